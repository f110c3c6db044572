// SPDX-License-Identifier: MIT OR Apache-2.0
//! Simulated odometry with noise.

use super::Scene;
use crate::error::Error;
use crate::geometry::{Pose, pose};
use crate::problem::{Noise, Odometry, check_sigma};
use alloc::vec::Vec;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

impl Scene {
    /// The motions from each view to the next, with Gaussian noise of these standard deviations of x, y and
    /// heading \[rad\]. The same seed gives the same noise.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for a standard deviation that is not above zero, [`Error::Magnitude`] for one beyond
    /// [`SIGMA_MAGNITUDES`](crate::SIGMA_MAGNITUDES).
    ///
    /// # Example
    /// ```
    /// use bearslam::{Arena, Layout, Problem, SolveOptions, simulate, solve};
    /// let arena = Arena { sight: 2.0, ..Arena::default() };
    /// let scene = simulate(Layout::Trajectory, 30, 20, 0.01, 1, arena)?;
    /// let odometry = scene.odometry([0.01, 0.01, 0.01], 2)?;
    /// let problem = Problem::dense(30, 20, &scene.bearings, 0.01)?.with_odometry(&odometry)?;
    /// let found = solve(&problem, &SolveOptions::default(), None)?;
    /// // Odometry determines the scale.
    /// let step = odometry[0].delta.translation.vector.norm();
    /// let position = found.map.poses[1].unwrap().translation.vector.norm();
    /// assert!((position - step).abs() < 0.05);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn odometry(&self, sigmas: [f64; 3], seed: u64) -> Result<Vec<Odometry>, Error> {
        for (index, sigma) in sigmas.into_iter().enumerate() {
            check_sigma("sigma", index, sigma)?;
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let pairs = self.poses.iter().zip(self.poses.iter().skip(1));
        Ok(pairs
            .enumerate()
            .map(|(start, (from, to))| {
                let error = sigmas.map(|sigma| {
                    let unit: f64 = StandardNormal.sample(&mut random);
                    sigma * unit
                });
                let error: Pose<f64> = pose(error[0], error[1], error[2]);
                Odometry {
                    start,
                    end: start + 1,
                    delta: from.inv_mul(to) * error,
                    noise: Noise::Sigmas(sigmas),
                }
            })
            .collect())
    }
}
