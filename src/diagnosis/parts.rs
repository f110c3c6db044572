// SPDX-License-Identifier: MIT OR Apache-2.0
//! Counting of sightings: which parts of a problem can be determined at all.

pub mod components;
pub mod counting;
pub mod subproblem;
