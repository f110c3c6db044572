// SPDX-License-Identifier: MIT OR Apache-2.0
//! Views and landmarks in other places.

use super::super::options::{Progress, tell};
use super::consensus::{ITERATIONS, Settled, descend, fixed_point, settle};
use super::motions::Motions;
use super::objective::{OUTLIER, cost, inliers};
use super::place::{Placed, place_landmark, place_view};
use crate::error::Error;
use crate::geometry::Pose;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::Point2;
use rand_chacha::ChaCha8Rng;

/// Bounds within which views and landmarks are placed anew, how many places of each are looked at, by
/// how many outliers they may be worse as long as nothing else moves, and how many are tried.
const BOUNDS: [f64; 2] = [3.0, 9.0];
const PLACES: usize = 4;
const WORSE: f64 = 2.0;
const TRIED: usize = 24;

/// Sightings that must change sides where odometry ties the views.
const SEVERAL: usize = 3;

/// Most rounds: each lowers the cost, so they end by themselves.
const ROUNDS: usize = 10;

/// Moves all views and landmarks to where most agrees with them, as long as that lowers the cost.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn replace(
    problem: &Problem,
    mut best: Settled,
    options: &RefineOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Settled, Error> {
    let motions = Motions::new(problem);
    // Bearings alone know nothing of the motions of a view.
    let is_better = |map: &Map, view: usize, place: &Pose<f64>| {
        let cost_at = |at: &Pose<f64>| motions.cost(problem, map, view, at);
        let present = map.poses[view].filter(|_| !motions.of(view).is_empty());
        present.is_none_or(|present| cost_at(place) < cost_at(&present))
    };
    for round in 0..ROUNDS {
        if !tell(progress, "replace", round, ROUNDS) {
            return Err(Error::Interrupted);
        }
        let mut map = best.map.clone();
        for view in 0..problem.views() {
            if let Some(placed) = place_view(problem, &map, view, OUTLIER, 1, random).first()
                && is_better(&map, view, &placed.place)
            {
                map.poses[view] = Some(placed.place);
            }
        }
        for landmark in 0..problem.landmarks() {
            if let Some(placed) =
                place_landmark(problem, &map, landmark, OUTLIER, 1, random).first()
            {
                map.landmarks[landmark] = Some(placed.place);
            }
        }
        let kept = inliers(problem, &map, OUTLIER);
        if kept == best.inliers {
            break;
        }
        match fixed_point(problem, map, kept, options)? {
            Some(found) if found.is_below(&best) => best = found,
            _ => break,
        }
    }
    Ok(best)
}

/// A place for a view or a landmark.
enum Move {
    View(usize, Pose<f64>),
    Landmark(usize, Point2<f64>),
}

/// Puts single views and landmarks in other places and follows the map from there, as long as that
/// lowers the cost.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn relocate(
    problem: &Problem,
    mut best: Settled,
    options: &RefineOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Settled, Error> {
    // Where each try moves hundreds of views, only one that promises something is followed to its end.
    let tied = !problem.ties().is_empty();
    for _ in 0..ROUNDS {
        let mut lower = None;
        let limit = best.cost + (WORSE * OUTLIER * OUTLIER / 2.0);
        for (tried, (bound, place)) in moves(problem, &best.map, random).into_iter().enumerate() {
            if !tell(progress, "relocate", tried, TRIED) {
                return Err(Error::Interrupted);
            }
            let mut map = best.map.clone();
            match place {
                Move::View(view, pose) => map.poses[view] = Some(pose),
                Move::Landmark(landmark, point) => map.landmarks[landmark] = Some(point),
            }
            descend(problem, &mut map, bound, ITERATIONS, options)?;
            if tied && cost(problem, &map, OUTLIER) > limit {
                continue;
            }
            lower = settle(problem, map, options)?.filter(|found| found.is_below(&best));
            if lower.is_some() {
                break;
            }
        }
        match lower {
            Some(found) => best = found,
            None => break,
        }
    }
    Ok(best)
}

/// Other places of single views and landmarks, and the bound within which sightings agree with them;
/// the most promising first.
fn moves(problem: &Problem, map: &Map, random: &mut ChaCha8Rng) -> Vec<(f64, Move)> {
    let mut found: Vec<(f64, f64, Move)> = Vec::new();
    let motions = Motions::new(problem);
    // One sighting more or less is no other place where each try moves hundreds of views.
    let least = if problem.ties().is_empty() {
        1
    } else {
        SEVERAL
    };
    for bound in BOUNDS {
        // Views with motions find their places along these.
        for view in (0..problem.views()).filter(|&view| motions.of(view).is_empty()) {
            let places = place_view(problem, map, view, bound, PLACES, random);
            let places = others(places, bound, least);
            found.extend(places.map(|(worse, pose)| (worse, bound, Move::View(view, pose))));
        }
        for landmark in 0..problem.landmarks() {
            let places = place_landmark(problem, map, landmark, bound, PLACES, random);
            found.extend(
                others(places, bound, least)
                    .map(|(worse, point)| (worse, bound, Move::Landmark(landmark, point))),
            );
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(TRIED);
    found
        .into_iter()
        .map(|(_, bound, place)| (bound, place))
        .collect()
}

/// Places other than the present one, with which at least so many sightings agree that do not with that, or the
/// reverse, and by how many outliers they are worse, if not by too many.
fn others<P>(places: Vec<Placed<P>>, bound: f64, least: usize) -> impl Iterator<Item = (f64, P)> {
    let cost = move |placed: &Placed<P>| placed.cost / (bound * bound);
    // A present place that is not among them is worse than all.
    let present = places.iter().find(|placed| placed.present);
    let now = present.or(places.last()).map_or(0.0, cost);
    let before = present.map(|placed| placed.agreeing.clone());
    let changes = move |placed: &Placed<P>| {
        let before = before.iter().flatten();
        let changed = before.zip(&placed.agreeing).filter(|(a, b)| a != b);
        changed.count()
    };
    let is_new = present.is_none();
    places
        .into_iter()
        .filter(move |placed| !placed.present && (is_new || changes(placed) >= least))
        .map(move |placed| (cost(&placed) - now, placed.place))
        .filter(|(change, _)| *change < WORSE)
}
