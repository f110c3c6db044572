// SPDX-License-Identifier: MIT OR Apache-2.0
//! The 2x2x2 trifocal tensor of three 1D cameras.

use super::Triple;
use crate::geometry::Bearing;
use crate::scalar::Real;
use nalgebra::{Complex, Matrix2, UnitComplex};

/// The trilinear relation `sum T_ijk u_i v_j w_k = 0` between three bearings of one landmark.
///
/// `u`, `v`, `w` are the bearings as unit vectors `(cos, sin)` in views 0, 1, 2. Known up to scale
/// and sign; the estimators of this crate return it with unit Frobenius norm.
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 3.1; L. Quan and T. Kanade, "Affine structure from line
/// correspondences with uncalibrated affine cameras", PAMI 19(8), 1997.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrifocalTensor<T: Real> {
    /// `entries[i][j][k]` is `T_ijk`.
    pub entries: [[[T; 2]; 2]; 2],
}

impl<T: Real> TrifocalTensor<T> {
    /// The 2x2 matrix `sum_i T_ijk u_i`: the relation left between views 1 and 2.
    pub fn contract_first(&self, u: [T; 2]) -> Matrix2<T> {
        Matrix2::from_fn(|j, k| self.entries[0][j][k] * u[0] + self.entries[1][j][k] * u[1])
    }

    /// The 2x2 matrix `sum_k T_ijk w_k`: the relation left between views 0 and 1.
    pub fn contract_last(&self, w: [T; 2]) -> Matrix2<T> {
        Matrix2::from_fn(|i, j| self.entries[i][j][0] * w[0] + self.entries[i][j][1] * w[1])
    }

    /// The two numbers `sum_ij T_ijk u_i v_j`: the line of bearings left to view 2.
    fn contract_both(&self, u: &Bearing<T>, v: &Bearing<T>) -> [T; 2] {
        let matrix = self.contract_first([u.re, u.im]);
        [
            matrix.m11 * v.re + matrix.m21 * v.im,
            matrix.m12 * v.re + matrix.m22 * v.im,
        ]
    }

    /// The algebraic residual `sum T_ijk u_i v_j w_k` of one landmark.
    pub fn residual(&self, [u, v, w]: &Triple<T>) -> T {
        let [p, q] = self.contract_both(u, v);
        p * w.re + q * w.im
    }

    /// The Sampson residual in radians: the algebraic one over the norm of its gradient with respect
    /// to the three angles; to first order the norm of the smallest correction of the bearings.
    ///
    /// Zero where residual and gradient both vanish (a landmark on top of a view).
    pub fn sampson_residual(&self, triple: &Triple<T>) -> T {
        let turned = triple.map(|b| UnitComplex::new_unchecked(Complex::new(-b.im, b.re)));
        let mut gradient = T::zero();
        for k in 0..3 {
            let mut moved = *triple;
            moved[k] = turned[k];
            let partial = self.residual(&moved);
            gradient += partial * partial;
        }
        let residual = self.residual(triple);
        if gradient > T::zero() {
            residual / gradient.sqrt()
        } else {
            residual
        }
    }

    /// Point transfer: the bearing in view 2 of the landmark that views 0 and 1 see at `u` and `v`.
    ///
    /// Known only modulo pi: a tensor does not distinguish a landmark ahead from one behind. `None` when both
    /// bearings point along the baseline, so that every bearing in view 2 fits.
    ///
    /// # Example
    /// ```
    /// # use bearslam::{trifocal_tensor, Bearing, Method};
    /// # let views = [(0.0, 0.0, 0.1), (3.0, 0.5, 0.7), (1.0, 3.0, -0.4)];
    /// # let points = [(1.0, 1.5), (2.0, 4.0), (-1.0, 2.0), (4.0, 3.0), (2.0, -2.0), (0.5, -1.0)];
    /// # let triples: Vec<[Bearing<f64>; 3]> = points.iter().map(|&(x, y)| views.map(|(a, b, t)| {
    /// #     Bearing::new(f64::atan2(y - b, x - a) - t)
    /// # })).collect();
    /// let tensor = trifocal_tensor(&triples, Method::Calibrated { reweights: 0 })?;
    /// let [u, v, w] = triples[0];
    /// let transferred = tensor.transfer(&u, &v).unwrap();
    /// assert!((transferred.angle() - w.angle()).sin().abs() < 1e-12);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn transfer(&self, u: &Bearing<T>, v: &Bearing<T>) -> Option<Bearing<T>> {
        let [p, q] = self.contract_both(u, v);
        let norm = (p * p + q * q).sqrt();
        (norm > T::eps() * self.norm())
            .then(|| UnitComplex::new_unchecked(Complex::new(-q / norm, p / norm)))
    }

    /// The Frobenius norm.
    pub fn norm(&self) -> T {
        self.entries
            .as_flattened()
            .as_flattened()
            .iter()
            .fold(T::zero(), |sum, t| sum + *t * *t)
            .sqrt()
    }

    /// The same relation with unit Frobenius norm; `None` for a tensor that is zero or not finite.
    pub fn normalized(&self) -> Option<Self> {
        let flat = self.entries.as_flattened().as_flattened();
        let largest = flat.iter().fold(T::zero(), |most, t| most.max(t.abs()));
        if !(largest > T::zero() && largest.is_finite() && self.norm() >= T::zero()) {
            return None;
        }
        // Two steps, so that squares do not over- or underflow.
        let scaled = self
            .entries
            .map(|slice| slice.map(|row| row.map(|t| t / largest)));
        let norm = Self { entries: scaled }.norm();
        Some(Self {
            entries: scaled.map(|slice| slice.map(|row| row.map(|t| t / norm))),
        })
    }
}
