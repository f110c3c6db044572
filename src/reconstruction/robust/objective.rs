// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a robust map minimises: squared errors, none of which counts for more than an outlier's.

use crate::adjustment::cost_of_ties;
use crate::geometry::Pose;
use crate::lm::Loss;
use crate::problem::{Map, Problem, Seen};
use alloc::vec::Vec;
use nalgebra::Point2;

/// Standard deviations beyond which a bearing is an outlier.
pub const OUTLIER: f64 = Loss::<f64>::TRUNCATED;

/// The square of residual over sigma of one sighting: the only place that says what it is for a bearing
/// to agree with a pose and a landmark.
#[inline]
pub fn square(problem: &Problem, seen: &Seen, pose: &Pose<f64>, point: &Point2<f64>) -> f64 {
    let residual = problem.residual(pose, point, seen) * seen.weight;
    residual * residual
}

/// The same for each sighting of a problem, in their order; `None` where an end is undetermined.
pub fn squares<'a>(problem: &'a Problem, map: &'a Map) -> impl Iterator<Item = Option<f64>> + 'a {
    problem
        .sightings()
        .iter()
        .map(|s| match (&map.poses[s.view], &map.landmarks[s.landmark]) {
            (Some(pose), Some(point)) => Some(square(problem, s, pose, point)),
            _ => None,
        })
}

/// Half the sum of the squares, none of which counts for more than that of `bound`; a sighting that the
/// map does not reach counts that much. Odometry and priors count in full.
pub fn cost(problem: &Problem, map: &Map, bound: f64) -> f64 {
    let most = bound * bound;
    let bearings = squares(problem, map).fold(0.0, |sum, square| {
        sum + square.map_or(most, |square| square.min(most))
    });
    bearings * 0.5 + cost_of_ties(problem, map)
}

/// The sightings that a map explains to within `bound` standard deviations.
pub fn inliers(problem: &Problem, map: &Map, bound: f64) -> Vec<bool> {
    let most = bound * bound;
    squares(problem, map)
        .map(|square| square.is_some_and(|square| square <= most))
        .collect()
}
