// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the robust stage, from samples to the last exchange.

use crate::problem::MIN_LANDMARKS_OF_VIEW;

/// Options of the robust stage. Bounds are in standard deviations of a bearing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RobustOptions {
    /// Triples of views that samples are drawn from in a round. Not sensitive.
    pub triples: usize,
    /// Samples of each triple. With 30 % outliers one sample in 200 is free of them, three in a round. Not sensitive.
    pub samples: usize,
    /// Seeds that are grown in a round. Not sensitive.
    pub grown: usize,
    /// Maximum number of rounds: all of them take a second or two for 12 views and 15 landmarks with 50 % outliers. Not
    /// sensitive.
    pub rounds: usize,
    /// The same times the number of views, as which the work of a round grows: all rounds up to 20 views.
    pub searched_views: usize,
    /// Maximum number of triples in all; later rounds draw new samples from the same triples. Not sensitive.
    pub all_triples: usize,
    /// Expected number of outlier-free samples after which the search ends without a confirmation. Not every such
    /// sample is accurate enough to lead to the map. Not sensitive.
    pub good_samples: f64,
    /// Two maps confirm each other when they share this percentage of their inliers. Not sensitive; with double, which
    /// no map reaches, the search takes half as long again.
    pub confirming_percent: usize,
    /// Number of lowest minima in which sightings are exchanged before the best is chosen: another than the lowest may
    /// end lowest. Not sensitive.
    pub exchanged: usize,
    /// Another minimum is a rival when its cost is higher by no more than this: that of two outliers. Not sensitive.
    pub rival_cost: f64,
    /// Non-robust hypotheses that are refined when no three views share enough landmarks for a sample. Not sensitive.
    pub plain_hypotheses: usize,

    /// Under limited sight, triples of views from which samples are drawn for each view, at least `all_triples` and at
    /// most `most_triples` in all.
    pub triples_per_view: usize,
    /// Maximum number of those triples.
    pub most_triples: usize,
    /// Under limited sight, bounds within which a bearing agrees with a new view; the next where no view passes: drift
    /// along a loop is larger than the errors of its parts.
    pub gates: [f64; 3],

    /// Sampson error over its standard deviation up to which a landmark agrees with the tensor of a sample. Wide,
    /// because that tensor is no better than its five landmarks. Not sensitive.
    pub sample_bound: f64,
    /// The same for tensors re-estimated from the landmarks that agree, round by round. Not sensitive.
    pub narrower_bounds: [f64; 3],
    /// Best samples of a triple that are re-estimated from all landmarks that agree with them. Not sensitive.
    pub kept_samples: usize,

    /// Maximum number of minimal samples of sightings that are tried for each requested place. With 50 % outliers one
    /// sample of three in eight is good, and 64 miss them all once in 5000. Not sensitive.
    pub sets: usize,
    /// Inliers that two places may share by chance beyond those of a minimal sample. Not sensitive.
    pub shared_by_chance: usize,
    /// Rounds of re-estimation of a place from all sightings that agree with it. Not sensitive.
    pub place_rounds: usize,

    /// Bound within which a bearing agrees with a growing map: few bearings determine it, so its errors are several
    /// times theirs. Not sensitive.
    pub growing_bound: f64,
    /// Sightings of a new view that must agree: one more than determine it. Not sensitive.
    pub agreeing_of_view: usize,
    /// Sightings of a new landmark that must agree: one more than determine it. Half changes nothing; double fails on
    /// six of 55 scenes fewer.
    pub agreeing_of_landmark: usize,
    /// Iterations of each refinement while a map grows: it need not converge. Not sensitive.
    pub growing_iterations: usize,

    /// Bounds that lead from that of a growing map to the final one. Half fails on three of 55 scenes more, double on
    /// two.
    pub narrowing_bounds: [f64; 2],
    /// Iterations of refinement at each of them. Not sensitive.
    pub narrowing_iterations: usize,
    /// Tolerance of refinements with Cauchy's loss: they only have to identify the inliers. Not sensitive.
    pub cauchy_tolerance: f64,
    /// Most iterations of a refinement between two changes of the set of inliers: more than a good map takes, and so few
    /// that Newton's method, whose iterations take many times as long, is left to the sets that stay.
    pub changing_iterations: usize,
    /// Most iterations of the refinement of a set that has not changed: what takes more is a wrong map, or goes on when
    /// it has become the best.
    pub finished_iterations: usize,
    /// How much more than the best the map of such a set may cost to be refined so far, in costs of an outlier. Of some
    /// 2,400 maps that cost more than a ninth of an outlier more, three ended below the best.
    pub finished_outliers: f64,
    /// Unknowns of a map up to which a comparison with the best takes all these iterations; with more, each takes as much
    /// longer as their cube grows, and as many fewer are taken. The last map is always refined to the end.
    pub finished_unknowns: usize,
    /// Maximum number of changes of the set of inliers. Each lowers the cost, so they end by themselves, usually after
    /// two or three. Not sensitive.
    pub inlier_changes: usize,

    /// An exchange is tried when it is predicted to raise twice the cost by no more than this, which is within the
    /// error of the prediction. Not sensitive.
    pub promising: f64,
    /// Exchanges that are tried without success before the stage ends. Not sensitive.
    pub exchange_tries: usize,
    /// Maximum number of successful exchanges. Not sensitive.
    pub exchange_successes: usize,

    /// Under limited sight, maximum number of views of maps in which single sightings, views and landmarks are exchanged:
    /// that work is quadratic in the views.
    pub improved_views: usize,
    /// Maximum number of rounds of such exchanges: each lowers the cost, so they end by themselves.
    pub improve_rounds: usize,
    /// Decrease of the cost that is worth another round: a hundredth of an outlier. What a slow descent has left would
    /// otherwise ask for all of them.
    pub improve_worth: f64,
    /// Sightings up to this many standard deviations are changed one at a time, with everything else held fixed.
    pub toggled: f64,

    /// Maximum number of Gauss-Newton steps for one view along its motion; three unknowns need a few. Not sensitive.
    pub motion_steps: usize,

    /// Bounds within which views and landmarks are reassigned: the final one, and that of a growing map. Not sensitive.
    pub reassign_bounds: [f64; 2],
    /// Candidate places of each view and landmark. Not sensitive.
    pub places: usize,
    /// How much worse such a place may be with everything else fixed, in costs of an outlier. Not sensitive.
    pub worse_outliers: f64,
    /// Places that are tried in a round, the most promising first. Not sensitive.
    pub reassign_tries: usize,
    /// Places that are tried in all rounds, times the number of views, as which the work of a try grows: never fewer than
    /// the rounds would try up to 20 views.
    pub reassigned_views: usize,
    /// With odometry, sightings that must change between inlier and outlier: each try then moves hundreds of views. Not
    /// sensitive.
    pub changes_with_odometry: usize,
    /// Maximum number of rounds of reassigning, and of re-estimating each: each lowers the cost, so they end by
    /// themselves. Not sensitive.
    pub reassign_rounds: usize,
}

impl Default for RobustOptions {
    fn default() -> Self {
        Self {
            triples: 16,
            samples: 40,
            grown: 6,
            rounds: 24,
            searched_views: 480,
            all_triples: 128,
            good_samples: 30.0,
            confirming_percent: 95,
            exchanged: 3,
            rival_cost: 9.0,
            plain_hypotheses: 6,
            triples_per_view: 2,
            most_triples: 1000,
            gates: [9.0, 9.0, 18.0],
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
            cauchy_tolerance: 1e-5,
            changing_iterations: 8,
            finished_iterations: 100,
            finished_outliers: 0.25,
            finished_unknowns: 150,
            inlier_changes: 30,
            promising: 4.0,
            exchange_tries: 16,
            exchange_successes: 20,
            improved_views: 250,
            improve_rounds: 10,
            improve_worth: 0.045,
            toggled: 9.0,
            motion_steps: 10,
            reassign_bounds: [3.0, 9.0],
            places: 4,
            worse_outliers: 2.0,
            reassign_tries: 24,
            reassigned_views: 5000,
            changes_with_odometry: 3,
            reassign_rounds: 10,
        }
    }
}

impl RobustOptions {
    /// Maximum number of iterations of a map of so many unknowns that is compared with the best.
    pub(super) fn compared_iterations(&self, unknowns: usize) -> usize {
        if unknowns <= self.finished_unknowns {
            return self.finished_iterations;
        }
        let [affordable, needed] =
            [self.finished_unknowns, unknowns].map(|n| (n as u128).saturating_pow(3));
        let iterations = (self.finished_iterations as u128).saturating_mul(affordable) / needed;
        usize::try_from(iterations).unwrap_or(self.finished_iterations)
    }
}

/// Options of the removal and growth of parts of a map with outliers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RegrowthOptions {
    /// Maximum number of maps, those of the lowest cost, of which parts are grown again.
    pub maps: usize,
    /// Tries in a row without success that are the last, times the square of the number of views, as which the work of
    /// one grows: 150 with 20 views, none beyond 244.
    pub work: usize,
    /// Tries in a row for each part that a map has, a center and a number of views: random as they are, three reach 95 %
    /// of the parts. It decides below 13 views.
    pub tries_per_part: usize,
    /// Maximum number of tries in all, as a multiple of that.
    pub successes: usize,
    /// Maximum number of views that are removed in a try.
    pub part: usize,
    /// Percentage of the tries in which the part grows apart from the rest, from a seed of its own, and is joined to it
    /// afterwards. Neither way does without the other: what no seed lies in can only grow from the rest.
    pub apart_percent: usize,
    /// Minimal sets of ties between the two that are tried: with 10 % outliers half of those of four sightings are good,
    /// but most are badly conditioned.
    pub similarities: usize,
    /// Iterations of the first refinement of a try.
    pub iterations: usize,
    /// Rounds in which everything is placed anew before the cost of a try is judged.
    pub rounds: usize,
    /// How much worse than the best a try may be by then to be refined to the end, in costs of an outlier.
    pub worse_outliers: f64,
}

impl Default for RegrowthOptions {
    fn default() -> Self {
        Self {
            maps: 3,
            work: 60_000,
            tries_per_part: 3,
            successes: 4,
            part: 16,
            apart_percent: 50,
            similarities: 64,
            iterations: 8,
            rounds: 3,
            worse_outliers: 5.0,
        }
    }
}

/// Options of the assignment of bearings to landmarks. Shares are of all bearings.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct IdentityOptions {
    /// How much smaller the square of residual over sigma is taken to be under a bearing's own label: an assignment
    /// that changes labels has to explain more.
    pub own_label: f64,
    /// Rounds of assignment and refinement.
    pub rounds: usize,
    /// Iterations of each refinement: the assignment need not be refined to the end.
    pub iterations: usize,
    /// Two maps that explain shares of the bearings which differ by less are told apart by their costs.
    pub telling: f64,
    /// Share that a map must explain after assignment for its identities to be believed. At 12 x 15 with 30 to 50 % of the
    /// identities exchanged, true maps explain at least 90 %, and so do maps in which a view or a landmark is wrong; maps
    /// that are wrong as a whole mostly explain less than 67 % (`benches/identities.rs`).
    pub believed: f64,
    /// Share by which the assignment must explain more than the inliers of a map for the map to be estimated from the
    /// bearings that keep their labels. Below it the inliers tell the outliers well enough: a third of the outliers
    /// exchanged, with 30 % outliers, are not meant.
    pub exchanged: f64,
    /// Bound in standard deviations within which a second landmark that explains a bearing makes its identity ambiguous.
    pub ambiguous: f64,
    /// Maximum number of bearings of a view that are assigned, as the work grows with their cube; views with more keep
    /// their labels.
    pub bearings: usize,
}

impl Default for IdentityOptions {
    fn default() -> Self {
        Self {
            own_label: 1.0,
            rounds: 3,
            iterations: 8,
            telling: 0.05,
            believed: 0.8,
            exchanged: 0.15,
            ambiguous: 2.0,
            bearings: 500,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_maps_are_compared_after_fewer_iterations() {
        let options = RobustOptions::default();
        let iterations = [0, 60, 150, 207, 300, 600].map(|n| options.compared_iterations(n));
        assert_eq!(iterations, [100, 100, 100, 38, 12, 1]);
    }
}
