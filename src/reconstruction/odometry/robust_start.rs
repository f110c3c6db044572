// SPDX-License-Identifier: MIT OR Apache-2.0
//! Starts along the odometry that outliers do not spoil, and what they lead to.

use super::super::options::{Progress, SolveOptions, tell};
use super::super::result::Reconstruction;
use super::super::robust::expand::AGREEING_OF_VIEW;
use super::super::robust::reassign::replace;
use super::super::robust::solve::{FEW_OUTLIERS, check_sigmas, reconstruction};
use super::robust_growth;
use super::sweeps::{retrace, softly};
use crate::error::Error;
use crate::lm::{Loss, RefineOptions};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Maps along the odometry of a problem, the largest first; none where it has no odometry.
///
/// # Errors
/// [`Error::Interrupted`], [`Error::OutOfMemory`] and [`Error::SigmaTooLarge`].
pub fn along_odometry(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    check_sigmas(problem)?;
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    robust_growth::follow(problem, &options.refine, &mut random, progress)
}

/// Whether the search from bearings alone may reach most views: those that see landmarks enough to be
/// placed among outliers. The work it does is quadratic in the views, and in vain where most are not.
pub fn is_searchable(problem: &Problem) -> bool {
    let counts = (0..problem.views()).map(|view| problem.of_view(view).len());
    let enough = counts.clone().filter(|&count| count >= AGREEING_OF_VIEW);
    2 * enough.count() > counts.filter(|&count| count > 0).count()
}

/// The map at the fixed point near a start, with odometry and priors; `None` when there is none.
///
/// # Errors
/// [`Error::Interrupted`], [`Error::OutOfMemory`] and [`Error::SigmaTooLarge`].
pub fn from_start(
    problem: &Problem,
    start: &Map,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    check_sigmas(problem)?;
    if !tell(progress, "improve", 0, 1) {
        return Err(Error::Interrupted);
    }
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let plain = RefineOptions {
        loss: Loss::Squared,
        ..options.refine
    };
    let Some(settled) = softly(problem, start.clone(), &plain)? else {
        return Ok(None);
    };
    let settled = replace(problem, settled, &plain, &mut random, progress)?;
    let settled = retrace(problem, settled, &plain, &mut random, progress)?;
    Ok(Some(reconstruction(problem, &settled)))
}

/// Refuses a map along odometry that most bearings do not agree with: the odometry alone makes a map, whatever
/// they say.
pub fn refuse_minority(found: &Reconstruction) -> Result<(), Error> {
    let inliers = found.inliers.iter().filter(|inlier| **inlier).count();
    let outliers = found.inliers.len() - inliers;
    if outliers > inliers && outliers > FEW_OUTLIERS {
        return Err(Error::NoConsensus {
            inliers,
            outliers,
            freedom: found.freedom,
        });
    }
    Ok(())
}
