// SPDX-License-Identifier: MIT OR Apache-2.0
//! A sighting linearised, and a landmark put onto its rays, (T12).

use crate::geometry::{Bearing, Pose, signed_angle};
use crate::scalar::Real;
use nalgebra::{Point2, Vector2};

/// A measured bearing and one over its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen<T: Real> {
    pub bearing: Bearing<T>,
    pub weight: T,
}

/// Residual and derivatives of a sighting, over sigma; all zero where there is none.
#[derive(Clone, Copy, Debug)]
pub struct Row<T: Real> {
    /// Minus the derivative with respect to the pose `(x, y, theta)`. The first two are the derivative
    /// with respect to the landmark, the last is one over sigma.
    pub slope: [T; 3],
    pub residual: T,
}

impl<T: Real> Row<T> {
    pub const fn filled(zero: T) -> Self {
        Self {
            slope: [zero; 3],
            residual: zero,
        }
    }

    #[inline]
    pub fn new(pose: &Pose<T>, point: &Point2<T>, seen: &Seen<T>) -> Self {
        let offset = point.coords - pose.translation.vector;
        let ray = pose.rotation.into_inner() * seen.bearing.into_inner();
        let along = ray.re * offset.x + ray.im * offset.y;
        let across = ray.re * offset.y - ray.im * offset.x;
        let square = offset.norm_squared();
        // A landmark exactly on its view may lie in any direction, and pulls nowhere.
        if square <= T::zero() {
            return Self {
                slope: [T::zero(), T::zero(), seen.weight],
                residual: T::zero(),
            };
        }
        let scale = seen.weight / square;
        Self {
            slope: [-offset.y * scale, offset.x * scale, seen.weight],
            residual: signed_angle(along, across) * seen.weight,
        }
    }

    /// The derivative with respect to the landmark.
    #[inline]
    pub fn landmark(&self) -> [T; 2] {
        let [x, y, _] = self.slope;
        [x, y]
    }
}

/// What the views tell about one landmark.
pub struct Around<T: Real> {
    /// xx, xy, yy.
    information: [T; 3],
    gradient: [T; 2],
    /// Sum of squared residuals.
    pub loss: T,
}

impl<T: Real> Around<T> {
    /// Linearises the sightings of a landmark at a place.
    #[inline]
    pub fn new<const M: usize>(
        poses: &[Option<Pose<T>>; M],
        seen: &[Option<Seen<T>>; M],
        point: &Point2<T>,
        rows: &mut [Row<T>; M],
    ) -> Self {
        let zero = T::zero();
        let mut around = Self {
            information: [zero; 3],
            gradient: [zero; 2],
            loss: zero,
        };
        for ((pose, seen), row) in poses.iter().zip(seen).zip(rows) {
            let (Some(pose), Some(seen)) = (pose, seen) else {
                *row = Row::filled(zero);
                continue;
            };
            *row = Row::new(pose, point, seen);
            let [x, y] = row.landmark();
            let [xx, xy, yy] = &mut around.information;
            *xx += x * x;
            *xy += x * y;
            *yy += y * y;
            let [gx, gy] = &mut around.gradient;
            *gx += x * row.residual;
            *gy += y * row.residual;
            around.loss += row.residual * row.residual;
        }
        around
    }

    /// The place after a step of Gauss-Newton; `None` where the views do not fix it within the horizon.
    #[inline]
    fn step(&self, from: &Point2<T>) -> Option<Point2<T>> {
        let [xx, xy, yy] = self.information;
        let [x, y] = self.gradient;
        let determinant = xx * yy - xy * xy;
        let to = from + Vector2::new(xy * y - yy * x, xy * x - xx * y) / determinant;
        (determinant > T::zero() && to.coords.amax() <= horizon()).then_some(to)
    }
}

/// Moves a landmark towards its best place for the poses: a step or two of Gauss-Newton, as far as the
/// cost falls. Leaves its sightings linearised there and returns the sum of squared residuals.
///
/// A linear step takes the landmarks off their rays as the poses turn; put back onto them, the descent
/// may take longer steps (variable projection).
#[inline]
pub fn settle<const M: usize, T: Real>(
    poses: &[Option<Pose<T>>; M],
    seen: &[Option<Seen<T>>; M],
    point: &mut Point2<T>,
    rows: &mut [Row<T>; M],
    spare: &mut [Row<T>; M],
) -> T {
    let at = Around::new(poses, seen, point, rows);
    let Some(first) = at.step(point) else {
        return at.loss;
    };
    let there = Around::new(poses, seen, &first, spare);
    if !(there.loss < at.loss) {
        return at.loss;
    }
    if let Some(second) = there.step(&first) {
        let beyond = Around::new(poses, seen, &second, rows);
        if beyond.loss < there.loss {
            *point = second;
            return beyond.loss;
        }
    }
    *point = first;
    *rows = *spare;
    there.loss
}

/// Range, in extents of the views, that leaves half of the digits to tell directions: as good as infinity.
pub fn horizon<T: Real>() -> T {
    T::lit(0.1) / T::eps().sqrt()
}
