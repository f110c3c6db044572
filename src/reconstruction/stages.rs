// SPDX-License-Identifier: MIT OR Apache-2.0
//! The options of all stages, in one place for a caller who varies them.
//!
//! `cargo bench --bench thresholds --features rayon,serde -- 3` counts the solves that fail, as defined there, with
//! half and with double of each default, on the scenes that use the option: 90 for the search, 9 along odometry, 6 each
//! with limited sight, for the global method, with outliers, and with outliers and only four landmarks, and 3 along
//! odometry with outliers. Options for which a count changed were measured again with `-- 8 1000`; their figures are of
//! both runs together. *Not sensitive*: neither half nor double changes the number of failures by more than one, which
//! may be chance. So few scenes show frequent failures only; along odometry with outliers, eight of eleven solves fail
//! with the defaults.

use super::global::options::{AveragingOptions, PositionOptions, RelativeHeadingOptions};
use super::incremental::options::IncrementalOptions;
use super::infinity::InfinityOptions;
use super::judge::JudgeOptions;
use super::odometry::options::{
    HeadingOptions, OdometryGrowthOptions, OdometrySweepOptions, PosteriorOptions,
    RobustGrowthOptions, StrideOptions,
};
use super::robust::options::{IdentityOptions, RegrowthOptions, RobustOptions};
use super::search::options::{DrawOptions, HypothesisOptions, MinimaOptions, MoveOptions};
use super::sight::SightOptions;
use super::verify::options::VerifyOptions;

/// The thresholds, counts and tolerances of the stages of a reconstruction.
///
/// The defaults suit any problem; other values are for experiments, and may make a solve slower or miss the
/// best map, but never panic.
///
/// # Example
/// ```
/// use bearslam::{Arena, Layout, Problem, SolveOptions, simulate, solve};
/// let scene = simulate(Layout::Mixed, 12, 9, 0.01, 7, Arena::default())?;
/// let problem = Problem::dense(12, 9, &scene.bearings, 0.01)?;
/// let mut options = SolveOptions::default();
/// // As if sight were limited: grown view by view.
/// options.stages.sight.many_views = 10;
/// let grown = solve(&problem, &options, None)?;
/// let searched = solve(&problem, &SolveOptions::default(), None)?;
/// assert!((grown.cost / searched.cost - 1.0).abs() < 1e-6);
/// # Ok::<(), bearslam::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct StageOptions {
    /// When sight is limited, so that a map grows view by view.
    pub sight: SightOptions,
    /// How triples of views are drawn.
    pub draw: DrawOptions,
    /// Which hypotheses of the search are kept.
    pub hypotheses: HypothesisOptions,
    /// How far hypotheses are refined.
    pub minima: MinimaOptions,
    /// Which alternative positions of landmarks are tried.
    pub moves: MoveOptions,
    /// Growth view by view, for limited sight and [`Strategy::Incremental`](crate::Strategy::Incremental).
    pub incremental: IncrementalOptions,
    /// Which triples the global method uses.
    pub relative_headings: RelativeHeadingOptions,
    /// How the global method averages headings.
    pub averaging: AveragingOptions,
    /// How the global method finds positions.
    pub positions: PositionOptions,
    /// When a map is plausible, and which others are its rivals.
    pub judge: JudgeOptions,
    /// When a landmark is at infinity.
    pub infinity: InfinityOptions,
    /// Bearings with outliers: [`SolveOptions::robust`](crate::SolveOptions::robust).
    pub robust: RobustOptions,
    /// How bearings are assigned to landmarks whatever their labels.
    pub identities: IdentityOptions,
    /// Which parts of a map with outliers are grown again under limited sight.
    pub regrowth: RegrowthOptions,
    /// Which starts are tried with odometry or priors.
    pub posterior: PosteriorOptions,
    /// Growth along odometry, of both kinds.
    pub odometry_growth: OdometryGrowthOptions,
    /// Headings of views whose positions are known.
    pub headings: HeadingOptions,
    /// Growth along odometry by least squares.
    pub stride: StrideOptions,
    /// Growth along odometry with outliers.
    pub robust_growth: RobustGrowthOptions,
    /// Sweeps along odometry with outliers.
    pub odometry_sweeps: OdometrySweepOptions,
    /// How a map is verified: [`SolveOptions::verify`](crate::SolveOptions::verify).
    pub verify: VerifyOptions,
}
