// SPDX-License-Identifier: MIT OR Apache-2.0
//! Landmarks behind the views that see them, where a descent has ended that went through a view.

use super::attempt::attempt;
use super::far_views::without_far_views;
use super::infinity::{drop_landmarks_at_infinity, with_landmarks_at_infinity};
use super::options::{Progress, SolveOptions, report_progress};
use super::result::Reconstruction;
use crate::error::Error;
use crate::geometry::is_ahead;
use crate::problem::{Map, Problem, Subject, Why};
use alloc::vec::Vec;

/// A map without the landmarks that are behind their rays, which are listed, and refined again; unchanged where there are
/// none, or the rest cannot be refined.
///
/// Alternatives do not stay with a map that has lost landmarks: they explain other bearings.
///
/// # Errors
/// As [`without_far_views`].
pub fn without_landmarks_behind(
    problem: &Problem,
    mut best: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let dropped = landmarks_behind(problem, &best.map);
    if dropped.is_empty() {
        return Ok(best);
    }
    // The bearings of those at infinity still count.
    let sizes = options.stages.incremental.far_sizes;
    let mut map = with_landmarks_at_infinity(problem, &best, sizes);
    for &landmark in &dropped {
        map.landmarks[landmark] = None;
    }
    let total = options.refine.max_iterations;
    let mut observer = |done, _| report_progress(progress, "refine", done, total);
    let refined = attempt(problem, &mut map, &options.refine, Some(&mut observer))?;
    let Some(report) = refined else {
        return Ok(best);
    };
    let mut found = Reconstruction::new(problem, &map, report);
    for one in &mut found.undetermined {
        if matches!(one.subject, Subject::Landmark(landmark) if dropped.contains(&landmark)) {
            one.why = Why::Degenerate;
        }
    }
    drop_landmarks_at_infinity(problem, &mut found, &options.stages.infinity);
    let components = core::mem::take(&mut best.components);
    found.attach(components);
    // The refinement of the rest may have sent views away.
    without_far_views(problem, found, options, progress)
}

/// The landmarks that are behind at least half of the rays that see them; where priors know a landmark it stays.
fn landmarks_behind(problem: &Problem, map: &Map) -> Vec<usize> {
    if !problem.is_oriented() {
        return Vec::new();
    }
    let known = problem.known_landmarks();
    let behind = |&landmark: &usize| {
        let Some(point) = map.landmarks[landmark].filter(|_| !known[landmark]) else {
            return false;
        };
        let rays = map.rays(problem, landmark);
        // On its view it is neither.
        let behind = rays.clone().filter(|(pose, s)| {
            !is_ahead(pose, &s.bearing, &point) && point.coords != pose.translation.vector
        });
        let behind = behind.count();
        behind > 0 && 2 * behind >= rays.count()
    };
    (0..problem.landmarks()).filter(behind).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::geometry::{bearing_to, pose};
    use crate::problem::{LandmarkPrior, Noise};
    use crate::simulate::{Arena, Layout, simulate};
    use core::f64::consts::PI;
    use nalgebra::{Point2, Vector2};

    /// A landmark behind half of the views that see it is behind; on a view it is neither. Modulo pi there is no behind, and
    /// what a prior knows stays.
    #[test]
    fn landmarks_behind_half_of_their_rays_are_behind() {
        let point = Point2::new(0.5, 2.0);
        let places = [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (-1.0, 1.0)];
        let map = |on_view: bool| Map {
            poses: places.map(|(x, y)| Some(pose(x, y, 0.3))).to_vec(),
            landmarks: Vec::from([Some(if on_view {
                Point2::new(0.0, 0.0)
            } else {
                point
            })]),
        };
        let problem = |behind: usize| {
            let bearing = |k: usize| {
                let toward = bearing_to(&map(false).poses[k].unwrap(), &point).unwrap();
                toward.angle() + if k >= 4 - behind { PI } else { 0.2 }
            };
            let bearings: [f64; 4] = core::array::from_fn(bearing);
            Problem::dense(4, 1, &bearings, 0.1).unwrap()
        };
        for (behind, expected) in [(0, &[][..]), (1, &[]), (2, &[0]), (4, &[0])] {
            let problem = problem(behind);
            assert_eq!(
                landmarks_behind(&problem, &map(false)),
                expected,
                "{behind}"
            );
            assert_eq!(
                landmarks_behind(&problem.clone().unoriented(), &map(false)),
                [0; 0]
            );
            let known = LandmarkPrior {
                landmark: 0,
                position: point,
                noise: Noise::Sigmas([1.0, 1.0]),
            };
            let known = problem.with_landmark_priors(&[known]).unwrap();
            assert_eq!(landmarks_behind(&known, &map(false)), [0; 0]);
        }
        let mut lost = map(false);
        lost.landmarks[0] = None;
        assert_eq!(landmarks_behind(&problem(4), &lost), [0; 0]);
        // Nobody in the map sees it.
        lost = map(false);
        lost.poses.fill(None);
        assert_eq!(landmarks_behind(&problem(4), &lost), [0; 0]);
        // On the first view it is behind two of the other three, or one.
        let on_view = |wrong: [f64; 4]| {
            let mut map = map(true);
            map.poses[0] = Some(pose(0.0, 0.0, 0.3));
            let bearing = |k: usize| match k {
                0 => PI,
                k => {
                    bearing_to(&map.poses[k].unwrap(), &Point2::origin())
                        .unwrap()
                        .angle()
                        + wrong[k]
                }
            };
            let bearings: [f64; 4] = core::array::from_fn(bearing);
            landmarks_behind(&Problem::dense(4, 1, &bearings, 0.1).unwrap(), &map)
        };
        assert_eq!(on_view([0.0, PI, PI, 0.0]), [0]);
        assert_eq!(on_view([0.0, PI, 0.0, 0.0]), [0; 0]);
    }

    /// The rest is refined as if the landmark had never been seen, with what is at infinity, and what was lost is listed.
    #[test]
    fn the_rest_is_refined_without_them() {
        let scene = simulate(Layout::Enclosed, 6, 10, 0.01, 3, Arena::default()).unwrap();
        let (far, from) = (Point2::new(2.4e4, -1.8e4), Vector2::new(-236.5, 182.5));
        let mut bearings = scene.bearings.clone();
        for (view, pose) in scene.poses.iter().enumerate() {
            bearings[view * 10 + 4] += PI;
            // The rays of the last one diverge, as if from the other side.
            let ahead = pose.translation.vector * 2.0 - from;
            bearings[view * 10 + 9] = bearing_to(pose, &ahead.into()).unwrap().angle();
        }
        let problem = Problem::dense(6, 10, &bearings, 0.01).unwrap();
        let options = SolveOptions::default();
        let refined = |without: bool| {
            let mut map = scene.map();
            map.landmarks[9] = Some(far);
            if without {
                map.landmarks[4] = None;
            }
            let report = refine_map(&problem, &mut map, &options.refine, None).unwrap();
            let mut found = Reconstruction::new(&problem, &map, report);
            drop_landmarks_at_infinity(&problem, &mut found, &options.stages.infinity);
            found
        };
        let expected = refined(true);
        let mut start = expected.clone();
        start.map.landmarks[4] = triangulated(&problem, &expected.map);
        start
            .undetermined
            .retain(|one| one.subject != Subject::Landmark(4));
        start.alternatives = Vec::from([expected.clone()]);
        start.components = Vec::from([expected.clone()]);
        start.components[0].map = Map::empty(6, 10);
        let mut told = 0;
        let mut progress = |stage: &'static str, done: usize, all: usize| {
            told += usize::from(stage == "refine" && done <= all);
            true
        };
        let found = without_landmarks_behind(&problem, start, &options, &mut Some(&mut progress));
        let found = found.unwrap();
        assert!(told > 0);
        assert!((found.cost / expected.cost - 1.0).abs() < 1e-6);
        assert_eq!(found.freedom, expected.freedom);
        assert_eq!(found.map.landmarks[4], None);
        let why = |landmark: usize| {
            let mut listed = found.undetermined.iter();
            listed
                .find(|one| one.subject == Subject::Landmark(landmark))
                .map(|one| one.why)
        };
        assert_eq!(why(4), Some(Why::Degenerate));
        assert_eq!(why(9), Some(Why::AtInfinity));
        assert_eq!(found.undetermined.len(), 2);
        assert!(found.alternatives.is_empty() && found.components.len() == 1);
        // Where none is behind nothing changes.
        let mut kept = expected.clone();
        kept.alternatives = Vec::from([expected.clone()]);
        let same = without_landmarks_behind(&problem, kept, &options, &mut None).unwrap();
        assert_eq!(same.alternatives.len(), 1);
        assert_eq!(same.map, expected.map);
    }

    /// Where the rays of the fifth landmark meet: behind the views, whose bearings are the wrong way round.
    fn triangulated(problem: &Problem, map: &Map) -> Option<Point2<f64>> {
        let rays = map.rays(problem, 4).map(|(pose, s)| (pose, s.bearing));
        crate::kernels::triangulate(rays)
            .ok()
            .map(|found| found.point)
    }
}
