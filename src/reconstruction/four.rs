// SPDX-License-Identifier: MIT OR Apache-2.0
//! Four landmarks: three views leave a circle of tensors, a fourth view finds its place on it.

use super::expand::{grow, score};
use super::triples::common_bearings;
use crate::estimation::{Map, Problem};
use crate::kernels::CalibratedTensor;
use crate::scalar::Real;
use alloc::vec::Vec;

/// Places on the half circle of tensors that are tried.
const PLACES: usize = 48;

/// Maps that a sweep over the tensors of a triple of views finds, best first.
///
/// With four landmarks the null space of the calibrated system has two dimensions, a circle of
/// tensors `cos f Ta + sin f Tb` (and its negative, which is the same tensor). For each f the motion
/// is closed form; growing the map to the other views scores it. Local minima of the score along f
/// are returned.
pub fn sweep<T: Real>(problem: &Problem<T>, views: [usize; 3]) -> Vec<(T, Map<T>)> {
    let (triples, _) = common_bearings(problem, views);
    let basis = CalibratedTensor::null_pair(&triples);
    let mut branches: [Vec<Option<(T, Map<T>)>>; 2] = [Vec::new(), Vec::new()];
    for place in 0..PLACES {
        let angle = T::pi() * T::lit((place as f64 + 0.5) / PLACES as f64);
        let (sin, cos) = angle.sin_cos();
        let motions = CalibratedTensor::combine(&basis, cos, sin).motions(&triples);
        for (branch, scores) in branches.iter_mut().enumerate() {
            scores.push(motions.as_ref().ok().map(|motions| {
                let mut map = Map::empty(problem.views(), problem.landmarks());
                for (&view, pose) in views.iter().zip(motions[branch].poses) {
                    map.poses[view] = Some(pose);
                }
                grow(problem, &mut map);
                (score(problem, &map), map)
            }));
        }
    }
    let mut found: Vec<(T, Map<T>)> = Vec::new();
    for scores in branches {
        let value = |place: usize| {
            scores[place % PLACES]
                .as_ref()
                .map_or(f64::INFINITY, |(score, _)| score.as_f64())
        };
        let minima: Vec<bool> = (0..PLACES)
            .map(|place| {
                value(place) <= value(place + PLACES - 1) && value(place) <= value(place + 1)
            })
            .collect();
        found.extend(
            scores
                .into_iter()
                .zip(minima)
                .filter_map(|(scored, minimum)| scored.filter(|_| minimum)),
        );
    }
    found.sort_by(|a, b| a.0.as_f64().total_cmp(&b.0.as_f64()));
    found
}
