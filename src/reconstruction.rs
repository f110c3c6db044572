// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps of many views from nothing.

mod anchored;
mod bounded;
mod circle;
mod edges;
mod expand;
mod global;
mod incremental;
mod minima;
mod options;
mod paper;
mod posterior;
mod result;
mod robust;
mod search;
mod sight;
mod solve;
mod triples;
mod witness;

pub use options::{Progress, Search, SolveOptions, Strategy};
pub use result::Reconstruction;
pub use solve::{initialize, refine, solve};
pub(crate) use witness::{Witness, explaining, mirror_images, seed, witness};
