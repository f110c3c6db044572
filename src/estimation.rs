// SPDX-License-Identifier: MIT OR Apache-2.0
//! The nonlinear problem over all views: sightings, residuals, refinement.

mod bundle;
mod cholesky;
mod descent;
mod influence;
mod linearized;
mod map;
mod newton;
mod problem;
mod refine;
mod schur;
mod sensitivity;
mod variances;

pub(crate) use influence::Influence;
pub(crate) use map::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK};
pub use map::{Map, Subject, Undetermined, Why};
pub use problem::{Problem, Seen, Sighting};
pub use refine::{RefineOptions, Report, Termination, Watch, refine_map};
pub(crate) use sensitivity::{sensitivity, unbounded_landmarks};
pub(crate) use variances::aligned_variances;
