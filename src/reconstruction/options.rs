// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a caller may choose, and how it is told of progress.

use super::stages::StageOptions;
use crate::kernels::Method;
use crate::lm::RefineOptions;

/// How a first map is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Strategy {
    /// Many triples of views, both branches of each; the best few refined. Under limited sight (more
    /// than 40 views, or eight and more that see less than 60 % of the landmarks) as `Incremental`.
    Search,
    /// Well conditioned triples of views grown by resection and triangulation, with refinement in
    /// between; several maps where the views are not connected.
    Incremental,
    /// All views at once: headings by rotation averaging over many triples, then one sparse linear
    /// system for all positions and landmarks.
    Global,
    /// The paper's path from the first three views, with its own or the calibrated tensor.
    FirstViews(Method),
}

/// How wide a search is.
///
/// `docs/accuracy.md` has how often the defaults miss the best known minimum, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SearchOptions {
    /// Triples of views whose tensor is estimated.
    pub triples: usize,
    /// The best conditioned of them, which are grown to whole maps, both branches.
    pub grown: usize,
    /// Most maps that are refined; fewer when the first or two that agree are enough.
    pub candidates: usize,
    /// Triples, the best conditioned, whose tensor is varied along the direction that the bearings
    /// determine least when the candidates leave doubt; twice as many candidates are then refined.
    /// Zero for none.
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
    /// How wide a search is: of [`Strategy::Search`], where it is effective.
    pub search: SearchOptions,
    /// Options of the refinement.
    pub refine: RefineOptions,
    /// Seed of the draw of triples: the same seed gives the same bits.
    pub seed: u64,
    /// Expect outliers: wrong bearings of any kind are found and left out. Needs the standard
    /// deviations of the bearings: an outlier is a bearing that misses by more than three of them. The
    /// strategy applies to the final search over the inliers. [`initialize`](crate::initialize) ignores
    /// this option.
    pub robust: bool,
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
            stages: StageOptions::default(),
        }
    }
}

/// Called now and then with the stage, the steps done and their number; `false` stops the work.
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
