// SPDX-License-Identifier: MIT OR Apache-2.0
//! Placement of single views and landmarks in a map.
//!
//! When a landmark is so close to a view that noise decides on which side it lies, the closed forms may put it behind
//! the view; the mirrored place, which puts it ahead, is tried as well.

use super::super::choice::size;
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
    let place = far_out(problem, map, landmark, sizes * size(map))?;
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
