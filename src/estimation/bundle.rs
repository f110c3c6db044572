// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parameters, residuals and derivatives of the full problem.
//!
//! Residual of a sighting: `r = arg(e^{-i bearing} e^{-i theta} (x - p))`, predicted minus measured in
//! (-pi, pi], over sigma. With `d = x - p` and `g = (-d_y, d_x) / |d|^2`, (T12):
//! `dr/dx = g`, `dr/dp = -g`, `dr/dtheta = -1`.

use super::map::Map;
use super::problem::Problem;
use crate::geometry::{Pose, signed_angle};
use crate::scalar::Real;
use alloc::vec::Vec;
use nalgebra::{Point2, Translation2, UnitComplex, Vector2, Vector3};

/// A complete map: every view and landmark has a value.
#[derive(Clone, Debug)]
pub struct Bundle<T: Real> {
    pub poses: Vec<Pose<T>>,
    pub landmarks: Vec<Point2<T>>,
}

/// A sighting linearised: residual and derivatives, all over sigma.
#[derive(Clone, Copy, Debug)]
pub struct Row<T: Real> {
    /// Derivative with respect to the landmark, minus that with respect to the position.
    pub gradient: Vector2<T>,
    /// Minus the derivative with respect to the heading: one over sigma.
    pub weight: T,
    /// The residual.
    pub residual: T,
}

impl<T: Real> Row<T> {
    /// Derivative with respect to the pose `(x, y, theta)`.
    #[inline]
    pub fn pose(&self) -> [T; 3] {
        [-self.gradient.x, -self.gradient.y, -self.weight]
    }

    /// Derivative with respect to the landmark `(x, y)`.
    #[inline]
    pub fn landmark(&self) -> [T; 2] {
        [self.gradient.x, self.gradient.y]
    }
}

impl<T: Real> Bundle<T> {
    /// The determined part of a map.
    pub fn from_map(map: &Map<T>) -> Self {
        Self {
            poses: map.poses.iter().flatten().copied().collect(),
            landmarks: map.landmarks.iter().flatten().copied().collect(),
        }
    }

    /// Writes the values back into the determined places of the map they came from.
    pub fn write_to(&self, map: &mut Map<T>) {
        for (to, from) in map.poses.iter_mut().flatten().zip(&self.poses) {
            *to = *from;
        }
        for (to, from) in map.landmarks.iter_mut().flatten().zip(&self.landmarks) {
            *to = *from;
        }
    }

    /// Linearises every sighting; returns half the sum of squared residuals.
    pub fn linearize(&self, problem: &Problem<T>, rows: &mut Vec<Row<T>>) -> T {
        rows.clear();
        let mut sum = T::zero();
        for (view, pose) in self.poses.iter().enumerate() {
            for s in problem.of_view(view) {
                let offset = self.landmarks[s.landmark].coords - pose.translation.vector;
                let ray = pose.rotation.into_inner() * s.bearing.into_inner();
                let along = ray.re * offset.x + ray.im * offset.y;
                let across = ray.re * offset.y - ray.im * offset.x;
                let residual = signed_angle(along, across) * s.weight;
                let square = offset.norm_squared();
                // A landmark exactly on its view has no bearing and pulls nowhere.
                let scale = if square > T::zero() {
                    s.weight / square
                } else {
                    T::zero()
                };
                sum += residual * residual;
                rows.push(Row {
                    gradient: Vector2::new(-offset.y * scale, offset.x * scale),
                    weight: s.weight,
                    residual,
                });
            }
        }
        sum * T::lit(0.5)
    }

    /// Applies a step: positions are added to, headings turned.
    pub fn step(&self, poses: &[Vector3<T>], landmarks: &[Vector2<T>], result: &mut Self) {
        for ((to, from), step) in result.poses.iter_mut().zip(&self.poses).zip(poses) {
            let turned = from.rotation.into_inner() * UnitComplex::new(step.z).into_inner();
            // First-order normalisation keeps rounding from adding up.
            let scale = (T::lit(3.0) - turned.norm_sqr()) * T::lit(0.5);
            *to = Pose::from_parts(
                Translation2::from(from.translation.vector + step.xy()),
                UnitComplex::new_unchecked(turned * scale),
            );
        }
        for ((to, from), step) in result
            .landmarks
            .iter_mut()
            .zip(&self.landmarks)
            .zip(landmarks)
        {
            *to = from + step;
        }
    }
}
