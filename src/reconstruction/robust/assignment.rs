// SPDX-License-Identifier: MIT OR Apache-2.0
//! Assignment of the bearings of a view to the landmarks of a map, whatever their labels: the linear assignment
//! problem, view by view.

use super::consensus::{OUTLIER, square_within};
use super::options::IdentityOptions;
use crate::geometry::Pose;
use crate::problem::{Map, Problem};
use alloc::vec;
use alloc::vec::Vec;

/// The landmark of each sighting, in the order of [`Problem::sightings`], when each view's bearings are assigned to
/// the landmarks of the map at the least sum of squares of residual over sigma, each truncated at three sigma.
///
/// No view has a landmark twice. A bearing that no landmark explains keeps its label, or takes one that is left over
/// where that has gone to another.
pub fn assign(problem: &Problem, map: &Map, options: &IdentityOptions) -> Vec<usize> {
    let mut labels: Vec<usize> = problem.sightings().iter().map(|s| s.landmark).collect();
    for view in 0..problem.views() {
        if let Some(pose) = &map.poses[view] {
            let labels = &mut labels[problem.range_of_view(view)];
            assign_view(problem, map, (view, pose), labels, options);
        }
    }
    labels
}

/// The same for one view, at this pose; the number of bearings that are explained.
pub fn assign_view(
    problem: &Problem,
    map: &Map,
    (view, pose): (usize, &Pose<f64>),
    labels: &mut [usize],
    options: &IdentityOptions,
) -> usize {
    let seen = problem.of_view(view);
    if seen.len() > options.bearings {
        return 0;
    }
    let most = OUTLIER * OUTLIER;
    // Candidates: the landmarks that explain a bearing, and for each bearing a place of its own for none.
    let explains = |k: usize, landmark: usize| {
        let point = map.landmarks[landmark].as_ref()?;
        let square = square_within(problem, &seen[k], pose, point, OUTLIER);
        (square <= most).then_some(square)
    };
    let candidates: Vec<usize> = (0..problem.landmarks())
        .filter(|&landmark| (0..seen.len()).any(|k| explains(k, landmark).is_some()))
        .collect();
    let columns = candidates.len() + seen.len();
    let mut costs = vec![f64::INFINITY; seen.len() * columns];
    for k in 0..seen.len() {
        for (column, &landmark) in candidates.iter().enumerate() {
            if let Some(square) = explains(k, landmark) {
                let own = if landmark == labels[k] {
                    options.own_label
                } else {
                    0.0
                };
                costs[k * columns + column] = square - own;
            }
        }
        costs[k * columns + candidates.len() + k] = most;
    }
    let assigned = cheapest(&costs, columns);
    let mut free: Vec<usize> = labels.to_vec();
    let mut left = Vec::new();
    for (k, column) in assigned.into_iter().enumerate() {
        match candidates.get(column) {
            Some(&landmark) => {
                labels[k] = landmark;
                free.retain(|other| *other != landmark);
            }
            None => left.push(k),
        }
    }
    // Own labels first.
    let explained = seen.len() - left.len();
    left.retain(|&k| {
        let own = free.iter().position(|label| *label == labels[k]);
        if let Some(place) = own {
            free.remove(place);
        }
        own.is_none()
    });
    for (k, label) in left.into_iter().zip(free) {
        labels[k] = label;
    }
    explained
}

/// The column of each row in an assignment of least total cost, each column at most once: the Hungarian algorithm
/// with shortest augmenting paths (Jonker and Volgenant 1987).
///
/// `costs` is row by row, infinite where an assignment is impossible; each row must have an assignment whatever the
/// others take.
fn cheapest(costs: &[f64], columns: usize) -> Vec<usize> {
    let rows = costs.len() / columns.max(1);
    let mut row_of: Vec<Option<usize>> = vec![None; columns];
    let (mut row_price, mut column_price) = (vec![0.0; rows], vec![0.0; columns]);
    for first in 0..rows {
        // Dijkstra over reduced costs, from this row to a free column.
        let mut distance = vec![f64::INFINITY; columns];
        let mut from: Vec<Option<usize>> = vec![None; columns];
        let mut done = vec![false; columns];
        let (mut row, mut reached, mut entered) = (first, 0.0, None);
        let end = loop {
            for column in 0..columns {
                let cost = costs[row * columns + column] - row_price[row] - column_price[column];
                if !done[column] && reached + cost < distance[column] {
                    distance[column] = reached + cost;
                    from[column] = entered;
                }
            }
            let open = (0..columns).filter(|&column| !done[column]);
            let Some(next) = open.min_by(|&a, &b| distance[a].total_cmp(&distance[b])) else {
                break None;
            };
            reached = distance[next];
            if reached == f64::INFINITY {
                break None;
            }
            done[next] = true;
            match row_of[next] {
                None => break Some(next),
                Some(other) => (row, entered) = (other, Some(next)),
            }
        };
        let Some(end) = end else {
            continue;
        };
        row_price[first] += reached;
        for column in (0..columns).filter(|&column| done[column] && column != end) {
            let gain = reached - distance[column];
            column_price[column] -= gain;
            if let Some(row) = row_of[column] {
                row_price[row] += gain;
            }
        }
        // Along the path each column takes the row of the one before.
        let mut column = end;
        while let Some(before) = from[column] {
            row_of[column] = row_of[before];
            column = before;
        }
        row_of[column] = Some(first);
    }
    let mut column_of = vec![columns; rows];
    for (column, row) in row_of.into_iter().enumerate() {
        if let Some(row) = row {
            column_of[row] = column;
        }
    }
    column_of
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// Against all permutations.
    #[test]
    fn an_assignment_is_the_cheapest() {
        let mut state = 1_u64;
        let mut draw = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as f64 / (1_u64 << 31) as f64
        };
        for _ in 0..200 {
            // Rows of six entries, some impossible, each with one of its own behind.
            let mut costs = vec![f64::INFINITY; 4 * 10];
            for row in 0..4 {
                for column in 0..6 {
                    let cost = draw() * 9.0 - 1.0;
                    if draw() < 0.6 {
                        costs[row * 10 + column] = cost;
                    }
                }
                costs[row * 10 + 6 + row] = 9.0;
            }
            let total = |columns: [usize; 4]| -> f64 {
                let sum = (0..4).map(|row| costs[row * 10 + columns[row]]);
                sum.sum()
            };
            let mut least = f64::INFINITY;
            for code in 0..10_000_usize {
                let columns = [code / 1000, code / 100 % 10, code / 10 % 10, code % 10];
                let twice = (0..4).any(|a| (0..a).any(|b| columns[a] == columns[b]));
                if !twice {
                    least = least.min(total(columns));
                }
            }
            let found: [usize; 4] = cheapest(&costs, 10).try_into().unwrap();
            assert!((0..4).all(|a| (0..a).all(|b| found[a] != found[b])));
            assert!((total(found) - least).abs() < 1e-12);
        }
        assert!(cheapest(&[], 0).is_empty());
    }

    /// A cycle of three labels is undone; a bearing that nothing explains takes what is left.
    #[test]
    fn labels_are_put_right_view_by_view() {
        let scene = simulate(Layout::Enclosed, 3, 6, 0.0, 4, Arena::default()).unwrap();
        let mut bearings = scene.bearings.clone();
        bearings[6..12].copy_from_slice(&[1, 2, 0, 3, 4, 5].map(|j| scene.bearings[6 + j]));
        let problem = |bearings: &[f64]| Problem::dense(3, 6, bearings, 0.001).unwrap();
        let options = IdentityOptions::default();
        let labels = |bearings: &[f64], map: &Map| assign(&problem(bearings), map, &options);
        let own: Vec<usize> = (0..18).map(|k| k % 6).collect();
        let mut expected = own.clone();
        expected[6..12].copy_from_slice(&[1, 2, 0, 3, 4, 5]);
        assert_eq!(labels(&scene.bearings, &scene.map()), own);
        assert_eq!(labels(&bearings, &scene.map()), expected);
        let repaired = problem(&bearings).relabelled(&expected);
        let right = problem(&scene.bearings);
        assert!(repaired.sightings() == right.sightings());
        assert_eq!(repaired.input_order()[6..9], [8, 6, 7]);
        // The first bearing of the cycle is wrong altogether: the label that is left is its own no more.
        let mut odd = bearings.clone();
        odd[6] += 0.1;
        assert_eq!(labels(&odd, &scene.map()), expected);
        // Views that are not in the map, and those with too many bearings, keep their labels.
        let mut map = scene.map();
        map.poses[1] = None;
        assert_eq!(labels(&bearings, &map), own);
        let few = IdentityOptions {
            bearings: 5,
            ..options
        };
        assert_eq!(assign(&problem(&bearings), &scene.map(), &few), own);
    }
}
