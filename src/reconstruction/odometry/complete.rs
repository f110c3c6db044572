// SPDX-License-Identifier: MIT OR Apache-2.0
//! Completion of a map in the frame of the priors by all that is known of what it lacks.

use super::super::incremental::complete::place_all;
use super::super::incremental::options::IncrementalOptions;
use super::super::robust::motions::Motions;
use super::choices::Choices;
use super::known::Known;
use crate::problem::{Map, Problem};

/// Adds the views and landmarks that bearings, odometry and priors together place, however badly they fit.
///
/// Views that odometry or priors tell of come first, the one that most is known of next: three bearings alone may put a
/// view far from where a motion does, and landmarks that it sees with it.
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
    let best = &mut Choices::best();
    loop {
        while let Some((view, pose)) = known.locate_next(problem, map, motions, true, best) {
            map.poses[view] = Some(pose);
        }
        let before = map.determined().count();
        place_all(problem, options, map);
        if map.determined().count() == before {
            break;
        }
    }
}

/// What completes the maps of one problem.
pub struct Completion {
    known: Known,
    motions: Motions,
}

impl Completion {
    pub fn of(problem: &Problem) -> Self {
        Self {
            known: Known::of(problem),
            motions: Motions::new(problem),
        }
    }

    /// As [`complete`].
    pub fn complete(&self, problem: &Problem, options: &IncrementalOptions, map: &mut Map) {
        complete(problem, options, &self.known, &self.motions, map);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Noise, Odometry};
    use crate::simulate::{Arena, Layout, simulate};
    use alloc::vec::Vec;

    /// Three landmarks that are a little off put a view where they see it; motions put it where it is.
    #[test]
    fn motions_come_before_three_landmarks() {
        let scene = simulate(Layout::Enclosed, 6, 9, 0.0, 8, Arena::default()).unwrap();
        let all = Problem::dense(6, 9, &scene.bearings, 0.05).unwrap();
        let odometry = (1..6).map(|end| Odometry {
            start: end - 1,
            end,
            delta: scene.poses[end - 1].inv_mul(&scene.poses[end]),
            noise: Noise::Sigmas([0.001; 3]),
        });
        let problem = all.with_odometry(&odometry.collect::<Vec<_>>()).unwrap();
        let mut map = scene.map();
        // The last view alone is left, and three landmarks.
        map.poses[..5].fill(None);
        map.landmarks[3..].fill(None);
        map.landmarks[0].as_mut().unwrap().x += 0.3;
        let (known, motions) = (Known::of(&problem), Motions::new(&problem));
        complete(
            &problem,
            &IncrementalOptions::default(),
            &known,
            &motions,
            &mut map,
        );
        for (pose, truth) in map.poses.iter().zip(&scene.poses) {
            let error = truth.inv_mul(&pose.unwrap());
            assert!(error.translation.vector.norm() < 0.05, "{error}");
        }
        assert!(map.landmarks.iter().all(Option::is_some));
    }
}
