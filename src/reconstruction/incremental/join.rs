// SPDX-License-Identifier: MIT OR Apache-2.0
//! Two maps in one frame: the similarity between them by shared landmarks and by sightings across.
//!
//! A landmark of both maps gives two linear equations of the similarity: it moves to where it is in the first map. A view
//! of the first map that sees a landmark of the second alone gives one: it moves onto the ray. A sighting the other way,
//! of a landmark of the first map from a view of the second, is linear in the inverse; so both directions are tried.

use super::gates::{noise, range_variance};
use super::options::IncrementalOptions;
use crate::adjustment::linear_similarity::{LinearSimilarity, UNKNOWNS};
use crate::geometry::align;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::{Point2, Similarity2, Vector2};

/// The first map extended by what only the second has, once for each way to move that into its frame, the most reliable
/// first; empty when neither landmarks nor sightings tie the two.
///
/// The ties may determine the similarity without redundancy; the check is the cost of the refined whole. Landmarks that
/// a map determines badly serve only where others do not lead to it.
pub fn merged<'a>(
    problem: &'a Problem,
    options: &'a IncrementalOptions,
    first: &'a Map,
    second: &'a Map,
) -> impl Iterator<Item = Map> + 'a {
    [options.max_deviation, f64::INFINITY]
        .into_iter()
        .flat_map(move |deviation| {
            let [to, from] = [first, second].map(|map| Part::new(problem, options, deviation, map));
            similarities(problem, options.joining_landmarks, &to, &from)
        })
        .map(move |similarity| first.united(&second.transformed(&similarity)))
}

/// The similarities that move the second map into the frame of the first: by landmarks alone, and by sightings across
/// in either direction.
fn similarities(
    problem: &Problem,
    joining_landmarks: usize,
    to: &Part<'_>,
    from: &Part<'_>,
) -> Vec<Similarity2<f64>> {
    let shared: Vec<[Point2<f64>; 2]> = (0..problem.landmarks())
        .filter_map(|landmark| Some([to.held[landmark]?, from.held[landmark]?]))
        .collect();
    let swapped: Vec<_> = shared.iter().map(|&[a, b]| [b, a]).collect();
    let aligned = if shared.len() >= joining_landmarks {
        let [targets, sources]: [Vec<_>; 2] =
            [&shared, &swapped].map(|pairs| pairs.iter().map(|pair| pair[0]).collect());
        align(&sources, &targets).ok()
    } else {
        None
    };
    let oriented = problem.is_oriented();
    let there = similarity(&shared, &to.sightings_of(problem, from), oriented);
    let back = similarity(&swapped, &from.sightings_of(problem, to), oriented);
    let back = back.map(|back| back.inverse());
    aligned.into_iter().chain(there).chain(back).collect()
}

/// A map and those of its landmarks of which it determines the range well.
struct Part<'a> {
    map: &'a Map,
    held: Vec<Option<Point2<f64>>>,
}

impl<'a> Part<'a> {
    fn new(problem: &Problem, options: &IncrementalOptions, deviation: f64, map: &'a Map) -> Self {
        let bound = deviation / noise(problem, map, options);
        let is_held = |landmark: usize, point: &Point2<f64>| {
            !(range_variance(problem, map, landmark, point) > bound * bound)
        };
        let landmarks = map.landmarks.iter().enumerate();
        let held =
            landmarks.map(|(landmark, point)| point.filter(|point| is_held(landmark, point)));
        Self {
            map,
            held: held.collect(),
        }
    }

    /// What the views of this map see of the landmarks that only another map has: the position of the view, the
    /// direction of the ray, and the landmark in the frame of the other.
    fn sightings_of(&self, problem: &Problem, other: &Self) -> Vec<Across> {
        let sightings = problem.sightings().iter();
        let across = sightings.filter_map(|s| {
            let landmark = other.held[s.landmark]?;
            let pose = self.map.poses[s.view]?;
            let ray = pose.rotation.into_inner() * s.bearing.into_inner();
            let is_new = self.map.landmarks[s.landmark].is_none();
            is_new.then_some(Across {
                landmark,
                view: Point2::from(pose.translation.vector),
                ray: Vector2::new(ray.re, ray.im),
            })
        });
        across.collect()
    }
}

/// A sighting from a view of one map of a landmark of another.
struct Across {
    landmark: Point2<f64>,
    view: Point2<f64>,
    ray: Vector2<f64>,
}

/// The similarity that moves what the second of each pair is to where the first is, and landmarks seen across onto
/// their rays; `None` when there are too few equations, when they leave a direction free, or when a landmark comes to be
/// behind the view that sees it, unless bearings are known modulo pi.
fn similarity(
    shared: &[[Point2<f64>; 2]],
    across: &[Across],
    oriented: bool,
) -> Option<Similarity2<f64>> {
    let mut equations = LinearSimilarity::default();
    for [to, from] in shared {
        equations.add_point(from, to);
    }
    for one in across {
        let normal = Vector2::new(-one.ray.y, one.ray.x);
        equations.add_line(&one.landmark, &normal, &one.view);
    }
    if across.is_empty() || equations.count() < UNKNOWNS {
        return None;
    }
    let (similarity, rank) = equations.solve()?;
    if rank < UNKNOWNS {
        return None;
    }
    let is_ahead = |one: &Across| {
        let offset = similarity.transform_point(&one.landmark) - one.view;
        offset.dot(&one.ray) > 0.0
    };
    (!oriented || across.iter().all(is_ahead)).then_some(similarity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// Two views with what they see, and two others with theirs in a frame of their own, of an exact scene.
    fn parts(landmarks: [&[usize]; 2]) -> (Problem, Map, [Map; 2]) {
        let scene = simulate(Layout::Enclosed, 4, 9, 0.0, 2, Arena::default()).unwrap();
        let problem = Problem::dense(4, 9, &scene.bearings, 0.01).unwrap();
        let truth = scene.map();
        let part = |views: [usize; 2], landmarks: &[usize]| {
            let mut part = Map::empty(4, 9);
            for view in views {
                part.poses[view] = truth.poses[view];
            }
            for &landmark in landmarks {
                part.landmarks[landmark] = truth.landmarks[landmark];
            }
            part
        };
        let by = Similarity2::new(Vector2::new(5.0, -7.0), 2.0, 0.3);
        let first = part([0, 1], landmarks[0]);
        let second = part([2, 3], landmarks[1]).transformed(&by);
        (problem, truth, [first, second])
    }

    /// Shared landmarks, what each sees of the other's, or both together bring the second map to where it belongs.
    #[test]
    fn exact_maps_are_merged_exactly() {
        let options = IncrementalOptions::default();
        for (landmarks, count) in [
            // Aligned by three, and by all in both directions.
            ([&[0, 1, 2, 3][..], &[1, 2, 3, 4][..]], 3),
            // One is shared and not enough.
            ([&[0, 1, 2], &[2, 3, 4]], 2),
            // None: what each sees of the other's alone.
            ([&[0, 1, 2], &[3, 4, 5]], 2),
            // Only the first has seen what the second has.
            ([&[], &[3, 4, 5]], 1),
            // Nothing new is seen across.
            ([&[0, 1, 2], &[0, 1, 2]], 1),
        ] {
            let (problem, truth, [first, second]) = parts(landmarks);
            let found: Vec<Map> = merged(&problem, &options, &first, &second).collect();
            // Once with what is held well, and once with all.
            assert_eq!(found.len(), 2 * count, "{landmarks:?}");
            for map in found {
                assert_eq!(map.poses[..2], first.poses[..2]);
                for (pose, truth) in map.poses.iter().zip(&truth.poses) {
                    let error = truth.unwrap().inv_mul(&pose.unwrap());
                    let error = error.translation.vector.norm() + error.rotation.angle().abs();
                    assert!(error < 1e-6, "{landmarks:?}: {error:e}");
                }
            }
        }
        // One landmark and nothing across.
        let (problem, _, [mut first, mut second]) = parts([&[0], &[0]]);
        assert_eq!(merged(&problem, &options, &first, &second).count(), 0);
        first.landmarks.fill(None);
        second.landmarks.fill(None);
        assert_eq!(merged(&problem, &options, &first, &second).count(), 0);
    }

    /// A similarity that puts a landmark behind a ray is none, except modulo pi.
    #[test]
    fn what_is_seen_across_is_ahead() {
        let points = [(1.0, 1.0), (3.0, 1.0), (2.0, 4.0), (4.0, 3.0)];
        let across = |backward: bool| -> Vec<Across> {
            let mut across: Vec<Across> = Vec::new();
            for (k, &(x, y)) in points.iter().enumerate() {
                let view = Point2::new(-1.0 - k as f64, 0.5);
                let ray = (Point2::new(x, y) - view).normalize();
                across.push(Across {
                    landmark: Point2::new(0.5 * x + 1.0, 0.5 * y),
                    view,
                    ray: if backward && k == 2 { -ray } else { ray },
                });
            }
            across
        };
        let found = similarity(&[], &across(false), true).unwrap();
        assert!((found.scaling() - 2.0).abs() < 1e-9);
        assert!(
            (found.transform_point(&Point2::new(1.5, 0.5)) - Point2::new(1.0, 1.0)).norm() < 1e-9
        );
        assert!(similarity(&[], &across(true), true).is_none());
        assert!(similarity(&[], &across(true), false).is_some());
        // Three rays are too few; four of one landmark leave directions free.
        assert!(similarity(&[], &across(false)[..3], false).is_none());
        let mut same = across(false);
        for one in &mut same {
            one.landmark = Point2::new(1.0, 1.0);
        }
        assert!(similarity(&[], &same, false).is_none());
    }
}
