// SPDX-License-Identifier: MIT OR Apache-2.0
//! Four landmarks: three views leave a circle of tensors, a fourth view finds its place on it.

use super::expand::{grow, score};
use super::triples::common_bearings;
use crate::estimation::{Map, Problem};
use crate::kernels::CalibratedTensor;
use crate::scalar::Real;
use alloc::vec::Vec;

/// Places on the half circle of tensors that are tried.
const PLACES: usize = 180;

/// A map and its score.
pub type Scored<T> = (T, Map<T>);

/// Maps that a sweep over the tensors of a triple of views finds, best first.
///
/// With four landmarks the null space of the calibrated system has two dimensions, a circle of
/// tensors `cos f Ta + sin f Tb`, (T17) (and its negative, which is the same tensor). For each f the motion
/// is closed form; growing the map to the other views scores it. Local minima of the score along f
/// are returned.
pub fn sweep<T: Real>(problem: &Problem<T>, views: [usize; 3]) -> Vec<Scored<T>> {
    let (triples, _) = common_bearings(problem, views);
    let basis = CalibratedTensor::null_pair(&triples);
    // One tensor after the other along the circle, both branches of each.
    let mut scored: [Vec<Scored<T>>; 2] = [Vec::new(), Vec::new()];
    for place in 0..PLACES {
        let angle = T::pi() * T::lit((place as f64 + 0.5) / PLACES as f64);
        let (sin, cos) = angle.sin_cos();
        let motions = CalibratedTensor::combine(&basis, cos, sin).motions(&triples);
        for (branch, scored) in scored.iter_mut().enumerate() {
            let mut map = Map::empty(problem.views(), problem.landmarks());
            if let Ok(motions) = &motions {
                for (&view, pose) in views.iter().zip(motions[branch].poses) {
                    map.poses[view] = Some(pose);
                }
                grow(problem, &mut map);
            }
            scored.push((score(problem, &map), map));
        }
    }
    let mut found = Vec::new();
    for scored in scored {
        let value = |place: usize| scored[place % PLACES].0;
        let minima: Vec<bool> = (0..PLACES)
            .map(|place| {
                value(place) <= value(place + PLACES - 1) && value(place) <= value(place + 1)
            })
            .collect();
        let kept = scored
            .into_iter()
            .zip(minima)
            .filter(|(_, minimum)| *minimum);
        found.extend(kept.map(|(scored, _)| scored));
    }
    found.sort_by(|a, b| a.0.as_f64().total_cmp(&b.0.as_f64()));
    found
}
