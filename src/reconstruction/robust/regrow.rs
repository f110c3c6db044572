// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parts of a map among outliers that are removed and grown again, as by least squares.

use super::super::attempt::attempt;
use super::super::incremental::growth::IncrementalGrowth;
use super::super::incremental::regrow::without_part;
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::stages::StageOptions;
use super::consensus::{
    Consensus, OUTLIER, cost, descend, fixed_point, inliers, with_cauchy, without_finish,
};
use super::consensus_places::ConsensusPlaces;
use super::options::RegrowthOptions;
use super::reassign::{place_each, reestimate_each};
use super::rejoin::grown_apart;
use super::sampling::Seed;
use crate::error::Error;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Removes random parts of a map and grows them again, until none of so many tries in a row has lowered the cost. Only
/// views that are `allowed` may be added. A part grows from the rest, or from one of the `seeds` within it.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn regrow(
    problem: &Problem,
    mut best: Consensus,
    allowed: &[bool],
    seeds: &[Seed],
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let soft = with_cauchy(options);
    let compared = &without_finish(options);
    let StageOptions {
        regrowth, robust, ..
    } = &options.stages;
    let tries = tries(problem.views(), regrowth);
    let (mut failed, mut left) = (0, tries.saturating_mul(regrowth.successes));
    while failed < tries && left > 0 {
        if !report_progress(progress, "regrow", failed, tries) {
            return Err(Error::Interrupted);
        }
        failed += 1;
        left -= 1;
        let part = without_random_part(problem, &best, regrowth.part, random);
        let apart = if random.random_range(0..100) < regrowth.apart_percent {
            grown_apart(problem, &part, seeds, allowed, options, random, progress)?
        } else {
            None
        };
        let grown = match apart {
            Some(grown) => grown,
            None => {
                let estimator = ConsensusPlaces::new(problem, &soft, random.random());
                let growth = IncrementalGrowth::new(problem, &soft, estimator, allowed, part)?;
                let Some(mut growth) = growth else {
                    continue;
                };
                growth.grow(usize::MAX, progress)?;
                growth.map
            }
        };
        let map = rough(problem, grown, options, random)?;
        let slack = regrowth.worse_outliers * OUTLIER * OUTLIER / 2.0;
        if cost(problem, &map, OUTLIER) > best.cost + slack {
            continue;
        }
        let kept = inliers(problem, &map, OUTLIER);
        let Some(found) = fixed_point(problem, map, kept, f64::INFINITY, compared)? else {
            continue;
        };
        let found = reestimate_each(problem, found, compared, random, progress)?;
        let limit = best.limit(robust);
        if found.cost > limit {
            continue;
        }
        let found = fixed_point(problem, found.map, found.inliers, limit, options)?;
        if let Some(found) = found.filter(|found| found.is_below(&best)) {
            best = found;
            failed = 0;
        }
    }
    Ok(best)
}

/// Tries in a row without success that are the last: a small map has few parts, and many views take long.
fn tries(views: usize, options: &RegrowthOptions) -> usize {
    let views = views.max(1);
    let parts = views.saturating_mul(most_removed(views, options.part));
    let affordable = options.work / views.saturating_mul(views);
    affordable.min(parts.saturating_mul(options.tries_per_part))
}

/// Most views that are removed of so many: three are left to grow from.
fn most_removed(views: usize, part: usize) -> usize {
    views.saturating_sub(3).min(part).max(1)
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
    let left = found.map.poses.iter().flatten().count();
    let views = random.random_range(1..=most_removed(left, most));
    without_part(problem, &found.map, center, views)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_map_is_tried_no_more_often_than_its_parts_are_worth() {
        let options = RegrowthOptions::default();
        let none = RegrowthOptions { work: 0, ..options };
        // Of three views each may be removed, of six up to three around each.
        assert_eq!([3, 6].map(|views| tries(views, &options)), [9, 54]);
        // From 13 views on the work decides.
        assert_eq!(
            [13, 20, 245].map(|views| tries(views, &options)),
            [355, 150, 0]
        );
        assert_eq!([0, 3, 20].map(|views| tries(views, &none)), [0; 3]);
    }
}
