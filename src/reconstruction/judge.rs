// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a minimum is worth: whether it is plausible, free in a direction, the same as another, and which of
//! several is the best.

use super::result::Reconstruction;
use crate::error::{Degeneracy, Error};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::Termination;
use crate::problem::{Map, Problem};
use crate::uncertainty::sensitivity;
use alloc::vec::Vec;

/// Fewest degrees of freedom for which the cost alone tells a right minimum.
const TELLING_FREEDOM: usize = 20;

/// Standard deviations of the cost by which that of the right minimum may differ from its mean.
const PLAUSIBLE: f64 = 3.0;

/// Costs whose ratio is closer to 1 than this are those of one minimum.
pub const SAME_COST: f64 = 1.0 - 1e-6;

/// Fills in sensitivity and uncertainty.
pub fn assess(problem: &Problem, found: &mut Reconstruction) {
    found.sensitivity = sensitivity(problem, &found.map);
    if found.freedom > 0 {
        let variance = 2.0 * found.cost / (found.freedom as f64);
        found.uncertainty = found.sensitivity * variance.sqrt();
    }
}

/// Fills in sensitivity and uncertainty of the best map and tests it for directions that the bearings leave free.
pub fn judged(problem: &Problem, mut best: Reconstruction) -> Result<Reconstruction, Error> {
    assess(problem, &mut best);
    refuse_free(problem, &best)?;
    Ok(best)
}

/// Refuses a map that exact bearings leave free in a direction.
///
/// Odometry and priors may hold what bearings do not, however loosely beside them: with these it is
/// `diagnose` and the covariance that tell.
pub fn refuse_free(problem: &Problem, best: &Reconstruction) -> Result<(), Error> {
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
            kind: Degeneracy::FreeMap,
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

/// Whether the cost of a minimum is what the standard deviations of the sightings let expect of the
/// right one, and no wrong one would come so low.
pub fn is_plausible(found: &Reconstruction) -> bool {
    let freedom = found.freedom as f64;
    let deviation = (2.0 * found.cost - freedom).abs();
    found.termination == Termination::ZeroResidual
        || (found.freedom >= TELLING_FREEDOM
            && found.undetermined.is_empty()
            && deviation * deviation <= PLAUSIBLE * PLAUSIBLE * 2.0 * freedom)
}

/// Whether two normalised maps are the same minimum.
pub fn same(a: &Map, b: &Map) -> bool {
    near(a, b, 1e-4_f64.max(f64::EPSILON.sqrt()))
}

/// Whether all poses of two normalised maps differ by less than a bound.
pub fn near(a: &Map, b: &Map, near: f64) -> bool {
    a.poses.iter().zip(&b.poses).all(|(a, b)| match (a, b) {
        (Some(a), Some(b)) => {
            (a.translation.vector - b.translation.vector).norm() < near
                && a.rotation.angle_to(&b.rotation).abs() < near
        }
        (None, None) => true,
        _ => false,
    })
}

/// The best of some reconstructions, with the rivals that explain the data nearly as well.
pub fn choose(problem: &Problem, mut found: Vec<Reconstruction>) -> Result<Reconstruction, Error> {
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
        kind: Degeneracy::NoHypothesis,
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
