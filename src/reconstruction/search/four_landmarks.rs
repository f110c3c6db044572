// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps grown from four landmarks that four or more views see.

use super::super::grow::grow;
use super::triples::common_bearings;
use crate::kernels::{Quadruple, four_landmarks};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// Minimum number of views that determine four landmarks: each has one equation more than its pose has unknowns, and
/// the landmarks have four.
const MIN_VIEWS: usize = 4;

/// Both maps of each set of four landmarks that one of these triples of views shares and four or more views see,
/// with the index of the triple.
pub fn maps_of_four(problem: &Problem, triples: &[[usize; 3]]) -> Vec<(Map, usize)> {
    let mut known: Vec<[usize; 4]> = Vec::new();
    let mut found = Vec::new();
    for (triple, &views) in triples.iter().enumerate() {
        let (_, shared) = common_bearings(problem, views);
        let Ok(four) = <[usize; 4]>::try_from(shared) else {
            continue;
        };
        if known.contains(&four) {
            continue;
        }
        known.push(four);
        let views = (0..problem.views()).filter_map(|view| bearings_of(problem, view, &four));
        if views.clone().nth(MIN_VIEWS - 1).is_none() {
            continue;
        }
        for points in four_landmarks(views).into_iter().flatten() {
            let mut map = Map::empty(problem.views(), problem.landmarks());
            for (&landmark, point) in four.iter().zip(points) {
                map.landmarks[landmark] = Some(point);
            }
            grow(problem, &mut map);
            found.push((map, triple));
        }
    }
    found
}

/// The bearings of four landmarks from one view; `None` when it does not see all of them.
fn bearings_of(problem: &Problem, view: usize, four: &[usize; 4]) -> Option<Quadruple<f64>> {
    let seen = problem.of_view(view);
    let place = |landmark: usize| seen.binary_search_by_key(&landmark, |s| s.landmark).ok();
    let [a, b, c, d] = four.map(place);
    Some([a?, b?, c?, d?].map(|place| seen[place].bearing))
}
