// SPDX-License-Identifier: MIT OR Apache-2.0
//! Along the odometry with bearings some of which are wrong.
//!
//! A view has two or three bearings at times, too few to place it without odometry, and one wrong ray in a
//! hundred is enough to spoil a triangulation by least squares. So each view is placed by its motion and
//! the bearings together, each bearing counting the less the worse it fits, and a landmark is where most of
//! its rays meet.

use super::super::expand::score;
use super::super::options::{Progress, tell};
use super::expand::{AGREEING_OF_LANDMARK, GROWING, extend};
use super::place::{place_landmark, sets};
use crate::error::Error;
use crate::estimation::{Loss, Map, Problem, RefineOptions, Tie, refine_map};
use crate::geometry::{Pose, align, pose};
use crate::kernels::triangulate;
use crate::scalar::Real;
use alloc::collections::VecDeque;

use alloc::vec::Vec;
use nalgebra::{Matrix3, Point2, Vector3};
use rand_chacha::ChaCha8Rng;

/// Views after which a piece is refined for the first time, and the part by which it grows until the next.
const FIRST_VIEWS: usize = 6;
const PART: usize = 4;

/// Iterations that a growing piece gets each time: it only has to stay near.
const ITERATIONS: usize = 8;

/// Steps of Gauss-Newton for one view.
const STEPS: usize = 10;

/// Parallax below which a landmark of a growing piece has to wait: rays that spread by less than six
/// degrees tell its range badly.
const MIN_PARALLAX: f64 = 0.05;

/// Landmarks that lay one piece over another, and most pairs of them that are tried.
const SHARED: usize = 2;
const PAIRS: usize = 128;

/// A motion from a view, as the pose of its other end in its frame.
struct Link<T: Real> {
    end: usize,
    delta: Pose<T>,
    /// The root of the information, in the frame of either end: between them it hardly turns.
    root: Matrix3<T>,
}

/// Maps along the odometry, the one with most views first; those after it share too few landmarks with it.
/// None where there is no odometry.
///
/// Priors are not looked at: the maps are in frames of their own.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so, [`Error::OutOfMemory`] of the refinement.
pub fn follow<T: Real>(
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map<T>>, Error> {
    let problem = &problem.clone().with_motions_only();
    let options = &RefineOptions {
        loss: Loss::Cauchy(T::lit(Loss::<T>::CAUCHY)),
        max_iterations: options.max_iterations.min(ITERATIONS),
        ..*options
    };
    let links = links(problem);
    // From the view that sees most; of equals the first.
    let mut order: Vec<usize> = (0..problem.views()).collect();
    order.sort_by_key(|&view| core::cmp::Reverse(problem.of_view(view).len()));
    let mut pieces: Vec<Map<T>> = Vec::new();
    for root in order {
        let reached = |map: &Map<T>| map.poses[root].is_some();
        if !links[root].is_empty() && !pieces.iter().any(reached) {
            pieces.push(piece(problem, &links, root, options, random, progress)?);
        }
    }
    let size = |map: &Map<T>| map.poses.iter().flatten().count();
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

/// The motions of each view.
fn links<T: Real>(problem: &Problem<T>) -> Vec<Vec<Link<T>>> {
    let mut links: Vec<Vec<Link<T>>> = (0..problem.views()).map(|_| Vec::new()).collect();
    for tie in problem.ties() {
        if let Tie::Motion {
            start,
            end,
            delta,
            root,
        } = tie
        {
            let root = Matrix3::from_fn(|i, j| root[i][j]);
            for (from, end, delta) in [(*start, *end, *delta), (*end, *start, delta.inverse())] {
                links[from].push(Link { end, delta, root });
            }
        }
    }
    links
}

/// The map of all views that motions tie to one.
fn piece<T: Real>(
    problem: &Problem<T>,
    links: &[Vec<Link<T>>],
    root: usize,
    options: &RefineOptions<T>,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Map<T>, Error> {
    let mut map = Map::empty(problem.views(), problem.landmarks());
    map.poses[root] = Some(Pose::identity());
    let mut waiting = VecDeque::from([(root, Pose::identity())]);
    let (mut count, mut next) = (1, FIRST_VIEWS);
    while let Some((view, first)) = waiting.pop_front() {
        // A refinement may have moved it since.
        let from = map.poses[view].unwrap_or(first);
        for link in &links[view] {
            if map.poses[link.end].is_some() {
                continue;
            }
            let found = placed(problem, &map, link, from * link.delta);
            map.poses[link.end] = Some(found);
            waiting.push_back((link.end, found));
            for s in problem.of_view(link.end) {
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

/// The pose at the end of a motion: the least of its square and of Cauchy's loss of the bearings of what
/// the map has.
fn placed<T: Real>(
    problem: &Problem<T>,
    map: &Map<T>,
    link: &Link<T>,
    predicted: Pose<T>,
) -> Pose<T> {
    let seen: Vec<_> = problem
        .of_view(link.end)
        .iter()
        .filter_map(|s| map.landmarks[s.landmark].map(|point| (point, *s)))
        .collect();
    let loss = Loss::Cauchy(T::lit(Loss::<T>::CAUCHY));
    let linearize = |at: &Pose<T>| {
        let off = predicted.inv_mul(at);
        let off = Vector3::new(off.translation.x, off.translation.y, off.rotation.angle());
        let error = link.root * off;
        let mut cost = error.norm_squared();
        let mut gradient = link.root.tr_mul(&error);
        let mut normal = link.root.tr_mul(&link.root);
        for (point, s) in &seen {
            let local = at.inverse_transform_point(point);
            let square = local.coords.norm_squared();
            if !(square > T::zero()) {
                continue;
            }
            let residual = problem.residual(at, point, s) * s.weight;
            let (value, slope) = loss.evaluate(residual * residual);
            let row = Vector3::new(local.y / square, -local.x / square, -T::one()) * s.weight;
            cost += value;
            gradient += row * (residual * slope);
            normal += row * row.transpose() * slope;
        }
        (cost, gradient, normal)
    };
    let mut best = predicted;
    let (mut cost, mut gradient, mut normal) = linearize(&best);
    for _ in 0..STEPS {
        let Some(factor) = normal.cholesky() else {
            break;
        };
        let step = factor.solve(&gradient);
        let trial = best * pose(-step.x, -step.y, -step.z);
        let then = linearize(&trial);
        if !(then.0 < cost) {
            break;
        }
        best = trial;
        (cost, gradient, normal) = then;
    }
    best
}

/// Puts a landmark where most of its rays meet, if enough do and not too narrowly.
fn place<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    landmark: usize,
    random: &mut ChaCha8Rng,
) {
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
        && triangulate(agreeing).is_ok_and(|found| found.parallax > T::lit(MIN_PARALLAX));
    map.landmarks[landmark] = held.then_some(found.place);
}

/// Places all landmarks anew and refines a little; what cannot be refined stays as it is.
fn settle<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    options: &RefineOptions<T>,
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
        Err(error @ (Error::Interrupted | Error::OutOfMemory)) => Err(error),
        Err(_) => Ok(()),
    }
}

/// The piece that shares most landmarks with a map, of those that share enough.
fn closest<T: Real>(map: &Map<T>, pieces: &[Map<T>]) -> Option<usize> {
    let shared = |piece: &Map<T>| shared(map, piece).len();
    let pieces = pieces.iter().map(shared).enumerate();
    let best = pieces.max_by_key(|&(k, shared)| (shared, core::cmp::Reverse(k)));
    best.filter(|&(_, shared)| shared >= SHARED)
        .map(|(k, _)| k)
}

/// The places of landmarks that two maps share: in the second, and in the first.
fn shared<T: Real>(first: &Map<T>, second: &Map<T>) -> Vec<(Point2<T>, Point2<T>)> {
    let pairs = second.landmarks.iter().zip(&first.landmarks);
    pairs.filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect()
}

/// Two maps as one: the second laid over two of the landmarks that they share, those with which
/// most bearings agree, or over all of them if that is better.
fn joined<T: Real>(
    problem: &Problem<T>,
    first: &Map<T>,
    second: &Map<T>,
    random: &mut ChaCha8Rng,
) -> Option<Map<T>> {
    let shared = shared(first, second);
    let mut best: Option<(T, Map<T>)> = None;
    let mut offer = |pairs: &[(Point2<T>, Point2<T>)]| {
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
