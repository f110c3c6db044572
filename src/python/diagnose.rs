// SPDX-License-Identifier: MIT OR Apache-2.0
//! The diagnosis as arrays and numbers.

use super::convert::{self, Floats};
use super::finding::RawFinding;
use super::observer::InterpreterObserver;
use super::reconstruction::subject;
use super::request::Request;
use crate::{Diagnosis, NullDirection, Part};
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use numpy::PyArray1;
use pyo3::prelude::*;

/// The contents of the package's `Diagnosis`.
#[derive(IntoPyObject)]
pub struct RawDiagnosis<'py> {
    views: usize,
    landmarks: usize,
    sightings: usize,
    determined: bool,
    extra: usize,
    singular_values: Bound<'py, PyArray1<f64>>,
    condition: f64,
    noise: f64,
    near_collinear: bool,
    mirror_margin: f64,
    components: Vec<RawComponent>,
    null_directions: Vec<RawDirection>,
    findings: Vec<RawFinding>,
    text: String,
}

#[derive(IntoPyObject)]
struct RawComponent {
    views: Vec<usize>,
    landmarks: Vec<usize>,
    sightings: usize,
    freedom: i64,
}

#[derive(IntoPyObject)]
struct RawDirection {
    free: bool,
    singular_value: f64,
    deviation: f64,
    /// Kind, index, share.
    movers: Vec<(&'static str, usize, f64)>,
    cause: Option<&'static str>,
}

#[pyfunction]
pub fn diagnose<'py>(
    py: Python<'py>,
    request: Request<'py>,
    poses: Option<Floats<'py>>,
    landmarks: Option<Floats<'py>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<RawDiagnosis<'py>> {
    let problem = request.read(py)?;
    let map = match (poses, landmarks) {
        (Some(poses), Some(landmarks)) => Some(convert::map(py, &poses, &landmarks)?),
        _ => None,
    };
    let found = InterpreterObserver::run(py, progress, |watch| {
        crate::diagnose(&problem, map.as_ref(), Some(watch))
    })?;
    Ok(RawDiagnosis::of(py, &found))
}

impl<'py> RawDiagnosis<'py> {
    fn of(py: Python<'py>, found: &Diagnosis) -> Self {
        Self {
            views: found.views,
            landmarks: found.landmarks,
            sightings: found.sightings,
            determined: found.determined(),
            extra: found.extra,
            singular_values: PyArray1::from_slice(py, &found.singular_values),
            condition: found.condition,
            noise: found.noise,
            near_collinear: found.near_collinear,
            mirror_margin: found.mirror_margin,
            components: found.components.iter().map(RawComponent::from).collect(),
            null_directions: found.directions.iter().map(RawDirection::from).collect(),
            findings: found.findings.iter().map(RawFinding::from).collect(),
            text: found.to_string(),
        }
    }
}

impl From<&Part> for RawComponent {
    fn from(part: &Part) -> Self {
        Self {
            views: part.views.clone(),
            landmarks: part.landmarks.clone(),
            sightings: part.sightings,
            freedom: part.freedom(),
        }
    }
}

impl From<&NullDirection> for RawDirection {
    fn from(direction: &NullDirection) -> Self {
        let movers = direction.movers.iter().map(|&(moved, share)| {
            let (kind, index) = subject(moved);
            (kind, index, share)
        });
        Self {
            free: direction.free,
            singular_value: direction.singular_value,
            deviation: direction.deviation,
            movers: movers.collect(),
            cause: direction.cause.map(|kind| kind.name()),
        }
    }
}
