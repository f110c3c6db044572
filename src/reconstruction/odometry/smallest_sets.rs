// SPDX-License-Identifier: MIT OR Apache-2.0
//! Poses of views from the smallest sets of what is known and seen that fix them.

use super::super::incremental::place::backward;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Pose;
use crate::problem::{IndexedSighting, Problem};
use alloc::vec::Vec;
use nalgebra::{Complex, Point2, Translation2, UnitComplex, Vector2};

/// Part of the square of its radius by which a circle may miss a line that it is taken to touch.
const TOUCHING: f64 = 0.1;

/// Most landmarks whose pairs are tried for a view of known heading: a few dozen pairs are enough, and their number
/// grows with the square.
const PAIRED: usize = 10;

/// A view at a position, of a heading.
pub fn at(position: Vector2<f64>, heading: UnitComplex<f64>) -> Pose<f64> {
    Pose::from_parts(Translation2::from(position), heading)
}

/// A view at a position, turned so that it sees a point where it does.
pub fn turned_to(
    position: Vector2<f64>,
    point: &Point2<f64>,
    s: &IndexedSighting,
) -> Option<Pose<f64>> {
    let offset = point.coords - position;
    let norm = offset.norm();
    (norm > 0.0).then(|| {
        let toward = Complex::new(offset.x / norm, offset.y / norm);
        at(
            position,
            UnitComplex::new_unchecked(toward * s.bearing.into_inner().conj()),
        )
    })
}

/// Views of a heading that see two of their landmarks where they are.
pub fn by_pairs(
    problem: &Problem,
    heading: UnitComplex<f64>,
    seen: &[(Point2<f64>, &IndexedSighting)],
) -> Vec<Pose<f64>> {
    let mut found = Vec::new();
    for (k, first) in seen.iter().take(PAIRED).enumerate() {
        for second in seen.iter().take(k) {
            found.extend(backward(heading, first, second, problem.is_oriented()));
        }
    }
    found
}

/// A view of a heading that has a coordinate, on the ray backward from a landmark.
pub fn on_line(
    (axis, value): (usize, f64),
    heading: UnitComplex<f64>,
    point: &Point2<f64>,
    s: &IndexedSighting,
) -> Option<Pose<f64>> {
    let ray = (heading * s.bearing).into_inner();
    let ray = Vector2::new(ray.re, ray.im);
    let range = (point[axis] - value) / ray[axis];
    range
        .is_finite()
        .then(|| at(point.coords - ray * range, heading))
}

/// Views that have a coordinate and see two landmarks under their angle: where the line meets the two circles of the
/// points that do so modulo pi.
pub fn on_circles(
    (axis, value): (usize, f64),
    seen: &[(Point2<f64>, &IndexedSighting)],
) -> Vec<Pose<f64>> {
    let mut found = Vec::new();
    for (k, (first, one)) in seen.iter().take(PAIRED).enumerate() {
        for (second, two) in seen.iter().take(k) {
            let between = (one.bearing.inverse() * two.bearing).into_inner();
            let half = (second - first) * 0.5;
            let off = Vector2::new(-half.y, half.x) * (between.re / between.im);
            for off in [off, -off] {
                let center = first + half + off;
                let across = value - center[axis];
                let radius = (half + off).norm_squared();
                let square = radius - across * across;
                // Where they nearly touch, the noise decides whether they meet.
                if !(square >= -TOUCHING * radius) {
                    continue;
                }
                let root = square.max(0.0).sqrt();
                for along in [root, -root] {
                    let mut place = center.coords;
                    place[axis] = value;
                    place[1 - axis] += along;
                    found.extend(turned_to(place, first, one));
                }
            }
        }
    }
    found
}
