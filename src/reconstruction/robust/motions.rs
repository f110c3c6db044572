// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cost and placement of one view by its odometry and the landmarks of the map.

use super::consensus::{OUTLIER, square};
use crate::geometry::{Pose, pose};
use crate::lm::Loss;
use crate::problem::{Map, Prior, Problem};
use alloc::vec::Vec;
use nalgebra::{Matrix3, Vector3};

/// A motion from a view: the pose of the other end in the frame of the view.
pub struct OdometryLink {
    pub end: usize,
    pub delta: Pose<f64>,
    /// Square root of the information, in the frame of the end of the motion as it was measured.
    root: Matrix3<f64>,
    forward: bool,
}

/// The motions of each view.
pub struct Motions {
    of: Vec<Vec<OdometryLink>>,
}

impl Motions {
    pub fn new(problem: &Problem) -> Self {
        let mut of: Vec<Vec<OdometryLink>> = (0..problem.views()).map(|_| Vec::new()).collect();
        for prior in problem.priors() {
            let Prior::Motion {
                start,
                end,
                delta,
                root,
            } = prior
            else {
                continue;
            };
            let root = Matrix3::from_fn(|i, j| root[i][j]);
            for (from, end, delta, forward) in [
                (*start, *end, *delta, true),
                (*end, *start, delta.inverse(), false),
            ] {
                of[from].push(OdometryLink {
                    end,
                    delta,
                    root,
                    forward,
                });
            }
        }
        Self { of }
    }

    pub fn of(&self, view: usize) -> &[OdometryLink] {
        &self.of[view]
    }

    /// Twice the cost of a view at a pose with everything else fixed: the squares of its motions to other views of
    /// the map, and of its sightings, the latter each at most that of an outlier.
    pub fn cost(&self, problem: &Problem, map: &Map, view: usize, at: &Pose<f64>) -> f64 {
        let most = OUTLIER * OUTLIER;
        let mut cost = 0.0;
        for (point, s) in map.seen(problem, view) {
            cost += square(problem, s, at, &point).min(most);
        }
        for motion in &self.of[view] {
            if let Some(other) = &map.poses[motion.end] {
                let off = if motion.forward {
                    (at * motion.delta).inv_mul(other)
                } else {
                    (other * motion.delta.inverse()).inv_mul(at)
                };
                cost += (motion.root * vector(&off)).norm_squared();
            }
        }
        cost
    }
}

fn vector(pose: &Pose<f64>) -> Vector3<f64> {
    let place = &pose.translation;
    Vector3::new(place.x, place.y, pose.rotation.angle())
}

/// The pose at the end of a motion from a known pose. It minimises the square of the motion's error plus
/// Cauchy's loss of the bearings to landmarks in the map.
///
/// At most `steps` Gauss-Newton steps. The error is weighted in the frame of this end, whichever way the motion
/// was measured: the heading hardly changes between the two ends.
pub fn moved(
    problem: &Problem,
    map: &Map,
    from: &Pose<f64>,
    motion: &OdometryLink,
    steps: usize,
) -> Pose<f64> {
    let predicted = from * motion.delta;
    let seen: Vec<_> = map.seen(problem, motion.end).collect();
    let loss = Loss::Cauchy(Loss::<f64>::CAUCHY);
    let linearize = |at: &Pose<f64>| {
        let error = motion.root * vector(&predicted.inv_mul(at));
        let mut cost = error.norm_squared();
        let mut gradient = motion.root.tr_mul(&error);
        let mut normal = motion.root.tr_mul(&motion.root);
        for (point, s) in &seen {
            let local = at.inverse_transform_point(point);
            let range = local.coords.norm_squared();
            if !(range > 0.0) {
                continue;
            }
            let residual = problem.residual(at, point, s) * s.weight;
            let (value, slope) = loss.evaluate(residual * residual);
            let row = Vector3::new(local.y / range, -local.x / range, -1.0) * s.weight;
            cost += value;
            gradient += row * (residual * slope);
            normal += row * row.transpose() * slope;
        }
        (cost, gradient, normal)
    };
    let mut best = predicted;
    let (mut cost, mut gradient, mut normal) = linearize(&best);
    for _ in 0..steps {
        let Some(factor) = normal.cholesky() else {
            break;
        };
        let step = factor.solve(&gradient);
        let trial = best * pose(-step.x, -step.y, -step.z);
        let then = linearize(&trial);
        if !(then.0 < cost) {
            break;
        }
        best = trial;
        (cost, gradient, normal) = then;
    }
    best
}
