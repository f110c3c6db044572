// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps of many views from nothing.

mod expand;
mod four;
mod paper;
mod result;
mod solve;
mod triples;

pub use result::Reconstruction;
pub use solve::{Progress, Search, SolveOptions, Strategy, initialize, refine, solve};
