// SPDX-License-Identifier: MIT OR Apache-2.0
//! What is known besides bearings: odometry, poses, landmarks, each with its uncertainty.

use super::bundle::Bundle;
use super::map::Subject;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::{Pose, signed_angle};
use nalgebra::{Point2, Vector2};

/// The measured motion from one view to another: the pose of `end` in the frame of `start`.
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 2.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometry {
    /// Index of the view at the start.
    pub start: usize,
    /// Index of the view at the end.
    pub end: usize,
    /// Pose of the view at the end in the frame of that at the start.
    pub delta: Pose<f64>,
    /// How well it is known: x and y in the frame of the end, heading \[rad\].
    pub noise: Noise<3>,
}

/// A pose that is known beforehand, in the map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePrior {
    /// Index of the view.
    pub view: usize,
    /// Its pose.
    pub pose: Pose<f64>,
    /// How well it is known: x and y in the map frame, heading \[rad\]. An infinite standard deviation
    /// is for what is not known: a compass gives the heading only.
    pub noise: Noise<3>,
}

/// A landmark whose position is known beforehand: a beacon, a survey point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkPrior {
    /// Index of the landmark.
    pub landmark: usize,
    /// Its position in the map frame.
    pub position: Point2<f64>,
    /// How well it is known, in the map frame.
    pub noise: Noise<2>,
}

/// The uncertainty of several numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise<const N: usize> {
    /// Independent standard deviations, above zero.
    Sigmas([f64; N]),
    /// A covariance, symmetric and positive definite.
    Covariance([[f64; N]; N]),
}

/// Largest difference of two entries of a covariance that should be the same, over the largest entry:
/// files give six digits or more.
const ASYMMETRY: f64 = 1e-5;

impl<const N: usize> Noise<N> {
    /// The root of the information: a lower triangle `W` with `W^T W` the inverse of the covariance.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for a standard deviation or a pivot of the covariance that is not positive,
    /// or whose inverse square is not a number; [`Error::NotFinite`] for a covariance that is not;
    /// [`Error::NotSymmetric`].
    pub(super) fn root(&self, what: &'static str, index: usize) -> Result<[[f64; N]; N], Error> {
        let refuse = |value: f64| Error::NotPositive {
            what,
            index,
            value: value,
        };
        // Its square must be a number as well, or the cost is none.
        let usable = |weight: f64| {
            let square = weight * weight;
            square > 0.0 && square.is_finite()
        };
        let mut root = [[0.0; N]; N];
        match self {
            Self::Sigmas(sigmas) => {
                for (k, &sigma) in sigmas.iter().enumerate() {
                    let weight = 1.0 / sigma;
                    let unknown = sigma == 1.0 / 0.0;
                    if !(sigma > 0.0 && (unknown || usable(weight))) {
                        return Err(refuse(sigma));
                    }
                    root[k][k] = weight;
                }
            }
            Self::Covariance(covariance) => {
                let entries = covariance.as_flattened();
                if entries.iter().any(|entry| !entry.is_finite()) {
                    return Err(Error::NotFinite { what, index });
                }
                let size = entries.iter().fold(0.0_f64, |size, e| size.max(e.abs()));
                // The Cholesky factor L, and its inverse row by row.
                let mut factor = [[0.0; N]; N];
                for i in 0..N {
                    for j in 0..=i {
                        if (covariance[i][j] - covariance[j][i]).abs() > size * ASYMMETRY {
                            return Err(Error::NotSymmetric { what, index });
                        }
                        let mut sum = covariance[i][j];
                        for k in 0..j {
                            sum -= factor[i][k] * factor[j][k];
                        }
                        if i > j {
                            factor[i][j] = sum / factor[j][j];
                        } else if sum > 0.0 && usable(1.0 / sum.sqrt()) {
                            factor[i][i] = sum.sqrt();
                        } else {
                            return Err(refuse(sum));
                        }
                    }
                    for j in 0..=i {
                        let mut sum = if i == j { 1.0 } else { 0.0 };
                        for k in j..i {
                            sum -= factor[i][k] * root[k][j];
                        }
                        root[i][j] = sum / factor[i][i];
                    }
                }
            }
        }
        Ok(root)
    }
}

/// Something known of one or two subjects, as the problem keeps it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Tie {
    Motion {
        start: usize,
        end: usize,
        delta: Pose<f64>,
        root: [[f64; 3]; 3],
    },
    Pose {
        view: usize,
        pose: Pose<f64>,
        root: [[f64; 3]; 3],
    },
    Landmark {
        landmark: usize,
        position: Point2<f64>,
        root: [[f64; 2]; 2],
    },
}

/// A tie linearised: residuals and derivatives, all times the root of the information.
///
/// For a landmark the third row and column are zero.
#[derive(Clone, Copy, Debug)]
pub struct TieRow {
    /// The subjects, and the derivatives of the residuals with respect to their parameters.
    pub first: (Subject, [[f64; 3]; 3]),
    pub second: Option<(Subject, [[f64; 3]; 3])>,
    pub residual: [f64; 3],
}

impl Tie {
    /// The subjects that it holds.
    pub(crate) fn subjects(&self) -> [Option<Subject>; 2] {
        match *self {
            Self::Motion { start, end, .. } => {
                [Some(Subject::View(start)), Some(Subject::View(end))]
            }
            Self::Pose { view, .. } => [Some(Subject::View(view)), None],
            Self::Landmark { landmark, .. } => [Some(Subject::Landmark(landmark)), None],
        }
    }

    /// The same between subjects numbered anew, with all lengths times a factor.
    pub(super) fn moved(
        &self,
        view: impl Fn(usize) -> usize,
        landmark: impl Fn(usize) -> usize,
        factor: f64,
    ) -> Self {
        let stretched = |pose: &Pose<f64>| {
            let mut pose = *pose;
            pose.translation.vector *= factor;
            pose
        };
        // Weights of lengths go the other way; the third column belongs to the heading.
        let looser =
            |root: &[[f64; 3]; 3]| root.map(|[x, y, heading]| [x / factor, y / factor, heading]);
        match self {
            Self::Motion {
                start,
                end,
                delta,
                root,
            } => Self::Motion {
                start: view(*start),
                end: view(*end),
                delta: stretched(delta),
                root: looser(root),
            },
            Self::Pose {
                view: index,
                pose,
                root,
            } => Self::Pose {
                view: view(*index),
                pose: stretched(pose),
                root: looser(root),
            },
            Self::Landmark {
                landmark: index,
                position,
                root,
            } => Self::Landmark {
                landmark: landmark(*index),
                position: position * factor,
                root: root.map(|row| row.map(|entry| entry / factor)),
            },
        }
    }

    /// Linearises at a bundle, (T25).
    ///
    /// Odometry: `e = Z^-1 (P_i^-1 P_j)` as `(x, y, theta)`. Priors: estimate less prior in the map frame.
    pub(super) fn linearize(&self, bundle: &Bundle) -> TieRow {
        let (zero, one) = (0.0, 1.0);
        match self {
            Self::Motion {
                start,
                end,
                delta,
                root,
            } => {
                let (from, to) = (&bundle.poses[*start], &bundle.poses[*end]);
                let error = delta.inv_mul(&from.inv_mul(to));
                // Turns a step of the map frame into the frame of the measured end.
                let back = (from.rotation * delta.rotation).inverse().into_inner();
                let (c, s) = (back.re, back.im);
                let offset = to.translation.vector - from.translation.vector;
                let swung = Vector2::new(offset.y * c + offset.x * s, offset.y * s - offset.x * c);
                let before = [[-c, s, swung.x], [-s, -c, swung.y], [zero, zero, -one]];
                let after = [[c, -s, zero], [s, c, zero], [zero, zero, one]];
                TieRow {
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
            Self::Pose { view, pose, root } => {
                let estimate = &bundle.poses[*view];
                let offset = estimate.translation.vector - pose.translation.vector;
                let turn = pose.rotation.inverse() * estimate.rotation;
                TieRow {
                    first: (Subject::View(*view), *root),
                    second: None,
                    residual: whitened(root, [offset.x, offset.y, signed_angle(turn.re, turn.im)]),
                }
            }
            Self::Landmark {
                landmark,
                position,
                root,
            } => {
                let offset = bundle.landmarks[*landmark] - position;
                let [[a, b], [c, d]] = *root;
                let wide = [[a, b, zero], [c, d, zero], [zero; 3]];
                TieRow {
                    first: (Subject::Landmark(*landmark), wide),
                    second: None,
                    residual: whitened(&wide, [offset.x, offset.y, zero]),
                }
            }
        }
    }
}

impl TieRow {
    /// Sum of squared residuals.
    pub fn square(&self) -> f64 {
        self.residual.iter().fold(0.0, |sum, r| sum + *r * *r)
    }

    /// Residuals that count: those with a derivative.
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

/// The product of a root of information with a residual; what has no weight adds nothing, even if it is
/// infinite.
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
    use super::*;
    use crate::geometry::pose;
    use alloc::vec;
    use alloc::vec::Vec;
    use nalgebra::{Matrix3, Vector3};

    fn covariance() -> [[f64; 3]; 3] {
        [[0.04, 0.01, 0.0], [0.01, 0.09, 0.002], [0.0, 0.002, 0.01]]
    }

    #[test]
    fn root_of_information_inverts_the_covariance() {
        let root = Noise::Covariance(covariance()).root("odometry", 0).unwrap();
        let root = Matrix3::from_fn(|i, j| root[i][j]);
        let product = root.transpose() * root * Matrix3::from_fn(|i, j| covariance()[i][j]);
        assert!((product - Matrix3::identity()).norm() < 1e-13);
        let sigmas = Noise::Sigmas([2.0, f64::INFINITY, 0.5]).root("pose", 0);
        assert_eq!(
            sigmas.unwrap(),
            [[0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]
        );
        for bad in [
            Noise::Sigmas([1.0, 0.0]),
            Noise::Sigmas([1.0, f64::NAN]),
            Noise::Sigmas([-1.0, 1.0]),
            Noise::Covariance([[1.0, 2.0], [2.0, 1.0]]),
            Noise::Covariance([[1.0, 0.5], [0.1, 1.0]]),
            Noise::Covariance([[1.0, f64::NAN], [f64::NAN, 1.0]]),
        ] {
            assert!(bad.root("landmark", 3).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn derivatives_are_differences_of_residuals() {
        let bundle = Bundle {
            poses: vec![pose(0.1, 0.2, 0.3), pose(2.0, -1.0, 2.5)],
            landmarks: vec![Point2::new(1.0, 2.0)],
        };
        let root = Noise::Covariance(covariance()).root("", 0).unwrap();
        let ties = [
            Tie::Motion {
                start: 1,
                end: 0,
                delta: pose(1.0, 0.4, -0.7),
                root,
            },
            Tie::Pose {
                view: 1,
                pose: pose(1.0, 1.0, -3.0),
                root,
            },
            Tie::Landmark {
                landmark: 0,
                position: Point2::new(0.0, 0.3),
                root: Noise::Sigmas([0.1, 0.3]).root("", 0).unwrap(),
            },
        ];
        let step = 1e-6;
        for tie in ties {
            let row = tie.linearize(&bundle);
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
                        tie.linearize(&moved).residual
                    });
                    for k in 0..3 {
                        let difference = (sides[1][k] - sides[0][k]) / (2.0 * step);
                        let found = jacobian[k][parameter];
                        assert!(
                            (difference - found).abs() < 1e-7,
                            "{tie:?} {difference} {found}"
                        );
                    }
                }
            }
        }
    }
}
