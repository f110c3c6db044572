// SPDX-License-Identifier: MIT OR Apache-2.0
//! From a rough map to a fixed point of the bounded cost.
//!
//! Refinement and choice of the inliers in turn never raise the cost; they end where the inliers of the
//! refined map are those that it was refined to.

use super::super::judge::same;
use super::super::result::Reconstruction;
use super::objective::{OUTLIER, cost, inliers};
use crate::adjustment::{Report, refine_map};
use crate::error::Error;
use crate::lm::{Loss, RefineOptions};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// Bounds, in standard deviations, on the way from a growing map to the final one.
const NARROWING: [f64; 2] = [6.0, 4.0];

/// Iterations of refinement at each of them.
pub const ITERATIONS: usize = 4;

/// Most changes of the set of inliers. Each lowers the cost, so they end by themselves, after two or
/// three as a rule.
const CHANGES: usize = 30;

/// A cost is lower when it is by more than this part: the tolerance of the refinement and more.
const LOWER: f64 = 1.0 - 1e-9;

/// A map at a fixed point: the refinement of its inliers.
#[derive(Clone)]
pub struct Settled {
    pub map: Map,
    pub inliers: Vec<bool>,
    /// Half the sum of squares, those of outliers bounded.
    pub cost: f64,
    pub report: Report,
}

/// Refines what a map explains to within `bound`. Views and landmarks that this leaves without enough
/// sightings are dropped.
///
/// A map that cannot be refined stays as it is.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`] of the refinement.
pub fn descend(
    problem: &Problem,
    map: &mut Map,
    bound: f64,
    iterations: usize,
    options: &RefineOptions,
) -> Result<(), Error> {
    let kept = problem.subset(&inliers(problem, map, bound));
    refined(&kept, map, iterations, options).map(|_| ())
}

/// Refines a map; `None` when it cannot be.
fn refined(
    problem: &Problem,
    map: &mut Map,
    iterations: usize,
    options: &RefineOptions,
) -> Result<Option<Report>, Error> {
    let options = RefineOptions {
        max_iterations: options.max_iterations.min(iterations),
        ..*options
    };
    match refine_map(problem, map, &options, None) {
        Ok(report) => Ok(Some(report)),
        Err(error) if error.stops_all() => Err(error),
        Err(_) => Ok(None),
    }
}

/// The fixed point that a set of inliers leads to.
///
/// `None` when they do not hold a map.
///
/// # Errors
/// As [`descend`].
pub fn fixed_point(
    problem: &Problem,
    mut map: Map,
    mut kept: Vec<bool>,
    options: &RefineOptions,
) -> Result<Option<Settled>, Error> {
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
pub fn settle(
    problem: &Problem,
    mut map: Map,
    options: &RefineOptions,
) -> Result<Option<Settled>, Error> {
    for bound in NARROWING {
        descend(problem, &mut map, bound, ITERATIONS, options)?;
    }
    let kept = inliers(problem, &map, OUTLIER);
    fixed_point(problem, map, kept, options)
}

impl Settled {
    /// The result of a plain solve of the inliers of its map.
    pub fn of(problem: &Problem, found: Reconstruction) -> Self {
        Self {
            inliers: inliers(problem, &found.map, OUTLIER),
            cost: cost(problem, &found.map, OUTLIER),
            report: Report {
                cost: found.cost,
                termination: found.termination,
                iterations: found.iterations,
                undetermined: found.undetermined,
                loss: Loss::Squared,
            },
            map: found.map,
        }
    }

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

    /// Whether it costs less than another by more than the tolerance of the refinement.
    pub fn is_below(&self, other: &Self) -> bool {
        self.cost < other.cost * LOWER
    }

    /// Whether two fixed points are one.
    pub fn is_same(&self, other: &Self) -> bool {
        self.inliers == other.inliers && same(&self.map.normalized(), &other.map.normalized())
    }
}
