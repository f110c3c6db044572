// SPDX-License-Identifier: MIT OR Apache-2.0
//! The extension module `bearslam._core`: arrays in, one call with the interpreter released, arrays out.
//!
//! No arithmetic happens here. The module has no state and is safe on free-threaded Python as long
//! as no other thread writes into an array while a call copies it; all input is copied before the
//! interpreter is released.

mod convert;
mod diagnose;
mod errors;
mod finding;
mod fit;
mod geometry;
mod observer;
mod reconstruction;
mod relabel;
mod request;
mod simulate;
mod solve;
mod sweep;
mod three_view;

use numpy::PyArray1;
use pyo3::prelude::*;

/// The compiled core of bearslam.
#[pymodule(gil_used = false)]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    // Load NumPy now, with a first array, so that an interruption is an ordinary error.
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
    module.add_function(wrap_pyfunction!(relabel::relabel, module)?)?;
    module.add_function(wrap_pyfunction!(fit::redundancy, module)?)?;
    module.add_function(wrap_pyfunction!(fit::expected_error, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::odometry, module)?)?;
    module.add_function(wrap_pyfunction!(three_view::three_view_batch, module)?)?;
    module.add_function(wrap_pyfunction!(sweep::sweep, module)?)?;
    module.add_function(wrap_pyfunction!(sweep::scene_seed, module)?)
}
