// SPDX-License-Identifier: MIT OR Apache-2.0
//! The C interface: plain arrays in, plain arrays and a status out. `include/bearslam.h` is made from it.
//!
//! Angles are radians. A pose is `x, y, heading`, a landmark `x, y`; arrays are row by row. A bearing that
//! is NaN has not been seen. Nothing allocates, nothing panics, and no call keeps a pointer. With any status
//! but [`BearslamStatus::Ok`] and [`BearslamStatus::NotConverged`] nothing has been written.
//!
//! # Safety
//! Holds for every function: a pointer that is not null has room for the numbers that its argument
//! names, and what a call writes overlaps nothing else that it is given. Null and misaligned pointers are
//! told by the status.

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
