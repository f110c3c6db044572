// SPDX-License-Identifier: MIT OR Apache-2.0
//! Degeneracies that the bearings themselves show, without a map.
//!
//! The bearings of two views in one place differ by a constant. If the views are on one circle with the
//! landmarks, they differ by a constant modulo pi (inscribed angles). If everything is on one line, all
//! bearings of a view are equal modulo pi. In each case one of the many maps that explain the bearings
//! modulo pi can be written down.

use super::super::shapes::normalized_map::NormalizedMap;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::problem::Problem;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};
use nalgebra::{Complex, Vector2};

/// Rounding error of a bearing, or of a sum of two, in machine epsilons. Far below any noise.
const ROUNDINGS: f64 = 64.0;

/// Minimum number of landmarks in common to tell whether the bearings of two views differ by a constant: with two
/// they may by chance.
const MIN_COMMON: usize = 3;

/// A map of the shape that the bearings show. `noise` is their standard deviation \[rad\], 0 if exact; they may
/// deviate from the shape by at most this many `sigmas`.
///
/// `None` when the bearings show no such shape. What the bearings leave open is chosen arbitrarily: the positions
/// of points along the line or circle, or along their rays.
pub fn map_from_bearings(problem: &Problem, noise: f64, sigmas: f64) -> Option<NormalizedMap> {
    let bound = sigmas * noise + ROUNDINGS * f64::EPSILON;
    on_one_line(problem, bound).or_else(|| {
        // Differences of two bearings.
        let bound = bound * core::f64::consts::SQRT_2;
        let alike = places(problem, bound, 1.0, 2);
        if alike.as_ref().is_some_and(|places| places.count == 1) {
            in_few_places(problem, &alike?)
        } else if places(problem, bound, 2.0, 1).is_some() {
            on_one_circle(problem)
        } else {
            in_few_places(problem, &alike?)
        }
    })
}

/// The constant that all angles equal modulo `2 pi / turns`, up to a bound; `None` when there is none.
fn constant(angles: &[f64], turns: f64, bound: f64) -> Option<f64> {
    let sum = angles
        .iter()
        .map(|&a| unit(a * turns))
        .fold(Complex::new(0.0, 0.0), |sum, z| sum + z);
    let middle = sum.im.atan2(sum.re) / turns;
    let period = TAU / turns;
    let far = |&a: &f64| {
        let turned = (a - middle) / period;
        (turned - turned.round()).abs() * period
    };
    angles.iter().all(|a| far(a) <= bound).then_some(middle)
}

fn unit(angle: f64) -> Complex<f64> {
    let (sin, cos) = angle.sin_cos();
    Complex::new(cos, sin)
}

/// Quasi-random numbers in (0, 1): multiples of the golden ratio modulo 1.
fn scattered(k: usize) -> f64 {
    let turned = (k as f64 + 1.0) * 0.618_033_988_749_894_9;
    turned - turned.floor()
}

fn on_one_line(problem: &Problem, bound: f64) -> Option<NormalizedMap> {
    for view in 0..problem.views() {
        let bearings: Vec<f64> = problem
            .of_view(view)
            .iter()
            .map(|s| s.bearing.angle())
            .collect();
        constant(&bearings, 2.0, bound)?;
    }
    let views = problem.views();
    let along = |k: usize| Vector2::new(scattered(k), 0.0);
    NormalizedMap::new(
        problem,
        (0..views).map(|view| (view, along(view))),
        (0..problem.landmarks()).map(|landmark| (landmark, along(views + landmark))),
    )
}

/// Views whose bearings differ by a constant.
struct Places {
    /// Which set each view is in.
    of_view: Vec<usize>,
    /// What to subtract from the bearings of each view to get those of the first view of its set.
    offset: Vec<f64>,
    count: usize,
}

/// The sets of views whose bearings differ by a constant modulo `2 pi / turns`; `None` when there are
/// more than `most`, or a view has too few landmarks in common with the first of a set.
fn places(problem: &Problem, bound: f64, turns: f64, most: usize) -> Option<Places> {
    let mut places = Places {
        of_view: Vec::new(),
        offset: Vec::new(),
        count: 0,
    };
    let mut firsts: Vec<usize> = Vec::new();
    for view in 0..problem.views() {
        let mut found = None;
        for (place, &first) in firsts.iter().enumerate() {
            let differences = differences(problem, first, view);
            if differences.len() < MIN_COMMON {
                return None;
            }
            if let Some(offset) = constant(&differences, turns, bound) {
                found = Some((place, offset));
                break;
            }
        }
        let (place, offset) = match found {
            Some(found) => found,
            None if firsts.len() == most => return None,
            None => {
                firsts.push(view);
                (firsts.len() - 1, 0.0)
            }
        };
        places.of_view.push(place);
        places.offset.push(offset);
    }
    places.count = firsts.len();
    (places.count > 0).then_some(places)
}

/// Bearings of a view minus those of another, for the landmarks that both see.
fn differences(problem: &Problem, first: usize, view: usize) -> Vec<f64> {
    let mut others = problem.of_view(first).iter().peekable();
    let mut found = Vec::new();
    for s in problem.of_view(view) {
        while others.next_if(|o| o.landmark < s.landmark).is_some() {}
        if let Some(other) = others.next_if(|o| o.landmark == s.landmark) {
            found.push(s.bearing.angle() - other.bearing.angle());
        }
    }
    found
}

/// By inscribed angles, the direction of a landmark from the centre is twice its bearing from any view.
fn on_one_circle(problem: &Problem) -> Option<NormalizedMap> {
    let views = places(problem, PI, 2.0, 1)?;
    let mut at: Vec<Option<f64>> = vec![None; problem.landmarks()];
    for s in problem.sightings() {
        at[s.landmark].get_or_insert(2.0 * (s.bearing.angle() - views.offset[s.view]));
    }
    let on = |angle: f64| {
        let z = unit(angle);
        Vector2::new(z.re, z.im)
    };
    // A view sees the same bearings from anywhere on the circle.
    NormalizedMap::new(
        problem,
        (0..problem.views()).map(|view| (view, on(TAU * scattered(view)))),
        at.iter()
            .enumerate()
            .filter_map(|(landmark, angle)| angle.map(|angle| (landmark, on(angle)))),
    )
}

/// One place, with landmarks anywhere along their rays, or two places with any rotation between them.
fn in_few_places(problem: &Problem, places: &Places) -> Option<NormalizedMap> {
    // Rays of each landmark from each place, in the frame of the first view there.
    let mut rays = vec![[None; 2]; problem.landmarks()];
    for s in problem.sightings() {
        let angle = s.bearing.angle() - places.offset[s.view];
        rays[s.landmark][places.of_view[s.view]].get_or_insert(angle);
    }
    // The rotation for which the smallest angle between two rays of a landmark is largest.
    let turns = (0..TURNS).map(|k| PI * (f64::from(k) + 0.5) / f64::from(TURNS));
    let steepness = |turn: f64| {
        let pairs = rays.iter().filter_map(|[a, b]| Some((*a)? - (*b)? - turn));
        pairs.map(|d| d.sin().abs()).fold(1.0, f64::min)
    };
    let turn = turns.max_by(|a, b| steepness(*a).total_cmp(&steepness(*b)))?;
    let at = |place: usize| Vector2::new(if place == 0 { 0.0 } else { 1.0 }, 0.0);
    let heading = |place: usize| if place == 0 { 0.0 } else { turn };
    let ray = |place: usize, angle: f64| {
        let z = unit(angle + heading(place));
        Vector2::new(z.re, z.im)
    };
    let landmark = |k: usize| -> Option<Vector2<f64>> {
        match rays[k] {
            [Some(a), Some(b)] => {
                let (a, b) = (ray(0, a), ray(1, b));
                let range = b.y / (a.x * b.y - a.y * b.x);
                Some(a * range)
            }
            [Some(a), None] => Some(at(0) + ray(0, a) * (0.5 + scattered(k))),
            [None, Some(b)] => Some(at(1) + ray(1, b) * (0.5 + scattered(k))),
            [None, None] => None,
        }
    };
    NormalizedMap::new(
        problem,
        (0..problem.views()).map(|view| (view, at(places.of_view[view]))),
        (0..problem.landmarks()).filter_map(|k| landmark(k).map(|p| (k, p))),
    )
}

/// Rotations between two places that are tried: any that leaves no rays parallel will do.
const TURNS: u32 = 16;
