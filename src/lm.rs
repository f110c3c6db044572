// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nonlinear least squares, whatever the storage.

mod loss;
mod termination;

pub use loss::Loss;
pub use termination::Termination;
