// SPDX-License-Identifier: MIT OR Apache-2.0
//! Completion of a map in the frame of the priors by all that is known of what it lacks.

use super::super::incremental::complete::place_all;
use super::super::incremental::options::IncrementalOptions;
use super::super::robust::motions::Motions;
use super::known::Known;
use crate::problem::{Map, Problem};

/// Adds the views and landmarks that bearings, odometry and priors together place, however badly they fit.
pub fn complete(
    problem: &Problem,
    options: &IncrementalOptions,
    known: &Known,
    motions: &Motions,
    map: &mut Map,
) {
    for (place, known) in map.landmarks.iter_mut().zip(&known.landmarks) {
        *place = place.or(*known);
    }
    loop {
        place_all(problem, options, map);
        let mut placed = false;
        for view in 0..map.poses.len() {
            if map.poses[view].is_none() {
                map.poses[view] = known.locate(problem, map, view, motions, true);
                placed |= map.poses[view].is_some();
            }
        }
        if !placed {
            break;
        }
    }
}
