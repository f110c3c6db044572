// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps of many views from nothing.

mod attempt;
pub(crate) mod global;
pub(crate) mod grow;
mod incremental;
mod infinity;
pub(crate) mod judge;
mod odometry;
mod options;
mod result;
mod robust;
pub(crate) mod search;
mod solve;
pub(crate) mod strategy;

pub(crate) use options::report_progress;
pub use options::{Progress, SearchOptions, SolveOptions, Strategy};
pub use result::Reconstruction;
pub use solve::{initialize, refine, solve};
