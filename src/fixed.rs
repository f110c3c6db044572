// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps in storage of fixed size: they grow scan by scan and are refined without a heap.
//!
//! A [`FixedMap`] holds up to `M` views and `N` landmarks in memory of the caller, for example a
//! static; the refinement uses a separate [`Workspace`]. Nothing here panics on an index, recurses or
//! loops without a bound.

mod cholesky;
mod growth;
mod map;
mod refine;
mod workspace;

pub use growth::Branch;
pub use map::FixedMap;
pub use workspace::Workspace;
