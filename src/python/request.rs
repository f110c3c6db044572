// SPDX-License-Identifier: MIT OR Apache-2.0
//! The problem with its odometry and priors, read from the attributes of frozen dataclasses of the package.

use super::convert::{self, Floats, Indices};
use super::errors;
use crate::{LandmarkPrior, Noise, Odometry, Pose, PosePrior, Problem, Sighting};
use alloc::vec::Vec;
use nalgebra::Point2;
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use std::format;

/// The package's `Request`.
#[derive(FromPyObject)]
pub struct Request<'py> {
    views: usize,
    landmarks: usize,
    view: Indices<'py>,
    landmark: Indices<'py>,
    bearing: Floats<'py>,
    sigma: Floats<'py>,
    oriented: bool,
    odometry: Option<RawOdometry<'py>>,
    pose_priors: Option<RawPosePriors<'py>>,
    landmark_priors: Option<RawLandmarkPriors<'py>>,
}

/// `sigma` holds standard deviations (k, 3) or covariances (k, 3, 3); for landmarks (k, 2) or (k, 2, 2).
#[derive(FromPyObject)]
struct RawOdometry<'py> {
    start: Indices<'py>,
    end: Indices<'py>,
    delta: Floats<'py>,
    sigma: Floats<'py>,
}

#[derive(FromPyObject)]
struct RawPosePriors<'py> {
    view: Indices<'py>,
    pose: Floats<'py>,
    sigma: Floats<'py>,
}

#[derive(FromPyObject)]
struct RawLandmarkPriors<'py> {
    landmark: Indices<'py>,
    position: Floats<'py>,
    sigma: Floats<'py>,
}

impl Request<'_> {
    pub fn read(&self, py: Python<'_>) -> PyResult<Problem> {
        let bearing = convert::entries(py, "bearing", &self.bearing, &[None])?;
        let sigma = convert::entries(py, "sigma", &self.sigma, &[Some(bearing.len())])?;
        let view = convert::indices(py, "view", &self.view, Some(bearing.len()))?;
        let landmark = convert::indices(py, "landmark", &self.landmark, Some(bearing.len()))?;
        let sightings: Vec<Sighting> = view
            .iter()
            .zip(&landmark)
            .zip(bearing.iter().zip(&sigma))
            .map(|((&view, &landmark), (&bearing, &sigma))| Sighting {
                view,
                landmark,
                bearing,
                sigma,
            })
            .collect();
        let odometry = self.odometry.as_ref().map(|raw| odometry(py, raw));
        let poses = self.pose_priors.as_ref().map(|raw| pose_priors(py, raw));
        let points = self.landmark_priors.as_ref();
        let points = points.map(|raw| landmark_priors(py, raw));
        let (odometry, poses, points) = (
            odometry.transpose()?.unwrap_or_default(),
            poses.transpose()?.unwrap_or_default(),
            points.transpose()?.unwrap_or_default(),
        );
        let (views, landmarks, oriented) = (self.views, self.landmarks, self.oriented);
        let made = py.detach(|| {
            let problem = Problem::new(views, landmarks, &sightings)?
                .with_odometry(&odometry)?
                .with_pose_priors(&poses)?
                .with_landmark_priors(&points)?;
            Ok(if oriented {
                problem
            } else {
                problem.unoriented()
            })
        });
        made.map_err(|error| errors::error(py, error))
    }
}

fn odometry(py: Python<'_>, raw: &RawOdometry<'_>) -> PyResult<Vec<Odometry>> {
    let RawOdometry {
        start,
        end,
        delta,
        sigma,
    } = raw;
    let start = convert::indices(py, "odometry: start", start, None)?;
    let end = convert::indices(py, "odometry: end", end, Some(start.len()))?;
    let delta = poses(py, "odometry: delta", delta, start.len())?;
    let noise = noise::<3>(py, "odometry: sigma", sigma, start.len())?;
    let ends = start.into_iter().zip(end);
    Ok(ends
        .zip(delta.into_iter().zip(noise))
        .map(|((start, end), (delta, noise))| Odometry {
            start,
            end,
            delta,
            noise,
        })
        .collect())
}

fn pose_priors(py: Python<'_>, raw: &RawPosePriors<'_>) -> PyResult<Vec<PosePrior>> {
    let RawPosePriors { view, pose, sigma } = raw;
    let view = convert::indices(py, "pose_priors: view", view, None)?;
    let pose = poses(py, "pose_priors: pose", pose, view.len())?;
    let noise = noise::<3>(py, "pose_priors: sigma", sigma, view.len())?;
    Ok(view
        .into_iter()
        .zip(pose.into_iter().zip(noise))
        .map(|(view, (pose, noise))| PosePrior { view, pose, noise })
        .collect())
}

fn landmark_priors(py: Python<'_>, raw: &RawLandmarkPriors<'_>) -> PyResult<Vec<LandmarkPrior>> {
    let RawLandmarkPriors {
        landmark,
        position,
        sigma,
    } = raw;
    let landmark = convert::indices(py, "landmark_priors: landmark", landmark, None)?;
    let count = landmark.len();
    let shape = [Some(count), Some(2)];
    let position = convert::finite(py, "landmark_priors: position", position, &shape)?;
    let noise = noise::<2>(py, "landmark_priors: sigma", sigma, count)?;
    Ok(landmark
        .into_iter()
        .zip(position.chunks_exact(2).zip(noise))
        .map(|(landmark, (position, noise))| LandmarkPrior {
            landmark,
            position: Point2::new(position[0], position[1]),
            noise,
        })
        .collect())
}

fn poses(
    py: Python<'_>,
    name: &'static str,
    array: &Floats<'_>,
    count: usize,
) -> PyResult<Vec<Pose<f64>>> {
    let entries = convert::finite(py, name, array, &[Some(count), Some(3)])?;
    let rows = entries.chunks_exact(3);
    Ok(rows.map(|p| crate::pose(p[0], p[1], p[2])).collect())
}

/// Standard deviations (k, N) or covariances (k, N, N).
fn noise<const N: usize>(
    py: Python<'_>,
    name: &str,
    array: &Floats<'_>,
    count: usize,
) -> PyResult<Vec<Noise<N>>> {
    let row = |row: &[f64]| core::array::from_fn(|k| row[k]);
    match *array.shape() {
        [rows, width] if rows == count && width == N => {
            let entries = convert::entries(py, name, array, &[None, None])?;
            let rows = entries.chunks_exact(N);
            Ok(rows.map(|sigmas| Noise::Sigmas(row(sigmas))).collect())
        }
        [blocks, height, width] if blocks == count && height == N && width == N => {
            let entries = convert::entries(py, name, array, &[None, None, None])?;
            let blocks = entries.chunks_exact(N * N);
            let covariance =
                |block: &[f64]| core::array::from_fn(|i| row(&block[N * i..N * (i + 1)]));
            Ok(blocks
                .map(|block| Noise::Covariance(covariance(block)))
                .collect())
        }
        _ => Err(errors::invalid(
            py,
            &format!(
                "{name}: expected an array of shape ({count}, {N}) or ({count}, {N}, {N}), got {:?}",
                array.shape()
            ),
        )),
    }
}
