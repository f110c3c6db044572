// SPDX-License-Identifier: MIT OR Apache-2.0
//! Positions of views whose headings are known.

use super::super::global::options::PositionOptions;
use super::super::global::positions;
use crate::geometry::points::{median, middle};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::{UnitComplex, Vector2};

/// How many times as far from the middle as half of the views a view may be. Not an option: far above any path, and far
/// below what a direction that the bearings leave free comes out as.
const FAR: f64 = 1000.0;

/// The map of the views with a heading that hold together; `None` when the rays determine nothing.
///
/// A view that shares too little with the others may be anywhere, and the linear solution puts it so far away that the
/// others come to be in one place. Such views are left out, the farthest first.
pub fn map_from_headings(
    problem: &Problem,
    mut headings: Vec<Option<UnitComplex<f64>>>,
    options: &PositionOptions,
) -> Option<Map> {
    loop {
        let map = positions::solve(problem, &headings, options)?;
        let Some(view) = far_view(&map) else {
            return Some(map);
        };
        headings[view] = None;
    }
}

/// The view farthest from the middle, if it is too far.
fn far_view(map: &Map) -> Option<usize> {
    let places = map.poses.iter().enumerate();
    let places: Vec<(usize, Vector2<f64>)> = places
        .filter_map(|(view, pose)| Some((view, pose.as_ref()?.translation.vector)))
        .collect();
    let middle = middle(&places.iter().map(|(_, place)| *place).collect::<Vec<_>>());
    let distance = |place: &Vector2<f64>| (place - middle).norm();
    let usual = median(places.iter().map(|(_, place)| distance(place)).collect());
    let far = places
        .iter()
        .max_by(|a, b| distance(&a.1).total_cmp(&distance(&b.1)))?;
    (distance(&far.1) > FAR * usual).then_some(far.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of five views within two of their middle, one beyond a thousand times that is too far.
    #[test]
    fn a_view_a_thousand_times_as_far_as_others_is_too_far() {
        for (x, far) in [(1990.0, None), (2010.0, Some(3))] {
            let places = [(0.0, 2.0), (0.0, -2.0), (2.0, 0.0), (x, 0.0), (-2.0, 0.0)];
            let mut map = Map::empty(6, 0);
            for (place, (x, y)) in map.poses.iter_mut().zip(places) {
                *place = Some(crate::geometry::pose(x, y, 0.1));
            }
            assert_eq!(far_view(&map), far, "{x}");
        }
        assert_eq!(far_view(&Map::empty(2, 0)), None);
    }
}
