// SPDX-License-Identifier: MIT OR Apache-2.0
//! Many problems at once, on all cores.

use crate::error::Error;
use crate::kernels::{Method, ThreeView, Triple, three_view};
use crate::problem::Problem;
use crate::reconstruction::{Reconstruction, SolveOptions, solve};
use crate::scalar::Real;
use alloc::vec::Vec;
use rayon::prelude::*;

/// Solves many problems in parallel: the results of [`solve`], in the same order.
///
/// Each problem is solved by one thread, so results do not depend on the number of threads.
///
/// # Example
/// ```
/// use bearslam::{Arena, Layout, Problem, SolveOptions, simulate, solve_batch};
/// let problems: Vec<Problem> = (0..8)
///     .map(|seed| {
///         let scene = simulate(Layout::Mixed, 4, 9, 0.0, seed, Arena::default())?;
///         Problem::dense(4, 9, &scene.bearings, 1.0)
///     })
///     .collect::<Result<_, _>>()?;
/// let found = solve_batch(&problems, &SolveOptions::default());
/// assert!(found.iter().flatten().all(|found| found.rms < 1e-9));
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn solve_batch(
    problems: &[Problem],
    options: &SolveOptions,
) -> Vec<Result<Reconstruction, Error>> {
    problems
        .par_iter()
        .map(|problem| solve(problem, options, None))
        .collect()
}

/// The motions of many triples of views in parallel: the results of [`three_view`], in the same order.
///
/// Each problem has `landmarks` triples of bearings, stored one after the other; an incomplete problem at
/// the end is ignored.
///
/// # Example
/// ```
/// use bearslam::{Bearing, Method, three_view_batch};
/// let views = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.4), (0.3, 0.8, -0.7)];
/// let points = [(2.0, 1.0), (-1.0, 2.0), (0.5, 3.0), (1.5, -2.0), (-2.0, -1.0)];
/// let triples: Vec<[Bearing<f64>; 3]> = points
///     .iter()
///     .map(|&(x, y)| views.map(|(a, b, t)| Bearing::new(f64::atan2(y - b, x - a) - t)))
///     .collect();
/// let twice = [triples.clone(), triples].concat();
/// let found = three_view_batch(&twice, 5, Method::Calibrated { reweights: 0 });
/// assert_eq!(found.len(), 2);
/// assert_eq!(found[0].as_ref().unwrap(), found[1].as_ref().unwrap());
/// ```
pub fn three_view_batch<T: Real>(
    triples: &[Triple<T>],
    landmarks: usize,
    method: Method,
) -> Vec<Result<ThreeView<T>, Error>> {
    triples
        .par_chunks_exact(landmarks.max(1))
        .with_min_len(64)
        .map(|triples| three_view(triples, method))
        .collect()
}
