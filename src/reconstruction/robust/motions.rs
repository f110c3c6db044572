// SPDX-License-Identifier: MIT OR Apache-2.0
//! One view against its neighbours in the odometry and the landmarks of the map.

use super::consensus::{OUTLIER, square};
use crate::geometry::{Pose, pose};
use crate::lm::Loss;
use crate::problem::{IndexedSighting, Map, Prior, Problem};
use alloc::vec::Vec;
use nalgebra::{Matrix3, Point2, Vector3};

/// A motion from a view, as the pose of its other end in its frame.
pub struct OdometryLink {
    pub end: usize,
    pub delta: Pose<f64>,
    /// The root of the information, in the frame of `end` if that is where it was measured.
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

    /// What the motions from or to views of a map tell of the pose of a view.
    pub fn terms<'a>(&'a self, map: &'a Map, view: usize) -> impl Iterator<Item = PoseTerm> + 'a {
        self.of[view].iter().filter_map(|motion| {
            let other = map.poses[motion.end]?;
            Some(PoseTerm {
                wanted: other * motion.delta.inverse(),
                root: motion.root,
                in_map_frame: false,
            })
        })
    }

    /// Twice the cost of a view at a pose while nothing else moves: the squares of its motions to other views of the
    /// map, and of its sightings, each at most that of an outlier.
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

/// What pulls at the pose of a view besides its bearings: a pose that is wanted, and how much.
#[derive(Clone, Copy)]
pub struct PoseTerm {
    pub wanted: Pose<f64>,
    /// The root of the information.
    root: Matrix3<f64>,
    /// Whether offsets are measured in the map frame; otherwise in that of the wanted pose.
    in_map_frame: bool,
}

impl PoseTerm {
    /// A prior.
    pub fn prior(pose: &Pose<f64>, root: &[[f64; 3]; 3]) -> Self {
        Self {
            wanted: *pose,
            root: Matrix3::from_fn(|i, j| root[i][j]),
            in_map_frame: true,
        }
    }

    /// The pose at the end of a motion from a known pose. It is weighed in the frame of its end whichever way it was measured:
    /// between the two it hardly turns.
    pub fn motion(from: &Pose<f64>, motion: &OdometryLink) -> Self {
        Self {
            wanted: from * motion.delta,
            root: motion.root,
            in_map_frame: false,
        }
    }

    /// The residual at a pose, and what turns a step in the frame of the pose into one of the residual.
    fn linearize(&self, at: &Pose<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let turn = (self.wanted.rotation.inverse() * at.rotation).angle();
        let (offset, rotation) = if self.in_map_frame {
            (
                at.translation.vector - self.wanted.translation.vector,
                at.rotation,
            )
        } else {
            let error = self.wanted.inv_mul(at);
            (error.translation.vector, error.rotation)
        };
        let (sin, cos) = (rotation.im, rotation.re);
        let step = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        let residual = self.root * Vector3::new(offset.x, offset.y, turn);
        (residual, self.root * step)
    }

    /// The square of the residual at a pose.
    pub fn square(&self, at: &Pose<f64>) -> f64 {
        self.linearize(at).0.norm_squared()
    }
}

/// The pose at the end of a motion from a known pose: the minimum next to it of the square of the motion and of
/// Cauchy's loss of the bearings to what the map has.
pub fn moved(
    problem: &Problem,
    map: &Map,
    from: &Pose<f64>,
    motion: &OdometryLink,
    steps: usize,
) -> Pose<f64> {
    let seen: Vec<_> = map.seen(problem, motion.end).collect();
    let term = PoseTerm::motion(from, motion);
    let predicted = term.wanted;
    let loss = Loss::Cauchy(Loss::<f64>::CAUCHY);
    descend_view(problem, &seen, &[term], loss, predicted, steps)
}

/// The minimum next to a pose of the squares of what pulls at it and of a loss of its bearings, by at most so many
/// steps of Gauss-Newton.
pub fn descend_view(
    problem: &Problem,
    seen: &[(Point2<f64>, &IndexedSighting)],
    terms: &[PoseTerm],
    loss: Loss<f64>,
    start: Pose<f64>,
    steps: usize,
) -> Pose<f64> {
    let linearize = |at: &Pose<f64>| {
        let (mut cost, mut gradient, mut normal) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for term in terms {
            let (error, jacobian) = term.linearize(at);
            cost += error.norm_squared();
            gradient += jacobian.tr_mul(&error);
            normal += jacobian.tr_mul(&jacobian);
        }
        for (point, s) in seen {
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
    let mut best = start;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// Exact bearings, and with none a prior, bring a view back to where it was.
    #[test]
    fn a_view_descends_to_its_bearings_and_its_prior() {
        let scene = simulate(Layout::Enclosed, 3, 12, 0.0, 4, Arena::default()).unwrap();
        let problem = Problem::dense(3, 12, &scene.bearings, 0.01).unwrap();
        let map = scene.map();
        let root = [[20.0, 3.0, 0.0], [0.0, 10.0, 1.0], [0.0, 0.0, 50.0]];
        for (view, truth) in scene.poses.iter().enumerate() {
            let seen: Vec<_> = map.seen(&problem, view).collect();
            let prior = [PoseTerm::prior(truth, &root)];
            let start = truth * pose(0.05, -0.04, 0.03);
            for (seen, terms) in [(&seen[..], &prior[..0]), (&[], &prior), (&seen, &prior)] {
                let loss = Loss::Cauchy(Loss::<f64>::CAUCHY);
                let found = descend_view(&problem, seen, terms, loss, start, 30);
                let error = vector(&truth.inv_mul(&found)).norm();
                assert!(error < 1e-9, "{view}: {error:e}");
                // A step that raises the cost is not taken.
                let stays = descend_view(&problem, seen, terms, loss, *truth, 30);
                let error = vector(&truth.inv_mul(&stays)).norm();
                assert!(error < 1e-9, "{view}: {error:e}");
            }
        }
    }

    /// What turns a step in the frame of the pose into one of the residual is its derivative, of a prior and of a motion.
    #[test]
    fn terms_are_linearized_at_a_pose() {
        let root = [[20.0, 3.0, 0.5], [0.0, 10.0, 1.0], [0.0, 0.0, 50.0]];
        let link = OdometryLink {
            end: 0,
            delta: pose(0.7, -0.2, 0.4),
            root: Matrix3::from_fn(|i, j| root[i][j]),
            forward: true,
        };
        let at = pose(1.0, 2.0, 0.9);
        for term in [
            PoseTerm::prior(&pose(0.8, 2.3, 0.6), &root),
            PoseTerm::motion(&pose(0.2, 2.1, 0.3), &link),
        ] {
            let (residual, jacobian) = term.linearize(&at);
            assert!((term.square(&at) / residual.norm_squared() - 1.0).abs() < 1e-12);
            let length = 1e-6;
            for k in 0..3 {
                let sides = [-length, length].map(|length| {
                    let mut step = [0.0; 3];
                    step[k] = length;
                    term.linearize(&(at * pose(step[0], step[1], step[2]))).0
                });
                let difference = (sides[1] - sides[0]) / (2.0 * length);
                assert!(
                    (difference - jacobian.column(k)).norm() < 1e-6,
                    "{k}: {difference}"
                );
            }
        }
    }
}
