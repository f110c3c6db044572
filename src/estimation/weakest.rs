// SPDX-License-Identifier: MIT OR Apache-2.0
//! The directions in which the sparse normal equations hold a map least.

use super::normal::Normal;
use crate::scalar::Real;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{ComplexField, DMatrix};

/// A direction, one standard deviation long for residuals of unit variance, and its gain: the variance of
/// the parameters in it over what it would be if each were alone.
pub struct Weak {
    pub direction: Vec<f64>,
    pub gain: f64,
}

/// Gain beyond which a direction is free: what is left of the information is rounding.
pub const FREE: f64 = 1e11;

/// Steps of the iteration; sizes are wanted to a few percent.
const STEPS: usize = 8;

/// The `count` weakest directions, the weakest first.
///
/// (T16) for a sparse matrix: inverse iteration on a few vectors at once, with the parameters in units of
/// their conditional standard deviations. Needs [`Normal::factorize`].
pub fn weakest<T: Real>(normal: &Normal<'_, T>, count: usize) -> Vec<Weak> {
    let size = normal.size();
    let count = count.min(size);
    let units: Vec<f64> = (0..size)
        .map(|parameter| ComplexField::sqrt(normal.diagonal(parameter)))
        .collect();
    // Any vectors that no symmetry of the problem shares.
    let mut basis = DMatrix::from_fn(size, count, |k, j| {
        1.0 + 0.37 * (((7 * k + 3 + (5 * k + 1) * j) % (11 + 2 * j)) as f64)
    });
    let mut gains = vec![0.0; count];
    for _ in 0..STEPS {
        let orthogonal = basis.qr().q();
        let mut next = orthogonal.clone();
        for (k, unit) in units.iter().enumerate() {
            next.row_mut(k).scale_mut(*unit);
        }
        normal.solve(next.as_mut_slice());
        for (k, unit) in units.iter().enumerate() {
            next.row_mut(k).scale_mut(*unit);
        }
        // The small problem in the space that they span.
        let small = orthogonal.transpose() * &next;
        let eigen = ((&small + small.transpose()) * 0.5).symmetric_eigen();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        gains = order.iter().map(|&k| eigen.eigenvalues[k]).collect();
        let turned = DMatrix::from_fn(count, count, |i, j| eigen.eigenvectors[(i, order[j])]);
        basis = next * turned;
    }
    (0..count)
        .map(|k| {
            let column = basis.column(k);
            let length = ComplexField::sqrt(gains[k].max(0.0)) / column.norm();
            let entries = column.iter().zip(&units);
            Weak {
                direction: entries
                    .map(|(entry, unit)| {
                        if *unit > 0.0 {
                            entry * length / unit
                        } else {
                            0.0
                        }
                    })
                    .collect(),
                gain: gains[k],
            }
        })
        .collect()
}
