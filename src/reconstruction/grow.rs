// SPDX-License-Identifier: MIT OR Apache-2.0
//! Growth of a map from a few poses by resection and triangulation, and its score.

use crate::geometry::{Bearing, Pose};
use crate::kernels::{LineOfSight, meeting, resect};
use crate::problem::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Map, Problem};
use alloc::vec::Vec;
use nalgebra::Point2;

/// Triangulates every landmark that at least two determined views see, replacing any earlier position.
pub fn triangulate_all(problem: &Problem, map: &mut Map) {
    // Gathered, because they are iterated several times.
    let mut rays = Vec::new();
    for landmark in 0..map.landmarks.len() {
        rays.clear();
        let sightings = map.rays(problem, landmark);
        rays.extend(sightings.map(|(pose, s)| LineOfSight::new(&pose, &s.bearing)));
        if rays.len() >= MIN_VIEWS_OF_LANDMARK {
            let found = meeting(rays.iter().copied());
            map.landmarks[landmark] = found.ok().map(|found| found.point);
        }
    }
}

/// The pose of a view by resection from the landmarks in the map, and its misfit.
pub fn resect_view(problem: &Problem, map: &Map, view: usize) -> Option<(Pose<f64>, f64)> {
    resect_from(problem, map, view, &mut Vec::new())
}

/// As [`resect_view`], with room for the sightings, which are gathered because they are iterated several times.
fn resect_from(
    problem: &Problem,
    map: &Map,
    view: usize,
    seen: &mut Vec<(Point2<f64>, Bearing<f64>)>,
) -> Option<(Pose<f64>, f64)> {
    seen.clear();
    let sightings = map.seen(problem, view);
    seen.extend(sightings.map(|(point, s)| (point, s.bearing)));
    if seen.len() < MIN_LANDMARKS_OF_VIEW {
        return None;
    }
    let found = resect(seen.iter().copied()).ok()?;
    Some((found.pose, found.misfit))
}

/// Grows a map from its poses by alternating triangulation and resection until nothing can be added.
///
/// All landmarks are triangulated again after each round, because more views are then known.
pub fn grow(problem: &Problem, map: &mut Map) {
    let mut seen = Vec::new();
    triangulate_all(problem, map);
    loop {
        let mut grown = false;
        for view in 0..map.poses.len() {
            if map.poses[view].is_none()
                && let Some((pose, _)) = resect_from(problem, map, view, &mut seen)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::simulate::{Arena, Layout, simulate};

    /// A sighting off by the sine of a tenth counts one half, one behind its view nearly one, one without a map one.
    #[test]
    fn the_score_counts_what_is_not_explained() {
        let scored = |bearing: f64, oriented: bool| {
            let problem = Problem::dense(1, 1, &[bearing], 1.0).unwrap();
            let problem = if oriented {
                problem
            } else {
                problem.unoriented()
            };
            let mut map = Map::empty(1, 1);
            map.poses[0] = Some(pose(1.0, 2.0, 0.3));
            map.landmarks[0] = Some(pose(1.0, 2.0, 0.3) * Point2::new(5.0, 0.0));
            let found = score(&problem, &map);
            map.landmarks[0] = None;
            assert_eq!(score(&problem, &map), 1.0);
            map.landmarks[0] = Some(Point2::new(1.0, 2.0));
            assert_eq!(score(&problem, &map), 1.0);
            map.poses[0] = None;
            assert_eq!(score(&problem, &map), 1.0);
            found
        };
        let half = 0.1_f64.asin();
        for (bearing, oriented, expected) in [
            (0.0, true, 0.0),
            (half, true, 0.5),
            (-half, true, 0.5),
            (core::f64::consts::PI - half, false, 0.5),
            // One plus the squared cosine, over that and a hundredth.
            (core::f64::consts::PI, true, 2.0 / 2.01),
            (core::f64::consts::FRAC_PI_2 + 1e-9, true, 1.0 / 1.01),
        ] {
            let found = scored(bearing, oriented);
            assert!(
                (found - expected).abs() < 1e-7,
                "{bearing} {oriented}: {found}"
            );
        }
    }

    /// From two poses of an exact scene all the rest is reached; what two views see is no longer where it was.
    #[test]
    fn an_exact_map_grows_from_two_poses() {
        let scene = simulate(Layout::Enclosed, 5, 9, 0.0, 2, Arena::default()).unwrap();
        let mut bearings = scene.bearings.clone();
        // The last view sees three landmarks, one of which only it and another one see.
        bearings[4 * 9..4 * 9 + 6].fill(f64::NAN);
        for view in 0..3 {
            bearings[9 * view + 8] = f64::NAN;
        }
        let problem = Problem::dense(5, 9, &bearings, 0.01).unwrap();
        let mut map = Map::empty(5, 9);
        map.poses[0] = Some(scene.poses[0]);
        map.poses[1] = Some(scene.poses[1]);
        map.landmarks[2] = Some(Point2::new(50.0, 50.0));
        assert!(resect_view(&problem, &map, 2).is_none());
        grow(&problem, &mut map);
        let poses = map.poses.iter().zip(&scene.poses).take(4);
        for (pose, truth) in poses {
            assert!((pose.unwrap().translation.vector - truth.translation.vector).norm() < 1e-6);
        }
        for (point, truth) in map.landmarks.iter().zip(&scene.landmarks).take(8) {
            assert!((point.unwrap() - truth).norm() < 1e-6);
        }
        // Two landmarks are too few for a view, and one view for a landmark.
        assert_eq!((map.poses[4], map.landmarks[8]), (None, None));
        let (found, misfit) = resect_view(&problem, &map, 2).unwrap();
        assert!((found.translation.vector - scene.poses[2].translation.vector).norm() < 1e-6);
        assert!(misfit < 1e-9);
    }
}
