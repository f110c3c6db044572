// SPDX-License-Identifier: MIT OR Apache-2.0
//! Growth by least squares: what is placed fits within a multiple of the noise that the map has shown so far.

use super::gates::{Fit, noise, range_variance};
use super::growth::PlaceEstimator;
use super::options::IncrementalOptions;
use super::place;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Pose;
use crate::lm::RefineOptions;
use crate::problem::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Map, Problem};
use nalgebra::Point2;

/// Places by least squares.
pub struct LeastSquaresPlaces<'a> {
    problem: &'a Problem,
    options: &'a IncrementalOptions,
    refine: &'a RefineOptions,
    /// Expected root mean square of residuals over sigma.
    noise: f64,
}

impl<'a> LeastSquaresPlaces<'a> {
    pub fn new(
        problem: &'a Problem,
        options: &'a IncrementalOptions,
        refine: &'a RefineOptions,
    ) -> Self {
        Self {
            problem,
            options,
            refine,
            noise: 0.0,
        }
    }
}

impl PlaceEstimator for LeastSquaresPlaces<'_> {
    fn refine_options(&self) -> RefineOptions {
        *self.refine
    }

    fn observe(&mut self, map: &Map) {
        self.noise = noise(self.problem, map, self.options);
    }

    fn variance(&self, _map: &Map) -> f64 {
        self.noise * self.noise
    }

    fn place_view(&mut self, map: &Map, view: usize, gate: usize) -> Option<(Pose<f64>, f64)> {
        if map.connections_of_view(self.problem, view) < self.options.landmarks_of_view[gate] {
            return None;
        }
        let (found, pose, fit) = place::place_view(self.problem, map, view)?;
        let count = fit.count as f64;
        let weight = self.problem.of_view(view)[0].weight;
        let held = found.gap * count.sqrt() * weight / self.noise;
        let last = gate + 1 == self.options.gates.len();
        let fits = fit.passes(MIN_LANDMARKS_OF_VIEW, self.noise, self.options.gates[gate]);
        (fits && (last || held * self.options.max_deviation > 1.0)).then_some((pose, held))
    }

    fn place_landmark(&mut self, map: &Map, landmark: usize) -> Option<Point2<f64>> {
        let (point, fit) = place::place_landmark(self.problem, map, landmark)?;
        let variance = range_variance(self.problem, map, landmark, &point);
        let bound = self.options.max_deviation / self.noise;
        (fit.passes(MIN_VIEWS_OF_LANDMARK, self.noise, self.options.gates[0])
            && variance < bound * bound)
            .then_some(point)
    }

    fn keeps_view(&self, map: &Map, view: usize, pose: &Pose<f64>) -> bool {
        let fit = Fit::of_view(self.problem, map, view, pose);
        fit.passes(MIN_LANDMARKS_OF_VIEW, self.noise, self.options.gates[0])
    }

    fn keeps_landmark(&self, map: &Map, landmark: usize, point: &Point2<f64>) -> bool {
        let fit = Fit::of_landmark(self.problem, map, landmark, point);
        fit.passes(MIN_VIEWS_OF_LANDMARK, self.noise, self.options.gates[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// A landmark is placed when its rays determine its range, and fit.
    #[test]
    fn a_landmark_is_placed_with_enough_parallax() {
        let (options, refine) = (IncrementalOptions::default(), RefineOptions::default());
        // In units of the range, two rays have a standard deviation of sqrt(2) sigma over the sine of their angle.
        let angle = (2.0_f64.sqrt() * 0.01 / options.max_deviation).asin();
        for (share, off, placed) in [
            (1.1, 0.0, true),
            (0.9, 0.0, false),
            (5.0, 0.0, true),
            (5.0, 0.6, false),
        ] {
            let half = (0.5 * angle * share).tan();
            let at = |x: f64| Some(crate::geometry::pose(x, 0.0, 0.0));
            let map = Map {
                poses: alloc::vec![at(-half), at(half), at(0.0)],
                landmarks: alloc::vec![None],
            };
            let truth = Point2::new(0.0, 1.0);
            let bearing = |k: usize| {
                let pose = map.poses[k].unwrap();
                crate::geometry::bearing_to(&pose, &truth).unwrap().angle()
            };
            let bearings = [
                bearing(0),
                bearing(1),
                if off > 0.0 {
                    bearing(2) + off
                } else {
                    f64::NAN
                },
            ];
            let problem = Problem::dense(3, 1, &bearings, 0.01).unwrap();
            let mut places = LeastSquaresPlaces::new(&problem, &options, &refine);
            places.noise = 1.0;
            assert_eq!(
                places.place_landmark(&map, 0).is_some(),
                placed,
                "{share} {off}"
            );
            if off == 0.0 {
                assert!(places.keeps_landmark(&map, 0, &truth));
                assert!(!places.keeps_landmark(&map, 0, &Point2::new(0.5, 1.0)));
            }
        }
    }

    /// A view is placed when it sees enough at its gate, fits, and is held; at the last gate if it can be placed at all.
    #[test]
    fn a_view_is_placed_within_its_gate() {
        let scene = simulate(Layout::Enclosed, 2, 9, 0.0, 2, Arena::default()).unwrap();
        let (options, refine) = (IncrementalOptions::default(), RefineOptions::default());
        let placed = |seen: usize, off: f64, gate: usize, noise: f64| {
            let mut bearings = scene.bearings.clone();
            bearings[seen..9].fill(f64::NAN);
            bearings[0] += off;
            let problem = Problem::dense(2, 9, &bearings, 0.01).unwrap();
            let mut map = scene.map();
            map.poses[0] = None;
            let mut places = LeastSquaresPlaces::new(&problem, &options, &refine);
            places.noise = noise;
            places.place_view(&map, 0, gate).is_some()
        };
        for (seen, off, noise, gates) in [
            (9, 0.0, 1.0, [true, true, true]),
            (4, 0.0, 1.0, [true, true, true]),
            (3, 0.0, 1.0, [false, false, true]),
            (2, 0.0, 1.0, [false, false, false]),
            (9, 0.3, 1.0, [false, true, true]),
            (9, 0.9, 1.0, [false, false, true]),
            // With so much noise the heading is not held.
            (9, 0.0, 60.0, [false, false, true]),
        ] {
            let found = [0, 1, 2].map(|gate| placed(seen, off, gate, noise));
            assert_eq!(found, gates, "{seen} {off} {noise}");
        }
    }
}
