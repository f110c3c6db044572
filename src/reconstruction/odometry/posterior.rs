// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maximum a posteriori: bearings with odometry and priors, from several starts.
//!
//! One start grows from all that is known, along the odometry and from what priors tell; another is the map from
//! bearings alone, moved to where odometry and priors want it. What each of them leads to is completed, and the best
//! wins: the result is never worse than without the odometry. Where outliers are expected the first start is one
//! that they do not spoil, and the search from bearings alone, whose work is quadratic in the views, is left out where
//! it could place only a few of many views.

use super::super::far_views::without_far_views;
use super::super::infinity::drop_landmarks_at_infinity;
use super::super::judge::{is_too_costly, refuse_minority};
use super::super::options::{Progress, SolveOptions};
use super::super::result::Reconstruction;
use super::super::robust::motions::Motions;
use super::super::robust::solve::check_sigmas;
use super::super::strategy;
use super::attempts::Attempts;
use super::choices::Choices;
use super::far_starts::far_starts;
use super::headings::maps_from_positions;
use super::known::Known;
use super::parts::{beyond, tied};
use super::robust_start;
use crate::adjustment::aligned_to_priors;
use crate::error::{Degeneracy, Error};
use crate::lm::Loss;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// Poses and landmarks of a problem with odometry or priors.
///
/// # Errors
/// As [`solve`], when no start leads to a map.
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 2.2.
pub fn solve_posterior(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let stages = &options.stages;
    let many = problem.views() > stages.posterior.many_views;
    let mut attempts = Attempts {
        problem,
        options,
        many,
        known: Known::of(problem),
        motions: Motions::new(problem),
        progress,
        found: Vec::new(),
    };
    let (known, motions) = (&attempts.known, &attempts.motions);
    let empty = Map::empty(problem.views(), problem.landmarks());
    let seeds = maps_from_positions(problem, known, motions, &empty, &stages.headings);
    let mut starts = Vec::new();
    if options.robust {
        starts = robust_start::robust_starts(problem, &seeds, options, attempts.progress)?;
        if let Some(start) = starts.first() {
            attempts.refine_fitted(start)?;
        }
    }
    // Most maps grow best with squared loss, whatever the loss of the final refinement; with a few outliers,
    // Cauchy's loss is better.
    for loss in [Loss::Squared, Loss::Cauchy(Loss::<f64>::CAUCHY)] {
        if attempts.suffice() {
            break;
        }
        let grown = attempts.grow(&seeds, loss, &mut Choices::best())?;
        if let Some(start) = grown.first() {
            attempts.refine_fitted(start)?;
        }
        starts.extend(grown);
    }
    if !options.robust
        && let Some(start) = starts.first()
    {
        let least = stages.odometry_growth.min_parallax;
        for far in far_starts(problem, start, least, &stages.posterior) {
            attempts.refine_fitted(&far)?;
        }
    }
    let hopeless = options.robust && many && !robust_start::is_searchable(problem, &stages.robust);
    if !(attempts.suffice() || hopeless) {
        attempts.refine_from_bearings()?;
    }
    if !options.robust && check_sigmas(problem).is_ok() && attempts.are_too_costly() {
        let grown = robust_start::robust_starts(problem, &seeds, options, attempts.progress)?;
        if let Some(start) = grown.first() {
            attempts.refine_fitted(start)?;
        }
        starts.extend(grown);
    }
    let best = attempts.take_best()?;
    let best = if options.robust || attempts.many {
        best
    } else {
        attempts.grown_otherwise(best, &seeds)?
    };
    let mut best = best.ok_or(NOTHING)?;
    // Views that the best does not reach, and that nothing connects to it, make maps of their own.
    let mut others: Vec<Reconstruction> = Vec::new();
    for start in &starts {
        let reached = core::iter::once(&best).chain(&others);
        let rest = beyond(start, reached.map(|found| &found.map));
        if rest.poses.iter().all(Option::is_none) {
            continue;
        }
        attempts.refine_fitted(&rest)?;
        // What fits is a map, however it lies to the others; completed, it may reach views of another.
        let bound = stages.judge.plausible_deviations;
        let found = attempts.found.drain(..);
        let found =
            found.filter(|one| rest.has_views_of(start) || !is_too_costly(problem, one, bound));
        let (apart, reaching): (Vec<_>, Vec<_>) =
            found.partition(|one| best.map.is_apart_from(&one.map));
        others.extend(apart);
        if reaching.iter().any(|one| one.map.has_views_of(&best.map)) {
            attempts.found = reaching;
            attempts.found.push(best);
            best = attempts.take_best()?.ok_or(NOTHING)?;
        }
    }
    if options.robust {
        refuse_minority(&best, &stages.judge)?;
    }
    let mut maps = Vec::from([best]);
    for other in others {
        if maps.iter().all(|map| map.map.is_apart_from(&other.map)) {
            maps.push(other);
        }
    }
    if options.robust {
        return strategy::with_components(problem, maps).ok_or(NOTHING);
    }
    let mut refine = |start: &Map| attempts.whole(&aligned_to_priors(problem, start));
    let mut maps = tied(problem, maps, stages, &mut refine)?;
    for map in &mut maps {
        drop_landmarks_at_infinity(problem, map, &stages.infinity);
        for rival in &mut map.alternatives {
            drop_landmarks_at_infinity(problem, rival, &stages.infinity);
        }
    }
    let best = strategy::with_components(problem, maps).ok_or(NOTHING)?;
    without_far_views(problem, best, options, progress)
}

/// No start has led to a map.
const NOTHING: Error = Error::Degenerate {
    kind: Degeneracy::NoStart,
    value: 0.0,
    bound: 1.0,
};
