// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the global method: triples, headings, positions.

/// Options of the choice of triples for relative headings.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RelativeHeadingOptions {
    /// Triples that are drawn for each view.
    pub per_view: usize,
    /// Fewest triples that are drawn.
    pub fewest: usize,
    /// The best conditioned of them that are kept for each view.
    pub kept: usize,
    /// Landmarks that a triple must share: six, so that one checks it, five where there are no more.
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
    /// Most rounds of reweighting: the branches are decided in the first few, the weights in about ten.
    pub rounds: usize,
    /// The width of Cauchy's weight in medians of residual times quality: residuals of a typical triple count fully,
    /// larger ones less. A width of 2.4 is the usual 95 % of efficiency for Gaussian errors, whose median is 0.67.
    pub cauchy_medians: f64,
    /// The averaging ends when no heading turns by more than this \[rad\].
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
    /// Rounds of reweighting: rows are divided by the range of the round before.
    pub rounds: usize,
    /// Steps of inverse iteration in a round. The next round goes on from where this one ends.
    pub steps: usize,
    /// No range counts as less than this part of the median, or one bad sighting would rule the system.
    pub nearest: f64,
    /// Rays whose directions spread less than this (smaller over larger eigenvalue of their information: about the
    /// square of half the parallax in radians) place no landmark.
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
