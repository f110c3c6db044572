// SPDX-License-Identifier: MIT OR Apache-2.0
//! Triangulation, resection, alignment.

use super::convert::{self, Floats};
use super::errors;
use alloc::vec::Vec;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

#[pyfunction]
pub fn triangulate<'py>(
    py: Python<'py>,
    poses: Floats<'py>,
    bearings: Floats<'py>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let poses = convert::finite_poses(py, "poses", &poses)?;
    let (bearings, columns) = convert::table(py, "bearings", &bearings, poses.len())?;
    let landmarks = py.detach(|| {
        (0..columns)
            .map(|landmark| {
                let rays = poses.iter().enumerate().filter_map(|(view, pose)| {
                    let bearing = bearings[view * columns + landmark];
                    (!bearing.is_nan()).then(|| (*pose, crate::Bearing::new(bearing)))
                });
                crate::triangulate(rays).ok().map(|found| found.point)
            })
            .collect::<Vec<_>>()
    });
    Ok(convert::points(py, &landmarks))
}

#[pyfunction]
pub fn resect<'py>(
    py: Python<'py>,
    landmarks: Floats<'py>,
    bearings: Floats<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let points = convert::finite_points(py, "landmarks", &landmarks)?;
    let (bearings, _) = convert::vector(py, "bearings", &bearings, Some(points.len()))?;
    let sightings: Vec<_> = points
        .into_iter()
        .zip(bearings)
        .filter(|(_, bearing)| !bearing.is_nan())
        .map(|(point, bearing)| (point, crate::Bearing::new(bearing)))
        .collect();
    let found = py
        .detach(|| crate::resect(sightings.iter().copied()))
        .map_err(|error| errors::error(py, error))?;
    Ok(PyArray1::from_slice(py, &convert::triplet(&found.pose)))
}

#[pyfunction]
pub fn align(
    py: Python<'_>,
    source: Floats<'_>,
    target: Floats<'_>,
) -> PyResult<(f64, f64, f64, f64)> {
    let source = convert::finite_points(py, "source", &source)?;
    let target = convert::finite_points(py, "target", &target)?;
    let found = crate::align(&source, &target).map_err(|error| errors::error(py, error))?;
    let shift = found.isometry.translation;
    Ok((
        found.scaling(),
        convert::angle(&found.isometry.rotation),
        shift.x,
        shift.y,
    ))
}
