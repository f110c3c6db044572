// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps of many views without an initial guess.

mod alternatives;
mod attempt;
mod behind;
mod certificate;
pub(crate) mod choice;
mod collapsed;
mod far_views;
pub(crate) mod global;
pub(crate) mod grow;
mod home;
mod incremental;
mod infinity;
pub(crate) mod judge;
mod odometry;
mod options;
mod persist;
mod relabel;
mod result;
mod robust;
pub(crate) mod search;
mod sight;
mod solve;
mod stages;
pub(crate) mod strategy;
mod verify;

pub use certificate::{Certificate, Verdict};
pub use global::options::{AveragingOptions, PositionOptions, RelativeHeadingOptions};
pub use incremental::options::IncrementalOptions;
pub use infinity::InfinityOptions;
pub use judge::JudgeOptions;
pub use odometry::options::{
    HeadingOptions, OdometryGrowthOptions, OdometrySweepOptions, PosteriorOptions,
    RobustGrowthOptions, StrideOptions,
};
pub use options::{Progress, SearchOptions, SolveOptions, Strategy};
pub(crate) use options::{goes_on, report_progress};
pub use relabel::{LabelChange, relabel};
pub use result::Reconstruction;
pub use robust::options::{IdentityOptions, RegrowthOptions, RobustOptions};
pub use search::options::{DrawOptions, HypothesisOptions, MinimaOptions, MoveOptions};
pub use sight::SightOptions;
pub use solve::{initialize, refine, solve};
pub use stages::StageOptions;
pub use verify::options::VerifyOptions;
