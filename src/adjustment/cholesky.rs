// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cholesky factorisation of a dense symmetric matrix in place, tuned for a few dozen rows.

#[cfg(not(feature = "std"))]
use crate::float::Float;
use alloc::vec;
use alloc::vec::Vec;

/// Replaces the lower triangle of a row-major `n x n` matrix by its Cholesky factor with inverted diagonal.
///
/// `false` when a pivot is not positive: the matrix is not positive definite in this arithmetic.
pub fn factorize(matrix: &mut [f64], n: usize) -> bool {
    // Two rows at a time against two rows, so that each number loaded is used twice.
    let even = n - n % 2;
    for i in (0..even).step_by(2) {
        let (above, rest) = matrix.split_at_mut(i * n);
        let (first, second) = rest.split_at_mut(n);
        for j in (0..i).step_by(2) {
            let (p, q) = (&above[j * n..][..=j], &above[(j + 1) * n..][..=j + 1]);
            let [fp, fq, sp, sq] = dots([&first[..j], &second[..j]], [&p[..j], &q[..j]]);
            first[j] = (first[j] - fp) * p[j];
            second[j] = (second[j] - sp) * p[j];
            first[j + 1] = (first[j + 1] - fq - first[j] * q[j]) * q[j + 1];
            second[j + 1] = (second[j + 1] - sq - second[j] * q[j]) * q[j + 1];
        }
        let [ff, _, sf, ss] = dots([&first[..i], &second[..i]], [&first[..i], &second[..i]]);
        let Some(inverse) = inverse_root(first[i] - ff) else {
            return false;
        };
        first[i] = inverse;
        second[i] = (second[i] - sf) * inverse;
        let Some(inverse) = inverse_root(second[i + 1] - ss - second[i] * second[i]) else {
            return false;
        };
        second[i + 1] = inverse;
    }
    if even < n {
        let (above, row) = matrix.split_at_mut(even * n);
        for j in 0..even {
            let other = &above[j * n..][..=j];
            row[j] = (row[j] - dot(&row[..j], &other[..j])) * other[j];
        }
        let Some(inverse) = inverse_root(row[even] - dot(&row[..even], &row[..even])) else {
            return false;
        };
        row[even] = inverse;
    }
    true
}

/// One over the square root of a positive number.
#[inline]
fn inverse_root(pivot: f64) -> Option<f64> {
    (pivot > 0.0).then(|| 1.0 / pivot.sqrt())
}

/// The four inner products of two rows with two rows, all of even length.
#[inline]
fn dots([a, b]: [&[f64]; 2], [p, q]: [&[f64]; 2]) -> [f64; 4] {
    let mut sums = [[0.0; 2]; 4];
    let [a, b, p, q] = [a, b, p, q].map(|row| row.as_chunks::<2>().0);
    for ((a, b), (p, q)) in a.iter().zip(b).zip(p.iter().zip(q)) {
        for k in 0..2 {
            sums[0][k] += a[k] * p[k];
            sums[1][k] += a[k] * q[k];
            sums[2][k] += b[k] * p[k];
            sums[3][k] += b[k] * q[k];
        }
    }
    sums.map(|[even, odd]| even + odd)
}

/// Solves `L L^T x = b` in place with the factor of [`factorize`].
pub fn solve(factor: &[f64], x: &mut [f64]) {
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

/// Solves `L y = x` in place with the factor of [`factorize`]; `x` is zero before `begin`.
pub fn whiten(factor: &[f64], x: &mut [f64], begin: usize) {
    let n = x.len();
    for i in begin..n {
        let row = &factor[i * n..][..=i];
        x[i] = (x[i] - dot(&row[begin..i], &x[begin..i])) * row[i];
    }
}

/// The diagonal of the inverse of the matrix, from the factor of [`factorize`].
pub fn inverse_diagonal(factor: &[f64], n: usize) -> Vec<f64> {
    let mut column = vec![0.0; n];
    let squares = |j: usize| {
        // Column j of the inverse of L.
        column[j] = factor[j * n + j];
        let mut sum = column[j] * column[j];
        for i in j + 1..n {
            let row = &factor[i * n..][..=i];
            column[i] = -dot(&row[j..i], &column[j..i]) * row[i];
            sum += column[i] * column[i];
        }
        sum
    };
    (0..n).map(squares).collect()
}

/// Inner product with four interleaved sums: a fixed order that suits vector registers.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    for (x, y) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let mut rest = 0.0;
    for (x, y) in a_rest.iter().zip(b_rest) {
        rest += *x * *y;
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
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
            let inverse = a.clone().cholesky().unwrap().inverse();
            let mut unit = vec![0.0; n];
            unit[n / 2] = 2.0;
            whiten(&matrix, &mut unit, n / 2);
            let form = dot(&unit, &unit);
            assert!(
                (form - 4.0 * inverse[(n / 2, n / 2)]).abs() < 1e-11 * form,
                "{form}"
            );
            for (k, found) in inverse_diagonal(&matrix, n).into_iter().enumerate() {
                let expected = inverse[(k, k)];
                assert!((found - expected).abs() < 1e-11 * expected, "{k}");
            }
        }
        assert!(!factorize(&mut [1.0, 0.0, 2.0, 1.0], 2));
        assert!(!factorize(&mut [f64::NAN], 1));
    }
}
