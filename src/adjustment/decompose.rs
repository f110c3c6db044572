// SPDX-License-Identifier: MIT OR Apache-2.0
//! Decompositions by iteration, bounded: what is not finite or does not converge gives `None`, never a panic and
//! never a call without an end.

use nalgebra::{
    DMatrix, DefaultAllocator, Dim, DimDiff, DimSub, Dyn, OMatrix, SVD, SymmetricEigen, U1,
    allocator::Allocator,
};

/// Most steps of an iteration per row; two are usual.
const STEPS: usize = 60;

/// Share of its neighbours below which an entry beside the diagonal is taken as zero. With a single unit of rounding
/// the singular value decomposition of nalgebra 0.35 goes on where it has converged, and loses ten digits: the test
/// below has such a matrix.
const CONVERGED: f64 = 5.0 * f64::EPSILON;

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
    let found = SymmetricEigen::try_new(matrix, CONVERGED, steps)?;
    (is_finite(&found.eigenvalues) && is_finite(&found.eigenvectors)).then_some(found)
}

/// Singular values, largest first, with the singular vectors of the rows.
pub fn singular_values(matrix: DMatrix<f64>) -> Option<SVD<f64, Dyn, Dyn>> {
    decompose(matrix, false)
}

/// The inverse of a square matrix on the space of all singular values above `share` of the largest; zero along the
/// others.
pub fn pseudo_inverse(matrix: DMatrix<f64>, share: f64) -> Option<DMatrix<f64>> {
    if matrix.is_empty() {
        return Some(matrix);
    }
    let found = decompose(matrix, true)?;
    let bound = found.singular_values.amax() * share;
    found.pseudo_inverse(bound).ok()
}

fn decompose(matrix: DMatrix<f64>, left: bool) -> Option<SVD<f64, Dyn, Dyn>> {
    if matrix.is_empty() || !is_finite(&matrix) {
        return None;
    }
    let steps = STEPS * matrix.nrows().min(matrix.ncols());
    let mut found = SVD::try_new_unordered(matrix, left, true, CONVERGED, steps)?;
    // nalgebra sorts with a panic on NaN.
    if !is_finite(&found.singular_values) {
        return None;
    }
    found.sort_by_singular_values();
    Some(found)
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
        let values = singular_values(matrix.clone()).unwrap().singular_values;
        assert!(values.as_slice().is_sorted_by(|a, b| a >= b), "{values}");
        let off = values.norm() - matrix.norm();
        // The values come in pairs.
        assert!(off.abs() < 1e-13, "{off:e} {values}");
        let both = matrix.clone().resize(5, 6, 0.0);
        let inverse = pseudo_inverse(both.clone(), 1e-12).unwrap();
        assert!((&both * inverse * &both - &both).norm() < 1e-12);
        assert_eq!(
            pseudo_inverse(DMatrix::zeros(0, 0), 1e-12).unwrap().len(),
            0
        );
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
                assert!(singular_values(matrix.clone()).is_none(), "{bad} {place}");
                assert!(pseudo_inverse(matrix, 1e-12).is_none(), "{bad} {place}");
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
            let _ = singular_values(matrix.clone());
            if let Some(inverse) = pseudo_inverse(matrix, 1e-12) {
                assert_eq!(inverse.shape(), (4, 4));
            }
        }
    }
}
