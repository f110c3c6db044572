// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sweeps along the odometry to lower minima.
//!
//! While a map grows, its views are placed by poorly determined landmarks, and a stretch of views may settle where a
//! few outliers and the odometry agree. Once all landmarks are known, a sweep places all views again, one after the
//! other, by all of their landmarks. Sweeps from the two ends give different poses where it matters.

use super::super::attempt::attempt;
use super::super::options::{Progress, report_progress};
use super::super::robust::consensus::{Consensus, OUTLIER, fixed_point, inliers, to_consensus};
use super::super::robust::motions::{Motions, moved};
use super::super::robust::options::RobustOptions;
use super::super::robust::reassign::{reassign, reestimate_each};
use crate::error::Error;
use crate::lm::{Loss, RefineOptions};
use crate::problem::{Map, Problem};
use alloc::collections::VecDeque;
use rand_chacha::ChaCha8Rng;

/// Options of the sweeps.
#[derive(Clone, Copy, Debug)]
struct SweepOptions {
    /// Maximum number of rounds: each lowers the cost, so they end by themselves.
    rounds: usize,
    /// Another round follows when the last one lowered the cost by more than this: the cost of an outlier.
    worth: f64,
    /// Tolerance of the refinement with Cauchy's loss: it only has to identify the inliers.
    cauchy_tolerance: f64,
    /// Bounds, in standard deviations, that are each tried once for the selection of inliers: narrow ones exclude
    /// outliers that have bent the map, wide ones readmit good bearings that such outliers have pushed out.
    bounds: [f64; 4],
}

impl Default for SweepOptions {
    fn default() -> Self {
        Self {
            rounds: 10,
            worth: OUTLIER * OUTLIER / 2.0,
            cauchy_tolerance: 1e-5,
            bounds: [2.0, 4.5, 9.0, 20.0],
        }
    }
}

/// The fixed point that a start leads to through the minimum with Cauchy's loss, which outliers hardly move.
///
/// # Errors
/// Those of the refinement.
pub fn cauchy_consensus(
    problem: &Problem,
    mut map: Map,
    options: &RobustOptions,
) -> Result<Option<Consensus>, Error> {
    let soft = RefineOptions {
        loss: Loss::Cauchy(Loss::<f64>::CAUCHY),
        tolerance: SweepOptions::default().cauchy_tolerance,
        ..options.refine
    };
    // If the whole cannot be refined, its inliers may still be.
    attempt(problem, &mut map, &soft, None)?;
    to_consensus(problem, map, options)
}

/// Places all views again along the odometry, forwards and backwards, as long as that lowers the cost; then
/// tries other bounds for the inliers.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn sweep_odometry(
    problem: &Problem,
    mut best: Consensus,
    options: &RobustOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let stage = SweepOptions::default();
    let motions = Motions::new(problem);
    for round in 0..stage.rounds {
        let cost = best.cost;
        for backward in [false, true] {
            if !report_progress(progress, "improve", round, stage.rounds) {
                return Err(Error::Interrupted);
            }
            let map = swept(problem, &motions, &best.map, backward, options.motion_steps);
            if let Some(found) = cauchy_consensus(problem, map, options)?
                && found.is_below(&best)
            {
                best = reestimate_each(problem, found, options, random, progress)?;
            }
        }
        best = reassign(problem, best, options, random, progress)?;
        if !(best.cost + stage.worth < cost) {
            break;
        }
    }
    for bound in stage.bounds {
        let kept = inliers(problem, &best.map, bound);
        let found = fixed_point(problem, best.map.clone(), kept, options)?;
        if let Some(found) = found.filter(|found| found.is_below(&best)) {
            best = found;
        }
    }
    Ok(best)
}

/// The views of a map placed one after the other along the odometry, by all of its landmarks. In each set of
/// connected views the first view (the last if `backward`) keeps its pose.
fn swept(problem: &Problem, motions: &Motions, map: &Map, backward: bool, steps: usize) -> Map {
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
                    result.poses[motion.end] = Some(moved(problem, &result, &pose, motion, steps));
                    waiting.push_back(motion.end);
                }
            }
        }
    }
    result
}
