// SPDX-License-Identifier: MIT OR Apache-2.0
//! The bearings that a map explains once the identities of their landmarks are assigned anew.
//!
//! The inliers of a wrong map are about as many as those of the true one where identities are exchanged. But the bearings
//! of exchanged identities are good bearings of other landmarks: only the true map explains them.

use super::super::options::SolveOptions;
use super::super::stages::StageOptions;
use super::assignment::{assign, assign_view};
use super::consensus::{
    Consensus, OUTLIER, cost, descend, fixed_point, inliers, square_within, to_consensus,
};
use super::exchange::promising;
use super::options::IdentityOptions;
use super::place::{Placed, place_landmark, place_view};
use crate::error::Error;
use crate::geometry::Pose;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::Point2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A map and the labels of the bearings that go with it.
pub struct Identified {
    pub map: Map,
    /// The landmark of each sighting, in the order of the problem.
    pub labels: Vec<usize>,
    /// Number of bearings explained to three sigma under these labels.
    pub explained: usize,
    /// Half the sum of squares under these labels, truncated at three sigma.
    cost: f64,
}

/// Assigns identities and refines the map in turn, once views and landmarks are where they explain most.
///
/// # Errors
/// Those of the refinement.
pub fn identify(problem: &Problem, map: &Map, options: &SolveOptions) -> Result<Identified, Error> {
    let mut map = map.clone();
    relocate(problem, &mut map, options);
    settle(problem, map, options)
}

/// The same with views and landmarks near where they are.
fn settle(problem: &Problem, mut map: Map, options: &SolveOptions) -> Result<Identified, Error> {
    let identity = &options.stages.identities;
    for _ in 0..identity.rounds {
        let labelled = problem.relabelled(&assign(problem, &map, identity));
        descend(&labelled, &mut map, OUTLIER, identity.iterations, options)?;
    }
    let labels = assign(problem, &map, identity);
    let labelled = problem.relabelled(&labels);
    let explained = inliers(&labelled, &map, OUTLIER);
    Ok(Identified {
        explained: explained.into_iter().filter(|inlier| *inlier).count(),
        cost: cost(&labelled, &map, OUTLIER),
        map,
        labels,
    })
}

/// Changes single bearings from inlier to outlier or back, as [`exchange`](super::exchange::exchange), as long as that
/// lowers the cost once identities are assigned anew. Where one bearing alone determines where a landmark is, the right
/// one and one of another landmark cost the same, but only the latter is explained in any case.
///
/// # Errors
/// Those of the refinement.
pub fn exchange_identified(
    problem: &Problem,
    mut best: Identified,
    options: &SolveOptions,
) -> Result<Identified, Error> {
    let robust = &options.stages.robust;
    for _ in 0..robust.exchange_successes {
        let labelled = problem.relabelled(&best.labels);
        let start = best.map.clone();
        let Some(now) = to_consensus(&labelled, start, f64::INFINITY, options)? else {
            break;
        };
        let mut lower = None;
        for set in promising(&labelled, &now, robust) {
            let mut kept = now.inliers.clone();
            for k in set {
                kept[k] = !kept[k];
            }
            let limit = now.limit(robust);
            if let Some(found) = fixed_point(&labelled, now.map.clone(), kept, limit, options)? {
                let found = settle(problem, found.map, options)?;
                if found.cost + robust.improve_worth < best.cost {
                    lower = Some(found);
                    break;
                }
            }
        }
        match lower {
            Some(found) => best = found,
            None => break,
        }
    }
    Ok(best)
}

/// Moves each view, then each landmark, to the place where it explains most bearings whatever their labels, among those
/// that their own labels suggest: most of them may be wrong.
fn relocate(problem: &Problem, map: &mut Map, options: &SolveOptions) {
    let StageOptions {
        robust, identities, ..
    } = &options.stages;
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let mut labels: Vec<usize> = problem.sightings().iter().map(|s| s.landmark).collect();
    for view in 0..problem.views() {
        let range = problem.range_of_view(view);
        let places = place_view(
            problem,
            map,
            view,
            OUTLIER,
            robust.places,
            robust,
            &mut random,
        );
        let mut most = None;
        for Placed { place, .. } in places {
            let mut assigned: Vec<usize> =
                problem.of_view(view).iter().map(|s| s.landmark).collect();
            let explained = assign_view(problem, map, (view, &place), &mut assigned, identities);
            // Of equals the first, which costs least.
            if most.is_none_or(|most| explained > most) {
                most = Some(explained);
                map.poses[view] = Some(place);
                labels[range.clone()].copy_from_slice(&assigned);
            }
        }
    }
    let square = |k: usize, point: &Point2<f64>, poses: &[Option<Pose<f64>>]| {
        let seen = &problem.sightings()[k];
        poses[seen.view].map_or(f64::INFINITY, |pose| {
            square_within(problem, seen, &pose, point, OUTLIER)
        })
    };
    let within = |square: f64| square <= OUTLIER * OUTLIER;
    // What another landmark explains.
    let taken: Vec<bool> = (0..labels.len())
        .map(|k| map.landmarks[labels[k]].is_some_and(|p| within(square(k, &p, &map.poses))))
        .collect();
    for landmark in 0..problem.landmarks() {
        let places = place_landmark(
            problem,
            map,
            landmark,
            OUTLIER,
            robust.places,
            robust,
            &mut random,
        );
        let explained = |point: &Point2<f64>| {
            let views = (0..problem.views()).filter(|&view| {
                problem.range_of_view(view).any(|k| {
                    (labels[k] == landmark || !taken[k]) && within(square(k, point, &map.poses))
                })
            });
            views.count()
        };
        let mut best = None;
        for Placed { place, .. } in places {
            let explained = explained(&place);
            if best.is_none_or(|(most, _)| explained > most) {
                best = Some((explained, place));
            }
        }
        if let Some((_, place)) = best {
            map.landmarks[landmark] = Some(place);
        }
    }
}

impl Identified {
    /// The part of the problem that another landmark does not explain, under its own labels, and which sightings these
    /// are.
    pub fn own(&self, problem: &Problem) -> (Problem, Vec<bool>) {
        let sightings = problem.sightings().iter().zip(&self.labels);
        let kept: Vec<bool> = sightings
            .map(|(seen, &label)| {
                let ends = (&self.map.poses[seen.view], &self.map.landmarks[label]);
                let explains = |pose, point| {
                    square_within(problem, seen, pose, point, OUTLIER) <= OUTLIER * OUTLIER
                };
                label == seen.landmark
                    || !matches!(ends, (Some(pose), Some(point)) if explains(pose, point))
            })
            .collect();
        (problem.subset(&kept), kept)
    }
}

/// A fixed point of some of the sightings as one of all: the others are outliers.
pub fn of_subset(problem: &Problem, found: Consensus, kept: &[bool]) -> Consensus {
    let mut of_kept = found.inliers.into_iter();
    let inliers = kept
        .iter()
        .map(|kept| *kept && of_kept.next() == Some(true));
    Consensus {
        inliers: inliers.collect(),
        cost: cost(problem, &found.map, OUTLIER),
        map: found.map,
        report: found.report,
    }
}

impl IdentityOptions {
    /// Whether so many explained bearings are telling fewer than others.
    pub(super) fn tells(&self, problem: &Problem, explained: usize, others: usize) -> bool {
        others as f64 - explained as f64 > self.telling * problem.sightings().len() as f64
    }

    /// Whether the assigned identities are believed, and explain much that the inliers of a map do not.
    pub(super) fn are_exchanged(
        &self,
        problem: &Problem,
        map: &Consensus,
        identified: &Identified,
    ) -> bool {
        let all = problem.sightings().len() as f64;
        let explained = identified.explained as f64;
        let own = map.inliers.iter().filter(|inlier| **inlier).count() as f64;
        explained >= self.believed * all && explained - own > self.exchanged * all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, Outliers, simulate};

    /// Exchanged identities are put right from the truth, and what keeps its own makes the map.
    #[test]
    fn exchanged_identities_are_explained_and_left_out() {
        let noise = 0.01;
        let clean = simulate(Layout::Mixed, 12, 15, noise, 2, Arena::default()).unwrap();
        let (scene, wrong) = clean.contaminate(Outliers::Exchanged, 0.4, 2);
        let problem = Problem::dense(12, 15, &scene.bearings, noise).unwrap();
        let options = SolveOptions::default();
        let identified = identify(&problem, &scene.map(), &options).unwrap();
        assert!(identified.explained > 170);
        let own = to_consensus(&problem, scene.map(), f64::INFINITY, &options);
        let own = own.unwrap().unwrap();
        let identities = &options.stages.identities;
        assert!(identities.are_exchanged(&problem, &own, &identified));
        let (left, kept) = identified.own(&problem);
        // In the order of the problem, which is that of the table.
        let taken = kept.iter().zip(&wrong);
        assert!(
            taken
                .clone()
                .filter(|(kept, wrong)| **kept && **wrong)
                .count()
                <= 9
        );
        assert!(taken.filter(|(kept, wrong)| !**kept && !**wrong).count() <= 5);
        let found = to_consensus(&left, scene.map(), f64::INFINITY, &options);
        let found = found.unwrap().unwrap();
        let count = found.inliers.iter().filter(|inlier| **inlier).count();
        let whole = of_subset(&problem, found, &kept);
        assert_eq!(whole.inliers.len(), 180);
        assert_eq!(
            whole.inliers.iter().filter(|inlier| **inlier).count(),
            count
        );
        assert!(
            whole
                .inliers
                .iter()
                .zip(&kept)
                .all(|(inlier, kept)| *kept || !inlier)
        );
        // Of the clean scene nothing is exchanged.
        let problem = Problem::dense(12, 15, &clean.bearings, noise).unwrap();
        let identified = identify(&problem, &clean.map(), &options).unwrap();
        let own = to_consensus(&problem, clean.map(), f64::INFINITY, &options);
        let own = own.unwrap().unwrap();
        assert!(identified.explained > 175);
        assert!(!identities.are_exchanged(&problem, &own, &identified));
        assert!(identities.tells(&problem, 120, 175) && !identities.tells(&problem, 174, 175));
    }
}
