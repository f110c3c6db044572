// SPDX-License-Identifier: MIT OR Apache-2.0
//! The gauge: the part of translation, rotation and scale of the whole map that odometry and priors leave free.

use super::bundle::Bundle;
use super::decompose::symmetric_eigen;
use super::prior_rows::linearize;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::{centroid, spread};
use crate::problem::{Map, Prior, Problem, Subject};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{Matrix4, Similarity2, Translation2, UnitComplex, Vector2, Vector4};

/// A residual of odometry or a prior does not depend on the gauge when its derivative along it is below this
/// fraction of the terms that cancel in it: far above rounding, far below any real dependence.
const UNCHANGED: f64 = 1e-9;

/// Eigenvalues below this fraction of the largest are zero: rounding of a 4x4 matrix that is a sum of squares. Its
/// root, 3e-7, is the weakest dependence on the gauge, relative to the strongest, that counts.
const ROUNDING: f64 = 1e-13;

/// The directions in the space of all parameters (poses, then landmarks) along which neither bearings nor odometry
/// nor priors change: up to four, (T26).
///
/// They are combinations of the two translations, the rotation and the scaling about the centroid, scaled to
/// entries of about 1.
pub fn gauge_directions(problem: &Problem, bundle: &Bundle) -> Vec<Vec<f64>> {
    let views = bundle.poses.len();
    let positions = bundle.poses.iter().map(|pose| pose.translation.vector);
    let places: Vec<Vector2<f64>> = positions
        .chain(bundle.landmarks.iter().map(|point| point.coords))
        .collect();
    let middle = centroid(&places);
    let size = (spread(&places) / (places.len() as f64)).sqrt();
    let size = if size > 0.0 { size } else { 1.0 };
    let at = |parameter: usize, position: &Vector2<f64>| -> [f64; 4] {
        let q = (position - middle) / size;
        let turn = 1.0 / size;
        match parameter {
            0 => [1.0, 0.0, -q.y, q.x],
            1 => [0.0, 1.0, q.x, q.y],
            _ => [0.0, 0.0, turn, 0.0],
        }
    };
    let combinations = unconstrained(problem, bundle, &at);
    let mut directions =
        vec![vec![0.0; 3 * views + 2 * bundle.landmarks.len()]; combinations.len()];
    for (direction, combination) in directions.iter_mut().zip(&combinations) {
        for (k, position) in places.iter().enumerate() {
            let (place, width) = if k < views {
                (3 * k, 3)
            } else {
                (views + 2 * k, 2)
            };
            for parameter in 0..width {
                direction[place + parameter] = at(parameter, position)
                    .iter()
                    .zip(combination)
                    .map(|(entry, part)| entry * part)
                    .sum();
            }
        }
    }
    directions
}

/// The combinations of the four directions along which no residual of odometry and priors changes.
fn unconstrained(
    problem: &Problem,
    bundle: &Bundle,
    at: &impl Fn(usize, &Vector2<f64>) -> [f64; 4],
) -> Vec<[f64; 4]> {
    let mut constrained = Matrix4::<f64>::zeros();
    for prior in problem.priors() {
        let row = linearize(prior, &bundle.poses, &bundle.landmarks);
        for k in 0..3 {
            // The change of a residual along each of the four, and the size of the terms that cancel in it.
            let (mut change, mut size) = ([0.0; 4], [0.0_f64; 4]);
            for (subject, jacobian) in [Some(row.first), row.second].into_iter().flatten() {
                let position = match subject {
                    Subject::View(view) => bundle.poses[view].translation.vector,
                    Subject::Landmark(landmark) => bundle.landmarks[landmark].coords,
                };
                for (parameter, slope) in jacobian[k].iter().enumerate() {
                    for (g, entry) in at(parameter, &position).into_iter().enumerate() {
                        let product = slope * entry;
                        change[g] += product;
                        size[g] += product.abs();
                    }
                }
            }
            let norm = size.iter().map(|s| s * s).sum::<f64>();
            if !(norm > 0.0 && norm.is_finite()) {
                continue;
            }
            let norm = norm.sqrt();
            let change = Vector4::from(change) / norm;
            if change.norm() > UNCHANGED {
                constrained += change * change.transpose();
            }
        }
    }
    let Some(eigen) = symmetric_eigen(constrained) else {
        // Without a gauge, equations that are singular are found to be so.
        return Vec::new();
    };
    let largest = eigen.eigenvalues.amax();
    (0..4)
        .filter(|&k| !(eigen.eigenvalues[k] > largest * ROUNDING))
        .map(|k| core::array::from_fn(|g| eigen.eigenvectors[(g, k)]))
        .collect()
}

/// One parameter for each of the given directions, so that fixing these parameters fixes the directions.
///
/// They are chosen by elimination with complete pivoting, with entries in units of the parameter's conditional
/// standard deviation; `information` is one over its square.
pub fn anchors(directions: &[Vec<f64>], information: impl Fn(usize) -> f64) -> Vec<usize> {
    let mut rest: Vec<Vec<f64>> = directions.to_vec();
    let mut chosen = Vec::new();
    for done in 0..rest.len() {
        let mut best = (0.0, 0, done);
        for (k, direction) in rest.iter().enumerate().skip(done) {
            for (parameter, entry) in direction.iter().enumerate() {
                let weight = entry * entry * information(parameter);
                if weight > best.0 {
                    best = (weight, parameter, k);
                }
            }
        }
        let (weight, parameter, k) = best;
        if !(weight > 0.0) {
            break;
        }
        rest.swap(done, k);
        let (head, tail) = rest.split_at_mut(done + 1);
        let pivot = &head[done];
        for other in tail {
            let factor = other[parameter] / pivot[parameter];
            for (entry, from) in other.iter_mut().zip(pivot) {
                *entry -= factor * from;
            }
        }
        chosen.push(parameter);
    }
    chosen
}

/// A map in the frame in which it is reported: the part of the gauge that odometry and priors leave free is fixed
/// as in [`Map::normalized`].
pub fn in_reported_frame(problem: &Problem, map: &Map) -> Map {
    let mut framed = if problem.priors().is_empty() {
        map.normalized()
    } else {
        let fixed = FixedByPriors::of(&map.restrict(problem));
        match fixed.frame(&Bundle::from_map(map)) {
            Some(similarity) => map.transformed(&similarity),
            None => map.clone(),
        }
    };
    if !problem.is_oriented() && problem.priors().is_empty() {
        // A heading is known modulo pi; odometry and priors may know more.
        for pose in framed.poses.iter_mut().flatten() {
            if pose.rotation.re < 0.0 {
                pose.rotation = UnitComplex::new_unchecked(-pose.rotation.into_inner());
            }
        }
    }
    framed
}

/// The number of directions of the gauge that odometry and priors leave free in a map, and the number of residuals
/// that they have.
pub fn gauge_and_prior_numbers(problem: &Problem, map: &Map) -> (usize, usize) {
    if problem.priors().is_empty() {
        return (4, 0);
    }
    let active = map.restrict(problem);
    let bundle = Bundle::from_map(map);
    let priors = active.priors().iter();
    let numbers = priors.map(|prior| linearize(prior, &bundle.poses, &bundle.landmarks).count());
    (gauge_directions(&active, &bundle).len(), numbers.sum())
}

/// The part of the gauge that odometry and priors fix, judged by their kinds alone.
#[derive(Clone, Debug)]
pub struct FixedByPriors {
    /// Known coordinates of positions, each the direction along which it is measured; of each direction no more than
    /// tell whether heading and scale are fixed.
    coordinates: Vec<(Subject, Vector2<f64>)>,
    pub heading: bool,
    pub scale: bool,
}

/// Known coordinates that fix translation, rotation and scale.
const ALL_FIXED: usize = 4;

impl FixedByPriors {
    /// What odometry and priors of a problem fix.
    pub fn of(problem: &Problem) -> Self {
        let mut fixed = Self {
            coordinates: Vec::new(),
            heading: false,
            scale: false,
        };
        for prior in problem.priors() {
            match prior {
                Prior::Motion { .. } => fixed.scale = true,
                Prior::Pose { view, root, .. } => {
                    let [x, y, heading] = root;
                    fixed.add(Subject::View(*view), [[x[0], x[1]], [y[0], y[1]]]);
                    fixed.heading |= heading[2] > 0.0;
                }
                Prior::Landmark { landmark, root, .. } => {
                    fixed.add(Subject::Landmark(*landmark), *root);
                }
            }
        }
        // What is known beyond the place ties the heading to the scale, or fixes both.
        let place = fixed.place_conditions();
        let place = place.iter().filter(|(_, known)| known.is_some()).count();
        let beyond = fixed.coordinates.len() > place;
        fixed.scale |= beyond;
        fixed.heading |= beyond;
        fixed
    }

    /// Whether the translation is fixed.
    pub fn place(&self) -> bool {
        let mut conditions = self.place_conditions().into_iter();
        conditions.all(|(_, known)| known.is_some())
    }

    /// Adds what the root of a prior's information knows of the position of a subject.
    fn add(&mut self, subject: Subject, root: [[f64; 2]; 2]) {
        for row in root.map(Vector2::from) {
            let norm = row.norm();
            if !(norm > 0.0) {
                continue;
            }
            let direction = row / norm;
            let mut own = self.coordinates.iter().filter(|(of, _)| *of == subject);
            let is_told = own.clone().count() == 2 || own.any(|(_, d)| are_parallel(d, &direction));
            let first = self.coordinates.first();
            // Until the place is fixed all are parallel to the first.
            let is_new = !self.place() && first.is_none_or(|(_, d)| !are_parallel(d, &direction));
            if !is_told && (is_new || self.coordinates.len() < ALL_FIXED) {
                self.coordinates.push((subject, direction));
            }
        }
    }

    /// Two directions that fix the translation, along each of which that subject stays where it is, or, where none is
    /// known, the first view is at zero.
    fn place_conditions(&self) -> [(Vector2<f64>, Option<Subject>); 2] {
        let Some((subject, direction)) = self.coordinates.first() else {
            return [(Vector2::x(), None), (Vector2::y(), None)];
        };
        let mut others = self.coordinates.iter();
        let second = match others.find(|(_, other)| !are_parallel(other, direction)) {
            Some((subject, other)) => (*other, Some(*subject)),
            None => (Vector2::new(-direction.y, direction.x), None),
        };
        [(*direction, Some(*subject)), second]
    }

    /// The similarity that brings a map into the frame in which it is reported: as far as the gauge is not
    /// fixed, the first view is at the origin with heading 0, and the root-mean-square distance of the other
    /// views from it is 1. Where one coordinate is known, the first view is at zero along the other. `None` when the
    /// views are in one place.
    pub fn frame(&self, bundle: &Bundle) -> Option<Similarity2<f64>> {
        let first = bundle.poses.first()?;
        let scale = if self.scale {
            1.0
        } else {
            let others = bundle.poses.iter().skip(1);
            let sum = others.fold(0.0, |sum, pose| {
                sum + (pose.translation.vector - first.translation.vector).norm_squared()
            });
            ((bundle.poses.len() as f64 - 1.0) / sum).sqrt()
        };
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let rotation = if self.heading {
            UnitComplex::identity()
        } else {
            first.rotation.inverse()
        };
        let conditions = self.place_conditions();
        let shifts = conditions.map(|(direction, known)| {
            let (from, to) = match known {
                None => (first.translation.vector, Vector2::zeros()),
                Some(Subject::View(view)) => {
                    let position = bundle.poses[view].translation.vector;
                    (position, position)
                }
                Some(Subject::Landmark(landmark)) => {
                    let position = bundle.landmarks[landmark].coords;
                    (position, position)
                }
            };
            direction.dot(&(to - rotation * from * scale))
        });
        let [a, b] = conditions.map(|(direction, _)| direction);
        let shift = Vector2::new(
            b.y * shifts[0] - a.y * shifts[1],
            a.x * shifts[1] - b.x * shifts[0],
        ) / a.perp(&b);
        Some(Similarity2::from_parts(
            Translation2::from(shift),
            rotation,
            scale,
        ))
    }

    /// The constraints that define this frame to first order, each as a row over all parameters.
    pub fn constraints(&self, bundle: &Bundle) -> Vec<Vec<f64>> {
        let size = 3 * bundle.poses.len() + 2 * bundle.landmarks.len();
        let of_first = |entries: [f64; 3]| {
            let mut row = vec![0.0; size];
            row[..3].copy_from_slice(&entries);
            row
        };
        let mut rows = Vec::new();
        for (direction, known) in self.place_conditions() {
            if known.is_none() {
                rows.push(of_first([direction.x, direction.y, 0.0]));
            }
        }
        if !self.heading {
            rows.push(of_first([0.0, 0.0, 1.0]));
        }
        if !self.scale {
            let mut row = vec![0.0; size];
            let first = bundle.poses[0].translation.vector;
            for (view, pose) in bundle.poses.iter().enumerate() {
                let offset = pose.translation.vector - first;
                for (k, part) in [offset.x, offset.y].into_iter().enumerate() {
                    row[3 * view + k] += part;
                    row[k] -= part;
                }
            }
            rows.push(row);
        }
        rows
    }
}

/// Whether two directions are the same up to rounding.
fn are_parallel(a: &Vector2<f64>, b: &Vector2<f64>) -> bool {
    a.perp(b).abs() <= UNCHANGED
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::problem::{LandmarkPrior, Noise, Odometry, PosePrior};
    use nalgebra::{Point2, Vector3};

    /// The map of three views and two landmarks, and problems that fix none, some or all of its gauge.
    fn settings() -> (Bundle, Vec<Problem>) {
        let bundle = Bundle {
            poses: [(0.3, -0.2, 0.4), (1.4, 0.5, -0.7), (-0.6, 1.1, 1.9)]
                .map(|(x, y, theta)| pose(x, y, theta))
                .to_vec(),
            landmarks: vec![Point2::new(2.0, 1.5), Point2::new(-1.2, 0.4)],
        };
        let alone = || Problem::dense(3, 2, &[0.3, -2.0, 1.5, 2.9, 0.1, -0.4], 0.5).unwrap();
        let known = |landmark: usize| LandmarkPrior {
            landmark,
            position: bundle.landmarks[landmark],
            noise: Noise::Sigmas([0.1, 0.1]),
        };
        let posed = |sigmas| PosePrior {
            view: 1,
            pose: bundle.poses[1],
            noise: Noise::Sigmas(sigmas),
        };
        let coordinate = |view: usize, sigmas| PosePrior {
            view,
            pose: bundle.poses[view],
            noise: Noise::Sigmas(sigmas),
        };
        let motion = Odometry {
            start: 0,
            end: 1,
            delta: bundle.poses[0].inv_mul(&bundle.poses[1]),
            noise: Noise::Sigmas([0.1; 3]),
        };
        let free = f64::INFINITY;
        let problems = [
            Ok(alone()),
            alone().with_landmark_priors(&[known(1)]),
            alone().with_pose_priors(&[posed([0.1, 0.1, free])]),
            alone().with_pose_priors(&[posed([free, free, 0.1])]),
            alone().with_pose_priors(&[posed([0.1; 3])]),
            alone().with_odometry(&[motion]),
            alone().with_landmark_priors(&[known(0), known(1)]),
            // One coordinate of one view, of all, and one of each of two.
            alone().with_pose_priors(&[posed([free, 0.1, free])]),
            alone().with_pose_priors(&[0, 1, 2].map(|view| coordinate(view, [free, 0.1, free]))),
            alone().with_odometry(&[motion]).and_then(|p| {
                p.with_pose_priors(&[0, 2].map(|view| coordinate(view, [0.1, free, 0.1])))
            }),
            alone().with_pose_priors(&[
                coordinate(0, [0.1, free, free]),
                coordinate(2, [free, 0.1, free]),
            ]),
            // One coordinate of more than tell whether all is fixed, before both of others.
            alone()
                .with_pose_priors(&[0, 1, 2].map(|view| coordinate(view, [0.1, free, free])))
                .and_then(|p| p.with_landmark_priors(&[known(0), known(1)])),
        ];
        (bundle.clone(), problems.map(Result::unwrap).to_vec())
    }

    /// A change of the map brought back into the frame moves along no constraint, to first order in its length.
    #[test]
    fn constraints_are_the_frame_linearised() {
        let (bundle, problems) = settings();
        for (case, problem) in problems.iter().enumerate() {
            let fixed = FixedByPriors::of(problem);
            let framed = |mut bundle: Bundle| {
                bundle.transform(&fixed.frame(&bundle).unwrap());
                bundle
            };
            let bundle = framed(bundle.clone());
            let constraints = fixed.constraints(&bundle);
            // They fix what the priors leave free, all of it and nothing else.
            assert_eq!(
                constraints.len(),
                gauge_directions(problem, &bundle).len(),
                "{case}"
            );
            let length = 1e-6;
            for parameter in 0..13 {
                let entry = |k: usize| if k == parameter { length } else { 0.0 };
                let poses = [0, 3, 6].map(|k| Vector3::new(entry(k), entry(k + 1), entry(k + 2)));
                let landmarks = [9, 11].map(|k| Vector2::new(entry(k), entry(k + 1)));
                let mut moved = bundle.clone();
                bundle.step(&poses, &landmarks, &mut moved);
                let moved = framed(moved);
                let turned = |k: usize| {
                    let [before, after] = [&bundle, &moved].map(|b| b.poses[k].rotation);
                    before.angle_to(&after)
                };
                let pairs = moved.poses.iter().zip(&bundle.poses).enumerate();
                let mut change: Vec<f64> = pairs
                    .flat_map(|(k, (after, before))| {
                        let step = after.translation.vector - before.translation.vector;
                        [step.x, step.y, turned(k)]
                    })
                    .collect();
                let pairs = moved.landmarks.iter().zip(&bundle.landmarks);
                change.extend(
                    pairs.flat_map(|(after, before)| [(after - before).x, (after - before).y]),
                );
                for (place, row) in constraints.iter().enumerate() {
                    let along: f64 = row.iter().zip(&change).map(|(a, b)| a * b).sum();
                    // What is left is of second order.
                    assert!(along.abs() < 1e-9, "{case} {parameter} {place}: {along:e}");
                }
            }
        }
    }

    /// In the frame of a map from bearings alone the first view is at the origin with heading 0, and the root mean square
    /// distance of the others from it is 1; what priors fix stays.
    #[test]
    fn the_frame_is_that_of_the_first_view_as_far_as_it_is_free() {
        let (bundle, problems) = settings();
        for (case, problem) in problems.iter().enumerate() {
            let fixed = FixedByPriors::of(problem);
            let mut framed = bundle.clone();
            framed.transform(&fixed.frame(&bundle).unwrap());
            let place = |view: usize| framed.poses[view].translation.vector;
            let squares = [1, 2].map(|view| (place(view) - place(0)).norm_squared());
            let mean = 0.5 * (squares[0] + squares[1]);
            let before = bundle.poses[0].translation.vector;
            let lengths = [1, 2]
                .map(|view: usize| (bundle.poses[view].translation.vector - before).norm_squared());
            let expected = if fixed.scale {
                0.5 * (lengths[0] + lengths[1])
            } else {
                1.0
            };
            assert!((mean / expected - 1.0).abs() < 1e-12, "{case}: {mean}");
            let heading = if fixed.heading {
                bundle.poses[0].rotation.angle()
            } else {
                0.0
            };
            assert!(
                (framed.poses[0].rotation.angle() - heading).abs() < 1e-12,
                "{case}"
            );
            let position = |bundle: &Bundle, subject: Subject| match subject {
                Subject::View(view) => bundle.poses[view].translation.vector,
                Subject::Landmark(landmark) => bundle.landmarks[landmark].coords,
            };
            for (direction, known) in fixed.place_conditions() {
                let off = match known {
                    None => place(0),
                    Some(subject) => position(&framed, subject) - position(&bundle, subject),
                };
                assert!(off.dot(&direction).abs() < 1e-12, "{case}: {off}");
            }
            // What odometry and priors say of the map before they say of this one.
            for prior in problem.priors() {
                let square = linearize(prior, &framed.poses, &framed.landmarks).square();
                assert!(square < 1e-20, "{case}: {square}");
            }
        }
        let mut still = bundle.clone();
        for pose in &mut still.poses {
            pose.translation.vector = Vector2::new(1.0, 2.0);
        }
        assert!(FixedByPriors::of(&problems[0]).frame(&still).is_none());
    }

    /// Anchors are one parameter for each direction, and fixing them fixes all: the directions at the anchors are
    /// independent.
    #[test]
    fn anchors_fix_their_directions() {
        let (bundle, problems) = settings();
        for problem in &problems {
            let directions = gauge_directions(problem, &bundle);
            let chosen = anchors(&directions, |k| 1.0 + k as f64);
            assert_eq!(chosen.len(), directions.len());
            let count = chosen.len();
            let at = nalgebra::DMatrix::from_fn(count, count, |i, j| directions[i][chosen[j]]);
            assert!(count == 0 || at.determinant().abs() > 1e-3);
        }
        // The largest entry in units of the standard deviation, then what is left of the other.
        let directions = [vec![1.0, 2.0, 0.0], vec![0.0, 2.0, 0.5]];
        assert_eq!(anchors(&directions, |_| 1.0), [1, 0]);
        assert_eq!(anchors(&directions, |k| [100.0, 1.0, 1.0][k]), [0, 1]);
        assert_eq!(anchors(&directions, |k| [1.0, 0.0, 0.0][k]), [0]);
    }
}
