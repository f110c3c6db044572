// SPDX-License-Identifier: MIT OR Apache-2.0
//! From a rough map to a minimum of the bounded cost.
//!
//! Refinement and choice of the inliers in turn never raise the cost: it is the usual way down. It ends
//! in a fixed point, of which there are many; so views, landmarks and single sightings are then tried
//! otherwise, one at a time.

use super::objective::{OUTLIER, cost, inliers};
use super::place::{Placed, place_landmark, place_view};
use crate::error::Error;
use crate::estimation::{Influence, Map, Problem, RefineOptions, Report, Termination, refine_map};
use crate::scalar::Real;
use alloc::vec::Vec;
use rand_chacha::ChaCha8Rng;

/// Bounds, in standard deviations, on the way from a growing map to the final one.
const NARROWING: [f64; 2] = [6.0, 4.0];

/// Iterations of refinement at each of them.
const ITERATIONS: usize = 4;

/// Most changes of the set of inliers: each lowers the cost, so they end by themselves.
const CHANGES: usize = 30;

/// Most rounds of moving views and landmarks, and of changing single sightings.
const ROUNDS: usize = 10;

/// A sighting is tried on the other side of the bound when that is foreseen to raise twice the cost by
/// no more than this, which is within the error of the forecast; and so many of them at a time.
const PROMISING: f64 = 4.0;
const TRIED: usize = 16;
const EXCHANGES: usize = 20;

/// Bounds within which views and landmarks are placed anew, how many places of each are looked at, by
/// how many outliers they may be worse as long as nothing else moves, and how many are tried.
const RELOCATING: [f64; 3] = [3.0, 6.0, 9.0];
const PLACES: usize = 4;
const WORSE: f64 = 2.0;
const RELOCATED: usize = 24;

/// A cost is lower when it is by more than this part.
const LOWER: f64 = 1.0 - 1e-9;

/// A map at a fixed point: the refinement of its inliers.
#[derive(Clone)]
pub struct Settled<T: Real> {
    pub map: Map<T>,
    pub inliers: Vec<bool>,
    /// Half the sum of squares, those of outliers bounded.
    pub cost: T,
    pub report: Report<T>,
}

/// Refines what a map explains to within `bound`. Views and landmarks that this leaves without enough
/// sightings are dropped.
///
/// A map that cannot be refined stays as it is.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::TooLarge`] of the refinement.
pub fn descend<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    bound: f64,
    iterations: usize,
    options: &RefineOptions<T>,
) -> Result<(), Error> {
    let kept = problem.subset(&inliers(problem, map, bound));
    refined(&kept, map, iterations, options).map(|_| ())
}

/// Refines a map; `None` when it cannot be.
fn refined<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    iterations: usize,
    options: &RefineOptions<T>,
) -> Result<Option<Report<T>>, Error> {
    let options = RefineOptions {
        max_iterations: options.max_iterations.min(iterations),
        ..*options
    };
    match refine_map(problem, map, &options, None) {
        Ok(report) => Ok(Some(report)),
        Err(error @ (Error::Interrupted | Error::TooLarge { .. })) => Err(error),
        Err(_) => Ok(None),
    }
}

/// The fixed point that a set of inliers leads to.
///
/// `None` when they do not hold a map.
///
/// # Errors
/// As [`descend`].
fn fixed_point<T: Real>(
    problem: &Problem<T>,
    mut map: Map<T>,
    mut kept: Vec<bool>,
    options: &RefineOptions<T>,
) -> Result<Option<Settled<T>>, Error> {
    for _ in 0..CHANGES {
        let subset = problem.subset(&kept);
        let Some(report) = refined(&subset, &mut map, usize::MAX, options)? else {
            return Ok(None);
        };
        let next = inliers(problem, &map, OUTLIER);
        if next == kept {
            return Ok(Some(Settled {
                cost: cost(problem, &map, OUTLIER),
                map,
                inliers: kept,
                report,
            }));
        }
        kept = next;
    }
    Ok(None)
}

/// The fixed point near a rough map.
///
/// # Errors
/// As [`descend`].
pub fn settle<T: Real>(
    problem: &Problem<T>,
    mut map: Map<T>,
    options: &RefineOptions<T>,
) -> Result<Option<Settled<T>>, Error> {
    for bound in NARROWING {
        descend(problem, &mut map, bound, ITERATIONS, options)?;
    }
    let kept = inliers(problem, &map, OUTLIER);
    fixed_point(problem, map, kept, options)
}

/// Moves views and landmarks to where more agrees with them, as long as that lowers the cost.
///
/// # Errors
/// As [`descend`].
pub fn replace<T: Real>(
    problem: &Problem<T>,
    mut best: Settled<T>,
    options: &RefineOptions<T>,
    random: &mut ChaCha8Rng,
) -> Result<Settled<T>, Error> {
    for _ in 0..ROUNDS {
        let mut map = best.map.clone();
        for view in 0..problem.views() {
            if let Some(placed) = place_view(problem, &map, view, OUTLIER, 1, random).first() {
                map.poses[view] = Some(placed.place);
            }
        }
        for landmark in 0..problem.landmarks() {
            if let Some(placed) =
                place_landmark(problem, &map, landmark, OUTLIER, 1, random).first()
            {
                map.landmarks[landmark] = Some(placed.place);
            }
        }
        let kept = inliers(problem, &map, OUTLIER);
        if kept == best.inliers {
            break;
        }
        match fixed_point(problem, map, kept, options)? {
            Some(found) if found.cost < best.cost * T::lit(LOWER) => best = found,
            _ => break,
        }
    }
    Ok(best)
}

/// Changes single sightings from inlier to outlier or back, as long as that lowers the cost.
///
/// The residual that a sighting would have on the other side follows from its leverage, (T25); those
/// that promise most are tried.
///
/// # Errors
/// As [`descend`].
pub fn exchange<T: Real>(
    problem: &Problem<T>,
    mut best: Settled<T>,
    options: &RefineOptions<T>,
) -> Result<Settled<T>, Error> {
    for _ in 0..EXCHANGES {
        let mut lower = None;
        for set in promising(problem, &best) {
            let mut kept = best.inliers.clone();
            for k in set {
                kept[k] = !kept[k];
            }
            lower = fixed_point(problem, best.map.clone(), kept, options)?
                .filter(|found| found.cost < best.cost * T::lit(LOWER));
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

/// Sets of sightings, one or two, whose change of sides may lower the cost; the most promising first.
fn promising<T: Real>(problem: &Problem<T>, best: &Settled<T>) -> Vec<Vec<usize>> {
    let Some(influence) = Influence::new(problem, &best.map, &best.inliers) else {
        return Vec::new();
    };
    let most = T::lit(OUTLIER * OUTLIER);
    // Adding has the sign 1, leaving out -1.
    let sign = |k: usize| if best.inliers[k] { -T::one() } else { T::one() };
    let change = |sign: T, residual: T, leverage: T| {
        let spread = (T::one() + sign * leverage).max(T::eps());
        sign * (residual * residual / spread - most)
    };
    let single: Vec<(usize, T, T, T)> = influence
        .residuals
        .iter()
        .enumerate()
        .filter_map(|(k, residual)| {
            let (residual, leverage) = ((*residual)?, influence.between(k, k));
            Some((k, residual, leverage, change(sign(k), residual, leverage)))
        })
        .collect();
    let worth = T::lit(PROMISING);
    let mut found: Vec<(f64, Vec<usize>)> = Vec::new();
    for &(k, residual, leverage, alone) in &single {
        if alone < worth {
            found.push((alone.as_f64(), alloc::vec![k]));
        }
        // An inlier can only be missed by what it costs as an outlier; others may be anything.
        if alone > most {
            continue;
        }
        let spread = (T::one() + sign(k) * leverage).max(T::eps());
        for &(l, other, other_leverage, _) in &single {
            if l == k || best.inliers[l] {
                continue;
            }
            let tie = influence.between(k, l) * sign(k) / spread;
            let residual_then = other - tie * residual;
            let leverage_then = other_leverage - tie * influence.between(k, l);
            let both = alone + change(T::one(), residual_then, leverage_then);
            if both < worth && both < alone {
                found.push((both.as_f64(), alloc::vec![k, l]));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(TRIED);
    found.into_iter().map(|(_, set)| set).collect()
}

/// Puts single views and landmarks in other places and follows the map from there, as long as that
/// lowers the cost.
///
/// # Errors
/// As [`descend`].
pub fn relocate<T: Real>(
    problem: &Problem<T>,
    mut best: Settled<T>,
    options: &RefineOptions<T>,
    random: &mut ChaCha8Rng,
) -> Result<Settled<T>, Error> {
    for _ in 0..ROUNDS {
        let mut lower = None;
        for (bound, mut map) in relocated(problem, &best.map, random) {
            descend(problem, &mut map, bound, ITERATIONS, options)?;
            lower = settle(problem, map, options)?
                .filter(|found| found.cost < best.cost * T::lit(LOWER));
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

/// Maps that differ from a map in the place of one view or landmark, and the bound within which other
/// sightings agree with it there; the most promising first.
fn relocated<T: Real>(
    problem: &Problem<T>,
    map: &Map<T>,
    random: &mut ChaCha8Rng,
) -> Vec<(f64, Map<T>)> {
    let mut found: Vec<(f64, f64, Map<T>)> = Vec::new();
    for bound in RELOCATING {
        let most = bound * bound;
        for view in 0..problem.views() {
            let places = place_view(problem, map, view, bound, PLACES, random);
            for (change, place) in others(places, map.poses[view].as_ref(), most) {
                let mut map = map.clone();
                map.poses[view] = Some(place);
                found.push((change, bound, map));
            }
        }
        for landmark in 0..problem.landmarks() {
            let places = place_landmark(problem, map, landmark, bound, PLACES, random);
            for (change, place) in others(places, map.landmarks[landmark].as_ref(), most) {
                let mut map = map.clone();
                map.landmarks[landmark] = Some(place);
                found.push((change, bound, map));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(RELOCATED);
    found
        .into_iter()
        .map(|(_, bound, map)| (bound, map))
        .collect()
}

/// Places other than the present one, and by how many outliers they are worse, if not by too many.
fn others<P: Copy + PartialEq, T: Real>(
    places: Vec<Placed<P, T>>,
    present: Option<&P>,
    most: f64,
) -> Vec<(f64, P)> {
    let cost = |placed: &Placed<P, T>| placed.cost.as_f64() / most;
    let now = places
        .iter()
        .find(|placed| Some(&placed.place) == present)
        .map_or_else(|| places.first().map_or(0.0, cost), cost);
    places
        .iter()
        .filter(|placed| Some(&placed.place) != present)
        .map(|placed| (cost(placed) - now, placed.place))
        .filter(|(change, _)| *change < WORSE)
        .collect()
}

impl<T: Real> Settled<T> {
    /// Whether two fixed points are nearly the same: of the sightings that one of them explains, so
    /// many in a hundred are explained by both.
    pub fn agrees(&self, other: &Self, percent: usize) -> bool {
        let (mut both, mut either) = (0, 0);
        for (&a, &b) in self.inliers.iter().zip(&other.inliers) {
            both += usize::from(a && b);
            either += usize::from(a || b);
        }
        100 * both >= percent * either
    }

    /// Whether the bearings are explained to rounding.
    pub fn is_exact(&self) -> bool {
        self.report.termination == Termination::ZeroResidual
    }
}
