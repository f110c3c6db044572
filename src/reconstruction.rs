// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps of many views from nothing.

mod bounded;
mod circle;
mod edges;
mod expand;
mod minima;
mod options;
mod paper;
mod result;
mod robust;
mod search;
mod solve;
mod triples;

pub use options::{Progress, Search, SolveOptions, Strategy};
pub use result::Reconstruction;
pub use solve::{initialize, refine, solve};
