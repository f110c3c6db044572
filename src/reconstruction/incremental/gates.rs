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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::simulate::{Arena, Layout, simulate};
    use alloc::vec::Vec;
    use core::f64::consts::FRAC_PI_2;

    /// Four residuals of one sigma, of which a view takes three: the gate is in units of the noise.
    #[test]
    fn a_fit_passes_within_the_gate() {
        let fit = Fit::of([1.0, -1.0, 1.0, -1.0].into_iter());
        assert_eq!((fit.squares, fit.count), (4.0, 4));
        for (parameters, gate, passes) in [
            (0, 1.01, true),
            (0, 0.99, false),
            (2, 1.42, true),
            (2, 1.41, false),
            (3, 2.01, true),
            (3, 1.99, false),
            // At least one degree of freedom.
            (5, 2.01, true),
            (5, 1.99, false),
        ] {
            assert_eq!(
                fit.passes(parameters, 1.0, gate),
                passes,
                "{parameters} {gate}"
            );
            assert_eq!(fit.passes(parameters, 0.1, 10.0 * gate), passes);
        }
    }

    /// Two views at right angles around a landmark two away from each: the range is known up to sigma.
    #[test]
    fn the_variance_of_the_range_is_that_of_the_rays() {
        let point = Point2::new(2.0, 2.0);
        let map = |angle: f64| Map {
            poses: Vec::from([
                Some(pose(2.0, 0.0, 0.1)),
                Some(pose(2.0 + 2.0 * angle.sin(), 2.0 - 2.0 * angle.cos(), 0.2)),
                None,
            ]),
            landmarks: Vec::from([None]),
        };
        let problem = Problem::dense(3, 1, &[0.1, 0.2, 0.3], 0.01).unwrap();
        // Both eigenvalues of the information are one over the variance, and the trace is their sum.
        let found = range_variance(&problem, &map(FRAC_PI_2), 0, &point);
        assert!((found / (2.0 * 1e-4) - 1.0).abs() < 1e-12);
        // Nearly parallel, the range has the variance of two rays at that angle.
        let found = range_variance(&problem, &map(0.02), 0, &point);
        assert!((found / (2.0 * 1e-4 / 0.02_f64.sin().powi(2)) - 1.0).abs() < 1e-6);
        assert_eq!(
            range_variance(&problem, &map(0.0), 0, &point),
            f64::INFINITY
        );
    }

    /// The noise is what is expected before there are residuals, and that of the residuals once there are many.
    #[test]
    fn the_noise_is_expected_until_it_is_observed() {
        let options = IncrementalOptions::default();
        let scene = simulate(Layout::Enclosed, 20, 30, 0.05, 3, Arena::default()).unwrap();
        let problem = Problem::dense(20, 30, &scene.bearings, 0.01).unwrap();
        let nothing = noise(&problem, &Map::empty(20, 30), &options);
        let expected = options.expected_noise / 0.01;
        let four = (options.expected_count / (4.0 + options.expected_count)).sqrt();
        assert!(
            (nothing / (expected * four) - 1.0).abs() < 1e-12,
            "{nothing}"
        );
        let truth = noise(&problem, &scene.map(), &options);
        let squares: f64 = scene
            .map()
            .residuals(&problem)
            .flatten()
            .map(|r| r * r * 1e4)
            .sum();
        let weight = options.expected_count;
        let freedom = (600 + 4 - 60 - 60) as f64;
        let mean = (squares + expected * expected * weight) / (freedom + weight);
        assert!((truth / mean.sqrt() - 1.0).abs() < 1e-12, "{truth}");
        // Of a map with nothing to spare.
        let few = Problem::dense(1, 1, &[-0.1], 0.01).unwrap();
        let map = Map {
            poses: Vec::from([Some(pose(0.0, 0.0, 0.1))]),
            landmarks: Vec::from([Some(Point2::new(1.0, 0.0))]),
        };
        let found = noise(&few, &map, &options);
        assert!((found / expected - 1.0).abs() < 1e-9, "{found}");
    }
}
