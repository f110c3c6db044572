// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a robust map minimises: squared errors, none of which counts for more than an outlier's.

use crate::estimation::{Loss, Map, Problem, Seen, cost_of_ties};
use crate::geometry::Pose;
use crate::scalar::Real;
use alloc::vec::Vec;
use nalgebra::Point2;

/// Standard deviations beyond which a bearing is an outlier.
pub const OUTLIER: f64 = Loss::<f64>::TRUNCATED;

/// The square of residual over sigma of one sighting: the only place that says what it is for a bearing
/// to agree with a pose and a landmark.
#[inline]
pub fn square<T: Real>(
    problem: &Problem<T>,
    seen: &Seen<T>,
    pose: &Pose<T>,
    point: &Point2<T>,
) -> T {
    let residual = problem.residual(pose, point, seen) * seen.weight;
    residual * residual
}

/// The same for each sighting of a problem, in their order; `None` where an end is undetermined.
pub fn squares<'a, T: Real>(
    problem: &'a Problem<T>,
    map: &'a Map<T>,
) -> impl Iterator<Item = Option<T>> + 'a {
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
pub fn cost<T: Real>(problem: &Problem<T>, map: &Map<T>, bound: f64) -> T {
    let most = T::lit(bound * bound);
    let bearings = squares(problem, map).fold(T::zero(), |sum, square| {
        sum + square.map_or(most, |square| square.min(most))
    });
    bearings * T::lit(0.5) + cost_of_ties(problem, map)
}

/// The sightings that a map explains to within `bound` standard deviations.
pub fn inliers<T: Real>(problem: &Problem<T>, map: &Map<T>, bound: f64) -> Vec<bool> {
    let most = T::lit(bound * bound);
    squares(problem, map)
        .map(|square| square.is_some_and(|square| square <= most))
        .collect()
}
