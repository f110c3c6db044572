// SPDX-License-Identifier: MIT OR Apache-2.0
//! Landmarks of which only the direction is known.

use super::judge::variance;
use super::result::Reconstruction;
use crate::lm::Termination;
use crate::problem::{Problem, Subject, Undetermined, Why};
use crate::uncertainty::unbounded_landmarks;

/// Options of the decision that a landmark is at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct InfinityOptions {
    /// Root mean square of the residuals \[rad\] above which a map is taken to be wrong: its landmarks are not tested.
    /// Not sensitive.
    pub plausible_rms: f64,
}

impl Default for InfinityOptions {
    fn default() -> Self {
        Self { plausible_rms: 0.1 }
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
