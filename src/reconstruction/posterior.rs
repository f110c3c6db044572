// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maximum a posteriori: bearings with odometry and priors, from several starts.
//!
//! One start grows along the odometry and from what is known; another is the map from bearings alone, laid
//! over the first. The lower cost wins: the result is never worse than without the odometry.

use super::anchored::anchored;
use super::bounded::take_out_unbounded;
use super::options::{Progress, SolveOptions, tell};
use super::result::Reconstruction;
use super::robust;
use super::sight;
use super::solve::solve;
use crate::error::Error;
use crate::estimation::{Loss, Map, Problem, RefineOptions, Undetermined, Why, refine_map};
use crate::geometry::align;
use crate::scalar::Real;
use alloc::vec::Vec;
use nalgebra::Point2;

/// Standard deviations of the cost by which that of the right map may differ from its mean.
const PLAUSIBLE: f64 = 3.0;

/// Views beyond which a plausible cost is enough: no wrong minimum of so many bearings comes so low. With
/// fewer, the map from bearings alone costs little and is always tried.
const MANY_VIEWS: usize = 40;

/// Poses and landmarks of a problem with odometry or priors.
///
/// # Errors
/// As [`solve`], when neither start comes to a map.
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 2.2.
pub fn solve_posterior<T: Real>(
    problem: &Problem<T>,
    options: &SolveOptions<T>,
    mut progress: Option<Progress<'_>>,
) -> Result<Reconstruction<T>, Error> {
    let growing = RefineOptions {
        loss: if options.robust {
            Loss::Cauchy(T::lit(Loss::<T>::CAUCHY))
        } else {
            options.refine.loss
        },
        ..options.refine
    };
    let starts = anchored(problem, &growing, &mut progress)?;
    let mut found = Vec::new();
    let mut failure = None;
    for start in starts.iter().take(1) {
        try_start(
            problem,
            start,
            options,
            &mut progress,
            &mut found,
            &mut failure,
        )?;
    }
    let many = problem.views() > MANY_VIEWS;
    if !(many
        && found
            .iter()
            .any(|found| is_plausible(found, options.robust)))
    {
        let alone = problem.clone().without_ties();
        match solve(&alone, options, reborrow(&mut progress)) {
            Ok(best) => {
                let rivals = core::iter::once(&best).chain(&best.alternatives);
                // As it is as well: what it is laid over may be far off.
                for map in rivals.map(|rival| &rival.map) {
                    let laid = starts.first().map(|target| laid_over(map, target));
                    for start in laid.iter().chain([map]) {
                        try_start(
                            problem,
                            start,
                            options,
                            &mut progress,
                            &mut found,
                            &mut failure,
                        )?;
                    }
                }
            }
            Err(error @ (Error::Interrupted | Error::OutOfMemory)) => return Err(error),
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    let rank = |found: &Reconstruction<T>| (found.undetermined.len(), found.cost.as_f64());
    found.sort_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    let best = found.into_iter().next().ok_or(failure.unwrap_or(NOTHING))?;
    let mut maps = Vec::from([best]);
    for start in starts.iter().skip(1) {
        let apart = |map: &Map<T>| {
            map.poses
                .iter()
                .zip(&start.poses)
                .all(|(a, b)| a.is_none() || b.is_none())
        };
        if maps.iter().all(|found| apart(&found.map)) {
            try_start(
                problem,
                start,
                options,
                &mut progress,
                &mut maps,
                &mut failure,
            )?;
        }
    }
    if !options.robust {
        maps.iter_mut()
            .for_each(|map| take_out_unbounded(problem, map));
    }
    sight::gather(problem, maps).ok_or(NOTHING)
}

/// No start has led to a map.
const NOTHING: Error = Error::Degenerate {
    quantity: "number of starts that could be refined",
    value: 0.0,
    bound: 1.0,
};

/// Refines a start and keeps what comes of it.
fn try_start<T: Real>(
    problem: &Problem<T>,
    start: &Map<T>,
    options: &SolveOptions<T>,
    progress: &mut Option<Progress<'_>>,
    found: &mut Vec<Reconstruction<T>>,
    failure: &mut Option<Error>,
) -> Result<(), Error> {
    if options.robust {
        found.extend(robust::from_start(problem, start, options, progress)?);
        return Ok(());
    }
    let mut map = start.clone();
    let total = options.refine.max_iterations;
    let mut watch = |done, _| tell(progress, "refine", done, total);
    match refine_map(problem, &mut map, &options.refine, Some(&mut watch)) {
        Ok(report) => found.push(Reconstruction::new(problem, &map, report)),
        Err(error @ (Error::Interrupted | Error::OutOfMemory)) => return Err(error),
        Err(error) => *failure = Some(error),
    }
    Ok(())
}

/// Whether the cost is what the standard deviations let expect.
fn is_plausible<T: Real>(found: &Reconstruction<T>, robust: bool) -> bool {
    let freedom = found.freedom as f64;
    // An outlier counts with its bound, and is none of the freedom.
    let outliers = found.inliers.iter().filter(|inlier| !**inlier).count();
    let bound = if robust {
        Loss::<T>::TRUNCATED * Loss::<T>::TRUNCATED
    } else {
        0.0
    };
    let excess = 2.0 * found.cost.as_f64() - bound * outliers as f64 - freedom;
    // What has too few sightings no start would reach.
    let hopeless = |one: &Undetermined| matches!(one.why, Why::TooFewSightings { .. });
    found.termination.was_successful()
        && found.undetermined.iter().all(hopeless)
        && excess <= 0.0_f64.max(PLAUSIBLE * nalgebra::ComplexField::sqrt(2.0 * freedom))
}

/// A map laid over another by the positions that both determine.
fn laid_over<T: Real>(map: &Map<T>, target: &Map<T>) -> Map<T> {
    let points = |map: &Map<T>| -> Vec<Option<Point2<T>>> {
        let views = map
            .poses
            .iter()
            .map(|pose| pose.map(|pose| pose.translation.vector.into()));
        views.chain(map.landmarks.iter().copied()).collect()
    };
    let pairs = points(map).into_iter().zip(points(target));
    let (from, to): (Vec<_>, Vec<_>) = pairs.filter_map(|(a, b)| Some((a?, b?))).unzip();
    match align(&from, &to) {
        Ok(similarity) => map.transformed(&similarity),
        Err(_) => map.clone(),
    }
}

fn reborrow<'a>(progress: &'a mut Option<Progress<'_>>) -> Option<Progress<'a>> {
    match progress {
        Some(progress) => Some(&mut **progress),
        None => None,
    }
}
