// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reconstructions as dictionaries of arrays.

use super::convert;
use crate::{Covariance, Reconstruction};
use alloc::string::String;
use alloc::vec::Vec;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::format;

/// The winner and, after it, its alternatives; covariances are the winner's.
pub fn ranked<'py>(
    py: Python<'py>,
    found: &Reconstruction,
    covariance: Option<&Covariance>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let winner = core::iter::once((found, covariance));
    winner
        .chain(found.alternatives.iter().map(|rival| (rival, None)))
        .map(|(found, covariance)| reconstruction(py, found, covariance))
        .collect()
}

pub fn reconstruction<'py>(
    py: Python<'py>,
    found: &Reconstruction,
    covariance: Option<&Covariance>,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let poses = found.map.poses.iter().map(Option::as_ref);
    dict.set_item("poses", convert::poses(py, poses))?;
    dict.set_item("landmarks", convert::points(py, &found.map.landmarks))?;
    let residuals: Vec<f64> = found
        .residuals
        .iter()
        .map(|r| r.unwrap_or(f64::NAN))
        .collect();
    dict.set_item("residuals", PyArray1::from_vec(py, residuals))?;
    dict.set_item("inliers", PyArray1::from_slice(py, &found.inliers))?;
    dict.set_item("cost", found.cost)?;
    dict.set_item("rms", found.rms)?;
    dict.set_item("sensitivity", found.sensitivity)?;
    dict.set_item("uncertainty", found.uncertainty)?;
    dict.set_item("converged", found.termination.was_successful())?;
    dict.set_item("termination", found.termination.name())?;
    dict.set_item("iterations", found.iterations)?;
    let undetermined: Vec<(&str, usize, String)> = found
        .undetermined
        .iter()
        .map(|u| {
            let (kind, index) = match u.subject {
                crate::Subject::View(index) => ("view", index),
                crate::Subject::Landmark(index) => ("landmark", index),
            };
            (kind, index, format!("{}", u.why))
        })
        .collect();
    dict.set_item("undetermined", undetermined)?;
    let components: Vec<_> = found
        .components
        .iter()
        .map(|found| reconstruction(py, found, None))
        .collect::<PyResult<_>>()?;
    dict.set_item("components", components)?;
    if let Some(covariance) = covariance {
        let (views, landmarks) = (covariance.poses.len(), covariance.landmarks.len());
        // A block of a symmetric matrix is the same by rows and by columns.
        let blocks = covariance.poses.iter();
        let flat: Vec<f64> = blocks
            .flat_map(|block| block.map_or([[f64::NAN; 3]; 3], |b| b.data.0))
            .flatten()
            .collect();
        dict.set_item(
            "pose_covariance",
            convert::array3(py, &flat, [views, 3, 3])?,
        )?;
        let blocks = covariance.landmarks.iter();
        let flat: Vec<f64> = blocks
            .flat_map(|block| block.map_or([[f64::NAN; 2]; 2], |b| b.data.0))
            .flatten()
            .collect();
        dict.set_item(
            "landmark_covariance",
            convert::array3(py, &flat, [landmarks, 2, 2])?,
        )?;
        dict.set_item("covariance_frame", covariance.frame.name())?;
    } else {
        for name in ["pose_covariance", "landmark_covariance", "covariance_frame"] {
            dict.set_item(name, py.None())?;
        }
    }
    Ok(dict)
}
