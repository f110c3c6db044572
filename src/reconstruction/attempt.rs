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
    loop {
        let stuck = found.termination == Termination::NoProgress;
        if !(stuck || found.termination == Termination::MaxIterations) {
            return Ok(found);
        }
        let start = with_landmarks_at_infinity(problem, &found, sizes);
        let Some(mut refined) = further(problem, &found, start, options, progress)? else {
            return Ok(found);
        };
        let lower = refined.cost < found.cost * SAME_COST;
        let higher = found.cost < refined.cost * SAME_COST;
        if higher || (stuck && !lower) {
            return Ok(found);
        }
        refined.alternatives = core::mem::take(&mut found.alternatives);
        refined.attach(core::mem::take(&mut found.components));
        found = refined;
    }
}

/// What is left of the iterations of a map, from a start near it, without its alternatives and components; `None` when
/// nothing is left or the start cannot be refined.
///
/// # Errors
/// Those that stop everything, as [`recoverable`].
pub fn further(
    problem: &Problem,
    found: &Reconstruction,
    mut start: Map,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let refine = &options.refine;
    let used = found.iterations;
    let left = refine.max_iterations.saturating_sub(used);
    if left == 0 {
        return Ok(None);
    }
    let further = RefineOptions {
        max_iterations: left,
        ..*refine
    };
    let mut observer =
        |done, _| report_progress(progress, "refine", used + done, refine.max_iterations);
    let report = attempt(problem, &mut start, &further, Some(&mut observer))?;
    Ok(report.map(|mut report| {
        report.iterations += used;
        Reconstruction::new(problem, &start, report)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};
    use alloc::vec::Vec;

    /// What was given few iterations goes on where it ended, with its alternatives and components; what has converged, or
    /// has used up its iterations, does not, nor what is not lowered.
    #[test]
    fn a_refinement_that_was_cut_short_goes_on() {
        let scene = simulate(Layout::Enclosed, 6, 9, 0.02, 3, Arena::default()).unwrap();
        let problem = Problem::dense(6, 9, &scene.bearings, 0.02).unwrap();
        let options = SolveOptions::default();
        let refined = |max_iterations: usize| {
            let mut map = scene.map();
            let refine = RefineOptions {
                max_iterations,
                ..options.refine
            };
            let report = refine_map(&problem, &mut map, &refine, None).unwrap();
            Reconstruction::new(&problem, &map, report)
        };
        let least = refined(100);
        assert!(least.termination.was_successful());
        let mut short = refined(1);
        assert_eq!(short.termination, Termination::MaxIterations);
        assert!(short.cost > least.cost * 1.001);
        short.alternatives = Vec::from([least.clone()]);
        short.components = Vec::from([least.clone()]);
        let go_on = |found: &Reconstruction, max_iterations: usize| {
            let mut options = options;
            options.refine.max_iterations = max_iterations;
            let mut told = Vec::new();
            let mut progress = |_: &'static str, done: usize, all: usize| {
                told.push((done, all));
                true
            };
            let found = converged(&problem, found.clone(), &options, &mut Some(&mut progress));
            (found.unwrap(), told)
        };
        let (found, told) = go_on(&short, 100);
        assert!((found.cost / least.cost - 1.0).abs() < 1e-6);
        assert!(found.iterations > 1 && found.termination.was_successful());
        assert_eq!((found.alternatives.len(), found.components.len()), (1, 1));
        // The iterations before count.
        assert_eq!(told.first(), Some(&(1, 100)));
        for (found, limit) in [(&short, 1), (&least, 100)] {
            let (same, told) = go_on(found, limit);
            assert!(
                same.cost == found.cost && same.iterations == found.iterations && told.is_empty()
            );
        }
        // One that no step lowered is tried anew, and kept where that does not lower it either.
        let mut stuck = short.clone();
        stuck.termination = Termination::NoProgress;
        assert!((go_on(&stuck, 100).0.cost / least.cost - 1.0).abs() < 1e-6);
        let mut stuck = least.clone();
        (stuck.termination, stuck.iterations) = (Termination::NoProgress, 7);
        let (same, _) = go_on(&stuck, 100);
        assert_eq!(
            (same.iterations, same.termination),
            (7, Termination::NoProgress)
        );
        // A map that the descent would leave for a higher one stays.
        let mut lower = short.clone();
        lower.cost = 0.5 * least.cost;
        assert_eq!(go_on(&lower, 100).0.iterations, 1);
    }
}
