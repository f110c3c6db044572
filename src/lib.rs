// SPDX-License-Identifier: MIT OR Apache-2.0
#![no_std]
#![deny(unsafe_code)]
#![warn(missing_docs)]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

mod error;
mod geometry;
mod kernels;
mod scalar;

pub use error::Error;
pub use geometry::{Bearing, Pose, align, bearing_to, pose, signed_angle, transform_pose};
pub use kernels::*;
pub use scalar::Real;
