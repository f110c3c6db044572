// SPDX-License-Identifier: MIT OR Apache-2.0
//! How far the landmarks of a map are predicted to be off.

use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::spread;
use crate::lm::{Loss, Observer};
use crate::problem::{Map, Problem};
use crate::uncertainty::{Frame, covariance};
use alloc::vec::Vec;
use nalgebra::Vector2;

/// The predicted root-mean-square error of the landmarks once the map is aligned with the truth, as a share of their
/// root-mean-square distance from their centroid: maps above a tenth are rough.
///
/// Of the free-network covariance, (T27), times `sigma0` of the [`GlobalTest`](crate::GlobalTest) where that is above 1
/// or no standard deviations are stated.
/// Infinite where a landmark is free, NaN without two landmarks apart. `inliers` says which sightings the map is
/// estimated from, in the order of the input.
///
/// # Errors
/// As [`covariance`].
///
/// # Example
/// ```
/// use bearslam::{
///     Arena, GlobalTest, Layout, Problem, SolveOptions, expected_error, simulate, solve,
/// };
/// let scene = simulate(Layout::Mixed, 6, 12, 0.01, 7, Arena::default())?;
/// let problem = Problem::dense(6, 12, &scene.bearings, 0.01)?;
/// let found = solve(&problem, &SolveOptions::default(), None)?;
/// let sigma0 = GlobalTest::of(&problem, &found).sigma0;
/// let error = expected_error(&problem, &found.map, &found.inliers, sigma0, None)?;
/// assert!((0.01..0.1).contains(&error));
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn expected_error(
    problem: &Problem,
    map: &Map,
    inliers: &[bool],
    sigma0: f64,
    observer: Option<Observer<'_>>,
) -> Result<f64, Error> {
    let inner = problem.of_inliers(inliers)?;
    let covariances = covariance(&inner, map, Loss::Squared, Frame::FreeNetwork, observer)?;
    let variances = covariances.landmarks.iter().flatten();
    let sum: f64 = variances.map(nalgebra::Matrix2::trace).sum();
    let places: Vec<Vector2<f64>> = map.landmarks.iter().flatten().map(|p| p.coords).collect();
    let least = if problem.states_sigma() { 1.0 } else { 0.0 };
    Ok((sum / spread(&places)).sqrt() * f64::max(least, sigma0))
}
