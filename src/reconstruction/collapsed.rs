// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps that have collapsed into a point.

use super::judge::JudgeOptions;
use super::result::Reconstruction;
use crate::error::{Degeneracy, Error};
use crate::geometry::points::{median, middle};
use crate::problem::Map;
use alloc::vec::Vec;
use nalgebra::Vector2;

/// Views below which a map in few places is no collapse: of three, one is the middle.
const FEW_VIEWS: usize = 4;

/// Rejects a map that explains nothing and has most views in one place: the least squares of a few bearings that are
/// exact there, whatever the others.
///
/// # Errors
/// [`Error::Degenerate`].
pub fn refuse_collapsed(found: &Reconstruction, options: &JudgeOptions) -> Result<(), Error> {
    let views = found.map.view_positions().count();
    if views < FEW_VIEWS || found.rms <= options.explaining_rms {
        return Ok(());
    }
    let share = share(&found.map);
    if share >= options.collapsed {
        return Ok(());
    }
    Err(Error::Degenerate {
        kind: Degeneracy::CollapsedMap,
        value: share,
        bound: options.collapsed,
    })
}

/// The median distance of the views from their middle, as a share of the largest.
pub fn share(map: &Map) -> f64 {
    let views: Vec<Vector2<f64>> = map.view_positions().collect();
    let middle = middle(&views);
    let distances = views.iter().map(|place| (place - middle).norm());
    let farthest = distances.clone().fold(0.0, f64::max);
    median(distances.collect()) / farthest
}
