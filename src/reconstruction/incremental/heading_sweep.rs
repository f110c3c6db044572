// SPDX-License-Identifier: MIT OR Apache-2.0
//! Views that see too few landmarks of a map to be placed alone, by a sweep over the heading of one of them.
//!
//! Two landmarks place a view of which the heading is known. The landmarks that it sees beyond these, with the rays of
//! other views, place further views in turn, and where one sighting is left over, it tells the heading.

use super::super::judge::{is_excess_plausible, variance};
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::result::Reconstruction;
use super::complete::{finish, place_all};
use super::place::backward;
use crate::error::Error;
use crate::problem::{MIN_LANDMARKS_OF_VIEW, Map, Problem};
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;
use nalgebra::UnitComplex;

/// A map with the views that a sweep over headings places, as long as redundant sightings confirm them.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn place_by_headings(
    problem: &Problem,
    mut best: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let allowed = vec![true; problem.views()];
    loop {
        let mut candidates: Vec<(usize, f64, Map)> = Vec::new();
        for view in 0..problem.views() {
            if !report_progress(progress, "place", view, problem.views()) {
                return Err(Error::Interrupted);
            }
            let two = best.map.connections_of_view(problem, view) + 1 == MIN_LANDMARKS_OF_VIEW;
            if best.map.poses[view].is_none() && two {
                candidates.extend(swept(problem, &best.map, view, options));
            }
        }
        // What explains most, then what explains it best.
        candidates.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)));
        candidates.truncate(options.stages.incremental.max_finished);
        let deviations = options.stages.incremental.joining_deviations;
        let noise = variance(&best);
        let mut next: Option<Reconstruction> = None;
        for (_, _, map) in candidates {
            let Some(found) = finish(problem, options, map, &allowed, progress)? else {
                continue;
            };
            let added = found.freedom.saturating_sub(best.freedom);
            let excess = 2.0 * (found.cost - best.cost);
            let fits = is_excess_plausible(problem, excess, added, noise, deviations);
            let is_better = |next: &Reconstruction| {
                found.freedom > next.freedom
                    || (found.freedom == next.freedom && found.cost < next.cost)
            };
            if added > 0 && fits && next.as_ref().is_none_or(is_better) {
                next = Some(found);
            }
        }
        let Some(found) = next else {
            return Ok(best);
        };
        best = found;
    }
}

/// The local minima over the heading of a view of a map with all that it then reaches: how many sightings that explains,
/// and the sum of their squares.
fn swept(
    problem: &Problem,
    map: &Map,
    view: usize,
    options: &SolveOptions,
) -> Vec<(usize, f64, Map)> {
    let stage = &options.stages.incremental;
    let seen: Vec<_> = map.seen(problem, view).collect();
    let [first, second] = &seen[..] else {
        return Vec::new();
    };
    let count = stage.headings;
    let tried: Vec<Option<(usize, f64, Map)>> = (0..count)
        .map(|k| {
            let heading = UnitComplex::new(TAU * k as f64 / count as f64);
            let pose = backward(heading, first, second, problem.is_oriented())?;
            let mut map = map.clone();
            map.poses[view] = Some(pose);
            place_all(problem, stage, &mut map);
            let squares = problem.sightings().iter().zip(map.residuals(problem));
            let squares = squares.filter_map(|(s, residual)| {
                let residual = residual? * s.weight;
                Some(residual * residual)
            });
            let (explained, sum) =
                squares.fold((0, 0.0), |(count, sum), square| (count + 1, sum + square));
            Some((explained, sum, map))
        })
        .collect();
    let key = |k: usize| {
        let one = tried[k % count].as_ref();
        one.map_or((0, f64::INFINITY), |(explained, sum, _)| (*explained, *sum))
    };
    let is_below = |a: (usize, f64), b: (usize, f64)| a.0 > b.0 || (a.0 == b.0 && a.1 <= b.1);
    let is_lowest = |k: &usize| {
        tried[*k].is_some()
            && is_below(key(*k), key(k + 1))
            && is_below(key(*k), key(k + count - 1))
    };
    let lowest: Vec<usize> = (0..count).filter(is_lowest).collect();
    let mut tried = tried;
    lowest.into_iter().filter_map(|k| tried[k].take()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::simulate::{Arena, Layout, simulate};

    /// A view that sees two landmarks of an exact map is placed by the others that it brings in, with a further view.
    #[test]
    fn a_view_of_two_landmarks_is_placed_by_what_it_adds() {
        let scene = simulate(Layout::Enclosed, 6, 9, 0.0, 2, Arena::default()).unwrap();
        let mut bearings = scene.bearings.clone();
        // The last three views see the last four landmarks, and of the others one, two and three.
        for view in 0..3 {
            bearings[9 * view + 5..9 * view + 9].fill(f64::NAN);
        }
        for view in 3..6 {
            bearings[9 * view + view - 2..9 * view + 5].fill(f64::NAN);
        }
        let problem = Problem::dense(6, 9, &bearings, 1e-4).unwrap();
        let mut map = scene.map();
        map.poses[3..5].fill(None);
        map.landmarks[5..].fill(None);
        let options = SolveOptions::default();
        let found = swept(&problem, &map, 4, &options);
        // The lowest in their neighbourhoods, few of all headings that are tried.
        assert!(!found.is_empty() && found.len() < 10, "{}", found.len());
        let most = found.iter().map(|(explained, ..)| *explained).max();
        // What both see places the landmarks.
        assert_eq!(most, Some(problem.sightings().len()));
        let of_truth = |(explained, sum, map): &(usize, f64, Map)| {
            let pose = map.poses[4].unwrap();
            let turned = pose.rotation.angle_to(&scene.poses[4].rotation).abs();
            Some(*explained) == most && turned < 0.1 && sum.is_finite()
        };
        assert!(found.iter().any(of_truth));
        // In units of the noise.
        for (_, sum, map) in &found {
            let over_sigma = map.residuals(&problem).flatten().map(|r| r / 1e-4);
            let squares: f64 = over_sigma.map(|r| r * r).sum();
            assert!((sum - squares).abs() <= 1e-9 * squares, "{sum} {squares}");
        }
        // Three landmarks are not swept.
        map.landmarks[6] = scene.map().landmarks[6];
        assert!(swept(&problem, &map, 4, &options).is_empty());
        map.landmarks[6] = None;
        let report = refine_map(&problem, &mut map, &options.refine, None).unwrap();
        let start = Reconstruction::new(&problem, &map, report);
        let freedom = start.freedom;
        let found = place_by_headings(&problem, start, &options, &mut None).unwrap();
        assert!(found.map.is_complete());
        assert_eq!(found.freedom, problem.sightings().len() + 4 - 18 - 18);
        assert!(found.freedom > freedom && found.rms < 1e-6);
    }
}
