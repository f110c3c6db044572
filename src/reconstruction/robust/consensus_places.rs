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

#[cfg(test)]
mod tests {
    use super::*;

    /// At least so many sightings agree, and at least half of all.
    #[test]
    fn what_fits_agrees_with_half_of_its_sightings() {
        for (squares, least, agrees) in [
            (&[1.0, 4.0, 4.1][..], 2, true),
            (&[1.0, 4.0, 4.1], 3, false),
            (&[1.0, 4.0, 4.1, 9.0], 2, true),
            (&[1.0, 4.0, 4.1, 9.0, 9.0], 2, false),
            (&[], 0, true),
        ] {
            assert_eq!(
                agree(squares.iter().copied(), 2.0, least),
                agrees,
                "{squares:?}"
            );
        }
    }

    /// The mean square is truncated, of what the map has.
    #[test]
    fn the_variance_counts_an_outlier_no_more_than_the_bound() {
        let map = Map {
            poses: alloc::vec![Some(crate::geometry::pose(0.0, 0.0, 0.0))],
            landmarks: alloc::vec![
                Some(Point2::new(1.0, 0.0)),
                Some(Point2::new(2.0, 0.0)),
                None
            ],
        };
        let problem = Problem::dense(1, 3, &[0.02, 1.0, 0.0], 0.01).unwrap();
        let options = SolveOptions::default();
        let places = ConsensusPlaces::new(&problem, &options, 0);
        let bound = options.stages.robust.growing_bound;
        let expected = (4.0 + bound * bound) / 2.0;
        assert!((places.variance(&map) / expected - 1.0).abs() < 1e-9);
        assert_eq!(places.variance(&Map::empty(1, 3)), 0.0);
    }

    /// A view is placed by the bearings that agree, if they are one more than it needs and half of all.
    #[test]
    fn a_view_is_placed_by_most_of_its_bearings() {
        let arena = crate::simulate::Arena::default();
        let layout = crate::simulate::Layout::Enclosed;
        let scene = crate::simulate::simulate(layout, 2, 9, 0.0, 2, arena).unwrap();
        let options = SolveOptions::default();
        let placed = |outliers: usize, seen: usize| {
            let mut bearings = scene.bearings.clone();
            for (k, bearing) in bearings[..outliers].iter_mut().enumerate() {
                *bearing += 0.4 + 0.5 * k as f64;
            }
            bearings[seen..9].fill(f64::NAN);
            let problem = Problem::dense(2, 9, &bearings, 0.001).unwrap();
            let mut map = scene.map();
            map.poses[0] = None;
            let found = ConsensusPlaces::new(&problem, &options, 1).place_view(&map, 0, 0);
            found.map(|(pose, _)| {
                let error = scene.poses[0].inv_mul(&pose).translation.vector.norm();
                assert!(error < 1e-6, "{outliers} {seen}: {error}");
            })
        };
        for (outliers, seen, found) in [
            (0, 9, true),
            (4, 9, true),
            (5, 9, false),
            (0, 4, true),
            (1, 4, false),
            (0, 3, false),
        ] {
            assert_eq!(placed(outliers, seen).is_some(), found, "{outliers} {seen}");
        }
    }
}
