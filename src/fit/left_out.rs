// SPDX-License-Identifier: MIT OR Apache-2.0
//! Views and landmarks that a map leaves out because their bearings contradict it.

use super::alarm::{Alarm, Observation, TestOptions, is_poor};
use super::distributions::normal_exceeded;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::kernels::{resect, triangulate};
use crate::problem::{IndexedSighting, Map, Problem, Subject, Why};
use crate::reconstruction::Reconstruction;
use alloc::vec::Vec;

/// What the bearings between the map and each view or landmark that it leaves out say against it: one of them
/// contradicts the map, or all together do.
///
/// Its place is the closed form of all its bearings, and of all but one in turn. The square of what that one costs is
/// the square of its standardized residual.
pub fn left_out(problem: &Problem, found: &Reconstruction, options: &TestOptions) -> Vec<Alarm> {
    let (mut alarms, mut subjects) = (Vec::new(), Vec::new());
    for one in &found.undetermined {
        if !matches!(one.why, Why::Misfit | Why::Degenerate) {
            continue;
        }
        match misfit(problem, &found.map, one.subject, options) {
            None => {}
            Some(None) => subjects.push(one.subject),
            Some(blunder) => alarms.extend(blunder),
        }
    }
    alarms.extend((!subjects.is_empty()).then_some(Alarm::LeftOut { subjects }));
    alarms
}

/// Whether the bearings of a view or a landmark contradict the map, and the one at fault, if it is one.
fn misfit(
    problem: &Problem,
    map: &Map,
    subject: Subject,
    options: &TestOptions,
) -> Option<Option<Alarm>> {
    let (parameters, seen) = match subject {
        Subject::View(view) => {
            let range = problem.range_of_view(view);
            let is_seen = |&k: &usize| map.landmarks[problem.sightings()[k].landmark].is_some();
            (3, range.filter(is_seen).collect::<Vec<_>>())
        }
        Subject::Landmark(landmark) => {
            let all = problem.of_landmark(landmark).iter().copied();
            let is_seen = |&k: &usize| map.poses[problem.sightings()[k].view].is_some();
            (2, all.filter(is_seen).collect())
        }
    };
    let square = |without: Option<usize>| {
        let kept = seen.iter().filter(|k| Some(**k) != without);
        square_of(problem, map, subject, kept.map(|&k| problem.sightings()[k]))
    };
    let freedom = seen.len().checked_sub(parameters)?;
    let all = square(None)?;
    if freedom == 0 || !is_poor(all, freedom, options) {
        return None;
    }
    // With one degree of freedom each of them alone could be at fault.
    let rest = (freedom > 1).then(|| {
        let each = seen.iter().filter_map(|&k| Some((k, square(Some(k))?)));
        each.min_by(|a, b| a.1.total_cmp(&b.1))
    });
    let bound = normal_exceeded(options.blunder_significance / seen.len() as f64);
    let blunder = rest.flatten().and_then(|(k, rest)| {
        let standardized = (all - rest).max(0.0).sqrt();
        let is_one = standardized > bound && !is_poor(rest, freedom - 1, options);
        is_one.then(|| Alarm::Blunder {
            observation: Observation::Sighting(problem.input_order()[k]),
            standardized,
        })
    });
    Some(blunder)
}

/// The sum of the squared residuals over sigma of a view or a landmark at the place that its sightings give it; `None`
/// where they give none.
fn square_of(
    problem: &Problem,
    map: &Map,
    subject: Subject,
    sightings: impl Iterator<Item = IndexedSighting> + Clone,
) -> Option<f64> {
    let sum = |residuals: &mut dyn Iterator<Item = f64>| residuals.map(|r| r * r).sum();
    match subject {
        Subject::View(_) => {
            let seen = sightings.filter_map(|s| Some((map.landmarks[s.landmark]?, s)));
            let pose = resect(seen.clone().map(|(point, s)| (point, s.bearing))).ok()?;
            let residual = |(point, s)| problem.residual(&pose.pose, &point, &s) * s.weight;
            Some(sum(&mut seen.map(residual)))
        }
        Subject::Landmark(_) => {
            let rays = sightings.filter_map(|s| Some((map.poses[s.view]?, s)));
            let place = triangulate(rays.clone().map(|(pose, s)| (pose, s.bearing))).ok()?;
            let residual = |(pose, s)| problem.residual(&pose, &place.point, &s) * s.weight;
            Some(sum(&mut rays.map(residual)))
        }
    }
}
