// SPDX-License-Identifier: MIT OR Apache-2.0
//! Further searches where the first map fits worse than the stated standard deviations allow, or leaves something out.

use super::attempt::{attempt, recoverable};
use super::choice::{SAME_COST, better, choose};
use super::incremental::complete::place_all;
use super::incremental::heading_sweep::place_by_headings;
use super::incremental::regrow::regrow;
use super::infinity::with_landmarks_at_infinity;
use super::judge::{JudgeOptions, is_incomplete, is_too_costly};
use super::options::{Progress, SolveOptions, Strategy};
use super::result::Reconstruction;
use super::robust::solve::{check_sigmas, solve_robust};
use super::search::plain::moved;
use super::sight::filled;
use super::stages::StageOptions;
use super::strategy::{assembled, effective, finished, lowest};
use crate::error::Error;
use crate::lm::Loss;
use crate::problem::{Map, Problem};
use alloc::vec;
use alloc::vec::Vec;

/// The map from bearings alone, without outliers, with uncertainty and tested for free directions.
///
/// Where it fits worse than the stated standard deviations allow, or leaves something out that has sightings enough, the
/// search goes on: with changes of this map, then grown with a loss that few bearings bend, with the other strategy, with
/// another seed, and as if some bearings were wrong, in this order until one fits.
///
/// # Errors
/// As [`solve`](super::solve).
pub fn solve(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let best = lowest(problem, options, progress)?;
    let best = persist(problem, options, best, progress)?;
    let best = finished(problem, options, best, progress)?;
    if !is_doubtful(problem, options, &best) {
        return Ok(best);
    }
    let JudgeOptions {
        doubtful_tried,
        doubtful_worth,
        ..
    } = options.stages.judge;
    let mut thorough = *options;
    thorough.stages.moves.tried = doubtful_tried;
    thorough.stages.moves.partial_worth = doubtful_worth;
    let found = moved(problem, best.clone(), &thorough, progress)?;
    if !(found.cost < best.cost * SAME_COST) {
        return Ok(best);
    }
    let found = recoverable(finished(problem, options, found, progress))?;
    Ok(found.unwrap_or(best))
}

/// Whether a map from partial sight is so weakly determined that others may be as low.
fn is_doubtful(problem: &Problem, options: &SolveOptions, best: &Reconstruction) -> bool {
    let StageOptions { judge, moves, .. } = &options.stages;
    best.uncertainty > judge.doubtful
        && best.components.is_empty()
        && problem.views() <= judge.persistent_views
        && filled(problem) < moves.partial
        && options.refine.loss == Loss::Squared
        && !is_named(options.strategy)
}

/// Whether the caller has chosen one way to a map.
fn is_named(strategy: Strategy) -> bool {
    matches!(strategy, Strategy::FirstViews(_) | Strategy::Global)
}

/// The best of a map and of what further searches find, unless it is as good as the standard deviations predict.
fn persist(
    problem: &Problem,
    options: &SolveOptions,
    best: Reconstruction,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let judge = &options.stages.judge;
    let few = problem.views() <= judge.persistent_views;
    let is_lacking = |found: &Reconstruction, deviations| {
        is_too_costly(problem, found, deviations) || (few && is_incomplete(found))
    };
    if is_named(options.strategy)
        || options.refine.loss != Loss::Squared
        || !is_lacking(&best, judge.costly_deviations)
    {
        return Ok(best);
    }
    let best = mended(problem, options, best, progress)?;
    let is_lacking = |found: &Reconstruction| is_lacking(found, judge.plausible_deviations);
    if !is_lacking(&best) {
        return Ok(best);
    }
    let mut found = vec![best];
    for further in further_searches(problem, options) {
        let searched = lowest(problem, &further, progress);
        let Ok(mut map) = recoverable(searched)? else {
            continue;
        };
        if further.refine.loss != options.refine.loss {
            let Some(refined) = with_loss(problem, map, options)? else {
                continue;
            };
            map = refined;
        }
        let enough = !is_lacking(&map);
        found.push(map);
        if enough {
            return chosen(problem, found, judge);
        }
    }
    if check_sigmas(problem).is_ok()
        && let Ok(robust) = recoverable(solve_robust(problem, options, progress))?
    {
        let mut start = robust.map;
        place_all(problem, &options.stages.incremental, &mut start);
        found.extend(refined(problem, start, options)?);
    }
    chosen(problem, found, judge)
}

/// The best of maps, of those that fit where any does: one that leaves something out fits, and one that takes it in all
/// the same may not.
fn chosen(
    problem: &Problem,
    mut found: Vec<Reconstruction>,
    judge: &JudgeOptions,
) -> Result<Reconstruction, Error> {
    let fits = |map: &Reconstruction| !is_too_costly(problem, map, judge.plausible_deviations);
    if found.iter().any(fits) {
        found.retain(fits);
    }
    choose(problem, found, judge)
}

/// The best map after changes: more places of its landmarks and views than a search tries, where there are few views
/// parts of it grown again while it is too costly or leaves something out, and what it still leaves out placed by a sweep
/// over headings.
fn mended(
    problem: &Problem,
    options: &SolveOptions,
    mut best: Reconstruction,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let judge = &options.stages.judge;
    let mut thorough = *options;
    thorough.stages.moves.tried = options.stages.moves.persistent_tried;
    let before = best.clone();
    let mut components = core::mem::take(&mut best.components);
    best = moved(problem, best, &thorough, progress)?;
    if problem.views() <= judge.persistent_views {
        let apart = |found: &Reconstruction| {
            let mut components = components.iter();
            components.any(|other| !found.map.has_views_of(&other.map))
        };
        let enough = |found: &Reconstruction| {
            !(is_too_costly(problem, found, judge.plausible_deviations)
                || is_incomplete(found)
                || apart(found))
        };
        best = regrow(problem, best, enough, options, progress)?;
        if components.is_empty() && is_incomplete(&best) {
            best = place_by_headings(problem, best, options, progress)?;
        }
    }
    components.retain(|other| best.map.is_apart_from(&other.map));
    best.attach(components);
    Ok(better(problem, [before, best], judge))
}

/// A map refined; `None` when it cannot be.
fn refined(
    problem: &Problem,
    mut map: Map,
    options: &SolveOptions,
) -> Result<Option<Reconstruction>, Error> {
    let report = attempt(problem, &mut map, &options.refine, None)?;
    Ok(report.map(|report| Reconstruction::new(problem, &map, report)))
}

/// A map and its components, grown with another loss, refined with that of the options; `None` when one cannot be.
fn with_loss(
    problem: &Problem,
    mut grown: Reconstruction,
    options: &SolveOptions,
) -> Result<Option<Reconstruction>, Error> {
    let far = options.stages.incremental.far_sizes;
    let components = core::mem::take(&mut grown.components);
    let mut maps = Vec::new();
    for map in core::iter::once(grown).chain(components) {
        let start = with_landmarks_at_infinity(problem, &map, far);
        let Some(refined) = refined(problem, start, options)? else {
            return Ok(None);
        };
        maps.push(refined);
    }
    Ok(assembled(problem, options, maps))
}

/// Searches that find other minima than the one by the options.
fn further_searches(problem: &Problem, options: &SolveOptions) -> [SolveOptions; 3] {
    let mut robust = SolveOptions {
        strategy: Strategy::Incremental,
        ..*options
    };
    robust.refine.loss = Loss::Cauchy(Loss::<f64>::CAUCHY);
    let mut other = *options;
    other.seed = options.seed.wrapping_add(1);
    let incremental = effective(problem, options) == Strategy::Incremental;
    if incremental && problem.views() <= options.stages.sight.many_views {
        other.strategy = Strategy::Search;
        // Whatever the views see.
        other.stages.sight.filled = 0.0;
    } else {
        other.strategy = Strategy::Incremental;
    }
    let seeded = SolveOptions {
        seed: options.seed.wrapping_add(2),
        ..*options
    };
    [robust, other, seeded]
}
