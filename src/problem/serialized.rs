// SPDX-License-Identifier: MIT OR Apache-2.0
//! Serialisation of problems and maps with `serde`.
//!
//! Reading goes through the constructors of the problem, so that an invalid problem is a deserialisation error. A
//! problem is written as it was given, sightings in the order of the input with bearings and standard deviations;
//! it stores directions and weights, so numbers survive a round trip to within rounding. Infinite standard
//! deviations, which JSON cannot express, are written as `None`.

use super::map::Map;
use super::noise::Noise;
use super::priors::{LandmarkPrior, Odometry, PosePrior, Prior};
use super::problem::Problem;
use super::sighting::Sighting;
use crate::geometry::{pose, xytheta};
use alloc::vec::Vec;
use nalgebra::{Point2, SMatrix};
use serde::de::Error as _;
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A problem as it was given.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Problem", deny_unknown_fields)]
struct Given {
    views: usize,
    landmarks: usize,
    #[serde(default = "oriented")]
    oriented: bool,
    sightings: Vec<Sighting>,
    #[serde(default)]
    odometry: Vec<Odometry>,
    #[serde(default)]
    pose_priors: Vec<PosePrior>,
    #[serde(default)]
    landmark_priors: Vec<LandmarkPrior>,
}

fn oriented() -> bool {
    true
}

impl Serialize for Problem {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut by_place: Vec<_> = self.input_order().iter().zip(self.sightings()).collect();
        by_place.sort_by_key(|(place, _)| **place);
        let sightings = by_place.into_iter().map(|(_, seen)| Sighting {
            view: seen.view,
            landmark: seen.landmark,
            bearing: seen.bearing.angle(),
            sigma: 1.0 / seen.weight,
        });
        let mut given = Given {
            views: self.views(),
            landmarks: self.landmarks(),
            oriented: self.is_oriented(),
            sightings: sightings.collect(),
            odometry: Vec::new(),
            pose_priors: Vec::new(),
            landmark_priors: Vec::new(),
        };
        for prior in self.priors() {
            match *prior {
                Prior::Motion {
                    start,
                    end,
                    delta,
                    root,
                } => given.odometry.push(Odometry {
                    start,
                    end,
                    delta,
                    noise: noise(root),
                }),
                Prior::Pose { view, pose, root } => given.pose_priors.push(PosePrior {
                    view,
                    pose,
                    noise: noise(root),
                }),
                Prior::Landmark {
                    landmark,
                    position,
                    root,
                } => given.landmark_priors.push(LandmarkPrior {
                    landmark,
                    position,
                    noise: noise(root),
                }),
            }
        }
        given.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Problem {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let given = Given::deserialize(deserializer)?;
        let problem = Self::new(given.views, given.landmarks, &given.sightings)
            .and_then(|problem| problem.with_odometry(&given.odometry))
            .and_then(|problem| problem.with_pose_priors(&given.pose_priors))
            .and_then(|problem| problem.with_landmark_priors(&given.landmark_priors))
            .map_err(D::Error::custom)?;
        Ok(if given.oriented {
            problem
        } else {
            problem.unoriented()
        })
    }
}

/// The uncertainty with a given square root of the information, a lower triangle.
fn noise<const N: usize>(root: [[f64; N]; N]) -> Noise<N> {
    let is_diagonal = (0..N).all(|i| (0..i).all(|j| root[i][j] == 0.0));
    // A root with unknown components, without information, is always diagonal.
    if is_diagonal {
        return Noise::Sigmas(core::array::from_fn(|k| 1.0 / root[k][k]));
    }
    // The inverse of the triangle, column by column; the covariance is this times its transpose.
    let mut inverse = SMatrix::<f64, N, N>::zeros();
    for column in 0..N {
        for row in column..N {
            let known = f64::from(u8::from(row == column));
            let sum: f64 = (column..row)
                .map(|k| root[row][k] * inverse[(k, column)])
                .sum();
            inverse[(row, column)] = (known - sum) / root[row][row];
        }
    }
    let covariance = inverse * inverse.transpose();
    Noise::Covariance(core::array::from_fn(|i| {
        core::array::from_fn(|j| covariance[(i, j)])
    }))
}

/// A map as coordinates: `[x, y, theta]` of poses, `[x, y]` of landmarks, `None` for what is undetermined.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Map", deny_unknown_fields)]
struct Coordinates {
    poses: Vec<Option<[f64; 3]>>,
    landmarks: Vec<Option<[f64; 2]>>,
}

impl Serialize for Map {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let poses = self.poses.iter().map(|pose| pose.as_ref().map(xytheta));
        let landmarks = self.landmarks.iter().map(|point| point.map(Into::into));
        let coordinates = Coordinates {
            poses: poses.collect(),
            landmarks: landmarks.collect(),
        };
        coordinates.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Map {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = Coordinates::deserialize(deserializer)?;
        let poses = read.poses.into_iter();
        let landmarks = read.landmarks.into_iter();
        Ok(Self {
            poses: poses
                .map(|given| given.map(|[x, y, theta]| pose(x, y, theta)))
                .collect(),
            landmarks: landmarks.map(|given| given.map(Point2::from)).collect(),
        })
    }
}

/// An uncertainty of any size.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Noise", rename_all = "snake_case")]
enum GivenNoise {
    /// `None` is infinite.
    Sigmas(Vec<Option<f64>>),
    Covariance(Vec<Vec<f64>>),
}

impl<const N: usize> Serialize for Noise<N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Sigmas(sigmas) => {
                if sigmas.iter().any(|sigma| sigma.is_nan()) {
                    return Err(S::Error::custom("a standard deviation is not a number"));
                }
                let finite = |sigma: &f64| sigma.is_finite().then_some(*sigma);
                GivenNoise::Sigmas(sigmas.iter().map(finite).collect())
            }
            Self::Covariance(rows) => {
                GivenNoise::Covariance(rows.iter().map(|row| row.to_vec()).collect())
            }
        }
        .serialize(serializer)
    }
}

impl<'de, const N: usize> Deserialize<'de> for Noise<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let wrong = |rows: usize| D::Error::invalid_length(rows, &"one number for each component");
        match GivenNoise::deserialize(deserializer)? {
            GivenNoise::Sigmas(sigmas) => {
                let sigmas: Vec<_> = sigmas
                    .into_iter()
                    .map(|sigma| sigma.unwrap_or(f64::INFINITY))
                    .collect();
                let sigmas = sigmas.try_into();
                sigmas
                    .map(Self::Sigmas)
                    .map_err(|sigmas: Vec<f64>| wrong(sigmas.len()))
            }
            GivenNoise::Covariance(rows) => {
                let mut covariance = [[0.0; N]; N];
                if rows.len() != N {
                    return Err(wrong(rows.len()));
                }
                for (to, row) in covariance.iter_mut().zip(rows) {
                    *to = row.try_into().map_err(|row: Vec<f64>| wrong(row.len()))?;
                }
                Ok(Self::Covariance(covariance))
            }
        }
    }
}
