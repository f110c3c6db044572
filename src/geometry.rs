// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bearings, poses and similarities of the plane.

mod align;
mod bearing;
pub(crate) mod points;
#[cfg(all(feature = "serde", feature = "alloc"))]
pub(crate) mod serialized;

pub use align::{align, transform_pose};
pub use bearing::{Bearing, Pose, bearing_to, is_ahead, pose, signed_angle, xytheta};
