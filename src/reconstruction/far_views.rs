// SPDX-License-Identifier: MIT OR Apache-2.0
//! Views beyond the horizon of a map: a few bearings that contradict the rest send them there.

use super::attempt::attempt;
use super::collapsed::share;
use super::infinity::{
    drop_landmarks_at_infinity, views_beyond_horizon, with_landmarks_at_infinity,
};
use super::options::{Progress, SolveOptions, report_progress};
use super::result::Reconstruction;
use crate::error::{Degeneracy, Error};
use crate::problem::Problem;

/// Rounds in which views are removed: what is left has another size, and may have others beyond its horizon.
const ROUNDS: usize = 4;

/// A map without the views that are beyond its horizon, refined again; unchanged where none are.
///
/// Alternatives do not stay with a map that has lost views: they explain other bearings.
///
/// # Errors
/// [`Error::Degenerate`] where the rest is no map, and those that stop everything.
pub fn without_far_views(
    problem: &Problem,
    mut found: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let refine = &options.refine;
    for _ in 0..ROUNDS {
        let far = views_beyond_horizon(problem, &found.map, &options.stages.infinity);
        if far.is_empty() {
            break;
        }
        let sizes = options.stages.incremental.far_sizes;
        let mut map = with_landmarks_at_infinity(problem, &found, sizes);
        for view in far {
            map.poses[view] = None;
        }
        let mut observer =
            |done, _| report_progress(progress, "refine", done, refine.max_iterations);
        let Some(report) = attempt(problem, &mut map, refine, Some(&mut observer))? else {
            return Err(Error::Degenerate {
                kind: Degeneracy::CollapsedMap,
                value: share(&found.map),
                bound: options.stages.infinity.horizon.recip(),
            });
        };
        let components = core::mem::take(&mut found.components);
        found = Reconstruction::new(problem, &map, report);
        drop_landmarks_at_infinity(problem, &mut found, &options.stages.infinity);
        found.attach(components);
    }
    Ok(found)
}
