// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bearings and poses. A bearing is a unit vector in the frame of the view that measured it.

use crate::scalar::Real;
use nalgebra::{Isometry2, Point2, UnitComplex, Vector2};

/// A direction measured in the frame of a view, counter-clockwise from its heading.
///
/// `Bearing::new(angle)` makes one from radians, `.angle()` gives radians in (-pi, pi].
pub type Bearing<T> = UnitComplex<T>;

/// Position and heading of a view: the map from the frame of the view to the map frame.
///
/// [`pose`] makes one from `(x, y, theta)`.
pub type Pose<T> = Isometry2<T>;

/// The pose `(x, y, theta)`; theta in radians, counter-clockwise.
///
/// # Example
/// ```
/// let pose = bearslam::pose(1.0, 2.0, 0.5);
/// assert_eq!(pose.translation.x, 1.0);
/// assert_eq!(pose.rotation.angle(), 0.5);
/// ```
pub fn pose<T: Real>(x: T, y: T, theta: T) -> Pose<T> {
    Isometry2::new(Vector2::new(x, y), theta)
}

/// The coordinates `(x, y, theta)` of a pose, theta in (-pi, pi] \[rad\]: the inverse of [`pose`], and convenient
/// to print.
///
/// # Example
/// ```
/// use bearslam::{pose, xytheta};
/// let pose = pose(1.0, 2.0, 0.5_f64);
/// assert_eq!(xytheta(&pose), [1.0, 2.0, 0.5]);
/// assert_eq!(format!("{:.2?}", xytheta(&pose)), "[1.00, 2.00, 0.50]");
/// ```
pub fn xytheta<T: Real>(pose: &Pose<T>) -> [T; 3] {
    let angle = pose.rotation.angle();
    let theta = if angle == -T::pi() { T::pi() } else { angle };
    [pose.translation.x, pose.translation.y, theta]
}

/// The bearing `atan2(R(theta)^T (x - p))` at which the view at `pose` sees `point`.
///
/// `None` when the point is at the position of the view.
///
/// # Example
/// ```
/// use nalgebra::Point2;
/// let pose = bearslam::pose(0.0_f64, 0.0, 0.5);
/// let bearing = bearslam::bearing_to(&pose, &Point2::new(1.0, 1.0)).unwrap();
/// assert!((bearing.angle() - (core::f64::consts::FRAC_PI_4 - 0.5)).abs() < 1e-15);
/// ```
pub fn bearing_to<T: Real>(pose: &Pose<T>, point: &Point2<T>) -> Option<Bearing<T>> {
    let local = pose.inverse_transform_point(point).coords;
    let norm = local.norm();
    (norm > T::zero())
        .then(|| UnitComplex::new_unchecked(nalgebra::Complex::new(local.x / norm, local.y / norm)))
}

/// Whether `bearing`, measured at `pose`, points at `point` rather than away from it (cheirality):
/// within a right angle.
///
/// # Example
/// ```
/// use nalgebra::Point2;
/// let pose = bearslam::pose(0.0_f64, 0.0, 0.5);
/// let point = Point2::new(1.0, 1.0);
/// let bearing = bearslam::bearing_to(&pose, &point).unwrap();
/// assert!(bearslam::is_ahead(&pose, &bearing, &point));
/// assert!(!bearslam::is_ahead(&pose, &bearing, &Point2::new(-1.0, -1.0)));
/// ```
pub fn is_ahead<T: Real>(pose: &Pose<T>, bearing: &Bearing<T>, point: &Point2<T>) -> bool {
    let ray = pose.rotation.into_inner() * bearing.into_inner();
    let (x, y) = (point.x - pose.translation.x, point.y - pose.translation.y);
    ray.re * x + ray.im * y > T::zero()
}

/// The angle of the vector `(x, y)` in (-pi, pi].
///
/// Residuals are nearly always small angles, so the arctangent of a ratio up to 1/16 is summed from its
/// series: seven terms leave less than 1e-18.
#[inline]
pub fn signed_angle<T: Real>(x: T, y: T) -> T {
    if y.abs() <= x * T::lit(SERIES_RANGE) && x > T::zero() {
        let t = y / x;
        let q = t * t;
        let mut sum = T::lit(1.0 / 13.0);
        for k in [11.0, 9.0, 7.0, 5.0, 3.0] {
            sum = T::lit(1.0 / k) - q * sum;
        }
        t - t * q * sum
    } else {
        y.atan2(x)
    }
}

/// Largest ratio for which [`signed_angle`] sums the series: there the last of the seven terms is
/// 1 / (13 * 16^12) = 2.7e-16 of the angle, about one unit of rounding.
const SERIES_RANGE: f64 = 1.0 / 16.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_equals_atan2() {
        for k in -4000..4000 {
            let y = f64::from(k) / 20_000.0;
            let expected = y.atan2(1.7);
            assert!((signed_angle(1.7, y) - expected).abs() <= 2.0 * f64::EPSILON * expected.abs());
            assert_eq!(signed_angle(-1.7, y), y.atan2(-1.7));
        }
        assert_eq!(signed_angle(-1.0, 0.0), core::f64::consts::PI);
        assert_eq!(signed_angle(0.0, 0.0), 0.0);
    }
}
