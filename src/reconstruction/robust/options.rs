// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the robust stage, from samples to the last exchange.

use crate::problem::MIN_LANDMARKS_OF_VIEW;

/// Options of the robust stage. Bounds are in standard deviations of a bearing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RobustOptions {
    /// Triples of views that samples are drawn from in a round.
    pub triples: usize,
    /// Samples of each: when three bearings in ten are wrong, three samples in a hundred are good.
    pub samples: usize,
    /// Seeds that are grown in a round.
    pub grown: usize,
    /// Most rounds: all of them take a second or two at 12 x 15, where half of the bearings are wrong.
    pub rounds: usize,
    /// Most triples in all; rounds beyond them draw new samples of the same.
    pub all_triples: usize,
    /// Good samples that are wanted before the search ends without a confirmation: not every one is exact enough to
    /// lead to the map.
    pub good_samples: f64,
    /// Two maps confirm each other when they share so many in a hundred of their inliers.
    pub confirming_percent: usize,
    /// The lowest minima in which sightings are exchanged before the best is chosen: one with a higher cost may end
    /// lowest.
    pub exchanged: usize,
    /// Another minimum is a rival when its cost is higher by no more than this: that of two outliers.
    pub rival_cost: f64,
    /// Plain hypotheses that are refined when no three views share enough landmarks for a sample.
    pub plain_hypotheses: usize,

    /// Sampson's residual over its standard deviation up to which a landmark agrees with the tensor of a sample,
    /// which is no better than its five landmarks.
    pub sample_bound: f64,
    /// The same for tensors estimated from more and more of the landmarks that agree.
    pub narrower_bounds: [f64; 3],
    /// Samples of a triple that are estimated anew from all that agrees with them.
    pub kept_samples: usize,

    /// Most smallest sets of sightings that are tried for each place that is asked for. When half of the sightings
    /// are wrong, one in eight threes is good, and 64 miss them all once in 5000.
    pub sets: usize,
    /// Agreeing sightings that two places may share by chance beyond those that fix them.
    pub shared_by_chance: usize,
    /// Rounds of estimation of a place from all that agrees with it.
    pub place_rounds: usize,

    /// Within this a bearing agrees with a map that is still growing: it comes from few bearings, and its errors are
    /// several times theirs.
    pub growing_bound: f64,
    /// Sightings of a new view that must agree: one more than fix it.
    pub agreeing_of_view: usize,
    /// Sightings of a new landmark that must agree: one more than fix it.
    pub agreeing_of_landmark: usize,
    /// Iterations of each refinement while a map grows: it only has to be better than its parts.
    pub growing_iterations: usize,

    /// Bounds on the way from a growing map to the final one.
    pub narrowing_bounds: [f64; 2],
    /// Iterations of refinement at each of them.
    pub narrowing_iterations: usize,
    /// Most changes of the set of inliers. Each lowers the cost, so they end by themselves, after two or three as a
    /// rule.
    pub inlier_changes: usize,

    /// An exchange is tried when it is predicted to raise twice the cost by no more than this, which is within the
    /// error of the prediction.
    pub promising: f64,
    /// Exchanges that are tried before the best is given up.
    pub exchange_tries: usize,
    /// Most exchanges that succeed.
    pub exchange_successes: usize,

    /// Most steps of Gauss-Newton for one view along its motion; its three unknowns need a few.
    pub motion_steps: usize,

    /// Bounds within which views and landmarks are reassigned: the final one, and that of a growing map.
    pub reassign_bounds: [f64; 2],
    /// Places of each view and landmark that are looked at.
    pub places: usize,
    /// By how many outliers such a place may be worse as long as nothing else moves.
    pub worse_outliers: f64,
    /// Places that are tried in a round, the most promising first.
    pub reassign_tries: usize,
    /// Sightings that must change sides where odometry ties the views: each try then moves hundreds of views.
    pub changes_with_odometry: usize,
    /// Most rounds of reassigning, and of estimating each anew: each lowers the cost, so they end by themselves.
    pub reassign_rounds: usize,
}

impl Default for RobustOptions {
    fn default() -> Self {
        Self {
            triples: 16,
            samples: 40,
            grown: 6,
            rounds: 24,
            all_triples: 128,
            good_samples: 30.0,
            confirming_percent: 95,
            exchanged: 3,
            rival_cost: 9.0,
            plain_hypotheses: 6,
            sample_bound: 6.0,
            narrower_bounds: [6.0, 4.5, 3.0],
            kept_samples: 3,
            sets: 64,
            shared_by_chance: 2,
            place_rounds: 3,
            growing_bound: 9.0,
            agreeing_of_view: MIN_LANDMARKS_OF_VIEW + 1,
            agreeing_of_landmark: 3,
            growing_iterations: 4,
            narrowing_bounds: [6.0, 4.0],
            narrowing_iterations: 4,
            inlier_changes: 30,
            promising: 4.0,
            exchange_tries: 16,
            exchange_successes: 20,
            motion_steps: 10,
            reassign_bounds: [3.0, 9.0],
            places: 4,
            worse_outliers: 2.0,
            reassign_tries: 24,
            changes_with_odometry: 3,
            reassign_rounds: 10,
        }
    }
}
