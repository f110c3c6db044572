// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of the core as exceptions of the package.

use crate::Error;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::format;

/// Creates an exception of `bearslam.errors`, whose classes are defined in Python.
fn raise(py: Python<'_>, class: &str, message: &str, details: Option<&Bound<'_, PyDict>>) -> PyErr {
    let made = py
        .import("bearslam.errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call((message,), details));
    match made {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

pub fn invalid(py: Python<'_>, message: &str) -> PyErr {
    raise(py, "InvalidInputError", message, None)
}

pub fn error(py: Python<'_>, error: Error) -> PyErr {
    let message = format!("{error}");
    let (kind, value, bound) = match error {
        Error::Degenerate { kind, value, bound } => (kind.name(), value, bound),
        // Also a degeneracy of the data: the degrees of freedom should be at least a quarter of the outliers.
        Error::NoConsensus {
            freedom, outliers, ..
        } => ("no_consensus", freedom as f64, outliers as f64 / 4.0),
        _ => return invalid(py, &message),
    };
    let details = PyDict::new(py);
    let filled = details
        .set_item("kind", kind)
        .and_then(|()| details.set_item("value", value))
        .and_then(|()| details.set_item("bound", bound));
    match filled {
        Ok(()) => raise(py, "DegenerateError", &message, Some(&details)),
        Err(error) => error,
    }
}
