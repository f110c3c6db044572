// SPDX-License-Identifier: MIT OR Apache-2.0
//! How well a map is known: covariances, sensitivity, weak directions, leverage.

mod covariance;
mod frame;
mod inverse_blocks;
mod leverage;
mod sensitivity;
mod variances;
mod weak_directions;

pub use covariance::{Covariance, covariance};
pub use frame::Frame;
pub(crate) use frame::LIFT;
pub(crate) use inverse_blocks::observe;
pub(crate) use leverage::Leverage;
pub(crate) use sensitivity::{sensitivity, unbounded_landmarks};
pub(crate) use variances::aligned_variances;
pub use weak_directions::WeakDirection;
pub(crate) use weak_directions::{SINGULAR_EQUATIONS, Watch, largest_first, weakest_directions};
