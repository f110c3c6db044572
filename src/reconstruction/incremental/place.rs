// SPDX-License-Identifier: MIT OR Apache-2.0
//! Placement of single views and landmarks in a map.
//!
//! When a landmark is so close to a view that noise decides on which side it lies, the closed forms may put it behind
//! the view; the mirrored place, which puts it ahead, is tried as well.

use super::super::infinity::far_out;
use super::gates::Fit;
use crate::geometry::Pose;
use crate::kernels::{Resection, resect, triangulate};
use crate::problem::{IndexedSighting, MIN_VIEWS_OF_LANDMARK, Map, Problem};
use nalgebra::{Point2, Translation2, UnitComplex, Vector2};

/// Places a view by its landmarks in the map: the resection, its pose or the mirrored one, and the fit.
pub fn place_view(
    problem: &Problem,
    map: &Map,
    view: usize,
) -> Option<(Resection<f64>, Pose<f64>, Fit)> {
    let seen = map.seen(problem, view);
    let found = resect(seen.clone().map(|(point, s)| (point, s.bearing))).ok()?;
    let pose = found.pose;
    let fit = Fit::of_view(problem, map, view, &pose);
    let offset = |point: &Point2<f64>| point.coords - pose.translation.vector;
    let (point, s) = seen.min_by(|(a, _), (b, _)| {
        let [a, b] = [a, b].map(|point| offset(point).norm_squared());
        a.total_cmp(&b)
    })?;
    let place = point.coords - ray(&pose, s) * offset(&point).norm();
    let beside = Pose::from_parts(Translation2::from(place), pose.rotation);
    let fit_beside = Fit::of_view(problem, map, view, &beside);
    if fit_beside.squares < fit.squares {
        Some((found, beside, fit_beside))
    } else {
        Some((found, pose, fit))
    }
}

/// Places a landmark by its views in the map: where their rays meet, and the fit.
pub fn place_landmark(problem: &Problem, map: &Map, landmark: usize) -> Option<(Point2<f64>, Fit)> {
    let rays = map.rays(problem, landmark);
    rays.clone().nth(MIN_VIEWS_OF_LANDMARK - 1)?;
    let found = triangulate(rays.clone().map(|(pose, s)| (pose, s.bearing))).ok()?;
    let point = found.point;
    let fit = Fit::of_landmark(problem, map, landmark, &point);
    if found.behind == 0 || !problem.is_oriented() {
        return Some((point, fit));
    }
    let range = |pose: &Pose<f64>| (point.coords - pose.translation.vector).norm();
    let (pose, s) = rays.min_by(|(a, _), (b, _)| {
        let [a, b] = [a, b].map(range);
        a.total_cmp(&b)
    })?;
    let beside = Point2::from(pose.translation.vector + ray(&pose, s) * range(&pose));
    let fit_beside = Fit::of_landmark(problem, map, landmark, &beside);
    if fit_beside.squares < fit.squares {
        Some((beside, fit_beside))
    } else {
        Some((point, fit))
    }
}

/// A position far out along the mean ray of a landmark, and the fit.
pub fn place_far_out(
    problem: &Problem,
    map: &Map,
    landmark: usize,
    sizes: f64,
) -> Option<(Point2<f64>, Fit)> {
    let place = far_out(problem, map, landmark, sizes * map.size())?;
    Some((place, Fit::of_landmark(problem, map, landmark, &place)))
}

/// The view of a heading where two of its rays, followed backward from their landmarks, cross; `None` where the
/// landmarks would be behind it.
pub fn backward(
    heading: UnitComplex<f64>,
    (first, one): &(Point2<f64>, &IndexedSighting),
    (second, two): &(Point2<f64>, &IndexedSighting),
    is_oriented: bool,
) -> Option<Pose<f64>> {
    let ray = |s: &IndexedSighting| {
        let ray = (heading * s.bearing).into_inner();
        Vector2::new(ray.re, ray.im)
    };
    let (u, v) = (ray(one), ray(two));
    let sine = u.perp(&v);
    let range = (first - second).perp(&v) / sine;
    let place = first.coords - u * range;
    let is_ahead = range > 0.0 && (second.coords - place).dot(&v) > 0.0;
    let is_place = sine.abs() > f64::EPSILON && range.is_finite();
    (is_place && (is_ahead || !is_oriented))
        .then(|| Pose::from_parts(Translation2::from(place), heading))
}

/// The direction of a sighting in the map frame.
fn ray(pose: &Pose<f64>, s: &IndexedSighting) -> Vector2<f64> {
    let ray = pose.rotation.into_inner() * s.bearing.into_inner();
    Vector2::new(ray.re, ray.im)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{bearing_to, pose};
    use alloc::vec::Vec;

    /// A heading and two landmarks fix a view that sees both ahead, or modulo pi on either side.
    #[test]
    fn a_view_of_known_heading_stands_behind_two_landmarks() {
        let truth = pose(1.0, -2.0, 0.7);
        let points = [Point2::new(4.0, 1.0), Point2::new(-1.0, 3.0)];
        let bearings = points.map(|point| bearing_to(&truth, &point).unwrap().angle());
        let problem = Problem::dense(1, 2, &bearings, 0.1).unwrap();
        let seen = [0, 1].map(|k: usize| (points[k], &problem.sightings()[k]));
        for oriented in [true, false] {
            let found = backward(truth.rotation, &seen[0], &seen[1], oriented).unwrap();
            assert!((found.translation.vector - truth.translation.vector).norm() < 1e-12);
            assert_eq!(found.rotation, truth.rotation);
            // The other way round it sees both behind.
            let turned = truth.rotation * UnitComplex::new(core::f64::consts::PI);
            let found = backward(turned, &seen[0], &seen[1], oriented);
            assert_eq!(found.is_none(), oriented);
        }
        // One ahead and one behind.
        let mixed = [bearings[0], bearings[1] + core::f64::consts::PI];
        let mixed = Problem::dense(1, 2, &mixed, 0.1).unwrap();
        let mixed = [0, 1].map(|k: usize| (points[k], &mixed.sightings()[k]));
        for [a, b] in [[0, 1], [1, 0]] {
            assert!(backward(truth.rotation, &mixed[a], &mixed[b], true).is_none());
            assert!(backward(truth.rotation, &mixed[a], &mixed[b], false).is_some());
        }
        // Parallel rays meet nowhere.
        let same = Problem::dense(1, 2, &[0.3, 0.3], 0.1).unwrap();
        let same = [0, 1].map(|k: usize| (points[k], &same.sightings()[k]));
        assert!(backward(truth.rotation, &same[0], &same[1], false).is_none());
    }

    /// Next to a view, the rays of the others decide on which side a landmark is; its own bearing says where it must be.
    #[test]
    fn a_landmark_behind_its_nearest_view_is_put_ahead_of_it() {
        let truth = Point2::new(0.0, 0.02);
        let places = [(0.0, 0.0), (5.0, 1.0), (-4.0, 2.0), (1.0, 6.0)];
        let map = Map {
            poses: places.map(|(x, y)| Some(pose(x, y, 0.0))).to_vec(),
            landmarks: Vec::from([None]),
        };
        let mut bearings: [f64; 4] =
            core::array::from_fn(|k| bearing_to(&map.poses[k].unwrap(), &truth).unwrap().angle());
        let exact = Problem::dense(4, 1, &bearings, 0.01).unwrap();
        let (found, fit) = place_landmark(&exact, &map, 0).unwrap();
        assert!((found - truth).norm() < 1e-9 && fit.squares < 1e-12);
        // The others see it a little below the first view, which sees it above.
        for (k, bearing) in bearings.iter_mut().enumerate().skip(1) {
            let below = Point2::new(0.0, -0.02);
            *bearing = bearing_to(&map.poses[k].unwrap(), &below).unwrap().angle();
        }
        let problem = Problem::dense(4, 1, &bearings, 0.01).unwrap();
        let (found, fit) = place_landmark(&problem, &map, 0).unwrap();
        assert!(found.x.abs() < 1e-3 && found.y > 0.005, "{found}");
        assert!(fit.squares < 20.0 && fit.count == 4);
        // Modulo pi it may be on either side.
        let (found, _) = place_landmark(&problem.unoriented(), &map, 0).unwrap();
        assert!(found.y < 0.0, "{found}");
        let mut one = map.clone();
        one.poses[1..].fill(None);
        assert!(place_landmark(&exact, &one, 0).is_none());
    }

    /// A view next to a landmark goes to the side of it from which it sees it where it does.
    #[test]
    fn a_view_is_put_on_the_side_from_which_it_sees_its_nearest_landmark() {
        let points = [
            (0.0, 0.02),
            (5.0, 1.0),
            (-4.0, 2.0),
            (1.0, 6.0),
            (2.0, -5.0),
        ];
        let map = Map {
            poses: Vec::from([None]),
            landmarks: points.map(|(x, y)| Some(Point2::new(x, y))).to_vec(),
        };
        let from = |at: &Pose<f64>| -> [f64; 5] {
            core::array::from_fn(|k| bearing_to(at, &map.landmarks[k].unwrap()).unwrap().angle())
        };
        let truth = pose(0.0, 0.0, 0.4);
        let exact = Problem::dense(1, 5, &from(&truth), 0.01).unwrap();
        let (_, found, fit) = place_view(&exact, &map, 0).unwrap();
        assert!((found.translation.vector - truth.translation.vector).norm() < 1e-9);
        assert!(fit.squares < 1e-12 && fit.count == 5);
        // The others see it from above the first landmark, which it sees above itself.
        let mut bearings = from(&pose(0.0, 0.04, 0.4));
        bearings[0] = from(&truth)[0];
        let problem = Problem::dense(1, 5, &bearings, 0.01).unwrap();
        let (_, found, fit) = place_view(&problem, &map, 0).unwrap();
        assert!(
            found.translation.y < 0.015 && fit.squares < 100.0,
            "{found}"
        );
    }
}
