// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parts of a map that are removed and grown again, a search in large neighbourhoods.
//!
//! Where sight is limited a map may be right in one place and wrong in another, and no change of a single view or
//! landmark helps, because those next to it are wrong as well.

use super::super::choice::better;
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::result::Reconstruction;
use super::complete::finish;
use super::growth::IncrementalGrowth;
use super::least_squares::LeastSquaresPlaces;
use crate::error::Error;
use crate::problem::{Map, Problem};
use alloc::vec;
use alloc::vec::Vec;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Removes parts of a map that fit badly, or are next to what it leaves out, and grows them again by least squares, until
/// the map is `enough` or so many tries in a row have not made it better.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn regrow(
    problem: &Problem,
    mut best: Reconstruction,
    enough: impl Fn(&Reconstruction) -> bool,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let stage = &options.stages.incremental;
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let allowed = vec![true; problem.views()];
    let mut failed = 0;
    while failed < stage.regrowths && !enough(&best) {
        if !report_progress(progress, "regrow", failed, stage.regrowths) {
            return Err(Error::Interrupted);
        }
        failed += 1;
        let border = border(problem, &best.map);
        let center = if border.is_empty() || random.random::<f64>() < 0.5 {
            drawn_by_misfit(problem, &best.map, &mut random)
        } else {
            Some(border[random.random_range(0..border.len())])
        };
        let Some(center) = center else { break };
        let views = random.random_range(1..=stage.regrown_views.max(1));
        let part = without_part(problem, &best.map, center, views);
        let places = LeastSquaresPlaces::new(problem, stage, &options.refine);
        let Some(mut growth) = IncrementalGrowth::new(problem, options, places, &allowed, part)?
        else {
            continue;
        };
        growth.grow(usize::MAX, progress)?;
        let Some(found) = finish(problem, options, growth.map, &allowed, progress)? else {
            continue;
        };
        let cost = best.cost;
        best = better(problem, [best, found], &options.stages.judge);
        if best.cost != cost {
            failed = 0;
        }
    }
    Ok(best)
}

/// The views of a map that see a landmark which views that are not in it see, too.
fn border(problem: &Problem, map: &Map) -> Vec<usize> {
    let mut wanted = vec![false; problem.landmarks()];
    for s in problem.sightings() {
        wanted[s.landmark] |= map.poses[s.view].is_none();
    }
    let sees = |view: &usize| problem.of_view(*view).iter().any(|s| wanted[s.landmark]);
    let views = 0..problem.views();
    views
        .filter(|view| map.poses[*view].is_some())
        .filter(sees)
        .collect()
}

/// A view, drawn with the probability of its share of the cost.
fn drawn_by_misfit(problem: &Problem, map: &Map, random: &mut ChaCha8Rng) -> Option<usize> {
    let sightings = problem.sightings().iter();
    let squares = sightings.zip(map.residuals(problem)).map(|(s, residual)| {
        let residual = residual.unwrap_or(0.0) * s.weight;
        (s.view, residual * residual)
    });
    let squares: Vec<(usize, f64)> = squares.collect();
    let sum: f64 = squares.iter().map(|(_, square)| square).sum();
    let mut left = random.random::<f64>() * sum;
    let drawn = squares.iter().find(|(_, square)| {
        left -= square;
        left <= 0.0
    });
    drawn.or(squares.last()).map(|(view, _)| *view)
}

/// A map without so many of its views, those that see most of what the center sees, and without the landmarks that mostly
/// these see. Three views are left to grow from.
pub fn without_part(problem: &Problem, map: &Map, center: usize, views: usize) -> Map {
    let sightings = problem.sightings();
    let mut seen = vec![false; problem.landmarks()];
    for s in problem.of_view(center) {
        seen[s.landmark] = true;
    }
    let mut map = map.clone();
    let mut near: Vec<usize> = (0..problem.views())
        .filter(|&view| map.poses[view].is_some())
        .collect();
    near.sort_by_cached_key(|&view| {
        let shared = problem.of_view(view).iter().filter(|s| seen[s.landmark]);
        (view != center, core::cmp::Reverse(shared.count()))
    });
    let most = near.len().saturating_sub(3).min(views).max(1);
    for &view in near.iter().take(most) {
        map.poses[view] = None;
    }
    for landmark in 0..problem.landmarks() {
        let of = problem.of_landmark(landmark);
        let left = of
            .iter()
            .filter(|&&k| map.poses[sightings[k].view].is_some());
        if 2 * left.count() <= of.len() {
            map.landmarks[landmark] = None;
        }
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::geometry::pose;
    use crate::problem::Sighting;
    use crate::reconstruction::judge::is_incomplete;
    use crate::simulate::{Arena, Layout, simulate};
    use nalgebra::Point2;

    /// Views that a map leaves out are reached by growing again what is next to them.
    #[test]
    fn what_is_left_out_is_reached() {
        let arena = Arena {
            sight: 2.0,
            ..Arena::default()
        };
        let sigma = 0.002;
        let scene = simulate(Layout::Trajectory, 20, 40, sigma, 3, arena).unwrap();
        let problem = Problem::dense(20, 40, &scene.bearings, sigma).unwrap();
        let options = SolveOptions::default();
        let refined = |mut map: Map| {
            let report = refine_map(&problem, &mut map, &options.refine, None).unwrap();
            Reconstruction::new(&problem, &map, report)
        };
        let whole = refined(scene.map());
        let mut part = whole.map.clone();
        part.poses[..6].fill(None);
        for landmark in 0..problem.landmarks() {
            if part.rays(&problem, landmark).count() < 2 {
                part.landmarks[landmark] = None;
            }
        }
        let next = border(&problem, &part);
        assert!(!next.is_empty() && next.len() < 14, "{next:?}");
        assert!(next.iter().all(|&view| view >= 6));
        let part = refined(part);
        assert!(is_incomplete(&part));
        let enough = |found: &Reconstruction| !is_incomplete(found);
        let found = regrow(&problem, part, enough, &options, &mut None).unwrap();
        assert_eq!(found.undetermined, whole.undetermined);
        assert!(found.cost < whole.cost * (1.0 + 1e-5));
    }

    /// The views that see most of what the center sees go with it, and the landmarks that half of their views have lost;
    /// three views stay.
    #[test]
    fn a_part_is_what_sees_the_same() {
        // Each view sees four landmarks in a row.
        let sightings: Vec<Sighting> = (0..8)
            .flat_map(|view| (view..view + 4).map(move |landmark| (view, landmark)))
            .map(|(view, landmark)| Sighting {
                view,
                landmark,
                bearing: 0.1 * landmark as f64,
                sigma: 0.1,
            })
            .collect();
        let problem = Problem::new(8, 11, &sightings).unwrap();
        let map = Map {
            poses: (0..8).map(|k| Some(pose(k as f64, 0.0, 0.0))).collect(),
            landmarks: (0..11).map(|k| Some(Point2::new(k as f64, 3.0))).collect(),
        };
        // What a missing view sees, its neighbours see, too.
        let mut gap = map.clone();
        gap.poses[1] = None;
        assert_eq!(border(&problem, &gap), [0, 2, 3, 4]);
        gap.poses[7] = None;
        assert_eq!(border(&problem, &gap), [0, 2, 3, 4, 5, 6]);
        assert!(border(&problem, &map).is_empty());
        let missing = |center: usize, views: usize| {
            let part = without_part(&problem, &map, center, views);
            let views: Vec<usize> = (0..8).filter(|&k| part.poses[k].is_none()).collect();
            let landmarks: Vec<usize> = (0..11).filter(|&k| part.landmarks[k].is_none()).collect();
            (views, landmarks)
        };
        // The first landmark has one view, the second two, the third three.
        assert_eq!(missing(0, 1), (vec![0], vec![0, 1]));
        assert_eq!(missing(0, 2), (vec![0, 1], vec![0, 1, 2, 3]));
        assert_eq!(missing(4, 1), (vec![4], vec![]));
        assert_eq!(missing(4, 3), (vec![3, 4, 5], vec![4, 5, 6, 7]));
        assert_eq!(missing(4, 100).0.len(), 5);
        assert_eq!(missing(4, 0).0, [4]);
        // Of four views one goes.
        let mut few = map.clone();
        few.poses[4..].fill(None);
        assert_eq!(
            without_part(&problem, &few, 1, 9)
                .poses
                .iter()
                .flatten()
                .count(),
            3
        );
    }

    /// A view is drawn as often as its share of the squares is, whatever its place.
    #[test]
    fn views_are_drawn_by_their_misfit() {
        let map = Map {
            poses: (0..3).map(|_| Some(pose(0.0, 0.0, 0.0))).collect(),
            landmarks: vec![Some(Point2::new(1.0, 0.0))],
        };
        // Residuals of 1, 0 and 3.
        let problem = Problem::dense(3, 1, &[0.1, 0.0, 0.3], 0.1).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut times = [0; 3];
        for _ in 0..1000 {
            times[drawn_by_misfit(&problem, &map, &mut random).unwrap()] += 1;
        }
        assert!(times[1] == 0 && (70..130).contains(&times[0]), "{times:?}");
        let nothing = Problem::new(3, 1, &[]).unwrap();
        assert_eq!(drawn_by_misfit(&nothing, &map, &mut random), None);
    }
}
