// SPDX-License-Identifier: MIT OR Apache-2.0
//! Four landmarks near a circle: the two maps that explain noisy bearings, and the map between them.
//!
//! Any map of four landmarks has a twin that explains the bearings as well, and the two coincide when the landmarks are
//! on a circle. Noisy bearings of such a scene give two solutions on either side of the circle, at about the same
//! distance from it; the map halfway between them is off the circle only by the square of that distance.

use super::super::finding::Kind;
use super::super::parts::subproblem::SubProblem;
use crate::geometry::{Pose, align};
use crate::problem::Map;
use alloc::vec::Vec;
use nalgebra::{Point2, center};

impl SubProblem {
    /// A map with four landmarks on a circle: one of the others that explain the bearings, or the map halfway
    /// between the given one and one of them.
    pub fn midpoint_map(&self, map: &Map, others: &[Map], noise: f64) -> Option<Map> {
        if self.problem.landmarks() != 4 {
            return None;
        }
        let between = others.iter().filter_map(|other| midpoint(map, other));
        let between = between.filter(|halfway| self.explains(halfway, map, noise));
        let mut maps = others.iter().cloned().chain(between);
        maps.find(|map| self.has_shape(map, Kind::FourLandmarksOnACircle, noise))
    }
}

/// The map halfway between two, after the second has been aligned with the first.
fn midpoint(one: &Map, other: &Map) -> Option<Map> {
    let place = |pose: &Pose<f64>| Point2::from(pose.translation.vector);
    let points = |map: &Map| {
        let views = map.poses.iter().map(move |pose| pose.as_ref().map(place));
        views
            .chain(map.landmarks.iter().copied())
            .collect::<Vec<_>>()
    };
    let pairs = points(one).into_iter().zip(points(other));
    let (target, source): (Vec<_>, Vec<_>) = pairs.filter_map(|(a, b)| Some((a?, b?))).unzip();
    let laid = other.transformed(&align(&source, &target).ok()?);
    let poses = one.poses.iter().zip(&laid.poses).map(|(a, b)| {
        let (a, b) = ((*a)?, (*b)?);
        let rotation = a.rotation * (a.rotation.inverse() * b.rotation).powf(0.5);
        let middle = center(&place(&a), &place(&b));
        Some(Pose::from_parts(middle.coords.into(), rotation))
    });
    let landmarks = one.landmarks.iter().zip(&laid.landmarks);
    Some(Map {
        poses: poses.collect(),
        landmarks: landmarks
            .map(|(a, b)| Some(center(&(*a)?, &(*b)?)))
            .collect(),
    })
}
