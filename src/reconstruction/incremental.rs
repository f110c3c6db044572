// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps under limited sight: grown view by view from several seeds, component by component.

mod complete;
mod gates;
mod growth;
mod locate;
mod merge;
mod seeds;

use super::incremental::complete::finish;
use super::incremental::growth::Growth;
use super::incremental::merge::{best, merge, variance, views};
use super::judge::{SAME_COST, is_plausible, same};
use super::options::Progress;
use super::result::Reconstruction;
use crate::error::Error;
use crate::lm::{RefineOptions, Termination};
use crate::problem::{Map, Problem};
use alloc::vec;
use alloc::vec::Vec;

/// Seeds that are tried for a map before the best is taken as it is.
const ATTEMPTS: usize = 12;

/// Iterations that the map of a seed gets at its end: one that has grown well needs two to five, and
/// what takes more goes on by Newton's method, which is dear.
const FIRST_ITERATIONS: usize = 8;

/// Most unfinished maps that go on, and by how much their cost per degree of freedom may exceed the
/// best.
const MAX_FINISHED: usize = 3;
const HOPELESS: f64 = 30.0;

/// Views to which both branches of a seed grow before the better goes on.
const TRIAL: usize = 8;

/// Two branches whose costs per degree of freedom differ by less than this factor after the trial are
/// both grown to the end.
const CLEARLY: f64 = 4.0;

/// The maps of all components, refined, the largest first; none when no three views share five
/// landmarks.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`]; why no triple of views can start a map, when none can.
pub fn grow(
    problem: &Problem,
    options: &RefineOptions,
    seed: u64,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction>, Error> {
    let seeds = seeds::seeds(problem, seed)?;
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

/// The maps of all components from a start of each.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn finish_all(
    problem: &Problem,
    options: &RefineOptions,
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

/// The first map that a seed leads to: for [`initialize`](super::initialize).
///
/// # Errors
/// As [`grow`].
pub fn first(
    problem: &Problem,
    options: &RefineOptions,
    seed: u64,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Map>, Error> {
    let free = vec![true; problem.views()];
    for views in seeds::seeds(problem, seed)?.into_iter().take(ATTEMPTS) {
        if let Some(map) = from_seed(problem, options, views, &free, progress)?
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
    options: &RefineOptions,
    seeds: &[[usize; 3]],
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let mut found: Vec<Reconstruction> = Vec::new();
    let mut unfinished: Vec<Reconstruction> = Vec::new();
    let first = RefineOptions {
        max_iterations: options.max_iterations.min(FIRST_ITERATIONS),
        ..*options
    };
    // Seeds have no view in common, as far as there are such.
    let mut used = vec![false; problem.views()];
    for _ in 0..ATTEMPTS {
        let fresh = |views: &&[usize; 3]| views.iter().all(|&view| free[view] && !used[view]);
        let Some(&views) = seeds.iter().find(fresh) else {
            break;
        };
        for view in views {
            used[view] = true;
        }
        for map in from_seed(problem, options, views, free, progress)? {
            let Some(map) = finish(problem, &first, map, free, progress)? else {
                continue;
            };
            // Something must check the map.
            if map.freedom == 0 {
                continue;
            }
            if map.termination == Termination::MaxIterations {
                unfinished.push(map);
                continue;
            }
            let beyond_doubt = is_plausible(&map) || confirms(&found, &map);
            found.push(map);
            if beyond_doubt {
                return Ok(best(problem, found));
            }
        }
    }
    // What goes on is what may still be the best.
    let least = found.iter().map(variance).fold(f64::INFINITY, f64::min);
    let rounding = gates::rounding(problem);
    unfinished.retain(|map| variance(map) <= HOPELESS * least + rounding);
    unfinished.sort_by(|a, b| variance(a).total_cmp(&variance(b)));
    for map in unfinished.into_iter().take(MAX_FINISHED) {
        found.extend(finish(problem, options, map.map, free, progress)?);
    }
    Ok(best(problem, found))
}

/// The maps that a seed grows to: one, or two when neither branch is clearly better.
fn from_seed(
    problem: &Problem,
    options: &RefineOptions,
    views: [usize; 3],
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    let mut growths = Vec::new();
    for map in seeds::begin(problem, views) {
        if let Some(mut growth) = Growth::new(problem, options, free, map)? {
            growth.grow(TRIAL, progress)?;
            let noise = growth.noise();
            let variance = noise * noise;
            growths.push((growth.reached(), variance, growth));
        }
    }
    growths.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)));
    let Some((reached, variance)) = growths.first().map(|first| (first.0, first.1)) else {
        return Ok(Vec::new());
    };
    growths.retain(|growth| {
        growth.0 == reached && growth.1 < CLEARLY * variance.max(f64::MIN_POSITIVE)
    });
    let mut maps = Vec::new();
    for (_, _, mut growth) in growths {
        growth.grow(usize::MAX, progress)?;
        maps.push(growth.map);
    }
    Ok(maps)
}

/// Whether a map is the lowest known, and another seed has led to it before.
fn confirms(others: &[Reconstruction], found: &Reconstruction) -> bool {
    let reached = views(found);
    others
        .iter()
        .all(|other| views(other) < reached || other.cost >= found.cost * SAME_COST)
        && others.iter().any(|other| same(&other.map, &found.map))
}
