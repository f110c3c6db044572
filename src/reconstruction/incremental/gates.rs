// SPDX-License-Identifier: MIT OR Apache-2.0
//! How well a view or a landmark fits a map, and how well the map determines it.
//!
//! Residuals are divided by sigma, and bounds are multiples of the noise observed so far, because sigma may be
//! unknown.

use super::super::judge;
use super::options::IncrementalOptions;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Pose;
use crate::problem::{Map, Problem};
use nalgebra::{Matrix2, Point2, Vector2};

/// Sum of squared residuals over sigma, and their number.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    pub squares: f64,
    pub count: usize,
}

impl Fit {
    fn of(residuals: impl Iterator<Item = f64>) -> Self {
        let nothing = Self {
            squares: 0.0,
            count: 0,
        };
        residuals.fold(nothing, |fit, r| Self {
            squares: fit.squares + r * r,
            count: fit.count + 1,
        })
    }

    /// The fit of a view at a pose, over its landmarks in the map.
    pub fn of_view(problem: &Problem, map: &Map, view: usize, pose: &Pose<f64>) -> Self {
        let seen = map.seen(problem, view);
        Self::of(seen.map(|(point, s)| problem.residual(pose, &point, s) * s.weight))
    }

    /// The fit of a landmark at a position, over its views in the map.
    pub fn of_landmark(problem: &Problem, map: &Map, landmark: usize, point: &Point2<f64>) -> Self {
        let rays = map.rays(problem, landmark);
        Self::of(rays.map(|(pose, s)| problem.residual(&pose, point, s) * s.weight))
    }

    /// Whether the root mean square, after fitting this many parameters, is within `gate` times the noise.
    pub fn passes(&self, parameters: usize, noise: f64, gate: f64) -> bool {
        let freedom = self.count.saturating_sub(parameters).max(1);
        let bound = gate * noise;
        self.squares <= bound * bound * (freedom as f64)
    }
}

/// The noise of a map: root mean square of its residuals over sigma per degree of freedom, drawn
/// towards the expected noise while there are few.
pub fn noise(problem: &Problem, map: &Map, options: &IncrementalOptions) -> f64 {
    let (mut squares, mut weights, mut count) = (0.0, 0.0, 0);
    for (s, residual) in problem.sightings().iter().zip(map.residuals(problem)) {
        weights += s.weight * s.weight;
        if let Some(residual) = residual {
            let r = residual * s.weight;
            squares += r * r;
            count += 1;
        }
    }
    let parameters =
        3 * map.poses.iter().flatten().count() + 2 * map.landmarks.iter().flatten().count();
    let freedom = (count + 4_usize).saturating_sub(parameters) as f64;
    let all = problem.sightings().len().max(1) as f64;
    let expected = (options.expected_noise * options.expected_noise) * weights / all;
    let counted = options.expected_count;
    ((squares + expected * counted) / (freedom + counted)).sqrt()
}

/// The variance of residuals due to rounding, for the most precise of the bearings: maps that are compared may have
/// different sightings.
pub fn rounding(problem: &Problem) -> f64 {
    let weights = problem.sightings().iter();
    judge::rounding(weights.fold(0.0_f64, |most, s| most.max(s.weight)))
}

/// The relative variance of the range of a landmark, for residuals of one sigma and views held fixed:
/// infinite for parallel rays.
pub fn range_variance(problem: &Problem, map: &Map, landmark: usize, point: &Point2<f64>) -> f64 {
    let mut information = Matrix2::zeros();
    for (pose, s) in map.rays(problem, landmark) {
        let offset = point.coords - pose.translation.vector;
        let range = offset.norm();
        // Divided by the range once, not twice: information about the position in units of the range.
        let gradient = Vector2::new(-offset.y, offset.x) * (s.weight / range);
        information += gradient * gradient.transpose();
    }
    // The trace is the larger eigenvalue to within a factor of two.
    information.trace() / information.determinant().max(0.0)
}
