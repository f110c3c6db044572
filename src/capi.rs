// SPDX-License-Identifier: MIT OR Apache-2.0
//! The C interface: plain arrays in, plain arrays and a status out. `include/bearslam.h` is generated from it.
//!
//! Angles are in radians. A pose is `x, y, heading`, a landmark `x, y`; arrays are row by row. A bearing is NaN
//! where a view does not see a landmark. Nothing allocates or panics, and no call keeps a pointer. With any status
//! other than [`BearslamStatus::Ok`] and [`BearslamStatus::NotConverged`] nothing has been written.
//!
//! # Safety
//! For every function, each non-null pointer must have room for the numbers that the description of its argument
//! states, and what a call writes must not overlap any of its other arguments. Null and misaligned pointers are
//! reported by the status.

#[allow(unsafe_code, reason = "functions of C")]
mod calls;
mod generic;
#[allow(unsafe_code, reason = "pointers of C")]
mod memory;
mod status;

pub use calls::*;
pub use generic::{
    BEARSLAM_MAX_LANDMARKS, BEARSLAM_MAX_REWEIGHTS, BEARSLAM_MAX_TRIPLES, BEARSLAM_MAX_VIEWS,
    BearslamMethod,
};
pub use status::BearslamStatus;
