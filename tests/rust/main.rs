// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tests of the crate from outside, one module per concept.

mod batch;
mod beyond;
#[cfg(feature = "capi")]
mod capi;
mod common;
mod degenerate;
mod diagnosis;
mod fixed;
mod header;
mod layers;
#[cfg(feature = "serde")]
mod leaves;
mod magnitudes;
mod posterior;
mod properties;
mod reference;
mod refinement;
mod robust;
#[cfg(feature = "serde")]
mod serialized;
mod shapes;
mod sight;
mod single;
mod solve;
#[cfg(feature = "serde")]
mod stages;
mod start;
#[cfg(feature = "rayon")]
mod sweep;
mod unoriented;
mod verify;
