// SPDX-License-Identifier: MIT OR Apache-2.0
//! Refinements that may fail: a start that leads nowhere is no reason to give up the others.

use crate::adjustment::{Report, refine_map};
use crate::error::Error;
use crate::lm::{Observer, RefineOptions};
use crate::problem::{Map, Problem};

/// Refines a map in place; `None` when it cannot be refined.
///
/// A map that could not be refined may have lost the views and landmarks that its other parts do not fix;
/// nothing else of it has changed.
///
/// # Errors
/// Those that stop all work, as [`recoverable`].
pub fn attempt(
    problem: &Problem,
    map: &mut Map,
    options: &RefineOptions,
    observer: Option<Observer<'_>>,
) -> Result<Option<Report>, Error> {
    Ok(recoverable(refine_map(problem, map, options, observer))?.ok())
}

/// The failures of one attempt, which another may make good, apart from those that stop all work.
///
/// For callers that keep the last failure: when no attempt succeeds it says why.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn recoverable<T>(result: Result<T, Error>) -> Result<Result<T, Error>, Error> {
    match result {
        Err(error) if error.stops_all() => Err(error),
        other => Ok(other),
    }
}
