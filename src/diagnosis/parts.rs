// SPDX-License-Identifier: MIT OR Apache-2.0
//! What counting tells: which parts of a problem may be determined at all.

pub mod components;
pub mod counting;
pub mod subproblem;
