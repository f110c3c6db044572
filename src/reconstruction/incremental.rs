// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps under limited sight: grown view by view from several seeds, component by component.

mod complete;
mod gates;
mod growth;
mod locate;
mod merge;
mod seeds;

use super::minima::{SAME_COST, is_plausible, same};
use super::options::{Progress, tell};
use super::result::Reconstruction;
use crate::error::Error;
use crate::estimation::{Map, Problem, RefineOptions, Termination, refine_map};
use crate::scalar::Real;
use alloc::vec;
use alloc::vec::Vec;
use growth::Growth;

/// Seeds that are tried for a map before the best is taken as it is.
const ATTEMPTS: usize = 12;

/// Iterations that the map of a seed gets at its end: one that has grown well needs two to five.
const FIRST_ITERATIONS: usize = 20;

/// Most unfinished maps that go on, and by how much their cost per degree of freedom may exceed the best.
const MAX_FINISHED: usize = 2;
const HOPELESS: f64 = 30.0;

/// Views to which both branches of a seed grow before the better goes on.
const TRIAL: usize = 8;

/// Two branches whose costs per degree of freedom differ by less than this factor after the trial are both
/// grown to the end.
const CLEARLY: f64 = 4.0;

/// The maps of all components, refined, the largest first; none when no three views share five landmarks.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::TooLarge`]; why no triple of views can start a map, when none can.
pub fn grow<T: Real>(
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    seed: u64,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction<T>>, Error> {
    let seeds = seeds::seeds(problem, seed)?;
    let mut free = vec![true; problem.views()];
    let mut found: Vec<Reconstruction<T>> = Vec::new();
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
/// [`Error::Interrupted`] and [`Error::TooLarge`].
pub fn finish_all<T: Real>(
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    starts: Vec<Map<T>>,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction<T>>, Error> {
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
pub fn first<T: Real>(
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    seed: u64,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Map<T>>, Error> {
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
fn component<T: Real>(
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    seeds: &[[usize; 3]],
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction<T>>, Error> {
    let mut found: Vec<Reconstruction<T>> = Vec::new();
    let mut unfinished: Vec<Reconstruction<T>> = Vec::new();
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
                return Ok(best(found));
            }
        }
    }
    // What goes on is what may still be the best.
    let least = found.iter().map(variance).fold(f64::INFINITY, f64::min);
    unfinished.retain(|map| variance(map) <= HOPELESS * least);
    unfinished.sort_by(|a, b| variance(a).total_cmp(&variance(b)));
    for map in unfinished.into_iter().take(MAX_FINISHED) {
        found.extend(finish(problem, options, map.map, free, progress)?);
    }
    Ok(best(found))
}

/// The maps that a seed grows to: one, or two when neither branch is clearly better.
fn from_seed<T: Real>(
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    views: [usize; 3],
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map<T>>, Error> {
    let mut growths = Vec::new();
    for map in seeds::begin(problem, views) {
        if let Some(mut growth) = Growth::new(problem, options, free, map)? {
            growth.grow(TRIAL, progress)?;
            let variance = growth.noise().as_f64().powi(2);
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

/// The last refinement of a map, of everything that has a place in it.
pub fn finish<T: Real>(
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    mut map: Map<T>,
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction<T>>, Error> {
    let mut best: Option<Reconstruction<T>> = None;
    for _ in 0..COMPLETIONS {
        // The gauge of a reconstruction is as good as any.
        if let Some(found) = &best {
            map = found.map.clone();
        }
        let before = map.poses.iter().flatten().count();
        complete::complete(problem, &mut map, free);
        if best.is_some() && map.poses.iter().flatten().count() == before {
            break;
        }
        match refined(problem, options, map.clone(), progress)? {
            Some(found) => best = Some(found),
            None => break,
        }
    }
    Ok(best)
}

/// Refinements of a map, each of which may make room for a view that did not fit before.
const COMPLETIONS: usize = 3;

/// A map refined; `None` when it cannot be.
fn refined<T: Real>(
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    mut map: Map<T>,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction<T>>, Error> {
    let total = options.max_iterations;
    let mut watch = |done, _| tell(progress, "refine", done, total);
    match refine_map(problem, &mut map, options, Some(&mut watch)) {
        Ok(report) => Ok(Some(Reconstruction::new(problem, &map, report))),
        Err(error @ (Error::Interrupted | Error::TooLarge { .. })) => Err(error),
        Err(_) => Ok(None),
    }
}

/// Whether a map is the lowest known, and another seed has led to it before.
fn confirms<T: Real>(others: &[Reconstruction<T>], found: &Reconstruction<T>) -> bool {
    let reached = views(found);
    others
        .iter()
        .all(|other| views(other) < reached || other.cost >= found.cost * T::lit(SAME_COST))
        && others.iter().any(|other| same(&other.map, &found.map))
}

/// The cost per degree of freedom.
fn variance<T: Real>(found: &Reconstruction<T>) -> f64 {
    found.cost.as_f64() / found.freedom.max(1) as f64
}

/// Number of views in a map.
fn views<T: Real>(found: &Reconstruction<T>) -> usize {
    found.map.poses.iter().flatten().count()
}

/// A map fits about as well as another when its cost per degree of freedom is at most so many times the other's.
const AS_GOOD: f64 = 4.0;

/// Of those that fit about as well as the best, the one that reaches most, then the lowest.
fn best<T: Real>(found: Vec<Reconstruction<T>>) -> Option<Reconstruction<T>> {
    let least = found.iter().map(variance).fold(f64::INFINITY, f64::min);
    found.into_iter().min_by(|a, b| {
        let misfits = |found: &Reconstruction<T>| !(variance(found) <= AS_GOOD * least);
        misfits(a)
            .cmp(&misfits(b))
            .then(a.undetermined.len().cmp(&b.undetermined.len()))
            .then(a.cost.as_f64().total_cmp(&b.cost.as_f64()))
    })
}

/// Joins maps that share landmarks; the largest first.
fn merge<T: Real>(
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    mut found: Vec<Reconstruction<T>>,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction<T>>, Error> {
    let nothing = vec![false; problem.views()];
    let mut pair = Some((0, 1));
    while let Some((a, b)) = pair.filter(|&(_, b)| b < found.len()) {
        let start = merge::merged(problem, &found[a].map, &found[b].map);
        let joined = match start {
            Some(start) => finish(problem, options, start, &nothing, progress)?,
            None => None,
        };
        let apart = found[a].cost + found[b].cost;
        let freedom = found[a].freedom + found[b].freedom;
        match joined {
            // As good as apart, per degree of freedom: they belong together.
            Some(joined)
                if joined.cost.as_f64() / joined.freedom.max(1) as f64
                    <= AS_GOOD * apart.as_f64() / freedom.max(1) as f64 =>
            {
                found[a] = joined;
                found.remove(b);
                pair = Some((0, 1));
            }
            _ => {
                pair = Some(if b + 1 < found.len() {
                    (a, b + 1)
                } else {
                    (a + 1, a + 2)
                });
            }
        }
    }
    found.sort_by_key(|found| core::cmp::Reverse(views(found)));
    Ok(found)
}
