// SPDX-License-Identifier: MIT OR Apache-2.0
//! Scenes with known truth.

use super::convert::{self, Floats};
use super::errors;
use super::observer::InterpreterObserver;
use crate::simulate::simulate_while;
use crate::{Arena, Layout, Outliers, Scene};
use alloc::vec::Vec;
use nalgebra::Point2;
use numpy::PyArray2;
use pyo3::prelude::*;
use std::format;

/// Poses (m, 3), landmarks (n, 2), bearings (m, n), and which of them are outliers (m, n).
type Simulated<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<bool>>,
);

#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the stub names them all")]
pub fn simulate<'py>(
    py: Python<'py>,
    layout: &str,
    views: usize,
    landmarks: usize,
    noise: f64,
    seed: u64,
    width: f64,
    height: f64,
    sight: f64,
    outliers: f64,
    outlier_kind: &str,
) -> PyResult<Simulated<'py>> {
    let kind = self::outlier_kind(py, outlier_kind)?;
    let layout = self::layout(py, layout)?;
    let arena = Arena {
        width,
        height,
        sight,
    };
    let (scene, wrong) = InterpreterObserver::run(py, None, |watch| {
        let goes_on = |done| watch("simulate", done, views);
        let scene = simulate_while(layout, views, landmarks, noise, seed, arena, goes_on)?;
        Ok(scene.contaminate(kind, outliers, seed))
    })?;
    let points: Vec<Option<Point2<f64>>> = scene.landmarks.iter().copied().map(Some).collect();
    Ok((
        convert::poses(py, scene.poses.iter().map(Some)),
        convert::points(py, &points),
        convert::array2(py, scene.bearings, [views, landmarks]),
        convert::array2(py, wrong, [views, landmarks]),
    ))
}

/// The noisy motion (k, 3) from each of the poses to the next.
#[pyfunction]
pub fn odometry<'py>(
    py: Python<'py>,
    poses: Floats<'py>,
    sigmas: [f64; 3],
    seed: u64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let scene = Scene {
        poses: convert::finite_poses(py, "poses", &poses)?,
        landmarks: Vec::new(),
        bearings: Vec::new(),
    };
    let motions = py
        .detach(|| scene.odometry(sigmas, seed))
        .map_err(|error| errors::error(py, error))?;
    Ok(convert::poses(
        py,
        motions.iter().map(|motion| Some(&motion.delta)),
    ))
}

pub fn layout(py: Python<'_>, name: &str) -> PyResult<Layout> {
    named(py, "layout", Layout::ALL, Layout::name, name)
}

fn outlier_kind(py: Python<'_>, name: &str) -> PyResult<Outliers> {
    named(py, "outlier_kind", Outliers::ALL, Outliers::name, name)
}

/// The one of some variants that has this name.
fn named<T: Copy, const N: usize>(
    py: Python<'_>,
    what: &str,
    all: [T; N],
    name_of: fn(T) -> &'static str,
    name: &str,
) -> PyResult<T> {
    all.into_iter()
        .find(|&variant| name_of(variant) == name)
        .ok_or_else(|| {
            let known = all.map(name_of).join("\" or \"");
            errors::invalid(py, &format!("{what}: expected \"{known}\", got {name:?}"))
        })
}
