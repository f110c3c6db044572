// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a test of a fit can say, and from where on it does.

use super::distributions::upper_tail;
use crate::problem::Subject;
use crate::reconstruction::IdentityOptions;
use alloc::vec::Vec;

/// Thresholds of the tests.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct TestOptions {
    /// Probability of a right fit below which it is noted that sigma is understated, or overstated.
    pub significance: f64,
    /// Nobody knows sigma better than to this factor: within it a fit is no reason for a warning.
    pub tolerated_factor: f64,
    /// Probability of a fit with errors that are so many times what is stated, below which there is a warning.
    pub tolerated_significance: f64,
    /// Probability of naming an observation of a right fit.
    pub blunder_significance: f64,
    /// Most observations that are named, one after the other.
    pub most_blunders: usize,
    /// A sensor that is turned or mirrored explains a poor fit that with it is good, or has less than this share of the
    /// squares: other errors may be there as well.
    pub explained: f64,
    /// Angle \[rad\] from which on a sensor is far off: beyond what a mount is adjusted by.
    pub far_off: f64,
    /// Share of the degrees of freedom that the map of a sensor that is far off, or mirrored, may lack: landmarks that a
    /// contradictory map places may have no range in the right one.
    pub lost: f64,
    /// Single observations are tested where the probability of the fit is below this, ...
    pub suspicious: f64,
    /// ... or a residual is above so many standard deviations: the tests take as long as a covariance.
    pub suspicious_deviations: f64,
    /// Degrees of freedom for each outlier below which the inliers of a robust map may agree by chance, unless it explains
    /// enough once identities are assigned anew. By counting, 12 x 15 with 40 % wrong leaves 0.6. Chosen, not set from data:
    /// maps of which one view or landmark is wrong have more (`benches/identities.rs`).
    pub weak_spare: f64,
    /// The share of the bearings that is enough, as `believed` of [`IdentityOptions`].
    pub believed: f64,
    /// Most numbers, observations times unknowns, with which they are tested nevertheless: a second of work.
    pub most_numbers: usize,
}

impl Default for TestOptions {
    fn default() -> Self {
        Self {
            significance: 1e-3,
            tolerated_factor: 1.5,
            tolerated_significance: 0.02,
            blunder_significance: 5e-4,
            most_blunders: 10,
            explained: 0.1,
            far_off: 0.2,
            lost: 0.1,
            suspicious: 0.05,
            suspicious_deviations: 3.0,
            weak_spare: 0.55,
            believed: IdentityOptions::default().believed,
            most_numbers: 20_000_000,
        }
    }
}

/// An observation, by its place in the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Observation {
    /// A sighting.
    Sighting(usize),
    /// A motion.
    Odometry(usize),
    /// A prior on a pose.
    PosePrior(usize),
    /// A prior on a landmark.
    LandmarkPrior(usize),
}

/// What is wrong with a fit.
#[derive(Clone, Debug, PartialEq)]
pub enum Alarm {
    /// A robust map leaves so many outliers that its inliers may agree by chance, and exchanged identities do not explain
    /// them.
    WeakConsensus {
        /// Number of outliers.
        outliers: usize,
        /// Share of the bearings that the map explains once their identities are assigned anew.
        explained: f64,
    },
    /// The residuals are larger than errors of one and a half times the stated standard deviations would be.
    PoorFit,
    /// An observation contradicts the others, as long as those that are named before it are left out.
    Blunder {
        /// Which one.
        observation: Observation,
        /// Its standardized residual.
        standardized: f64,
    },
    /// The bearings of some views or landmarks contradict the map, which leaves them out.
    LeftOut {
        /// The views and landmarks.
        subjects: Vec<Subject>,
    },
    /// All bearings of a sensor are turned by one angle.
    TurnedBearings {
        /// The views of the sensor.
        views: Vec<usize>,
        /// By how much they are larger than they should be \[rad\].
        angle: f64,
    },
    /// All bearings are clockwise: the mirror image fits.
    MirroredBearings,
    /// The residuals are larger than the stated standard deviations predict, but not by much.
    UnderstatedSigma,
    /// The residuals are smaller than the stated standard deviations predict.
    OverstatedSigma,
}

/// Whether residuals are larger than errors of what is tolerated would be.
pub fn is_poor(square: f64, freedom: usize, options: &TestOptions) -> bool {
    let freedom = freedom as f64;
    let tolerated = square / (options.tolerated_factor * options.tolerated_factor);
    upper_tail(square, freedom) < options.significance
        && upper_tail(tolerated, freedom) < options.tolerated_significance
}
