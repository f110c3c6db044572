// SPDX-License-Identifier: MIT OR Apache-2.0
//! From bearings to the best map: hypotheses, refinement, choice.

use super::options::{Progress, SolveOptions, Strategy, tell};
use super::paper;
use super::result::Reconstruction;
use super::search::{self, Hypotheses, near};
use crate::error::Error;
use crate::estimation::{
    Map, Problem, RefineOptions, Report, Subject, Termination, Watch, Why, refine_map, sensitivity,
    unbounded_landmarks,
};
use crate::scalar::Real;
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
pub fn initialize<T: Real>(
    problem: &Problem<T>,
    options: &SolveOptions<T>,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction<T>, Error> {
    let mut progress = progress;
    let hypotheses = hypotheses(problem, options, &mut progress)?;
    let count = match options.strategy {
        Strategy::Search(_) => 2,
        Strategy::FirstViews(_) => 1,
    };
    let judged = hypotheses.maps.into_iter().take(count).map(|mut map| {
        let undetermined = map.prune(problem);
        let cost = cost(problem, &map);
        Reconstruction::new(
            problem,
            &map,
            Report {
                cost,
                termination: Termination::NotRefined,
                iterations: 0,
                undetermined,
            },
        )
    });
    choose(judged.collect())
}

/// Half the sum of squared residuals over sigma.
fn cost<T: Real>(problem: &Problem<T>, map: &Map<T>) -> T {
    problem
        .sightings()
        .iter()
        .zip(map.residuals(problem))
        .filter_map(|(s, residual)| residual.map(|r| r * s.weight))
        .fold(T::zero(), |sum, r| sum + r * r)
        * T::lit(0.5)
}

/// Refines a start: one map, no search.
///
/// Places of the start that are `None`, or that its other places do not fix, stay undetermined. The
/// result is in the gauge of [`solve`]. For repeated calls without the judgement of the result there
/// is [`refine_map`](crate::refine_map).
///
/// # Errors
/// As [`refine_map`](crate::refine_map).
pub fn refine<T: Real>(
    problem: &Problem<T>,
    start: &Map<T>,
    options: &RefineOptions<T>,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction<T>, Error> {
    let mut progress = progress;
    let mut map = start.clone();
    let total = options.max_iterations;
    let report = refine_bounded(problem, &mut map, options, &mut |done, _| {
        tell(&mut progress, "refine", done, total)
    })?;
    Ok(Reconstruction::new(problem, &map, report))
}

/// Refines a map, takes out landmarks that have gone to infinity, and refines what is left.
fn refine_bounded<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    options: &RefineOptions<T>,
    watch: Watch<'_>,
) -> Result<Report<T>, Error> {
    let mut report = refine_map(problem, map, options, Some(&mut *watch))?;
    let mut dropped = Vec::new();
    for _ in 0..MAX_ROUNDS {
        let freedom = freedom(problem, map);
        if freedom == 0 {
            break;
        }
        let variance = T::lit(2.0) * report.cost / T::lit(freedom as f64);
        let unbounded = unbounded_landmarks(problem, map, variance);
        if unbounded.is_empty() {
            break;
        }
        for &landmark in &unbounded {
            map.landmarks[landmark] = None;
        }
        dropped.extend(unbounded.into_iter().map(Subject::Landmark));
        let iterations = report.iterations;
        report = refine_map(problem, map, options, Some(&mut *watch))?;
        report.iterations += iterations;
    }
    for undetermined in &mut report.undetermined {
        if dropped.contains(&undetermined.subject) {
            undetermined.why = Why::AtInfinity;
        }
    }
    Ok(report)
}

/// Most times that landmarks are taken out; a map without them seldom sends others away.
const MAX_ROUNDS: usize = 4;

/// Poses and landmarks from bearings alone: no odometry, no guess.
///
/// Triples of views give hypotheses in closed form, both branches of each; the best conditioned are
/// grown to whole maps by resection and triangulation and scored by a robust cost over all bearings;
/// the best are refined until two end in the same minimum; the lowest is returned, with the rivals
/// that explain the bearings nearly as well (the mirror branch of three views, the several exact maps
/// of four landmarks).
///
/// The first determined view is at the origin with heading 0 and the root-mean-square distance of the
/// other views from it is 1. Views and landmarks that the bearings do not determine are `None` and
/// listed with the reason.
///
/// # Errors
/// [`Error::TooFew`] below three views or when no three views share five landmarks (four, where there
/// is a fourth view); [`Error::Degenerate`] when no triple has a solution (all landmarks along one
/// wall, views in one place) or exact bearings leave a direction of the map free;
/// [`Error::TooLarge`] as [`refine_map`](crate::refine_map); [`Error::Interrupted`] when `progress`
/// says so. With noise a degenerate geometry shows in
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
pub fn solve<T: Real>(
    problem: &Problem<T>,
    options: &SolveOptions<T>,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction<T>, Error> {
    let mut progress = progress;
    let Hypotheses { maps, unique } = hypotheses(problem, options, &mut progress)?;
    let candidates = match options.strategy {
        Strategy::Search(search) if unique => search.candidates,
        // Every minimum counts where there may be several exact ones.
        Strategy::Search(_) => maps.len(),
        Strategy::FirstViews(_) => 1,
    };
    let total = candidates.min(maps.len());
    let mut refined: Vec<Reconstruction<T>> = Vec::with_capacity(total);
    for (done, mut map) in maps.into_iter().take(candidates).enumerate() {
        let report = refine_bounded(problem, &mut map, &options.refine, &mut |_, _| {
            tell(&mut progress, "refine", done, total)
        });
        match report {
            Ok(report) => {
                let found = Reconstruction::new(problem, &map, report);
                let confirmed = unique
                    && refined
                        .iter()
                        .all(|other| other.cost >= found.cost * T::lit(SAME_COST))
                    && refined.iter().any(|other| same(&other.map, &found.map));
                refined.push(found);
                if confirmed {
                    break;
                }
            }
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            // A hypothesis that cannot even be refined is none.
            Err(_) => {}
        }
    }
    judge(problem, choose(refined)?)
}

/// Tests the best map for directions that the bearings leave free.
fn judge<T: Real>(
    problem: &Problem<T>,
    mut best: Reconstruction<T>,
) -> Result<Reconstruction<T>, Error> {
    best.sensitivity = sensitivity(problem, &best.map);
    // Beyond this the number is rounding itself.
    let bound = 1.0 / (8.0 * T::eps().sqrt().as_f64());
    let per_radian = best.sensitivity * mean_weight(problem);
    // Bearings that are explained to rounding leave no doubt that the geometry is at fault; with noise
    // the uncertainty says so.
    if !(per_radian < bound) && best.rms < T::eps().sqrt() {
        return Err(Error::Degenerate {
            quantity: "sensitivity of the map to bearing noise, in map sizes per radian,",
            value: per_radian,
            bound,
        });
    }
    let freedom = freedom(problem, &best.map);
    if freedom > 0 {
        let variance = T::lit(2.0) * best.cost / T::lit(freedom as f64);
        best.uncertainty = best.sensitivity * variance.sqrt().as_f64();
    }
    Ok(best)
}

/// Root mean square of one over sigma.
fn mean_weight<T: Real>(problem: &Problem<T>) -> f64 {
    let sightings = problem.sightings();
    let sum = sightings
        .iter()
        .fold(T::zero(), |sum, s| sum + s.weight * s.weight);
    (sum / T::lit(sightings.len() as f64)).sqrt().as_f64()
}

/// Sightings less parameters.
fn freedom<T: Real>(problem: &Problem<T>, map: &Map<T>) -> usize {
    let views = map.poses.iter().flatten().count();
    let landmarks = map.landmarks.iter().flatten().count();
    let sightings = map.residuals(problem).flatten().count();
    (sightings + 4).saturating_sub(3 * views + 2 * landmarks)
}

/// First maps, by the strategy of the options.
fn hypotheses<T: Real>(
    problem: &Problem<T>,
    options: &SolveOptions<T>,
    progress: &mut Option<Progress<'_>>,
) -> Result<Hypotheses<T>, Error> {
    match options.strategy {
        Strategy::FirstViews(method) => Ok(Hypotheses {
            maps: paper::follow(problem, method)?.into(),
            unique: false,
        }),
        Strategy::Search(search) => search::search(problem, search, options.seed, progress),
    }
}

/// The best of some reconstructions, with the rivals that explain the data nearly as well.
fn choose<T: Real>(mut found: Vec<Reconstruction<T>>) -> Result<Reconstruction<T>, Error> {
    // Those that reach more come first: a cost over fewer sightings is no merit.
    found.sort_by(|a, b| {
        let missing = a.undetermined.len().cmp(&b.undetermined.len());
        missing.then(a.cost.as_f64().total_cmp(&b.cost.as_f64()))
    });
    let mut found = found.into_iter();
    let mut best = found.next().ok_or(Error::Degenerate {
        quantity: "number of hypotheses that could be refined",
        value: 0.0,
        bound: 1.0,
    })?;
    let bound = (best.rms * T::lit(RIVAL_RMS)).max(T::eps().sqrt());
    for rival in found {
        let known = core::iter::once(&best).chain(&best.alternatives);
        if rival.rms <= bound
            && rival.undetermined.len() == best.undetermined.len()
            && known.into_iter().all(|other| !same(&rival.map, &other.map))
        {
            best.alternatives.push(rival);
        }
    }
    Ok(best)
}

/// A rival is returned when its residuals are at most this many times those of the winner.
const RIVAL_RMS: f64 = 3.0;

/// Costs whose ratio is closer to 1 than this are those of one minimum.
const SAME_COST: f64 = 1.0 - 1e-6;

/// Whether two normalised maps are the same minimum.
fn same<T: Real>(a: &Map<T>, b: &Map<T>) -> bool {
    near(a, b, T::lit(1e-4).max(T::eps().sqrt()))
}
