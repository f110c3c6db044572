// SPDX-License-Identifier: MIT OR Apache-2.0
//! The search from bearings alone without outliers: hypotheses, refinement, choice.

use super::super::infinity::take_out_unbounded;
use super::super::judge::{assess, choose, judged};
use super::super::options::{Progress, SolveOptions, Strategy};
use super::super::result::Reconstruction;
use super::super::strategy;
use super::first_three;
use super::hypotheses::{self, Hypotheses};
use super::minima::Minima;
use crate::error::Error;
use crate::problem::Problem;

/// The map of the lowest minimum, judged.
///
/// # Errors
/// As [`solve`](super::super::solve).
pub fn solve(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    judged(problem, lowest(problem, options, progress)?)
}

/// The map of the lowest minimum, not yet tested for free directions.
///
/// # Errors
/// As [`solve`].
pub fn lowest(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut maps = strategy::maps(problem, options, progress)?;
    for map in &mut maps {
        take_out_unbounded(problem, map);
    }
    for map in maps.iter_mut().skip(1) {
        assess(problem, map);
    }
    if let Some(found) = strategy::with_components(problem, maps) {
        return Ok(found);
    }
    let mut hypotheses = first_maps(problem, options, progress)?;
    let maps = core::mem::take(&mut hypotheses.maps).into_iter();
    let found = match options.strategy {
        Strategy::FirstViews(_) | Strategy::Incremental | Strategy::Global => {
            let mut minima = Minima::new(problem, &options.refine, progress);
            minima.try_out(maps.take(1), false)?;
            minima.finish(true)?;
            minima.into_found()?
        }
        // Three views, or four landmarks: several minima may be exact.
        Strategy::Search(search) if !hypotheses.unique => {
            let mut minima = Minima::new(problem, &options.refine, progress);
            minima.try_out(maps, false)?;
            if !minima.has_exact() && search.swept > 0 {
                let maps = hypotheses.widened(problem, search.swept, minima.progress)?;
                minima.try_out(maps.into_iter().take(2 * search.candidates), false)?;
            }
            minima.finish(hypotheses.four)?;
            minima.move_landmarks()?;
            minima.into_found()?
        }
        Strategy::Search(search) => {
            let mut minima = Minima::new(problem, &options.refine, progress);
            let candidates = maps.take(search.candidates);
            let beyond_doubt = minima.try_out(candidates, true)? || minima.finish(false)?;
            if !beyond_doubt && search.swept > 0 {
                let maps = hypotheses.widened(problem, search.swept, minima.progress)?;
                let candidates = maps.into_iter().take(2 * search.candidates);
                if !minima.try_out(candidates, true)? {
                    minima.finish(false)?;
                }
            }
            minima.move_landmarks()?;
            minima.into_found()?
        }
    };
    let mut best = choose(problem, found)?;
    take_out_unbounded(problem, &mut best);
    for rival in &mut best.alternatives {
        take_out_unbounded(problem, rival);
    }
    Ok(best)
}

/// First maps, by the strategy of the options.
pub fn first_maps(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Hypotheses, Error> {
    match options.strategy {
        Strategy::FirstViews(method) => Ok(Hypotheses::of(first_three::follow(problem, method)?)),
        Strategy::Search(search) => hypotheses::search(problem, search, options.seed, progress),
        // Their own paths have found no triple to start from.
        Strategy::Incremental | Strategy::Global => Err(strategy::no_map(problem)),
    }
}
