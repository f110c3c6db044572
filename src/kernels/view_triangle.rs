// SPDX-License-Identifier: MIT OR Apache-2.0
//! The triangle of three views: the coefficients of the calibrated tensor are its sides and angles, and both
//! motions follow in closed form.
//!
//! Symbols as in `docs/theory.md`, sections 2.4 and 2.5.

use super::motion::Motion;
use super::signs::{LineMotion, resolve_signs};
use super::{CalibratedTensor, Triple};
use crate::error::{Degeneracy, Error};
use crate::scalar::Real;
use nalgebra::Complex;

impl<T: Real> CalibratedTensor<T> {
    /// Both motions that have this tensor, their headings resolved by the signs of the bearings.
    ///
    /// # Errors
    /// [`Error::Degenerate`] when a side of the triangle of views vanishes: two views coincide.
    pub fn motions(&self, triples: &[Triple<T>]) -> Result<[Motion<T>; 2], Error> {
        Ok(
            resolve_signs(&self.line_motions()?, triples, |_, _| ())
                .map(|oriented| oriented.motion),
        )
    }

    /// Minus the cosine of the angle at view 0 between the baselines, from the three sides, (T6);
    /// beyond \[-1, 1\] when noise has broken the triangle inequality.
    pub fn kappa(&self) -> T {
        let [a, b, c] = self.coefficients.map(|z| z.norm_sqr());
        (c - a - b) / (T::lit(2.0) * (a * b).sqrt())
    }

    /// How well the data determine the motion: inversely proportional to its error for equal noise.
    ///
    /// The second smallest singular value bounds the error of the tensor; a flat triangle of views
    /// multiplies this error by its longest side over its height.
    pub fn quality(&self) -> T {
        let [la, lb, lc] = self.coefficients.map(|z| z.norm_sqr().sqrt());
        let area = (la + lb + lc) * (lb + lc - la) * (la + lc - lb) * (la + lb - lc);
        let longest = la.max(lb).max(lc);
        // Heron's product is 16 times the squared area; height over side is 2 area / side^2.
        let flatness = area.max(T::zero()).sqrt() * T::lit(0.5) / (longest * longest);
        self.singular_values[1] * flatness
    }

    /// Both motions, mirror images in their triangle of views, each modulo pi in every heading:
    /// (T5) and (T7).
    ///
    /// If noise violates the triangle inequality, the nearest triangle is taken, which is flat; both
    /// motions are then the same.
    ///
    /// # Errors
    /// [`Error::Degenerate`] when a side of the triangle vanishes: two views coincide.
    pub(super) fn line_motions(&self) -> Result<[LineMotion<T>; 2], Error> {
        let sides = self.coefficients.map(|z| z.norm_sqr().sqrt());
        let [la, lb, lc] = sides;
        let shortest = la.min(lb).min(lc);
        let bound = T::eps() * T::lit(64.0);
        if !(shortest > bound) {
            return Err(Error::Degenerate {
                kind: Degeneracy::CoincidentViews,
                value: (shortest / la.max(lb).max(lc)).as_f64(),
                bound: bound.as_f64(),
            });
        }
        let phase: [Complex<T>; 3] =
            core::array::from_fn(|k| self.coefficients[k] * (T::one() / sides[k]));
        let beta = angle_of_sides(la, lb, lc);
        Ok([beta, beta.conj()].map(|beta| {
            // C' = -(A' + B'), all relative to the phase of A'.
            let opposite = -(beta * lb + la);
            let gamma = opposite * (T::one() / opposite.norm_sqr().sqrt());
            let alpha2 = phase[0] * phase[1] * beta.conj();
            let turn1 = phase[0] * phase[2] * alpha2.conj() * gamma.conj();
            let turn2 = phase[1] * phase[2] * (alpha2 * beta * gamma).conj();
            let alpha = square_root(alpha2);
            LineMotion {
                headings: [square_root(turn1), square_root(turn2)],
                positions: [-alpha.conj() * la, (alpha * beta).conj() * lb],
            }
        }))
    }
}

/// `e^{i beta}` for which `la + lb e^{i beta}` has the length `lc`, from Heron's formula: cos and sin without
/// cancellation in a flat triangle. Where no triangle has these sides, the nearest flat one is taken.
#[inline(always)]
pub(super) fn angle_of_sides<T: Real>(la: T, lb: T, lc: T) -> Complex<T> {
    let halves = T::lit(0.5) / (la * lb);
    let cos = ((lc - la) * (lc + la) - lb * lb) * halves;
    let area = (la + lb + lc) * (lb + lc - la) * (la + lc - lb) * (la + lb - lc);
    let sin = area.max(T::zero()).sqrt() * halves;
    // In a flat triangle the cosine is 1 or -1.
    let cos = if area > T::zero() {
        cos
    } else if cos > T::zero() {
        T::one()
    } else {
        -T::one()
    };
    Complex::new(cos, sin)
}

/// One of the two square roots of a unit complex number, again of unit length.
#[inline]
pub(super) fn square_root<T: Real>(z: Complex<T>) -> Complex<T> {
    let half = T::lit(0.5);
    let large = ((T::one() + z.re.abs()) * half).sqrt();
    let small = z.im * half / large;
    if z.re >= T::zero() {
        Complex::new(large, small)
    } else {
        Complex::new(small, large)
    }
}
