// SPDX-License-Identifier: MIT OR Apache-2.0
//! Refinement of a map whose landmarks may lie at infinity.

use super::expand::triangulate_one;
use crate::error::Error;
use crate::estimation::{
    Map, Problem, RefineOptions, Report, Subject, Termination, Watch, Why, refine_map,
    unbounded_landmarks,
};
use crate::scalar::Real;
use alloc::vec::Vec;

/// Refines a map, takes out landmarks that have gone to infinity, and refines what is left.
pub fn refine_bounded<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    options: &RefineOptions<T>,
    watch: Watch<'_>,
) -> Result<Report<T>, Error> {
    let mut report = refine_map(problem, map, options, Some(&mut *watch))?;
    let mut dropped = Vec::new();
    take_out(problem, map, options, watch, &mut report, &mut dropped)?;
    if restore(problem, map, &dropped, &report) {
        again(problem, map, options, watch, &mut report)?;
        take_out(problem, map, options, watch, &mut report, &mut dropped)?;
    }
    for undetermined in &mut report.undetermined {
        if let Subject::Landmark(landmark) = undetermined.subject
            && dropped.contains(&landmark)
        {
            undetermined.why = Why::AtInfinity;
        }
    }
    Ok(report)
}

/// Another refinement, its iterations added up.
fn again<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    options: &RefineOptions<T>,
    watch: Watch<'_>,
    report: &mut Report<T>,
) -> Result<(), Error> {
    let iterations = report.iterations;
    *report = refine_map(problem, map, options, Some(watch))?;
    report.iterations += iterations;
    Ok(())
}

/// Takes out landmarks of which only the direction is known, and refines, until there are none.
fn take_out<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    options: &RefineOptions<T>,
    watch: Watch<'_>,
    report: &mut Report<T>,
    dropped: &mut Vec<usize>,
) -> Result<(), Error> {
    for _ in 0..MAX_ROUNDS {
        // Exact bearings leave no noise to judge by, and a map that explains nothing is none.
        let freedom = freedom(problem, map);
        if freedom == 0
            || report.termination == Termination::ZeroResidual
            || rms(problem, map) > T::lit(PLAUSIBLE_RMS)
        {
            break;
        }
        let unbounded = unbounded_landmarks(problem, map, variance(report, freedom));
        let lost: usize = unbounded
            .iter()
            .map(|&landmark| problem.of_landmark(landmark).len().saturating_sub(2))
            .sum();
        // When their directions are needed what is left could not be checked: the uncertainty tells.
        if unbounded.is_empty() || lost >= freedom {
            break;
        }
        for &landmark in &unbounded {
            map.landmarks[landmark] = None;
        }
        dropped.extend(unbounded);
        again(problem, map, options, watch, report)?;
    }
    Ok(())
}

/// Triangulates landmarks that were taken out, for the views may have moved since; whether any is
/// within reach after all.
fn restore<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    dropped: &[usize],
    report: &Report<T>,
) -> bool {
    let variance = variance(report, freedom(problem, map).max(1));
    let mut restored = false;
    for &landmark in dropped {
        triangulate_one(problem, map, landmark);
        if unbounded_landmarks(problem, map, variance).contains(&landmark) {
            map.landmarks[landmark] = None;
        }
        restored |= map.landmarks[landmark].is_some();
    }
    restored
}

/// Residuals \[rad\] above which a map is taken for a wrong one, whose landmarks say nothing.
const PLAUSIBLE_RMS: f64 = 0.1;

/// Root mean square of the residuals \[rad\].
fn rms<T: Real>(problem: &Problem<T>, map: &Map<T>) -> T {
    let (mut sum, mut count) = (T::zero(), T::zero());
    for r in map.residuals(problem).flatten() {
        sum += r * r;
        count += T::one();
    }
    (sum / count.max(T::one())).sqrt()
}

/// Most times that landmarks are taken out; a map without them seldom sends others away.
const MAX_ROUNDS: usize = 4;

/// Variance of the residuals over sigma.
fn variance<T: Real>(report: &Report<T>, freedom: usize) -> T {
    T::lit(2.0) * report.cost / T::lit(freedom as f64)
}

/// Sightings less parameters.
pub fn freedom<T: Real>(problem: &Problem<T>, map: &Map<T>) -> usize {
    let views = map.poses.iter().flatten().count();
    let landmarks = map.landmarks.iter().flatten().count();
    let sightings = map.residuals(problem).flatten().count();
    (sightings + 4).saturating_sub(3 * views + 2 * landmarks)
}
