// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps from bearings some of which are wrong.
//!
//! What is minimised is half the sum of squared residuals over sigma, none of which counts for more than
//! that of three sigma. Five random landmarks of three random views give a motion ([`sample`]); those
//! on which most other landmarks agree are grown to whole maps ([`expand`]) with estimates that outliers
//! do not move ([`place`]), and lowered to minima ([`settle`]). It is enough when seeds from two triples
//! of views have led to the lowest. The plain search over the inliers has the last word.

mod expand;
mod objective;
mod place;
mod sample;
mod settle;

use super::options::{Progress, SolveOptions, tell};
use super::result::Reconstruction;
use super::solve::{assess, solve};
use super::{bounded, triples};
use crate::error::Error;
use crate::estimation::{Map, Problem, Undetermined, Why};
use crate::scalar::Real;
use alloc::vec::Vec;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sample::{Common, Seed};
use settle::Settled;

/// Largest standard deviation with which outliers can be told \[rad\]: three of them are a third of the
/// circle to both sides together, and a random bearing is as good as any other.
const COARSEST: f64 = 0.35;

/// Most triples of views that samples are drawn from, and samples of each in a round.
const TRIPLES: usize = 64;
const SAMPLES: usize = 40;

/// Seeds that are grown in a round, and rounds.
const GROWN: usize = 16;
const ROUNDS: usize = 6;

/// Two maps confirm each other when they share so many in a hundred of their inliers.
const CONFIRMS: usize = 95;

/// The map that explains most of the bearings, and which these are.
///
/// # Errors
/// As [`solve`], and [`Error::TooCoarse`] for a standard deviation above [`COARSEST`].
pub(super) fn solve_robust<T: Real>(
    problem: &Problem<T>,
    options: &SolveOptions<T>,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction<T>, Error> {
    let mut progress = progress;
    check_sigmas(problem)?;
    let best = search(problem, options, &mut progress)?;
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let best = finish(problem, best, options, &mut random)?;
    Ok(reconstruction(problem, best))
}

/// The first sighting in the order of the input whose sigma is too large.
fn check_sigmas<T: Real>(problem: &Problem<T>) -> Result<(), Error> {
    let coarse = problem
        .sightings()
        .iter()
        .zip(problem.input_order())
        .filter(|(s, _)| s.weight * T::lit(COARSEST) < T::one())
        .min_by_key(|(_, index)| **index);
    match coarse {
        None => Ok(()),
        Some((s, &index)) => Err(Error::TooCoarse {
            what: "sigma",
            index,
            value: s.weight.recip().as_f64(),
            bound: COARSEST,
        }),
    }
}

/// The lowest minimum that samples lead to.
fn search<T: Real>(
    problem: &Problem<T>,
    options: &SolveOptions<T>,
    progress: &mut Option<Progress<'_>>,
) -> Result<Settled<T>, Error> {
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let commons: Vec<Common<T>> = triples::draw(problem, sample::SAMPLE, TRIPLES, options.seed)
        .into_iter()
        .map(|views| Common::new(problem, views))
        .collect();
    let mut found: Vec<(Settled<T>, [usize; 3])> = Vec::new();
    'rounds: for round in 0..ROUNDS {
        if !tell(progress, "sample", round, ROUNDS) {
            return Err(Error::Interrupted);
        }
        let mut seeds: Vec<Seed<T>> = commons
            .iter()
            .filter_map(|common| common.best_seed(SAMPLES, &mut random))
            .collect();
        seeds.sort_by(|a, b| b.support.total_cmp(&a.support));
        for (done, seed) in seeds.iter().take(GROWN).enumerate() {
            if !tell(progress, "grow", done, GROWN) {
                return Err(Error::Interrupted);
            }
            for motion in branches(seed) {
                let map = expand::expand(problem, seed, motion, &options.refine, &mut random)?;
                let Some(settled) = settle::settle(problem, map, &options.refine)? else {
                    continue;
                };
                let settled = settle::replace(problem, settled, &options.refine, &mut random)?;
                let confirmed = found.iter().all(|(other, _)| {
                    other.cost >= settled.cost || other.agrees(&settled, CONFIRMS)
                }) && found
                    .iter()
                    .any(|(other, views)| *views != seed.views && other.agrees(&settled, CONFIRMS));
                found.push((settled, seed.views));
                if confirmed {
                    break 'rounds;
                }
            }
        }
    }
    found
        .into_iter()
        .map(|(settled, _)| settled)
        .min_by(|a, b| a.cost.as_f64().total_cmp(&b.cost.as_f64()))
        .ok_or(Error::Degenerate {
            quantity: "number of maps that more than a sample agrees with",
            value: 0.0,
            bound: 1.0,
        })
}

/// The motions of a seed that are worth growing: both, unless the signs of the bearings decide.
fn branches<T: Real>(seed: &Seed<T>) -> impl Iterator<Item = &crate::kernels::Motion<T>> {
    let [first, second] = &seed.motions;
    let margin = 1 + seed.landmarks.len() / 4;
    let rivals = second.inconsistent <= first.inconsistent + margin;
    seed.motions.iter().take(1 + usize::from(rivals))
}

/// Lowers the best map as far as it goes.
fn finish<T: Real>(
    problem: &Problem<T>,
    best: Settled<T>,
    options: &SolveOptions<T>,
    random: &mut ChaCha8Rng,
) -> Result<Settled<T>, Error> {
    let mut best = best;
    for _ in 0..4 {
        let cost = best.cost;
        best = settle::exchange(problem, best, &options.refine)?;
        best = settle::replace(problem, best, &options.refine, random)?;
        best = settle::relocate(problem, best, &options.refine, random)?;
        if !(best.cost < cost) {
            break;
        }
    }
    let _ = solve::<T>;
    Ok(best)
}

fn reconstruction<T: Real>(problem: &Problem<T>, best: Settled<T>) -> Reconstruction<T> {
    let kept = problem.subset(&best.inliers);
    let mut found = Reconstruction::new(&kept, &best.map, best.report);
    let map: Map<T> = found.map.clone();
    bounded::take_out_unbounded(&kept, &mut found);
    assess(&kept, &mut found);
    found.cost = best.cost;
    found.residuals = alloc::vec![None; problem.sightings().len()];
    found.inliers = alloc::vec![false; problem.sightings().len()];
    let residuals = map.residuals(problem).zip(best.inliers);
    for (&place, (residual, inlier)) in problem.input_order().iter().zip(residuals) {
        found.residuals[place] = residual;
        found.inliers[place] = inlier;
    }
    for Undetermined { why, .. } in &mut found.undetermined {
        if let Why::TooFewSightings { got, needed } | Why::NotConnected { got, needed } = *why {
            *why = Why::TooFewInliers { got, needed };
        }
    }
    found
}
