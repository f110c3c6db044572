// SPDX-License-Identifier: MIT OR Apache-2.0
//! Predicted variances of a map that is aligned with the truth, from the normal equations.

use crate::adjustment::bundle::{Bundle, Rows};
use crate::adjustment::cholesky;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::{centroid, spread};
use crate::lm::Loss;
use crate::problem::{Map, Problem};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::Vector2;

/// Sums of predicted variances, for residuals of one sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variances {
    /// Of all coordinates of views and landmarks.
    pub positions: f64,
    /// Of the headings \[rad^2\].
    pub headings: f64,
}

/// Maximum number of parameters for which the variances are computed: a dense matrix of eight megabytes, and less than
/// a second.
pub const MAX_PARAMETERS: usize = 1024;

/// Predicted variances of a complete map after the similarity that fits its positions best, (T24).
///
/// `None` when the bearings leave more than the similarity free, or there are too many parameters.
pub fn aligned_variances(problem: &Problem, map: &Map) -> Option<Variances> {
    let bundle = Bundle::from_map(map);
    let (views, landmarks) = (problem.views(), problem.landmarks());
    let size = 3 * views + 2 * landmarks;
    if size > MAX_PARAMETERS || !map.is_complete() {
        return None;
    }
    let mut rows = Rows::of(problem);
    bundle.linearize(problem, Loss::Squared, &mut rows);
    let mut matrix = vec![0.0; size * size];
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
    // Stiffness along the similarity, which the bearings leave free: the harmonic mean of the diagonal, which the
    // huge entry of a landmark close to a view hardly changes.
    let known: Vec<f64> = (0..size).map(|k| matrix[k * size + k]).collect();
    let stiffness = (size as f64) / known.iter().fold(0.0, |sum, k| sum + 1.0 / *k);
    let positions: Vec<Vector2<f64>> = bundle
        .poses
        .iter()
        .map(|pose| pose.translation.vector)
        .chain(bundle.landmarks.iter().map(|point| point.coords))
        .collect();
    let square = spread(&positions);
    hold_similarity(&mut matrix, &positions, views, stiffness);
    if !cholesky::factorize(&mut matrix, size) {
        return None;
    }
    // If a pivot is only rounding, the bearings leave more than the similarity free.
    let rounding = f64::EPSILON * (size as f64);
    let free = |k: usize| {
        let inverse = matrix[k * size + k];
        !(inverse * inverse * known[k] * rounding < 1.0)
    };
    if (0..size).any(free) {
        return None;
    }
    let diagonal = cholesky::inverse_diagonal(&matrix, size);
    let mut sums = Variances {
        // Remove what the stiffness has added along the similarity.
        positions: -4.0 / stiffness,
        headings: -(views as f64) / (square * stiffness),
    };
    for (k, &variance) in diagonal.iter().enumerate() {
        let turns = k < 3 * views && k % 3 == 2;
        if turns {
            sums.headings += variance;
        } else {
            sums.positions += variance;
        }
    }
    (sums.positions > 0.0 && sums.headings > 0.0).then_some(sums)
}

/// Adds rows to the normal matrix that fix translation, rotation and scale of all positions, views first, each with
/// this stiffness.
fn hold_similarity(matrix: &mut [f64], positions: &[Vector2<f64>], views: usize, stiffness: f64) {
    let size = views + 2 * positions.len();
    let place = |k: usize| if k < views { 3 * k } else { views + 2 * k };
    let (middle, square) = (centroid(positions), spread(positions));
    let count = positions.len() as f64;
    let places: Vec<usize> = (0..size).collect();
    for direction in 0..4 {
        let norm = if direction < 2 { count } else { square };
        let mut row = vec![0.0; size];
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
        let row: Vec<f64> = row.into_iter().map(|entry| entry * scale).collect();
        add_product(matrix, size, &places, &row);
    }
}

/// Adds the product of a row with itself to the lower triangle of a row-major matrix.
pub fn add_product(matrix: &mut [f64], size: usize, places: &[usize], row: &[f64]) {
    for (&i, &a) in places.iter().zip(row) {
        for (&j, &b) in places.iter().zip(row) {
            if j <= i {
                matrix[i * size + j] += a * b;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::covariance::covariance;
    use super::super::frame::Frame;
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// They are the traces of the covariances after alignment with the truth.
    #[test]
    fn variances_are_the_traces_of_the_covariances() {
        for (views, landmarks, seed) in [(4, 9, 1), (9, 5, 2), (6, 8, 3)] {
            let scene =
                simulate(Layout::Mixed, views, landmarks, 0.0, seed, Arena::default()).unwrap();
            let problem = Problem::dense(views, landmarks, &scene.bearings, 0.01).unwrap();
            let map = scene.map();
            let found = aligned_variances(&problem, &map).unwrap();
            let full = covariance(&problem, &map, Loss::Squared, Frame::FreeNetwork, None).unwrap();
            let poses = full.poses.iter().flatten();
            let headings: f64 = poses.clone().map(|block| block[(2, 2)]).sum();
            let of_views: f64 = poses.map(|block| block[(0, 0)] + block[(1, 1)]).sum();
            let of_landmarks: f64 = full
                .landmarks
                .iter()
                .flatten()
                .map(|block| block.trace())
                .sum();
            let positions = of_views + of_landmarks;
            assert!(
                (found.positions / positions - 1.0).abs() < 1e-6,
                "{seed}: {} {positions}",
                found.positions
            );
            assert!(
                (found.headings / headings - 1.0).abs() < 1e-6,
                "{seed}: {} {headings}",
                found.headings
            );
            let mut part = map.clone();
            part.landmarks[1] = None;
            assert_eq!(aligned_variances(&problem, &part), None);
        }
        // Three views and four landmarks leave a direction free.
        let scene = simulate(Layout::Mixed, 3, 4, 0.0, 1, Arena::default()).unwrap();
        let problem = Problem::dense(3, 4, &scene.bearings, 0.01).unwrap();
        assert_eq!(aligned_variances(&problem, &scene.map()), None);
    }
}
