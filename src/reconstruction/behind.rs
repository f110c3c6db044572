// SPDX-License-Identifier: MIT OR Apache-2.0
//! Landmarks behind the views that see them, where a descent has ended that went through a view.

use super::attempt::attempt;
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
/// Those that stop everything, as [`attempt`].
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
    Ok(found)
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
        let all = rays.clone().count();
        // On its view it is neither.
        let behind = rays.filter(|(pose, s)| {
            point.coords != pose.translation.vector && !is_ahead(pose, &s.bearing, &point)
        });
        all > 0 && 2 * behind.count() >= all
    };
    (0..problem.landmarks()).filter(behind).collect()
}
