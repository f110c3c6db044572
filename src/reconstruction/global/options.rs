// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the global method: triples, headings, positions.

/// Options of the choice of triples for relative headings.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RelativeHeadingOptions {
    /// Triples that are drawn for each view. Not sensitive, but the time is proportional to it.
    pub per_view: usize,
    /// Minimum number of triples that are drawn. Not sensitive.
    pub fewest: usize,
    /// Triples that are kept for each view, the best conditioned. Not sensitive.
    pub kept: usize,
    /// Landmarks that a triple must share: six, so that one is redundant, then five, the minimum. Half, too few for the
    /// tensor, fails on all 22 scenes, double on four.
    pub shared: [usize; 2],
}

impl Default for RelativeHeadingOptions {
    fn default() -> Self {
        Self {
            per_view: 48,
            fewest: 200,
            kept: 24,
            shared: [6, 5],
        }
    }
}

/// Options of the averaging of headings.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AveragingOptions {
    /// Maximum number of rounds of reweighting: the branches settle in the first few, the weights in about ten. Not
    /// sensitive.
    pub rounds: usize,
    /// Width of the Cauchy weight, in medians of residual times quality. A width of 2.4 sigma gives the usual 95 %
    /// efficiency for Gaussian errors, whose median absolute value is 0.67 sigma. Not sensitive.
    pub cauchy_medians: f64,
    /// The averaging ends when no heading changes by more than this \[rad\]. Not sensitive.
    pub tolerance: f64,
}

impl Default for AveragingOptions {
    fn default() -> Self {
        Self {
            rounds: 15,
            cauchy_medians: 2.4 / 0.67,
            tolerance: 1e-6,
        }
    }
}

/// Options of the linear system for all positions.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct PositionOptions {
    /// Rounds of reweighting: each divides the rows by the ranges that the previous round found. Not sensitive.
    pub rounds: usize,
    /// Steps of inverse iteration in a round. The next round starts from the result. Not sensitive.
    pub steps: usize,
    /// Smallest range used for weighting, as a fraction of the median: otherwise one bad sighting could dominate. Not
    /// sensitive.
    pub nearest: f64,
    /// A landmark is not placed when its rays spread less than this: smaller over larger eigenvalue of their
    /// information, about the square of half the parallax in radians. Not sensitive.
    pub spread: f64,
}

impl Default for PositionOptions {
    fn default() -> Self {
        Self {
            rounds: 6,
            steps: 3,
            nearest: 0.1,
            spread: 1e-4,
        }
    }
}
