// SPDX-License-Identifier: MIT OR Apache-2.0
//! What checks the observations of a map, and how far it is predicted to be off.

use super::convert::{self, Floats};
use super::observer::InterpreterObserver;
use super::request::Request;
use crate::{Checked, Map, Problem};
use alloc::vec::Vec;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

/// Redundancies and standardized residuals, for each kind of observation one of each; NaN where there is none.
#[derive(IntoPyObject)]
pub struct RawRedundancy<'py> {
    sightings: Pair<'py>,
    odometry: Pair<'py>,
    pose_priors: Pair<'py>,
    landmark_priors: Pair<'py>,
}

type Pair<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

#[pyfunction]
pub fn redundancy<'py>(
    py: Python<'py>,
    request: Request<'py>,
    poses: Floats<'py>,
    landmarks: Floats<'py>,
    inliers: PyReadonlyArray1<'py, bool>,
) -> PyResult<RawRedundancy<'py>> {
    let (problem, map, inliers) = read(py, &request, (&poses, &landmarks), &inliers)?;
    let found = InterpreterObserver::run(py, None, |watch| {
        let all = problem.sightings().len() + problem.priors().len();
        let mut look = |done, _| watch("redundancy", done, all);
        crate::redundancy(&problem, &map, &inliers, Some(&mut look))
    })?;
    let pair = |all: &[Option<Checked>]| {
        let of = |number: fn(&Checked) -> f64| {
            let numbers = all.iter().map(|one| one.as_ref().map_or(f64::NAN, number));
            PyArray1::from_iter(py, numbers)
        };
        (of(|one| one.redundancy), of(|one| one.standardized))
    };
    Ok(RawRedundancy {
        sightings: pair(&found.sightings),
        odometry: pair(&found.odometry),
        pose_priors: pair(&found.pose_priors),
        landmark_priors: pair(&found.landmark_priors),
    })
}

fn read(
    py: Python<'_>,
    request: &Request<'_>,
    (poses, landmarks): (&Floats<'_>, &Floats<'_>),
    inliers: &PyReadonlyArray1<'_, bool>,
) -> PyResult<(Problem, Map, Vec<bool>)> {
    let map = convert::map(py, poses, landmarks)?;
    Ok((request.read(py)?, map, inliers.as_array().to_vec()))
}

#[pyfunction]
pub fn expected_error<'py>(
    py: Python<'py>,
    request: Request<'py>,
    poses: Floats<'py>,
    landmarks: Floats<'py>,
    inliers: PyReadonlyArray1<'py, bool>,
    sigma0: f64,
) -> PyResult<f64> {
    let (problem, map, inliers) = read(py, &request, (&poses, &landmarks), &inliers)?;
    InterpreterObserver::run(py, None, |watch| {
        let all = map.poses.len() + map.landmarks.len();
        let mut look = |done, _| watch("covariance", done, all);
        crate::expected_error(&problem, &map, &inliers, sigma0, Some(&mut look))
    })
}
