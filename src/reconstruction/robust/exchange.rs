// SPDX-License-Identifier: MIT OR Apache-2.0
//! Single sightings, and pairs, that change from inlier to outlier or back.
//!
//! An outlier with high leverage bends the map until it fits: its residual is small, and that of a good
//! bearing that contradicts it is large. Leverage predicts, to first order, what the residuals would be
//! without it.

use super::super::options::SolveOptions;
use super::consensus::{Consensus, OUTLIER, fixed_point};
use super::options::RobustOptions;
use crate::error::Error;
use crate::problem::Problem;
use crate::uncertainty::Leverage;
use alloc::vec;
use alloc::vec::Vec;

/// Changes single sightings from inlier to outlier or back, as long as that lowers the cost.
///
/// The residual that a sighting would have after the change follows from its leverage, (T29); the most
/// promising changes are tried.
///
/// # Errors
/// Those of the refinement.
pub fn exchange(
    problem: &Problem,
    mut best: Consensus,
    options: &SolveOptions,
) -> Result<Consensus, Error> {
    let robust = &options.stages.robust;
    for _ in 0..robust.exchange_successes {
        let mut lower = None;
        for set in promising(problem, &best, robust) {
            let mut kept = best.inliers.clone();
            for k in set {
                kept[k] = !kept[k];
            }
            let limit = best.limit(robust);
            lower = fixed_point(problem, best.map.clone(), kept, limit, options)?
                .filter(|found| found.is_below(&best));
            if lower.is_some() {
                break;
            }
        }
        match lower {
            Some(found) => best = found,
            None => break,
        }
    }
    Ok(best)
}

/// Sets of one or two sightings whose change may lower the cost, the most promising first.
pub fn promising(problem: &Problem, best: &Consensus, options: &RobustOptions) -> Vec<Vec<usize>> {
    let Some(influence) = Leverage::new(problem, &best.map, &best.inliers) else {
        return Vec::new();
    };
    let most = OUTLIER * OUTLIER;
    // 1 to add a sighting, -1 to remove it.
    let sign = |k: usize| if best.inliers[k] { -1.0 } else { 1.0 };
    let change = |sign: f64, residual: f64, leverage: f64| {
        let spread = (1.0 + sign * leverage).max(f64::EPSILON);
        sign * (residual * residual / spread - most)
    };
    let single: Vec<(usize, f64, f64, f64)> = influence
        .residuals
        .iter()
        .enumerate()
        .filter_map(|(k, residual)| {
            let (residual, leverage) = ((*residual)?, influence.between(k, k));
            Some((k, residual, leverage, change(sign(k), residual, leverage)))
        })
        .collect();
    let worth = options.promising;
    let mut found: Vec<(f64, Vec<usize>)> = Vec::new();
    for &(k, residual, leverage, alone) in &single {
        if alone < worth {
            found.push((alone, vec![k]));
        }
        // Removing an inlier costs at most what an outlier costs; beyond that no second change pays.
        if alone > most {
            continue;
        }
        let spread = (1.0 + sign(k) * leverage).max(f64::EPSILON);
        for &(l, other, other_leverage, _) in &single {
            if l == k || best.inliers[l] {
                continue;
            }
            let prior = influence.between(k, l) * sign(k) / spread;
            let residual_then = other - prior * residual;
            let leverage_then = other_leverage - prior * influence.between(k, l);
            let both = alone + change(1.0, residual_then, leverage_then);
            if both < worth && both < alone {
                found.push((both, vec![k, l]));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(options.exchange_tries);
    found.into_iter().map(|(_, set)| set).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::lm::RefineOptions;
    use crate::problem::Map;
    use crate::simulate::{Arena, Layout, simulate};

    /// A map refined from the kept sightings, and twice its cost with an outlier's for the others.
    fn consensus(problem: &Problem, mut map: Map, kept: Vec<bool>) -> (Consensus, f64) {
        let inner = problem.subset(&kept);
        let report = refine_map(&inner, &mut map, &RefineOptions::default(), None).unwrap();
        let left_out = kept.iter().filter(|kept| !**kept).count() as f64;
        let twice = 2.0 * report.cost + OUTLIER * OUTLIER * left_out;
        let consensus = Consensus {
            map,
            inliers: kept,
            cost: 0.5 * twice,
            report,
        };
        (consensus, twice)
    }

    /// The changes of one sighting, and those of two that start with a promising one, that are predicted to lower the cost
    /// are those that do.
    #[test]
    fn promising_changes_lower_the_cost() {
        let options = RobustOptions {
            promising: 0.0,
            exchange_tries: usize::MAX,
            ..RobustOptions::default()
        };
        // So little that the residuals are linear in it, and two and a half times the standard deviation that is stated.
        let (noise, sigma) = (2.5e-5, 1e-5);
        let (mut lower, mut higher) = (0, 0);
        for seed in 0..6 {
            let scene = simulate(Layout::Mixed, 5, 9, noise, seed, Arena::default()).unwrap();
            let problem = Problem::dense(5, 9, &scene.bearings, sigma).unwrap();
            let kept: Vec<bool> = (0..45).map(|k| !(k + seed).is_multiple_of(6)).collect();
            let (best, now) = consensus(&problem, scene.map(), kept.clone());
            let found = promising(&problem, &best, &options);
            let change = |set: &[usize]| {
                let mut kept = kept.clone();
                for &k in set {
                    kept[k] = !kept[k];
                }
                consensus(&problem, best.map.clone(), kept).1 - now
            };
            for k in 0..kept.len() {
                let (actual, listed) = (change(&[k]), found.contains(&vec![k]));
                // The prediction is of first order.
                assert!(
                    actual.abs() < 0.05 || listed == (actual < 0.0),
                    "{seed} {k}: {actual}"
                );
                lower += usize::from(listed);
                higher += usize::from(!listed);
            }
            for set in &found {
                let actual = change(set);
                assert!(actual < 0.05, "{seed} {set:?}: {actual}");
            }
        }
        assert!(lower > 20 && higher > 20, "{lower} {higher}");
    }
}
