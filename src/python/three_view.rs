// SPDX-License-Identifier: MIT OR Apache-2.0
//! Three views: one problem, or many in one call.

use super::convert::{self, Floats};
use super::errors;
use super::observer::InterpreterObserver;
use crate::kernels::{three_view_while, trifocal_tensor_while};
use crate::{Bearing, Method, ThreeView, TrifocalTensor, Triple};
use alloc::vec::Vec;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::format;

fn method(py: Python<'_>, name: &str, reweights: usize) -> PyResult<Method> {
    match name {
        "calibrated" => Ok(Method::Calibrated { reweights }),
        "projective" => Ok(Method::Projective),
        _ => Err(errors::invalid(
            py,
            &format!("method: expected \"calibrated\" or \"projective\", got {name:?}"),
        )),
    }
}

/// One of the solutions.
#[derive(IntoPyObject)]
pub struct Solution<'py> {
    poses: Bound<'py, PyArray2<f64>>,
    landmarks: Bound<'py, PyArray2<f64>>,
    inconsistent: usize,
    cost: f64,
    near_collinear: bool,
}

#[pyfunction]
pub fn three_view<'py>(
    py: Python<'py>,
    bearings: Floats<'py>,
    method: &str,
    reweights: usize,
) -> PyResult<Vec<Solution<'py>>> {
    let triples = convert::triples(py, &bearings)?;
    let method = self::method(py, method, reweights)?;
    let solution = InterpreterObserver::run(py, None, |watch| {
        three_view_while(&triples, method, || watch("reweights", 0, reweights))
    })?;
    let count = if solution.flattened { 1 } else { 2 };
    let solutions = solution.motions[..count].iter().map(|motion| {
        let landmarks: Vec<_> = triples.iter().map(|t| motion.landmark(t)).collect();
        Solution {
            poses: convert::poses(py, motion.poses.iter().map(Some)),
            landmarks: convert::points(py, &landmarks),
            inconsistent: motion.inconsistent,
            cost: motion.cost,
            near_collinear: solution.near_collinear,
        }
    });
    Ok(solutions.collect())
}

#[pyfunction]
pub fn trifocal_tensor<'py>(
    py: Python<'py>,
    bearings: Floats<'py>,
    method: &str,
    reweights: usize,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let triples = convert::triples(py, &bearings)?;
    let method = self::method(py, method, reweights)?;
    let tensor = InterpreterObserver::run(py, None, |watch| {
        trifocal_tensor_while(&triples, method, || watch("reweights", 0, reweights))
    })?;
    let flat = tensor.entries.as_flattened().as_flattened();
    convert::array3(py, flat, [2, 2, 2])
}

#[pyfunction]
pub fn epipoles<'py>(py: Python<'py>, tensor: Floats<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let flat = convert::finite(py, "tensor", &tensor, &[Some(2), Some(2), Some(2)])?;
    let at = |i: usize, j: usize, k: usize| flat[4 * i + 2 * j + k];
    let entries =
        core::array::from_fn(|i| core::array::from_fn(|j| core::array::from_fn(|k| at(i, j, k))));
    let found = crate::real_epipoles(&TrifocalTensor { entries })
        .map_err(|error| errors::error(py, error))?;
    let angles: Vec<f64> = found
        .directions
        .as_flattened()
        .as_flattened()
        .iter()
        .map(|direction| direction.y.atan2(direction.x))
        .collect();
    convert::array3(py, &angles, [2, 3, 3])
}

/// Poses (k, 18), landmarks (k, 4 n), inconsistent (k, 2), cost (k, 2), near collinear (k,).
type Solutions<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<i64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<bool>>,
);

/// Many three-view problems, bearings (k, 3, n), on all cores: both solutions of each, NaN and -1
/// where there is none.
#[pyfunction]
pub fn three_view_batch<'py>(
    py: Python<'py>,
    bearings: Floats<'py>,
    method: &str,
    reweights: usize,
) -> PyResult<Solutions<'py>> {
    let flat = convert::finite(py, "bearings", &bearings, &[None, Some(3), None])?;
    let shape = bearings.shape();
    let (count, landmarks) = (shape[0], shape[2]);
    let method = self::method(py, method, reweights)?;
    let poses = PyArray2::zeros(py, [count, 18], false);
    let points = PyArray2::zeros(py, [count, 4 * landmarks], false);
    let inconsistent = PyArray2::zeros(py, [count, 2], false);
    let cost = PyArray2::zeros(py, [count, 2], false);
    let near_collinear = PyArray1::zeros(py, count, false);
    {
        let mut poses = poses.readwrite();
        let mut points = points.readwrite();
        let mut inconsistent = inconsistent.readwrite();
        let mut cost = cost.readwrite();
        let mut near_collinear = near_collinear.readwrite();
        let problems = (
            flat.par_chunks((3 * landmarks).max(1)),
            poses.as_slice_mut()?.par_chunks_mut(18),
            points
                .as_slice_mut()?
                .par_chunks_mut((4 * landmarks).max(1)),
            inconsistent.as_slice_mut()?.par_chunks_mut(2),
            cost.as_slice_mut()?.par_chunks_mut(2),
            near_collinear.as_slice_mut()?,
        )
            .into_par_iter()
            .with_min_len(MIN_SHARE);
        InterpreterObserver::run_on_pool(py, count.div_ceil(MIN_SHARE), |goes_on| {
            problems.for_each_init(
                || Vec::with_capacity(landmarks),
                |triples, (bearings, poses, points, inconsistent, cost, near_collinear)| {
                    triples.clear();
                    triples.extend((0..landmarks).map(|j| {
                        [0, 1, 2].map(|view| Bearing::new(bearings[view * landmarks + j]))
                    }));
                    poses.fill(f64::NAN);
                    points.fill(f64::NAN);
                    inconsistent.fill(-1);
                    cost.fill(f64::NAN);
                    if !goes_on() {
                        return;
                    }
                    if let Ok(solution) = three_view_while(triples, method, goes_on) {
                        *near_collinear = solution.near_collinear;
                        write(&solution, triples, poses, points, inconsistent, cost);
                    }
                },
            );
        })?;
    }
    Ok((poses, points, inconsistent, cost, near_collinear))
}

/// Minimum number of problems per task of a thread.
const MIN_SHARE: usize = 64;

fn write(
    solution: &ThreeView<f64>,
    triples: &[Triple<f64>],
    poses: &mut [f64],
    points: &mut [f64],
    inconsistent: &mut [i64],
    cost: &mut [f64],
) {
    let branches = if solution.flattened { 1 } else { 2 };
    for (branch, motion) in solution.motions[..branches].iter().enumerate() {
        for (view, pose) in motion.poses.iter().enumerate() {
            poses[9 * branch + 3 * view..][..3].copy_from_slice(&crate::xytheta(pose));
        }
        for (j, triple) in triples.iter().enumerate() {
            if let Some(point) = motion.landmark(triple) {
                points[2 * (branch * triples.len() + j)..][..2]
                    .copy_from_slice(&[point.x, point.y]);
            }
        }
        inconsistent[branch] = i64::try_from(motion.inconsistent).unwrap_or(i64::MAX);
        cost[branch] = motion.cost;
    }
}
