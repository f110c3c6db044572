// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cholesky factorisation in place of a symmetric matrix of 3x3 blocks.

use crate::scalar::Real;

/// Row by row.
pub type Block<T> = [[T; 3]; 3];

/// Replaces the lower triangle of the first `used` rows by the Cholesky factor with inverted
/// diagonal.
///
/// `false` when a pivot is not positive: the matrix is not positive definite in this arithmetic.
pub fn factorize<T: Real, const M: usize>(matrix: &mut [[Block<T>; M]; M], used: usize) -> bool {
    for i in 0..used {
        let Some((above, [row, ..])) = matrix.split_at_mut_checked(i) else {
            return false;
        };
        for (j, other) in above.iter().enumerate() {
            let Some((left, [block, ..])) = row.split_at_mut_checked(j) else {
                return false;
            };
            for (a, b) in left.iter().zip(other) {
                subtract_product(block, a, b);
            }
            let Some(pivot) = other.get(j) else {
                return false;
            };
            for row in block {
                forward(pivot, row);
            }
        }
        let Some((left, [block, ..])) = row.split_at_mut_checked(i) else {
            return false;
        };
        for a in left.iter() {
            subtract_product(block, a, a);
        }
        if !factorize_block(block) {
            return false;
        }
    }
    true
}

/// Solves `L L^T x = b` in place with the factor of [`factorize`].
pub fn solve<T: Real, const M: usize>(
    factor: &[[Block<T>; M]; M],
    x: &mut [[T; 3]; M],
    used: usize,
) {
    for (i, row) in factor.iter().enumerate().take(used) {
        if let (Some((done, [x, ..])), Some(pivot)) = (x.split_at_mut_checked(i), row.get(i)) {
            for (block, y) in row.iter().zip(done.iter()) {
                for (x, l) in x.iter_mut().zip(block) {
                    *x -= dot(l, y);
                }
            }
            forward(pivot, x);
        }
    }
    for (i, row) in factor.iter().enumerate().take(used).rev() {
        if let (Some((above, [x, ..])), Some(pivot)) = (x.split_at_mut_checked(i), row.get(i)) {
            backward(pivot, x);
            for (block, y) in row.iter().zip(above) {
                for (l, x) in block.iter().zip(x.iter()) {
                    for (y, l) in y.iter_mut().zip(l) {
                        *y -= *l * *x;
                    }
                }
            }
        }
    }
}

/// `block -= a b^T`.
#[inline]
fn subtract_product<T: Real>(block: &mut Block<T>, a: &Block<T>, b: &Block<T>) {
    for (row, a) in block.iter_mut().zip(a) {
        for (entry, b) in row.iter_mut().zip(b) {
            *entry -= dot(a, b);
        }
    }
}

#[inline]
fn factorize_block<T: Real>([[a, _, _], [b, c, _], [d, e, f]]: &mut Block<T>) -> bool {
    let Some(first) = inverse_root(*a) else {
        return false;
    };
    *a = first;
    *b *= first;
    *d *= first;
    let Some(second) = inverse_root(*c - *b * *b) else {
        return false;
    };
    *c = second;
    *e = (*e - *d * *b) * second;
    let Some(third) = inverse_root(*f - *d * *d - *e * *e) else {
        return false;
    };
    *f = third;
    true
}

/// One over the square root of a positive number.
#[inline]
fn inverse_root<T: Real>(pivot: T) -> Option<T> {
    (pivot > T::zero()).then(|| T::one() / pivot.sqrt())
}

/// `L^-1 x`.
#[inline]
fn forward<T: Real>([[a, _, _], [b, c, _], [d, e, f]]: &Block<T>, [x, y, z]: &mut [T; 3]) {
    *x *= *a;
    *y = (*y - *b * *x) * *c;
    *z = (*z - *d * *x - *e * *y) * *f;
}

/// `L^-T x`.
#[inline]
fn backward<T: Real>([[a, _, _], [b, c, _], [d, e, f]]: &Block<T>, [x, y, z]: &mut [T; 3]) {
    *z *= *f;
    *y = (*y - *e * *z) * *c;
    *x = (*x - *b * *y - *d * *z) * *a;
}

#[inline]
fn dot<T: Real>([a, b, c]: &[T; 3], [x, y, z]: &[T; 3]) -> T {
    *a * *x + *b * *y + *c * *z
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};

    #[test]
    fn agrees_with_nalgebra() {
        let a = SMatrix::<f64, 12, 12>::from_fn(|i, j| ((i * 7 + j * 13) % 11) as f64 - 5.0);
        let a = a * a.transpose() + SMatrix::identity();
        let b = SVector::<f64, 12>::from_fn(|i, _| i as f64 - 2.0);
        let at = |i: usize, j: usize| -> Block<f64> {
            core::array::from_fn(|r| core::array::from_fn(|c| a[(3 * i + r, 3 * j + c)]))
        };
        // One row of blocks more than is used.
        let full: [[Block<f64>; 5]; 5] = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                if i < 4 && j < 4 {
                    at(i, j)
                } else {
                    [[f64::NAN; 3]; 3]
                }
            })
        });
        let mut factor = full;
        let mut x: [[f64; 3]; 5] = core::array::from_fn(|i| {
            core::array::from_fn(|r| if i < 4 { b[3 * i + r] } else { 0.0 })
        });
        assert!(factorize(&mut factor, 4));
        solve(&factor, &mut x, 4);
        let expected = a.cholesky().unwrap().solve(&b);
        let found = SVector::<f64, 12>::from_fn(|k, _| x[k / 3][k % 3]);
        assert!((found - expected).norm() < 1e-11 * expected.norm());
        assert_eq!(x[4], [0.0; 3]);
        for (k, value) in [(0, -1.0), (7, f64::NAN), (11, 0.0)] {
            let mut broken = full;
            broken[k / 3][k / 3][k % 3][k % 3] = value;
            assert!(!factorize(&mut broken, 4), "{k}");
        }
    }
}
