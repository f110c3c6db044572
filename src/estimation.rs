// SPDX-License-Identifier: MIT OR Apache-2.0
//! The nonlinear problem over all views: sightings, residuals, refinement.

mod bundle;
mod cholesky;
mod map;
mod problem;
mod refine;
mod schur;

pub(crate) use map::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK};
pub use map::{Map, Subject, Undetermined, Why};
pub use problem::{Problem, Seen, Sighting};
pub(crate) use refine::sensitivity;
pub use refine::{RefineOptions, Report, Termination, Watch, refine_map};
