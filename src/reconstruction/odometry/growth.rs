// SPDX-License-Identifier: MIT OR Apache-2.0
//! First maps from what is known besides bearings: poses, landmarks, odometry.
//!
//! Views that odometry ties together make a piece. A piece grows view by view along its odometry, landmarks
//! are triangulated, and it is refined each time it has grown by half: so it never drifts far. Pieces that
//! share landmarks are then laid over each other, whatever frame each had.

use super::super::grow::{grow, resect_view};
use super::super::options::{Progress, tell};
use crate::adjustment::refine_map;
use crate::error::Error;
use crate::geometry::{Pose, align};
use crate::kernels::triangulate;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem, Tie};
use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;

/// Iterations that a growing piece gets each time: it only has to stay near.
const ITERATIONS: usize = 8;

/// Relative fall of its cost below which it is near enough.
const NEAR_ENOUGH: f64 = 1e-2;

/// Views after which a piece is refined for the first time.
const FIRST_VIEWS: usize = 6;

/// The part by which it grows until the next time, and how many views that is at least and at most: a long way
/// by odometry alone leads out of the reach of the refinement.
const PART: usize = 20;
const STRIDE: (usize, usize) = (10, 100);

/// Fewest landmarks that lay one piece over another.
const MIN_SHARED: usize = 2;

/// Maps from odometry and priors, the one with most views first; those after it have no tie to it.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so.
pub fn anchored(
    problem: &Problem,
    options: &RefineOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    let chains = Chains::new(problem);
    let mut known = Map::empty(problem.views(), problem.landmarks());
    for tie in problem.ties() {
        match tie {
            Tie::Landmark {
                landmark, position, ..
            } => known.landmarks[*landmark] = Some(*position),
            Tie::Pose { view, pose, root } if (0..3).all(|k| root[k][k] > 0.0) => {
                known.poses[*view] = Some(*pose);
            }
            _ => {}
        }
    }
    let mut pieces = Vec::new();
    let fixed =
        known.landmarks.iter().any(Option::is_some) || known.poses.iter().any(Option::is_some);
    if fixed {
        extend(problem, &chains, &mut known, options, progress)?;
        pieces.push(known);
    }
    let mut order: Vec<usize> = (0..problem.views()).collect();
    // From the view that sees most; of equals the first.
    order.sort_by_key(|&view| core::cmp::Reverse(problem.of_view(view).len()));
    for view in order {
        let reached = |map: &Map| map.poses[view].is_some();
        if !chains.links[view].is_empty() && !pieces.iter().any(reached) {
            let mut piece = Map::empty(problem.views(), problem.landmarks());
            piece.poses[view] = Some(Pose::identity());
            extend(problem, &chains, &mut piece, options, progress)?;
            pieces.push(piece);
        }
    }
    merge(problem, pieces, fixed)
}

/// The motions of each view, as the pose of the other end in its frame.
struct Chains {
    links: Vec<Vec<(usize, Pose<f64>)>>,
}

impl Chains {
    fn new(problem: &Problem) -> Self {
        let mut links = vec![Vec::new(); problem.views()];
        for tie in problem.ties() {
            if let Tie::Motion {
                start, end, delta, ..
            } = tie
            {
                links[*start].push((*end, *delta));
                links[*end].push((*start, delta.inverse()));
            }
        }
        Self { links }
    }
}

/// Grows a piece along its odometry, and where it has known landmarks by resection.
fn extend(
    problem: &Problem,
    chains: &Chains,
    map: &mut Map,
    options: &RefineOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<(), Error> {
    let mut waiting: VecDeque<usize> = (0..map.poses.len())
        .filter(|&view| map.poses[view].is_some())
        .collect();
    let mut count = waiting.len();
    let mut next = FIRST_VIEWS.max(count);
    loop {
        while let Some(view) = waiting.pop_front() {
            for (other, motion) in &chains.links[view] {
                if map.poses[*other].is_none()
                    && let Some(pose) = map.poses[view]
                {
                    map.poses[*other] = Some(pose * motion);
                    waiting.push_back(*other);
                    count += 1;
                }
            }
            if count >= next {
                next = count + (count / PART).clamp(STRIDE.0, STRIDE.1);
                settle(problem, map, options, (count, problem.views()), progress)?;
            }
        }
        // The view that sees most of what there is.
        let unseen = (0..map.poses.len()).filter(|&view| map.poses[view].is_none());
        let best = unseen
            .map(|view| (map.connections_of_view(problem, view), view))
            .max_by_key(|&(seen, view)| (seen, core::cmp::Reverse(view)));
        let Some((_, view)) = best else { break };
        let Some((pose, _)) = resect_view(problem, map, view) else {
            break;
        };
        map.poses[view] = Some(pose);
        waiting.push_back(view);
        count += 1;
    }
    settle(problem, map, options, (count, problem.views()), progress)?;
    triangulate_held(problem, map, 0.0);
    Ok(())
}

/// Triangulates anew every landmark that is not known beforehand, as far as its rays hold it.
///
/// A landmark that was first seen over a short distance may have come out anywhere; once its views are
/// refined it need not stay there.
fn triangulate_held(problem: &Problem, map: &mut Map, least: f64) {
    let mut known = vec![false; map.landmarks.len()];
    for tie in problem.ties() {
        if let Tie::Landmark { landmark, .. } = tie {
            known[*landmark] = true;
        }
    }
    for landmark in (0..known.len()).filter(|&landmark| !known[landmark]) {
        let rays = problem.of_landmark(landmark).iter().filter_map(|&k| {
            let s = &problem.sightings()[k];
            map.poses[s.view].map(|pose| (pose, s.bearing))
        });
        let found = triangulate(rays).ok();
        let ahead = |behind: usize| behind == 0 || !problem.is_oriented();
        let found = found.filter(|found| found.parallax > least && ahead(found.behind));
        map.landmarks[landmark] = found.map(|found| found.point);
    }
}

/// Parallax below which a landmark of a growing piece has to wait: rays that spread by less than six
/// degrees tell its range badly.
const MIN_PARALLAX: f64 = 0.05;

/// Refines a piece a little; one that cannot be stays as it is.
fn settle(
    problem: &Problem,
    map: &mut Map,
    options: &RefineOptions,
    (count, all): (usize, usize),
    progress: &mut Option<Progress<'_>>,
) -> Result<(), Error> {
    let options = RefineOptions {
        max_iterations: ITERATIONS.min(options.max_iterations),
        tolerance: NEAR_ENOUGH.max(options.tolerance),
        ..*options
    };
    triangulate_held(problem, map, MIN_PARALLAX);
    let mut trial = map.clone();
    let mut watch = |_, _| tell(progress, "odometry", count, all);
    match refine_map(problem, &mut trial, &options, Some(&mut watch)) {
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
        Err(Error::Interrupted) => Err(Error::Interrupted),
        Err(_) => Ok(()),
    }
}

/// Lays pieces over the first, as far as they share landmarks, and views without odometry onto it.
fn merge(problem: &Problem, mut pieces: Vec<Map>, fixed: bool) -> Result<Vec<Map>, Error> {
    let size = |map: &Map| map.poses.iter().flatten().count();
    let from = usize::from(fixed);
    if pieces.len() > from {
        pieces[from..].sort_by_key(|map| core::cmp::Reverse(size(map)));
    }
    let mut done = Vec::new();
    while !pieces.is_empty() {
        let mut main = pieces.remove(0);
        loop {
            let shared = |map: &Map| {
                let pairs = map.landmarks.iter().zip(&main.landmarks);
                pairs.filter(|(a, b)| a.is_some() && b.is_some()).count()
            };
            let best = pieces.iter().enumerate().map(|(k, map)| (shared(map), k));
            let best = best.max_by_key(|&(shared, k)| (shared, core::cmp::Reverse(k)));
            let Some((_, k)) = best.filter(|(shared, _)| *shared >= MIN_SHARED) else {
                break;
            };
            let piece = pieces.remove(k);
            let pairs = piece.landmarks.iter().zip(&main.landmarks);
            let (source, target): (Vec<_>, Vec<_>) =
                pairs.filter_map(|(a, b)| Some(((*a)?, (*b)?))).unzip();
            if let Ok(similarity) = align(&source, &target) {
                let piece = piece.transformed(&similarity);
                for (place, pose) in main.poses.iter_mut().zip(piece.poses) {
                    *place = place.or(pose);
                }
                for (place, point) in main.landmarks.iter_mut().zip(piece.landmarks) {
                    *place = place.or(point);
                }
            }
        }
        let before = main.landmarks.clone();
        grow(problem, &mut main);
        // What was known or refined is better than a triangulation.
        for (place, known) in main.landmarks.iter_mut().zip(before) {
            *place = known.or(*place);
        }
        done.push(main);
    }
    done.sort_by_key(|map| core::cmp::Reverse(size(map)));
    Ok(done)
}
