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
    use crate::problem::{Noise, Odometry, PosePrior};

    /// Headings of priors and lengths of motions give the rotation and the scale of an exact map, with bearings modulo pi up
    /// to half a turn, which is the other guess.
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
        let problem = problem.with_pose_priors(&[compass(0), compass(2)]).unwrap();
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
                rotation.abs() + (frame.scaling() - 4.0).abs()
            });
            let least = errors.fold(f64::INFINITY, f64::min);
            assert!(least < 1e-12, "{turn} {}: {least}", problem.is_oriented());
        }
    }
}
