// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the incremental stage, from seeds to joined components.

use crate::problem::MIN_LANDMARKS_OF_VIEW;

/// Options of the incremental stage. Noise is the root mean square of residuals over sigma, as large as it has shown so
/// far: sigma may be unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct IncrementalOptions {
    /// Triples of views that are drawn for each view.
    pub triples_per_view: usize,
    /// Fewest triples that are drawn.
    pub fewest_triples: usize,
    /// Most triples that are drawn.
    pub most_triples: usize,
    /// Landmarks that the views of a seed must share: one more than the tensor needs, so that something checks it, or
    /// just enough where there is no more.
    pub shared_landmarks: [usize; 2],
    /// Seeds that are tried for a map before the best is taken as it is.
    pub seeds: usize,
    /// Views to which both branches of a seed grow before the better goes on.
    pub views_before_choice: usize,
    /// Two branches whose variances differ by less than this factor then are both grown to the end.
    pub clear_ratio: f64,

    /// A view or landmark fits within so many times the noise. At first its neighbours are no better than itself, hence
    /// more than the usual three; wider, where a loop closes over the drift of the map; at last whatever has a pose at
    /// all.
    pub gates: [f64; 3],
    /// Landmarks that a view must see at each of the gates: one more than determine it, so that one checks it; without
    /// the check when nothing else is left.
    pub landmarks_of_view: [usize; 3],
    /// A round may add one view to so many.
    pub views_per_added: usize,
    /// A heading is taken when its standard deviation is below this \[rad\], a landmark when that of its range is below
    /// this part of it. Beyond, the first order no longer predicts what they do to others. A landmark nearer to infinity
    /// would also decide alone on the scale between two maps.
    pub max_deviation: f64,
    /// How often a view may be thrown out and come back.
    pub returns: u8,
    /// Most iterations of a refinement on the way: enough to take out the drift; the end is exact.
    pub growing_iterations: usize,
    /// Noise \[rad\] that is expected before anything has been measured: a good degree.
    pub expected_noise: f64,
    /// For how many residuals the expectation counts.
    pub expected_count: f64,

    /// Refinements of a map, each of which may make room for a view that did not fit before.
    pub completions: usize,
    /// So many times the size of the map is far out: beyond it the refinement finds out whether a landmark is at
    /// infinity.
    pub far_sizes: f64,
    /// Iterations of the last refinement of the map of a seed: one that has grown well needs two to five, and what takes
    /// more goes on by Newton's method, which is expensive.
    pub first_iterations: usize,
    /// Most unfinished maps that go on.
    pub max_finished: usize,
    /// How many times the variance of the best that of an unfinished map may be for it to go on.
    pub hopeless_ratio: f64,

    /// Two maps belong together, and a map competes with a better one, when its variance is at most so many times the
    /// other's: twice the residuals.
    pub fitting_ratio: f64,
    /// Shared landmarks that join two maps: as many as fix a similarity.
    pub joining_landmarks: usize,
}

impl Default for IncrementalOptions {
    fn default() -> Self {
        Self {
            triples_per_view: 8,
            fewest_triples: 64,
            most_triples: 2000,
            shared_landmarks: [6, 5],
            seeds: 12,
            views_before_choice: 8,
            clear_ratio: 4.0,
            gates: [5.0, 20.0, 80.0],
            landmarks_of_view: [4, 4, MIN_LANDMARKS_OF_VIEW],
            views_per_added: 4,
            max_deviation: 0.25,
            returns: 3,
            growing_iterations: 6,
            expected_noise: 0.02,
            expected_count: 6.0,
            completions: 3,
            far_sizes: 30.0,
            first_iterations: 8,
            max_finished: 3,
            hopeless_ratio: 30.0,
            fitting_ratio: 4.0,
            joining_landmarks: 2,
        }
    }
}
