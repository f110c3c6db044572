// SPDX-License-Identifier: MIT OR Apache-2.0
//! Decompositions by iteration, bounded: what is not finite or does not converge gives `None`, never a panic and
//! never a call without an end.
//!
//! Singular values are those of faer: nalgebra 0.35 errs by whole numbers on some singular matrices of whole numbers,
//! and has no end or panics on what is not finite.

use alloc::vec;
use alloc::vec::Vec;
use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::{MatMut, MatRef, Par, Spec};
use nalgebra::{
    DMatrix, DefaultAllocator, Dim, DimDiff, DimSub, OMatrix, SymmetricEigen, U1,
    allocator::Allocator,
};

/// Most steps of the iteration for eigenvalues per row; two are usual.
const STEPS: usize = 60;

/// Eigenvalues and eigenvectors of a symmetric matrix, in no order.
pub fn symmetric_eigen<D>(matrix: OMatrix<f64, D, D>) -> Option<SymmetricEigen<f64, D>>
where
    D: DimSub<U1>,
    DefaultAllocator: Allocator<D> + Allocator<D, D> + Allocator<DimDiff<D, U1>>,
{
    if !is_finite(&matrix) {
        return None;
    }
    let steps = STEPS * matrix.nrows();
    let found = SymmetricEigen::try_new(matrix, f64::EPSILON, steps)?;
    (is_finite(&found.eigenvalues) && is_finite(&found.eigenvectors)).then_some(found)
}

/// Singular values, largest first, each with a column of singular vectors on either side.
pub struct SingularValues {
    pub values: Vec<f64>,
    pub left: DMatrix<f64>,
    pub right: DMatrix<f64>,
}

/// The singular values of a matrix.
pub fn singular_values(matrix: &DMatrix<f64>) -> Option<SingularValues> {
    let (rows, columns) = matrix.shape();
    let size = rows.min(columns);
    if size == 0 || !is_finite(matrix) {
        return None;
    }
    let mut values = vec![0.0; size];
    let mut left = DMatrix::zeros(rows, size);
    let mut right = DMatrix::zeros(columns, size);
    let thin = ComputeSvdVectors::Thin;
    let need = svd_scratch::<f64>(rows, columns, thin, thin, Par::Seq, Spec::default());
    let mut work = MemBuffer::try_new(need).ok()?;
    svd(
        MatRef::from_column_major_slice(matrix.as_slice(), rows, columns),
        DiagMut::from_slice_mut(&mut values),
        Some(MatMut::from_column_major_slice_mut(
            left.as_mut_slice(),
            rows,
            size,
        )),
        Some(MatMut::from_column_major_slice_mut(
            right.as_mut_slice(),
            columns,
            size,
        )),
        Par::Seq,
        MemStack::new(&mut work),
        Spec::default(),
    )
    .ok()?;
    let finite = values.iter().all(|value| value.is_finite());
    (finite && is_finite(&left) && is_finite(&right)).then_some(SingularValues {
        values,
        left,
        right,
    })
}

/// The inverse on the space of all singular values above `share` of the largest; zero along the others.
pub fn pseudo_inverse(matrix: &DMatrix<f64>, share: f64) -> Option<DMatrix<f64>> {
    let (rows, columns) = matrix.shape();
    let mut inverse = DMatrix::zeros(columns, rows);
    if matrix.is_empty() {
        return Some(inverse);
    }
    let found = singular_values(matrix)?;
    let bound = found.values[0] * share;
    for (k, value) in found.values.iter().enumerate() {
        if *value > bound {
            let (row, column) = (found.left.column(k), found.right.column(k));
            inverse.ger(1.0 / value, &column, &row, 1.0);
        }
    }
    is_finite(&inverse).then_some(inverse)
}

fn is_finite<R: Dim, C: Dim>(matrix: &OMatrix<f64, R, C>) -> bool
where
    DefaultAllocator: Allocator<R, C>,
{
    matrix.iter().all(|entry| entry.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    #[test]
    fn decompositions_compose_the_matrix_again() {
        let matrix = DMatrix::from_fn(5, 5, |i, j| ((3 * i + 7 * j) % 5) as f64 - 1.5);
        let symmetric = &matrix + matrix.transpose();
        let found = symmetric_eigen(symmetric.clone()).unwrap();
        assert!((found.recompose() - &symmetric).norm() < 1e-13);
        let found = singular_values(&matrix).unwrap();
        assert!(found.values.is_sorted_by(|a, b| a >= b));
        let diagonal = DMatrix::from_diagonal(&found.values.into());
        let again = found.left * diagonal * found.right.transpose();
        assert!((again - &matrix).norm() < 1e-13);
    }

    /// Matrices of whole numbers of any rank, on which nalgebra errs.
    #[test]
    fn pseudo_inverses_invert_on_both_sides() {
        for trial in 0..500 {
            let (rows, columns) = (1 + trial % 7, 1 + trial / 7 % 7);
            let entry = |i: usize, j: usize| {
                ((i * i + 3 * i * j + (trial + 1) * j) % (2 + trial % 4)) as f64
            };
            let matrix = DMatrix::from_fn(rows, columns, |i, j| entry(i, j) - 1.0);
            let inverse = pseudo_inverse(&matrix, 1e-12).unwrap();
            let size = matrix.norm();
            let there = (&matrix * &inverse * &matrix - &matrix).norm();
            assert!(there <= 1e-13 * size, "{trial}: {there:e}");
            let back = (&inverse * &matrix * &inverse - &inverse).norm();
            assert!(back <= 1e-12 * inverse.norm(), "{trial}: {back:e}");
            for product in [&matrix * &inverse, &inverse * &matrix] {
                assert!((&product - product.transpose()).norm() < 1e-12, "{trial}");
            }
        }
        let nothing = pseudo_inverse(&DMatrix::zeros(0, 0), 1e-12).unwrap();
        assert!(nothing.is_empty());
    }

    /// nalgebra's own forms panic on these or have no end.
    #[test]
    fn what_is_not_finite_has_no_decomposition() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for place in 0..9 {
                let mut matrix = Matrix3::<f64>::identity();
                matrix[place] = bad;
                assert!(symmetric_eigen(matrix).is_none(), "{bad} {place}");
                let matrix = DMatrix::from_column_slice(3, 3, matrix.as_slice());
                assert!(symmetric_eigen(matrix.clone()).is_none(), "{bad} {place}");
                assert!(singular_values(&matrix).is_none(), "{bad} {place}");
                assert!(pseudo_inverse(&matrix, 1e-12).is_none(), "{bad} {place}");
            }
        }
    }

    #[test]
    fn extreme_scales_have_an_end() {
        for scale in [f64::MIN_POSITIVE * 1e-10, 1e-200, 1e150, 1e300] {
            let matrix = DMatrix::from_fn(4, 4, |i, j| {
                let mixed = if (i + j) % 2 == 0 { scale } else { 1.0 };
                mixed * (1.0 + (i * j) as f64)
            });
            let _ = symmetric_eigen(matrix.clone());
            let _ = singular_values(&matrix);
            if let Some(inverse) = pseudo_inverse(&matrix, 1e-12) {
                assert_eq!(inverse.shape(), (4, 4));
            }
        }
    }
}
