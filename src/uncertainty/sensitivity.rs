// SPDX-License-Identifier: MIT OR Apache-2.0
//! How sensitive a map is to noise, in the direction that the bearings determine least.

use super::weak_directions::{Eigenpair, weakest};
use crate::adjustment::bundle::{Bundle, Rows};
use crate::adjustment::elimination::{GroupedSightings, gauge, keeps_landmarks, kept_positions};
use crate::adjustment::gauge::gauge_directions;
use crate::adjustment::normal_equations::Normal;
use crate::adjustment::refine::is_sparse;
use crate::adjustment::schur::{Grouped, Schur};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::spread;
use crate::lm::Loss;
use crate::problem::{Map, Problem, Subject};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{Matrix2, Vector2};

/// How sensitive a refined map is to noise in the direction that the bearings determine least: the
/// predicted standard deviation of the map over its size, for residuals of one sigma; or that of the
/// position of a single view, where that is more.
///
/// Infinite when the direction is free, up to rounding: above about `1 / (8 sqrt(eps))` per radian
/// the value is mostly rounding.
pub fn sensitivity(problem: &Problem, map: &Map) -> f64 {
    let restricted;
    let active = if map.is_complete() {
        problem
    } else {
        restricted = map.restrict(problem);
        &restricted
    };
    let bundle = Bundle::from_map(map);
    if is_sparse(active) {
        weakest_of_all(&bundle, active)
    } else if keeps_landmarks(active) {
        weakest_kept::<3, 2>(&bundle, active)
    } else {
        weakest_kept::<2, 3>(&bundle, active)
    }
}

/// A sighting over less than this fraction of the map's size is left out. It says little more than that view and
/// landmark are in one place, and beside its huge weight the others would be lost in rounding.
const TOUCHING: f64 = 1e-4;

/// The sensitivity of the views, by the sparse normal equations.
fn weakest_of_all(bundle: &Bundle, problem: &Problem) -> f64 {
    let places = kept_positions::<3>(bundle);
    let size = spread(&places);
    let rows = without_touching(bundle, problem, size, places.len());
    let Some(mut normal) = Normal::new(problem) else {
        return f64::NAN;
    };
    normal.assemble(&rows, &gauge_directions(problem, bundle));
    if !normal.factorize(0.0) {
        return f64::INFINITY;
    }
    let square = |pair: &Eigenpair| {
        let views = pair.direction.chunks_exact(3).take(places.len());
        views
            .map(|step| step[0] * step[0] + step[1] * step[1])
            .sum::<f64>()
    };
    let Ok(found) = weakest(&normal, LOOKED_AT, &mut || Ok(())) else {
        return f64::INFINITY;
    };
    let largest = found.iter().map(square).fold(0.0, f64::max);
    (largest / size).sqrt()
}

/// Number of weakest directions among which the one that moves the views most is chosen: weak landmarks may come
/// before it.
const LOOKED_AT: usize = 8;

/// The problem linearised, without sightings over almost no distance.
fn without_touching(bundle: &Bundle, problem: &Problem, size: f64, count: usize) -> Rows {
    let mut rows = Rows::of(problem);
    bundle.linearize(problem, Loss::Squared, &mut rows);
    let limit = (count as f64 / (TOUCHING * TOUCHING)) / size;
    for row in &mut rows.sightings {
        if row.gradient.norm_squared() > limit * row.weight * row.weight {
            row.gradient = Vector2::zeros();
            row.weight = 0.0;
        }
    }
    rows
}

fn weakest_kept<const E: usize, const K: usize>(bundle: &Bundle, problem: &Problem) -> f64
where
    for<'x> GroupedSightings<'x>: Grouped<E, K>,
{
    let points = kept_positions::<K>(bundle);
    let size = spread(&points);
    let rows = without_touching(bundle, problem, size, points.len());
    let grouped = GroupedSightings {
        problem,
        rows: &rows.sightings,
    };
    let mut schur = Schur::<E, K>::new();
    if !schur.factorize(&grouped, 0.0, &gauge::<K>(bundle)) {
        return f64::INFINITY;
    }
    let direction = weakest_direction(&schur);
    let square = |block: &[f64]| block[0] * block[0] + block[1] * block[1];
    let spread = direction
        .chunks_exact(K)
        .fold(0.0, |sum, block| sum + square(block));
    // A single view may be weaker than that although all landmarks are well determined. Single landmarks are
    // found by `unbounded_landmarks`.
    let mean = size / (points.len() as f64);
    let loosest = if E == 3 {
        let variances = schur.blocks().iter().map(|block| block.position_variance());
        variances.fold(0.0, f64::max) / mean
    } else {
        0.0
    };
    (spread / size).max(loosest).sqrt()
}

/// Steps of inverse iteration in [`weakest_direction`]: enough to know its length to a few percent.
const WEAKEST_STEPS: usize = 6;

/// The direction in which the data determine the kept blocks least, as a displacement one standard
/// deviation long when residuals have unit variance.
///
/// (T16): inverse iteration on the reduced matrix with its parameters in units of their conditional
/// standard deviations; needs [`Schur::factorize`] without damping.
fn weakest_direction<const E: usize, const K: usize>(schur: &Schur<E, K>) -> Vec<f64> {
    let size = schur.size();
    let units: Vec<f64> = (0..size).map(|k| schur.information(k).sqrt()).collect();
    let mut vector: Vec<f64> = (0..size)
        .map(|k| 1.0 + 0.1 * ((7 * k + 3) % 11) as f64)
        .collect();
    let mut gain = 1.0;
    for _ in 0..WEAKEST_STEPS {
        let norm = vector.iter().fold(0.0, |s, v| s + *v * *v).sqrt();
        let mut next = vec![0.0; size];
        for k in 0..size {
            vector[k] /= norm;
            next[k] = vector[k] * units[k];
        }
        schur.solve_reduced(&mut next);
        gain = 0.0;
        for k in 0..size {
            next[k] *= units[k];
            gain += next[k] * vector[k];
        }
        vector = next;
    }
    let norm = vector.iter().fold(0.0, |s, v| s + *v * *v).sqrt();
    let length = gain.max(0.0).sqrt() / norm;
    for (v, unit) in vector.iter_mut().zip(&units) {
        *v *= length / *unit;
    }
    vector
}

/// The landmarks of a refined map of which only the direction is known: with the views held fixed, the
/// predicted standard deviation of their range exceeds the range itself. Their rays are parallel
/// within their noise, and the position along them where the refinement stopped is arbitrary.
///
/// `variance` is that of the residuals over sigma.
pub fn unbounded_landmarks(problem: &Problem, map: &Map, variance: f64) -> Vec<usize> {
    let mut found = Vec::new();
    let known = |landmark: usize| {
        let subject = Some(Subject::Landmark(landmark));
        problem
            .priors()
            .iter()
            .any(|prior| prior.subjects()[0] == subject)
    };
    for (landmark, point) in map.landmarks.iter().enumerate() {
        let Some(point) = point else { continue };
        let mut information = Matrix2::zeros();
        for (pose, s) in map.rays(problem, landmark) {
            let offset = point.coords - pose.translation.vector;
            let square = offset.norm_squared();
            // Multiplied by the range: information about the position in units of the range.
            let gradient = Vector2::new(-offset.y, offset.x) * (s.weight / square.sqrt());
            information += gradient * gradient.transpose();
        }
        // In a narrow bundle of rays this is the smaller eigenvalue.
        let trace = information.trace();
        let determinant = information.determinant().max(0.0);
        let held = determinant / trace;
        if trace > 0.0 && held < variance && !known(landmark) {
            found.push(landmark);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// The ways to compute it, each for problems of any size.
    const WAYS: [fn(&Bundle, &Problem) -> f64; 3] =
        [weakest_of_all, weakest_kept::<3, 2>, weakest_kept::<2, 3>];

    /// A standard deviation over the size of the map: proportional to that of the bearings, and the same in any unit of
    /// length.
    #[test]
    fn sensitivity_is_relative_to_the_size_of_the_map() {
        let scene = simulate(Layout::Mixed, 7, 9, 0.0, 2, Arena::default()).unwrap();
        let problem = |sigma| Problem::dense(7, 9, &scene.bearings, sigma).unwrap();
        let mut bundle = Bundle::from_map(&scene.map());
        let before = WAYS.map(|way| way(&bundle, &problem(0.01)));
        for (scale, sigma) in [(1000.0, 0.01), (1e-6, 0.01), (1.0, 0.03)] {
            bundle.scale(scale);
            for (k, (way, before)) in WAYS.iter().zip(before).enumerate() {
                let ratio = way(&bundle, &problem(sigma)) / before;
                // Not to the last digit: between these units one of them changes by 12 percent.
                assert!(
                    (ratio / (sigma / 0.01) - 1.0).abs() < 0.25,
                    "{k} {scale}: {ratio}"
                );
            }
        }
    }
}
