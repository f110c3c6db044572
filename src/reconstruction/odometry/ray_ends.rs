// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps in which a landmark is at another end of its rays: back from infinity, on a view, or away from it.
//!
//! Where odometry and priors hold views loosely, they turn toward a landmark or away from it together. What its place
//! costs while they are held fixed says little then, least of all of a landmark that two views see.

use super::super::infinity::{drop_landmarks_at_infinity, far_out, listed_at_infinity};
use super::super::result::Reconstruction;
use super::super::search::moves::ray;
use super::super::search::options::MoveOptions;
use super::super::stages::StageOptions;
use crate::problem::{Map, ON_VIEW, Problem};
use alloc::vec::Vec;
use nalgebra::Point2;

/// Maps that differ from a minimum in one landmark that is at an end of its rays, or in two that are exchanged; of maps
/// of many views, fewer.
pub fn other_ends(
    problem: &Problem,
    best: &Reconstruction,
    size: f64,
    stages: &StageOptions,
) -> Vec<Map> {
    let options = &stages.moves;
    let (views, all) = (problem.views(), stages.incremental.moved_views);
    let most = if views <= all {
        options.most_back
    } else {
        options.most_back.saturating_mul(all) / views
    };
    if most == 0 {
        return Vec::new();
    }
    let mut dropped = best.clone();
    drop_landmarks_at_infinity(problem, &mut dropped, &stages.infinity);
    let ends = Ends {
        problem,
        map: &best.map,
        size,
        options,
        at_infinity: listed_at_infinity(&dropped).collect(),
        on_views: dropped.map.landmarks_on_views(problem, ON_VIEW * size),
    };
    let beside = dropped
        .map
        .landmarks_on_views(problem, options.beside * size);
    let mut maps: Vec<Map> = ends.back().take(most).collect();
    maps.extend(ends.exchanged(&beside).take(most));
    maps.extend(ends.onto_views().take(most));
    maps.extend(ends.away().take(most));
    maps
}

/// The landmarks of a map that are at an end of their rays.
struct Ends<'a> {
    problem: &'a Problem,
    map: &'a Map,
    size: f64,
    options: &'a MoveOptions,
    at_infinity: Vec<usize>,
    on_views: Vec<usize>,
}

impl Ends<'_> {
    /// The map with landmarks in other places.
    fn with(&self, places: &[(usize, Point2<f64>)]) -> Map {
        let mut map = self.map.clone();
        for &(landmark, place) in places {
            map.landmarks[landmark] = Some(place);
        }
        map
    }

    /// A landmark so many sizes of the map along its mean ray.
    fn out(&self, landmark: usize, range: f64) -> Option<(usize, Point2<f64>)> {
        let place = far_out(self.problem, self.map, landmark, range * self.size)?;
        Some((landmark, place))
    }

    /// One of the landmarks at infinity is back: all views that see it have turned away from it together.
    fn back(&self) -> impl Iterator<Item = Map> {
        self.options.back.iter().flat_map(move |&range| {
            let landmarks = self.at_infinity.iter();
            landmarks.filter_map(move |&landmark| Some(self.with(&[self.out(landmark, range)?])))
        })
    }

    /// One of the landmarks at infinity is back in place of one beside a view, which goes there.
    fn exchanged<'a>(&'a self, beside: &'a [usize]) -> impl Iterator<Item = Map> + 'a {
        let MoveOptions { away, back, .. } = self.options;
        beside.iter().flat_map(move |&near| {
            let others = self.at_infinity.iter();
            others.filter_map(move |&far| {
                Some(self.with(&[self.out(near, *away)?, self.out(far, back[0])?]))
            })
        })
    }

    /// A landmark of few sightings, at infinity or on a view, is on another of the views that see it.
    fn onto_views(&self) -> impl Iterator<Item = Map> {
        let MoveOptions {
            off, beside, few, ..
        } = *self.options;
        let landmarks = self.at_infinity.iter().chain(&self.on_views);
        let of_few = landmarks.filter(move |&&k| self.map.rays(self.problem, k).count() <= few);
        of_few.flat_map(move |&landmark| {
            let rays = self.map.rays(self.problem, landmark);
            rays.filter_map(move |(pose, s)| {
                let view = pose.translation.vector;
                let range = (self.map.landmarks[landmark]?.coords - view).norm();
                let place = view + ray(&pose.rotation, s) * (off * self.size);
                (range > beside * self.size).then(|| self.with(&[(landmark, place.into())]))
            })
        })
    }

    /// A landmark on a view is at infinity.
    fn away(&self) -> impl Iterator<Item = Map> {
        let landmarks = self.on_views.iter();
        landmarks.filter_map(|&landmark| Some(self.with(&[self.out(landmark, self.options.away)?])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};
    use alloc::vec;

    /// Landmark 0 is on the view 1 of the two that see it, 1 and 2 are far out, and 2 is seen by too many to be tried on
    /// views.
    #[test]
    fn landmarks_go_to_each_other_end_of_their_rays() {
        let scene = simulate(Layout::Mixed, 6, 5, 0.0, 2, Arena::default()).unwrap();
        let seen_by = [vec![1, 3], vec![0, 4], vec![0, 1, 2, 3, 4]];
        let mut bearings = scene.bearings.clone();
        for (landmark, views) in seen_by.iter().enumerate() {
            for view in (0..6).filter(|view| !views.contains(view)) {
                bearings[view * 5 + landmark] = f64::NAN;
            }
        }
        let problem = Problem::dense(6, 5, &bearings, 0.01).unwrap();
        let mut map = scene.map();
        let at = |view: usize| Point2::from(map.poses[view].unwrap().translation.vector);
        let views = [at(0), at(1), at(2), at(3), at(4)];
        map.landmarks[0] = Some(views[1]);
        for far in [1, 2] {
            map.landmarks[far] = far_out(&problem, &map, far, 1e6);
        }
        let options = MoveOptions::default();
        let ends = Ends {
            problem: &problem,
            map: &map,
            size: 2.0,
            options: &options,
            at_infinity: vec![1, 2],
            on_views: vec![0],
        };
        let moved = |maps: &mut dyn Iterator<Item = Map>| -> Vec<Vec<(usize, Point2<f64>)>> {
            let changes = |other: Map| {
                assert_eq!(other.poses, map.poses);
                let pairs = other.landmarks.into_iter().zip(&map.landmarks).enumerate();
                let changed = pairs.filter(|(_, (other, before))| other != *before);
                changed.map(|(k, (other, _))| (k, other.unwrap())).collect()
            };
            maps.map(changes).collect()
        };
        let onto = moved(&mut ends.onto_views());
        let ranges = onto.iter().map(|change| (change[0].0, change[0].1));
        let expected = [(1, 0), (1, 4), (0, 3)];
        assert_eq!(onto.len(), expected.len());
        for ((landmark, place), (expected, view)) in ranges.zip(expected) {
            let step = place - views[view];
            let ray = scene.landmarks[expected] - views[view];
            assert_eq!(landmark, expected);
            assert!((step - ray.normalize() * options.off * 2.0).norm() < 1e-9);
        }
        assert_eq!(moved(&mut ends.away()), [vec![ends.out(0, 30.0).unwrap()]]);
        let back = moved(&mut ends.back());
        let places = options.back.iter().flat_map(|&range| {
            let out = |k| vec![ends.out(k, range).unwrap()];
            [out(1), out(2)]
        });
        assert_eq!(back, places.collect::<Vec<_>>());
        let exchanged = moved(&mut ends.exchanged(&[0]));
        let pair = |far| vec![ends.out(0, 30.0).unwrap(), ends.out(far, 0.3).unwrap()];
        assert_eq!(exchanged, [pair(1), pair(2)]);
        assert_eq!(map.landmarks_on_views(&problem, 1e-6), [0]);
    }
}
