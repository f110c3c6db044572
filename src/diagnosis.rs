// SPDX-License-Identifier: MIT OR Apache-2.0
//! What bearings can determine, what they cannot, and why: by name.
//!
//! `docs/theory.md` has the geometry, `docs/diagnosis.md` the list of findings.

mod beyond;
mod describe;
mod diagnose;
mod finding;
mod maps;
mod parts;
mod report;
mod shapes;
mod verdict;
mod words;

pub use diagnose::diagnose;
pub use finding::{Finding, Kind, Severity};
pub use parts::components::Part;
pub use report::{Diagnosis, NullDirection};
