// SPDX-License-Identifier: MIT OR Apache-2.0
//! The map that explains most of the bearings, and its inliers.

use super::super::attempt::recoverable;
use super::super::infinity::{InfinityOptions, drop_landmarks_at_infinity};
use super::super::judge::{assess, refuse_chance, refuse_free};
use super::super::options::{Progress, SearchOptions, SolveOptions, Strategy, report_progress};
use super::super::result::Reconstruction;
use super::super::search::{hypotheses, triples};
use super::super::strategy;
use super::candidate::Candidate;
use super::consensus::{
    Consensus, OUTLIER, cost, fixed_point, inliers, to_consensus, with_squares, without_finish,
};
use super::exchange::exchange;
use super::expand::expand;
use super::growth::grow;
use super::identities::{Identified, exchange_identified, identify, of_subset};
use super::reassign::{reassign, reestimate_each};
use super::sampling::{Common, SAMPLE, Seed};
use super::toggle::toggle;
use crate::error::{Degeneracy, Error};
use crate::lm::Loss;
use crate::problem::{Map, Problem, Subject, Undetermined, Why};
use alloc::vec;
use alloc::vec::Vec;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Largest standard deviation \[rad\] with which outliers can be identified: three sigma to both sides cover a
/// third of the circle, so every third random bearing would be an inlier. Not an option: a bound of the method.
const COARSEST: f64 = 0.35;

/// The map that explains most of the bearings, and its inliers.
///
/// # Errors
/// As [`solve`], and [`Error::SigmaTooLarge`] for a standard deviation above [`COARSEST`].
pub fn solve_robust(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    check_sigmas(problem)?;
    let options = &with_squares(options);
    let stages = &options.stages;
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    if strategy::effective(problem, options) == Strategy::Incremental {
        let found = grow(problem, options, &mut random, progress)?;
        if !found.is_empty() {
            return with_components(problem, found, options, &mut random, progress);
        }
    }
    let best = lowest(problem, options, &mut random, progress)?;
    let identified = identify(problem, &best.map, options)?;
    let maps = if stages.identities.are_exchanged(problem, &best, &identified) {
        improve_identified(problem, identified, options, &mut random, progress)?
    } else {
        improve_and_confirm(problem, best, options, &mut random, progress)?
    };
    let [best, rivals @ ..] = &maps[..] else {
        return Err(NOTHING);
    };
    let mut found = reconstruction(problem, best, &stages.infinity);
    refuse_free(&problem.subset(&best.inliers), &found)?;
    refuse_chance(&found, &stages.judge)?;
    found.alternatives = rivals
        .iter()
        .map(|rival| reconstruction(problem, rival, &stages.infinity))
        .collect();
    found.explained = Some(identify(problem, &best.map, options)?.explained);
    Ok(found)
}

/// The first of some components, improved, with the others.
fn with_components(
    problem: &Problem,
    mut found: Vec<Consensus>,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let stages = &options.stages;
    let mut first = toggle(problem, found.remove(0), options, progress)?;
    if problem.views() <= stages.robust.improved_views {
        first = improve(problem, first, options, random, progress)?;
    }
    let first = first.finished(problem, options.refine.max_iterations, options)?;
    let mut main = reconstruction(problem, &first, &stages.infinity);
    main.explained = Some(identify(problem, &first.map, options)?.explained);
    refuse_free(&problem.subset(&first.inliers), &main)?;
    refuse_chance(&main, &stages.judge)?;
    let others = found.iter();
    let others = others.map(|found| reconstruction(problem, found, &stages.infinity));
    // Without redundancy nothing checks a component.
    let others = others.filter(|other| other.freedom > 0);
    let maps = core::iter::once(main).chain(others).collect();
    strategy::with_components(problem, maps).ok_or(NOTHING)
}

/// No seed has led to a map.
const NOTHING: Error = Error::Degenerate {
    kind: Degeneracy::NoSupport,
    value: 0.0,
    bound: 1.0,
};

/// The first sighting in the order of the input whose sigma is too large.
pub fn check_sigmas(problem: &Problem) -> Result<(), Error> {
    let coarse = problem
        .sightings()
        .iter()
        .zip(problem.input_order())
        .filter(|(s, _)| s.weight * COARSEST < 1.0)
        .min_by_key(|(_, index)| **index);
    match coarse {
        None => Ok(()),
        Some((s, &index)) => Err(Error::SigmaTooLarge {
            what: "sigma",
            index,
            value: s.weight.recip(),
            bound: COARSEST,
        }),
    }
}

/// The lowest minimum that samples lead to.
fn lowest(
    problem: &Problem,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let SolveOptions { seed, stages, .. } = options;
    let robust = &stages.robust;
    let drawn = triples::draw(problem, SAMPLE, robust.all_triples, *seed, &stages.draw);
    let commons: Vec<Common> = drawn
        .into_iter()
        .map(|views| Common::new(problem, views))
        .collect();
    if commons.is_empty() {
        return from_plain_hypotheses(problem, options, random, progress);
    }
    let mut found: Vec<Candidate> = Vec::new();
    let rough = &without_finish(options);
    let rounds = robust
        .rounds
        .min(robust.searched_views / problem.views())
        .max(1);
    for round in 0..rounds {
        if !report_progress(progress, "search", round, rounds) {
            return Err(Error::Interrupted);
        }
        let some = commons
            .iter()
            .cycle()
            .skip(round.wrapping_mul(robust.triples) % commons.len());
        let mut seeds: Vec<Seed> = some
            .take(robust.triples)
            .filter_map(|common| common.best_seed(robust, random))
            .collect();
        seeds.sort_by(|a, b| b.support.total_cmp(&a.support));
        for (done, seed) in seeds.iter().take(robust.grown).enumerate() {
            if !report_progress(progress, "grow", done, robust.grown) {
                return Err(Error::Interrupted);
            }
            for motion in seed.branches(problem) {
                let map = expand(problem, seed, motion, rough, random)?;
                let Some(consensus) = to_consensus(problem, map, f64::INFINITY, rough)? else {
                    continue;
                };
                let consensus = reestimate_each(problem, consensus, rough, random, progress)?;
                let identified = identify(problem, &consensus.map, rough)?;
                let candidate = Candidate {
                    consensus,
                    views: seed.views,
                    explained: identified.explained,
                };
                let confirmed = candidate.is_confirmed_by(&found, robust)
                    || stages
                        .identities
                        .are_exchanged(problem, &candidate.consensus, &identified);
                found.push(candidate);
                if confirmed {
                    return exchanged(problem, found, options);
                }
            }
        }
        let drawn = (round + 1) as f64 * robust.triples as f64 * robust.samples as f64;
        if best_of(found.iter().map(|one| &one.consensus))
            .is_ok_and(|best| drawn * good_samples(best) > robust.good_samples)
        {
            break;
        }
    }
    exchanged(problem, found, options)
}

/// The best of some rough minima: of those that explain the most bearings after assignment the lowest few, refined to
/// the end, with sightings exchanged.
fn exchanged(
    problem: &Problem,
    found: Vec<Candidate>,
    options: &SolveOptions,
) -> Result<Consensus, Error> {
    let SolveOptions { stages, .. } = options;
    let most = found.iter().map(|one| one.explained).max().unwrap_or(0);
    let close = |one: &Candidate| !stages.identities.tells(problem, one.explained, most);
    let close = found.into_iter().filter(close);
    let mut found: Vec<Consensus> = close.map(|one| one.consensus).collect();
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    found.dedup_by(|a, b| a.inliers == b.inliers);
    let robust = &stages.robust;
    found.truncate(robust.exchanged);
    let exchanged: Result<Vec<_>, Error> = found
        .into_iter()
        .map(|rough| {
            let finished = rough.finished(problem, robust.finished_iterations, options)?;
            exchange(problem, finished, options)
        })
        .collect();
    best_of(exchanged?.into_iter())
}

/// Expected fraction of samples without an outlier, given the inliers of a map: all 15 bearings must be inliers.
fn good_samples(best: &Consensus) -> f64 {
    let inliers = best.inliers.iter().filter(|inlier| **inlier).count();
    let share = inliers as f64 / best.inliers.len() as f64;
    (0..3 * SAMPLE).fold(1.0, |product, _| product * share)
}

/// The minimum that non-robust hypotheses lead to, for problems too small for samples.
fn from_plain_hypotheses(
    problem: &Problem,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let plain = SolveOptions {
        search: SearchOptions::default(),
        ..*options
    };
    let hypotheses = hypotheses::search(problem, &plain, progress)?;
    let mut found = Vec::new();
    for hypothesis in hypotheses
        .maps
        .into_iter()
        .take(options.stages.robust.plain_hypotheses)
    {
        if let Some(consensus) = to_consensus(problem, hypothesis.map, f64::INFINITY, options)? {
            found.push(reestimate_each(
                problem, consensus, options, random, progress,
            )?);
        }
    }
    best_of(found.into_iter())
}

/// The one with the least cost.
fn best_of<S: core::borrow::Borrow<Consensus>>(found: impl Iterator<Item = S>) -> Result<S, Error> {
    found
        .min_by(|a, b| {
            let [a, b] = [a, b].map(|consensus| consensus.borrow().cost);
            a.total_cmp(&b)
        })
        .ok_or(NOTHING)
}

/// The best map and its rivals of the bearings whose identities are not exchanged: with so many others, some agree by
/// chance with any map, and one of lower cost may be made of them.
fn improve_identified(
    problem: &Problem,
    identified: Identified,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Consensus>, Error> {
    // The first map still lacks bearings that the next explains.
    let (own, _) = identified.own(problem);
    let identified = match to_consensus(&own, identified.map, f64::INFINITY, options)? {
        Some(start) => {
            let improved = improve(&own, start, options, random, progress)?;
            identify(problem, &improved.map, options)?
        }
        None => return Ok(Vec::new()),
    };
    let identified = exchange_identified(problem, identified, options)?;
    let (own, kept) = identified.own(problem);
    match to_consensus(&own, identified.map, f64::INFINITY, options)? {
        Some(start) => {
            let found = improve_and_confirm(&own, start, options, random, progress)?;
            let whole = |found| of_subset(problem, found, &kept);
            Ok(found.into_iter().map(whole).collect())
        }
        None => Ok(Vec::new()),
    }
}

/// The best map, improved, and its rivals.
fn improve_and_confirm(
    problem: &Problem,
    best: Consensus,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Consensus>, Error> {
    let best = improve(problem, best, options, random, progress)?;
    let best = best.finished(problem, options.refine.max_iterations, options)?;
    confirm_by_plain_search(problem, best, options, progress)
}

/// Lowers the cost of the best map by single changes until none helps.
fn improve(
    problem: &Problem,
    mut best: Consensus,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let rounds = options.stages.robust.improve_rounds;
    for round in 0..rounds {
        if !report_progress(progress, "improve", round, rounds) {
            return Err(Error::Interrupted);
        }
        best = exchange(problem, best, options)?;
        let cost = best.cost;
        best = reestimate_each(problem, best, options, random, progress)?;
        best = reassign(problem, best, options, random, progress)?;
        if !(best.cost + options.stages.robust.improve_worth < cost) {
            break;
        }
    }
    Ok(best)
}

/// The best map and its rivals after a non-robust search over the inliers, which also finds the mirror branch of
/// three views, and makes robust and non-robust solves agree when there are no outliers.
fn confirm_by_plain_search(
    problem: &Problem,
    best: Consensus,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Consensus>, Error> {
    let plain = SolveOptions {
        robust: false,
        ..*options
    };
    let kept = problem.subset(&best.inliers);
    let mut all = Vec::new();
    // What the plain search cannot solve may still have been found.
    if let Ok(mut found) = recoverable(strategy::solve(&kept, &plain, progress))? {
        let rivals = core::mem::take(&mut found.alternatives);
        for found in core::iter::once(found).chain(rivals) {
            if inliers(problem, &found.map, OUTLIER) == best.inliers {
                all.push(Consensus::of(problem, found));
            } else {
                let inliers = best.inliers.clone();
                all.extend(fixed_point(
                    problem,
                    found.map,
                    inliers,
                    f64::INFINITY,
                    options,
                )?);
            }
        }
    }
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    // Of equals the map of the non-robust search comes first.
    let first = all.first().is_none_or(|plain| best.is_below(plain));
    all.insert(if first { 0 } else { all.len() }, best);
    let stages = &options.stages;
    let mut distinct: Vec<Consensus> = Vec::new();
    for consensus in all {
        let limit = distinct
            .first()
            .map(|best| best.cost + stages.robust.rival_cost);
        if limit.is_none_or(|limit| consensus.cost < limit)
            && distinct
                .iter()
                .all(|other| !other.is_same(&consensus, problem, &stages.judge))
        {
            distinct.push(consensus);
        }
    }
    if let [_, rivals @ ..] = &mut distinct[..] {
        rivals.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    }
    Ok(distinct)
}

/// What is known of a map: made from its inliers, with the residuals of all.
pub fn reconstruction(
    problem: &Problem,
    best: &Consensus,
    options: &InfinityOptions,
) -> Reconstruction {
    let kept = problem.subset(&best.inliers);
    let mut found = Reconstruction::new(&kept, &best.map, best.report.clone());
    let map: Map = found.map.clone();
    drop_landmarks_at_infinity(&kept, &mut found, options);
    assess(&kept, &mut found);
    // Of the map as it is reported: the change of frame may round.
    found.cost = cost(problem, &map, OUTLIER);
    found.loss = Loss::Truncated(OUTLIER);
    found.residuals = vec![None; problem.sightings().len()];
    found.inliers = vec![false; problem.sightings().len()];
    let residuals = map.residuals(problem).zip(&best.inliers);
    for (&place, (residual, inlier)) in problem.input_order().iter().zip(residuals) {
        found.residuals[place] = residual;
        found.inliers[place] = *inlier;
    }
    for Undetermined { subject, why } in &mut found.undetermined {
        let all = match *subject {
            Subject::View(view) => problem.of_view(view).len(),
            Subject::Landmark(landmark) => problem.of_landmark(landmark).len(),
        };
        if let Why::TooFewSightings { got, needed } = *why
            && all >= needed
        {
            *why = Why::TooFewInliers { got, needed };
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of the bearings right, one of 2 to the 15th samples of five landmarks in three views is free of outliers.
    #[test]
    fn good_samples_have_no_outlier() {
        let half = Consensus::with_inliers(&[true, false, true, false], 1.0);
        assert_eq!(good_samples(&half), 0.5_f64.powi(15));
        assert_eq!(good_samples(&Consensus::with_inliers(&[true; 3], 1.0)), 1.0);
    }

    #[test]
    fn the_best_costs_least() {
        let costs = [3.0, 1.0, 2.0].map(|cost| Consensus::with_inliers(&[true], cost));
        assert_eq!(best_of(costs.into_iter()).unwrap().cost, 1.0);
        assert_eq!(
            best_of(core::iter::empty::<Consensus>()).err(),
            Some(NOTHING)
        );
    }

    /// The first bearing in the order of the input that is too coarse is named.
    #[test]
    fn coarse_sigmas_are_refused() {
        let sighting = |view, sigma| crate::problem::Sighting {
            view,
            landmark: 0,
            bearing: 0.1,
            sigma,
        };
        let check = |sigmas: [f64; 3]| {
            let sightings = [
                sighting(2, sigmas[0]),
                sighting(1, sigmas[1]),
                sighting(0, sigmas[2]),
            ];
            check_sigmas(&Problem::new(3, 1, &sightings).unwrap())
        };
        assert_eq!(check([0.1, 0.34, 0.2]), Ok(()));
        for (sigmas, index) in [([0.1, 0.36, 0.5], 1), ([0.4, 0.1, 0.5], 0)] {
            let Err(Error::SigmaTooLarge {
                index: found,
                value,
                ..
            }) = check(sigmas)
            else {
                panic!("{sigmas:?}");
            };
            assert_eq!(found, index);
            assert!((value / sigmas[index] - 1.0).abs() < 1e-12);
        }
    }
}
