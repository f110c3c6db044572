// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of a solve, and reports of progress.

use super::stages::StageOptions;
use crate::error::Error;
use crate::kernels::Method;
use crate::lm::RefineOptions;

/// How a first map is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Strategy {
    /// Many triples of views, both branches of each; the best few refined. Under limited sight (more than 40
    /// views, or at least eight that see less than 60 % of the landmarks on average) as `Incremental`.
    Search,
    /// Well-conditioned triples of views grown by resection and triangulation, with refinement in
    /// between; several maps where the views are not connected.
    Incremental,
    /// All views at once: headings by rotation averaging over many triples, then one linear system for
    /// all positions and landmarks.
    Global,
    /// The method of Dellaert and Stroupe (2002) from the first three views, with their tensor or the
    /// calibrated one.
    FirstViews(Method),
}

/// How wide a search is.
///
/// `docs/accuracy.md` says how often the defaults miss the best known minimum, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SearchOptions {
    /// Triples of views whose tensor is estimated.
    pub triples: usize,
    /// How many of them, the best conditioned, are grown to whole maps, both branches of each.
    pub grown: usize,
    /// Maximum number of maps that are refined; fewer when one is plausible or two agree.
    pub candidates: usize,
    /// If the candidates leave doubt, the number of best-conditioned triples whose tensor is varied along
    /// the direction that the bearings determine least; twice as many candidates are then refined. Zero
    /// disables this.
    pub swept: usize,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            triples: 24,
            grown: 6,
            candidates: 6,
            swept: 4,
        }
    }
}

/// Options of [`solve`](crate::solve) and [`initialize`](crate::initialize).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SolveOptions {
    /// How a first map is found.
    pub strategy: Strategy,
    /// How wide the search is, for [`Strategy::Search`] without limited sight.
    pub search: SearchOptions,
    /// Options of the refinement.
    pub refine: RefineOptions,
    /// Seed of all random draws: the same seed gives the same bits.
    pub seed: u64,
    /// Find outliers, gross errors of any kind, and exclude them. Needs the standard deviations of the
    /// bearings: an outlier is a bearing whose residual exceeds three of them. The strategy applies to the
    /// final search over the inliers. [`initialize`](crate::initialize) ignores this option.
    pub robust: bool,
    /// Verify the map: bound where the tensor of three views is in all maps of lower cost, a cone, and search that cone
    /// cell by cell. A lower map that is found is returned in its place;
    /// [`Reconstruction::certificate`](crate::Reconstruction::certificate) tells what was shown. For squared residuals
    /// only, without `robust`. [`initialize`](crate::initialize) ignores this option.
    pub verify: bool,
    /// Thresholds of the stages, for experiments: the defaults suit any problem.
    pub stages: StageOptions,
}

impl Default for SolveOptions {
    fn default() -> Self {
        Self {
            strategy: Strategy::Search,
            search: SearchOptions::default(),
            refine: RefineOptions::default(),
            seed: 0,
            robust: false,
            verify: false,
            stages: StageOptions::default(),
        }
    }
}

/// Called at intervals with the stage, the steps done and the number of steps; returning `false` stops the work.
pub type Progress<'a> = &'a mut dyn FnMut(&'static str, usize, usize) -> bool;

/// Reports progress to a caller who asked for it; `false` when the work is to stop.
pub fn report_progress(
    progress: &mut Option<Progress<'_>>,
    stage: &'static str,
    done: usize,
    all: usize,
) -> bool {
    progress
        .as_mut()
        .is_none_or(|progress| progress(stage, done, all))
}

/// As [`report_progress`], with an error when the work is to stop.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn goes_on(
    progress: &mut Option<Progress<'_>>,
    stage: &'static str,
    done: usize,
    all: usize,
) -> Result<(), Error> {
    let goes_on = report_progress(progress, stage, done, all);
    goes_on.then_some(()).ok_or(Error::Interrupted)
}
