// SPDX-License-Identifier: MIT OR Apache-2.0
//! Incremental reconstruction under limited sight: view by view from several seeds, one component after another.

pub(crate) mod complete;
pub(crate) mod gates;
pub(crate) mod growth;
pub(crate) mod heading_sweep;
pub(crate) mod join;
mod least_squares;
pub(crate) mod merge;
pub(crate) mod options;
pub(crate) mod place;
pub(crate) mod regrow;
mod seeds;

use super::choice::{SAME_COST, same};
use super::incremental::complete::finish;
use super::incremental::growth::{IncrementalGrowth, PlaceEstimator};
use super::incremental::least_squares::LeastSquaresPlaces;
use super::incremental::merge::{best, merge, views};
use super::judge::{JudgeOptions, is_as_good, is_plausible, variance};
use super::options::{Progress, SolveOptions};
use super::result::Reconstruction;
use crate::error::Error;
use crate::lm::{RefineOptions, Termination};
use crate::problem::{Map, Problem};
use alloc::vec;
use alloc::vec::Vec;

/// The refined maps of all components, the largest first; empty when no three views share five
/// landmarks.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`]; when no triple of views can start a map, the error of the last.
pub fn grow(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction>, Error> {
    let seeds = seeds::seeds(problem, options)?;
    let mut free = vec![true; problem.views()];
    let mut found: Vec<Reconstruction> = Vec::new();
    while let Some(map) = component(problem, options, &seeds, &free, progress)? {
        for (free, pose) in free.iter_mut().zip(&map.map.poses) {
            *free &= pose.is_none();
        }
        found.push(map);
    }
    merge(problem, options, found, progress)
}

/// The refined maps of all components, given a start for each.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn finish_all(
    problem: &Problem,
    options: &SolveOptions,
    starts: Vec<Map>,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction>, Error> {
    let mut free = vec![true; problem.views()];
    for pose in starts.iter().flat_map(|map| map.poses.iter().enumerate()) {
        free[pose.0] &= pose.1.is_none();
    }
    let mut found = Vec::new();
    for map in starts {
        if let Some(map) = finish(problem, options, map, &free, progress)?
            && map.freedom > 0
        {
            for (free, pose) in free.iter_mut().zip(&map.map.poses) {
                *free &= pose.is_none();
            }
            found.push(map);
        }
    }
    merge(problem, options, found, progress)
}

/// The first map that grows from a seed, for [`initialize`](super::initialize).
///
/// # Errors
/// As [`grow`].
pub fn first(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Map>, Error> {
    let free = vec![true; problem.views()];
    for views in seeds::seeds(problem, options)?
        .into_iter()
        .take(options.stages.incremental.seeds)
    {
        if let Some(map) = from_views(problem, options, views, &free, progress)?
            .into_iter()
            .next()
        {
            return Ok(Some(map));
        }
    }
    Ok(None)
}

/// The best map of views that are free: from several seeds, until one is beyond doubt.
fn component(
    problem: &Problem,
    options: &SolveOptions,
    seeds: &[[usize; 3]],
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let mut found: Vec<Reconstruction> = Vec::new();
    let mut unfinished: Vec<Reconstruction> = Vec::new();
    let SolveOptions { refine, stages, .. } = options;
    let stage = &stages.incremental;
    let first = SolveOptions {
        refine: RefineOptions {
            max_iterations: refine.max_iterations.min(stage.first_iterations),
            ..*refine
        },
        ..*options
    };
    // No two seeds share a view.
    let mut used = vec![false; problem.views()];
    for _ in 0..stage.seeds {
        let fresh = |views: &&[usize; 3]| views.iter().all(|&view| free[view] && !used[view]);
        let Some(&views) = seeds.iter().find(fresh) else {
            break;
        };
        for view in views {
            used[view] = true;
        }
        for map in from_views(problem, options, views, free, progress)? {
            let Some(map) = finish(problem, &first, map, free, progress)? else {
                continue;
            };
            // Without redundancy nothing checks the map.
            if map.freedom == 0 {
                continue;
            }
            if map.termination == Termination::MaxIterations {
                unfinished.push(map);
                continue;
            }
            let beyond_doubt =
                is_plausible(&map, &stages.judge) || confirms(&found, &map, &stages.judge);
            found.push(map);
            if beyond_doubt {
                return Ok(best(problem, stage, found));
            }
        }
    }
    // Finish only those that may still become the best.
    let least = found.iter().map(variance).fold(f64::INFINITY, f64::min);
    let rounding = gates::rounding(problem);
    unfinished.retain(|map| is_as_good(variance(map), least, stage.hopeless_ratio, rounding));
    unfinished.sort_by(|a, b| variance(a).total_cmp(&variance(b)));
    for map in unfinished.into_iter().take(stage.max_finished) {
        found.extend(finish(problem, options, map.map, free, progress)?);
    }
    Ok(best(problem, stage, found))
}

/// The maps that a seed grows to by least squares.
fn from_views(
    problem: &Problem,
    options: &SolveOptions,
    views: [usize; 3],
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    let estimator =
        || LeastSquaresPlaces::new(problem, &options.stages.incremental, &options.refine);
    let branches = seeds::begin(problem, views);
    from_seed(problem, options, branches, estimator, free, progress)
}

/// The maps that the branches of a seed grow to: one, or two when neither is clearly better.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn from_seed<E: PlaceEstimator>(
    problem: &Problem,
    options: &SolveOptions,
    branches: Vec<Map>,
    estimator: impl Fn() -> E,
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    let stage = &options.stages.incremental;
    let mut growths = Vec::new();
    for map in branches {
        if let Some(mut growth) = IncrementalGrowth::new(problem, options, estimator(), free, map)?
        {
            growth.grow(stage.views_before_choice, progress)?;
            growths.push((growth.reached(), growth.variance(), growth));
        }
    }
    growths.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)));
    let Some((reached, variance)) = growths.first().map(|first| (first.0, first.1)) else {
        return Ok(Vec::new());
    };
    growths.retain(|growth| {
        growth.0 == reached && growth.1 < stage.clear_ratio * variance.max(f64::MIN_POSITIVE)
    });
    let mut maps = Vec::new();
    for (_, _, mut growth) in growths {
        growth.grow(usize::MAX, progress)?;
        maps.push(growth.map);
    }
    Ok(maps)
}

/// Whether a map is the lowest known, and another seed has led to it before.
fn confirms(others: &[Reconstruction], found: &Reconstruction, judge: &JudgeOptions) -> bool {
    let reached = views(found);
    others
        .iter()
        .all(|other| views(other) < reached || other.cost >= found.cost * SAME_COST)
        && others
            .iter()
            .any(|other| same(&other.map, &found.map, judge))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// The branch of a seed that reaches most and fits best decides, whichever is tried first.
    #[test]
    fn the_order_of_the_branches_does_not_matter() {
        let options = SolveOptions::default();
        let arena = Arena {
            sight: 3.0,
            ..Arena::default()
        };
        let mut both = 0;
        for seed in 0..10 {
            let scene = simulate(Layout::Trajectory, 20, 40, 0.002, seed, arena).unwrap();
            // Modulo pi no signs decide between the branches.
            let problem = Problem::dense(20, 40, &scene.bearings, 0.002).unwrap();
            let problem = problem.unoriented();
            let free = [true; 20];
            let estimator =
                || LeastSquaresPlaces::new(&problem, &options.stages.incremental, &options.refine);
            for views in seeds::seeds(&problem, &options)
                .unwrap()
                .into_iter()
                .take(3)
            {
                let mut branches = seeds::begin(&problem, views);
                both += usize::from(branches.len() == 2);
                let grow = |branches: &[Map]| {
                    let branches = branches.to_vec();
                    from_seed(&problem, &options, branches, estimator, &free, &mut None).unwrap()
                };
                let found = grow(&branches);
                branches.reverse();
                assert_eq!(grow(&branches), found, "{seed} {views:?}");
            }
        }
        assert!(both > 20, "{both}");
    }
}
