// SPDX-License-Identifier: MIT OR Apache-2.0
//! The search from bearings alone without outliers: hypotheses, refinement, choice.

use super::super::choice::choose;
use super::super::infinity::drop_landmarks_at_infinity;
use super::super::options::{Progress, SolveOptions};
use super::super::result::Reconstruction;
use super::super::stages::StageOptions;
use super::hypotheses;
use super::minima::Minima;
use crate::error::Error;
use crate::problem::{Map, Problem};

/// The lowest minimum that the hypotheses of a search lead to, not yet tested for free directions.
///
/// # Errors
/// As [`solve`](super::super::solve).
pub fn lowest(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut hypotheses = hypotheses::search(problem, options, progress)?;
    let search = &options.search;
    let maps = core::mem::take(&mut hypotheses.maps).into_iter();
    let mut minima = Minima::new(problem, options, progress);
    if hypotheses.unique {
        let candidates = maps.take(search.candidates);
        let beyond_doubt = minima.try_out(candidates, true)? || minima.finish(false)?;
        if !beyond_doubt && search.swept > 0 {
            let maps = hypotheses.widened(problem, options, minima.progress)?;
            let candidates = maps.into_iter().take(2 * search.candidates);
            if !minima.try_out(candidates, true)? {
                minima.finish(false)?;
            }
        }
    } else {
        // Three views, or four landmarks: several minima may be exact.
        minima.try_out(maps, false)?;
        if !minima.has_exact() && search.swept > 0 {
            let maps = hypotheses.widened(problem, options, minima.progress)?;
            let most = if hypotheses.four {
                maps.len()
            } else {
                2 * search.candidates
            };
            minima.try_out(maps.into_iter().take(most), false)?;
        }
        minima.finish(hypotheses.four)?;
        if hypotheses.four {
            if !minima.has_exact() {
                minima.follow_wall()?;
            }
            minima.add_twin()?;
        }
    }
    minima.try_moves(&options.stages.moves)?;
    best_of(problem, minima, &options.stages)
}

/// The minimum that one map leads to, not yet tested for free directions.
///
/// # Errors
/// As [`solve`](super::super::solve).
pub fn from_map(
    problem: &Problem,
    map: Map,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut minima = Minima::new(problem, options, progress);
    let start = hypotheses::Hypothesis { map, triple: 0 };
    minima.try_out([start].into_iter(), false)?;
    minima.finish(true)?;
    best_of(problem, minima, &options.stages)
}

/// The best minimum that moves of single landmarks and views lead to from this one.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn moved(
    problem: &Problem,
    found: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut minima = Minima::new(problem, options, progress);
    minima.add(found);
    minima.try_moves(&options.stages.moves)?;
    best_of(problem, minima, &options.stages)
}

/// The best of the minima with its rivals.
fn best_of(
    problem: &Problem,
    minima: Minima<'_, '_>,
    stages: &StageOptions,
) -> Result<Reconstruction, Error> {
    let mut best = choose(problem, minima.into_found()?, &stages.judge)?;
    drop_landmarks_at_infinity(problem, &mut best, &stages.infinity);
    for rival in &mut best.alternatives {
        drop_landmarks_at_infinity(problem, rival, &stages.infinity);
    }
    Ok(best)
}
