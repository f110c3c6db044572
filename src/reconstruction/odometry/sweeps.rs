// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lower minima along the odometry.
//!
//! While a map grows, its views are placed by landmarks that are hardly known yet, and a stretch of them may
//! come to lie where a few wrong bearings and the odometry agree. Once all landmarks are known the same views
//! find their places one after the other; from the other end they find different ones where it matters.

use super::super::options::{Progress, tell};
use super::super::robust::consensus::{Settled, fixed_point, settle};
use super::super::robust::motions::{Motions, moved};
use super::super::robust::objective::{OUTLIER, inliers};
use super::super::robust::reassign::{relocate, replace};
use crate::adjustment::refine_map;
use crate::error::Error;
use crate::lm::{Loss, RefineOptions};
use crate::problem::{Map, Problem};
use alloc::collections::VecDeque;
use rand_chacha::ChaCha8Rng;

/// Most rounds: each lowers the cost, so they end by themselves.
const ROUNDS: usize = 10;

/// A round is worth another when it has saved an outlier.
const WORTH: f64 = OUTLIER * OUTLIER / 2.0;

/// Tolerance of the refinement with Cauchy's loss: it only has to tell inliers.
const ROUGHLY: f64 = 1e-5;

/// Bounds, in standard deviations, within which sightings are taken for good for once: what has bent the map
/// falls out, and what it has pushed out comes back.
const BOUNDS: [f64; 4] = [2.0, 4.5, 9.0, 20.0];

/// The fixed point that a start leads to by way of the least of Cauchy's loss, which outliers hardly move.
///
/// # Errors
/// Those of the refinement.
pub fn softly(
    problem: &Problem,
    mut map: Map,
    options: &RefineOptions,
) -> Result<Option<Settled>, Error> {
    let soft = RefineOptions {
        loss: Loss::Cauchy(Loss::<f64>::CAUCHY),
        tolerance: ROUGHLY,
        ..*options
    };
    // What cannot be refined as a whole may still have a part that can.
    match refine_map(problem, &mut map, &soft, None) {
        Err(error) if error.stops_all() => return Err(error),
        _ => {}
    }
    settle(problem, map, options)
}

/// Places all views anew along the odometry, from its first views on and from its last, as long as that
/// lowers the cost; then takes sightings for good, or for wrong, that are near the bound.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn retrace(
    problem: &Problem,
    mut best: Settled,
    options: &RefineOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Settled, Error> {
    let motions = Motions::new(problem);
    for round in 0..ROUNDS {
        let cost = best.cost;
        for backward in [false, true] {
            if !tell(progress, "improve", round, ROUNDS) {
                return Err(Error::Interrupted);
            }
            let map = retraced(problem, &motions, &best.map, backward);
            if let Some(found) = softly(problem, map, options)?
                && found.is_below(&best)
            {
                best = replace(problem, found, options, random, progress)?;
            }
        }
        best = relocate(problem, best, options, random, progress)?;
        if !(best.cost + WORTH < cost) {
            break;
        }
    }
    for bound in BOUNDS {
        let kept = inliers(problem, &best.map, bound);
        let found = fixed_point(problem, best.map.clone(), kept, options)?;
        if let Some(found) = found.filter(|found| found.is_below(&best)) {
            best = found;
        }
    }
    Ok(best)
}

/// The views of a map one after the other along the odometry, by all of its landmarks; of what hangs
/// together the first view, or the last, stays.
fn retraced(problem: &Problem, motions: &Motions, map: &Map, backward: bool) -> Map {
    let views = problem.views();
    let mut result = Map::empty(views, 0);
    result.landmarks.clone_from(&map.landmarks);
    for place in 0..views {
        let root = if backward { views - 1 - place } else { place };
        if result.poses[root].is_some() {
            continue;
        }
        result.poses[root] = map.poses[root];
        let mut waiting = VecDeque::from([root]);
        while let Some(view) = waiting.pop_front() {
            let Some(pose) = result.poses[view] else {
                continue;
            };
            for motion in motions.of(view) {
                if result.poses[motion.end].is_none() {
                    result.poses[motion.end] = Some(moved(problem, &result, &pose, motion));
                    waiting.push_back(motion.end);
                }
            }
        }
    }
    result
}
