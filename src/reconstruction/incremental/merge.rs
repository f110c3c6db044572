// SPDX-License-Identifier: MIT OR Apache-2.0
//! Two maps that share landmarks become one.

use super::gates::{noise, range_variance};
use crate::estimation::{Map, Problem};
use crate::geometry::{align, transform_pose};
use crate::scalar::Real;
use alloc::vec::Vec;
use nalgebra::Point2;

/// Landmarks that tie two maps: as many as a similarity needs.
const TIES: usize = 2;

/// A landmark ties when both maps know its range to this part of it: one nearly at infinity would
/// decide the scale alone.
const MAX_DEVIATION: f64 = 0.25;

/// The first map with what the second has beyond it, moved by the similarity that fits their common
/// landmarks best; `None` when they share fewer than two.
///
/// Two shared landmarks fix the similarity and leave nothing to check it; the refinement of the
/// whole does, by its cost.
pub fn merged<T: Real>(problem: &Problem<T>, first: &Map<T>, second: &Map<T>) -> Option<Map<T>> {
    let (mut source, mut target) = (Vec::new(), Vec::new());
    let held = |map: &Map<T>, noise: T, landmark: usize, point: &Point2<T>| {
        let bound = T::lit(MAX_DEVIATION) / noise;
        range_variance(problem, map, landmark, point) < bound * bound
    };
    let noises = [noise(problem, first), noise(problem, second)];
    for landmark in 0..problem.landmarks() {
        if let (Some(a), Some(b)) = (first.landmarks[landmark], second.landmarks[landmark])
            && held(first, noises[0], landmark, &a)
            && held(second, noises[1], landmark, &b)
        {
            source.push(b);
            target.push(a);
        }
    }
    if source.len() < TIES {
        return None;
    }
    let similarity = align(&source, &target).ok()?;
    let mut map = first.clone();
    for (to, from) in map.poses.iter_mut().zip(&second.poses) {
        *to = to.or_else(|| from.map(|pose| transform_pose(&similarity, &pose)));
    }
    for (to, from) in map.landmarks.iter_mut().zip(&second.landmarks) {
        *to = to.or_else(|| from.map(|point| similarity.transform_point(&point)));
    }
    Some(map)
}
