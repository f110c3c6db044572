// SPDX-License-Identifier: MIT OR Apache-2.0
//! Choice of the strategy by how much the views see, and the result of several components.

use super::grow::resect_view;
use super::infinity::drop_landmarks_at_infinity;
use super::judge::{assess, judged};
use super::options::{Progress, SolveOptions, Strategy};
use super::result::Reconstruction;
use super::search::hypotheses::{self, MIN_SHARED};
use super::search::{first_three, plain};
use super::{global, incremental};
use crate::error::{Degeneracy, Error};
use crate::problem::{Map, Problem, Subject, Why};
use alloc::vec;
use alloc::vec::Vec;

/// The rule of [`is_limited`].
#[derive(Clone, Copy, Debug)]
struct SightOptions {
    /// Sight is limited with more views than this: no triple covers much of the whole.
    many_views: usize,
    /// Sight is not limited with fewer views than this.
    few_views: usize,
    /// In between, sight is limited when the views see less than this fraction of the landmarks on average.
    filled: f64,
}

impl Default for SightOptions {
    fn default() -> Self {
        Self {
            many_views: 40,
            few_views: 8,
            filled: 0.6,
        }
    }
}

/// Whether sight is limited: more than 40 views, or at least eight that see less than 60 % of the
/// landmarks on average.
///
/// A triple of views then covers little of the whole, and a map that is grown from it without refinement
/// in between drifts. Views and landmarks without sightings do not count.
fn is_limited(problem: &Problem) -> bool {
    let views = (0..problem.views()).filter(|&view| !problem.of_view(view).is_empty());
    let landmarks = (0..problem.landmarks()).filter(|&k| !problem.of_landmark(k).is_empty());
    let (views, landmarks) = (views.count(), landmarks.count());
    let filled = problem.sightings().len() as f64 / (views * landmarks).max(1) as f64;
    let options = SightOptions::default();
    views > options.many_views || (views >= options.few_views && filled < options.filled)
}

/// The effective strategy: under limited sight, incremental growth replaces the search.
fn effective(problem: &Problem, strategy: Strategy) -> Strategy {
    match strategy {
        Strategy::Search if is_limited(problem) => Strategy::Incremental,
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
    judged(problem, lowest(problem, options, progress)?)
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
    let mut maps = components(problem, options, progress)?;
    for map in &mut maps {
        drop_landmarks_at_infinity(problem, map);
    }
    for map in maps.iter_mut().skip(1) {
        assess(problem, map);
    }
    if let Some(found) = with_components(problem, maps) {
        return Ok(found);
    }
    match options.strategy {
        Strategy::FirstViews(method) => {
            let map = first_three::initialize_from_first_three(problem, method)?;
            plain::from_map(problem, map, options, progress)
        }
        Strategy::Search => plain::lowest(problem, options, progress),
        Strategy::Incremental | Strategy::Global => Err(no_map(problem)),
    }
}

/// The refined maps of all components, the largest first; empty for the other strategies, or when no three
/// views share five landmarks.
fn components(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction>, Error> {
    let SolveOptions { refine, seed, .. } = options;
    match effective(problem, options.strategy) {
        Strategy::Incremental => incremental::grow(problem, refine, *seed, progress),
        Strategy::Global => {
            let starts = global::starts(problem, *seed, progress)?;
            incremental::finish_all(problem, refine, starts, progress)
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
    let SolveOptions { refine, seed, .. } = options;
    let grown = match effective(problem, options.strategy) {
        Strategy::Incremental => incremental::first(problem, refine, *seed, progress)?,
        Strategy::Global => global::starts(problem, *seed, progress)?.into_iter().next(),
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
            let found = hypotheses::search(problem, &options.search, *seed, progress)?;
            let maps = found.maps.into_iter().take(2);
            Ok(maps.map(|hypothesis| hypothesis.map).collect())
        }
        Strategy::Incremental | Strategy::Global => Err(no_map(problem)),
    }
}

/// The error when growth or the global method finds no map.
fn no_map(problem: &Problem) -> Error {
    match hypotheses::too_few(problem, MIN_SHARED) {
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
    main.components = maps.collect();
    let others = &main.components;
    main.undetermined.retain(|undetermined| {
        others.iter().all(|other| match undetermined.subject {
            Subject::View(view) => other.map.poses[view].is_none(),
            Subject::Landmark(landmark) => other.map.landmarks[landmark].is_none(),
        })
    });
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
