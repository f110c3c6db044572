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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::problem::Map;
    use crate::simulate::{Arena, Layout, simulate};
    use alloc::vec::Vec;

    /// A view beyond the horizon is left out and the rest refined as if it had never been there.
    #[test]
    fn the_rest_is_refined_without_far_views() {
        let scene = simulate(Layout::Enclosed, 6, 9, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(6, 9, &scene.bearings, 0.01).unwrap();
        let options = SolveOptions::default();
        let refined = |without: Option<usize>| {
            let mut map = scene.map();
            if let Some(view) = without {
                map.poses[view] = None;
            }
            let report = refine_map(&problem, &mut map, &options.refine, None).unwrap();
            Reconstruction::new(&problem, &map, report)
        };
        let (whole, expected) = (refined(None), refined(Some(4)));
        let mut start = whole.clone();
        start.alternatives = Vec::from([whole.clone()]);
        start.components = Vec::from([whole.clone()]);
        start.components[0].map = Map::empty(6, 9);
        let same = without_far_views(&problem, start.clone(), &options, &mut None).unwrap();
        assert_eq!((&same.map, same.alternatives.len()), (&whole.map, 1));
        start.map.poses[4].as_mut().unwrap().translation.vector *= 1e9;
        let found = without_far_views(&problem, start.clone(), &options, &mut None).unwrap();
        assert!((found.cost / expected.cost - 1.0).abs() < 1e-6);
        assert_eq!(found.undetermined, expected.undetermined);
        assert_eq!(found.map.poses[4], None);
        assert!(found.alternatives.is_empty() && found.components.len() == 1);
        // Nothing is left of two views and what they see.
        for view in [0, 1, 2] {
            start.map.poses[view] = None;
        }
        start.map.landmarks[2..].fill(None);
        let error = without_far_views(&problem, start.clone(), &options, &mut None);
        assert!(matches!(error, Err(Error::Degenerate { .. })), "{error:?}");
        let stop = &mut |_: &'static str, _, _| false;
        start.map = whole.map.clone();
        start.map.poses[4].as_mut().unwrap().translation.vector *= 1e9;
        let stopped = without_far_views(&problem, start, &options, &mut Some(stop));
        assert_eq!(stopped, Err(Error::Interrupted));
    }
}
