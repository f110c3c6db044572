// SPDX-License-Identifier: MIT OR Apache-2.0
#![no_std]
#![deny(unsafe_code)]
#![warn(missing_docs)]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

mod error;
#[cfg(feature = "alloc")]
mod estimation;
mod geometry;
mod kernels;
#[cfg(feature = "python")]
mod python;
#[cfg(feature = "alloc")]
mod reconstruction;
mod scalar;
#[cfg(feature = "alloc")]
mod simulate;

pub use error::Error;
#[cfg(feature = "alloc")]
pub use estimation::{
    Map, Problem, RefineOptions, Report, Seen, Sighting, Subject, Termination, Undetermined, Watch,
    Why, refine_map,
};
pub use geometry::{Bearing, Pose, align, bearing_to, pose, signed_angle, transform_pose};
pub use kernels::*;
#[cfg(feature = "alloc")]
pub use reconstruction::{
    Progress, Reconstruction, Search, SolveOptions, Strategy, initialize, refine, solve,
};
pub use scalar::Real;
#[cfg(feature = "alloc")]
pub use simulate::{Arena, Layout, Scene, simulate};
