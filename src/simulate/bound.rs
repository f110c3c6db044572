// SPDX-License-Identifier: MIT OR Apache-2.0
//! The Cramer-Rao bound of a scene.

use super::Scene;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::problem::Problem;
use crate::uncertainty::aligned_variances;

/// The Cramer-Rao bound on the errors of a map, in the measure of [`Errors`](super::Errors).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Bound on the root mean square distance of views and landmarks from their true positions.
    pub position_rms: f64,
    /// Bound on the root mean square error of the headings \[rad\].
    pub heading_rms: f64,
}

impl Scene {
    /// The least root mean square errors that an unbiased estimate from bearings with Gaussian noise of
    /// this standard deviation \[rad\] can have, after the similarity that aligns all positions best.
    ///
    /// `None` when the bearings do not determine the map, or the scene has more than 1024 parameters.
    ///
    /// # Example
    /// ```
    /// use bearslam::{Arena, Layout, simulate};
    /// let scene = simulate(Layout::Mixed, 5, 9, 0.01, 1, Arena::default())?;
    /// let (one, two) = (scene.bound(0.01).unwrap(), scene.bound(0.02).unwrap());
    /// assert!((two.position_rms - 2.0 * one.position_rms).abs() < 1e-12);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn bound(&self, noise: f64) -> Option<Bound> {
        let (views, landmarks) = (self.poses.len(), self.landmarks.len());
        let problem = Problem::dense(views, landmarks, &self.bearings, 1.0).ok()?;
        let variances = aligned_variances(&problem, &self.map())?;
        let mean = |sum: f64, count: usize| (sum / count as f64).sqrt() * noise;
        Some(Bound {
            position_rms: mean(variances.positions, views + landmarks),
            heading_rms: mean(variances.headings, views),
        })
    }
}
