// SPDX-License-Identifier: MIT OR Apache-2.0
//! The global test of the fit: chi-square over its degrees of freedom.

use super::distributions::{truncated_variance, upper_tail};
use crate::adjustment::cost_of_priors;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::Loss;
use crate::problem::Problem;
use crate::reconstruction::Reconstruction;

/// How large the residuals of a map are, in units of the stated standard deviations.
///
/// # Reference
/// W. Baarda, "A testing procedure for use in geodetic networks", 1968.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlobalTest {
    /// Sum of the squared residuals over sigma, of bearings, odometry and priors. With a truncated loss, or
    /// [`SolveOptions::robust`](crate::SolveOptions::robust), that of the inliers, made as large as if none had been
    /// cut off. With another loss twice the cost.
    pub square: f64,
    /// Degrees of freedom.
    pub freedom: usize,
    /// A-posteriori standard deviation of unit weight: the root of the square per degree of freedom, 1 where the
    /// standard deviations are right. NaN without a degree of freedom.
    pub sigma0: f64,
    /// The probability that errors of the stated standard deviations have a square as large as this. NaN without a
    /// degree of freedom, where no standard deviations are stated, and with the losses of Huber and Cauchy, whose
    /// squares have no such distribution.
    pub p_value: f64,
}

impl GlobalTest {
    /// The test of a map of a problem.
    ///
    /// # Example
    /// ```
    /// use bearslam::{Arena, GlobalTest, Layout, Problem, SolveOptions, simulate, solve};
    /// let scene = simulate(Layout::Mixed, 6, 12, 0.01, 7, Arena::default())?;
    /// let understated = Problem::dense(6, 12, &scene.bearings, 0.005)?;
    /// let found = solve(&understated, &SolveOptions::default(), None)?;
    /// let test = GlobalTest::of(&understated, &found);
    /// assert!(test.sigma0 > 1.5 && test.p_value < 1e-3);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn of(problem: &Problem, found: &Reconstruction) -> Self {
        let square = match found.loss {
            Loss::Truncated(width) => {
                squares_of_inliers(problem, found) / truncated_variance(width)
                    + 2.0 * cost_of_priors(problem, &found.map)
            }
            _ => 2.0 * found.cost,
        };
        let freedom = found.freedom as f64;
        let has_distribution = matches!(found.loss, Loss::Squared | Loss::Truncated(_));
        Self {
            square,
            freedom: found.freedom,
            sigma0: if found.freedom > 0 {
                (square / freedom).sqrt()
            } else {
                f64::NAN
            },
            p_value: if has_distribution && problem.states_sigma() {
                upper_tail(square, freedom)
            } else {
                f64::NAN
            },
        }
    }
}

/// Sum of the squared residuals over sigma of the inliers.
fn squares_of_inliers(problem: &Problem, found: &Reconstruction) -> f64 {
    let sightings = problem.sightings().iter().zip(problem.input_order());
    let squares = sightings.filter_map(|(s, &place)| {
        let residual = found.residuals[place].filter(|_| found.inliers[place])?;
        let ratio = residual * s.weight;
        Some(ratio * ratio)
    });
    squares.sum()
}
