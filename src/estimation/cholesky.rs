// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cholesky factorisation of a dense symmetric matrix in place, tuned for some dozens of rows.

use crate::scalar::Real;

/// Replaces the lower triangle of a row-major `n x n` matrix by its Cholesky
/// factor with inverted diagonal.
///
/// `false` when a pivot is not positive: the matrix is not positive definite in this arithmetic.
pub fn factorize<T: Real>(matrix: &mut [T], n: usize) -> bool {
    for i in 0..n {
        let (above, rest) = matrix.split_at_mut(i * n);
        let row = &mut rest[..=i];
        for j in 0..i {
            let other = &above[j * n..][..=j];
            row[j] = (row[j] - dot(&row[..j], &other[..j])) * other[j];
        }
        let pivot = row[i] - dot(&row[..i], &row[..i]);
        if !(pivot > T::zero()) {
            return false;
        }
        row[i] = T::one() / pivot.sqrt();
    }
    true
}

/// Solves `L L^T x = b` in place with the factor of [`factorize`].
pub fn solve<T: Real>(factor: &[T], x: &mut [T]) {
    let n = x.len();
    for i in 0..n {
        let row = &factor[i * n..][..=i];
        x[i] = (x[i] - dot(&row[..i], &x[..i])) * row[i];
    }
    for i in (0..n).rev() {
        let row = &factor[i * n..][..=i];
        let value = x[i] * row[i];
        x[i] = value;
        for (x, l) in x[..i].iter_mut().zip(&row[..i]) {
            *x -= *l * value;
        }
    }
}

/// Inner product with four interleaved sums: a fixed order that fits the vector registers.
#[inline]
fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    let mut sums = [T::zero(); 4];
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    for (x, y) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let mut rest = T::zero();
    for (x, y) in a_rest.iter().zip(b_rest) {
        rest += *x * *y;
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn agrees_with_nalgebra() {
        for n in [1, 2, 3, 7, 30] {
            let a = DMatrix::from_fn(n, n, |i, j| ((i * 7 + j * 13) % 11) as f64 - 5.0);
            let a = &a * a.transpose() + DMatrix::identity(n, n);
            let b = DVector::from_fn(n, |i, _| i as f64 - 2.0);
            let expected = a.clone().cholesky().unwrap().solve(&b);
            let mut matrix: Vec<f64> = a.as_slice().to_vec();
            let mut x = b.as_slice().to_vec();
            assert!(factorize(&mut matrix, n));
            solve(&matrix, &mut x);
            let error = (DVector::from_vec(x) - &expected).norm();
            assert!(error < 1e-11 * expected.norm(), "{error:e}");
        }
        assert!(!factorize(&mut [1.0, 0.0, 2.0, 1.0], 2));
        assert!(!factorize(&mut [f64::NAN], 1));
    }
}
