// SPDX-License-Identifier: MIT OR Apache-2.0
//! Starts along the odometry that outliers do not spoil, and what they lead to.
//!
//! A view may see two or three landmarks only, too few to place it without odometry, and one wrong ray in a hundred
//! is enough to spoil a triangulation by least squares. So each view is placed by its motion and its bearings
//! together, each bearing counting the less the worse it fits, and a landmark is where most of its rays meet.

use super::super::grow::score;
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::result::Reconstruction;
use super::super::robust::expand::extend;
use super::super::robust::motions::{OdometryLink, moved};
use super::super::robust::options::RobustOptions;
use super::super::robust::place::{place_landmark, sets};
use super::super::robust::reassign::reestimate_each;
use super::super::robust::solve::{check_sigmas, reconstruction, with_squares};
use super::super::stages::StageOptions;
use super::growth::{Placement, Shared, grow_along_odometry, laid_over};
use super::sweeps::{cauchy_consensus, sweep_odometry};
use crate::error::Error;
use crate::geometry::Pose;
use crate::kernels::triangulate;
use crate::lm::{Loss, RefineOptions};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Landmarks that lay one piece over another: as many as fix a similarity. No option: the size of an array.
const FIXING: usize = 2;

/// Maps along the odometry of a problem, the largest first; none where it has no odometry.
///
/// Priors are not looked at: the maps are in frames of their own.
///
/// # Errors
/// [`Error::Interrupted`], [`Error::OutOfMemory`] and [`Error::SigmaTooLarge`].
pub fn along_odometry(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    check_sigmas(problem)?;
    let problem = &problem.clone().with_odometry_only();
    let mut placement = RobustPlacement {
        problem,
        options: SolveOptions {
            refine: RefineOptions {
                loss: Loss::Cauchy(Loss::<f64>::CAUCHY),
                ..options.refine
            },
            ..*options
        },
        random: ChaCha8Rng::seed_from_u64(options.seed),
    };
    let growth = &options.stages.odometry_growth;
    grow_along_odometry(problem, &mut placement, growth, progress)
}

/// The placement that outliers do not spoil.
struct RobustPlacement<'a> {
    problem: &'a Problem,
    /// With a loss for the refinements on the way that outliers hardly move.
    options: SolveOptions,
    random: ChaCha8Rng,
}

impl RobustPlacement<'_> {
    /// Puts a landmark where most of its rays meet, if enough do and not too narrowly.
    fn place_landmark(&mut self, map: &mut Map, landmark: usize) {
        let StageOptions {
            robust: options,
            odometry_growth,
            ..
        } = &self.options.stages;
        let bound = options.growing_bound;
        let found = place_landmark(
            self.problem,
            map,
            landmark,
            bound,
            1,
            options,
            &mut self.random,
        );
        let Some(found) = found.first() else {
            return;
        };
        let rays = map.rays(self.problem, landmark).zip(&found.agreeing);
        let agreeing = rays
            .filter(|(_, agrees)| **agrees)
            .map(|((pose, s), _)| (pose, s.bearing));
        let parallax = triangulate(agreeing).map_or(0.0, |found| found.parallax);
        let held = found.count() >= options.agreeing_of_landmark
            && parallax > odometry_growth.min_parallax;
        map.landmarks[landmark] = held.then_some(found.place);
    }
}

impl Placement for RobustPlacement<'_> {
    fn refine_options(&self) -> RefineOptions {
        self.options.refine
    }

    fn next_refinement(&self, count: usize) -> usize {
        count + count / self.options.stages.robust_growth.part.max(1) + 1
    }

    fn place_view(&mut self, map: &Map, from: &Pose<f64>, motion: &OdometryLink) -> Pose<f64> {
        moved(
            self.problem,
            map,
            from,
            motion,
            self.options.stages.robust.motion_steps,
        )
    }

    fn place_landmarks_of(&mut self, map: &mut Map, view: usize) {
        let problem = self.problem;
        for s in problem.of_view(view) {
            if map.landmarks[s.landmark].is_none() {
                self.place_landmark(map, s.landmark);
            }
        }
    }

    fn place_landmarks(&mut self, map: &mut Map) {
        for landmark in 0..self.problem.landmarks() {
            self.place_landmark(map, landmark);
        }
    }

    /// By the two shared landmarks with which most bearings agree, or by all of them if that is better.
    fn join(&mut self, maps: [&Map; 2], shared: &[Shared]) -> Option<Map> {
        let mut best: Option<(f64, Map)> = None;
        let mut offer = |pairs: &[Shared]| {
            let Some(map) = laid_over(maps, pairs) else {
                return;
            };
            let score = score(self.problem, &map);
            if best.as_ref().is_none_or(|(least, _)| score < *least) {
                best = Some((score, map));
            }
        };
        offer(shared);
        let most = self.options.stages.robust_growth.pairs;
        sets(
            shared.len(),
            most,
            &mut self.random,
            |set: [usize; FIXING]| {
                offer(&set.map(|k| shared[k]));
            },
        );
        best.map(|(_, map)| map)
    }

    fn refines_joined(&self) -> bool {
        true
    }

    fn complete(&mut self, map: &mut Map) -> Result<(), Error> {
        extend(self.problem, map, &self.options, &mut self.random)
    }
}

/// Whether the search from bearings alone may reach most views: those that see landmarks enough to be
/// placed among outliers. Its work is quadratic in the views, and in vain where most cannot be placed.
pub fn is_searchable(problem: &Problem, options: &RobustOptions) -> bool {
    let enough = options.agreeing_of_view;
    let counts = (0..problem.views()).map(|view| problem.of_view(view).len());
    let enough = counts.clone().filter(|&count| count >= enough);
    2 * enough.count() > counts.filter(|&count| count > 0).count()
}

/// The map at the fixed point near a start, with odometry and priors; `None` when there is none.
///
/// # Errors
/// [`Error::Interrupted`], [`Error::OutOfMemory`] and [`Error::SigmaTooLarge`].
pub fn from_start(
    problem: &Problem,
    start: &Map,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    check_sigmas(problem)?;
    if !report_progress(progress, "improve", 0, 1) {
        return Err(Error::Interrupted);
    }
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let options = &with_squares(options);
    let Some(consensus) = cauchy_consensus(problem, start.clone(), options)? else {
        return Ok(None);
    };
    let consensus = reestimate_each(problem, consensus, options, &mut random, progress)?;
    let consensus = sweep_odometry(problem, consensus, options, &mut random, progress)?;
    Ok(Some(reconstruction(
        problem,
        &consensus,
        &options.stages.infinity,
    )))
}
