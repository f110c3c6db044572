// SPDX-License-Identifier: MIT OR Apache-2.0
//! Landmarks of which only the direction is known.

use super::judge::variance;
use super::result::Reconstruction;
use crate::lm::Termination;
use crate::problem::{Map, Prior, Problem, Subject, Undetermined, Why};
use crate::uncertainty::unbounded_landmarks;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::Vector2;

/// Options of the decision that a landmark is at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct InfinityOptions {
    /// Root mean square of the residuals \[rad\] above which a map is taken to be wrong: its landmarks are not tested.
    /// Not sensitive.
    pub plausible_rms: f64,
    /// No landmark is this many times as far from the first view as the farthest view, or as the nearest landmark: there,
    /// bearings differ by rounding from those at infinity.
    pub horizon: f64,
}

impl Default for InfinityOptions {
    fn default() -> Self {
        Self {
            plausible_rms: 0.1,
            horizon: 1e6,
        }
    }
}

/// Removes landmarks at infinity from a refined map: their range is undetermined.
///
/// Their bearings have been used: they determine the headings, and the cost counts them. At infinity is what is so
/// within the noise, and what is beyond the horizon in any case.
pub fn drop_landmarks_at_infinity(
    problem: &Problem,
    found: &mut Reconstruction,
    options: &InfinityOptions,
) {
    let mut dropped = beyond_horizon(problem, &found.map, options);
    for landmark in unbounded(problem, found, options) {
        if !dropped.contains(&landmark) {
            dropped.push(landmark);
        }
    }
    for landmark in dropped {
        found.map.landmarks[landmark] = None;
        found.undetermined.push(Undetermined {
            subject: Subject::Landmark(landmark),
            why: Why::AtInfinity,
        });
    }
    found
        .undetermined
        .sort_by_key(|undetermined| undetermined.subject);
}

/// The landmarks whose range is undetermined within the noise of the bearings.
fn unbounded(problem: &Problem, found: &Reconstruction, options: &InfinityOptions) -> Vec<usize> {
    // Exact bearings leave no noise to judge by, and of a map that explains nothing no landmark is known.
    if found.freedom == 0
        || found.termination == Termination::ZeroResidual
        || found.rms > options.plausible_rms
    {
        return Vec::new();
    }
    let unbounded = unbounded_landmarks(problem, &found.map, variance(found));
    let lost: usize = unbounded
        .iter()
        .map(|&landmark| problem.of_landmark(landmark).len().saturating_sub(2))
        .sum();
    // When the map depends on them they stay, and its uncertainty shows it.
    if lost >= found.freedom {
        return Vec::new();
    }
    unbounded
}

/// The landmarks farther away than any could be, apart from those that priors know.
fn beyond_horizon(problem: &Problem, map: &Map, options: &InfinityOptions) -> Vec<usize> {
    let mut places = map
        .poses
        .iter()
        .flatten()
        .map(|pose| pose.translation.vector);
    let Some(home) = places.next() else {
        return Vec::new();
    };
    let range = |place: &Vector2<f64>| (place - home).norm();
    let farthest_view = places.map(|place| range(&place)).fold(0.0, f64::max);
    let ranges = map
        .landmarks
        .iter()
        .flatten()
        .map(|point| range(&point.coords));
    let nearest_landmark = ranges.fold(f64::INFINITY, f64::min);
    let far = farthest_view.max(nearest_landmark) * options.horizon;
    let known = known_landmarks(problem);
    let landmarks = map.landmarks.iter().enumerate();
    let beyond = landmarks.filter(|(landmark, point)| {
        !known[*landmark] && point.is_some_and(|point| !(range(&point.coords) <= far))
    });
    beyond.map(|(landmark, _)| landmark).collect()
}

/// Which landmarks have a prior.
fn known_landmarks(problem: &Problem) -> Vec<bool> {
    let mut known = vec![false; problem.landmarks()];
    for prior in problem.priors() {
        if let Prior::Landmark { landmark, .. } = prior {
            known[*landmark] = true;
        }
    }
    known
}

/// The map without the landmarks that are behind at least half of the rays that see them, and these; `None` when there are none.
///
/// Where priors know a landmark it stays.
pub fn without_landmarks_behind(problem: &Problem, map: &Map) -> Option<(Map, Vec<Undetermined>)> {
    if !problem.is_oriented() {
        return None;
    }
    let known = known_landmarks(problem);
    let mut left = map.clone();
    let mut dropped = Vec::new();
    for (landmark, place) in left.landmarks.iter_mut().enumerate() {
        let Some(point) = place.filter(|_| !known[landmark]) else {
            continue;
        };
        let rays = map.rays(problem, landmark);
        let all = rays.clone().count();
        let behind = rays.filter(|(pose, s)| {
            let ray = (pose.rotation * s.bearing).into_inner();
            let offset = point.coords - pose.translation.vector;
            ray.re * offset.x + ray.im * offset.y < 0.0
        });
        if all > 0 && 2 * behind.count() >= all {
            *place = None;
            dropped.push(Undetermined {
                subject: Subject::Landmark(landmark),
                why: Why::Degenerate,
            });
        }
    }
    (!dropped.is_empty()).then_some((left, dropped))
}
