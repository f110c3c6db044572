// SPDX-License-Identifier: MIT OR Apache-2.0
//! Many problems at once, over all cores.

use crate::error::Error;
use crate::estimation::Problem;
use crate::reconstruction::{Reconstruction, SolveOptions, solve};
use crate::scalar::Real;
use alloc::vec::Vec;
use rayon::prelude::*;

/// Solves many problems in parallel: the results of [`solve`], in the same order.
///
/// Each problem is solved by one thread, so results do not depend on their number.
///
/// # Example
/// ```
/// use bearslam::{Arena, Layout, Problem, SolveOptions, simulate, solve_batch};
/// let problems: Vec<Problem<f64>> = (0..8)
///     .map(|seed| {
///         let scene = simulate(Layout::Mixed, 4, 9, 0.0, seed, Arena::default())?;
///         Problem::dense(4, 9, &scene.bearings, 1.0)
///     })
///     .collect::<Result<_, _>>()?;
/// let found = solve_batch(&problems, &SolveOptions::default());
/// assert!(found.iter().flatten().all(|found| found.rms < 1e-9));
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn solve_batch<T: Real>(
    problems: &[Problem<T>],
    options: &SolveOptions<T>,
) -> Vec<Result<Reconstruction<T>, Error>> {
    problems
        .par_iter()
        .map(|problem| solve(problem, options, None))
        .collect()
}
