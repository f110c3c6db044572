// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reconstructions as arrays and numbers.

use super::convert;
use crate::{Covariance, Reconstruction, Subject};
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;

/// The contents of the package's `Reconstruction`.
#[derive(IntoPyObject)]
pub struct RawReconstruction<'py> {
    poses: Bound<'py, PyArray2<f64>>,
    landmarks: Bound<'py, PyArray2<f64>>,
    residuals: Bound<'py, PyArray1<f64>>,
    inliers: Bound<'py, PyArray1<bool>>,
    cost: f64,
    rms: f64,
    freedom: usize,
    sensitivity: f64,
    uncertainty: f64,
    converged: bool,
    termination: &'static str,
    iterations: usize,
    /// Kind, index, reason.
    undetermined: Vec<(&'static str, usize, String)>,
    components: Vec<Bound<'py, PyAny>>,
    pose_covariance: Option<Bound<'py, PyArray3<f64>>>,
    landmark_covariance: Option<Bound<'py, PyArray3<f64>>>,
    covariance_frame: Option<&'static str>,
}

/// The best map, with its covariances, followed by its alternatives.
pub fn best_with_alternatives<'py>(
    py: Python<'py>,
    found: &Reconstruction,
    covariance: Option<&Covariance>,
) -> PyResult<Vec<RawReconstruction<'py>>> {
    let winner = core::iter::once((found, covariance));
    winner
        .chain(found.alternatives.iter().map(|rival| (rival, None)))
        .map(|(found, covariance)| RawReconstruction::of(py, found, covariance))
        .collect()
}

impl<'py> RawReconstruction<'py> {
    pub fn of(
        py: Python<'py>,
        found: &Reconstruction,
        covariance: Option<&Covariance>,
    ) -> PyResult<Self> {
        let residuals = found.residuals.iter().map(|r| r.unwrap_or(f64::NAN));
        let undetermined = found.undetermined.iter().map(|one| {
            let (kind, index) = subject(one.subject);
            (kind, index, one.why.to_string())
        });
        let components = found.components.iter().map(|found| {
            let component = Self::of(py, found, None)?.into_pyobject(py)?;
            Ok(component.into_any())
        });
        let blocks = covariance.map(|found| blocks(py, found)).transpose()?;
        let (pose_covariance, landmark_covariance) = blocks.unzip();
        Ok(Self {
            poses: convert::poses(py, found.map.poses.iter().map(Option::as_ref)),
            landmarks: convert::points(py, &found.map.landmarks),
            residuals: PyArray1::from_iter(py, residuals),
            inliers: PyArray1::from_slice(py, &found.inliers),
            cost: found.cost,
            rms: found.rms,
            freedom: found.freedom,
            sensitivity: found.sensitivity,
            uncertainty: found.uncertainty,
            converged: found.termination.was_successful(),
            termination: found.termination.name(),
            iterations: found.iterations,
            undetermined: undetermined.collect(),
            components: components.collect::<PyResult<_>>()?,
            pose_covariance,
            landmark_covariance,
            covariance_frame: covariance.map(|found| found.frame.name()),
        })
    }
}

/// "view" or "landmark", and its index.
pub fn subject(subject: Subject) -> (&'static str, usize) {
    match subject {
        Subject::View(index) => ("view", index),
        Subject::Landmark(index) => ("landmark", index),
    }
}

type Blocks<'py> = Bound<'py, PyArray3<f64>>;

/// The covariances of poses and landmarks; being symmetric, they are the same by rows and by columns.
fn blocks<'py>(py: Python<'py>, found: &Covariance) -> PyResult<(Blocks<'py>, Blocks<'py>)> {
    let poses = found.poses.iter();
    let poses = poses.map(|block| block.map_or([[f64::NAN; 3]; 3], |b| b.data.0));
    let landmarks = found.landmarks.iter();
    let landmarks = landmarks.map(|block| block.map_or([[f64::NAN; 2]; 2], |b| b.data.0));
    let poses: Vec<f64> = poses.flatten().flatten().collect();
    let landmarks: Vec<f64> = landmarks.flatten().flatten().collect();
    Ok((
        convert::array3(py, &poses, [found.poses.len(), 3, 3])?,
        convert::array3(py, &landmarks, [found.landmarks.len(), 2, 2])?,
    ))
}
