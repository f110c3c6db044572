// SPDX-License-Identifier: MIT OR Apache-2.0
//! From bearings to the best map: hypotheses, refinement, choice.

use super::expand::{grow, score};
use super::four;
use super::paper;
use super::result::Reconstruction;
use super::triples::{self, Sight, common_bearings};
use crate::error::Error;
use crate::estimation::{
    Map, Problem, RefineOptions, Report, Termination, refine_map, sensitivity,
};
use crate::kernels::{CalibratedTensor, Method, three_view};
use crate::scalar::Real;
use alloc::vec::Vec;

/// How a first map is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// Many triples of views, both branches of each; the best few refined.
    Search(Search),
    /// The paper's path from the first three views, with its own or the calibrated tensor.
    FirstViews(Method),
}

/// How wide a search is.
///
/// The defaults are the cheapest rule that found the best known minimum in every scene of the
/// paper's sizes that was tried (`docs/accuracy.md`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Search {
    /// Triples of views whose tensor is estimated.
    pub triples: usize,
    /// The best conditioned of them, which are grown to whole maps, both branches.
    pub grown: usize,
    /// Most maps that are refined; two that end in the same minimum are enough.
    pub candidates: usize,
}

impl Default for Search {
    fn default() -> Self {
        Self {
            triples: 24,
            grown: 6,
            candidates: 6,
        }
    }
}

/// Options of [`solve`] and [`initialize`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveOptions<T: Real> {
    /// How a first map is found.
    pub strategy: Strategy,
    /// Options of the refinement.
    pub refine: RefineOptions<T>,
    /// Seed of the draw of triples: the same seed gives the same bits.
    pub seed: u64,
}

impl<T: Real> Default for SolveOptions<T> {
    fn default() -> Self {
        Self {
            strategy: Strategy::Search(Search::default()),
            refine: RefineOptions::default(),
            seed: 0,
        }
    }
}

/// Fewest landmarks that three views must share to start a map, and with a fourth view to help.
const MIN_SHARED: usize = 5;
const MIN_SHARED_WITH_FOURTH: usize = 4;

/// Called now and then with the stage, the steps done and their number; `false` stops the work.
pub type Progress<'a> = &'a mut dyn FnMut(&'static str, usize, usize) -> bool;

/// Linear maps without refinement, best first: the winner carries the rest as alternatives.
pub fn initialize<T: Real>(
    problem: &Problem<T>,
    options: &SolveOptions<T>,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction<T>, Error> {
    let mut progress = progress;
    let hypotheses = hypotheses(problem, options, &mut progress)?;
    let judged = hypotheses.maps.into_iter().take(2).map(|mut map| {
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
    let report = refine_map(
        problem,
        &mut map,
        options,
        Some(&mut |done, _| tell(&mut progress, "refine", done, total)),
    )?;
    Ok(Reconstruction::new(problem, &map, report))
}

fn tell(progress: &mut Option<Progress<'_>>, stage: &'static str, done: usize, all: usize) -> bool {
    progress
        .as_mut()
        .is_none_or(|progress| progress(stage, done, all))
}

/// Poses and landmarks from bearings alone.
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
        let report = refine_map(
            problem,
            &mut map,
            &options.refine,
            Some(&mut |_, _| tell(&mut progress, "refine", done, total)),
        );
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
    let mut best = choose(refined)?;
    best.sensitivity = sensitivity(problem, &best.map);
    let bound = 1.0 / (8.0 * T::eps().as_f64().sqrt());
    let per_radian = best.sensitivity * mean_weight(problem);
    // Bearings that are explained to rounding leave no doubt that the geometry is at fault; with noise
    // the uncertainty says so.
    if !(per_radian < bound) && best.rms < T::eps().sqrt() {
        return Err(Error::Degenerate {
            quantity: "relative error of the map per radian of bearing noise",
            value: per_radian,
            bound,
        });
    }
    let freedom = freedom(problem, &best.map);
    if freedom > 0 {
        best.uncertainty = best.sensitivity * (2.0 * best.cost.as_f64() / freedom as f64).sqrt();
    }
    Ok(best)
}

/// Root mean square of one over sigma.
fn mean_weight<T: Real>(problem: &Problem<T>) -> f64 {
    let sum = problem
        .sightings()
        .iter()
        .fold(0.0, |sum, s| sum + s.weight.as_f64() * s.weight.as_f64());
    (sum / problem.sightings().len() as f64).sqrt()
}

/// Sightings less parameters.
fn freedom<T: Real>(problem: &Problem<T>, map: &Map<T>) -> usize {
    let views = map.poses.iter().flatten().count();
    let landmarks = map.landmarks.iter().flatten().count();
    let sightings = map.residuals(problem).flatten().count();
    (sightings + 4).saturating_sub(3 * views + 2 * landmarks)
}

/// First maps.
struct Hypotheses<T: Real> {
    /// Best first.
    maps: Vec<Map<T>>,
    /// Whether the problem has one solution in general: more than three views, more than four
    /// landmarks. Then two hypotheses that end in the same minimum confirm each other.
    unique: bool,
}

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
        Strategy::Search(search) => self::search(problem, search, options.seed, progress),
    }
}

/// Maps grown from many triples of views, the best score first.
fn search<T: Real>(
    problem: &Problem<T>,
    search: Search,
    seed: u64,
    progress: &mut Option<Progress<'_>>,
) -> Result<Hypotheses<T>, Error> {
    if problem.views() < 3 {
        return Err(Error::TooFew {
            what: "views",
            needed: 3,
            got: problem.views(),
        });
    }
    let drawn = triples::draw(problem, MIN_SHARED, search.triples, seed);
    let mut failure = None;
    let mut seeds = Vec::with_capacity(drawn.len());
    for (done, &views) in drawn.iter().enumerate() {
        if !tell(progress, "search", done, drawn.len()) {
            return Err(Error::Interrupted);
        }
        let (triples, _) = common_bearings(problem, views);
        match CalibratedTensor::estimate(&triples, 0) {
            Ok(tensor) => seeds.push((tensor.quality().as_f64(), triples, views)),
            Err(error) => failure = Some(error),
        }
    }
    seeds.sort_by(|a, b| b.0.total_cmp(&a.0));
    seeds.truncate(search.grown);
    let mut scored: Vec<(f64, Map<T>)> = Vec::new();
    for (_, triples, views) in seeds {
        match three_view(&triples, Method::Calibrated { reweights: 1 }) {
            Err(error) => failure = Some(error),
            Ok(solution) => {
                let [first, second] = &solution.motions;
                let margin = 1 + triples.len() / 8;
                let rivals = second.inconsistent <= first.inconsistent + margin;
                for motion in solution.motions.iter().take(1 + usize::from(rivals)) {
                    let mut map = Map::empty(problem.views(), problem.landmarks());
                    for (&view, pose) in views.iter().zip(motion.poses) {
                        map.poses[view] = Some(pose);
                    }
                    grow(problem, &mut map);
                    scored.push((score(problem, &map).as_f64(), map));
                }
            }
        }
    }
    let four = drawn.is_empty() && problem.views() > 3;
    if four {
        let count = search.triples.min(MAX_SWEEPS);
        let drawn = triples::draw(problem, MIN_SHARED_WITH_FOURTH, count, seed);
        for (done, &views) in drawn.iter().enumerate() {
            if !tell(progress, "search", done, drawn.len()) {
                return Err(Error::Interrupted);
            }
            scored.extend(
                four::sweep(problem, views)
                    .into_iter()
                    .map(|(score, map)| (score.as_f64(), map)),
            );
        }
    }
    if scored.is_empty() {
        return Err(failure.unwrap_or_else(|| too_few_shared(problem)));
    }
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let maps: Vec<Map<T>> = scored.into_iter().map(|(_, map)| map).collect();
    Ok(Hypotheses {
        maps: if four { distinct(maps) } else { maps },
        unique: !four && problem.views() > 3,
    })
}

/// What to say when no three views share enough landmarks.
fn too_few_shared<T: Real>(problem: &Problem<T>) -> Error {
    let views = problem.views();
    let sight = Sight::new(problem);
    let mut most = 0;
    for i in 0..views.min(60) {
        for j in i + 1..views.min(60) {
            for k in j + 1..views.min(60) {
                most = most.max(sight.common([i, j, k]));
            }
        }
    }
    Error::TooFew {
        what: "landmarks seen by the same three views",
        needed: if views > 3 {
            MIN_SHARED_WITH_FOURTH
        } else {
            MIN_SHARED
        },
        got: most,
    }
}

/// The first of each cluster of maps, up to [`MAX_DISTINCT`].
fn distinct<T: Real>(maps: Vec<Map<T>>) -> Vec<Map<T>> {
    let mut found: Vec<(Map<T>, Map<T>)> = Vec::new();
    for map in maps {
        let normalized = map.normalized();
        if found
            .iter()
            .all(|(_, other)| !near(&normalized, other, T::lit(CLUSTER)))
        {
            found.push((map, normalized));
            if found.len() == MAX_DISTINCT {
                break;
            }
        }
    }
    found.into_iter().map(|(map, _)| map).collect()
}

/// Most triples of views that are swept for four landmarks: any one finds all minima it can see.
const MAX_SWEEPS: usize = 4;

/// Two hypotheses closer than this (positions over the size of the map, headings in radians) end in
/// the same minimum.
const CLUSTER: f64 = 0.05;

/// Most hypotheses that are refined for a problem with four landmarks.
const MAX_DISTINCT: usize = 60;

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
    near(a, b, T::lit(1e-3))
}

/// Whether all poses of two normalised maps differ by less than a bound.
fn near<T: Real>(a: &Map<T>, b: &Map<T>, near: T) -> bool {
    a.poses.iter().zip(&b.poses).all(|(a, b)| match (a, b) {
        (Some(a), Some(b)) => {
            (a.translation.vector - b.translation.vector).norm() < near
                && a.rotation.angle_to(&b.rotation).abs() < near
        }
        (None, None) => true,
        _ => false,
    })
}
