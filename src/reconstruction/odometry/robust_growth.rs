// SPDX-License-Identifier: MIT OR Apache-2.0
//! Along the odometry with bearings some of which are wrong.
//!
//! A view has two or three bearings at times, too few to place it without odometry, and one wrong ray in a
//! hundred is enough to spoil a triangulation by least squares. So each view is placed by its motion and
//! the bearings together, each bearing counting the less the worse it fits, and a landmark is where most of
//! its rays meet.

use super::super::grow::score;
use super::super::options::{Progress, tell};
use super::super::robust::expand::{AGREEING_OF_LANDMARK, GROWING, extend};
use super::super::robust::motions::{Motions, moved};
use super::super::robust::place::{place_landmark, sets};
use crate::adjustment::refine_map;
use crate::error::Error;
use crate::geometry::{Pose, align};
use crate::kernels::triangulate;
use crate::lm::{Loss, RefineOptions};
use crate::problem::{Map, Problem};
use alloc::collections::VecDeque;

use alloc::vec::Vec;
use nalgebra::Point2;
use rand_chacha::ChaCha8Rng;

/// Views after which a piece is refined for the first time, and the part by which it grows until the next.
const FIRST_VIEWS: usize = 6;
const PART: usize = 4;

/// Iterations that a growing piece gets each time: it only has to stay near.
const ITERATIONS: usize = 8;

/// Parallax below which a landmark of a growing piece has to wait: rays that spread by less than six
/// degrees tell its range badly.
const MIN_PARALLAX: f64 = 0.05;

/// Landmarks that lay one piece over another, and most pairs of them that are tried.
const SHARED: usize = 2;
const PAIRS: usize = 128;

/// Maps along the odometry, the one with most views first; those after it share too few landmarks with it.
/// None where there is no odometry.
///
/// Priors are not looked at: the maps are in frames of their own.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so, [`Error::OutOfMemory`] of the refinement.
pub fn follow(
    problem: &Problem,
    options: &RefineOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    let problem = &problem.clone().with_motions_only();
    let options = &RefineOptions {
        loss: Loss::Cauchy(Loss::<f64>::CAUCHY),
        max_iterations: options.max_iterations.min(ITERATIONS),
        ..*options
    };
    let motions = Motions::new(problem);
    // From the view that sees most; of equals the first.
    let mut order: Vec<usize> = (0..problem.views()).collect();
    order.sort_by_key(|&view| core::cmp::Reverse(problem.of_view(view).len()));
    let mut pieces: Vec<Map> = Vec::new();
    for root in order {
        let reached = |map: &Map| map.poses[root].is_some();
        if !motions.of(root).is_empty() && !pieces.iter().any(reached) {
            pieces.push(piece(problem, &motions, root, options, random, progress)?);
        }
    }
    let size = |map: &Map| map.poses.iter().flatten().count();
    pieces.sort_by_key(|map| core::cmp::Reverse(size(map)));
    let mut done = Vec::new();
    while !pieces.is_empty() {
        let mut main = pieces.remove(0);
        while let Some(k) = closest(&main, &pieces) {
            let other = pieces.remove(k);
            main = joined(problem, &main, &other, random).unwrap_or(main);
            settle(problem, &mut main, options, random, progress)?;
        }
        extend(problem, &mut main, options, random)?;
        done.push(main);
    }
    done.sort_by_key(|map| core::cmp::Reverse(size(map)));
    Ok(done)
}

/// The map of all views that motions tie to one.
fn piece(
    problem: &Problem,
    motions: &Motions,
    root: usize,
    options: &RefineOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Map, Error> {
    let mut map = Map::empty(problem.views(), problem.landmarks());
    map.poses[root] = Some(Pose::identity());
    let mut waiting = VecDeque::from([(root, Pose::identity())]);
    let (mut count, mut next) = (1, FIRST_VIEWS);
    while let Some((view, first)) = waiting.pop_front() {
        // A refinement may have moved it since.
        let from = map.poses[view].unwrap_or(first);
        for motion in motions.of(view) {
            if map.poses[motion.end].is_some() {
                continue;
            }
            let found = moved(problem, &map, &from, motion);
            map.poses[motion.end] = Some(found);
            waiting.push_back((motion.end, found));
            for s in problem.of_view(motion.end) {
                if map.landmarks[s.landmark].is_none() {
                    place(problem, &mut map, s.landmark, random);
                }
            }
            count += 1;
            if count >= next {
                next = count + count / PART + 1;
                settle(problem, &mut map, options, random, progress)?;
            }
        }
    }
    settle(problem, &mut map, options, random, progress)?;
    Ok(map)
}

/// Puts a landmark where most of its rays meet, if enough do and not too narrowly.
fn place(problem: &Problem, map: &mut Map, landmark: usize, random: &mut ChaCha8Rng) {
    let found = place_landmark(problem, map, landmark, GROWING, 1, random);
    let Some(found) = found.first() else {
        return;
    };
    let rays = problem.of_landmark(landmark).iter().filter_map(|&k| {
        let s = &problem.sightings()[k];
        map.poses[s.view].map(|pose| (pose, s.bearing))
    });
    let agreeing = rays
        .zip(&found.agreeing)
        .filter(|(_, agrees)| **agrees)
        .map(|(ray, _)| ray);
    let held = found.count() >= AGREEING_OF_LANDMARK
        && triangulate(agreeing).is_ok_and(|found| found.parallax > MIN_PARALLAX);
    map.landmarks[landmark] = held.then_some(found.place);
}

/// Places all landmarks anew and refines a little; what cannot be refined stays as it is.
fn settle(
    problem: &Problem,
    map: &mut Map,
    options: &RefineOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<(), Error> {
    for landmark in 0..problem.landmarks() {
        place(problem, map, landmark, random);
    }
    let count = map.poses.iter().flatten().count();
    let mut trial = map.clone();
    let mut watch = |_, _| tell(progress, "odometry", count, problem.views());
    match refine_map(problem, &mut trial, options, Some(&mut watch)) {
        Ok(_) => {
            // What was pruned may be reached later.
            for (place, refined) in map.poses.iter_mut().zip(trial.poses) {
                *place = refined.or(*place);
            }
            for (place, refined) in map.landmarks.iter_mut().zip(trial.landmarks) {
                *place = refined.or(*place);
            }
            Ok(())
        }
        Err(error) if error.stops_all() => Err(error),
        Err(_) => Ok(()),
    }
}

/// The piece that shares most landmarks with a map, of those that share enough.
fn closest(map: &Map, pieces: &[Map]) -> Option<usize> {
    let shared = |piece: &Map| shared(map, piece).len();
    let pieces = pieces.iter().map(shared).enumerate();
    let best = pieces.max_by_key(|&(k, shared)| (shared, core::cmp::Reverse(k)));
    best.filter(|&(_, shared)| shared >= SHARED).map(|(k, _)| k)
}

/// The places of landmarks that two maps share: in the second, and in the first.
fn shared(first: &Map, second: &Map) -> Vec<(Point2<f64>, Point2<f64>)> {
    let pairs = second.landmarks.iter().zip(&first.landmarks);
    pairs.filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect()
}

/// Two maps as one: the second laid over two of the landmarks that they share, those with which
/// most bearings agree, or over all of them if that is better.
fn joined(problem: &Problem, first: &Map, second: &Map, random: &mut ChaCha8Rng) -> Option<Map> {
    let shared = shared(first, second);
    let mut best: Option<(f64, Map)> = None;
    let mut offer = |pairs: &[(Point2<f64>, Point2<f64>)]| {
        let (source, target): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
        let Ok(similarity) = align(&source, &target) else {
            return;
        };
        let moved = second.transformed(&similarity);
        let mut map = first.clone();
        for (place, pose) in map.poses.iter_mut().zip(moved.poses) {
            *place = place.or(pose);
        }
        for (place, point) in map.landmarks.iter_mut().zip(moved.landmarks) {
            *place = place.or(point);
        }
        let score = score(problem, &map);
        if best.as_ref().is_none_or(|(least, _)| score < *least) {
            best = Some((score, map));
        }
    };
    offer(&shared);
    sets(shared.len(), PAIRS, random, |set: [usize; SHARED]| {
        offer(&set.map(|k| shared[k]));
    });
    best.map(|(_, map)| map)
}
