// SPDX-License-Identifier: MIT OR Apache-2.0
//! The damped normal equations with the landmarks eliminated, (T13), in fixed storage.

use super::cholesky::{Block, factorize, solve};
use crate::geometry::Pose;
use crate::lm::{BearingRow, LandmarkNormal, ZERO_PIVOT_EPS};
use crate::scalar::Real;
use nalgebra::{Point2, Vector2};

/// The working memory of a refinement; its contents are not kept between calls.
///
/// `new` is a `const fn`, for a static in `f32` or `f64`; generic code uses `default`. For its size see
/// [`FixedMap`](super::FixedMap).
#[derive(Clone, Debug)]
pub struct Workspace<T: Real, const M: usize, const N: usize> {
    /// The sightings linearised, by landmark, then by view.
    pub(super) rows: [[BearingRow<T>; M]; N],
    pub(super) spare: [BearingRow<T>; M],
    /// The map after the step.
    pub(crate) poses: [Option<Pose<T>>; M],
    pub(crate) landmarks: [Option<Point2<T>>; N],
    /// The reduced matrix, then its factor: the lower triangle.
    matrix: [[Block<T>; M]; M],
    /// Minus the reduced gradient, then the step of the poses.
    pub(super) step: [[T; 3]; M],
    /// The diagonal of the poses before elimination and damping.
    diagonal: [[T; 3]; M],
    /// Factors of the landmarks.
    points: [PointFactor<T>; N],
    /// `L^-1` times the derivatives with respect to the current landmark.
    whitened: [[T; 2]; M],
}

impl<const M: usize, const N: usize> Workspace<f32, M, N> {
    /// Room for maps of `M` views and `N` landmarks.
    pub const fn new() -> Self {
        Self::filled(0.0)
    }
}

impl<const M: usize, const N: usize> Workspace<f64, M, N> {
    /// Room for maps of `M` views and `N` landmarks.
    pub const fn new() -> Self {
        Self::filled(0.0)
    }
}

impl<T: Real, const M: usize, const N: usize> Default for Workspace<T, M, N> {
    fn default() -> Self {
        Self::filled(T::zero())
    }
}

/// The Cholesky factor of a damped 2x2 block, diagonal inverted.
#[derive(Clone, Copy, Debug)]
struct PointFactor<T: Real>([T; 3]);

impl<T: Real> PointFactor<T> {
    /// The factor of the damped information of a landmark (xx, xy, yy).
    ///
    /// A pivot that is only rounding belongs to a direction that no sighting determines, such as the range of a
    /// landmark at infinity. Its entry in the factor is set to zero, so that the direction gets no step and the others
    /// are solved for as if it did not exist. `None` for numbers that are not finite.
    #[inline]
    fn new([xx, xy, yy]: [T; 3], damping: T) -> Option<Self> {
        let root = |pivot: T, whole: T| {
            if !pivot.is_finite() {
                None
            } else if pivot > whole * T::eps() * T::lit(ZERO_PIVOT_EPS) {
                Some(T::one() / pivot.sqrt())
            } else {
                Some(T::zero())
            }
        };
        let grown = T::one() + damping;
        let (xx, yy) = (xx * grown, yy * grown);
        let first = root(xx, xx)?;
        let below = xy * first;
        let second = root(yy - below * below, yy)?;
        Some(Self([first, below, second]))
    }

    /// `L^-1 x`.
    #[inline]
    fn forward(&self, [x, y]: [T; 2]) -> [T; 2] {
        let Self([first, below, second]) = *self;
        let x = x * first;
        [x, (y - below * x) * second]
    }

    /// `L^-T x`.
    #[inline]
    fn backward(&self, [x, y]: [T; 2]) -> [T; 2] {
        let Self([first, below, second]) = *self;
        let y = y * second;
        [(x - below * y) * first, y]
    }
}

impl<T: Real, const M: usize, const N: usize> Workspace<T, M, N> {
    const fn filled(zero: T) -> Self {
        Self {
            rows: [[BearingRow::filled(zero); M]; N],
            spare: [BearingRow::filled(zero); M],
            poses: [None; M],
            landmarks: [None; N],
            matrix: [[[[zero; 3]; 3]; M]; M],
            step: [[zero; 3]; M],
            diagonal: [[zero; 3]; M],
            points: [PointFactor([zero; 3]); N],
            whitened: [[zero; 2]; M],
        }
    }

    /// Solves for the step of the poses, of which only the first `used` may be determined.
    ///
    /// Directions along which no residual changes get the stiffness of an average parameter. The right-hand side is
    /// orthogonal to them, so this fixes the gauge and, without damping, changes nothing else. `false` when the system
    /// is not positive definite.
    pub(super) fn solve(&mut self, poses: &[Option<Pose<T>>; M], used: usize, damping: T) -> bool {
        let zero = T::zero();
        for row in self.matrix.iter_mut().take(used) {
            row.iter_mut()
                .take(used)
                .for_each(|block| *block = [[zero; 3]; 3]);
        }
        self.step = [[zero; 3]; M];
        self.diagonal = [[zero; 3]; M];
        if !self.eliminate(damping) {
            return false;
        }
        self.fix_gauge(poses);
        let diagonal = self.diagonal.iter().enumerate().take(used);
        for ((k, conditional), row) in diagonal.zip(&mut self.matrix) {
            let Some([[xx, _, _], [_, yy, _], [_, _, tt]]) = row.get_mut(k) else {
                return false;
            };
            for (pivot, information) in [xx, yy, tt].into_iter().zip(conditional) {
                // A parameter on which no residual depends, for example because of the loss, gets no step.
                *pivot += if *information > zero {
                    *information * damping
                } else {
                    T::one()
                };
            }
        }
        if !factorize(&mut self.matrix, used) {
            return false;
        }
        solve(&self.matrix, &mut self.step, used);
        true
    }

    /// Forms the reduced system, landmark by landmark.
    #[inline]
    fn eliminate(&mut self, damping: T) -> bool {
        let zero = T::zero();
        for (rows, point) in self.rows.iter().zip(&mut self.points) {
            let normal: LandmarkNormal<T> = rows.iter().map(|row| (*row, zero)).collect();
            let Some(factor) = PointFactor::new(normal.information, damping) else {
                return false;
            };
            *point = factor;
            let gradient = factor.forward(normal.gradient);
            for (row, whitened) in rows.iter().zip(&mut self.whitened) {
                *whitened = factor.forward(row.landmark());
            }
            let views = rows.iter().zip(&self.whitened).enumerate();
            let totals = self.step.iter_mut().zip(&mut self.diagonal);
            for (((view, (row, z)), (step, diagonal)), blocks) in
                views.zip(totals).zip(&mut self.matrix)
            {
                if row.weight <= zero {
                    continue;
                }
                let left = row.residual - dot(z, &gradient);
                let slopes = minus_pose(row);
                for ((step, diagonal), slope) in step.iter_mut().zip(diagonal).zip(slopes) {
                    *step += slope * left;
                    *diagonal += slope * slope;
                }
                let others = rows.iter().zip(&self.whitened);
                for (block, (other, w)) in blocks.iter_mut().zip(others).take(view) {
                    add_product(block, -dot(z, w), &slopes, &minus_pose(other));
                }
                if let Some(block) = blocks.get_mut(view) {
                    add_product(block, T::one() - dot(z, z), &slopes, &slopes);
                }
            }
        }
        true
    }

    /// Adds stiffness along translation, rotation and scale of the poses, (T14).
    fn fix_gauge(&mut self, poses: &[Option<Pose<T>>; M]) {
        let positions = || poses.iter().flatten().map(|pose| pose.translation.vector);
        let count = positions().fold(T::zero(), |sum, _| sum + T::one());
        let centre = positions().fold(Vector2::zeros(), |sum, p| sum + p) / count;
        let spread = positions().fold(T::zero(), |sum, p| sum + (p - centre).norm_squared());
        let total = self.diagonal.iter().flatten();
        let total = total.fold(T::zero(), |sum, information| sum + *information);
        let stiffness = total / (T::lit(3.0) * count);
        let over = |square: T| {
            if square > T::zero() {
                stiffness / square
            } else {
                T::zero()
            }
        };
        let (shift, turn, grow) = (over(count), over(spread + count), over(spread));
        for ((pose, blocks), view) in poses.iter().zip(&mut self.matrix).zip(1..) {
            let Some(pose) = pose else { continue };
            let p = pose.translation.vector - centre;
            for (other, block) in poses.iter().zip(blocks).take(view) {
                let Some(other) = other else { continue };
                let q = other.translation.vector - centre;
                let [[xx, xy, xt], [yx, yy, yt], [tx, ty, tt]] = block;
                *xx += shift + turn * p.y * q.y + grow * p.x * q.x;
                *xy += grow * p.x * q.y - turn * p.y * q.x;
                *xt -= turn * p.y;
                *yx += grow * p.y * q.x - turn * p.x * q.y;
                *yy += shift + turn * p.x * q.x + grow * p.y * q.y;
                *yt += turn * p.x;
                *tx -= turn * q.y;
                *ty += turn * q.x;
                *tt += turn;
            }
        }
    }

    /// The step of one landmark after that of the poses, and what its residuals add, as the linear model predicts them
    /// after the step, to the two numbers of a [`Prediction`](crate::lm::Prediction::new).
    #[inline]
    pub(super) fn step_of_landmark(&self, landmark: usize) -> Option<(Vector2<T>, [T; 2])> {
        let (rows, factor) = (self.rows.get(landmark)?, self.points.get(landmark)?);
        let moved = |row: &BearingRow<T>, step: &[T; 3]| {
            let [a, b, c] = minus_pose(row);
            let [x, y, theta] = step;
            row.residual - a * *x - b * *y - c * *theta
        };
        let mut gradient = [T::zero(); 2];
        for (row, step) in rows.iter().zip(&self.step) {
            let residual = moved(row, step);
            for (gradient, slope) in gradient.iter_mut().zip(row.landmark()) {
                *gradient -= slope * residual;
            }
        }
        let by = factor.backward(factor.forward(gradient));
        let (mut left, mut curvature) = (T::zero(), T::zero());
        for (row, step) in rows.iter().zip(&self.step) {
            let residual = moved(row, step) + dot(&row.landmark(), &by);
            let decrease = row.residual - residual;
            left += decrease * residual;
            curvature += decrease * decrease;
        }
        Some((Vector2::from(by), [left, curvature]))
    }
}

/// Minus the derivative with respect to the pose `(x, y, theta)`: in products of two the signs cancel.
#[inline]
fn minus_pose<T: Real>(row: &BearingRow<T>) -> [T; 3] {
    [row.gradient.x, row.gradient.y, row.weight]
}

#[inline]
fn dot<T: Real>([a, b]: &[T; 2], [x, y]: &[T; 2]) -> T {
    *a * *x + *b * *y
}

/// `block += scale a b^T`.
#[inline]
fn add_product<T: Real>(block: &mut Block<T>, scale: T, a: &[T; 3], b: &[T; 3]) {
    for (row, a) in block.iter_mut().zip(a) {
        let a = *a * scale;
        for (entry, b) in row.iter_mut().zip(b) {
            *entry += a * *b;
        }
    }
}
