// SPDX-License-Identifier: MIT OR Apache-2.0
//! Headings of views whose positions are known, such as anchors on a wall or views with satellite positions.
//!
//! Two headings place every landmark that both views see; each of these then gives the heading of any other view that
//! sees it. Where that view sees two and more, their headings agree or they do not. So the two headings are searched
//! over a grid, and what agrees best is refined.

use super::super::robust::motions::Motions;
use super::known::Known;
use super::options::HeadingOptions;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Pose;
use crate::problem::{IndexedSighting, Map, Problem};
use alloc::vec::Vec;
use core::f64::consts::TAU;
use nalgebra::{Complex, Point2, Translation2, UnitComplex, Vector2};

/// Landmarks that two views must share to be a pair: with one, no other view could contradict their headings.
const SHARED: usize = 2;

/// Maps of the views of known position that a map does not have, the best first; none where no two of them share
/// landmarks that others see.
pub fn maps_from_positions(
    problem: &Problem,
    known: &Known,
    motions: &Motions,
    map: &Map,
    options: &HeadingOptions,
) -> Vec<Map> {
    let is_free = |view: usize| known.headings[view].is_none() && map.poses[view].is_none();
    let mut views: Vec<(usize, Vector2<f64>)> = (0..problem.views())
        .filter(|&view| is_free(view) && motions.of(view).is_empty())
        .filter_map(|view| Some((view, known.positions[view]?)))
        .collect();
    views.sort_by_key(|&(view, _)| (core::cmp::Reverse(problem.of_view(view).len()), view));
    views.truncate(options.views);
    let mut pairs = Vec::new();
    for (k, &first) in views.iter().enumerate() {
        for &second in &views[..k] {
            let shared = shared(problem, [first.0, second.0]);
            if shared.len() >= SHARED && first.1 != second.1 {
                let checks = views
                    .iter()
                    .filter(|view| view.0 != first.0 && view.0 != second.0);
                let checks = checks.map(|view| {
                    let seen = problem.of_view(view.0).iter();
                    let seen =
                        seen.filter(|s| shared.iter().any(|[a, _]| a.landmark == s.landmark));
                    seen.count().saturating_sub(1)
                });
                pairs.push((checks.sum::<usize>(), [first, second]));
            }
        }
    }
    pairs.retain(|(checks, _)| *checks > 0);
    pairs.sort_by_key(|(checks, [a, b])| (core::cmp::Reverse(*checks), a.0, b.0));
    pairs.truncate(options.pairs);
    let mut found: Vec<(f64, Map)> = Vec::new();
    for (_, pair) in pairs {
        found.extend(best_of_grid(problem, &views, pair, options));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(options.maps);
    found.into_iter().map(|(_, map)| map).collect()
}

/// What two views see of the same landmarks.
fn shared(problem: &Problem, [a, b]: [usize; 2]) -> Vec<[&IndexedSighting; 2]> {
    let mut found = Vec::new();
    for one in problem.of_view(a) {
        let other = problem
            .of_view(b)
            .iter()
            .find(|s| s.landmark == one.landmark);
        found.extend(other.map(|other| [one, other]));
    }
    found
}

/// The local minima over the grid of the headings of a pair, each as a map.
fn best_of_grid(
    problem: &Problem,
    views: &[(usize, Vector2<f64>)],
    pair: [(usize, Vector2<f64>); 2],
    options: &HeadingOptions,
) -> Vec<(f64, Map)> {
    let count = options.headings;
    let shared = shared(problem, pair.map(|(view, _)| view));
    let headings: Vec<UnitComplex<f64>> = (0..count)
        .map(|k| UnitComplex::new(TAU * k as f64 / count as f64))
        .collect();
    let others: Vec<Other<'_>> = views
        .iter()
        .filter(|(view, _)| pair.iter().all(|(other, _)| other != view))
        .map(|&(view, position)| Other::new(problem, &shared, view, position))
        .collect();
    let mut disagreement = Vec::with_capacity(count * count);
    for first in &headings {
        for second in &headings {
            let points = crossings(&shared, pair, [first, second]);
            let each = others
                .iter()
                .map(|other| other.heading(&points, options.half_agreed).1);
            disagreement.push(each.sum::<f64>());
        }
    }
    let mut found = Vec::new();
    for [i, j] in lowest_around(&disagreement, count) {
        let points = crossings(&shared, pair, [&headings[i], &headings[j]]);
        let mut map = Map::empty(problem.views(), problem.landmarks());
        for ((view, position), heading) in pair.iter().zip([headings[i], headings[j]]) {
            map.poses[*view] = Some(Pose::from_parts(Translation2::from(*position), heading));
        }
        for other in &others {
            let heading = other.heading(&points, options.half_agreed).0;
            map.poses[other.view] = heading
                .map(|heading| Pose::from_parts(Translation2::from(other.position), heading));
        }
        found.push((disagreement[i * count + j], map));
    }
    found
}

/// The places of a square grid, which closes in both directions, that are no higher than the eight around them.
fn lowest_around(values: &[f64], count: usize) -> Vec<[usize; 2]> {
    let at = |i: usize, j: usize| values[(i % count) * count + j % count];
    let places = (0..count * count).map(|k| [k / count, k % count]);
    let is_lowest = |[i, j]: &[usize; 2]| {
        (0..9)
            .map(|k| at(i + count + k / 3 - 1, j + count + k % 3 - 1))
            .all(|around| at(*i, *j) <= around)
    };
    places.filter(is_lowest).collect()
}

/// A view that neither of the pair is, and what it sees of the landmarks that these share.
struct Other<'a> {
    view: usize,
    position: Vector2<f64>,
    /// With the place of the landmark among the shared ones.
    seen: Vec<(usize, &'a IndexedSighting)>,
}

impl<'a> Other<'a> {
    fn new(
        problem: &'a Problem,
        shared: &[[&IndexedSighting; 2]],
        view: usize,
        position: Vector2<f64>,
    ) -> Self {
        let seen = problem.of_view(view).iter().filter_map(|s| {
            let place = shared
                .iter()
                .position(|[one, _]| one.landmark == s.landmark);
            Some((place?, s))
        });
        Self {
            view,
            position,
            seen: seen.collect(),
        }
    }

    /// The heading on which most of its landmarks agree, and how many do not: each between 0 and 1.
    fn heading(
        &self,
        points: &[Option<Point2<f64>>],
        half: f64,
    ) -> (Option<UnitComplex<f64>>, f64) {
        let wanted = |&(place, s): &(usize, &IndexedSighting)| {
            let offset = points[place]?.coords - self.position;
            let toward = Complex::new(offset.x, offset.y);
            let norm = toward.norm_sqr().sqrt();
            (norm > 0.0).then(|| toward / norm * s.bearing.into_inner().conj())
        };
        let mut best = (None, self.seen.len() as f64);
        for one in &self.seen {
            let Some(heading) = wanted(one) else { continue };
            let sum: f64 = self
                .seen
                .iter()
                .map(|other| match wanted(other) {
                    Some(other) => {
                        let off = (other - heading).norm_sqr();
                        off / (off + half * half)
                    }
                    None => 1.0,
                })
                .sum();
            if sum < best.1 {
                best = (Some(UnitComplex::new_unchecked(heading)), sum);
            }
        }
        best
    }
}

/// Where the rays of the pair meet, ahead of both.
fn crossings(
    shared: &[[&IndexedSighting; 2]],
    pair: [(usize, Vector2<f64>); 2],
    headings: [&UnitComplex<f64>; 2],
) -> Vec<Option<Point2<f64>>> {
    let [from, to] = pair.map(|(_, position)| position);
    let baseline = to - from;
    let meet = |sightings: &[&IndexedSighting; 2]| {
        let [u, v] = [0, 1].map(|k| {
            let ray = headings[k].into_inner() * sightings[k].bearing.into_inner();
            Vector2::new(ray.re, ray.im)
        });
        let sine = u.perp(&v);
        let (first, second) = (baseline.perp(&v) / sine, baseline.perp(&u) / sine);
        let ahead = first > 0.0 && second > 0.0 && first.is_finite();
        ahead.then(|| Point2::from(from + u * first))
    };
    shared.iter().map(meet).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Noise, PosePrior};
    use crate::simulate::{Arena, Layout, Scene, simulate};

    /// Five views of known positions in an exact scene.
    fn setting(landmarks: usize) -> (Scene, Problem) {
        let scene = simulate(Layout::Enclosed, 5, landmarks, 0.0, 4, Arena::default()).unwrap();
        let problem = Problem::dense(5, landmarks, &scene.bearings, 0.01).unwrap();
        let known = scene
            .poses
            .iter()
            .enumerate()
            .map(|(view, pose)| PosePrior {
                view,
                pose: *pose,
                noise: Noise::Sigmas([0.1, 0.1, f64::INFINITY]),
            });
        let problem = problem
            .with_pose_priors(&known.collect::<Vec<_>>())
            .unwrap();
        (scene, problem)
    }

    /// The best map has the headings of the truth, up to the grid.
    #[test]
    fn exact_positions_give_the_headings() {
        let options = HeadingOptions::default();
        let found = |problem: &Problem, known: &Known| {
            let (motions, empty) = (Motions::new(problem), Map::empty(5, problem.landmarks()));
            maps_from_positions(problem, known, &motions, &empty, &options)
        };
        let (scene, problem) = setting(9);
        let maps = found(&problem, &Known::of(&problem));
        assert!(!maps.is_empty() && maps.len() <= options.maps);
        for (pose, truth) in maps[0].poses.iter().zip(&scene.poses) {
            let pose = pose.unwrap();
            assert_eq!(pose.translation.vector, truth.translation.vector);
            let error = pose.rotation.angle_to(&truth.rotation).abs();
            assert!(error < 0.1, "{error}");
        }
        // A single landmark in common contradicts nothing.
        let (_, one) = setting(1);
        assert!(found(&one, &Known::of(&one)).is_empty());
        let mut known = Known::of(&problem);
        known.positions[2..].fill(None);
        assert!(found(&problem, &known).is_empty());
        let mut known = Known::of(&problem);
        known.headings.fill(Some(UnitComplex::identity()));
        assert!(found(&problem, &known).is_empty());
    }

    /// With the right headings the rays cross at the landmarks, and those of another view all agree on its heading.
    #[test]
    fn rays_of_the_right_headings_cross_at_the_landmarks() {
        let (scene, problem) = setting(9);
        let pair = [1, 3].map(|view: usize| (view, scene.poses[view].translation.vector));
        let both = shared(&problem, [1, 3]);
        assert_eq!(both.len(), 9);
        assert!(
            both.iter()
                .all(|[a, b]| a.view == 1 && b.view == 3 && a.landmark == b.landmark)
        );
        let headings = [&scene.poses[1].rotation, &scene.poses[3].rotation];
        let points = crossings(&both, pair, headings);
        for (point, truth) in points.iter().zip(&scene.landmarks) {
            assert!((point.unwrap() - truth).norm() < 1e-9);
        }
        // The other way round everything is behind.
        let around = headings.map(|heading| heading * UnitComplex::new(core::f64::consts::PI));
        let behind = crossings(&both, pair, [&around[0], &around[1]]);
        assert!(behind.iter().all(Option::is_none));
        let other = Other::new(&problem, &both, 4, scene.poses[4].translation.vector);
        let (heading, off) = other.heading(&points, 0.1);
        assert!(off < 1e-12);
        assert!(heading.unwrap().angle_to(&scene.poses[4].rotation).abs() < 1e-9);
        // What is wrong or missing counts one each, what is off by the half agreed one half.
        let mut some = points.clone();
        some[0] = None;
        let away = scene.poses[4].rotation * problem.of_view(4)[1].bearing;
        let away = Vector2::new(away.re, away.im);
        some[1] = Some(Point2::from(scene.poses[4].translation.vector - away));
        let toward =
            scene.poses[4].rotation * problem.of_view(4)[2].bearing * UnitComplex::new(0.1);
        let toward = Vector2::new(toward.re, toward.im);
        some[2] = Some(Point2::from(
            scene.poses[4].translation.vector + toward * 3.0,
        ));
        let (heading, off) = other.heading(&some, 0.1);
        assert!((off - 2.5).abs() < 0.01, "{off}");
        assert!(heading.unwrap().angle_to(&scene.poses[4].rotation).abs() < 1e-9);
        assert_eq!(other.heading(&[None; 9], 0.1), (None, 9.0));
    }

    /// A place is found unless one of its neighbours, also across the edge, is lower.
    #[test]
    fn the_lowest_around_are_found_across_the_edges() {
        for place in [[0, 0], [0, 3], [4, 2], [4, 4]] {
            for di in 0..3 {
                for dj in 0..3 {
                    let near = [(place[0] + di + 4) % 5, (place[1] + dj + 4) % 5];
                    let mut values = alloc::vec![1.0; 25];
                    for row in 0..5 {
                        for column in 0..5 {
                            // No two are equal.
                            values[5 * row + column] += 0.01 * (5 * row + column) as f64;
                        }
                    }
                    values[5 * place[0] + place[1]] = 0.5;
                    values[5 * near[0] + near[1]] = 0.4;
                    let found = lowest_around(&values, 5);
                    assert!(found.contains(&near), "{place:?} {near:?}");
                    assert_eq!(found.contains(&place), place == near, "{place:?} {near:?}");
                }
            }
        }
        assert_eq!(lowest_around(&[1.0; 9], 3).len(), 9);
    }
}
