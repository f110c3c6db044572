// SPDX-License-Identifier: MIT OR Apache-2.0
//! Alignment of a map with odometry and priors by a similarity.
//!
//! Bearings do not change when a map is moved, turned and scaled as a whole. So a map is first aligned with odometry
//! and priors as well as possible; priors that only define the datum are then satisfied exactly before the refinement.

use super::bundle::Bundle;
use super::decompose::pseudo_inverse;
use super::elimination::kept_positions;
use super::gauge::FixedByPriors;
use super::linear_similarity::{LinearSimilarity, UNKNOWNS};
use super::prior_rows::linearize;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::centroid;
use crate::problem::{Map, Prior, Problem, Subject};
use alloc::vec::Vec;
use nalgebra::{
    Complex, DMatrix, Matrix4, Point2, Similarity2, Translation2, UnitComplex, Vector2, Vector4,
};

/// Maximum number of Gauss-Newton steps for the four parameters of a similarity. It converges in a few; this bounds the
/// time.
const STEPS: usize = 30;

/// Maximum number of times that a step is quartered if it does not lower the cost. Eight are a factor of 65,536: the
/// cost is then at its minimum, up to rounding.
const QUARTERINGS: usize = 8;

/// The descent ends when a step lowers the cost by less than this fraction of it: the rest is small beside what the
/// following refinement changes.
const TOLERANCE: f64 = 1e-12;

/// The map after the similarity with the least cost of odometry and priors: the lowest minimum that is reached from
/// the given map and from a few initial guesses.
///
/// With bearings modulo pi each heading may be turned by pi as well, independently of the others.
pub fn aligned_to_priors(problem: &Problem, map: &Map) -> Map {
    let active = map.restrict(problem);
    if active.priors().is_empty() || map.poses.iter().flatten().next().is_none() {
        return map.clone();
    }
    let bundle = Bundle::from_map(map);
    let frames = first_frames(&active, &bundle).into_iter();
    let fits = frames.chain([Similarity2::identity()]).map(|frame| {
        let mut bundle = bundle.clone();
        bundle.transform(&frame);
        fit_similarity(&active, bundle)
    });
    // Of equals the first: the map as it is comes last, because it may be far from where the priors want it.
    let best = fits.min_by(|a, b| a.0.total_cmp(&b.0));
    let mut result = map.clone();
    if let Some((_, bundle)) = best {
        bundle.write_to(&mut result);
    }
    result
}

/// Twice the cost of odometry and priors.
fn cost(problem: &Problem, bundle: &Bundle) -> f64 {
    let priors = problem.priors().iter();
    priors.fold(0.0, |sum, prior| {
        sum + linearize(prior, &bundle.poses, &bundle.landmarks).square()
    })
}

/// Turns headings that are known modulo pi by pi where that brings them closer to their prior, or to the heading that
/// odometry predicts from the previous view.
fn turn_round(problem: &Problem, bundle: &mut Bundle) {
    if problem.is_oriented() {
        return;
    }
    for prior in problem.priors() {
        let (view, wanted) = match prior {
            Prior::Pose { view, pose, root } if root[2][2] > 0.0 => (*view, pose.rotation),
            Prior::Motion {
                start, end, delta, ..
            } => (*end, bundle.poses[*start].rotation * delta.rotation),
            _ => continue,
        };
        let rotation = &mut bundle.poses[view].rotation;
        let apart = wanted.inverse() * *rotation;
        if apart.re < 0.0 {
            *rotation = UnitComplex::new_unchecked(-rotation.into_inner());
        }
    }
}

/// Initial guesses of the similarity: from the positions of priors, and from their headings together with the lengths
/// of motions.
fn first_frames(problem: &Problem, bundle: &Bundle) -> Vec<Similarity2<f64>> {
    let mut pairs: Vec<(Point2<f64>, Point2<f64>)> = Vec::new();
    let mut places = LinearSimilarity::default();
    let mut turn = Complex::new(0.0, 0.0);
    let (mut lengths, mut squares) = (0.0, 0.0);
    for prior in problem.priors() {
        match prior {
            Prior::Landmark {
                landmark, position, ..
            } => {
                let estimate = &bundle.landmarks[*landmark];
                places.add_point(estimate, position);
                pairs.push((*estimate, *position));
            }
            Prior::Pose { view, pose, root } => {
                let estimate = &bundle.poses[*view];
                let (from, to) = (
                    Point2::from(estimate.translation.vector),
                    Point2::from(pose.translation.vector),
                );
                for known in (0..2).filter(|&k| root[k][k] > 0.0) {
                    places.add_line(&from, &Vector2::ith(known, 1.0), &to);
                }
                if root[0][0] > 0.0 && root[1][1] > 0.0 {
                    pairs.push((from, to));
                }
                if root[2][2] > 0.0 {
                    let by = (estimate.rotation.inverse() * pose.rotation).into_inner();
                    // Modulo pi only twice the angle is known.
                    turn += if problem.is_oriented() { by } else { by * by };
                }
            }
            Prior::Motion {
                start, end, delta, ..
            } => {
                let [from, to] = [start, end].map(|view| bundle.poses[*view].translation.vector);
                let length = (to - from).norm();
                lengths += length * delta.translation.vector.norm();
                squares += length * length;
            }
        }
    }
    let mut found = Vec::new();
    // Three equations fix what can be fixed where one coordinate is known of each.
    if places.count() >= UNKNOWNS - 1 {
        found.extend(places.solve().map(|(similarity, _)| similarity));
    }
    let scale = lengths / squares;
    let scale = if scale > 0.0 && scale.is_finite() {
        scale
    } else {
        1.0
    };
    let norm = turn.norm_sqr().sqrt();
    let rotation = if norm > f64::EPSILON {
        let angle = turn.im.atan2(turn.re);
        let part = if problem.is_oriented() { 1.0 } else { 0.5 };
        UnitComplex::new(angle * part)
    } else {
        UnitComplex::identity()
    };
    let half_turn = UnitComplex::new_unchecked(-rotation.into_inner());
    for rotation in [rotation, half_turn] {
        let mut similarity = Similarity2::from_parts(Translation2::identity(), rotation, scale);
        if let Some((from, to)) = pairs.first() {
            let shift = to - similarity.transform_point(from);
            similarity.isometry.translation = Translation2::from(shift);
        }
        found.push(similarity);
    }
    found
}

/// Minimises the cost over translation, rotation and scale by Gauss-Newton; returns twice the cost and the bundle
/// at the minimum.
///
/// A heading and a scale that odometry and priors do not fix stay: a step along them would move the one place that is
/// known.
fn fit_similarity(problem: &Problem, mut bundle: Bundle) -> (f64, Bundle) {
    turn_round(problem, &mut bundle);
    let fixed = FixedByPriors::of(problem);
    let [turned, scaled] = [fixed.heading, fixed.scale].map(|fixed| f64::from(u8::from(fixed)));
    let mut now = cost(problem, &bundle);
    for _ in 0..STEPS {
        let middle = centroid(&kept_positions::<3>(&bundle));
        let mut normal = Matrix4::zeros();
        let mut gradient = Vector4::zeros();
        for prior in problem.priors() {
            let row = linearize(prior, &bundle.poses, &bundle.landmarks);
            for k in 0..3 {
                let mut change = Vector4::zeros();
                for (subject, jacobian) in [Some(row.first), row.second].into_iter().flatten() {
                    let (position, is_view) = match subject {
                        Subject::View(view) => (bundle.poses[view].translation.vector, 1.0),
                        Subject::Landmark(landmark) => (bundle.landmarks[landmark].coords, 0.0),
                    };
                    let q = position - middle;
                    let [x, y, heading] = jacobian[k];
                    change += Vector4::new(
                        x,
                        y,
                        turned * (y * q.x - x * q.y + heading * is_view),
                        scaled * (x * q.x + y * q.y),
                    );
                }
                normal += change * change.transpose();
                gradient += change * row.residual[k];
            }
        }
        // A direction that odometry and priors leave free gets no step.
        let normal = DMatrix::from_column_slice(4, 4, normal.as_slice());
        let Some(inverse) = pseudo_inverse(&normal, f64::EPSILON) else {
            break;
        };
        let step: Vector4<f64> = -(inverse.fixed_view::<4, 4>(0, 0) * gradient);
        let mut part = 1.0;
        let mut lower = None;
        for _ in 0..QUARTERINGS {
            let by = step * part;
            let rotation = UnitComplex::new(by.z);
            let scale = by.w.exp();
            let shift = middle + by.xy() - rotation * middle * scale;
            let mut moved = bundle.clone();
            if scale > 0.0 && scale.is_finite() && shift.norm_squared().is_finite() {
                let shift = Translation2::from(shift);
                moved.transform(&Similarity2::from_parts(shift, rotation, scale));
                let there = cost(problem, &moved);
                if there < now {
                    lower = Some((there, moved));
                    break;
                }
            }
            part *= 0.25;
        }
        let Some((there, moved)) = lower else { break };
        let gained = now - there;
        (now, bundle) = (there, moved);
        if gained <= now * TOLERANCE {
            break;
        }
    }
    (now, bundle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::problem::{LandmarkPrior, Noise, Odometry, PosePrior};

    /// Headings of priors and lengths of motions give the rotation and the scale of an exact map, with bearings modulo pi up
    /// to half a turn, which is the other guess, and a known position gives the shift.
    #[test]
    fn first_frames_turn_and_scale_an_exact_map() {
        let poses = [(0.0, 0.0, 0.2), (2.0, 1.0, 1.1), (3.0, -1.0, -0.8)];
        let poses = poses.map(|(x, y, theta)| pose(x, y, theta));
        let free = f64::INFINITY;
        let compass = |view: usize| PosePrior {
            view,
            pose: poses[view],
            noise: Noise::Sigmas([free, free, 0.1]),
        };
        let motion = |start: usize| Odometry {
            start,
            end: start + 1,
            delta: poses[start].inv_mul(&poses[start + 1]),
            noise: Noise::Sigmas([0.1; 3]),
        };
        let problem = Problem::dense(3, 1, &[0.1, 0.2, 0.3], 0.5).unwrap();
        let problem = problem.with_odometry(&[motion(0), motion(1)]).unwrap();
        let place = PosePrior {
            view: 1,
            pose: poses[1],
            noise: Noise::Sigmas([0.1, 0.1, free]),
        };
        let problem = problem
            .with_pose_priors(&[compass(0), compass(2), place])
            .unwrap();
        for (turn, problem) in [0.4, 2.9, -1.7].into_iter().flat_map(|turn| {
            [
                (turn, problem.clone()),
                (turn, problem.clone().unoriented()),
            ]
        }) {
            let by = Similarity2::new(Vector2::new(5.0, -2.0), turn, 0.25);
            let mut bundle = Bundle {
                poses: poses.to_vec(),
                landmarks: Vec::new(),
            };
            bundle.transform(&by);
            // Half a turn changes nothing modulo pi.
            if !problem.is_oriented() {
                let rotation = &mut bundle.poses[2].rotation;
                *rotation = UnitComplex::new_unchecked(-rotation.into_inner());
            }
            let frames = first_frames(&problem, &bundle);
            let errors = frames.iter().map(|frame| {
                let rotation = frame.isometry.rotation.angle_to(&UnitComplex::new(-turn));
                let back = frame * (by * Point2::from(poses[1].translation.vector));
                let shift = back.coords - poses[1].translation.vector;
                rotation.abs() + (frame.scaling() - 4.0).abs() + shift.norm()
            });
            let least = errors.fold(f64::INFINITY, f64::min);
            assert!(least < 1e-12, "{turn} {}: {least}", problem.is_oriented());
        }
    }

    /// Headings that are known modulo pi turn to the nearer way of their prior, or of the heading that odometry tells
    /// from the view before; those that are known stay.
    #[test]
    fn headings_modulo_pi_turn_round_to_what_is_known_of_them() {
        let poses = [
            (0.0, 0.0, 0.2),
            (2.0, 1.0, 1.1),
            (3.0, -1.0, -0.8),
            (1.0, 4.0, 2.0),
        ];
        let poses = poses.map(|(x, y, theta)| pose(x, y, theta));
        let free = f64::INFINITY;
        let compass = PosePrior {
            view: 0,
            pose: poses[0] * pose(0.0, 0.0, 0.9),
            noise: Noise::Sigmas([free, free, 0.1]),
        };
        let place = PosePrior {
            view: 3,
            pose: poses[3] * pose(0.0, 0.0, 3.0),
            noise: Noise::Sigmas([0.1, 0.1, free]),
        };
        let motion = |start: usize| Odometry {
            start,
            end: start + 1,
            delta: poses[start].inv_mul(&poses[start + 1]) * pose(0.0, 0.0, -0.9),
            noise: Noise::Sigmas([0.1; 3]),
        };
        let problem = Problem::dense(4, 1, &[0.1, 0.2, 0.3, 0.4], 0.5).unwrap();
        let problem = problem.with_pose_priors(&[compass, place]).unwrap();
        let oriented = problem.with_odometry(&[motion(0), motion(1)]).unwrap();
        let lines = oriented.clone().unoriented();
        for turned in 0..16 {
            let mut bundle = Bundle {
                poses: poses.to_vec(),
                landmarks: Vec::new(),
            };
            for (view, pose) in bundle.poses.iter_mut().enumerate() {
                if turned >> view & 1 == 1 {
                    pose.rotation = UnitComplex::new_unchecked(-pose.rotation.into_inner());
                }
            }
            let before = bundle.clone();
            turn_round(&oriented, &mut bundle);
            assert_eq!(bundle.poses, before.poses);
            turn_round(&lines, &mut bundle);
            assert_eq!(bundle.poses[..3], poses[..3], "{turned}");
            assert_eq!(bundle.poses[3], before.poses[3], "{turned}");
        }
    }

    /// Three views and two landmarks, and problems that know parts of them, none of it exactly.
    fn known_up_to_noise() -> (Bundle, Vec<Problem>) {
        let poses = [(0.0, 0.0, 0.2), (2.0, 1.0, 1.1), (3.0, -1.0, -0.8)];
        let bundle = Bundle {
            poses: poses.map(|(x, y, theta)| pose(x, y, theta)).to_vec(),
            landmarks: Vec::from([Point2::new(1.0, 3.0), Point2::new(4.0, 2.0)]),
        };
        let alone = || Problem::dense(3, 2, &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6], 0.5).unwrap();
        let motion = |start: usize| Odometry {
            start,
            end: start + 1,
            delta: bundle.poses[start].inv_mul(&bundle.poses[start + 1]) * pose(0.2, -0.1, 0.1),
            noise: Noise::Sigmas([0.1, 0.2, 0.3]),
        };
        let posed = |view: usize, sigmas| PosePrior {
            view,
            pose: pose(0.1, 0.2, 0.0) * bundle.poses[view] * pose(0.0, 0.0, -0.1),
            noise: Noise::Sigmas(sigmas),
        };
        let known = |landmark: usize| LandmarkPrior {
            landmark,
            position: bundle.landmarks[landmark] + Vector2::new(-0.3, 0.1 * landmark as f64),
            noise: Noise::Sigmas([0.2, 0.1]),
        };
        let free = f64::INFINITY;
        let all = alone().with_odometry(&[motion(0), motion(1)]).unwrap();
        let all = all.with_pose_priors(&[posed(0, [0.3, 0.2, 0.1]), posed(2, [free, 0.3, 0.2])]);
        let problems = [
            all.unwrap().with_landmark_priors(&[known(0), known(1)]),
            alone().with_landmark_priors(&[known(0), known(1)]),
            alone().with_pose_priors(&[posed(0, [0.3, 0.2, free]), posed(1, [0.2, 0.4, 0.1])]),
            alone().with_pose_priors(&[posed(1, [0.3, 0.2, free])]),
            alone().with_pose_priors(&[posed(1, [0.3, 0.2, 0.1])]),
            alone().with_odometry(&[motion(0), motion(1)]),
        ];
        (bundle, problems.map(Result::unwrap).to_vec())
    }

    /// No small similarity lowers the cost any more, wherever it began. What odometry and priors leave free of heading and
    /// scale stays.
    #[test]
    fn the_similarity_of_least_cost_is_found() {
        let (bundle, problems) = known_up_to_noise();
        for (case, problem) in problems.iter().enumerate() {
            let fixed = FixedByPriors::of(problem);
            for (turn, scale) in [(0.4, 1.3), (-0.7, 0.8)] {
                let mut start = bundle.clone();
                start.transform(&Similarity2::new(Vector2::new(5.0, -2.0), turn, scale));
                let (least, found) = fit_similarity(problem, start.clone());
                assert!((cost(problem, &found) - least).abs() < 1e-12 * least.max(1.0));
                let middle = centroid(&kept_positions::<3>(&found));
                for parameter in 0..4 {
                    for step in [-1e-4, 1e-4] {
                        let mut by = [0.0_f64; 4];
                        by[parameter] = step;
                        let (rotation, scale) = (UnitComplex::new(by[2]), by[3].exp());
                        let shift = middle + Vector2::new(by[0], by[1]) - rotation * middle * scale;
                        let shift = Translation2::from(shift);
                        let mut moved = found.clone();
                        moved.transform(&Similarity2::from_parts(shift, rotation, scale));
                        let there = cost(problem, &moved);
                        // The cost is flat at its minimum: to first order nothing changes.
                        assert!(there > least - 1e-8, "{case} {parameter}: {there} {least}");
                    }
                }
                let length = |bundle: &Bundle| {
                    let [a, b] = [0, 2].map(|view: usize| bundle.poses[view].translation.vector);
                    (a - b).norm()
                };
                if !fixed.scale {
                    assert!(
                        (length(&found) / length(&start) - 1.0).abs() < 1e-12,
                        "{case}"
                    );
                }
                if !fixed.heading {
                    let turned = start.poses[1].rotation.angle_to(&found.poses[1].rotation);
                    assert!(turned.abs() < 1e-12, "{case}: {turned}");
                }
            }
        }
    }

    /// An exact map comes back from any similarity if positions, single coordinates, or headings and lengths are known.
    #[test]
    fn exact_priors_bring_a_map_back() {
        let poses = [
            (0.0, 0.0, 0.2),
            (2.0, 1.0, 1.1),
            (3.0, -1.0, -0.8),
            (-1.0, 2.0, 2.4),
        ];
        let truth = Map {
            poses: poses.map(|(x, y, theta)| Some(pose(x, y, theta))).to_vec(),
            landmarks: Vec::from([Some(Point2::new(1.0, 3.0)), Some(Point2::new(4.0, 2.0))]),
        };
        let alone =
            || Problem::dense(4, 2, &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8], 0.5).unwrap();
        let free = f64::INFINITY;
        let posed = |view: usize, sigmas| PosePrior {
            view,
            pose: truth.poses[view].unwrap(),
            noise: Noise::Sigmas(sigmas),
        };
        let [x, y, heading] = [[0.1, free, free], [free, 0.1, free], [free, free, 0.1]];
        let known = [0, 1].map(|landmark| LandmarkPrior {
            landmark,
            position: truth.landmarks[landmark].unwrap(),
            noise: Noise::Sigmas([0.2, 0.1]),
        });
        let motion = Odometry {
            start: 1,
            end: 3,
            delta: truth.poses[1].unwrap().inv_mul(&truth.poses[3].unwrap()),
            noise: Noise::Sigmas([0.1; 3]),
        };
        let compass = alone().with_pose_priors(&[posed(0, heading)]).unwrap();
        let compass = compass.with_odometry(&[motion]).unwrap();
        let coordinates = [
            posed(0, x),
            posed(1, y),
            posed(2, x),
            posed(3, y),
            posed(3, x),
        ];
        for (case, problem) in [
            alone().with_landmark_priors(&known).unwrap(),
            alone().with_pose_priors(&coordinates).unwrap(),
            compass.with_landmark_priors(&known[..1]).unwrap(),
        ]
        .iter()
        .enumerate()
        {
            for turn in [0.3, 1.6, 3.0, -2.0] {
                let by = Similarity2::new(Vector2::new(50.0, -20.0), turn, 0.05);
                let found = aligned_to_priors(problem, &truth.transformed(&by));
                let pairs = found.poses.iter().zip(&truth.poses);
                for (found, truth) in pairs.map(|(a, b)| (a.unwrap(), b.unwrap())) {
                    let error = truth.inv_mul(&found);
                    let error = error.translation.vector.norm() + error.rotation.angle().abs();
                    assert!(error < 1e-9, "{case} {turn}: {error:e}");
                }
            }
        }
    }

    #[test]
    fn what_nothing_is_known_of_stays() {
        let map = Map {
            poses: Vec::from([Some(pose(1.0, 2.0, 0.3)), None]),
            landmarks: Vec::from([Some(Point2::new(3.0, 4.0))]),
        };
        let alone = Problem::dense(2, 1, &[0.1, 0.2], 0.5).unwrap();
        assert_eq!(aligned_to_priors(&alone, &map), map);
        let known = LandmarkPrior {
            landmark: 0,
            position: Point2::new(7.0, 8.0),
            noise: Noise::Sigmas([0.1; 2]),
        };
        let known = alone.with_landmark_priors(&[known]).unwrap();
        let moved = aligned_to_priors(&known, &map);
        assert!((moved.landmarks[0].unwrap() - Point2::new(7.0, 8.0)).norm() < 1e-9);
        let mut unseen = map.clone();
        unseen.poses.fill(None);
        assert_eq!(aligned_to_priors(&known, &unseen), unseen);
    }
}
