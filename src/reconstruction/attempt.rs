// SPDX-License-Identifier: MIT OR Apache-2.0
//! Refinements that may fail: a start that leads nowhere does not stop the others.

use super::choice::SAME_COST;
use super::infinity::with_landmarks_at_infinity;
use super::options::{Progress, SolveOptions, report_progress};
use super::result::Reconstruction;
use crate::adjustment::{Report, refine_map};
use crate::error::Error;
use crate::lm::{Observer, RefineOptions, Termination};
use crate::problem::{Map, Problem};

/// Refines a map in place; `None` when it cannot be refined.
///
/// A map that could not be refined may have lost views and landmarks that the rest of it does not determine;
/// nothing else has changed.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn attempt(
    problem: &Problem,
    map: &mut Map,
    options: &RefineOptions,
    observer: Option<Observer<'_>>,
) -> Result<Option<Report>, Error> {
    Ok(recoverable(refine_map(problem, map, options, observer))?.ok())
}

/// Separates the failures of one attempt, after which another may still succeed, from those that stop everything.
///
/// Callers keep the last failure, to report it when no attempt succeeds.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn recoverable<T>(result: Result<T, Error>) -> Result<Result<T, Error>, Error> {
    match result {
        Err(error) if error.stops_all() => Err(error),
        other => Ok(other),
    }
}

/// A map that was given few iterations, refined to the end with all of its bearings, those of landmarks at infinity
/// among them; its alternatives and components stay.
///
/// One that no step lowers is refined anew as well, in the frame of the report: where a free scale has shrunk, steps were
/// lost in rounding. A map stays as it is where the descent from landmarks put back far out ends higher.
///
/// # Errors
/// Those that stop everything, as [`recoverable`].
pub fn converged(
    problem: &Problem,
    mut found: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let sizes = options.stages.incremental.far_sizes;
    let options = &options.refine;
    loop {
        let stuck = found.termination == Termination::NoProgress;
        let left = options.max_iterations.saturating_sub(found.iterations);
        if !(stuck || found.termination == Termination::MaxIterations) || left == 0 {
            return Ok(found);
        }
        let further = RefineOptions {
            max_iterations: left,
            ..*options
        };
        let mut map = with_landmarks_at_infinity(problem, &found, sizes);
        let used = found.iterations;
        let mut observer =
            |done, _| report_progress(progress, "refine", used + done, options.max_iterations);
        let Some(report) = attempt(problem, &mut map, &further, Some(&mut observer))? else {
            return Ok(found);
        };
        let mut refined = Reconstruction::new(problem, &map, report);
        let lower = refined.cost < found.cost * SAME_COST;
        let higher = found.cost < refined.cost * SAME_COST;
        if higher || (stuck && !lower) {
            return Ok(found);
        }
        refined.iterations += used;
        refined.alternatives = core::mem::take(&mut found.alternatives);
        refined.attach(core::mem::take(&mut found.components));
        found = refined;
    }
}
