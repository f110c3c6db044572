// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robust starts along the odometry, and their refinement.
//!
//! A view may see only two or three landmarks, too few for a robust resection, and one outlier in a hundred rays is
//! enough to spoil a triangulation by least squares. So each view is placed by its motion and its bearings together,
//! with a robust loss on the bearings, and each landmark where most of its rays meet.

use super::super::grow::score;
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::result::Reconstruction;
use super::super::robust::consensus::{cauchy_consensus, with_cauchy, with_squares};
use super::super::robust::expand::extend;
use super::super::robust::motions::{OdometryLink, moved};
use super::super::robust::options::RobustOptions;
use super::super::robust::place::{place_landmark, sets};
use super::super::robust::reassign::reestimate_each;
use super::super::robust::solve::{check_sigmas, reconstruction};
use super::super::stages::StageOptions;
use super::choices::Choices;
use super::frames::{Shared, laid_over};
use super::growth::{Placement, grow_from_priors};
use super::sweeps::sweep_odometry;
use crate::error::Error;
use crate::geometry::Pose;
use crate::kernels::triangulate;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Landmarks in a sample for joining two pieces: two determine a similarity. Not an option: the size of an array.
const FIXING: usize = 2;

/// Maps from all that is known, the largest first; none where nothing is known besides bearings.
///
/// # Errors
/// [`Error::Interrupted`], [`Error::OutOfMemory`] and [`Error::SigmaTooLarge`].
pub fn robust_starts(
    problem: &Problem,
    seeds: &[Map],
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    check_sigmas(problem)?;
    let mut placement = RobustPlacement {
        problem,
        options: with_cauchy(options),
        random: ChaCha8Rng::seed_from_u64(options.seed),
    };
    let (stages, choices) = (&options.stages, &mut Choices::best());
    grow_from_priors(problem, &mut placement, seeds, stages, choices, progress)
}

/// The robust placement.
struct RobustPlacement<'a> {
    problem: &'a Problem,
    /// With a loss for the refinements on the way that outliers hardly move.
    options: SolveOptions,
    random: ChaCha8Rng,
}

impl RobustPlacement<'_> {
    /// Places a landmark where most of its rays meet, if enough of them do and with enough parallax.
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

    fn place_landmarks(&mut self, map: &mut Map, stays: &dyn Fn(usize) -> bool) {
        for landmark in (0..self.problem.landmarks()).filter(|&landmark| !stays(landmark)) {
            self.place_landmark(map, landmark);
        }
    }

    /// By the pair of shared landmarks, or by all of them, whichever gives the joined map the best score.
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

/// The map at the fixed point that a start leads to, with odometry and priors; `None` when there is none.
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
    let found = cauchy_consensus(problem, start.clone(), f64::INFINITY, options)?;
    let Some(consensus) = found else {
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
