// SPDX-License-Identifier: MIT OR Apache-2.0
//! Wrong identities put right by a map.

use super::options::SolveOptions;
use super::robust::consensus::square_within;
use super::robust::identities::identify;
use super::robust::solve::check_sigmas;
use crate::error::Error;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// A bearing that has been given to another landmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LabelChange {
    /// Place of the sighting in the input of the problem.
    pub sighting: usize,
    /// The view.
    pub view: usize,
    /// The landmark whose label it had.
    pub from: usize,
    /// The landmark whose label it has now.
    pub to: usize,
}

/// The problem with the identities that a map explains, and what has changed, view by view.
///
/// In each view all bearings are assigned anew to the landmarks of the map, at the least sum of squared residuals over
/// sigma, each truncated at three sigma, with a little preference for their own labels; the map is refined, and this is
/// repeated. Left alone are bearings that their own landmark explains within two sigma, those that would displace them,
/// views that the map does not have, and bearings that no landmark explains, unless their label goes to another bearing:
/// they then take one that is left.
///
/// The map must be right: [`Reconstruction::explained`](crate::Reconstruction::explained) counts what it explains.
///
/// # Errors
/// [`Error::SigmaTooLarge`] for a standard deviation with which outliers cannot be told, as one that is not stated;
/// [`Error::LengthMismatch`] and [`Error::NotFinite`] for a map that is not of this problem; those of the refinement.
///
/// # Example
/// ```
/// use bearslam::{
///     Arena, Layout, Outliers, Problem, SolveOptions, relabel, simulate, solve,
/// };
/// let clean = simulate(Layout::Mixed, 12, 15, 0.01, 3, Arena::default())?;
/// let (scene, wrong) = clean.contaminate(Outliers::Exchanged, 0.3, 1);
/// let problem = Problem::dense(12, 15, &scene.bearings, 0.01)?;
/// let options = SolveOptions { robust: true, ..SolveOptions::default() };
/// let found = solve(&problem, &options, None)?;
/// let (repaired, changes) = relabel(&problem, &found.map, &options)?;
/// let right = changes.iter().filter(|one| {
///     let now = clean.bearings[one.view * 15 + one.to];
///     scene.bearings[one.sighting] == now
/// });
/// assert!(right.count() >= 40 && changes.len() <= 54);
/// let found = solve(&repaired, &options, None)?;
/// assert!(found.inliers.iter().filter(|inlier| **inlier).count() > 155);
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn relabel(
    problem: &Problem,
    map: &Map,
    options: &SolveOptions,
) -> Result<(Problem, Vec<LabelChange>), Error> {
    check_sigmas(problem)?;
    map.check(problem)?;
    let identified = identify(problem, map, options)?;
    let mut labels = identified.labels;
    let bound = options.stages.identities.ambiguous;
    for view in 0..problem.views() {
        keep_ambiguous(
            problem,
            &identified.map,
            view,
            &mut labels[problem.range_of_view(view)],
            bound,
        );
    }
    let all = problem.sightings().iter().zip(problem.input_order());
    let changes = all
        .zip(&labels)
        .filter(|((seen, _), label)| seen.landmark != **label)
        .map(|((seen, &sighting), &to)| LabelChange {
            sighting,
            view: seen.view,
            from: seen.landmark,
            to,
        });
    Ok((problem.relabelled(&labels), changes.collect()))
}

/// Gives the bearings of a view that the landmarks of their own labels explain within `bound` these again, and so those
/// that have taken them.
fn keep_ambiguous(problem: &Problem, map: &Map, view: usize, labels: &mut [usize], bound: f64) {
    let (Some(pose), seen) = (&map.poses[view], problem.of_view(view)) else {
        return;
    };
    let explains = |k: usize, landmark: usize| {
        map.landmarks[landmark].is_some_and(|point| {
            square_within(problem, &seen[k], pose, &point, bound) <= bound * bound
        })
    };
    let ambiguous: Vec<usize> = (0..seen.len())
        .filter(|&k| labels[k] != seen[k].landmark && explains(k, seen[k].landmark))
        .collect();
    for k in ambiguous {
        // Along the chain of those that have taken the label of the one before: each has its own in the end.
        let mut next = Some(k);
        while let Some(k) = next {
            labels[k] = seen[k].landmark;
            next = (0..seen.len()).find(|&other| other != k && labels[other] == labels[k]);
        }
    }
}
