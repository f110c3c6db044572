// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reassignment of views and landmarks to other places.

use super::super::options::{Progress, SolveOptions, report_progress};
use super::consensus::{Consensus, OUTLIER, cost, descend, fixed_point, inliers, to_consensus};
use super::motions::Motions;
use super::options::RobustOptions;
use super::place::{Placed, place_landmark, place_view};
use crate::error::Error;
use crate::geometry::Pose;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::Point2;
use rand_chacha::ChaCha8Rng;

/// Moves all views and landmarks to where most sightings agree, as long as that lowers the cost.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn reestimate_each(
    problem: &Problem,
    mut best: Consensus,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let robust = &options.stages.robust;
    for round in 0..robust.reassign_rounds {
        if !report_progress(progress, "replace", round, robust.reassign_rounds) {
            return Err(Error::Interrupted);
        }
        let mut map = best.map.clone();
        place_each(problem, &mut map, robust, random);
        let kept = inliers(problem, &map, OUTLIER);
        if kept == best.inliers {
            break;
        }
        match fixed_point(problem, map, kept, best.limit(robust), options)? {
            Some(found) if found.is_below(&best) => best = found,
            _ => break,
        }
    }
    Ok(best)
}

/// Moves each view, then each landmark, to where most of its sightings agree with the others.
pub fn place_each(
    problem: &Problem,
    map: &mut Map,
    options: &RobustOptions,
    random: &mut ChaCha8Rng,
) {
    let motions = Motions::new(problem);
    for view in 0..problem.views() {
        if let Some(placed) = place_view(problem, map, view, OUTLIER, 1, options, random).first() {
            // `place_view` ignores odometry: compare with the motions of the view included.
            let cost_at = |at: &Pose<f64>| motions.cost(problem, map, view, at);
            let present = map.poses[view].filter(|_| !motions.of(view).is_empty());
            if present.is_none_or(|present| cost_at(&placed.place) < cost_at(&present)) {
                map.poses[view] = Some(placed.place);
            }
        }
    }
    for landmark in 0..problem.landmarks() {
        if let Some(placed) =
            place_landmark(problem, map, landmark, OUTLIER, 1, options, random).first()
        {
            map.landmarks[landmark] = Some(placed.place);
        }
    }
}

/// A place for a view or a landmark.
enum Move {
    View(usize, Pose<f64>),
    Landmark(usize, Point2<f64>),
}

/// Moves single views and landmarks to other places and refines the map from there, as long as that
/// lowers the cost.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn reassign(
    problem: &Problem,
    mut best: Consensus,
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let robust = &options.stages.robust;
    // With odometry each try moves hundreds of views: only those that promise something are refined to the end.
    let tied = !problem.priors().is_empty();
    let mut left = if tied {
        usize::MAX
    } else {
        robust.reassigned_views / problem.views().max(1)
    };
    for _ in 0..robust.reassign_rounds {
        let mut lower = None;
        let limit = best.cost + (robust.worse_outliers * OUTLIER * OUTLIER / 2.0);
        for (tried, (bound, place)) in moves(problem, &best.map, robust, random)
            .into_iter()
            .take(left)
            .enumerate()
        {
            left -= 1;
            if !report_progress(progress, "relocate", tried, robust.reassign_tries) {
                return Err(Error::Interrupted);
            }
            let mut map = best.map.clone();
            match place {
                Move::View(view, pose) => map.poses[view] = Some(pose),
                Move::Landmark(landmark, point) => map.landmarks[landmark] = Some(point),
            }
            descend(
                problem,
                &mut map,
                bound,
                robust.narrowing_iterations,
                options,
            )?;
            if tied && cost(problem, &map, OUTLIER) > limit {
                continue;
            }
            lower = to_consensus(problem, map, best.limit(robust), options)?
                .filter(|found| found.is_below(&best));
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
fn moves(
    problem: &Problem,
    map: &Map,
    options: &RobustOptions,
    random: &mut ChaCha8Rng,
) -> Vec<(f64, Move)> {
    let mut found: Vec<(f64, f64, Move)> = Vec::new();
    let motions = Motions::new(problem);
    // With odometry, where each try moves hundreds of views, one sighting more or less is not worth a try.
    let least = if problem.priors().is_empty() {
        1
    } else {
        options.changes_with_odometry
    };
    for bound in options.reassign_bounds {
        // Views with odometry are placed by its sweeps instead.
        for view in (0..problem.views()).filter(|&view| motions.of(view).is_empty()) {
            let places = place_view(problem, map, view, bound, options.places, options, random);
            let places = others(places, bound, least, options.worse_outliers);
            found.extend(places.map(|(worse, pose)| (worse, bound, Move::View(view, pose))));
        }
        for landmark in 0..problem.landmarks() {
            let places = place_landmark(
                problem,
                map,
                landmark,
                bound,
                options.places,
                options,
                random,
            );
            found.extend(
                others(places, bound, least, options.worse_outliers)
                    .map(|(worse, point)| (worse, bound, Move::Landmark(landmark, point))),
            );
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(options.reassign_tries);
    found
        .into_iter()
        .map(|(_, bound, place)| (bound, place))
        .collect()
}

/// Places other than the present one whose inliers differ from its inliers in at least `least` sightings, and
/// how much worse they are in costs of an outlier, where that is less than `worse`.
fn others<P>(
    places: Vec<Placed<P>>,
    bound: f64,
    least: usize,
    worse: f64,
) -> impl Iterator<Item = (f64, P)> {
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
        .filter(move |(change, _)| *change < worse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};
    use rand::SeedableRng;

    fn placed(cost: f64, agreeing: [bool; 4], present: bool) -> Placed<f64> {
        Placed {
            place: cost,
            cost,
            agreeing: agreeing.to_vec(),
            present,
        }
    }

    /// Other places are tried when they are at most so much worse than the present one and change sightings enough.
    #[test]
    fn places_that_change_enough_and_cost_little_more_are_tried() {
        let tried = |places: Vec<Placed<f64>>, least: usize| -> Vec<(f64, f64)> {
            others(places, 2.0, least, 1.5).collect()
        };
        let all = [true, true, false, false];
        let places = || {
            Vec::from([
                placed(6.0, [false, false, true, true], false),
                placed(8.0, all, true),
                placed(13.0, [true, false, false, false], false),
                placed(14.5, [false, true, true, false], false),
            ])
        };
        // Relative to the present one, in units of the squared bound.
        assert_eq!(tried(places(), 1), [(-0.5, 6.0), (1.25, 13.0)]);
        assert_eq!(tried(places(), 2), [(-0.5, 6.0)]);
        assert_eq!(tried(places(), 5), []);
        // A present place that is not among them is worse than the last.
        let absent = || {
            places()
                .into_iter()
                .filter(|placed| !placed.present)
                .collect()
        };
        assert_eq!(
            tried(absent(), 5),
            [(-2.125, 6.0), (-0.375, 13.0), (0.0, 14.5)]
        );
    }

    /// A view goes to where most of its bearings agree, but along odometry only if its motions allow that.
    #[test]
    fn each_is_placed_by_its_bearings_and_its_motions() {
        let scene = simulate(Layout::Enclosed, 5, 9, 0.0, 2, Arena::default()).unwrap();
        let alone = Problem::dense(5, 9, &scene.bearings, 0.01).unwrap();
        let options = RobustOptions::default();
        let mut start = scene.map();
        let wrong = scene.poses[2] * crate::geometry::pose(0.5, 0.3, 0.2);
        start.poses[2] = Some(wrong);
        let placed = |problem: &Problem| {
            let mut map = start.clone();
            place_each(
                problem,
                &mut map,
                &options,
                &mut ChaCha8Rng::seed_from_u64(1),
            );
            let error = scene.poses[2].inv_mul(&map.poses[2].unwrap());
            error.translation.vector.norm() < 1e-6
        };
        let motion = |pose: &Pose<f64>, sigma: f64| crate::problem::Odometry {
            start: 1,
            end: 2,
            delta: scene.poses[1].inv_mul(pose),
            noise: crate::problem::Noise::Sigmas([sigma; 3]),
        };
        let tied = |motion| alone.clone().with_odometry(&[motion]).unwrap();
        assert!(placed(&alone));
        assert!(placed(&tied(motion(&scene.poses[2], 0.01))));
        // Nine outliers cost less than a motion that is so certain.
        assert!(placed(&tied(motion(&wrong, 1.0))) && !placed(&tied(motion(&wrong, 0.01))));
    }

    /// A landmark in a wrong place is moved to the right one.
    #[test]
    fn a_landmark_is_reassigned_to_where_most_bearings_agree() {
        let scene = simulate(Layout::Enclosed, 6, 9, 0.002, 2, Arena::default()).unwrap();
        let problem = Problem::dense(6, 9, &scene.bearings, 0.01).unwrap();
        let options = SolveOptions::default();
        let truth = to_consensus(&problem, scene.map(), f64::INFINITY, &options)
            .unwrap()
            .unwrap();
        let mut wrong = scene.map();
        wrong.landmarks[3].as_mut().unwrap().x += 1.0;
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let tried = moves(&problem, &wrong, &options.stages.robust, &mut random);
        let back = tried.iter().any(|(_, place)| match place {
            Move::Landmark(3, point) => (point - scene.landmarks[3]).norm() < 0.2,
            _ => false,
        });
        assert!(back);
        let stuck = Consensus {
            inliers: inliers(&problem, &wrong, OUTLIER),
            cost: cost(&problem, &wrong, OUTLIER),
            map: wrong,
            report: truth.report.clone(),
        };
        assert!(stuck.cost > truth.cost * 2.0);
        let found = reassign(&problem, stuck, &options, &mut random, &mut None).unwrap();
        assert!((found.cost / truth.cost - 1.0).abs() < 1e-6);
    }
}
