// SPDX-License-Identifier: MIT OR Apache-2.0
//! The diagnosis as a dictionary.

use super::convert::{self, Floats};
use super::problem::RawProblem;
use super::watch::Watcher;
use crate::{Diagnosis, Subject};
use alloc::vec::Vec;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::format;

#[pyfunction]
pub fn diagnose<'py>(
    py: Python<'py>,
    problem: RawProblem<'py>,
    poses: Option<Floats<'py>>,
    landmarks: Option<Floats<'py>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let problem = problem.read(py)?;
    let map = match (poses, landmarks) {
        (Some(poses), Some(landmarks)) => Some(convert::map(py, &poses, &landmarks)?),
        _ => None,
    };
    let found = Watcher::run(py, progress, |watch| {
        crate::diagnose(&problem, map.as_ref(), Some(watch))
    })?;
    to_dict(py, &found)
}

fn to_dict<'py>(py: Python<'py>, found: &Diagnosis) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("views", found.views)?;
    dict.set_item("landmarks", found.landmarks)?;
    dict.set_item("sightings", found.sightings)?;
    dict.set_item("determined", found.determined())?;
    dict.set_item("extra", found.extra)?;
    let values = PyArray1::from_slice(py, &found.singular_values);
    dict.set_item("singular_values", values)?;
    dict.set_item("condition", found.condition)?;
    dict.set_item("noise", found.noise)?;
    dict.set_item("near_collinear", found.near_collinear)?;
    dict.set_item("mirror_margin", found.mirror_margin)?;
    let components: Vec<_> = found
        .components
        .iter()
        .map(|part| {
            (
                part.views.clone(),
                part.landmarks.clone(),
                part.sightings,
                part.freedom(),
            )
        })
        .collect();
    dict.set_item("components", components)?;
    let directions: Vec<_> = found
        .directions
        .iter()
        .map(|direction| {
            let movers: Vec<_> = direction
                .movers
                .iter()
                .map(|&(subject, share)| match subject {
                    Subject::View(index) => ("view", index, share),
                    Subject::Landmark(index) => ("landmark", index, share),
                })
                .collect();
            (
                direction.free,
                direction.singular_value,
                direction.deviation,
                movers,
                direction.cause.map(|kind| kind.name()),
            )
        })
        .collect();
    dict.set_item("null_directions", directions)?;
    let findings: Vec<_> = found
        .findings
        .iter()
        .map(|finding| {
            (
                finding.kind.name(),
                finding.severity.name(),
                finding.views.clone(),
                finding.landmarks.clone(),
                finding.directions,
                finding.message.clone(),
                finding.advice.clone(),
            )
        })
        .collect();
    dict.set_item("findings", findings)?;
    dict.set_item("text", format!("{found}"))?;
    Ok(dict)
}
