// SPDX-License-Identifier: MIT OR Apache-2.0
//! Wrong identities put right by a map.

use super::convert::{self, Floats};
use super::errors;
use super::request::Request;
use crate::SolveOptions;
use alloc::vec::Vec;
use pyo3::prelude::*;

/// Of each bearing that has changed its landmark: place, view, landmark before and after.
#[pyfunction]
pub fn relabel<'py>(
    py: Python<'py>,
    request: Request<'py>,
    poses: Floats<'py>,
    landmarks: Floats<'py>,
) -> PyResult<Vec<[usize; 4]>> {
    let problem = request.read(py)?;
    let map = convert::map(py, &poses, &landmarks)?;
    let (_, changes) = py
        .detach(|| crate::relabel(&problem, &map, &SolveOptions::default()))
        .map_err(|error| errors::error(py, error))?;
    Ok(changes
        .iter()
        .map(|one| [one.sighting, one.view, one.from, one.to])
        .collect())
}
