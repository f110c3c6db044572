// SPDX-License-Identifier: MIT OR Apache-2.0
//! From a rough map to a minimum of the bounded cost.
//!
//! Refinement and choice of the inliers in turn never raise the cost: it is the usual way down. It ends
//! in a fixed point, of which there are many; so views, landmarks and single sightings are then tried
//! otherwise, one at a time.

use super::objective::{OUTLIER, cost, inliers, squares};
use super::place::{place_landmark, place_view};
use crate::error::Error;
use crate::estimation::{Map, Problem, RefineOptions, Report, Termination, refine_map};
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

/// A sighting is tried on the other side of the bound when it is so near, in standard deviations.
const NEAR: [f64; 2] = [1.5, 6.0];

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
            if let Some(placed) = place_view(problem, &map, view, OUTLIER, random) {
                map.poses[view] = Some(placed.place);
            }
        }
        for landmark in 0..problem.landmarks() {
            if let Some(placed) = place_landmark(problem, &map, landmark, OUTLIER, random) {
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

/// Tries sightings near the bound on its other side, as long as that lowers the cost.
///
/// # Errors
/// As [`descend`].
pub fn exchange<T: Real>(
    problem: &Problem<T>,
    mut best: Settled<T>,
    options: &RefineOptions<T>,
) -> Result<Settled<T>, Error> {
    let [low, high] = NEAR.map(|bound| bound * bound);
    for _ in 0..ROUNDS {
        let edge = OUTLIER * OUTLIER;
        let mut near: Vec<(f64, usize)> = squares(problem, &best.map)
            .enumerate()
            .filter_map(|(k, square)| Some((square?.as_f64(), k)))
            .filter(|(square, _)| (low..high).contains(square))
            .map(|(square, k)| ((square - edge).abs(), k))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut lower = false;
        for (_, k) in near {
            let mut kept = best.inliers.clone();
            kept[k] = !kept[k];
            if let Some(found) = fixed_point(problem, best.map.clone(), kept, options)?
                && found.cost < best.cost * T::lit(LOWER)
            {
                best = found;
                lower = true;
                break;
            }
        }
        if !lower {
            break;
        }
    }
    Ok(best)
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
