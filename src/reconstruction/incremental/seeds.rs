// SPDX-License-Identifier: MIT OR Apache-2.0
//! Seeds of maps: well-conditioned triples of views.

use super::super::options::SolveOptions;
use super::super::search::triples::{self, are_rivals, common_bearings};
use crate::error::Error;
use crate::kernels::{CalibratedTensor, Method, three_view};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// Triples of views that may start a map, the best conditioned first.
///
/// # Errors
/// Why the last of them could not, when none can; `Ok` and empty when no three views share five
/// landmarks.
pub fn seeds(problem: &Problem, options: &SolveOptions) -> Result<Vec<[usize; 3]>, Error> {
    let SolveOptions { seed, stages, .. } = options;
    let options = &stages.incremental;
    let drawn = options.triples_per_view.saturating_mul(problem.views());
    let count = drawn.max(options.fewest_triples).min(options.most_triples);
    let mut found: Vec<(bool, f64, [usize; 3])> = Vec::new();
    let mut failure = None;
    for needed in options.shared_landmarks {
        for views in triples::draw(problem, needed, count, *seed, &stages.draw) {
            if found.iter().any(|(_, _, other)| *other == views) {
                continue;
            }
            let (triples, _) = common_bearings(problem, views);
            match CalibratedTensor::estimate(&triples, 0) {
                Ok(tensor) => found.push((
                    triples.len() < options.shared_landmarks[0],
                    tensor.quality(),
                    views,
                )),
                Err(error) => failure = Some(error),
            }
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
    match failure {
        Some(error) if found.is_empty() => Err(error),
        _ => Ok(found.into_iter().map(|(_, _, views)| views).collect()),
    }
}

/// The poses of a seed: one map, or two where the signs of the bearings do not decide between the branches.
pub fn begin(problem: &Problem, views: [usize; 3]) -> Vec<Map> {
    let (triples, _) = common_bearings(problem, views);
    let Ok(solution) = three_view(&triples, Method::Calibrated { reweights: 1 }) else {
        return Vec::new();
    };
    let rivals = are_rivals(problem, &solution.motions, triples.len());
    let motions = solution.motions.iter().take(1 + usize::from(rivals));
    motions
        .map(|motion| {
            let mut map = Map::empty(problem.views(), problem.landmarks());
            for (&view, pose) in views.iter().zip(motion.poses) {
                map.poses[view] = Some(pose);
            }
            map
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// Triples that share many landmarks come before those that share few, and of either the better conditioned first.
    #[test]
    fn the_best_conditioned_triples_are_the_first() {
        let options = SolveOptions::default();
        let arena = Arena {
            sight: 3.0,
            ..Arena::default()
        };
        let scene = simulate(Layout::Trajectory, 20, 40, 0.002, 1, arena).unwrap();
        let problem = Problem::dense(20, 40, &scene.bearings, 0.002).unwrap();
        let key = |views: &[usize; 3]| {
            let (triples, _) = common_bearings(&problem, *views);
            let few = triples.len() < options.stages.incremental.shared_landmarks[0];
            let tensor = CalibratedTensor::estimate(&triples, 0).unwrap();
            (few, -tensor.quality())
        };
        let keys: Vec<(bool, f64)> = seeds(&problem, &options).unwrap().iter().map(key).collect();
        assert!(keys.is_sorted(), "{keys:?}");
        assert!(
            keys.len() > 10 && !keys[0].0 && keys[keys.len() - 1].0,
            "{keys:?}"
        );
    }

    /// A seed has both branches where the bearings are modulo pi, and one where their signs decide.
    #[test]
    fn signs_decide_between_the_branches() {
        let mut decided = 0;
        for seed in 0..10 {
            let scene = simulate(Layout::Enclosed, 3, 12, 0.0, seed, Arena::default()).unwrap();
            let problem = Problem::dense(3, 12, &scene.bearings, 0.01).unwrap();
            decided += usize::from(begin(&problem, [0, 1, 2]).len() == 1);
            assert_eq!(begin(&problem.unoriented(), [0, 1, 2]).len(), 2);
        }
        assert!(decided > 5, "{decided}");
    }
}
