// SPDX-License-Identifier: MIT OR Apache-2.0
//! The nonlinear problem over all views: sightings, residuals, refinement.

mod bundle;
mod cholesky;
mod covariance;
mod descent;
mod fit;
mod gauge;
mod influence;
mod linearized;
mod map;
mod newton;
mod normal;
mod priors;
mod problem;
mod refine;
mod schur;
mod sensitivity;
mod sparse;
mod variances;
mod weakest;

pub use covariance::{Covariance, Frame, covariance};
pub(crate) use fit::fitted;
pub(crate) use influence::Influence;
pub use map::{Map, Subject, Undetermined, Why};
pub(crate) use priors::Tie;
pub use priors::{LandmarkPrior, Noise, Odometry, PosePrior};
pub use problem::{Problem, Seen, Sighting};
pub use refine::{Report, Watch, refine_map};
pub(crate) use refine::{cost, cost_of_ties};
pub(crate) use sensitivity::{sensitivity, unbounded_landmarks};
pub(crate) use variances::aligned_variances;
pub(crate) use weakest::{Loose, loose_directions};

pub(crate) use crate::kernels::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK};
pub use crate::lm::{Loss, RefineOptions, Termination};
