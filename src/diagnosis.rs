// SPDX-License-Identifier: MIT OR Apache-2.0
//! What bearings can determine, what they cannot, and why: by name.
//!
//! `docs/theory.md` has the geometry, `docs/diagnosis.md` the list of findings.

mod appearance;
mod beyond;
mod cause;
mod counting;
mod describe;
mod diagnose;
mod evidence;
mod examine;
mod family;
mod figure;
mod finding;
mod fold;
mod movers;
mod own;
mod report;
mod shape;
mod spectrum;
mod structure;
mod verdict;
mod words;

pub use diagnose::diagnose;
pub use finding::{Finding, Kind, Severity};
pub use report::{Diagnosis, NullDirection};
pub use structure::Part;
