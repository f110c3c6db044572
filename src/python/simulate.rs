// SPDX-License-Identifier: MIT OR Apache-2.0
//! Scenes with known truth.

use super::convert::{self, Floats};
use super::errors;
use super::observer::InterpreterObserver;
use crate::simulate::simulate_while;
use crate::{Arena, Layout, Scene};
use alloc::vec::Vec;
use nalgebra::Point2;
use numpy::PyArray2;
use pyo3::prelude::*;
use std::format;

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
) -> PyResult<[Bound<'py, PyArray2<f64>>; 3]> {
    let layout = self::layout(py, layout)?;
    let arena = Arena {
        width,
        height,
        sight,
    };
    let scene = InterpreterObserver::run(py, None, |watch| {
        let goes_on = |done| watch("simulate", done, views);
        simulate_while(layout, views, landmarks, noise, seed, arena, goes_on)
    })?;
    let points: Vec<Option<Point2<f64>>> = scene.landmarks.iter().copied().map(Some).collect();
    Ok([
        convert::poses(py, scene.poses.iter().map(Some)),
        convert::points(py, &points),
        convert::array2(py, scene.bearings, [views, landmarks]),
    ])
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
    Layout::ALL
        .into_iter()
        .find(|layout| layout.name() == name)
        .ok_or_else(|| {
            let known = Layout::ALL.map(Layout::name).join("\" or \"");
            errors::invalid(py, &format!("layout: expected \"{known}\", got {name:?}"))
        })
}
