// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sweeps along the odometry to lower minima.
//!
//! While a map grows, its views are placed by poorly determined landmarks, and a stretch of views may settle where a
//! few outliers and the odometry agree. Once all landmarks are known, a sweep places all views again, one after the
//! other, by all of their landmarks. Sweeps from the two ends give different poses where it matters.

use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::robust::consensus::{Consensus, cauchy_consensus, fixed_point, inliers};
use super::super::robust::motions::{Motions, moved};
use super::super::robust::reassign::{reassign, reestimate_each};
use crate::error::Error;
use crate::problem::{Map, Problem};
use alloc::collections::VecDeque;
use rand_chacha::ChaCha8Rng;

/// Places all views again along the odometry, forwards and backwards, as long as that lowers the cost; then
/// tries other bounds for the inliers.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn sweep_odometry(
    problem: &Problem,
    mut best: Consensus,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let SolveOptions { stages, .. } = options;
    let stage = &stages.odometry_sweeps;
    let steps = stages.robust.motion_steps;
    let motions = Motions::new(problem);
    for round in 0..stage.rounds {
        let cost = best.cost;
        for backward in [false, true] {
            if !report_progress(progress, "improve", round, stage.rounds) {
                return Err(Error::Interrupted);
            }
            let map = swept(problem, &motions, &best.map, backward, steps);
            if let Some(found) =
                cauchy_consensus(problem, map, best.limit(&stages.robust), options)?
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
        let limit = best.limit(&stages.robust);
        let found = fixed_point(problem, best.map.clone(), kept, limit, options)?;
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

#[cfg(test)]
mod tests {
    use super::super::super::robust::consensus::{OUTLIER, cost};
    use super::*;
    use crate::problem::{Noise, Odometry};
    use crate::simulate::{Arena, Layout, simulate};
    use rand::SeedableRng;

    /// Placed again from either end, the views of an exact map come to where they were; the end keeps its pose.
    #[test]
    fn sweeps_place_all_views_from_one_end() {
        let scene = simulate(Layout::Trajectory, 8, 20, 0.0, 3, Arena::default()).unwrap();
        let problem = Problem::dense(8, 20, &scene.bearings, 0.01).unwrap();
        // Two drives.
        let odometry = [1, 2, 3, 5, 6, 7].map(|end: usize| Odometry {
            start: end - 1,
            end,
            delta: scene.poses[end - 1].inv_mul(&scene.poses[end]),
            noise: Noise::Sigmas([0.1, 0.1, 0.05]),
        });
        let problem = problem.with_odometry(&odometry).unwrap();
        let motions = Motions::new(&problem);
        for (backward, roots) in [(false, [0, 4]), (true, [7, 3])] {
            let mut map = scene.map();
            for (view, pose) in map.poses.iter_mut().flatten().enumerate() {
                if !roots.contains(&view) {
                    pose.translation.vector.x += 1.0;
                }
            }
            let found = swept(&problem, &motions, &map, backward, 10);
            assert_eq!(found.landmarks, map.landmarks);
            for (pose, truth) in found.poses.iter().zip(&scene.poses) {
                let error = truth.inv_mul(&pose.unwrap());
                assert!(error.translation.vector.norm() < 1e-6, "{backward}");
            }
            for root in roots {
                assert_eq!(found.poses[root], map.poses[root]);
            }
            map.poses[0] = None;
            map.poses[7] = None;
            let found = swept(&problem, &motions, &map, backward, 10);
            // The next in line takes the place of a root that is missing.
            let missing = found.poses.iter().filter(|pose| pose.is_none()).count();
            assert_eq!(missing, 0, "{backward}");
        }
    }

    /// The fixed point of a drive of eight views, with what changes its map, and options with which only sweeps or bounds do.
    fn drive(change: impl Fn(&mut Map)) -> (Problem, Consensus, Consensus, SolveOptions) {
        let scene = simulate(Layout::Trajectory, 8, 20, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(8, 20, &scene.bearings, 0.01).unwrap();
        let odometry = scene.odometry([0.05, 0.05, 0.02], 1).unwrap();
        let problem = problem.with_odometry(&odometry).unwrap();
        let mut options = SolveOptions::default();
        let truth = scene.map();
        let least = cauchy_consensus(&problem, truth, f64::INFINITY, &options);
        let least = least.unwrap().unwrap();
        let mut map = least.map.clone();
        change(&mut map);
        let start = Consensus {
            inliers: inliers(&problem, &map, OUTLIER),
            cost: cost(&problem, &map, OUTLIER),
            map,
            report: least.report.clone(),
        };
        options.stages.robust.reassign_rounds = 0;
        options.stages.odometry_sweeps.rounds = 0;
        // Of no sighting.
        options.stages.odometry_sweeps.bounds = [0.0; 4];
        (problem, least, start, options)
    }

    fn lowered(problem: &Problem, start: &Consensus, options: &SolveOptions) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let found = sweep_odometry(problem, start.clone(), options, &mut random, &mut None);
        found.unwrap().cost
    }

    /// The second half of a drive that lies apart is swept to the first, also by a single round.
    #[test]
    fn a_sweep_lowers_the_cost() {
        let (problem, least, start, mut options) = drive(|map| {
            for pose in map.poses[4..].iter_mut().flatten() {
                pose.translation.vector.x += 1.0;
            }
        });
        assert!(start.cost > 2.0 * least.cost);
        assert_eq!(lowered(&problem, &start, &options), start.cost);
        options.stages.odometry_sweeps.rounds = 1;
        let found = lowered(&problem, &start, &options);
        assert!((found / least.cost - 1.0).abs() < 1e-6, "{found}");
    }

    /// The sightings of a view that is turned by five standard deviations come back with a wider bound.
    #[test]
    fn a_wider_bound_readmits_what_was_pushed_out() {
        let (problem, least, start, mut options) = drive(|map| {
            let last = map.poses[7].as_mut().unwrap();
            last.rotation *= nalgebra::UnitComplex::new(0.05);
        });
        let lost = start.inliers.iter().filter(|inlier| !**inlier).count();
        assert!(lost > 10 && start.cost > 1.5 * least.cost, "{lost}");
        assert_eq!(lowered(&problem, &start, &options), start.cost);
        options.stages.odometry_sweeps.bounds = [0.0, 9.0, 0.0, 0.0];
        let found = lowered(&problem, &start, &options);
        assert!((found / least.cost - 1.0).abs() < 1e-6, "{found}");
    }
}
