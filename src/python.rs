// SPDX-License-Identifier: MIT OR Apache-2.0
//! The extension module `bearslam._core`: arrays in, one call without the interpreter, arrays out.
//!
//! No arithmetic happens here. The module has no state and is safe on free-threaded Python as long
//! as nobody writes into an array while a call reads it: what is needed is copied before the
//! interpreter is released.

mod convert;
mod diagnosis;
mod many;
mod problem;
mod result;
mod simulate;
mod solve;
mod sweep;
mod watch;

use crate::{Method, TrifocalTensor};
use alloc::vec::Vec;
use convert::Floats;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::format;

/// Linear algebra of bearings, compiled.
#[pymodule(gil_used = false)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    // NumPy is loaded with the first array: here, where an interruption is an error like any other.
    drop(PyArray1::<f64>::zeros(module.py(), 0, false));
    module.add_function(wrap_pyfunction!(three_view, module)?)?;
    module.add_function(wrap_pyfunction!(trifocal_tensor, module)?)?;
    module.add_function(wrap_pyfunction!(epipoles, module)?)?;
    module.add_function(wrap_pyfunction!(triangulate, module)?)?;
    module.add_function(wrap_pyfunction!(resect, module)?)?;
    module.add_function(wrap_pyfunction!(align, module)?)?;
    module.add_function(wrap_pyfunction!(diagnosis::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(solve::initialize, module)?)?;
    module.add_function(wrap_pyfunction!(solve::solve, module)?)?;
    module.add_function(wrap_pyfunction!(solve::refine, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::odometry, module)?)?;
    module.add_function(wrap_pyfunction!(many::three_view_batch, module)?)?;
    module.add_function(wrap_pyfunction!(sweep::sweep, module)?)?;
    module.add_function(wrap_pyfunction!(sweep::scene_seed, module)?)
}

fn method(py: Python<'_>, name: &str, reweights: usize) -> PyResult<Method> {
    match name {
        "calibrated" => Ok(Method::Calibrated { reweights }),
        "projective" => Ok(Method::Projective),
        _ => Err(convert::invalid(
            py,
            &format!("method: expected \"calibrated\" or \"projective\", got {name:?}"),
        )),
    }
}

#[pyfunction]
fn three_view<'py>(
    py: Python<'py>,
    bearings: Floats<'py>,
    method: &str,
    reweights: usize,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let triples = convert::triples(py, &bearings)?;
    let method = self::method(py, method, reweights)?;
    let solution = py
        .detach(|| crate::three_view(&triples, method))
        .map_err(|error| convert::error(py, error))?;
    let count = if solution.flattened { 1 } else { 2 };
    solution.motions[..count]
        .iter()
        .map(|motion| {
            let dict = PyDict::new(py);
            dict.set_item("poses", convert::poses(py, motion.poses.iter().map(Some)))?;
            let landmarks: Vec<_> = triples.iter().map(|t| motion.landmark(t)).collect();
            dict.set_item("landmarks", convert::points(py, &landmarks))?;
            dict.set_item("inconsistent", motion.inconsistent)?;
            dict.set_item("cost", motion.cost)?;
            dict.set_item("near_collinear", solution.near_collinear)?;
            Ok(dict)
        })
        .collect()
}

#[pyfunction]
fn trifocal_tensor<'py>(
    py: Python<'py>,
    bearings: Floats<'py>,
    method: &str,
    reweights: usize,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let triples = convert::triples(py, &bearings)?;
    let method = self::method(py, method, reweights)?;
    let tensor = py
        .detach(|| crate::trifocal_tensor(&triples, method))
        .map_err(|error| convert::error(py, error))?;
    let flat = tensor.entries.as_flattened().as_flattened();
    convert::array3(py, flat, [2, 2, 2])
}

#[pyfunction]
fn epipoles<'py>(py: Python<'py>, tensor: Floats<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let flat = convert::finite(py, "tensor", &tensor, &[Some(2), Some(2), Some(2)])?;
    let at = |i: usize, j: usize, k: usize| flat[4 * i + 2 * j + k];
    let entries =
        core::array::from_fn(|i| core::array::from_fn(|j| core::array::from_fn(|k| at(i, j, k))));
    let found = crate::real_epipoles(&TrifocalTensor { entries })
        .map_err(|error| convert::error(py, error))?;
    let angles: Vec<f64> = found
        .directions
        .as_flattened()
        .as_flattened()
        .iter()
        .map(|direction| direction.y.atan2(direction.x))
        .collect();
    convert::array3(py, &angles, [2, 3, 3])
}

#[pyfunction]
fn triangulate<'py>(
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
fn resect<'py>(
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
        .map_err(|error| convert::error(py, error))?;
    Ok(PyArray1::from_slice(py, &convert::triplet(&found.pose)))
}

#[pyfunction]
fn align(py: Python<'_>, source: Floats<'_>, target: Floats<'_>) -> PyResult<(f64, f64, f64, f64)> {
    let source = convert::finite_points(py, "source", &source)?;
    let target = convert::finite_points(py, "target", &target)?;
    let found = crate::align(&source, &target).map_err(|error| convert::error(py, error))?;
    let shift = found.isometry.translation;
    Ok((
        found.scaling(),
        convert::angle(&found.isometry.rotation),
        shift.x,
        shift.y,
    ))
}
