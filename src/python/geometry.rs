// SPDX-License-Identifier: MIT OR Apache-2.0
//! Triangulation, resection, alignment.

use super::convert::{self, Floats};
use super::errors;
use super::observer::InterpreterObserver;
use crate::{Error, Fix};

use alloc::vec::Vec;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;

/// Estimates and, on request, their uncertainty; NaN where there is no estimate.
#[derive(IntoPyObject)]
pub struct Fixes<'py> {
    value: Bound<'py, PyArray2<f64>>,
    covariance: Option<Bound<'py, PyArray3<f64>>>,
    rms: Option<Bound<'py, PyArray1<f64>>>,
    sigma0: Option<Bound<'py, PyArray1<f64>>>,
}

impl<'py> Fixes<'py> {
    /// From the estimates and, with `detailed`, the fix of each.
    fn new<const N: usize>(
        py: Python<'py>,
        value: Bound<'py, PyArray2<f64>>,
        fixes: &[Option<Fix<N>>],
        detailed: bool,
    ) -> PyResult<Self> {
        let numbers = |number: fn(&Fix<N>) -> f64| {
            let all = fixes
                .iter()
                .map(|fix| fix.as_ref().map_or(f64::NAN, number));
            detailed.then(|| PyArray1::from_iter(py, all))
        };
        let covariance = if detailed {
            // Symmetric: the order of columns is that of rows.
            let entries = fixes.iter().flat_map(|fix| {
                let entry = move |k: usize| fix.map_or(f64::NAN, |fix| fix.covariance[k]);
                (0..N * N).map(entry)
            });
            let entries: Vec<_> = entries.collect();
            Some(convert::array3(py, &entries, [fixes.len(), N, N])?)
        } else {
            None
        };
        Ok(Self {
            value,
            covariance,
            rms: numbers(|fix| fix.rms),
            sigma0: numbers(|fix| fix.sigma0),
        })
    }
}

/// A requested fix; `None` where the geometry does not determine it.
fn determined<const N: usize>(fix: Option<Result<Fix<N>, Error>>) -> Result<Option<Fix<N>>, Error> {
    match fix {
        Some(Err(error @ (Error::NotPositive { .. } | Error::Magnitude { .. }))) => Err(error),
        fix => Ok(fix.and_then(Result::ok)),
    }
}

/// Positions of landmarks; with `sigma` \[rad\] also their uncertainty.
#[pyfunction]
pub fn triangulate<'py>(
    py: Python<'py>,
    poses: Floats<'py>,
    bearings: Floats<'py>,
    sigma: Option<f64>,
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
            let fix = |sigma| Fix::of_landmark(&found.point, rays, sigma);
            Ok((Some(found.point), determined(sigma.map(fix))?))
        });
        found.collect::<Result<(Vec<_>, Vec<_>), _>>()
    })?;
    let points = convert::points(py, &points);
    Fixes::new(py, points, &fixes, sigma.is_some())
}

/// Poses of the views, the rows of `bearings`; with `sigma` \[rad\] also their uncertainty. A view that cannot be
/// resected is NaN, or an error if `strict`.
#[pyfunction]
pub fn resect<'py>(
    py: Python<'py>,
    landmarks: Floats<'py>,
    bearings: Floats<'py>,
    sigma: Option<f64>,
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
            let fix = |sigma| Fix::of_pose(&pose, seen, sigma);
            Ok((Some(pose), determined(sigma.map(fix))?))
        });
        found.collect::<Result<(Vec<_>, Vec<_>), _>>()
    })?;
    let poses = convert::poses(py, poses.iter().map(Option::as_ref));
    Fixes::new(py, poses, &fixes, sigma.is_some())
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
