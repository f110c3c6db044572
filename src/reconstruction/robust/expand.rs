// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robust growth from three views to a whole map.

use super::super::options::SolveOptions;
use super::consensus::descend;
use super::place::{place_landmark, place_view};
use super::sampling::Seed;
use crate::error::Error;
use crate::geometry::Pose;
use crate::kernels::Motion;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use rand_chacha::ChaCha8Rng;

/// Grows a map from a seed by resection and triangulation in turn, refined in between. The views with most
/// inliers come first; a round adds at most half as many views as the map has.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`] of the refinement.
pub fn expand(
    problem: &Problem,
    seed: &Seed,
    motion: &Motion<f64>,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
) -> Result<Map, Error> {
    let robust = &options.stages.robust;
    let mut map = Map::empty(problem.views(), problem.landmarks());
    for (&view, pose) in seed.views.iter().zip(motion.poses) {
        map.poses[view] = Some(pose);
    }
    for &landmark in &seed.landmarks {
        map.landmarks[landmark] = place_landmark(
            problem,
            &map,
            landmark,
            robust.growing_bound,
            1,
            robust,
            random,
        )
        .first()
        .map(|found| found.place);
    }
    extend(problem, &mut map, options, random)?;
    Ok(map)
}

/// Grows a map by resection and triangulation in turn, as [`expand`], from the views that it has.
///
/// # Errors
/// As [`expand`].
pub fn extend(
    problem: &Problem,
    map: &mut Map,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
) -> Result<(), Error> {
    let robust = &options.stages.robust;
    // At least one view more each time, unless the refinement has thrown it out again.
    for _ in 0..problem.views() {
        let mut found: Vec<(usize, usize, Pose<f64>)> = Vec::new();
        for view in 0..problem.views() {
            if map.poses[view].is_none()
                && let Some(placed) =
                    place_view(problem, map, view, robust.growing_bound, 1, robust, random).first()
                && placed.count() >= robust.agreeing_of_view
            {
                found.push((placed.count(), view, placed.place));
            }
        }
        if found.is_empty() {
            break;
        }
        found.sort_by_key(|&(agreeing, view, _)| (core::cmp::Reverse(agreeing), view));
        let placed = map.poses.iter().flatten().count();
        for (_, view, pose) in found.into_iter().take(placed.div_ceil(2)) {
            map.poses[view] = Some(pose);
        }
        for landmark in 0..problem.landmarks() {
            if let Some(placed) = place_landmark(
                problem,
                map,
                landmark,
                robust.growing_bound,
                1,
                robust,
                random,
            )
            .first()
            {
                let known = map.landmarks[landmark].is_some();
                if known || placed.count() >= robust.agreeing_of_landmark {
                    map.landmarks[landmark] = Some(placed.place);
                }
            }
        }
        let iterations = robust.growing_iterations;
        descend(problem, map, robust.growing_bound, iterations, options)?;
    }
    Ok(())
}
