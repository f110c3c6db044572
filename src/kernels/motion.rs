// SPDX-License-Identifier: MIT OR Apache-2.0
//! Relative motion of three views: its landmarks, and point transfer.

use super::Triple;
use crate::geometry::{Bearing, Pose};
use crate::scalar::Real;
use nalgebra::{Complex, Point2, UnitComplex};

/// Three poses that explain the bearings of three views, and how well.
///
/// Gauge: view 0 at the origin with heading 0, unit baseline between views 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T: Real> {
    /// The poses of views 0, 1 and 2.
    pub poses: [Pose<T>; 3],
    /// How many sightings point away from their landmark (violate cheirality), after the heading of every
    /// view has been decided by the majority of its sightings.
    pub inconsistent: usize,
    /// Half the sum of squared bearing residuals \[rad^2\] of all sightings to the landmarks of
    /// [`Motion::landmark`]; the residual of a sighting that points away is nearly pi.
    pub cost: T,
}

/// Sum of squared pairwise determinants of three lines up to which they count as parallel.
#[inline(always)]
pub(super) fn parallel<T: Real>() -> T {
    T::eps() * T::eps()
}

impl<T: Real> Motion<T> {
    /// The landmark where three rays meet best: the least sum of squared distances to the three
    /// lines.
    ///
    /// `None` when the three rays are parallel.
    pub fn landmark(&self, triple: &Triple<T>) -> Option<Point2<T>> {
        let rays =
            core::array::from_fn(|view| (self.poses[view].rotation * triple[view]).into_inner());
        let positions = self
            .poses
            .map(|pose| Complex::new(pose.translation.x, pose.translation.y));
        meet(&rays, &positions).map(|point| Point2::new(point.re, point.im))
    }

    /// Point transfer: the bearing in view 2 of the landmark that views 0 and 1 see at `u` and `v`.
    ///
    /// Oriented, unlike [`TrifocalTensor::transfer`](super::TrifocalTensor::transfer). The landmark is
    /// where the two lines of sight cross, whether ahead of the views or not: check with
    /// [`is_ahead`](crate::is_ahead). `None` when the two are parallel, or cross at view 2.
    ///
    /// # Example
    /// ```
    /// # use bearslam::{three_view, bearing_to, pose, Method};
    /// # let views = [pose(0.0_f64, 0.0, 0.1), pose(3.0, 0.5, 0.7), pose(1.0, 3.0, -0.4)];
    /// # let points = [[1.0, 1.5], [2.0, 4.0], [-1.0, 2.0], [4.0, 3.0], [2.0, -2.0], [0.5, -1.0]];
    /// # let triples = points.map(|point| views.map(|view| bearing_to(&view, &point.into()).unwrap()));
    /// let found = three_view(&triples, Method::Calibrated { reweights: 0 })?;
    /// let [u, v, w] = &triples[0];
    /// let transferred = found.motions[0].transfer(u, v).unwrap();
    /// assert!(transferred.angle_to(w).abs() < 1e-12);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn transfer(&self, u: &Bearing<T>, v: &Bearing<T>) -> Option<Bearing<T>> {
        let [p, q, r] = self
            .poses
            .map(|pose| Complex::new(pose.translation.x, pose.translation.y));
        let [first, second, third] = self.poses.map(|pose| pose.rotation.into_inner());
        let (first, second) = (first * u.into_inner(), second * v.into_inner());
        let across = cross(first, second);
        // The crossing as seen from view 2, times the determinant.
        let seen = second * cross(first, p) - first * cross(second, q) - r * across;
        let seen = if across < T::zero() { -seen } else { seen } * third.conj();
        let norm = seen.norm_sqr().sqrt();
        let size = (p.norm_sqr() + q.norm_sqr() + r.norm_sqr()).sqrt();
        (across.abs() > T::eps() && norm > T::eps() * size)
            .then(|| UnitComplex::new_unchecked(seen * (T::one() / norm)))
    }
}

/// The point with the least sum of squared distances to three lines.
///
/// By Jacobi's formula, (T10), it is the mean of the three pairwise intersections weighted by their
/// squared determinants. The weight is a sum of squares, so no digits are lost to cancellation as in normal
/// equations.
#[inline]
pub(super) fn meet<T: Real>(
    rays: &[Complex<T>; 3],
    positions: &[Complex<T>; 3],
) -> Option<Complex<T>> {
    let offsets: [T; 3] = core::array::from_fn(|k| cross(rays[k], positions[k]));
    let mut sum = Complex::new(T::zero(), T::zero());
    let mut weight = T::zero();
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let determinant = cross(rays[i], rays[j]);
        sum += (rays[j] * offsets[i] - rays[i] * offsets[j]) * determinant;
        weight += determinant * determinant;
    }
    (weight > parallel()).then(|| sum * (T::one() / weight))
}

#[inline]
fn cross<T: Real>(a: Complex<T>, b: Complex<T>) -> T {
    a.re * b.im - a.im * b.re
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{bearing_to, pose};

    /// Pseudo-random numbers in (-1, 1).
    fn noise(seed: usize) -> f64 {
        ((seed as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(2.0) - 1.0
    }

    #[test]
    fn transfer_is_the_bearing_of_the_landmark() {
        let mut sides = [0; 2];
        for trial in 0..200 {
            let number = |k: usize| noise(50 * trial + k);
            let heading = |k: usize| number(k + 1).atan2(number(k));
            let views = [
                pose(0.0, 0.0, 0.3),
                pose(number(4), number(5), heading(0)),
                pose(number(6), number(7), heading(2)),
            ];
            let motion = Motion {
                poses: views,
                inconsistent: 0,
                cost: 0.0,
            };
            let point = Point2::new(5.0 * noise(50 * trial + 20), 5.0 * noise(50 * trial + 21));
            let [u, v, w] = views.map(|view| bearing_to(&view, &point).unwrap());
            let parallax = (views[0].rotation * u).angle_to(&(views[1].rotation * v));
            if parallax.sin().abs() > 1e-3 {
                sides[usize::from(parallax.sin() < 0.0)] += 1;
                let found = motion.transfer(&u, &v).unwrap();
                assert!(found.angle_to(&w).abs() < 1e-11);
            }
            // The same direction in the map: the lines do not cross.
            let parallel = views[1].rotation.inverse() * views[0].rotation * u;
            assert!(motion.transfer(&u, &parallel).is_none());
        }
        assert!(sides.iter().all(|&side| side > 20));
    }
}
