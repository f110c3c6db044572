// SPDX-License-Identifier: MIT OR Apache-2.0
//! The end of a growth: a place for everything that has one, and the last refinement.

use super::super::options::{Progress, tell};
use super::super::result::Reconstruction;
use super::gates::noise;
use super::growth::GATES;
use super::locate;
use crate::adjustment::refine_map;
use crate::error::Error;
use crate::lm::RefineOptions;
use crate::problem::{MIN_LANDMARKS_OF_VIEW, Map, Problem};

/// Refinements of a map, each of which may make room for a view that did not fit before.
const COMPLETIONS: usize = 3;

/// The last refinement of a map, of everything that has a place in it; `None` when it cannot be
/// refined.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn finish(
    problem: &Problem,
    options: &RefineOptions,
    mut map: Map,
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let mut best: Option<Reconstruction> = None;
    for _ in 0..COMPLETIONS {
        // The gauge of a reconstruction is as good as any.
        if let Some(found) = &best {
            map = found.map.clone();
        }
        let before = map.poses.iter().flatten().count();
        complete(problem, &mut map, free);
        if best.is_some() && map.poses.iter().flatten().count() == before {
            break;
        }
        match refined(problem, options, map.clone(), progress)? {
            Some(found) => {
                let converged = found.termination.was_successful();
                best = Some(found);
                // What is not at rest makes no room.
                if !converged {
                    break;
                }
            }
            None => break,
        }
    }
    Ok(best)
}

/// A map refined; `None` when it cannot be.
fn refined(
    problem: &Problem,
    options: &RefineOptions,
    mut map: Map,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let total = options.max_iterations;
    let mut watch = |done, _| tell(progress, "refine", done, total);
    match refine_map(problem, &mut map, options, Some(&mut watch)) {
        Ok(report) => Ok(Some(Reconstruction::new(problem, &map, report))),
        Err(error) if error.stops_all() => Err(error),
        Err(_) => Ok(None),
    }
}

/// Puts in everything that the gates have kept out and that has a place at all, for the last
/// refinement.
///
/// A landmark whose rays do not meet goes far out along them: the refinement tells whether it is at
/// infinity.
fn complete(problem: &Problem, map: &mut Map, allowed: &[bool]) {
    let noise = noise(problem, map);
    // Landmarks, the views that need them, the landmarks that need these.
    for _ in 0..2 {
        for landmark in 0..map.landmarks.len() {
            if map.landmarks[landmark].is_none() {
                let met = locate::landmark(problem, map, landmark);
                let far = locate::far_out(problem, map, landmark);
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
                && allowed[view]
                && let Some((_, pose, fit)) = locate::view(problem, map, view)
                && fit.passes(MIN_LANDMARKS_OF_VIEW, noise, GATES[GATES.len() - 1])
            {
                map.poses[view] = Some(pose);
            }
        }
    }
}
