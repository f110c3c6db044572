// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps from bearings with odometry and priors.

mod attempts;
mod choices;
mod compass;
pub(super) mod complete;
mod far_starts;
mod frames;
mod growth;
mod headings;
mod known;
mod least_squares;
pub(crate) mod options;
mod parts;
pub(crate) mod posterior;
mod ray_ends;
mod robust_start;
mod smallest_sets;
mod sweeps;
