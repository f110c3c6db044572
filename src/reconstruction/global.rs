// SPDX-License-Identifier: MIT OR Apache-2.0
//! All views at once: headings by averaging over many triples, then one linear system for all
//! positions.
//!
//! Dellaert and Stroupe say that no linear method treats more than three views at once. Once the
//! headings are known there is one, (T30): `Im((x_j - p_i) e^{-i(t_i + a_ij)}) = 0` is linear in all
//! positions and landmarks.

mod headings;
pub(crate) mod options;
pub(crate) mod positions;
mod relative;

use super::options::{Progress, SolveOptions, report_progress};
use crate::error::Error;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// Maximum number of views: the linear systems are dense in the views. Not an option: a bound of the method.
const MAX_VIEWS: usize = 1024;

/// One unrefined map for each set of views connected by triples, the largest first; empty when no three views
/// share five landmarks.
///
/// # Errors
/// [`Error::TooLarge`] above 1024 views, [`Error::NeedsOriented`] for bearings modulo pi, [`Error::Interrupted`];
/// when no triple can be estimated, the error of the last one.
pub fn starts(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    // The signs of the bearings distinguish the branches of most triples, and fix the sign of the linear solution.
    if !problem.is_oriented() {
        return Err(Error::NeedsOriented {
            what: "the global method",
        });
    }
    if problem.views() > MAX_VIEWS {
        return Err(Error::TooLarge {
            what: "views of the global method",
            bound: MAX_VIEWS,
            got: problem.views(),
        });
    }
    let stages = &options.stages;
    let relatives = relative::relatives(problem, options, progress)?;
    let mut maps = Vec::new();
    let total = problem.views();
    let mut done = 0;
    for group in relative::groups(problem.views(), &relatives) {
        if !report_progress(progress, "global", done, total) {
            return Err(Error::Interrupted);
        }
        done += group.len();
        let headings = headings::average(problem.views(), &relatives, &group, &stages.averaging);
        maps.extend(positions::solve(problem, &headings, &stages.positions));
    }
    Ok(maps)
}
