// SPDX-License-Identifier: MIT OR Apache-2.0
//! The choice of the blocks to eliminate, poses or landmarks: the sightings grouped by them, and the gauge of the
//! blocks that are kept.

use super::bundle::Bundle;
use super::schur::{Grouped, Slot};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::{centroid, spread};
use crate::lm::BearingRow;
use crate::problem::Problem;
use alloc::vec::Vec;
use nalgebra::{DMatrix, Vector2};

/// Whether poses are eliminated and landmarks kept, because that leaves the smaller system.
pub fn keeps_landmarks(problem: &Problem) -> bool {
    2 * problem.landmarks() <= 3 * problem.views()
}

/// All sightings linearised, grouped by view or by landmark.
pub struct GroupedSightings<'a> {
    pub problem: &'a Problem,
    pub rows: &'a [BearingRow],
}

/// Grouped by view: poses are eliminated, landmarks kept.
impl Grouped<3, 2> for GroupedSightings<'_> {
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
    fn group(&self, view: usize) -> impl Iterator<Item = Slot<3, 2>> {
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

/// Grouped by landmark: landmarks are eliminated, poses kept.
impl Grouped<2, 3> for GroupedSightings<'_> {
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
    fn group(&self, landmark: usize) -> impl Iterator<Item = Slot<2, 3>> {
        self.problem.of_landmark(landmark).iter().map(|&k| Slot {
            kept: self.problem.sightings()[k].view,
            gone: self.rows[k].landmark(),
            stay: self.rows[k].pose(),
            residual: self.rows[k].residual,
        })
    }
}

/// The directions of translation, rotation and scale of the kept blocks, (T14): orthonormal rows.
pub fn gauge<const K: usize>(bundle: &Bundle) -> DMatrix<f64> {
    let points = kept_positions::<K>(bundle);
    let count = points.len() as f64;
    let centre = centroid(&points);
    let spread = spread(&points);
    // Norms of the four directions; a rotation changes headings as well.
    let turned = if K == 2 { spread } else { spread + count };
    let [shift, turn, grow] = [count, turned, spread].map(|square| {
        if square > 0.0 {
            1.0 / square.sqrt()
        } else {
            0.0
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

/// The positions of the kept blocks: landmarks for `K` = 2, views for `K` = 3.
pub fn kept_positions<const K: usize>(bundle: &Bundle) -> Vec<Vector2<f64>> {
    if K == 2 {
        bundle.landmarks.iter().map(|p| p.coords).collect()
    } else {
        bundle.poses.iter().map(|p| p.translation.vector).collect()
    }
}
