// SPDX-License-Identifier: MIT OR Apache-2.0
//! The end of a growth: a place for everything that has one.

use super::gates::noise;
use super::growth::GATES;
use super::locate;
use crate::estimation::{MIN_LANDMARKS_OF_VIEW, Map, Problem};
use crate::scalar::Real;

/// Puts in everything that the gates have kept out and that has a place at all, for the last refinement.
///
/// A landmark whose rays do not meet goes far out along them: the refinement tells whether it is at
/// infinity.
pub fn complete<T: Real>(problem: &Problem<T>, map: &mut Map<T>, allowed: &[bool]) {
    let noise = noise(problem, map);
    // Landmarks, the views that need them, the landmarks that need these.
    for _ in 0..2 {
        for landmark in 0..map.landmarks.len() {
            if map.landmarks[landmark].is_none() {
                let met = locate::landmark(problem, map, landmark);
                let far = locate::far_out(problem, map, landmark);
                let places = met.into_iter().chain(far);
                let best = places.min_by(|a, b| {
                    let [a, b] = [a, b].map(|(_, fit)| fit.squares.as_f64());
                    a.total_cmp(&b)
                });
                map.landmarks[landmark] = best.map(|(point, _)| point);
            }
        }
        for view in 0..map.poses.len() {
            if map.poses[view].is_none()
                && allowed[view]
                && let Some((_, pose, fit)) = locate::view(problem, map, view)
                && fit.passes(MIN_LANDMARKS_OF_VIEW, noise, GATES[GATES.len() - 1])
            {
                map.poses[view] = Some(pose);
            }
        }
    }
}
