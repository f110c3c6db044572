// SPDX-License-Identifier: MIT OR Apache-2.0
//! The triangular factor of a matrix whose rows are added one by one.

use super::null_space::{NullSpace, null_space};
use crate::scalar::Real;

/// Rows that are eliminated together, by one Householder reflection per column.
const BLOCK: usize = 8;

/// The factor R of `A = QR` for a matrix `A` with `N` columns and any number of rows.
///
/// Rows are streamed in and folded into R by orthogonal reflections, so memory is constant and the
/// condition number is that of `A`, not its square. A reflection acts only on one row of R and the
/// waiting rows, because the rest of its column is already zero.
#[derive(Clone, Debug)]
pub(super) struct TriangularFactor<T: Real, const N: usize> {
    /// R, row by row.
    factor: [[T; N]; N],
    /// Rows not yet folded in, column by column, zero beyond `waiting`.
    block: [[T; BLOCK]; N],
    waiting: usize,
}

impl<T: Real, const N: usize> TriangularFactor<T, N> {
    /// The factor of a matrix without rows.
    pub fn new() -> Self {
        Self {
            factor: [[T::zero(); N]; N],
            block: [[T::zero(); BLOCK]; N],
            waiting: 0,
        }
    }

    /// Appends a row to the matrix.
    #[inline]
    pub fn push(&mut self, row: [T; N]) {
        let place = self.waiting;
        // Always true; the test lets the compiler see that nothing panics.
        if place < BLOCK {
            for (column, value) in self.block.iter_mut().zip(row) {
                column[place] = value;
            }
            self.waiting = place + 1;
        }
        if self.waiting >= BLOCK {
            self.fold();
        }
    }

    /// Folds the waiting rows into R.
    fn fold(&mut self) {
        if self.waiting <= BLOCK / 2 {
            self.eliminate::<{ BLOCK / 2 }>();
        } else {
            self.eliminate::<BLOCK>();
        }
        self.waiting = 0;
    }

    /// Folds the first B rows of the block, which include all waiting ones. B is a constant, so that the
    /// loops over rows become vector operations.
    fn eliminate<const B: usize>(&mut self) {
        for k in 0..N {
            // A copy, which the compiler keeps in registers.
            let column = head::<T, B>(&self.block[k]);
            let pivot = self.factor[k][k];
            let below = dot(&column, &column);
            // NaN passes as well, and propagates into every number.
            if below != T::zero() {
                let norm = (pivot * pivot + below).sqrt();
                let signed = if pivot > T::zero() { -norm } else { norm };
                let first = pivot - signed;
                let scale = T::one() / (norm * (norm + pivot.abs()));
                self.factor[k][k] = signed;
                for j in k + 1..N {
                    let mut other = head::<T, B>(&self.block[j]);
                    let above = self.factor[k][j];
                    let step = (first * above + dot(&column, &other)) * scale;
                    self.factor[k][j] = above - step * first;
                    for i in 0..B {
                        other[i] -= step * column[i];
                    }
                    for (place, value) in self.block[j].iter_mut().zip(other) {
                        *place = value;
                    }
                }
            }
            self.block[k] = [T::zero(); BLOCK];
        }
    }

    /// R, row by row; its lower part is zero.
    pub fn rows(&mut self) -> &[[T; N]; N] {
        if self.waiting > 0 {
            self.fold();
        }
        &self.factor
    }

    /// The two smallest singular values and their right singular vectors.
    pub fn null_space(&mut self) -> NullSpace<T, N> {
        null_space(self.rows())
    }
}

/// The first B numbers of a column of waiting rows.
#[inline]
fn head<T: Real, const B: usize>(column: &[T; BLOCK]) -> [T; B] {
    let mut first = [T::zero(); B];
    for (place, value) in first.iter_mut().zip(column) {
        *place = *value;
    }
    first
}

/// The scalar product as four interleaved sums: a fixed order that suits vector registers.
#[inline]
fn dot<T: Real, const B: usize>(a: &[T; B], b: &[T; B]) -> T {
    let mut sums = [T::zero(); 4];
    for (a, b) in a.chunks_exact(4).zip(b.chunks_exact(4)) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += *a * *b;
        }
    }
    let [a, b, c, d] = sums;
    (a + c) + (b + d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// A matrix with pseudo-random entries.
    fn matrix(rows: usize, seed: f64) -> DMatrix<f64> {
        DMatrix::from_fn(rows, 6, |i, j| {
            ((seed + 12.9898 * i as f64 + 78.233 * j as f64).sin() * 43758.5453).rem_euclid(2.0)
                - 1.0
        })
    }

    fn check(matrix: &DMatrix<f64>, tolerance: f64) {
        let mut factor = TriangularFactor::<f64, 6>::new();
        for row in matrix.row_iter() {
            factor.push(core::array::from_fn(|j| row[j]));
        }
        let null = factor.null_space();
        let full = matrix
            .clone()
            .resize(matrix.nrows().max(6), 6, 0.0)
            .svd(false, true);
        let mut order: Vec<usize> = (0..6).collect();
        order.sort_by(|&i, &j| full.singular_values[i].total_cmp(&full.singular_values[j]));
        let [smallest, second] = [0, 1].map(|k| full.singular_values[order[k]]);
        assert!((null.singular_values[0] - smallest).abs() < 1e-13);
        assert!(null.singular_values[1] > second - 1e-13);
        let expected = full.v_t.unwrap().row(order[0]).transpose();
        let cosine = expected.dot(&DMatrix::from_column_slice(
            6,
            1,
            null.vectors[0].as_slice(),
        ));
        assert!((cosine.abs() - 1.0).abs() < tolerance, "{cosine}");
    }

    extern crate alloc;
    use alloc::vec::Vec;

    #[test]
    fn dependent_columns_have_a_null_vector() {
        let mut factor = TriangularFactor::<f64, 2>::new();
        for row in [[1.0, 1.0], [1.0, 1.0], [2.0, 2.0]] {
            factor.push(row);
        }
        let null = factor.null_space();
        assert!(null.singular_values[0] < 1e-15);
        assert!((null.vectors[0].x + null.vectors[0].y).abs() < 1e-15);
    }

    #[test]
    fn smallest_singular_vectors_are_those_of_the_full_decomposition() {
        for rows in [5, 6, 7, 8, 9, 15, 16, 17, 40] {
            for seed in 0..20 {
                // A row of three views has a small component along the tensor: its noise.
                let noise = [0.0, 1e-6, 0.02, 0.2][seed % 4];
                let axis = DMatrix::from_fn(6, 1, |i, _| [0.1, -0.5, 0.3, 0.7, 0.2, 0.346][i]);
                let rows = matrix(rows, seed as f64);
                let along =
                    &rows * &axis * (axis.transpose() * ((noise - 1.0) / axis.norm_squared()));
                check(&(rows + along), 1e-12);
            }
        }
    }

    #[test]
    fn rank_deficient_matrices_of_every_kind_are_finite() {
        for rank in 0..5 {
            for rows in [5, 8, 20] {
                let left = matrix(rows, 0.3).columns(0, rank).into_owned();
                let right = matrix(rank, 1.7);
                let product = left * right;
                let mut factor = TriangularFactor::<f64, 6>::new();
                for row in product.row_iter() {
                    factor.push(core::array::from_fn(|j| row[j]));
                }
                let null = factor.null_space();
                for k in 0..2 {
                    assert!(null.singular_values[k] < 1e-13);
                    assert!((null.vectors[k].norm() - 1.0).abs() < 1e-14);
                    assert!(
                        (&product * DMatrix::from_column_slice(6, 1, null.vectors[k].as_slice()))
                            .norm()
                            < 1e-13
                    );
                }
            }
        }
    }
}
