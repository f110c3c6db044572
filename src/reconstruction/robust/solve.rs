// SPDX-License-Identifier: MIT OR Apache-2.0
//! The map that explains most of the bearings, and which these are.

use super::super::infinity::take_out_unbounded;
use super::super::judge::{assess, refuse_free};
use super::super::options::{Progress, Search, SolveOptions, tell};
use super::super::result::Reconstruction;
use super::super::search::{hypotheses, triples};
use super::super::strategy;
use super::consensus::{Settled, fixed_point, settle};
use super::exchange::exchange;
use super::expand::expand;
use super::objective::{OUTLIER, inliers};
use super::reassign::{relocate, replace};
use super::sampling::{Common, SAMPLE, Seed};
use crate::error::{Degeneracy, Error};
use crate::kernels::Motion;
use crate::lm::{Loss, RefineOptions};
use crate::problem::{Map, Problem, Subject, Undetermined, Why};
use alloc::vec;
use alloc::vec::Vec;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Largest standard deviation with which outliers can be told \[rad\]: three of them to both sides are a
/// third of the circle, and every third random bearing is no outlier.
const COARSEST: f64 = 0.35;

/// Triples of views that samples are drawn from in a round, and samples of each: when three bearings in
/// ten are wrong, three samples in a hundred are good.
const TRIPLES: usize = 16;
const SAMPLES: usize = 40;

/// Seeds that are grown in a round, and most rounds: all of them take a second or two at 12 x 15, where
/// half of the bearings are wrong.
const GROWN: usize = 6;
const ROUNDS: usize = 24;

/// Most triples in all; rounds beyond them draw new samples of the same.
const ALL_TRIPLES: usize = 128;

/// Good samples that are wanted before the search ends without a confirmation: not every one is exact
/// enough to lead to the map.
const GOOD_SAMPLES: f64 = 30.0;

/// Two maps confirm each other when they share so many in a hundred of their inliers.
const CONFIRMS: usize = 95;

/// The lowest minima in which sightings are exchanged before the best is chosen.
const POLISHED: usize = 3;

/// Another minimum is a rival when it costs no more than two outliers more.
const RIVAL: f64 = OUTLIER * OUTLIER;

/// Plain hypotheses that are followed when no three views share enough landmarks for a sample.
const PLAIN: usize = 6;

/// The map that explains most of the bearings, and which these are.
///
/// # Errors
/// As [`solve`], and [`Error::SigmaTooLarge`] for a standard deviation above [`COARSEST`].
pub fn solve_robust(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    check_sigmas(problem)?;
    // Outliers are told apart here; what is left counts with its squares.
    let options = &SolveOptions {
        refine: RefineOptions {
            loss: Loss::Squared,
            ..options.refine
        },
        ..*options
    };
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let best = lowest(problem, options, &mut random, progress)?;
    let best = improve(problem, best, options, &mut random, progress)?;
    let [best, rivals @ ..] = &last_word(problem, best, options, progress)?[..] else {
        return Err(NOTHING);
    };
    let mut found = reconstruction(problem, best);
    refuse_free(&problem.subset(&best.inliers), &found)?;
    refuse_chance(&found)?;
    found.alternatives = rivals
        .iter()
        .map(|rival| reconstruction(problem, rival))
        .collect();
    Ok(found)
}

/// Refuses a map that chance explains: any bearings have one that as many of them agree with as it has
/// unknowns, and a few more.
fn refuse_chance(found: &Reconstruction) -> Result<(), Error> {
    let outliers = found.inliers.iter().filter(|inlier| !**inlier).count();
    let share = found.freedom as f64 / outliers as f64;
    if outliers > FEW_OUTLIERS && share < CONSENSUS {
        return Err(Error::NoConsensus {
            inliers: found.inliers.len() - outliers,
            outliers,
            freedom: found.freedom,
        });
    }
    Ok(())
}

/// Inliers beyond the unknowns, for each outlier, below which there is no consensus. Random bearings have a
/// tenth, scenes with three outliers in ten one or more.
const CONSENSUS: f64 = 0.25;

/// So few outliers are no sign of chance, however few bearings there are.
pub const FEW_OUTLIERS: usize = 2;

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
) -> Result<Settled, Error> {
    let commons: Vec<Common> = triples::draw(problem, SAMPLE, ALL_TRIPLES, options.seed)
        .into_iter()
        .map(|views| Common::new(problem, views))
        .collect();
    if commons.is_empty() {
        return from_plain(problem, options, random, progress);
    }
    let mut found: Vec<(Settled, [usize; 3])> = Vec::new();
    for round in 0..ROUNDS {
        if !tell(progress, "search", round, ROUNDS) {
            return Err(Error::Interrupted);
        }
        let some = commons.iter().cycle().skip(round * TRIPLES % commons.len());
        let mut seeds: Vec<Seed> = some
            .take(TRIPLES)
            .filter_map(|common| common.best_seed(SAMPLES, random))
            .collect();
        seeds.sort_by(|a, b| b.support.total_cmp(&a.support));
        for (done, seed) in seeds.iter().take(GROWN).enumerate() {
            if !tell(progress, "grow", done, GROWN) {
                return Err(Error::Interrupted);
            }
            for motion in branches(problem, seed) {
                let map = expand(problem, seed, motion, &options.refine, random)?;
                let Some(settled) = settle(problem, map, &options.refine)? else {
                    continue;
                };
                let settled = replace(problem, settled, &options.refine, random, progress)?;
                let confirmed = confirms(&found, &settled, seed.views);
                found.push((settled, seed.views));
                if confirmed {
                    return polished(problem, found, options);
                }
            }
        }
        let drawn = (round + 1) * TRIPLES * SAMPLES;
        if best_of(found.iter().map(|(settled, _)| settled))
            .is_ok_and(|best| drawn as f64 * good_samples(best) > GOOD_SAMPLES)
        {
            break;
        }
    }
    polished(problem, found, options)
}

/// The best of some minima, once sightings have been exchanged in the lowest few.
fn polished(
    problem: &Problem,
    found: Vec<(Settled, [usize; 3])>,
    options: &SolveOptions,
) -> Result<Settled, Error> {
    let mut found: Vec<Settled> = found.into_iter().map(|(settled, _)| settled).collect();
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    found.dedup_by(|a, b| a.inliers == b.inliers);
    found.truncate(POLISHED);
    let polished: Result<Vec<_>, Error> = found
        .into_iter()
        .map(|settled| exchange(problem, settled, &options.refine))
        .collect();
    best_of(polished?.into_iter())
}

/// Whether a minimum is as low as any, and another triple of views has led to nearly the same.
fn confirms(found: &[(Settled, [usize; 3])], settled: &Settled, views: [usize; 3]) -> bool {
    found
        .iter()
        .all(|(other, _)| other.cost >= settled.cost || other.agrees(settled, CONFIRMS))
        && found
            .iter()
            .any(|(other, from)| *from != views && other.agrees(settled, CONFIRMS))
}

/// The share of samples without an outlier, going by those of a map: all bearings of five landmarks.
fn good_samples(best: &Settled) -> f64 {
    let inliers = best.inliers.iter().filter(|inlier| **inlier).count();
    let share = inliers as f64 / best.inliers.len() as f64;
    (0..3 * SAMPLE).fold(1.0, |product, _| product * share)
}

/// The minimum that the plain hypotheses lead to: for problems too small for samples.
fn from_plain(
    problem: &Problem,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Settled, Error> {
    let search = Search::default();
    let hypotheses = hypotheses::search(problem, search, options.seed, progress)?;
    let mut found = Vec::new();
    for hypothesis in hypotheses.maps.into_iter().take(PLAIN) {
        if let Some(settled) = settle(problem, hypothesis.map, &options.refine)? {
            found.push(replace(
                problem,
                settled,
                &options.refine,
                random,
                progress,
            )?);
        }
    }
    best_of(found.into_iter())
}

/// The one with the least cost.
fn best_of<S: core::borrow::Borrow<Settled>>(found: impl Iterator<Item = S>) -> Result<S, Error> {
    found
        .min_by(|a, b| {
            let [a, b] = [a, b].map(|settled| settled.borrow().cost);
            a.total_cmp(&b)
        })
        .ok_or(NOTHING)
}

/// The motions of a seed that are worth growing: both, unless the signs of the bearings decide.
fn branches<'a>(
    problem: &Problem,
    seed: &'a Seed,
) -> impl Iterator<Item = &'a Motion<f64>> + use<'a> {
    let rivals = triples::are_rivals(problem, &seed.motions, 2 * seed.landmarks.len());
    seed.motions.iter().take(1 + usize::from(rivals))
}

/// Lowers the best map as far as single changes go.
fn improve(
    problem: &Problem,
    mut best: Settled,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Settled, Error> {
    loop {
        if !tell(progress, "improve", 0, 1) {
            return Err(Error::Interrupted);
        }
        best = exchange(problem, best, &options.refine)?;
        let cost = best.cost;
        best = replace(problem, best, &options.refine, random, progress)?;
        best = relocate(problem, best, &options.refine, random, progress)?;
        // Each round lowers the cost by more than rounding, or is the last.
        if !(best.cost < cost) {
            return Ok(best);
        }
    }
}

/// The best map and its rivals, once the plain search has seen the inliers: it knows the second motion
/// of three views, and on good bearings robust and plain solve agree.
fn last_word(
    problem: &Problem,
    best: Settled,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Settled>, Error> {
    let options = SolveOptions {
        robust: false,
        ..*options
    };
    let kept = problem.subset(&best.inliers);
    let mut all = Vec::new();
    match strategy::solve(&kept, &options, progress) {
        Ok(mut found) => {
            let rivals = core::mem::take(&mut found.alternatives);
            for found in core::iter::once(found).chain(rivals) {
                if inliers(problem, &found.map, OUTLIER) == best.inliers {
                    all.push(Settled::of(problem, found));
                } else {
                    let inliers = best.inliers.clone();
                    all.extend(fixed_point(problem, found.map, inliers, &options.refine)?);
                }
            }
        }
        Err(error) if error.stops_all() => return Err(error),
        // What the plain search cannot solve may still have been found.
        Err(_) => {}
    }
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    // Where they are the same, the map of the plain search is the one.
    let first = all.first().is_none_or(|plain| best.is_below(plain));
    all.insert(if first { 0 } else { all.len() }, best);
    let mut distinct: Vec<Settled> = Vec::new();
    for settled in all {
        let limit = distinct.first().map(|best| best.cost + RIVAL);
        if limit.is_none_or(|limit| settled.cost < limit)
            && distinct.iter().all(|other| !other.is_same(&settled))
        {
            distinct.push(settled);
        }
    }
    Ok(distinct)
}

/// What is known of a map: made from its inliers, with the residuals of all.
pub fn reconstruction(problem: &Problem, best: &Settled) -> Reconstruction {
    let kept = problem.subset(&best.inliers);
    let mut found = Reconstruction::new(&kept, &best.map, best.report.clone());
    let map: Map = found.map.clone();
    take_out_unbounded(&kept, &mut found);
    assess(&kept, &mut found);
    found.cost = best.cost;
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
