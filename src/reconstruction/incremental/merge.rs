// SPDX-License-Identifier: MIT OR Apache-2.0
//! Choice of the best of several maps, and merging of maps that share landmarks.

use super::super::judge::{is_as_good, is_excess_plausible, variance};
use super::super::options::{Progress, SolveOptions};
use super::super::result::Reconstruction;
use super::complete::finish;
use super::gates::rounding;
use super::join::merged;
use super::options::IncrementalOptions;
use crate::error::Error;
use crate::problem::Problem;
use alloc::vec;
use alloc::vec::Vec;

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

/// Two maps merged and refined; `None` when nothing ties them or they do not fit.
fn joined(
    problem: &Problem,
    options: &SolveOptions,
    [first, second]: [&Reconstruction; 2],
    free: &[bool],
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let stage = &options.stages.incremental;
    for start in merged(problem, stage, &first.map, &second.map) {
        let joined = finish(problem, options, start, free, progress)?;
        if let Some(joined) = joined
            && belong_together(problem, stage, [first, second], &joined)
        {
            return Ok(Some(joined));
        }
    }
    Ok(None)
}

/// Whether a map fits as well as the two that it was merged from, per degree of freedom, and what ties them is no worse
/// than what either explains.
fn belong_together(
    problem: &Problem,
    options: &IncrementalOptions,
    [first, second]: [&Reconstruction; 2],
    joined: &Reconstruction,
) -> bool {
    let own = first.freedom + second.freedom;
    let apart = 2.0 * (first.cost + second.cost);
    let rounding = rounding(problem);
    let noise = apart / own.max(1) as f64;
    let added = joined.freedom.saturating_sub(own);
    let excess = 2.0 * joined.cost - apart;
    is_as_good(variance(joined), noise, options.fitting_ratio, rounding)
        && is_excess_plausible(problem, excess, added, noise, options.joining_deviations)
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

    /// Two maps belong together when the joined map fits as well, and what ties them no worse than the noise allows.
    #[test]
    fn maps_belong_together_up_to_the_noise_of_their_ties() {
        let scene = simulate(Layout::Enclosed, 5, 9, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(5, 9, &scene.bearings, 0.01).unwrap();
        let mut map = scene.map();
        let report = refine_map(&problem, &mut map, &RefineOptions::default(), None).unwrap();
        let whole = Reconstruction::new(&problem, &map, report);
        let with = |freedom: usize, cost: f64| {
            let mut found = whole.clone();
            (found.freedom, found.cost) = (freedom, cost);
            found
        };
        let options = IncrementalOptions::default();
        // Unit variance each; the ties add eight degrees of freedom.
        let (first, second) = (with(60, 30.0), with(32, 16.0));
        let most = 8.0 + 5.0 * 4.0 + 25.0;
        for (excess, belong) in [(0.0, true), (0.99 * most, true), (1.01 * most, false)] {
            let joined = with(100, 46.0 + 0.5 * excess);
            assert_eq!(
                belong_together(&problem, &options, [&first, &second], &joined),
                belong
            );
        }
        // Many ties may be worse than the maps, but not by more than twice the residuals.
        let fits = IncrementalOptions {
            joining_deviations: 1e3,
            ..options
        };
        for (variance, belong) in [(3.99, true), (4.01, false)] {
            let joined = with(100, 50.0 * variance);
            assert_eq!(
                belong_together(&problem, &fits, [&first, &second], &joined),
                belong
            );
        }
    }

    /// Of three maps the two that share landmarks are merged, whichever comes first; the largest comes first then.
    #[test]
    fn maps_that_share_landmarks_are_merged_in_any_order() {
        let sigma = 0.003;
        let scene = simulate(Layout::Enclosed, 9, 16, sigma, 3, Arena::default()).unwrap();
        let mut bearings = scene.bearings.clone();
        // The first three views see the last six landmarks, the others the first ten.
        for (view, seen) in bearings.chunks_exact_mut(16).enumerate() {
            let unseen = if view < 3 { 0..10 } else { 10..16 };
            seen[unseen].fill(f64::NAN);
        }
        let problem = Problem::dense(9, 16, &bearings, sigma).unwrap();
        let options = SolveOptions::default();
        let of_views = |views: core::ops::Range<usize>| {
            let mut map = scene.map();
            for view in (0..9).filter(|view| !views.contains(view)) {
                map.poses[view] = None;
            }
            let report = refine_map(&problem, &mut map, &options.refine, None).unwrap();
            Reconstruction::new(&problem, &map, report)
        };
        let parts = [of_views(0..3), of_views(3..6), of_views(6..9)];
        for order in [[0, 1, 2], [1, 0, 2], [1, 2, 0], [2, 0, 1]] {
            let found = order.map(|k: usize| parts[k].clone()).to_vec();
            let found = merge(&problem, &options, found, &mut None).unwrap();
            assert_eq!(
                found.iter().map(views).collect::<Vec<_>>(),
                [6, 3],
                "{order:?}"
            );
            assert!(found[0].map.poses[3..].iter().all(Option::is_some));
            assert_eq!(found[0].freedom, 60 + 4 - 18 - 20);
        }
    }
}
