// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps in storage of fixed size: they grow scan by scan and are refined without a heap.
//!
//! A [`FixedMap`] holds up to `M` views and `N` landmarks and lives where the caller puts it, in a
//! static for example; the refinement works in a [`Workspace`] beside it. Nothing here indexes,
//! recurses or loops without a bound.

mod cholesky;
mod growth;
mod map;
mod refine;
mod workspace;

pub use growth::Branch;
pub use map::FixedMap;
pub use workspace::Workspace;
