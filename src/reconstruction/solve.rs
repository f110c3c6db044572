// SPDX-License-Identifier: MIT OR Apache-2.0
//! From bearings to the best map: hypotheses, refinement, choice.

use super::bounded::take_out_unbounded;
use super::minima::{Minima, same};
use super::options::{Progress, SolveOptions, Strategy, tell};
use super::paper;
use super::posterior::solve_posterior;
use super::result::Reconstruction;
use super::robust::solve_robust;
use super::search::{self, Hypotheses, Hypothesis};
use super::sight;
use crate::error::Error;
use crate::estimation::{
    Map, Problem, RefineOptions, Report, Subject, Termination, Why, cost, refine_map, sensitivity,
};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use alloc::vec::Vec;

/// A linear map without refinement: a start for a solver of one's own.
///
/// The best hypothesis of the search, or with [`Strategy::FirstViews`] the map at the end of the
/// paper's path, whatever its cost. Same gauge as [`solve`]; [`Termination::NotRefined`].
///
/// # Errors
/// As [`solve`], except that the result is not tested for free directions.
///
/// # Example
/// ```
/// use bearslam::{
///     Arena, Layout, Method, Problem, SolveOptions, Strategy, initialize, refine, simulate,
/// };
/// let scene = simulate(Layout::Enclosed, 6, 9, 0.01, 5, Arena::default())?;
/// let problem = Problem::dense(6, 9, &scene.bearings, 1.0)?;
/// let options = SolveOptions {
///     strategy: Strategy::FirstViews(Method::Projective),
///     ..SolveOptions::default()
/// };
/// let start = initialize(&problem, &options, None)?;
/// let found = refine(&problem, &start.map, &options.refine, None)?;
/// assert!(found.cost < start.cost);
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn initialize(
    problem: &Problem,
    options: &SolveOptions,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut progress = progress;
    let (hypotheses, count) = match sight::first_map(problem, options, &mut progress)? {
        Some(map) => (Hypotheses::of([map]), 1),
        None => {
            let count = match options.strategy {
                Strategy::FirstViews(_) => 1,
                _ => 2,
            };
            (hypotheses(problem, options, &mut progress)?, count)
        }
    };
    let judged = hypotheses
        .maps
        .into_iter()
        .take(count)
        .map(|Hypothesis { mut map, .. }| {
            let undetermined = map.prune(problem);
            let cost = cost(problem, &map, options.refine.loss);
            Reconstruction::new(
                problem,
                &map,
                Report {
                    cost,
                    termination: Termination::NotRefined,
                    iterations: 0,
                    undetermined,
                    loss: options.refine.loss,
                },
            )
        });
    choose(problem, judged.collect())
}

/// Refines a start: one map, no search.
///
/// Places of the start that are `None`, or that its other places do not fix, stay undetermined. The
/// result is in the gauge of [`solve`], with its sensitivity and uncertainty, but is no error whatever
/// they are. [`refine_map`](crate::refine_map) does the bare minimisation.
///
/// # Errors
/// As [`refine_map`](crate::refine_map).
pub fn refine(
    problem: &Problem,
    start: &Map,
    options: &RefineOptions,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut progress = progress;
    let mut map = start.clone();
    let total = options.max_iterations;
    let mut watch = |done, _| tell(&mut progress, "refine", done, total);
    let mut report = refine_map(problem, &mut map, options, Some(&mut watch))?;
    for undetermined in &mut report.undetermined {
        let without = match undetermined.subject {
            Subject::View(view) => start.poses[view].is_none(),
            Subject::Landmark(landmark) => start.landmarks[landmark].is_none(),
        };
        if without && undetermined.why == Why::Degenerate {
            undetermined.why = Why::NoStart;
        }
    }
    let mut found = Reconstruction::new(problem, &map, report);
    take_out_unbounded(problem, &mut found);
    assess(problem, &mut found);
    Ok(found)
}

/// Poses and landmarks from bearings alone: no odometry, no guess.
///
/// Triples of views give hypotheses in closed form, both branches of each; the best conditioned are
/// grown to whole maps by resection and triangulation and scored by a robust cost over all bearings;
/// the best are refined until one is as low as the noise says or two end in the same minimum. If they
/// do not, more hypotheses are made by varying the tensors along the direction that the
/// bearings hold least. Then single landmarks are tried in other places. The lowest minimum is returned,
/// with the rivals that explain the bearings nearly as well (the mirror branch of three views, the
/// several exact maps of four landmarks).
///
/// The first determined view is at the origin with heading 0 and the root-mean-square distance of the
/// other views from it is 1. Views and landmarks that the bearings do not determine are `None` and
/// listed with the reason.
///
/// # Errors
/// [`Error::TooFew`] for an empty search, below three views or when no three views share five landmarks (four, where there
/// is a fourth view); [`Error::Degenerate`] when no triple has a solution (all landmarks along one
/// wall, views in one place) or exact bearings leave a direction of the map free;
/// [`Error::OutOfMemory`] as [`refine_map`](crate::refine_map); [`Error::Interrupted`] when `progress`
/// says so; with [`SolveOptions::robust`] [`Error::TooCoarse`] for a sigma above 0.35 rad. With noise a degenerate geometry shows in
/// [`Reconstruction::uncertainty`]: look at it before you trust a map.
///
/// # Example
/// ```
/// use bearslam::{Arena, Layout, Problem, SolveOptions, simulate, solve};
/// let scene = simulate(Layout::Enclosed, 8, 11, 0.01, 5, Arena::default())?;
/// let problem = Problem::dense(8, 11, &scene.bearings, 0.01)?;
/// let found = solve(&problem, &SolveOptions::default(), None)?;
/// assert!(found.termination.was_successful());
/// assert!(found.uncertainty < 0.1);
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn solve(
    problem: &Problem,
    options: &SolveOptions,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let best = best(problem, options, progress)?;
    if options.robust {
        return Ok(best);
    }
    judge(problem, best)
}

/// The map of [`solve`], not yet tested for free directions.
pub fn best(
    problem: &Problem,
    options: &SolveOptions,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    if !problem.ties().is_empty() {
        return solve_posterior(problem, options, progress);
    }
    if options.robust {
        return solve_robust(problem, options, progress);
    }
    let mut progress = progress;
    let mut maps = sight::maps(problem, options, &mut progress)?;
    for map in &mut maps {
        take_out_unbounded(problem, map);
    }
    for map in maps.iter_mut().skip(1) {
        assess(problem, map);
    }
    if let Some(found) = sight::gather(problem, maps) {
        return Ok(found);
    }
    let mut hypotheses = hypotheses(problem, options, &mut progress)?;
    let maps = core::mem::take(&mut hypotheses.maps).into_iter();
    let found = match options.strategy {
        Strategy::FirstViews(_) | Strategy::Incremental | Strategy::Global => {
            let mut minima = Minima::new(problem, &options.refine, &mut progress);
            minima.try_out(maps.take(1), false)?;
            minima.finish(true)?;
            minima.into_found()?
        }
        // Three views, or four landmarks: several minima may be exact.
        Strategy::Search(search) if !hypotheses.unique => {
            let mut minima = Minima::new(problem, &options.refine, &mut progress);
            minima.try_out(maps, false)?;
            if !minima.has_exact() && search.swept > 0 {
                let maps = hypotheses.widened(problem, search.swept, minima.progress)?;
                minima.try_out(maps.into_iter().take(2 * search.candidates), false)?;
            }
            minima.finish(hypotheses.four)?;
            minima.move_landmarks()?;
            minima.into_found()?
        }
        Strategy::Search(search) => {
            let mut minima = Minima::new(problem, &options.refine, &mut progress);
            let candidates = maps.take(search.candidates);
            let beyond_doubt = minima.try_out(candidates, true)? || minima.finish(false)?;
            if !beyond_doubt && search.swept > 0 {
                let maps = hypotheses.widened(problem, search.swept, minima.progress)?;
                let candidates = maps.into_iter().take(2 * search.candidates);
                if !minima.try_out(candidates, true)? {
                    minima.finish(false)?;
                }
            }
            minima.move_landmarks()?;
            minima.into_found()?
        }
    };
    let mut best = choose(problem, found)?;
    take_out_unbounded(problem, &mut best);
    for rival in &mut best.alternatives {
        take_out_unbounded(problem, rival);
    }
    Ok(best)
}

/// Fills in sensitivity and uncertainty.
pub(super) fn assess(problem: &Problem, found: &mut Reconstruction) {
    found.sensitivity = sensitivity(problem, &found.map);
    if found.freedom > 0 {
        let variance = 2.0 * found.cost / (found.freedom as f64);
        found.uncertainty = found.sensitivity * variance.sqrt();
    }
}

/// Tests the best map for directions that the bearings leave free.
fn judge(problem: &Problem, mut best: Reconstruction) -> Result<Reconstruction, Error> {
    assess(problem, &mut best);
    refuse_free(problem, &best)?;
    Ok(best)
}

/// Refuses a map that exact bearings leave free in a direction.
///
/// Odometry and priors may hold what bearings do not, however loosely beside them: with these it is
/// `diagnose` and the covariance that tell.
pub(super) fn refuse_free(problem: &Problem, best: &Reconstruction) -> Result<(), Error> {
    if !problem.ties().is_empty() {
        return Ok(());
    }
    // Beyond this the number is rounding itself.
    let bound = 1.0 / (8.0 * f64::EPSILON.sqrt());
    let per_radian = best.sensitivity * mean_weight(problem);
    // Bearings that are explained to rounding leave no doubt that the geometry is at fault; with noise
    // the uncertainty says so.
    if !(per_radian < bound) && best.rms < f64::EPSILON.sqrt() {
        return Err(Error::Degenerate {
            quantity: "sensitivity of the map to bearing noise, in map sizes per radian,",
            value: per_radian,
            bound,
        });
    }
    Ok(())
}

/// Root mean square of one over sigma.
fn mean_weight(problem: &Problem) -> f64 {
    let sightings = problem.sightings();
    let sum = sightings
        .iter()
        .fold(0.0, |sum, s| sum + s.weight * s.weight);
    (sum / (sightings.len() as f64)).sqrt()
}

/// First maps, by the strategy of the options.
fn hypotheses(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Hypotheses, Error> {
    match options.strategy {
        Strategy::FirstViews(method) => Ok(Hypotheses::of(paper::follow(problem, method)?)),
        Strategy::Search(search) => search::search(problem, search, options.seed, progress),
        // Their own paths have found no triple to start from.
        Strategy::Incremental | Strategy::Global => Err(sight::no_map(problem)),
    }
}

/// The best of some reconstructions, with the rivals that explain the data nearly as well.
fn choose(problem: &Problem, mut found: Vec<Reconstruction>) -> Result<Reconstruction, Error> {
    // Per degree of freedom, for maps need not explain the same sightings.
    let variance = |found: &Reconstruction| found.cost / found.freedom.max(1) as f64;
    let least = found.iter().map(variance).fold(f64::INFINITY, f64::min);
    let tiny = f64::EPSILON * (mean_weight(problem) * mean_weight(problem));
    // Of those that fit about as well as the best, the one that reaches most.
    let rank = |found: &Reconstruction| {
        let variance = variance(found);
        let fits = variance <= least * AS_GOOD + tiny;
        (!fits, if fits { missing(found) } else { 0 }, variance)
    };
    found.sort_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2))
    });
    let mut found = found.into_iter();
    let mut best = found.next().ok_or(Error::Degenerate {
        quantity: "number of hypotheses that could be refined",
        value: 0.0,
        bound: 1.0,
    })?;
    let bound = variance(&best) * AS_GOOD + tiny;
    for rival in found {
        let known = core::iter::once(&best).chain(&best.alternatives);
        if variance(&rival) <= bound
            && missing(&rival) == missing(&best)
            && known.into_iter().all(|other| !same(&rival.map, &other.map))
        {
            best.alternatives.push(rival);
        }
    }
    Ok(best)
}

/// Views and landmarks that a map does not reach.
fn missing(found: &Reconstruction) -> usize {
    found.undetermined.len()
}

/// A map fits about as well as another, and is a rival of it, when its cost per degree of freedom is at
/// most this many times the other's: three times the residuals.
const AS_GOOD: f64 = 9.0;
