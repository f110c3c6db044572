// SPDX-License-Identifier: MIT OR Apache-2.0
//! Conversion between NumPy arrays and the types of the crate.

use super::errors::{error, invalid};
use crate::{Bearing, Error, Map, Pose, Triple, xytheta};
use alloc::string::String;
use alloc::vec::Vec;
use nalgebra::Point2;
use numpy::{PyArray2, PyArray3, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::format;

pub type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
pub type Indices<'py> = PyReadonlyArrayDyn<'py, i64>;

/// The entries in C order, after a check of the shape (`None` is any length).
pub fn entries(
    py: Python<'_>,
    name: &str,
    array: &Floats<'_>,
    shape: &[Option<usize>],
) -> PyResult<Vec<f64>> {
    let got = array.shape();
    let fits = got.len() == shape.len()
        && got
            .iter()
            .zip(shape)
            .all(|(got, want)| want.is_none_or(|want| want == *got));
    if !fits {
        let wanted: Vec<String> = shape
            .iter()
            .map(|want| want.map_or_else(|| "any".into(), |want| format!("{want}")))
            .collect();
        return Err(invalid(
            py,
            &format!(
                "{name}: expected an array of shape ({}), got {got:?}",
                wanted.join(", ")
            ),
        ));
    }
    // Copy arrays in C order at once. Fortran order is contiguous as well, but has no such slice.
    if let Some(slice) = array.as_array().as_slice() {
        return Ok(slice.to_vec());
    }
    Ok(array.as_array().iter().copied().collect())
}

/// The entries, none of which may be `bad`.
fn checked(
    py: Python<'_>,
    name: &'static str,
    array: &Floats<'_>,
    shape: &[Option<usize>],
    bad: impl Fn(&f64) -> bool,
) -> PyResult<Vec<f64>> {
    let entries = entries(py, name, array, shape)?;
    match entries.iter().position(bad) {
        None => Ok(entries),
        Some(index) => Err(error(py, Error::NotFinite { what: name, index })),
    }
}

/// The entries, which must all be finite.
pub fn finite(
    py: Python<'_>,
    name: &'static str,
    array: &Floats<'_>,
    shape: &[Option<usize>],
) -> PyResult<Vec<f64>> {
    checked(py, name, array, shape, |value| !value.is_finite())
}

/// The entries, each finite or NaN.
fn finite_or_missing(
    py: Python<'_>,
    name: &'static str,
    array: &Floats<'_>,
    shape: &[Option<usize>],
) -> PyResult<Vec<f64>> {
    checked(py, name, array, shape, |value| value.is_infinite())
}

/// A table of bearings with a given number of rows, and the number of its columns.
pub fn table(
    py: Python<'_>,
    name: &'static str,
    array: &Floats<'_>,
    rows: usize,
) -> PyResult<(Vec<f64>, usize)> {
    let entries = finite_or_missing(py, name, array, &[Some(rows), None])?;
    Ok((entries, array.shape()[1]))
}

/// A table of bearings with a given number of columns, and the number of its rows.
pub fn rows(
    py: Python<'_>,
    name: &'static str,
    array: &Floats<'_>,
    columns: usize,
) -> PyResult<(Vec<f64>, usize)> {
    let entries = finite_or_missing(py, name, array, &[None, Some(columns)])?;
    Ok((entries, array.shape()[0]))
}

/// The columns of a (3, n) array of bearings.
pub fn triples(py: Python<'_>, array: &Floats<'_>) -> PyResult<Vec<Triple<f64>>> {
    let entries = finite(py, "bearings", array, &[Some(3), None])?;
    let count = array.shape()[1];
    Ok((0..count)
        .map(|k| [0, 1, 2].map(|view| Bearing::new(entries[view * count + k])))
        .collect())
}

pub fn finite_points(
    py: Python<'_>,
    name: &'static str,
    array: &Floats<'_>,
) -> PyResult<Vec<Point2<f64>>> {
    let entries = finite(py, name, array, &[None, Some(2)])?;
    Ok(entries
        .chunks_exact(2)
        .map(|p| Point2::new(p[0], p[1]))
        .collect())
}

pub fn finite_poses(
    py: Python<'_>,
    name: &'static str,
    array: &Floats<'_>,
) -> PyResult<Vec<Pose<f64>>> {
    let entries = finite(py, name, array, &[None, Some(3)])?;
    Ok(entries
        .chunks_exact(3)
        .map(|p| crate::pose(p[0], p[1], p[2]))
        .collect())
}

/// A map; rows with NaN are undetermined.
pub fn map(py: Python<'_>, poses: &Floats<'_>, points: &Floats<'_>) -> PyResult<Map> {
    let poses = finite_or_missing(py, "poses", poses, &[None, Some(3)])?;
    let points = finite_or_missing(py, "landmarks", points, &[None, Some(2)])?;
    let known = |row: &[f64]| row.iter().all(|value| value.is_finite());
    Ok(Map {
        poses: poses
            .chunks_exact(3)
            .map(|p| known(p).then(|| crate::pose(p[0], p[1], p[2])))
            .collect(),
        landmarks: points
            .chunks_exact(2)
            .map(|p| known(p).then(|| Point2::new(p[0], p[1])))
            .collect(),
    })
}

/// Non-negative indices, `length` of them if it is given.
pub fn indices(
    py: Python<'_>,
    name: &str,
    array: &Indices<'_>,
    length: Option<usize>,
) -> PyResult<Vec<usize>> {
    let shape = array.shape();
    if shape.len() != 1 || length.is_some_and(|length| length != shape[0]) {
        let wanted = length.map_or_else(|| "any".into(), |length| format!("{length}"));
        return Err(invalid(
            py,
            &format!("{name}: expected an array of shape ({wanted}), got {shape:?}"),
        ));
    }
    let index = |(place, &value): (usize, &i64)| {
        usize::try_from(value).map_err(|_| {
            invalid(
                py,
                &format!("{name}: expected indices from 0, got {value} at index {place}"),
            )
        })
    };
    array.as_array().iter().enumerate().map(index).collect()
}

pub fn poses<'py, 'a>(
    py: Python<'py>,
    poses: impl ExactSizeIterator<Item = Option<&'a Pose<f64>>>,
) -> Bound<'py, PyArray2<f64>> {
    let count = poses.len();
    let flat = poses
        .flat_map(|pose| pose.map_or([f64::NAN; 3], xytheta))
        .collect();
    array2(py, flat, [count, 3])
}

pub fn points<'py>(py: Python<'py>, points: &[Option<Point2<f64>>]) -> Bound<'py, PyArray2<f64>> {
    let flat = points
        .iter()
        .flat_map(|point| point.map_or([f64::NAN; 2], |p| [p.x, p.y]))
        .collect();
    array2(py, flat, [points.len(), 2])
}

/// A C-ordered array from its entries; the shape gives their number.
pub fn array2<E: numpy::Element>(
    py: Python<'_>,
    flat: Vec<E>,
    shape: [usize; 2],
) -> Bound<'_, PyArray2<E>> {
    let array = PyArray2::zeros(py, shape, false);
    if let Ok(mut view) = array.try_readwrite() {
        for (cell, value) in view.as_array_mut().iter_mut().zip(flat) {
            *cell = value;
        }
    }
    array
}

pub fn array3<'py>(
    py: Python<'py>,
    flat: &[f64],
    shape: [usize; 3],
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    numpy::PyArray1::from_slice(py, flat).reshape(shape)
}
