// SPDX-License-Identifier: MIT OR Apache-2.0
//! How well the bearings fix a map, from the normal equations.

use super::bundle::{Bundle, Rows};
use super::cholesky;
use super::linearized::{centroid, spread};
use super::loss::Loss;
use super::map::Map;
use super::problem::Problem;
use crate::scalar::Real;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::Vector2;

/// Sums of predicted variances, for residuals of one sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variances<T: Real> {
    /// Of all coordinates of views and landmarks.
    pub positions: T,
    /// Of the headings \[rad^2\].
    pub headings: T,
}

/// Most parameters for which the variances are computed.
pub const MAX_PARAMETERS: usize = 1024;

/// Predicted variances of a complete map after the similarity that fits its positions best, (T24).
///
/// `None` when the bearings leave more than the similarity free, or there are too many parameters.
pub fn aligned_variances<T: Real>(problem: &Problem<T>, map: &Map<T>) -> Option<Variances<T>> {
    let bundle = Bundle::from_map(map);
    let (views, landmarks) = (problem.views(), problem.landmarks());
    let size = 3 * views + 2 * landmarks;
    if size > MAX_PARAMETERS || !map.is_complete() {
        return None;
    }
    let mut rows = Rows::of(problem);
    bundle.linearize(problem, Loss::Squared, &mut rows);
    let mut matrix = vec![T::zero(); size * size];
    for (s, row) in problem.sightings().iter().zip(&rows.sightings) {
        let (p, x) = (3 * s.view, 3 * views + 2 * s.landmark);
        let [dx, dy, turn] = row.pose();
        let [gx, gy] = row.landmark();
        add_product(
            &mut matrix,
            size,
            &[p, p + 1, p + 2, x, x + 1],
            &[dx, dy, turn, gx, gy],
        );
    }
    // The harmonic mean of what is known of each parameter when all others are: a landmark close to a
    // view does not count for more than it should.
    let known: Vec<T> = (0..size).map(|k| matrix[k * size + k]).collect();
    let stiffness =
        T::lit(size as f64) / known.iter().fold(T::zero(), |sum, k| sum + T::one() / *k);
    // Where the positions are in the list of parameters, and what is done to them by the similarity.
    let place = |k: usize| if k < views { 3 * k } else { views + 2 * k };
    let positions: Vec<Vector2<T>> = bundle
        .poses
        .iter()
        .map(|pose| pose.translation.vector)
        .chain(bundle.landmarks.iter().map(|point| point.coords))
        .collect();
    let (middle, square) = (centroid(&positions), spread(&positions));
    let count = T::lit(positions.len() as f64);
    for direction in 0..4 {
        let norm = if direction < 2 { count } else { square };
        let mut row = vec![T::zero(); size];
        for (k, position) in positions.iter().enumerate() {
            let offset = position - middle;
            let moved = match direction {
                0 => Vector2::x(),
                1 => Vector2::y(),
                2 => Vector2::new(-offset.y, offset.x),
                _ => offset,
            };
            row[place(k)] = moved.x;
            row[place(k) + 1] = moved.y;
        }
        let scale = (stiffness / norm).sqrt();
        let places: Vec<usize> = (0..size).collect();
        let row: Vec<T> = row.into_iter().map(|entry| entry * scale).collect();
        add_product(&mut matrix, size, &places, &row);
    }
    if !cholesky::factorize(&mut matrix, size) {
        return None;
    }
    // A pivot that is rounding: the bearings leave more than the similarity free.
    let rounding = T::eps() * T::lit(size as f64);
    let free = |k: usize| {
        let inverse = matrix[k * size + k];
        !(inverse * inverse * known[k] * rounding < T::one())
    };
    if (0..size).any(free) {
        return None;
    }
    let diagonal = cholesky::inverse_diagonal(&matrix, size);
    let mut sums = Variances {
        // What the stiffness has added along the similarity.
        positions: -T::lit(4.0) / stiffness,
        headings: -T::lit(views as f64) / (square * stiffness),
    };
    for (k, &variance) in diagonal.iter().enumerate() {
        let turns = k < 3 * views && k % 3 == 2;
        if turns {
            sums.headings += variance;
        } else {
            sums.positions += variance;
        }
    }
    (sums.positions > T::zero() && sums.headings > T::zero()).then_some(sums)
}

/// Adds the product of a row with itself to the lower triangle of a row-major matrix.
pub fn add_product<T: Real>(matrix: &mut [T], size: usize, places: &[usize], row: &[T]) {
    for (&i, &a) in places.iter().zip(row) {
        for (&j, &b) in places.iter().zip(row) {
            if j <= i {
                matrix[i * size + j] += a * b;
            }
        }
    }
}
