// SPDX-License-Identifier: MIT OR Apache-2.0
//! The linearised bearing, and the optimisation of one landmark with the poses held fixed.
//!
//! Residual of a sighting: `r = arg(e^{-i bearing} e^{-i theta} (x - p))`, predicted minus measured in
//! (-pi, pi], over sigma. With `d = x - p` and `g = (-d_y, d_x) / |d|^2`, (T12):
//! `dr/dx = g`, `dr/dp = -g`, `dr/dtheta = -1`.

use super::loss::Loss;
use crate::geometry::points::horizon;
use crate::geometry::{Bearing, Pose, signed_angle};
use crate::scalar::Real;
use nalgebra::{Point2, Vector2};

/// A measured bearing and one over its standard deviation \[1/rad\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray<T: Real = f64> {
    pub bearing: Bearing<T>,
    pub weight: T,
}

/// How the residuals of a problem are formed and weighted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SightingModel<T: Real = f64> {
    /// Whether a bearing is a ray; otherwise it is a line, known modulo pi.
    pub oriented: bool,
    pub loss: Loss<T>,
}

impl<T: Real> SightingModel<T> {
    /// Whether the loss is squared and bearings are rays.
    #[inline]
    pub fn is_plain(&self) -> bool {
        self.oriented && matches!(self.loss, Loss::Squared)
    }
}

/// A linearised bearing: residual and derivatives, all over sigma, and with a loss multiplied by the root of
/// its slope. All zero where there is no bearing.
#[derive(Clone, Copy, Debug)]
pub struct BearingRow<T: Real = f64> {
    /// Derivative with respect to the landmark, minus that with respect to the position.
    pub gradient: Vector2<T>,
    /// Minus the derivative with respect to the heading: one over sigma.
    pub weight: T,
    /// The residual.
    pub residual: T,
}

impl<T: Real> BearingRow<T> {
    /// All four numbers the same.
    pub const fn filled(value: T) -> Self {
        Self {
            gradient: Vector2::new(value, value),
            weight: value,
            residual: value,
        }
    }

    /// The bearing of a landmark from a pose with squared loss; a line rather than a ray when not
    /// `oriented`.
    #[inline(always)]
    pub fn new(pose: &Pose<T>, landmark: &Point2<T>, ray: &Ray<T>, oriented: bool) -> Self {
        let offset = landmark.coords - pose.translation.vector;
        let direction = pose.rotation.into_inner() * ray.bearing.into_inner();
        let along = direction.re * offset.x + direction.im * offset.y;
        let across = direction.re * offset.y - direction.im * offset.x;
        let square = offset.norm_squared();
        // A landmark exactly on its view has no bearing: residual and gradient are zero.
        if square <= T::zero() {
            return Self {
                gradient: Vector2::zeros(),
                weight: ray.weight,
                residual: T::zero(),
            };
        }
        let (along, across) = if oriented || along >= T::zero() {
            (along, across)
        } else {
            (-along, -across)
        };
        let scale = ray.weight / square;
        Self {
            gradient: Vector2::new(-offset.y * scale, offset.x * scale),
            weight: ray.weight,
            residual: signed_angle(along, across) * ray.weight,
        }
    }

    /// The bearing weighted by its loss, and what it adds to twice the cost. `PLAIN` is for rays with squared
    /// loss, the inner loop of most refinements, and compiles to these operations only.
    // Without inlining the row would pass through memory: a quarter more time, though hardly an instruction more.
    #[inline(always)]
    pub fn weighted<const PLAIN: bool>(
        pose: &Pose<T>,
        landmark: &Point2<T>,
        ray: &Ray<T>,
        model: &SightingModel<T>,
    ) -> (Self, T) {
        let mut row = Self::new(pose, landmark, ray, PLAIN || model.oriented);
        let square = row.residual * row.residual;
        if PLAIN {
            return (row, square);
        }
        let (value, slope) = model.loss.evaluate(square);
        if slope < T::one() {
            let root = slope.sqrt();
            row.gradient *= root;
            row.weight *= root;
            row.residual *= root;
        }
        (row, value)
    }

    /// Derivative with respect to the pose `(x, y, theta)`.
    #[cfg(feature = "alloc")]
    #[inline]
    pub fn pose(&self) -> [T; 3] {
        [-self.gradient.x, -self.gradient.y, -self.weight]
    }

    /// Derivative with respect to the landmark `(x, y)`.
    #[inline]
    pub fn landmark(&self) -> [T; 2] {
        self.gradient.into()
    }
}

/// The normal equations of one landmark with the poses held fixed.
#[derive(Clone, Copy, Debug)]
pub struct LandmarkNormal<T: Real = f64> {
    /// xx, xy, yy.
    pub information: [T; 3],
    pub gradient: [T; 2],
    /// Sum of losses.
    pub loss: T,
}

/// From linearised bearings, and what each adds to twice the cost.
impl<T: Real> FromIterator<(BearingRow<T>, T)> for LandmarkNormal<T> {
    #[inline]
    fn from_iter<I: IntoIterator<Item = (BearingRow<T>, T)>>(rows: I) -> Self {
        let mut normal = Self {
            information: [T::zero(); 3],
            gradient: [T::zero(); 2],
            loss: T::zero(),
        };
        for (row, loss) in rows {
            normal.add(&row, loss);
        }
        normal
    }
}

impl<T: Real> LandmarkNormal<T> {
    #[inline]
    fn add(&mut self, row: &BearingRow<T>, loss: T) {
        let [x, y] = row.landmark();
        let [xx, xy, yy] = &mut self.information;
        *xx += x * x;
        *xy += x * y;
        *yy += y * y;
        let [gx, gy] = &mut self.gradient;
        *gx += x * row.residual;
        *gy += y * row.residual;
        self.loss += loss;
    }

    /// The position after a Gauss-Newton step; `None` where the poses do not determine it within the horizon.
    #[inline]
    fn step(&self, from: &Point2<T>) -> Option<Point2<T>> {
        let [xx, xy, yy] = self.information;
        let [x, y] = self.gradient;
        let determinant = xx * yy - xy * xy;
        let to = from + Vector2::new(xy * y - yy * x, xy * x - xx * y) / determinant;
        (determinant > T::zero() && to.coords.amax() <= horizon()).then_some(to)
    }
}

/// Moves a landmark towards its best position with the poses held fixed: one or two Gauss-Newton steps, as
/// long as the cost falls.
///
/// A linear step takes landmarks off their rays when poses turn; moving them back onto the rays allows the
/// descent longer steps (variable projection).
///
/// `linearize` sums the rays at a position; it gets the index of the position, from 0, so that it can keep
/// the rows of two of them. Returns the best position, its index and the sum of the losses there.
#[inline]
pub fn optimize_landmark<T: Real>(
    start: Point2<T>,
    mut linearize: impl FnMut(usize, &Point2<T>) -> LandmarkNormal<T>,
) -> (Point2<T>, usize, T) {
    let here = linearize(0, &start);
    let Some(first) = here.step(&start) else {
        return (start, 0, here.loss);
    };
    let there = linearize(1, &first);
    if !(there.loss < here.loss) {
        return (start, 0, here.loss);
    }
    if let Some(second) = there.step(&first) {
        // Only the loss of the second step is needed.
        let loss = linearize(2, &second).loss;
        if loss < there.loss {
            return (second, 2, loss);
        }
    }
    (first, 1, there.loss)
}
