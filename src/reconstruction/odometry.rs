// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps from bearings with odometry and priors.

mod growth;

pub(crate) mod posterior;
mod robust_growth;
mod robust_start;
mod sweeps;
