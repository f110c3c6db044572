// SPDX-License-Identifier: MIT OR Apache-2.0
//! Non-linear least squares for any storage: one loop, one linearised bearing, one landmark step.
//!
//! Nothing here allocates or panics. Bundles on the heap and maps of fixed size are both
//! [`LeastSquares`] problems for [`minimize`].

mod bearing_residual;
mod loss;
mod minimize;
mod options;
mod prediction;
mod termination;

pub use bearing_residual::{BearingRow, LandmarkNormal, Ray, SightingModel, optimize_landmark};
pub use loss::{LOSS_WIDTHS, Loss};
pub use minimize::{LeastSquares, Outcome, Trial, minimize, rounding};
pub use options::{Observer, RefineOptions, ZERO_PIVOT_EPS};
pub use prediction::Prediction;
pub use termination::Termination;
