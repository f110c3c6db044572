// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the search: the draw of triples, hypotheses, minima, alternative positions of landmarks.

/// Options of the draw of triples.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct DrawOptions {
    /// Maximum number of views for which all triples are enumerated (40 views have 9880); with more, they are drawn.
    /// Not sensitive.
    pub listed_views: usize,
    /// Draws per requested triple when they are not enumerated. Not sensitive.
    pub draws: usize,
}

impl Default for DrawOptions {
    fn default() -> Self {
        Self {
            listed_views: 40,
            draws: 50,
        }
    }
}

/// Options of the choice among hypotheses.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct HypothesisOptions {
    /// Maximum number of triples of views that share four landmarks whose tensors are swept, where a closed form from
    /// four views does not suffice: each sweep finds the minima of its triple.
    pub max_sweeps: usize,
    /// Two hypotheses closer than this (positions over the size of the map, headings in radians) end in the same
    /// minimum. Not sensitive.
    pub cluster: f64,
    /// Maximum number of clusters that are kept. Not sensitive.
    pub max_distinct: usize,
}

impl Default for HypothesisOptions {
    fn default() -> Self {
        Self {
            max_sweeps: 4,
            cluster: 0.05,
            max_distinct: 60,
        }
    }
}

/// Options of the refinement of hypotheses.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct MinimaOptions {
    /// Iterations that every candidate gets first: from the basin of a good minimum fewer are enough. Half fails on six
    /// of 330 scenes more, double on three.
    pub first_iterations: usize,
    /// Maximum number of unfinished candidates that get more iterations. Not sensitive.
    pub max_finished: usize,
    /// Most iterations of them: what takes more is a wrong map, or goes on when it has become the best.
    pub finished_iterations: usize,
    /// An unfinished candidate is given up when its cost is more than this many times that of the best minimum. Half
    /// fails on two of 330 scenes more, double on none.
    pub hopeless_ratio: f64,
    /// Minimum degrees of freedom with which the cost alone identifies the right minimum when the first iterations did
    /// not reach it: such minima are wrong more often. Not sensitive.
    pub sure_freedom: usize,
}

impl Default for MinimaOptions {
    fn default() -> Self {
        Self {
            first_iterations: 8,
            max_finished: 3,
            finished_iterations: 100,
            hopeless_ratio: 30.0,
            sure_freedom: 45,
        }
    }
}

/// Options of alternative positions of single landmarks and views. Lengths are in sizes of the map: root-mean-square
/// distance of the views.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct MoveOptions {
    /// A position is worth a refinement when the cost there, with all else held fixed, is higher by at most this many
    /// times the variance of the residuals. Not sensitive.
    pub worth: f64,
    /// The same where the views see less than `partial` of the landmarks on average: a landmark of few sightings moves its
    /// views with it, and their wrong minima are farther apart. Only there views are moved as well. Most of these
    /// refinements are in vain, and would take as long as the whole search of a full table.
    pub partial_worth: f64,
    /// What part of the landmarks that is.
    pub partial: f64,
    /// Distance at which a landmark starts from the view that it moves onto, or the reverse, and minimum distance of a start from the present position. Not
    /// sensitive.
    pub off: f64,
    /// Distance at which a landmark that may be at infinity starts. Not sensitive.
    pub away: f64,
    /// Alternative positions that are tried in a round: so many of landmarks and so many of views. Not sensitive.
    pub tried: usize,
    /// The same where the best map fits worse than the stated standard deviations allow, or leaves something out.
    pub persistent_tried: usize,
    /// Maximum number of such rounds; one that does not lower the cost is the last. Not sensitive.
    pub rounds: usize,
    /// Iterations that each of them gets: one that is no better by then converges slowly because it is worse. Not
    /// sensitive.
    pub iterations: usize,
    /// Ranges, in sizes of the map, at which a landmark at infinity starts once more, all else being as it is. They are
    /// given the iterations of a start: views have to follow it.
    pub back: [f64; 4],
    /// Range from a view, in sizes of the map, below which a landmark is exchanged with one at infinity.
    pub beside: f64,
    /// Sightings up to which a landmark at infinity or on a view is tried on each of its other views.
    pub few: usize,
    /// Maximum number of each kind of these starts in a round: all ranges of eight landmarks, the nearest of more.
    pub most_back: usize,
}

impl Default for MoveOptions {
    fn default() -> Self {
        Self {
            worth: 10.0,
            partial_worth: 1000.0,
            partial: 0.75,
            off: 0.02,
            away: 30.0,
            tried: 4,
            persistent_tried: 20,
            rounds: 10,
            iterations: 10,
            back: [0.3, 1.0, 3.0, 10.0],
            beside: 0.1,
            few: 4,
            most_back: 32,
        }
    }
}
