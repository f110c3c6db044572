// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parts of a map among outliers that are removed and grown again, as by least squares.

use super::super::attempt::attempt;
use super::super::incremental::growth::IncrementalGrowth;
use super::super::incremental::regrow::without_part;
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::stages::StageOptions;
use super::consensus::{Consensus, OUTLIER, cost, descend, fixed_point, inliers, with_cauchy};
use super::consensus_places::ConsensusPlaces;
use super::reassign::{place_each, reestimate_each};
use crate::error::Error;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Removes random parts of a map and grows them again, until none of so many tries in a row has lowered the cost. Only
/// views that are `allowed` may be added.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn regrow(
    problem: &Problem,
    mut best: Consensus,
    allowed: &[bool],
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let soft = with_cauchy(options);
    let StageOptions { regrowth, .. } = &options.stages;
    let views = problem.views().max(1);
    let tries = regrowth.work / views.saturating_mul(views);
    let (mut failed, mut left) = (0, tries.saturating_mul(regrowth.successes));
    while failed < tries && left > 0 {
        if !report_progress(progress, "regrow", failed, tries) {
            return Err(Error::Interrupted);
        }
        failed += 1;
        left -= 1;
        let part = without_random_part(problem, &best, regrowth.part, random);
        let estimator = ConsensusPlaces::new(problem, &soft, random.random());
        let Some(mut growth) = IncrementalGrowth::new(problem, &soft, estimator, allowed, part)?
        else {
            continue;
        };
        growth.grow(usize::MAX, progress)?;
        let map = rough(problem, growth.map, options, random)?;
        let slack = regrowth.worse_outliers * OUTLIER * OUTLIER / 2.0;
        if cost(problem, &map, OUTLIER) > best.cost + slack {
            continue;
        }
        let kept = inliers(problem, &map, OUTLIER);
        let Some(found) = fixed_point(problem, map, kept, options)? else {
            continue;
        };
        let found = reestimate_each(problem, found, options, random, progress)?;
        if found.is_below(&best) {
            best = found;
            failed = 0;
        }
    }
    Ok(best)
}

/// A map near its fixed point, which shows whether it is worth more.
fn rough(
    problem: &Problem,
    mut map: Map,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
) -> Result<Map, Error> {
    let StageOptions {
        regrowth, robust, ..
    } = &options.stages;
    let refine = RefineOptions {
        max_iterations: options.refine.max_iterations.min(regrowth.iterations),
        ..with_cauchy(options).refine
    };
    attempt(problem, &mut map, &refine, None)?;
    for round in 0..regrowth.rounds {
        if round > 0 {
            place_each(problem, &mut map, robust, random);
        }
        let iterations = robust.narrowing_iterations;
        descend(problem, &mut map, OUTLIER, iterations, options)?;
    }
    Ok(map)
}

/// A map without up to `most` of its views around one that is drawn with the probability of its share of the outliers.
fn without_random_part(
    problem: &Problem,
    found: &Consensus,
    most: usize,
    random: &mut ChaCha8Rng,
) -> Map {
    let sightings = problem.sightings();
    let outliers = sightings.iter().zip(&found.inliers);
    let outliers: Vec<usize> = outliers
        .filter(|(_, inlier)| !**inlier)
        .map(|(s, _)| s.view)
        .collect();
    let center = if outliers.is_empty() {
        random.random_range(0..problem.views())
    } else {
        outliers[random.random_range(0..outliers.len())]
    };
    let left = found.map.poses.iter().flatten().count().saturating_sub(3);
    let views = random.random_range(1..=left.min(most).max(1));
    without_part(problem, &found.map, center, views)
}
