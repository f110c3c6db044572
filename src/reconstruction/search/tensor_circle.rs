// SPDX-License-Identifier: MIT OR Apache-2.0
//! A circle of tensors through the two that fit three views best; the other views determine the place on it.

use super::super::grow::{grow, score};
use super::triples::common_bearings;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::kernels::CalibratedTensor;
use crate::problem::{Map, Problem};
use crate::uncertainty::Watch;
use alloc::vec::Vec;

/// Samples of a half circle.
#[derive(Clone, Copy, Debug)]
pub struct Circle {
    /// Number of samples.
    pub places: usize,
    /// Half of them are within the angle whose tangent this is from the best tensor; 1 spreads them evenly.
    pub width: f64,
}

impl Circle {
    /// For four landmarks, which all tensors of the circle fit equally well.
    pub const WHOLE: Self = Self {
        places: 180,
        width: 1.0,
    };
    /// For more landmarks: noise moves the best tensor mainly along the circle.
    pub const AROUND_BEST: Self = Self {
        places: 40,
        width: 0.5,
    };
}

/// A map and its score.
pub type ScoredMap = (f64, Map);

/// Maps from places on the circle of tensors `cos f Ta + sin f Tb` of a triple of views, (T17): the local
/// minima of the score along the circle.
///
/// Ta and Tb are the singular vectors of the calibrated system with the smallest singular values: its
/// null space for four landmarks, its weakest directions for more. The negative of a tensor is the same
/// tensor, so a half circle is enough. For each f the motion has a closed form; the map grown from it to
/// the other views gives the score.
///
/// # Errors
/// Those of `watch`.
pub fn along_circle(
    problem: &Problem,
    views: [usize; 3],
    circle: Circle,
    watch: Watch<'_>,
) -> Result<Vec<ScoredMap>, Error> {
    let (triples, _) = common_bearings(problem, views);
    let basis = CalibratedTensor::null_pair(&triples);
    local_minima(problem, circle, watch, |cos, sin| {
        let motions = CalibratedTensor::combine(&basis, cos, sin).motions(&triples);
        [0, 1].map(|branch| {
            let mut map = Map::empty(problem.views(), problem.landmarks());
            if let Ok(motions) = &motions {
                for (&view, pose) in views.iter().zip(motions[branch].poses) {
                    map.poses[view] = Some(pose);
                }
                grow(problem, &mut map);
            }
            map
        })
    })
}

/// The local minima of the score along a half circle of tensors, each of which gives two maps.
///
/// # Errors
/// Those of `watch`, which is called before each tensor.
pub fn local_minima(
    problem: &Problem,
    circle: Circle,
    watch: Watch<'_>,
    mut maps: impl FnMut(f64, f64) -> [Map; 2],
) -> Result<Vec<ScoredMap>, Error> {
    // One tensor after the other along the circle, both branches of each.
    let mut scored: [Vec<ScoredMap>; 2] = [Vec::new(), Vec::new()];
    for place in 0..circle.places {
        watch()?;
        let part = (place as f64 + 0.5) / circle.places as f64 - 0.5;
        let (sin, cos) = (core::f64::consts::PI * part).sin_cos();
        for (scored, map) in scored.iter_mut().zip(maps(cos, sin * circle.width)) {
            scored.push((score(problem, &map), map));
        }
    }
    let mut found = Vec::new();
    for scored in scored {
        let count = scored.len();
        let value = |place: usize| scored[place % count].0;
        let minima: Vec<bool> = (0..count)
            .map(|place| {
                value(place) <= value(place + count - 1) && value(place) <= value(place + 1)
            })
            .collect();
        let kept = scored
            .into_iter()
            .zip(minima)
            .filter(|(_, minimum)| *minimum);
        found.extend(kept.map(|(scored, _)| scored));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    /// The samples go around half a circle once, evenly, or half of them within the angle that is asked for.
    #[test]
    fn samples_are_spread_over_half_a_circle() {
        let problem = Problem::dense(1, 1, &[0.1], 1.0).unwrap();
        for circle in [Circle::WHOLE, Circle::AROUND_BEST] {
            let mut angles = vec![];
            let found = local_minima(&problem, circle, &mut || Ok(()), |cos, sin| {
                angles.push(sin.atan2(cos));
                [Map::empty(1, 1), Map::empty(1, 1)]
            })
            .unwrap();
            // All scores are equal, so that every sample of both branches is a minimum.
            assert_eq!(found.len(), 2 * circle.places);
            assert_eq!(angles.len(), circle.places);
            assert!(angles.is_sorted() && angles.iter().all(|angle| angle.abs() < 1.58));
            let within = |bound: f64| angles.iter().filter(|angle| angle.abs() < bound).count();
            assert_eq!(within(circle.width.atan()), circle.places / 2);
            if circle.width == 1.0 {
                let step = core::f64::consts::PI / circle.places as f64;
                let even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() < 1e-12;
                assert!(angles.windows(2).all(even));
            }
        }
    }

    /// A minimum is lower than its neighbours along the circle, which closes: the last sample is next to the first.
    #[test]
    fn minima_are_found_across_the_end_of_the_circle() {
        // One view at the origin sees one landmark: the score grows with the error of its bearing.
        let problem = Problem::dense(1, 1, &[0.0], 1.0).unwrap();
        let circle = Circle {
            places: 12,
            width: 1.0,
        };
        for least in 0..12 {
            let mut place = 0;
            let found = local_minima(&problem, circle, &mut || Ok(()), |_, _| {
                let apart = (place + 12_usize - least) % 12;
                let error = 0.1 * apart.min(12 - apart) as f64;
                place += 1;
                let mut map = Map::empty(1, 1);
                map.poses[0] = Some(crate::geometry::pose(0.0, 0.0, error));
                map.landmarks[0] = Some(nalgebra::Point2::new(1.0, 0.0));
                [map, Map::empty(1, 1)]
            })
            .unwrap();
            let minima = found.iter().filter(|(score, _)| *score < 1e-12);
            assert_eq!(minima.count(), 1, "{least}");
            // All of the second branch, whose scores are equal, but of the first only one.
            assert_eq!(found.len(), 13, "{least}");
        }
    }
}
