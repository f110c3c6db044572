// SPDX-License-Identifier: MIT OR Apache-2.0
//! The extension module `bearslam._core`: arrays in, one call without the interpreter, arrays out.
//!
//! No arithmetic happens here. The module has no state and is safe on free-threaded Python as long
//! as nobody writes into an array while a call reads it: what is needed is copied before the
//! interpreter is released.

mod convert;
mod diagnosis;
mod many;
mod sweep;
mod watch;

use crate::{
    Arena, Layout, Method, Reconstruction, RefineOptions, Search, SolveOptions, Strategy,
    TrifocalTensor,
};
use alloc::string::String;
use alloc::vec::Vec;
use convert::{Floats, Indices};
use nalgebra::Point2;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::format;
use watch::Watcher;

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
    module.add_function(wrap_pyfunction!(initialize, module)?)?;
    module.add_function(wrap_pyfunction!(solve, module)?)?;
    module.add_function(wrap_pyfunction!(refine, module)?)?;
    module.add_function(wrap_pyfunction!(simulate, module)?)?;
    module.add_function(wrap_pyfunction!(diagnosis::diagnose, module)?)?;
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

fn strategy(py: Python<'_>, name: &str, search: Search) -> PyResult<Strategy> {
    match name {
        "search" => Ok(Strategy::Search(search)),
        "incremental" => Ok(Strategy::Incremental),
        "global" => Ok(Strategy::Global),
        "calibrated" => Ok(Strategy::FirstViews(Method::Calibrated { reweights: 1 })),
        "projective" => Ok(Strategy::FirstViews(Method::Projective)),
        _ => Err(convert::invalid(
            py,
            &format!(
                "method: expected \"search\", \"calibrated\", \"projective\", \"incremental\" or \"global\", \
                 got {name:?}"
            ),
        )),
    }
}

#[pyfunction]
#[pyo3(signature = (views, landmarks, view, landmark, bearing, sigma, *, method, triples, grown, seed, progress))]
#[expect(clippy::too_many_arguments, reason = "the stub names them all")]
fn initialize<'py>(
    py: Python<'py>,
    views: usize,
    landmarks: usize,
    view: Indices<'py>,
    landmark: Indices<'py>,
    bearing: Floats<'py>,
    sigma: Floats<'py>,
    method: &str,
    triples: usize,
    grown: usize,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let problem = convert::problem(py, views, landmarks, &view, &landmark, &bearing, &sigma)?;
    let options = SolveOptions {
        strategy: strategy(
            py,
            method,
            Search {
                triples,
                grown,
                ..Search::default()
            },
        )?,
        seed,
        ..SolveOptions::default()
    };
    let found = Watcher::run(py, progress, |watch| {
        crate::initialize(&problem, &options, Some(watch))
    })?;
    with_alternatives(py, &found)
}

#[pyfunction]
#[pyo3(signature = (views, landmarks, view, landmark, bearing, sigma, *, method, triples, grown, candidates, swept, max_iterations, damping, tolerance, seed, progress))]
#[expect(clippy::too_many_arguments, reason = "the stub names them all")]
fn solve<'py>(
    py: Python<'py>,
    views: usize,
    landmarks: usize,
    view: Indices<'py>,
    landmark: Indices<'py>,
    bearing: Floats<'py>,
    sigma: Floats<'py>,
    method: &str,
    triples: usize,
    grown: usize,
    candidates: usize,
    swept: usize,
    max_iterations: usize,
    damping: f64,
    tolerance: f64,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let problem = convert::problem(py, views, landmarks, &view, &landmark, &bearing, &sigma)?;
    let search = Search {
        triples,
        grown,
        candidates,
        swept,
    };
    let options = SolveOptions {
        strategy: strategy(py, method, search)?,
        refine: RefineOptions {
            max_iterations,
            damping,
            tolerance,
        },
        seed,
        ..SolveOptions::default()
    };
    let found = Watcher::run(py, progress, |watch| {
        crate::solve(&problem, &options, Some(watch))
    })?;
    with_alternatives(py, &found)
}

#[pyfunction]
#[pyo3(signature = (views, landmarks, view, landmark, bearing, sigma, poses, points, *, max_iterations, damping, tolerance, progress))]
#[expect(clippy::too_many_arguments, reason = "the stub names them all")]
fn refine<'py>(
    py: Python<'py>,
    views: usize,
    landmarks: usize,
    view: Indices<'py>,
    landmark: Indices<'py>,
    bearing: Floats<'py>,
    sigma: Floats<'py>,
    poses: Floats<'py>,
    points: Floats<'py>,
    max_iterations: usize,
    damping: f64,
    tolerance: f64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let problem = convert::problem(py, views, landmarks, &view, &landmark, &bearing, &sigma)?;
    let start = convert::map(py, &poses, &points)?;
    let options = RefineOptions {
        max_iterations,
        damping,
        tolerance,
    };
    let found = Watcher::run(py, progress, |watch| {
        crate::refine(&problem, &start, &options, Some(watch))
    })?;
    reconstruction(py, &found)
}

#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the stub names them all")]
fn simulate<'py>(
    py: Python<'py>,
    layout: &str,
    views: usize,
    landmarks: usize,
    noise: f64,
    seed: u64,
    width: f64,
    height: f64,
    sight: f64,
) -> PyResult<[Bound<'py, PyArray2<f64>>; 3]> {
    let layout = self::layout(py, layout)?;
    let arena = Arena {
        width,
        height,
        sight,
    };
    let scene = py
        .detach(|| crate::simulate(layout, views, landmarks, noise, seed, arena))
        .map_err(|error| convert::error(py, error))?;
    let points: Vec<Option<Point2<f64>>> = scene.landmarks.iter().copied().map(Some).collect();
    Ok([
        convert::poses(py, scene.poses.iter().map(Some)),
        convert::points(py, &points),
        convert::array2(py, scene.bearings, [views, landmarks]),
    ])
}

fn layout(py: Python<'_>, name: &str) -> PyResult<Layout> {
    Layout::ALL
        .into_iter()
        .find(|layout| layout.name() == name)
        .ok_or_else(|| {
            let known = Layout::ALL.map(Layout::name).join("\" or \"");
            convert::invalid(py, &format!("layout: expected \"{known}\", got {name:?}"))
        })
}

/// The winner and, after it, its alternatives.
fn with_alternatives<'py>(
    py: Python<'py>,
    found: &Reconstruction<f64>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    core::iter::once(found)
        .chain(&found.alternatives)
        .map(|found| reconstruction(py, found))
        .collect()
}

fn reconstruction<'py>(
    py: Python<'py>,
    found: &Reconstruction<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let poses = found.map.poses.iter().map(Option::as_ref);
    dict.set_item("poses", convert::poses(py, poses))?;
    dict.set_item("landmarks", convert::points(py, &found.map.landmarks))?;
    let residuals: Vec<f64> = found
        .residuals
        .iter()
        .map(|r| r.unwrap_or(f64::NAN))
        .collect();
    dict.set_item("residuals", PyArray1::from_vec(py, residuals))?;
    dict.set_item("cost", found.cost)?;
    dict.set_item("rms", found.rms)?;
    dict.set_item("sensitivity", found.sensitivity)?;
    dict.set_item("uncertainty", found.uncertainty)?;
    dict.set_item("converged", found.termination.was_successful())?;
    dict.set_item("termination", found.termination.name())?;
    dict.set_item("iterations", found.iterations)?;
    let undetermined: Vec<(&str, usize, String)> = found
        .undetermined
        .iter()
        .map(|u| {
            let (kind, index) = match u.subject {
                crate::Subject::View(index) => ("view", index),
                crate::Subject::Landmark(index) => ("landmark", index),
            };
            (kind, index, format!("{}", u.why))
        })
        .collect();
    dict.set_item("undetermined", undetermined)?;
    let components: Vec<_> = found
        .components
        .iter()
        .map(|found| reconstruction(py, found))
        .collect::<PyResult<_>>()?;
    dict.set_item("components", components)?;
    Ok(dict)
}
