// SPDX-License-Identifier: MIT OR Apache-2.0
//! Growth of a map from a few poses by resection and triangulation, and its score.

use crate::geometry::Pose;
use crate::kernels::{resect, triangulate};
use crate::problem::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Map, Problem};

/// Triangulates every landmark that at least two determined views see, replacing any earlier position.
pub fn triangulate_all(problem: &Problem, map: &mut Map) {
    for landmark in 0..map.landmarks.len() {
        triangulate_one(problem, map, landmark);
    }
}

/// Triangulates one landmark if at least two determined views see it.
pub fn triangulate_one(problem: &Problem, map: &mut Map, landmark: usize) {
    let rays = map.rays(problem, landmark);
    if rays.clone().nth(MIN_VIEWS_OF_LANDMARK - 1).is_some() {
        let found = triangulate(rays.map(|(pose, s)| (pose, s.bearing)));
        map.landmarks[landmark] = found.ok().map(|found| found.point);
    }
}

/// The pose of a view by resection from the landmarks in the map, and its misfit.
pub fn resect_view(problem: &Problem, map: &Map, view: usize) -> Option<(Pose<f64>, f64)> {
    let seen = map.seen(problem, view);
    seen.clone().nth(MIN_LANDMARKS_OF_VIEW - 1)?;
    let found = resect(seen.map(|(point, s)| (point, s.bearing))).ok()?;
    Some((found.pose, found.misfit))
}

/// Grows a map from its poses by alternating triangulation and resection until nothing can be added.
///
/// All landmarks are triangulated again after each round, because more views are then known.
pub fn grow(problem: &Problem, map: &mut Map) {
    triangulate_all(problem, map);
    loop {
        let mut grown = false;
        for view in 0..map.poses.len() {
            if map.poses[view].is_none()
                && let Some((pose, _)) = resect_view(problem, map, view)
            {
                map.poses[view] = Some(pose);
                grown = true;
            }
        }
        if !grown {
            return;
        }
        triangulate_all(problem, map);
        if map.poses.iter().all(Option::is_some) {
            return;
        }
    }
}

/// Bearing error \[rad\] at which a sighting adds one half to [`score`]. Not an option: scores are only compared
/// with each other.
const HALF_EXPLAINED: f64 = 0.1;

/// The robust cost of a map over all sightings of the problem, between 0 and their number.
///
/// Each sighting adds `q / (q + c^2)`, where `q` is the squared sine of its error, or one plus the squared
/// cosine when the landmark is behind the view (unless bearings are modulo pi). A sighting whose view or
/// landmark is not in the map adds 1.
pub fn score(problem: &Problem, map: &Map) -> f64 {
    let bound = HALF_EXPLAINED * HALF_EXPLAINED;
    let lines = !problem.is_oriented();
    let mut sum = 0.0;
    for (view, pose) in map.poses.iter().enumerate() {
        let seen = problem.of_view(view);
        let Some(pose) = pose else {
            sum += seen.len() as f64;
            continue;
        };
        for s in seen {
            let Some(point) = &map.landmarks[s.landmark] else {
                sum += 1.0;
                continue;
            };
            let offset = point.coords - pose.translation.vector;
            let ray = pose.rotation.into_inner() * s.bearing.into_inner();
            let along = ray.re * offset.x + ray.im * offset.y;
            let across = ray.re * offset.y - ray.im * offset.x;
            let square = offset.norm_squared();
            let error = if along > 0.0 || lines {
                across * across
            } else {
                square + along * along
            };
            // Both terms are multiplied by |d|^2, so that one division is enough.
            let total = error + bound * square;
            sum += if total > 0.0 { error / total } else { 1.0 };
        }
    }
    sum
}
