// SPDX-License-Identifier: MIT OR Apache-2.0
//! A part of a map that is grown from a seed of its own and joined to the rest by ties some of which are wrong.
//!
//! Where few sightings tie two parts of a drive, one wrong one among them bends the bottleneck, and growth view by view
//! does not get past it. What each part sees alone determines it up to a similarity. Minimal random sets of ties give
//! similarities, and all sightings together decide between them.

use super::super::incremental::from_seed;
use super::super::options::{Progress, SolveOptions};
use super::super::stages::StageOptions;
use super::consensus::{cost, with_cauchy};
use super::consensus_places::ConsensusPlaces;
use super::sampling::Seed;
use crate::adjustment::linear_similarity::{LinearSimilarity, UNKNOWNS};
use crate::error::Error;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::{Point2, Similarity2, Vector2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A map with the views that it lacks, grown from a random seed among those that are `allowed`; `None` where there is no
/// seed, or nothing ties what has grown from it to the map.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn grown_apart(
    problem: &Problem,
    rest: &Map,
    seeds: &[Seed],
    allowed: &[bool],
    options: &SolveOptions,
    random: &mut ChaCha8Rng,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Map>, Error> {
    let lacking = allowed.iter().zip(&rest.poses);
    let free: Vec<bool> = lacking.map(|(a, pose)| *a && pose.is_none()).collect();
    let is_apart = |seed: &&Seed| seed.views.iter().all(|&view| free[view]);
    let count = seeds.iter().filter(is_apart).count();
    if count == 0 {
        return Ok(None);
    }
    let drawn = random.random_range(0..count);
    let Some(seed) = seeds.iter().filter(is_apart).nth(drawn) else {
        return Ok(None);
    };
    let soft = with_cauchy(options);
    let draws = random.random();
    let estimator = || ConsensusPlaces::new(problem, &soft, draws);
    let starts = seed.starts(problem);
    let mut least: Option<(f64, Map)> = None;
    for part in from_seed(problem, &soft, starts, estimator, &free, progress)? {
        if let Some((cost, map)) = joined(problem, [rest, &part], &options.stages, random)
            && least.as_ref().is_none_or(|(least, _)| cost < *least)
        {
            least = Some((cost, map));
        }
    }
    Ok(least.map(|(_, map)| map))
}

/// The first map with what only the second has, moved to where the cost is least, and that cost; `None` when too little
/// ties the two.
fn joined(
    problem: &Problem,
    [first, second]: [&Map; 2],
    stages: &StageOptions,
    random: &mut ChaCha8Rng,
) -> Option<(f64, Map)> {
    let [there, back] = [[first, second], [second, first]].map(|maps| ties(problem, maps));
    let mut least: Option<(f64, Map)> = None;
    for k in 0..stages.regrowth.similarities {
        // What the second map sees of the first is linear in the inverse.
        let similarity = if k % 2 == 0 {
            sampled(&there, random)
        } else {
            sampled(&back, random).map(|back| back.inverse())
        };
        let Some(similarity) = similarity else {
            continue;
        };
        let map = first.united(&second.transformed(&similarity));
        let cost = cost(problem, &map, stages.robust.growing_bound);
        if least.as_ref().is_none_or(|(least, _)| cost < *least) {
            least = Some((cost, map));
        }
    }
    least
}

/// Where the landmark of a map should be in another.
enum Tie {
    /// At a position.
    Point(Point2<f64>, Point2<f64>),
    /// On the ray of a view.
    Ray {
        landmark: Point2<f64>,
        view: Point2<f64>,
        normal: Vector2<f64>,
    },
}

/// Where the first map has the landmarks of the second, and the rays on which its views see them.
fn ties(problem: &Problem, [first, second]: [&Map; 2]) -> Vec<Tie> {
    let shared = second.landmarks.iter().zip(&first.landmarks);
    let shared = shared.filter_map(|(from, to)| Some(Tie::Point((*from)?, (*to)?)));
    let rays = problem.sightings().iter().filter_map(|s| {
        let landmark = second.landmarks[s.landmark]?;
        let pose = first.poses[s.view]?;
        let ray = pose.rotation.into_inner() * s.bearing.into_inner();
        Some(Tie::Ray {
            landmark,
            view: Point2::from(pose.translation.vector),
            normal: Vector2::new(-ray.im, ray.re),
        })
    });
    shared.chain(rays).collect()
}

/// The similarity of a minimal random set of ties; `None` when they leave a direction free, as a tie does that is drawn
/// twice.
fn sampled(ties: &[Tie], random: &mut ChaCha8Rng) -> Option<Similarity2<f64>> {
    if ties.is_empty() {
        return None;
    }
    let mut equations = LinearSimilarity::default();
    while equations.count() < UNKNOWNS {
        match &ties[random.random_range(0..ties.len())] {
            Tie::Point(from, to) => equations.add_point(from, to),
            Tie::Ray {
                landmark,
                view,
                normal,
            } => equations.add_line(landmark, normal, view),
        }
    }
    let (similarity, rank) = equations.solve()?;
    (rank == UNKNOWNS).then_some(similarity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};
    use rand::SeedableRng;

    /// Two parts of an exact drive: what the first views of it see in the map, and the other views in a frame of their own.
    fn parts() -> (Problem, Map, [Map; 2]) {
        let arena = Arena {
            sight: 3.0,
            ..Arena::default()
        };
        let scene = simulate(Layout::Trajectory, 24, 40, 0.0, 3, arena).unwrap();
        let problem = Problem::dense(24, 40, &scene.bearings, 0.01).unwrap();
        let truth = scene.map();
        let part = |views: core::ops::Range<usize>| {
            let mut part = Map::empty(24, 40);
            part.poses[views.clone()].clone_from_slice(&truth.poses[views]);
            for landmark in 0..40 {
                if part.rays(&problem, landmark).count() >= 2 {
                    part.landmarks[landmark] = truth.landmarks[landmark];
                }
            }
            part
        };
        let by = Similarity2::new(Vector2::new(5.0, -7.0), 2.0, 0.3);
        let both = [part(0..12), part(12..24).transformed(&by)];
        (problem, truth, both)
    }

    #[test]
    fn ties_are_shared_landmarks_and_rays_across() {
        let (problem, truth, [first, second]) = parts();
        let found = ties(&problem, [&first, &second]);
        let shared = |landmark: &usize| {
            first.landmarks[*landmark].is_some() && second.landmarks[*landmark].is_some()
        };
        let shared = (0..40).filter(shared).count();
        let across = problem.sightings().iter();
        let across = across
            .filter(|s| s.view < 12 && second.landmarks[s.landmark].is_some())
            .count();
        assert!(shared > 2 && across > shared);
        assert_eq!(found.len(), shared + across);
        // In the map of the first, landmarks are where their ties say.
        for tie in found {
            match tie {
                Tie::Point(from, to) => {
                    let k = second
                        .landmarks
                        .iter()
                        .position(|p| *p == Some(from))
                        .unwrap();
                    assert_eq!(truth.landmarks[k], Some(to));
                }
                Tie::Ray {
                    landmark,
                    view,
                    normal,
                } => {
                    let k = second
                        .landmarks
                        .iter()
                        .position(|p| *p == Some(landmark))
                        .unwrap();
                    let off = truth.landmarks[k].unwrap() - view;
                    assert!(off.dot(&normal).abs() < 1e-9 && (normal.norm() - 1.0).abs() < 1e-12);
                }
            }
        }
    }

    /// Any ties that fix a similarity give the true one, and the second part joins the first where it belongs.
    #[test]
    fn exact_parts_are_joined_exactly() {
        let (problem, truth, [first, second]) = parts();
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let both = ties(&problem, [&first, &second]);
        let mut found = 0;
        for _ in 0..50 {
            let Some(similarity) = sampled(&both, &mut random) else {
                continue;
            };
            found += 1;
            for (moved, truth) in second
                .transformed(&similarity)
                .landmarks
                .iter()
                .zip(&truth.landmarks)
            {
                if let (Some(moved), Some(truth)) = (moved, truth) {
                    assert!((moved - truth).norm() < 1e-6);
                }
            }
        }
        assert!(found > 40, "{found}");
        let stages = StageOptions::default();
        let (cost, map) = joined(&problem, [&first, &second], &stages, &mut random).unwrap();
        for (pose, truth) in map.poses.iter().zip(&truth.poses) {
            let error = truth.unwrap().inv_mul(&pose.unwrap());
            assert!(error.translation.vector.norm() + error.rotation.angle().abs() < 1e-6);
        }
        // What neither has placed costs as an outlier, up to the bound of growing maps.
        let bound = stages.robust.growing_bound;
        let unplaced = problem
            .sightings()
            .iter()
            .filter(|s| map.landmarks[s.landmark].is_none());
        let expected = 0.5 * bound * bound * unplaced.count() as f64;
        assert!((cost - expected).abs() < 1e-3, "{cost} {expected}");
        // Nothing ties what shares nothing.
        let nothing = Map::empty(24, 40);
        assert!(joined(&problem, [&first, &nothing], &stages, &mut random).is_none());
        assert!(sampled(&both[..1], &mut random).is_none());
    }
}
