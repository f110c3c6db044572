// SPDX-License-Identifier: MIT OR Apache-2.0
//! Triangulation, resection, alignment.

use super::convert::{self, Floats};
use super::errors;
use super::observer::InterpreterObserver;
use crate::{Error, Fix, TestOptions};

use alloc::vec::Vec;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;

/// Estimates and how well they are known; NaN where there is no estimate.
#[derive(IntoPyObject)]
pub struct Fixes<'py> {
    value: Bound<'py, PyArray2<f64>>,
    covariance: Bound<'py, PyArray3<f64>>,
    rms: Bound<'py, PyArray1<f64>>,
    sigma0: Bound<'py, PyArray1<f64>>,
    p_value: Bound<'py, PyArray1<f64>>,
    /// Whether the fit is too poor for what is stated.
    poor: Bound<'py, PyArray1<bool>>,
    uncertainty: Bound<'py, PyArray1<f64>>,
}

impl<'py> Fixes<'py> {
    /// From the estimates and the fix of each.
    fn new<const N: usize>(
        py: Python<'py>,
        value: Bound<'py, PyArray2<f64>>,
        fixes: &[Option<Fix<N>>],
    ) -> PyResult<Self> {
        let numbers = |number: fn(&Fix<N>) -> f64| {
            let each = |fix: &Option<Fix<N>>| fix.as_ref().map_or(f64::NAN, number);
            PyArray1::from_iter(py, fixes.iter().map(each))
        };
        let options = TestOptions::default();
        let is_poor = |fix: &Option<Fix<N>>| fix.is_some_and(|fix| fix.is_poor(&options));
        // Symmetric: the order of columns is that of rows.
        let entries = fixes.iter().flat_map(|fix| {
            let entry = move |k: usize| fix.map_or(f64::NAN, |fix| fix.covariance[k]);
            (0..N * N).map(entry)
        });
        let entries: Vec<_> = entries.collect();
        Ok(Self {
            value,
            covariance: convert::array3(py, &entries, [fixes.len(), N, N])?,
            rms: numbers(|fix| fix.rms),
            sigma0: numbers(|fix| fix.sigma0),
            p_value: numbers(|fix| fix.p_value),
            poor: PyArray1::from_iter(py, fixes.iter().map(is_poor)),
            uncertainty: numbers(|fix| fix.uncertainty),
        })
    }
}

/// A fix; `None` where the geometry does not determine it.
fn determined<const N: usize>(fix: Result<Fix<N>, Error>) -> Result<Option<Fix<N>>, Error> {
    match fix {
        Err(error @ (Error::NotPositive { .. } | Error::Magnitude { .. })) => Err(error),
        fix => Ok(fix.ok()),
    }
}

/// Positions of landmarks; NaN where the rays determine none, or contradict each other.
#[pyfunction]
pub fn triangulate<'py>(
    py: Python<'py>,
    poses: Floats<'py>,
    bearings: Floats<'py>,
    sigma: f64,
) -> PyResult<Fixes<'py>> {
    let poses = convert::finite_poses(py, "poses", &poses)?;
    let (bearings, columns) = convert::table(py, "bearings", &bearings, poses.len())?;
    let (points, fixes) = InterpreterObserver::run(py, None, |watch| {
        let found = (0..columns).map(|landmark| {
            if !watch("triangulate", landmark, columns) {
                return Err(Error::Interrupted);
            }
            let rays = poses.iter().enumerate().filter_map(|(view, pose)| {
                let bearing = bearings[view * columns + landmark];
                (!bearing.is_nan()).then(|| (*pose, crate::Bearing::new(bearing)))
            });
            let Ok(found) = crate::triangulate(rays.clone()) else {
                return Ok((None, None));
            };
            if found.behind > 0 {
                return Ok((None, None));
            }
            let fix = determined(Fix::of_landmark(&found.point, rays, sigma))?;
            let contradicts = fix.is_some_and(|fix| fix.refuse_contradiction().is_err());
            Ok(if contradicts {
                (None, None)
            } else {
                (Some(found.point), fix)
            })
        });
        found.collect::<Result<(Vec<_>, Vec<_>), _>>()
    })?;
    let points = convert::points(py, &points);
    Fixes::new(py, points, &fixes)
}

/// Poses of the views, the rows of `bearings`. A view that cannot be resected, or whose bearings contradict each other, is
/// NaN, or an error if `strict`.
#[pyfunction]
pub fn resect<'py>(
    py: Python<'py>,
    landmarks: Floats<'py>,
    bearings: Floats<'py>,
    sigma: f64,
    strict: bool,
) -> PyResult<Fixes<'py>> {
    let points = convert::finite_points(py, "landmarks", &landmarks)?;
    let (bearings, views) = convert::rows(py, "bearings", &bearings, points.len())?;
    let (poses, fixes) = InterpreterObserver::run(py, None, |watch| {
        let found = (0..views).map(|view| {
            if !watch("resect", view, views) {
                return Err(Error::Interrupted);
            }
            let row = &bearings[view * points.len()..][..points.len()];
            let seen = points.iter().zip(row);
            let seen = seen
                .filter(|(_, bearing)| !bearing.is_nan())
                .map(|(point, bearing)| (*point, crate::Bearing::new(*bearing)));
            let pose = match crate::resect(seen.clone()) {
                Ok(found) => found.pose,
                Err(error) if strict => return Err(error),
                Err(_) => return Ok((None, None)),
            };
            let Some(fix) = determined(Fix::of_pose(&pose, seen, sigma))? else {
                return Ok((Some(pose), None));
            };
            match fix.refuse_contradiction() {
                Ok(fix) => Ok((Some(pose), Some(fix))),
                Err(error) if strict => Err(error),
                Err(_) => Ok((None, None)),
            }
        });
        found.collect::<Result<(Vec<_>, Vec<_>), _>>()
    })?;
    let poses = convert::poses(py, poses.iter().map(Option::as_ref));
    Fixes::new(py, poses, &fixes)
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
    let [x, y, angle] = crate::xytheta(&found.isometry);
    Ok((found.scaling(), angle, x, y))
}
