// SPDX-License-Identifier: MIT OR Apache-2.0
//! Landmarks behind the views that see them, where a descent has ended that went through a view.

use super::attempt::attempt;
use super::options::{Progress, SolveOptions, report_progress};
use super::result::Reconstruction;
use crate::error::Error;
use crate::problem::{Map, Problem, Subject, Undetermined, Why};
use alloc::vec::Vec;

/// A map without the landmarks that are behind their rays, which are listed, and refined again; unchanged where there are
/// none, or the rest cannot be refined.
///
/// # Errors
/// Those that stop everything, as [`attempt`].
pub fn without_landmarks_behind(
    problem: &Problem,
    mut best: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let Some((mut map, dropped)) = left_without_landmarks_behind(problem, &best.map) else {
        return Ok(best);
    };
    let total = options.refine.max_iterations;
    let mut observer = |done, _| report_progress(progress, "refine", done, total);
    let refined = attempt(problem, &mut map, &options.refine, Some(&mut observer))?;
    let Some(report) = refined else {
        return Ok(best);
    };
    let mut found = Reconstruction::new(problem, &map, report);
    let listed = |one: &Undetermined| dropped.iter().any(|other| other.subject == one.subject);
    found.undetermined.retain(|one| !listed(one));
    found.undetermined.extend(dropped);
    found.undetermined.sort_by_key(|one| one.subject);
    let components = core::mem::take(&mut best.components);
    found.attach(components);
    Ok(found)
}

/// The map without the landmarks that are behind at least half of the rays that see them, and these; `None` when there are none.
///
/// Where priors know a landmark it stays.
fn left_without_landmarks_behind(problem: &Problem, map: &Map) -> Option<(Map, Vec<Undetermined>)> {
    if !problem.is_oriented() {
        return None;
    }
    let known = problem.known_landmarks();
    let mut left = map.clone();
    let mut dropped = Vec::new();
    for (landmark, place) in left.landmarks.iter_mut().enumerate() {
        let Some(point) = place.filter(|_| !known[landmark]) else {
            continue;
        };
        let rays = map.rays(problem, landmark);
        let all = rays.clone().count();
        let behind = rays.filter(|(pose, s)| {
            let ray = (pose.rotation * s.bearing).into_inner();
            let offset = point.coords - pose.translation.vector;
            ray.re * offset.x + ray.im * offset.y < 0.0
        });
        if all > 0 && 2 * behind.count() >= all {
            *place = None;
            dropped.push(Undetermined {
                subject: Subject::Landmark(landmark),
                why: Why::Degenerate,
            });
        }
    }
    (!dropped.is_empty()).then_some((left, dropped))
}
