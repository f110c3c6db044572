// SPDX-License-Identifier: MIT OR Apache-2.0
//! From three views to a whole map, with bearings that may be wrong.

use super::consensus::descend;
use super::place::{place_landmark, place_view};
use super::sampling::Seed;
use crate::error::Error;
use crate::geometry::Pose;
use crate::kernels::Motion;
use crate::lm::RefineOptions;
use crate::problem::{MIN_LANDMARKS_OF_VIEW, Map, Problem};
use alloc::vec::Vec;
use rand_chacha::ChaCha8Rng;

/// Standard deviations within which a bearing agrees with a map that is still growing: it comes from few
/// bearings, and its errors are several times theirs.
pub const GROWING: f64 = 9.0;

/// Sightings of a new view that must agree, one more than fix it; and those of a new landmark.
pub const AGREEING_OF_VIEW: usize = MIN_LANDMARKS_OF_VIEW + 1;
pub const AGREEING_OF_LANDMARK: usize = 3;

/// Iterations of refinement while the map grows: it only has to be better than its parts.
const ITERATIONS: usize = 4;

/// Grows a map from a seed by resection and triangulation in turn, refined in between; the views on
/// which most landmarks agree come first, half as many at a time as there are.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`] of the refinement.
pub fn expand(
    problem: &Problem,
    seed: &Seed,
    motion: &Motion<f64>,
    options: &RefineOptions,
    random: &mut ChaCha8Rng,
) -> Result<Map, Error> {
    let mut map = Map::empty(problem.views(), problem.landmarks());
    for (&view, pose) in seed.views.iter().zip(motion.poses) {
        map.poses[view] = Some(pose);
    }
    for &landmark in &seed.landmarks {
        map.landmarks[landmark] = place_landmark(problem, &map, landmark, GROWING, 1, random)
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
    options: &RefineOptions,
    random: &mut ChaCha8Rng,
) -> Result<(), Error> {
    // At least one view more each time, unless the refinement has thrown it out again.
    for _ in 0..problem.views() {
        let mut found: Vec<(usize, usize, Pose<f64>)> = Vec::new();
        for view in 0..problem.views() {
            if map.poses[view].is_none()
                && let Some(placed) = place_view(problem, map, view, GROWING, 1, random).first()
                && placed.count() >= AGREEING_OF_VIEW
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
            if let Some(placed) = place_landmark(problem, map, landmark, GROWING, 1, random).first()
            {
                let known = map.landmarks[landmark].is_some();
                if known || placed.count() >= AGREEING_OF_LANDMARK {
                    map.landmarks[landmark] = Some(placed.place);
                }
            }
        }
        descend(problem, map, GROWING, ITERATIONS, options)?;
    }
    Ok(())
}
