// SPDX-License-Identifier: MIT OR Apache-2.0
//! Places of views and landmarks in a growing map where most bearings agree.

use super::super::incremental::gates::range_variance;
use super::super::incremental::growth::PlaceEstimator;
use super::super::options::SolveOptions;
use super::super::stages::StageOptions;
use super::consensus::{square, squares};
use super::place::{place_landmark, place_view};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Pose;
use crate::kernels::resect;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem};
use nalgebra::Point2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Places where most bearings agree.
pub struct ConsensusPlaces<'a> {
    problem: &'a Problem,
    /// With a loss for the refinements on the way that outliers hardly move.
    options: &'a SolveOptions,
    random: ChaCha8Rng,
}

impl<'a> ConsensusPlaces<'a> {
    pub fn new(problem: &'a Problem, options: &'a SolveOptions, seed: u64) -> Self {
        Self {
            problem,
            options,
            random: ChaCha8Rng::seed_from_u64(seed),
        }
    }
}

impl PlaceEstimator for ConsensusPlaces<'_> {
    fn refine_options(&self) -> RefineOptions {
        self.options.refine
    }

    /// Truncated: the branch that more bearings contradict is worse.
    fn variance(&self, map: &Map) -> f64 {
        let bound = self.options.stages.robust.growing_bound;
        let (sum, count) = squares(self.problem, map)
            .flatten()
            .fold((0.0, 0), |(sum, count), square| {
                (sum + square.min(bound * bound), count + 1)
            });
        sum / f64::from(count.max(1))
    }

    fn place_view(&mut self, map: &Map, view: usize, gate: usize) -> Option<(Pose<f64>, f64)> {
        let StageOptions {
            incremental,
            robust,
            ..
        } = &self.options.stages;
        let problem = self.problem;
        let bound = robust.gates[gate];
        let placed = place_view(problem, map, view, bound, 1, robust, &mut self.random);
        let placed = placed.first()?;
        let agreeing = || {
            let seen = map.seen(problem, view).zip(&placed.agreeing);
            seen.filter(|(_, agrees)| **agrees).map(|(seen, _)| seen)
        };
        let count = placed.count();
        if count < robust.agreeing_of_view || 2 * count < placed.agreeing.len() {
            return None;
        }
        let found = resect(agreeing().map(|(point, s)| (point, s.bearing))).ok()?;
        let weight = problem.of_view(view)[0].weight;
        let held = found.gap * (count as f64).sqrt() * weight;
        (held * incremental.max_deviation > 1.0).then_some((placed.place, held))
    }

    fn place_landmark(&mut self, map: &Map, landmark: usize) -> Option<Point2<f64>> {
        let StageOptions {
            incremental,
            robust,
            ..
        } = &self.options.stages;
        let bound = robust.growing_bound;
        let placed = place_landmark(
            self.problem,
            map,
            landmark,
            bound,
            1,
            robust,
            &mut self.random,
        );
        let placed = placed.first()?;
        let most = incremental.max_deviation * incremental.max_deviation;
        let held = range_variance(self.problem, map, landmark, &placed.place) < most;
        (held && placed.count() >= robust.agreeing_of_landmark).then_some(placed.place)
    }

    fn keeps_view(&self, map: &Map, view: usize, pose: &Pose<f64>) -> bool {
        let StageOptions { robust, .. } = &self.options.stages;
        let seen = map.seen(self.problem, view);
        let squares = seen.map(|(point, s)| square(self.problem, s, pose, &point));
        agree(squares, robust.growing_bound, robust.agreeing_of_view)
    }

    fn keeps_landmark(&self, map: &Map, landmark: usize, point: &Point2<f64>) -> bool {
        let StageOptions { robust, .. } = &self.options.stages;
        let rays = map.rays(self.problem, landmark);
        let squares = rays.map(|(pose, s)| square(self.problem, s, &pose, point));
        agree(squares, robust.growing_bound, robust.agreeing_of_landmark)
    }
}

/// Whether at least `least` of some squared residuals, and half of them, are within the bound.
fn agree(squares: impl Iterator<Item = f64>, bound: f64, least: usize) -> bool {
    let (mut agreeing, mut all) = (0, 0);
    for square in squares {
        agreeing += usize::from(square <= bound * bound);
        all += 1;
    }
    agreeing >= least && 2 * agreeing >= all
}
