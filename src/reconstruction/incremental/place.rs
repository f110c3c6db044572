// SPDX-License-Identifier: MIT OR Apache-2.0
//! Placement of single views and landmarks in a map.
//!
//! When a landmark is so close to a view that noise decides on which side it lies, the closed forms may put it behind
//! the view; the mirrored place, which puts it ahead, is tried as well.

use super::gates::Fit;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Pose;
use crate::kernels::{Resection, resect, triangulate};
use crate::problem::{IndexedSighting, MIN_VIEWS_OF_LANDMARK, Map, Problem};
use nalgebra::{Point2, Translation2, Vector2};

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

/// A position `sizes` times the size of the map out along the mean ray of a landmark that at least two views see.
pub fn far_out(
    problem: &Problem,
    map: &Map,
    landmark: usize,
    sizes: f64,
) -> Option<(Point2<f64>, Fit)> {
    let mut count = 0;
    let (mut sum, mut from) = (Vector2::zeros(), Vector2::zeros());
    for (pose, s) in map.rays(problem, landmark) {
        let ray = ray(&pose, s);
        // A bearing modulo pi points both ways: take the way of the sum.
        let turned = !problem.is_oriented() && ray.dot(&sum) < 0.0;
        sum += if turned { -ray } else { ray };
        from += pose.translation.vector;
        count += 1;
    }
    if count < MIN_VIEWS_OF_LANDMARK || !(sum.norm() > f64::EPSILON) {
        return None;
    }
    let middle = from / (count as f64);
    let place = Point2::from(middle + sum.normalize() * (size(map) * sizes));
    Some((place, Fit::of_landmark(problem, map, landmark, &place)))
}

/// The root mean square distance of the views from the first.
fn size(map: &Map) -> f64 {
    let mut views = map
        .poses
        .iter()
        .flatten()
        .map(|pose| pose.translation.vector);
    let Some(first) = views.next() else {
        return 1.0;
    };
    let (sum, count) = views.fold((0.0, 1.0), |(sum, count), view| {
        (sum + (view - first).norm_squared(), count + 1.0)
    });
    (sum / count).sqrt()
}

/// The direction of a sighting in the map frame.
fn ray(pose: &Pose<f64>, s: &IndexedSighting) -> Vector2<f64> {
    let ray = pose.rotation.into_inner() * s.bearing.into_inner();
    Vector2::new(ray.re, ray.im)
}
