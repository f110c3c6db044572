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
