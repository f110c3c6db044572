// SPDX-License-Identifier: MIT OR Apache-2.0
//! Completion of a grown map: places everything that can be placed, and refines for the last time.

use super::super::attempt::attempt;
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::result::Reconstruction;
use super::gates::{Fit, noise};
use super::options::IncrementalOptions;
use super::place;
use crate::error::Error;
use crate::lm::RefineOptions;
use crate::problem::{MIN_LANDMARKS_OF_VIEW, Map, Problem};

/// Completes a map and refines it for the last time; `None` when it cannot be refined.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn finish(
    problem: &Problem,
    options: &SolveOptions,
    mut map: Map,
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let stage = &options.stages.incremental;
    let refine = RefineOptions {
        max_iterations: options.refine.max_iterations.min(stage.finished_iterations),
        ..options.refine
    };
    let mut best: Option<Reconstruction> = None;
    for _ in 0..stage.completions {
        // The gauge of a reconstruction is as good as any.
        if let Some(found) = &best {
            map = found.map.clone();
        }
        let before = map.poses.iter().flatten().count();
        complete(problem, stage, &mut map, free);
        if best.is_some() && map.poses.iter().flatten().count() == before {
            break;
        }
        match refined(problem, &refine, map.clone(), progress)? {
            Some(found) => {
                let converged = found.termination.was_successful();
                best = Some(found);
                // Only a converged map can make room for further views.
                if !converged {
                    break;
                }
            }
            None => break,
        }
    }
    Ok(best)
}

/// Refines a map; `None` when it cannot be refined.
fn refined(
    problem: &Problem,
    options: &RefineOptions,
    mut map: Map,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let total = options.max_iterations;
    let mut observer = |done, _| report_progress(progress, "refine", done, total);
    let report = attempt(problem, &mut map, options, Some(&mut observer))?;
    Ok(report.map(|report| Reconstruction::new(problem, &map, report)))
}

/// Adds everything that the gates have kept out and that can be placed at all, for the last refinement.
fn complete(problem: &Problem, options: &IncrementalOptions, map: &mut Map, allowed: &[bool]) {
    let noise = noise(problem, map, options);
    let [.., widest] = options.gates;
    place_rest(problem, options, map, |view, fit| {
        allowed[view] && fit.passes(MIN_LANDMARKS_OF_VIEW, noise, widest)
    });
}

/// Adds all views and landmarks that can be placed at all, however badly they fit.
pub fn place_all(problem: &Problem, options: &IncrementalOptions, map: &mut Map) {
    place_rest(problem, options, map, |_, _| true);
}

/// Adds the landmarks that can be placed at all, and the views that may be taken.
///
/// A landmark whose rays do not meet ahead is put far out along them: the refinement finds out whether it is at
/// infinity.
fn place_rest(
    problem: &Problem,
    options: &IncrementalOptions,
    map: &mut Map,
    takes: impl Fn(usize, &Fit) -> bool,
) {
    // Landmarks, the views that need them, the landmarks that need these.
    for _ in 0..2 {
        for landmark in 0..map.landmarks.len() {
            if map.landmarks[landmark].is_none() {
                let met = place::place_landmark(problem, map, landmark);
                let far = place::place_far_out(problem, map, landmark, options.far_sizes);
                let places = met.into_iter().chain(far);
                let best = places.min_by(|a, b| {
                    let [a, b] = [a, b].map(|(_, fit)| fit.squares);
                    a.total_cmp(&b)
                });
                map.landmarks[landmark] = best.map(|(point, _)| point);
            }
        }
        for view in 0..map.poses.len() {
            if map.poses[view].is_none()
                && let Some((_, pose, fit)) = place::place_view(problem, map, view)
                && takes(view, &fit)
            {
                map.poses[view] = Some(pose);
            }
        }
    }
}
