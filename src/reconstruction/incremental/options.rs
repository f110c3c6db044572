// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the incremental stage, from seeds to merged components.

use crate::problem::MIN_LANDMARKS_OF_VIEW;

/// Options of the incremental stage. Noise is the root mean square of residuals over sigma, as large as it has shown so
/// far: sigma may be unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct IncrementalOptions {
    /// Triples of views that are drawn for each view. Not sensitive.
    pub triples_per_view: usize,
    /// Minimum number of triples that are drawn. Not sensitive.
    pub fewest_triples: usize,
    /// Maximum number of triples that are drawn. Not sensitive.
    pub most_triples: usize,
    /// Landmarks that the views of a seed must share: one more than the tensor needs, for redundancy, then the minimum.
    /// Not sensitive.
    pub shared_landmarks: [usize; 2],
    /// Seeds that are tried for a map before the best so far is taken. Not sensitive.
    pub seeds: usize,
    /// Number of views to which both branches of a seed grow before the better one is chosen. Not sensitive.
    pub views_before_choice: usize,
    /// If the variances of the branches then differ by less than this factor, both are grown to the end. Not sensitive.
    pub clear_ratio: f64,

    /// A view or landmark fits when its residuals are within this many times the noise. First more than the usual
    /// three, because its neighbours are no better determined than it is; then wider, to close loops despite drift;
    /// last, whatever can be placed at all. Not sensitive.
    pub gates: [f64; 3],
    /// Landmarks in the map that a view must see at each gate: one more than the minimum, for redundancy, except at the
    /// last. Not sensitive.
    pub landmarks_of_view: [usize; 3],
    /// A round may add one view for every this many in the map. Not sensitive.
    pub views_per_added: usize,
    /// A view is accepted when the standard deviation of its heading is below this \[rad\], a landmark when the
    /// relative standard deviation of its range is. Above this, first-order predictions fail, and a landmark near
    /// infinity would alone set the scale between two maps. Not sensitive.
    pub max_deviation: f64,
    /// How often a view may be removed and added again. Not sensitive.
    pub returns: u8,
    /// Maximum number of iterations of a refinement during growth: enough to remove drift; only the last converges. Not
    /// sensitive.
    pub growing_iterations: usize,
    /// Noise \[rad\] that is expected before there are residuals: a little more than a degree. Not sensitive.
    pub expected_noise: f64,
    /// Number of residuals that the expectation weighs as much as. Not sensitive.
    pub expected_count: f64,

    /// Final refinements of a map: after each, a view that did not fit before may fit. Not sensitive.
    pub completions: usize,
    /// Range, in sizes of the map, at which a landmark that may be at infinity starts; the refinement decides whether
    /// it is. Not sensitive.
    pub far_sizes: f64,
    /// Iterations that the final refinement of a seed's map gets at first: a map that has grown well needs two to five,
    /// and one that needs more continues by Newton's method, which is expensive. Not sensitive.
    pub first_iterations: usize,
    /// Maximum number of maps refined further after the first iterations. Not sensitive.
    pub max_finished: usize,
    /// Most iterations of them: what takes more is a wrong map, or goes on when it has become the best.
    pub finished_iterations: usize,
    /// A map is refined further only if its variance is at most this many times that of the best. Not sensitive.
    pub hopeless_ratio: f64,

    /// Two maps belong together, and a map competes with a better one, when their variances differ by at most this
    /// factor: residuals twice as large. Not sensitive.
    pub fitting_ratio: f64,
    /// By how many standard deviations the squares of what ties two maps may exceed their expectation.
    pub joining_deviations: f64,
    /// Shared landmarks needed to merge two maps by these alone: two determine a similarity. Not sensitive.
    pub joining_landmarks: usize,

    /// Where the best map is too costly, parts that are grown again in a row without success before the next search.
    pub regrowths: usize,
    /// Maximum number of views of such a part.
    pub regrown_views: usize,

    /// Headings that are tried of a view that sees two landmarks of the map.
    pub headings: usize,

    /// Maximum number of views of a map of which landmarks are tried in other positions.
    pub moved_views: usize,
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
            finished_iterations: 100,
            hopeless_ratio: 30.0,
            fitting_ratio: 4.0,
            joining_deviations: 5.0,
            joining_landmarks: 2,
            regrowths: 30,
            regrown_views: 16,
            headings: 90,
            moved_views: 100,
        }
    }
}
