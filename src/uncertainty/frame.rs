// SPDX-License-Identifier: MIT OR Apache-2.0
//! The datum of a covariance: what is held fixed while the rest varies, and directions transformed into that frame.

use crate::adjustment::decompose::pseudo_inverse;
use alloc::vec::Vec;
use nalgebra::{DMatrix, DVector};

/// The datum, what is held fixed while the rest varies: without it a covariance has no meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// The frame in which maps are reported. Where odometry and priors leave the gauge free, the first determined
    /// view and the root mean square distance of the other views from it are held.
    FirstView,
    /// Inner constraints: along what odometry and priors leave free of the gauge, positions do not move on average.
    /// This is the covariance after aligning all positions of the map with the truth, and has the least possible
    /// sum of position variances.
    FreeNetwork,
    /// The frame of odometry and priors, which must leave nothing of the gauge free.
    Priors,
}

impl Frame {
    /// All frames.
    pub const ALL: [Self; 3] = [Self::FirstView, Self::FreeNetwork, Self::Priors];

    /// The name of the variant in lower case with underscores.
    pub fn name(self) -> &'static str {
        match self {
            Self::FirstView => "first_view",
            Self::FreeNetwork => "free_network",
            Self::Priors => "priors",
        }
    }
}

/// Damping, as a fraction of the diagonal, with which a singular matrix can be factorised: a few hundred units of
/// rounding, so that the gain of a free direction exceeds all others.
pub const LIFT: f64 = 1e-13;

/// The inverse of a small matrix, or its pseudo-inverse if it is singular; `None` beyond the arithmetic.
pub fn inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    pseudo_inverse(matrix, SINGULAR)
}

/// Fraction of the largest singular value below which one is zero: far above rounding, far below any real one.
const SINGULAR: f64 = 1e-12;

/// The inner constraints: positions do not move on average along the gauge.
pub fn inner_constraints(gauge: &[Vec<f64>], views: usize) -> Vec<Vec<f64>> {
    let is_position = |parameter: usize| parameter >= 3 * views || parameter % 3 < 2;
    let inner = |direction: &Vec<f64>| {
        let entries = direction.iter().enumerate();
        entries
            .map(|(parameter, entry)| if is_position(parameter) { *entry } else { 0.0 })
            .collect()
    };
    gauge.iter().map(inner).collect()
}

/// Directions moved along the gauge until they satisfy the constraints; `None` when the arithmetic overflows.
pub fn in_frame(
    gauge: &[Vec<f64>],
    constraints: &[Vec<f64>],
    free: &[Vec<f64>],
) -> Option<Vec<Vec<f64>>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let count = gauge.len();
    let solver = inverse(&DMatrix::from_fn(count, count, |i, j| {
        dot(&constraints[i], &gauge[j])
    }))?;
    let framed = |direction: &Vec<f64>| {
        let violation = DVector::from_fn(count, |i, _| dot(&constraints[i], direction));
        let step = &solver * violation;
        let mut direction = direction.clone();
        for (along, part) in gauge.iter().zip(step.iter()) {
            for (entry, by) in direction.iter_mut().zip(along) {
                *entry -= part * by;
            }
        }
        direction
    };
    Some(free.iter().map(framed).collect())
}
