// SPDX-License-Identifier: MIT OR Apache-2.0
//! Choice of the strategy by how much the views see, and the result of several components.

use super::attempt::converged;
use super::behind::without_landmarks_behind;
use super::collapsed::refuse_collapsed;
use super::far_views::without_far_views;
use super::grow::resect_view;
use super::incremental::merge::views;
use super::infinity::drop_landmarks_at_infinity;
use super::judge::{assess, judged};
use super::options::{Progress, SolveOptions, Strategy};
use super::result::Reconstruction;
use super::search::hypotheses::{self, MIN_SHARED};
use super::search::{first_three, plain};
use super::sight::is_limited;
use super::{global, incremental};
use crate::error::{Degeneracy, Error};
use crate::problem::{Map, Problem, Subject, Why};
use alloc::vec;
use alloc::vec::Vec;

/// The strategy that is effective: the search gives way to growth under limited sight.
pub fn effective(problem: &Problem, options: &SolveOptions) -> Strategy {
    match options.strategy {
        Strategy::Search if is_limited(problem, &options.stages.sight) => Strategy::Incremental,
        other => other,
    }
}

/// The map from bearings alone, without outliers, with uncertainty and tested for free directions.
///
/// # Errors
/// As [`solve`](super::solve).
pub fn solve(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let best = lowest(problem, options, progress)?;
    finished(problem, options, best, progress)
}

/// The best map refined to the end, without what has gone to infinity or behind its views by then, and tested for free
/// directions.
///
/// # Errors
/// As [`solve`](super::solve).
pub fn finished(
    problem: &Problem,
    options: &SolveOptions,
    best: Reconstruction,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut best = converged(problem, best, options, progress)?;
    drop_landmarks_at_infinity(problem, &mut best, &options.stages.infinity);
    let best = without_far_views(problem, best, options, progress)?;
    let best = without_landmarks_behind(problem, best, options, progress)?;
    refuse_collapsed(problem, &best, &options.stages.judge)?;
    judged(problem, best)
}

/// As [`solve`], but not yet tested for free directions.
///
/// # Errors
/// As [`solve`].
pub fn lowest(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut maps = Vec::new();
    for map in components(problem, options, progress)? {
        let few = views(&map) <= options.stages.incremental.moved_views;
        maps.push(if few {
            plain::moved(problem, map, options, progress)?
        } else {
            map
        });
    }
    if let Some(found) = assembled(problem, options, maps) {
        return Ok(found);
    }
    match options.strategy {
        Strategy::FirstViews(method) => {
            let map = first_three::initialize_from_first_three(problem, method)?;
            plain::from_map(problem, map, options, progress)
        }
        Strategy::Search => plain::lowest(problem, options, progress),
        Strategy::Incremental | Strategy::Global => Err(no_map(problem, options)),
    }
}

/// Refined maps of different views as one result: without landmarks at infinity, the components assessed.
pub fn assembled(
    problem: &Problem,
    options: &SolveOptions,
    mut maps: Vec<Reconstruction>,
) -> Option<Reconstruction> {
    for map in &mut maps {
        drop_landmarks_at_infinity(problem, map, &options.stages.infinity);
    }
    for map in maps.iter_mut().skip(1) {
        assess(problem, map);
    }
    with_components(problem, maps)
}

/// The refined maps of all components, the largest first; empty for the other strategies, or when no three
/// views share five landmarks.
fn components(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction>, Error> {
    match effective(problem, options) {
        Strategy::Incremental => incremental::grow(problem, options, progress),
        Strategy::Global => {
            let starts = global::starts(problem, options, progress)?;
            incremental::finish_all(problem, options, starts, progress)
        }
        Strategy::Search | Strategy::FirstViews(_) => Ok(Vec::new()),
    }
}

/// First maps without a final refinement, the best first; two of a search, because either may be the better one.
///
/// # Errors
/// As [`initialize`](super::initialize).
pub fn first_maps(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    let grown = match effective(problem, options) {
        Strategy::Incremental => incremental::first(problem, options, progress)?,
        Strategy::Global => global::starts(problem, options, progress)?
            .into_iter()
            .next(),
        Strategy::Search | Strategy::FirstViews(_) => None,
    };
    if let Some(map) = grown {
        return Ok(vec![map]);
    }
    match options.strategy {
        Strategy::FirstViews(method) => Ok(vec![first_three::initialize_from_first_three(
            problem, method,
        )?]),
        Strategy::Search => {
            let found = hypotheses::search(problem, options, progress)?;
            let maps = found.maps.into_iter().take(2);
            Ok(maps.map(|hypothesis| hypothesis.map).collect())
        }
        Strategy::Incremental | Strategy::Global => Err(no_map(problem, options)),
    }
}

/// Why growth and the global method have found no map.
fn no_map(problem: &Problem, options: &SolveOptions) -> Error {
    match hypotheses::too_few(problem, MIN_SHARED, &options.stages.draw) {
        Error::TooFew { got, .. } if got >= MIN_SHARED => Error::Degenerate {
            kind: Degeneracy::NoSpareSighting,
            value: 0.0,
            bound: 1.0,
        },
        error => error,
    }
}

/// The largest map with the others as its components; `None` when there are none.
///
/// What is in any component is not listed as undetermined. The components list only their own landmarks
/// at infinity.
pub fn with_components(problem: &Problem, maps: Vec<Reconstruction>) -> Option<Reconstruction> {
    let mut maps = maps.into_iter();
    let mut main = maps.next()?;
    main.attach(maps.collect());
    for undetermined in &mut main.undetermined {
        if let (Subject::View(view), Why::Degenerate) = (undetermined.subject, undetermined.why)
            && resect_view(problem, &main.map, view).is_some()
        {
            undetermined.why = Why::Misfit;
        }
    }
    for other in &mut main.components {
        // List landmarks at infinity, which still belong to this map, but not what it never reached.
        other
            .undetermined
            .retain(|undetermined| undetermined.why == Why::AtInfinity);
    }
    Some(main)
}
