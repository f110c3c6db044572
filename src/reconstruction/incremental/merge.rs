// SPDX-License-Identifier: MIT OR Apache-2.0
//! Choice of the best of several maps, and merging of maps that share landmarks.

use super::super::judge::{is_as_good, variance};
use super::super::options::{Progress, SolveOptions};
use super::super::result::Reconstruction;
use super::complete::finish;
use super::gates::{noise, range_variance, rounding};
use super::options::IncrementalOptions;
use crate::error::Error;
use crate::geometry::{align, transform_pose};
use crate::problem::{Map, Problem};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::Point2;

/// Number of views in a map.
pub fn views(found: &Reconstruction) -> usize {
    found.map.poses.iter().flatten().count()
}

/// Of the maps that fit about as well as the best, the one that leaves least undetermined, then the lowest cost.
pub fn best(
    problem: &Problem,
    options: &IncrementalOptions,
    found: Vec<Reconstruction>,
) -> Option<Reconstruction> {
    let least = found.iter().map(variance).fold(f64::INFINITY, f64::min);
    let rounding = rounding(problem);
    found.into_iter().min_by(|a, b| {
        let misfits = |found: &Reconstruction| {
            !is_as_good(variance(found), least, options.fitting_ratio, rounding)
        };
        misfits(a)
            .cmp(&misfits(b))
            .then(a.undetermined.len().cmp(&b.undetermined.len()))
            .then(a.cost.total_cmp(&b.cost))
    })
}

/// Merges maps that share landmarks; returns the largest first.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`].
pub fn merge(
    problem: &Problem,
    options: &SolveOptions,
    mut found: Vec<Reconstruction>,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction>, Error> {
    // Views in no map yet may be placed in a merged one.
    let mut free = vec![true; problem.views()];
    for map in &found {
        for (free, pose) in free.iter_mut().zip(&map.map.poses) {
            *free &= pose.is_none();
        }
    }
    let (mut a, mut b) = (0, 1);
    while b < found.len() {
        if let Some(joined) = joined(problem, options, [&found[a], &found[b]], &free, progress)? {
            for (free, pose) in free.iter_mut().zip(&joined.map.poses) {
                *free &= pose.is_none();
            }
            found[a] = joined;
            found.remove(b);
            (a, b) = (0, 1);
        } else if b + 1 < found.len() {
            b += 1;
        } else {
            (a, b) = (a + 1, a + 2);
        }
    }
    found.sort_by_key(|found| core::cmp::Reverse(views(found)));
    Ok(found)
}

/// Two maps merged and refined; `None` when they share too few landmarks or do not fit.
fn joined(
    problem: &Problem,
    options: &SolveOptions,
    [first, second]: [&Reconstruction; 2],
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let stage = &options.stages.incremental;
    let Some(start) = merged(problem, stage, &first.map, &second.map) else {
        return Ok(None);
    };
    let Some(joined) = finish(problem, options, start, free, progress)? else {
        return Ok(None);
    };
    // They belong together when the merged map fits as well as the two apart, per degree of freedom.
    let freedom = (first.freedom + second.freedom).max(1) as f64;
    let apart = 2.0 * (first.cost + second.cost) / freedom;
    let fits = is_as_good(
        variance(&joined),
        apart,
        stage.fitting_ratio,
        rounding(problem),
    );
    Ok(fits.then_some(joined))
}

/// The first map extended by what only the second has, moved by the similarity that fits their shared
/// landmarks best; `None` when they share fewer than two well-determined ones.
///
/// Two shared landmarks determine the similarity without redundancy; the check is the cost of the refined
/// whole.
pub fn merged(
    problem: &Problem,
    options: &IncrementalOptions,
    first: &Map,
    second: &Map,
) -> Option<Map> {
    let (mut source, mut target) = (Vec::new(), Vec::new());
    let held = |map: &Map, noise: f64, landmark: usize, point: &Point2<f64>| {
        let bound = options.max_deviation / noise;
        range_variance(problem, map, landmark, point) < bound * bound
    };
    let noises = [first, second].map(|map| noise(problem, map, options));
    for landmark in 0..problem.landmarks() {
        if let (Some(a), Some(b)) = (first.landmarks[landmark], second.landmarks[landmark])
            && held(first, noises[0], landmark, &a)
            && held(second, noises[1], landmark, &b)
        {
            source.push(b);
            target.push(a);
        }
    }
    if source.len() < options.joining_landmarks {
        return None;
    }
    let similarity = align(&source, &target).ok()?;
    let mut map = first.clone();
    for (to, from) in map.poses.iter_mut().zip(&second.poses) {
        *to = to.or_else(|| from.map(|pose| transform_pose(&similarity, &pose)));
    }
    for (to, from) in map.landmarks.iter_mut().zip(&second.landmarks) {
        *to = to.or_else(|| from.map(|point| similarity.transform_point(&point)));
    }
    Some(map)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::lm::RefineOptions;
    use crate::problem::{Subject, Undetermined, Why};
    use crate::simulate::{Arena, Layout, simulate};

    /// A map that leaves less undetermined is better up to residuals twice as large; of equals the lower cost is.
    #[test]
    fn the_more_complete_map_is_best_up_to_twice_the_residuals() {
        let scene = simulate(Layout::Enclosed, 5, 9, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(5, 9, &scene.bearings, 0.01).unwrap();
        let mut map = scene.map();
        let report = refine_map(&problem, &mut map, &RefineOptions::default(), None).unwrap();
        let whole = Reconstruction::new(&problem, &map, report);
        let mut part = whole.clone();
        part.undetermined.push(Undetermined {
            subject: Subject::View(4),
            why: Why::Degenerate,
        });
        let options = IncrementalOptions::default();
        for (times, is_whole) in [(1.0_f64, true), (1.97, true), (2.03, false)] {
            let mut whole = whole.clone();
            whole.cost = part.cost * times * times;
            for found in [[part.clone(), whole.clone()], [whole, part.clone()]] {
                let chosen = best(&problem, &options, found.to_vec()).unwrap();
                assert_eq!(chosen.undetermined.is_empty(), is_whole, "{times}");
            }
        }
        let mut other = whole.clone();
        other.cost *= 1.1;
        let chosen = best(&problem, &options, Vec::from([other, whole.clone()]));
        assert_eq!(chosen.unwrap().cost, whole.cost);
    }
}
