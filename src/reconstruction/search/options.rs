// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the search: the draw of triples, hypotheses, minima, other places for landmarks.

/// Options of the draw of triples.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct DrawOptions {
    /// Views up to which all triples are listed; beyond, they are drawn: 40 views have 9880 triples.
    pub listed_views: usize,
    /// Draws per triple wanted when they are not listed.
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
    /// Most triples of views that are swept for four landmarks: any one finds all minima it can see.
    pub max_sweeps: usize,
    /// Two hypotheses closer than this (positions over the size of the map, headings in radians) end in the same
    /// minimum.
    pub cluster: f64,
    /// Most clusters that are looked at.
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

/// Options of the way from hypotheses to minima.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct MinimaOptions {
    /// Iterations that every candidate gets: in the basin of a good minimum it gets there in fewer.
    pub first_iterations: usize,
    /// Most unfinished candidates that go on.
    pub max_finished: usize,
    /// An unfinished candidate does not go on when its cost is so many times that of the best minimum.
    pub hopeless_ratio: f64,
    /// Fewest degrees of freedom with which the cost alone identifies the right minimum when the first iterations
    /// did not reach it: more of these are wrong.
    pub sure_freedom: usize,
    /// Other places of landmarks that are tried in a round.
    pub moves: usize,
    /// Rounds of such tries, each of which must have lowered the cost.
    pub move_rounds: usize,
    /// Iterations that each of them gets: what is not better by then is slow because it is worse.
    pub moved_iterations: usize,
}

impl Default for MinimaOptions {
    fn default() -> Self {
        Self {
            first_iterations: 8,
            max_finished: 3,
            hopeless_ratio: 30.0,
            sure_freedom: 45,
            moves: 4,
            move_rounds: 3,
            moved_iterations: 30,
        }
    }
}

/// Options of other places for landmarks. Lengths are in sizes of the map: root-mean-square distance of the views.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct LandmarkMoveOptions {
    /// A place is worth a refinement when the cost there, with the views where they are, is higher by at most so many
    /// times the variance of the residuals.
    pub worth: f64,
    /// How far off a view a landmark begins, and how far it must be from where it was.
    pub off: f64,
    /// How far out a landmark begins that may be at infinity.
    pub away: f64,
}

impl Default for LandmarkMoveOptions {
    fn default() -> Self {
        Self {
            worth: 10.0,
            off: 0.02,
            away: 30.0,
        }
    }
}
