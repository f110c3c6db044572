// SPDX-License-Identifier: MIT OR Apache-2.0
//! What the bearings determine, what they do not, and why.
//!
//! `docs/theory.md` explains the geometry, `docs/diagnosis.md` lists the findings.

mod diagnose;
mod finding;
mod fit_findings;
mod maps;
mod options;
mod parts;
mod report;
mod sentences;
mod shapes;
mod verdict;

pub use diagnose::{diagnose, diagnose_with};
pub use finding::{Finding, Kind, Severity};
pub use fit_findings::fit_findings;
pub use options::{DiagnosisOptions, MapOptions, ShapeOptions, VerdictOptions};
pub use parts::components::Part;
pub use report::{Diagnosis, NullDirection};
