// SPDX-License-Identifier: MIT OR Apache-2.0
//! Findings as texts and numbers.

use crate::Finding;
use alloc::string::String;
use alloc::vec::Vec;
use pyo3::prelude::*;

/// The contents of the package's `Finding`.
#[derive(IntoPyObject)]
pub struct RawFinding {
    name: &'static str,
    severity: &'static str,
    views: Vec<usize>,
    landmarks: Vec<usize>,
    directions: usize,
    message: String,
    advice: String,
}

impl From<&Finding> for RawFinding {
    fn from(finding: &Finding) -> Self {
        Self {
            name: finding.kind.name(),
            severity: finding.severity.name(),
            views: finding.views.clone(),
            landmarks: finding.landmarks.clone(),
            directions: finding.directions,
            message: finding.message.clone(),
            advice: finding.advice.clone(),
        }
    }
}
