// SPDX-License-Identifier: MIT OR Apache-2.0
//! Landmarks of which only the direction is known.

use super::judge::{size, variance};
use super::result::Reconstruction;
use crate::lm::Termination;
use crate::problem::{Map, Prior, Problem, Subject, Undetermined, Why};
use crate::uncertainty::unbounded_landmarks;
use alloc::vec;
use alloc::vec::Vec;

/// Options of the decision that a landmark is at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct InfinityOptions {
    /// Root mean square of the residuals \[rad\] above which a map is taken to be wrong: its landmarks are not tested.
    /// Not sensitive.
    pub plausible_rms: f64,
    /// No landmark is farther away than this many sizes of the map: there, bearings differ by rounding from those at
    /// infinity.
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
/// Their bearings have been used: they determine the headings, and the cost counts them.
pub fn drop_landmarks_at_infinity(
    problem: &Problem,
    found: &mut Reconstruction,
    options: &InfinityOptions,
) {
    // Exact bearings leave no noise to judge by, and in a map that explains nothing no landmark can be judged.
    if found.freedom == 0
        || found.termination == Termination::ZeroResidual
        || found.rms > options.plausible_rms
    {
        return;
    }
    let unbounded = unbounded_landmarks(problem, &found.map, variance(found));
    let lost: usize = unbounded
        .iter()
        .map(|&landmark| problem.of_landmark(landmark).len().saturating_sub(2))
        .sum();
    // When the map depends on them they stay, and its uncertainty shows it.
    if lost >= found.freedom {
        return;
    }
    for landmark in unbounded {
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

/// The map without the landmarks that cannot be where it has them, and these: behind at least half of the rays that see them, or
/// beyond the horizon. `None` when there are none.
///
/// Where priors know a landmark it stays.
pub fn drop_misplaced(problem: &Problem, map: &Map, options: &InfinityOptions) -> Option<(Map, Vec<Undetermined>)> {
    let far = size(map) * options.horizon;
    let home = map.poses.iter().flatten().next()?.translation.vector;
    let mut known = vec![false; problem.landmarks()];
    for prior in problem.priors() {
        if let Prior::Landmark { landmark, .. } = prior {
            known[*landmark] = true;
        }
    }
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
            problem.is_oriented() && ray.re * offset.x + ray.im * offset.y < 0.0
        });
        let why = if (point.coords - home).norm() > far {
            Why::AtInfinity
        } else if 2 * behind.count() >= all && all > 0 {
            Why::Degenerate
        } else {
            continue;
        };
        *place = None;
        dropped.push(Undetermined {
            subject: Subject::Landmark(landmark),
            why,
        });
    }
    (!dropped.is_empty()).then_some((left, dropped))
}
