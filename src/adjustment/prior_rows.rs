// SPDX-License-Identifier: MIT OR Apache-2.0
//! Odometry and priors linearised.

use crate::geometry::{Pose, signed_angle};
use crate::problem::{Prior, Subject};
use nalgebra::{Point2, Vector2};

/// Odometry or a prior linearised: residuals and derivatives, all multiplied by the square root of the information.
///
/// For a landmark the third row and column are zero.
#[derive(Clone, Copy, Debug)]
pub struct PriorRow {
    /// The subjects, and the derivatives of the residuals with respect to their parameters.
    pub first: (Subject, [[f64; 3]; 3]),
    pub second: Option<(Subject, [[f64; 3]; 3])>,
    pub residual: [f64; 3],
}

/// Linearises odometry or a prior, (T25).
///
/// Odometry: `e = Z^-1 (P_i^-1 P_j)` as `(x, y, theta)`. Priors: estimate minus prior in the map frame.
pub fn linearize(prior: &Prior, poses: &[Pose<f64>], landmarks: &[Point2<f64>]) -> PriorRow {
    match prior {
        Prior::Motion {
            start,
            end,
            delta,
            root,
        } => {
            let (from, to) = (&poses[*start], &poses[*end]);
            let error = delta.inv_mul(&from.inv_mul(to));
            // Rotates a step in the map frame into the frame of the measured end.
            let back = (from.rotation * delta.rotation).inverse().into_inner();
            let (c, s) = (back.re, back.im);
            let offset = to.translation.vector - from.translation.vector;
            let swung = Vector2::new(offset.y * c + offset.x * s, offset.y * s - offset.x * c);
            let before = [[-c, s, swung.x], [-s, -c, swung.y], [0.0, 0.0, -1.0]];
            let after = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
            PriorRow {
                first: (Subject::View(*start), product(root, &before)),
                second: Some((Subject::View(*end), product(root, &after))),
                residual: whitened(
                    root,
                    [
                        error.translation.x,
                        error.translation.y,
                        signed_angle(error.rotation.re, error.rotation.im),
                    ],
                ),
            }
        }
        Prior::Pose { view, pose, root } => {
            let estimate = &poses[*view];
            let offset = estimate.translation.vector - pose.translation.vector;
            let turn = pose.rotation.inverse() * estimate.rotation;
            PriorRow {
                first: (Subject::View(*view), *root),
                second: None,
                residual: whitened(root, [offset.x, offset.y, signed_angle(turn.re, turn.im)]),
            }
        }
        Prior::Landmark {
            landmark,
            position,
            root,
        } => {
            let offset = landmarks[*landmark] - position;
            let [[a, b], [c, d]] = *root;
            let wide = [[a, b, 0.0], [c, d, 0.0], [0.0; 3]];
            PriorRow {
                first: (Subject::Landmark(*landmark), wide),
                second: None,
                residual: whitened(&wide, [offset.x, offset.y, 0.0]),
            }
        }
    }
}

impl PriorRow {
    /// Sum of squared residuals.
    pub fn square(&self) -> f64 {
        self.residual.iter().fold(0.0, |sum, r| sum + *r * *r)
    }

    /// The number of residuals that have weight: those with a non-zero derivative.
    pub fn count(&self) -> usize {
        let weighs = |row: &&[f64; 3]| row.iter().any(|entry| *entry != 0.0);
        self.first.1.iter().filter(weighs).count()
    }
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    core::array::from_fn(|i| {
        core::array::from_fn(|j| (0..3).fold(0.0, |sum, k| sum + a[i][k] * b[k][j]))
    })
}

/// The product of a square root of information with a residual. Entries without weight add nothing, even where the
/// residual is infinite.
fn whitened(root: &[[f64; 3]; 3], residual: [f64; 3]) -> [f64; 3] {
    root.map(|row| {
        row.iter()
            .zip(residual)
            .filter(|(weight, _)| **weight != 0.0)
            .fold(0.0, |sum, (weight, r)| sum + *weight * r)
    })
}

#[cfg(test)]
mod tests {
    use super::super::bundle::Bundle;
    use super::*;
    use crate::geometry::pose;
    use crate::problem::Noise;
    use alloc::vec;
    use alloc::vec::Vec;
    use nalgebra::Vector3;

    fn covariance() -> [[f64; 3]; 3] {
        [[0.04, 0.01, 0.0], [0.01, 0.09, 0.002], [0.0, 0.002, 0.01]]
    }

    #[test]
    fn derivatives_are_differences_of_residuals() {
        let bundle = Bundle {
            poses: vec![pose(0.1, 0.2, 0.3), pose(2.0, -1.0, 2.5)],
            landmarks: vec![Point2::new(1.0, 2.0)],
        };
        let root = Noise::Covariance(covariance()).root("", 0).unwrap();
        let priors = [
            Prior::Motion {
                start: 1,
                end: 0,
                delta: pose(1.0, 0.4, -0.7),
                root,
            },
            Prior::Pose {
                view: 1,
                pose: pose(1.0, 1.0, -3.0),
                root,
            },
            Prior::Landmark {
                landmark: 0,
                position: Point2::new(0.0, 0.3),
                root: Noise::Sigmas([0.1, 0.3]).root("", 0).unwrap(),
            },
        ];
        let step = 1e-6;
        for prior in priors {
            let row = linearize(&prior, &bundle.poses, &bundle.landmarks);
            for (subject, jacobian) in [Some(row.first), row.second].into_iter().flatten() {
                for parameter in 0..3 {
                    let sides = [-step, step].map(|size| {
                        let mut poses: Vec<Vector3<f64>> = vec![Vector3::zeros(); 2];
                        let mut landmarks: Vec<Vector2<f64>> = vec![Vector2::zeros()];
                        match subject {
                            Subject::View(view) => poses[view][parameter] = size,
                            Subject::Landmark(landmark) if parameter < 2 => {
                                landmarks[landmark][parameter] = size;
                            }
                            Subject::Landmark(_) => {}
                        }
                        let mut moved = bundle.clone();
                        bundle.step(&poses, &landmarks, &mut moved);
                        linearize(&prior, &moved.poses, &moved.landmarks).residual
                    });
                    for k in 0..3 {
                        let difference = (sides[1][k] - sides[0][k]) / (2.0 * step);
                        let found = jacobian[k][parameter];
                        assert!(
                            (difference - found).abs() < 1e-7,
                            "{prior:?} {difference} {found}"
                        );
                    }
                }
            }
        }
    }
}
