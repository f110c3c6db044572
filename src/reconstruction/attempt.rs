// SPDX-License-Identifier: MIT OR Apache-2.0
//! Refinements that may fail: a start that leads nowhere does not stop the others.

use crate::adjustment::{Report, refine_map};
use crate::error::Error;
use crate::lm::{Observer, RefineOptions};
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
