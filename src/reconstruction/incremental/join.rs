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
