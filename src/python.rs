// SPDX-License-Identifier: MIT OR Apache-2.0
//! The extension module `bearslam._core`: arrays in, one call without the interpreter, arrays out.
//!
//! No arithmetic happens here. The module has no state and is safe on free-threaded Python as long
//! as nobody writes into an array while a call reads it: what is needed is copied before the
//! interpreter is released.

mod convert;
mod diagnose;
mod errors;
mod geometry;
mod observer;
mod reconstruction;
mod request;
mod simulate;
mod solve;
mod sweep;
mod three_view;

use numpy::PyArray1;
use pyo3::prelude::*;

/// Linear algebra of bearings, compiled.
#[pymodule(gil_used = false)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    // NumPy is loaded with the first array: here, where an interruption is an error like any other.
    drop(PyArray1::<f64>::zeros(module.py(), 0, false));
    module.add_function(wrap_pyfunction!(three_view::three_view, module)?)?;
    module.add_function(wrap_pyfunction!(three_view::trifocal_tensor, module)?)?;
    module.add_function(wrap_pyfunction!(three_view::epipoles, module)?)?;
    module.add_function(wrap_pyfunction!(geometry::triangulate, module)?)?;
    module.add_function(wrap_pyfunction!(geometry::resect, module)?)?;
    module.add_function(wrap_pyfunction!(geometry::align, module)?)?;
    module.add_function(wrap_pyfunction!(diagnose::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(solve::initialize, module)?)?;
    module.add_function(wrap_pyfunction!(solve::solve, module)?)?;
    module.add_function(wrap_pyfunction!(solve::defaults, module)?)?;
    module.add_function(wrap_pyfunction!(solve::refine, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::odometry, module)?)?;
    module.add_function(wrap_pyfunction!(three_view::three_view_batch, module)?)?;
    module.add_function(wrap_pyfunction!(sweep::sweep, module)?)?;
    module.add_function(wrap_pyfunction!(sweep::scene_seed, module)?)
}
