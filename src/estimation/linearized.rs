// SPDX-License-Identifier: MIT OR Apache-2.0
//! The linearised problem, grouped by either end of its sightings, and its gauge.

use super::bundle::{Bundle, Row};
use super::problem::Problem;
use super::schur::{Grouped, Slot};
use crate::scalar::Real;
use alloc::vec::Vec;
use nalgebra::{DMatrix, Vector2};

/// Whether eliminating the poses leaves the smaller system.
pub fn keeps_landmarks<T: Real>(problem: &Problem<T>) -> bool {
    2 * problem.landmarks() <= 3 * problem.views()
}

/// All sightings linearised, to be grouped by either end.
pub struct Linearized<'a, T: Real> {
    pub problem: &'a Problem<T>,
    pub rows: &'a [Row<T>],
}

/// Grouped by view: poses go, landmarks stay.
impl<T: Real> Grouped<T, 3, 2> for Linearized<'_, T> {
    fn groups(&self) -> usize {
        self.problem.views()
    }

    fn sightings(&self) -> usize {
        self.rows.len()
    }

    fn kept(&self) -> usize {
        self.problem.landmarks()
    }

    #[inline]
    fn group(&self, view: usize) -> impl Iterator<Item = Slot<T, 3, 2>> {
        let range = self.problem.range_of_view(view);
        self.problem.sightings()[range.clone()]
            .iter()
            .zip(&self.rows[range])
            .map(|(s, row)| Slot {
                kept: s.landmark,
                gone: row.pose(),
                stay: row.landmark(),
                residual: row.residual,
            })
    }
}

/// Grouped by landmark: landmarks go, poses stay.
impl<T: Real> Grouped<T, 2, 3> for Linearized<'_, T> {
    fn groups(&self) -> usize {
        self.problem.landmarks()
    }

    fn sightings(&self) -> usize {
        self.rows.len()
    }

    fn kept(&self) -> usize {
        self.problem.views()
    }

    #[inline]
    fn group(&self, landmark: usize) -> impl Iterator<Item = Slot<T, 2, 3>> {
        self.problem.of_landmark(landmark).iter().map(|&k| Slot {
            kept: self.problem.sightings()[k].view,
            gone: self.rows[k].landmark(),
            stay: self.rows[k].pose(),
            residual: self.rows[k].residual,
        })
    }
}

/// The directions of translation, rotation and scaling of the blocks that stay, (T14): orthonormal rows.
pub fn gauge<T: Real, const K: usize>(bundle: &Bundle<T>) -> DMatrix<T> {
    let points = kept_positions::<T, K>(bundle);
    let count = T::lit(points.len() as f64);
    let centre = centroid(&points);
    let spread = spread(&points);
    // Norms of the four directions; headings turn along.
    let turned = if K == 2 { spread } else { spread + count };
    let [shift, turn, grow] = [count, turned, spread].map(|square| {
        if square > T::zero() {
            T::one() / square.sqrt()
        } else {
            T::zero()
        }
    });
    let mut directions = DMatrix::zeros(4, points.len() * K);
    for (k, point) in points.iter().enumerate() {
        let p = point - centre;
        directions[(0, K * k)] = shift;
        directions[(1, K * k + 1)] = shift;
        directions[(2, K * k)] = -p.y * turn;
        directions[(2, K * k + 1)] = p.x * turn;
        if K == 3 {
            directions[(2, K * k + 2)] = turn;
        }
        directions[(3, K * k)] = p.x * grow;
        directions[(3, K * k + 1)] = p.y * grow;
    }
    directions
}

/// The positions of the blocks that stay: landmarks for `K` = 2, views for `K` = 3.
pub fn kept_positions<T: Real, const K: usize>(bundle: &Bundle<T>) -> Vec<Vector2<T>> {
    if K == 2 {
        bundle.landmarks.iter().map(|p| p.coords).collect()
    } else {
        bundle.poses.iter().map(|p| p.translation.vector).collect()
    }
}

pub fn centroid<T: Real>(points: &[Vector2<T>]) -> Vector2<T> {
    points.iter().fold(Vector2::zeros(), |sum, p| sum + p) / T::lit(points.len() as f64)
}

/// Sum of squared distances from the centroid.
pub fn spread<T: Real>(points: &[Vector2<T>]) -> T {
    let centre = centroid(points);
    points
        .iter()
        .fold(T::zero(), |sum, p| sum + (p - centre).norm_squared())
}
