// SPDX-License-Identifier: MIT OR Apache-2.0
//! Growth view by view among outliers: where sight is limited, no triple of views covers much of the whole, and a map
//! that is not refined on the way drifts.
//!
//! The growth is that of the incremental strategy. Only the estimates differ: a seed comes from random samples, views
//! and landmarks are placed where most of their bearings agree, and the map is refined with Cauchy's loss, which outliers
//! hardly move.

use super::super::incremental::from_seed;
use super::super::incremental::join::merged;
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::search::triples;
use super::super::stages::StageOptions;
use super::consensus::{
    Consensus, OUTLIER, cauchy_consensus, cost, inliers, with_cauchy, without_finish,
};
use super::consensus_places::ConsensusPlaces;
use super::reassign::reestimate_each;
use super::regrow::regrow;
use super::sampling::{Common, SAMPLE, Seed};
use crate::error::Error;
use crate::problem::Problem;
use alloc::vec;
use alloc::vec::Vec;
use rand_chacha::ChaCha8Rng;

/// The fixed points of all components, the largest first; none where no triple of views has a seed.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn grow(
    problem: &Problem,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Consensus>, Error> {
    let seeds = seeds(problem, options, random, progress)?;
    let mut free = vec![true; problem.views()];
    let mut found: Vec<Consensus> = Vec::new();
    while let Some(next) = component(problem, options, &seeds, &free, random, progress)? {
        // A component without a view would be found again and again.
        let left = free.iter().filter(|free| **free).count();
        for (free, pose) in free.iter_mut().zip(&next.map.poses) {
            *free &= pose.is_none();
        }
        if free.iter().filter(|free| **free).count() == left {
            break;
        }
        found.push(next);
    }
    join_all(problem, options, found, progress)
}

/// Seeds from random samples of many triples of views, those that most landmarks support first.
fn seeds(
    problem: &Problem,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Seed>, Error> {
    let SolveOptions { seed, stages, .. } = options;
    let robust = &stages.robust;
    let per_view = robust.triples_per_view.saturating_mul(problem.views());
    let count = per_view.max(robust.all_triples).min(robust.most_triples);
    // One more than a sample, for redundancy, unless no three views share so many.
    let mut drawn = triples::draw(problem, SAMPLE + 1, count, *seed, &stages.draw);
    drawn.extend(triples::draw(problem, SAMPLE, count, *seed, &stages.draw));
    drawn.sort_unstable();
    drawn.dedup();
    let total = drawn.len();
    let mut found = Vec::new();
    for (done, views) in drawn.into_iter().enumerate() {
        if !report_progress(progress, "search", done, total) {
            return Err(Error::Interrupted);
        }
        found.extend(Common::new(problem, views).best_seed(robust, random));
    }
    found.sort_by(|a, b| b.support.total_cmp(&a.support));
    Ok(found)
}

/// The best fixed point of views that are free: the lowest that some seeds lead to, after parts of them have been grown
/// again.
fn component(
    problem: &Problem,
    options: &SolveOptions,
    seeds: &[Seed],
    free: &[bool],
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Consensus>, Error> {
    // Only the bearings of these views count for a component.
    let own: Vec<bool> = problem.sightings().iter().map(|s| free[s.view]).collect();
    let own = &problem.subset(&own);
    let mut found = from_seeds(own, options, seeds, free, random, progress)?;
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    found.truncate(options.stages.regrowth.maps);
    let mut best: Option<Consensus> = None;
    for map in found {
        let map = map.finished(own, options.stages.robust.finished_iterations, options)?;
        let map = regrow(own, map, free, seeds, options, random, progress)?;
        if best.as_ref().is_none_or(|best| map.is_below(best)) {
            best = Some(map);
        }
    }
    Ok(best.map(|best| of_whole(problem, best)))
}

/// The fixed points that seeds lead to, each once, not yet refined to the end. With many views, where each takes long,
/// two seeds that lead to the same are enough.
fn from_seeds(
    problem: &Problem,
    options: &SolveOptions,
    seeds: &[Seed],
    free: &[bool],
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Consensus>, Error> {
    let StageOptions { robust, sight, .. } = &options.stages;
    let (soft, compared) = (with_cauchy(options), &without_finish(options));
    let mut found: Vec<Consensus> = Vec::new();
    // No two seeds share a view.
    let mut used = vec![false; problem.views()];
    for _ in 0..robust.grown {
        let fresh = |seed: &&Seed| seed.views.iter().all(|&view| free[view] && !used[view]);
        let Some(seed) = seeds.iter().find(fresh) else {
            break;
        };
        for view in seed.views {
            used[view] = true;
        }
        let estimator = || ConsensusPlaces::new(problem, &soft, options.seed);
        for map in from_seed(
            problem,
            &soft,
            seed.starts(problem),
            estimator,
            free,
            progress,
        )? {
            let found_here = cauchy_consensus(problem, map, f64::INFINITY, compared)?;
            let Some(consensus) = found_here else {
                continue;
            };
            let consensus = reestimate_each(problem, consensus, compared, random, progress)?;
            let known = |other: &Consensus| other.agrees(&consensus, robust.confirming_percent);
            if !found.iter().any(known) {
                found.push(consensus);
            } else if problem.views() > sight.many_views {
                return Ok(found);
            }
        }
    }
    Ok(found)
}

/// A fixed point of a part of the sightings as one of all: those of the other views are not among its inliers.
fn of_whole(problem: &Problem, found: Consensus) -> Consensus {
    Consensus {
        inliers: inliers(problem, &found.map, OUTLIER),
        cost: cost(problem, &found.map, OUTLIER),
        ..found
    }
}

/// Joins maps that share landmarks, as long as the joined map explains at least what the two explain apart.
fn join_all(
    problem: &Problem,
    options: &SolveOptions,
    mut found: Vec<Consensus>,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Consensus>, Error> {
    let size = |found: &Consensus| found.map.poses.iter().flatten().count();
    found.sort_by_key(|found| core::cmp::Reverse(size(found)));
    let (mut a, mut b) = (0, 1);
    let total = found.len();
    while a + 1 < found.len() {
        if !report_progress(progress, "join", total - found.len(), total) {
            return Err(Error::Interrupted);
        }
        if b == found.len() {
            (a, b) = (a + 1, a + 2);
        } else if let Some(joined) = joined(problem, options, [&found[a], &found[b]])? {
            found[a] = joined;
            found.remove(b);
            (a, b) = (0, 1);
        } else {
            b += 1;
        }
    }
    found.sort_by_key(|found| core::cmp::Reverse(size(found)));
    Ok(found)
}

/// Two maps as one; `None` when nothing ties them, or they explain more apart.
fn joined(
    problem: &Problem,
    options: &SolveOptions,
    [first, second]: [&Consensus; 2],
) -> Result<Option<Consensus>, Error> {
    let StageOptions {
        incremental,
        robust,
        ..
    } = &options.stages;
    let both = first.inliers.iter().zip(&second.inliers);
    let kept: Vec<bool> = both.map(|(a, b)| *a || *b).collect();
    let outlier = OUTLIER * OUTLIER / 2.0;
    let apart = first.cost + second.cost - outlier * problem.sightings().len() as f64;
    let inliers = problem.subset(&kept);
    for start in merged(&inliers, incremental, &first.map, &second.map) {
        let joined = cauchy_consensus(problem, start, f64::INFINITY, options)?;
        if let Some(joined) = joined
            && joined.cost < apart + robust.rival_cost
        {
            return Ok(Some(joined));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lm::Termination;
    use crate::simulate::{Arena, Layout, Outliers, simulate};
    use rand::SeedableRng;

    /// A component is the lowest of what seeds lead to, refined to the end, and counts all sightings, those of views that
    /// are not free as outliers.
    #[test]
    fn a_component_is_the_lowest_that_seeds_lead_to() {
        let arena = Arena {
            sight: 2.0,
            ..Arena::default()
        };
        let sigma = 0.5_f64.to_radians();
        let mut options = SolveOptions::default();
        options.stages.regrowth.work = 0;
        let mut later = 0;
        for seed in 0..12 {
            let scene = simulate(Layout::Trajectory, 12, 30, sigma, seed, arena).unwrap();
            let (scene, _) = scene.contaminate(Outliers::Mixture, 0.1, seed);
            let problem = Problem::dense(12, 30, &scene.bearings, sigma).unwrap();
            let random = || ChaCha8Rng::seed_from_u64(1);
            let seeds = seeds(&problem, &options, &mut random(), &mut None).unwrap();
            let free: Vec<bool> = (0..12).map(|view| view < 10 || seed % 2 == 0).collect();
            let own: Vec<bool> = problem.sightings().iter().map(|s| free[s.view]).collect();
            let own = problem.subset(&own);
            let found = from_seeds(&own, &options, &seeds, &free, &mut random(), &mut None);
            let costs: Vec<f64> = found.unwrap().iter().map(|found| found.cost).collect();
            let best = component(&problem, &options, &seeds, &free, &mut random(), &mut None);
            let Some(best) = best.unwrap() else {
                assert!(costs.is_empty(), "{seed}");
                continue;
            };
            let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
            later += usize::from(costs[0] > least * 1.001);
            assert_ne!(best.report.termination, Termination::MaxIterations);
            assert!(
                cost(&own, &best.map, OUTLIER) < least * (1.0 + 1e-9),
                "{seed}"
            );
            assert_eq!(best.cost, cost(&problem, &best.map, OUTLIER));
            assert_eq!(best.inliers.len(), problem.sightings().len());
            let pairs = problem.sightings().iter().zip(&best.inliers);
            assert!(pairs.into_iter().all(|(s, inlier)| free[s.view] || !inlier));
        }
        assert!(later > 0);
    }
}
