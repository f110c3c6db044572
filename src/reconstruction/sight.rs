// SPDX-License-Identifier: MIT OR Apache-2.0
//! How much of the landmarks the views see.

use crate::problem::Problem;

/// Options of the decision that sight is limited.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SightOptions {
    /// Sight is limited with more views than this: no triple covers much of the whole. Not sensitive.
    pub many_views: usize,
    /// Sight is not limited with fewer views than this. Not sensitive.
    pub few_views: usize,
    /// In between, sight is limited when the views see less than this fraction of the landmarks on average. Not
    /// sensitive.
    pub filled: f64,
}

impl Default for SightOptions {
    fn default() -> Self {
        Self {
            many_views: 40,
            few_views: 8,
            filled: 0.6,
        }
    }
}

/// Whether sight is limited: more than 40 views, or at least eight that see less than 60 % of the landmarks on average.
///
/// A triple of views then covers little of the whole, and a map that is grown from it without refinement in between
/// drifts. Views and landmarks without sightings do not count.
pub fn is_limited(problem: &Problem, options: &SightOptions) -> bool {
    let (views, filled) = views_and_filled(problem);
    views > options.many_views || (views >= options.few_views && filled < options.filled)
}

/// What part of the landmarks the views see on average. Views and landmarks without sightings do not count.
pub fn filled(problem: &Problem) -> f64 {
    views_and_filled(problem).1
}

fn views_and_filled(problem: &Problem) -> (usize, f64) {
    let views = (0..problem.views()).filter(|&view| !problem.of_view(view).is_empty());
    let landmarks = (0..problem.landmarks()).filter(|&k| !problem.of_landmark(k).is_empty());
    let (views, landmarks) = (views.count(), landmarks.count());
    let filled = problem.sightings().len() as f64 / (views * landmarks).max(1) as f64;
    (views, filled)
}
