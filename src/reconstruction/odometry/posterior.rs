// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maximum a posteriori: bearings with odometry and priors, from several starts.
//!
//! One start grows from all that is known, along the odometry and from what priors tell; another is the map from
//! bearings alone, moved to where odometry and priors want it. What each of them leads to is completed, and the best
//! wins: the result is never worse than without the odometry. Where outliers are expected the first start is one
//! that they do not spoil, and the search from bearings alone, whose work is quadratic in the views, is left out where
//! it could place only a few of many views.

use super::super::attempt::recoverable;
use super::super::incremental::complete::place_all;
use super::super::infinity::{drop_landmarks_at_infinity, drop_misplaced};
use super::super::judge::{
    choose, is_plausible_consensus, is_plausible_posterior, prices, refuse_minority,
};
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::result::Reconstruction;
use super::super::robust::solve::{check_sigmas, solve_robust};
use super::super::strategy;
use super::growth::grow_from_priors;
use super::least_squares::LeastSquaresPlacement;
use super::robust_start;
use crate::adjustment::{aligned_to_priors, refine_map};
use crate::error::{Degeneracy, Error};
use crate::lm::{Loss, RefineOptions};
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
        progress,
        found: Vec::new(),
        failure: NOTHING,
    };
    let mut starts = Vec::new();
    if options.robust {
        starts = robust_start::along_odometry(problem, options, attempts.progress)?;
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
        let growing = RefineOptions {
            loss,
            ..options.refine
        };
        let mut placement = LeastSquaresPlacement::new(problem, &growing, stages);
        let grown = grow_from_priors(problem, &mut placement, stages, attempts.progress)?;
        if let Some(start) = grown.first() {
            attempts.refine_fitted(start)?;
        }
        starts.extend(grown);
    }
    let hopeless = options.robust && many && !robust_start::is_searchable(problem, &stages.robust);
    if !(attempts.suffice() || hopeless) {
        attempts.refine_from_bearings()?;
    }
    if !options.robust && check_sigmas(problem).is_ok() && !attempts.is_plausible() {
        let grown = robust_start::robust_starts(problem, options, attempts.progress)?;
        if let Some(start) = grown.first() {
            attempts.refine_fitted(start)?;
        }
        starts.extend(grown);
    }
    let Attempts { found, failure, .. } = &mut attempts;
    let found = core::mem::take(found);
    if found.is_empty() {
        return Err(core::mem::replace(failure, NOTHING));
    }
    let mut best = if options.robust {
        lowest(found)
    } else {
        choose(problem, found, &stages.judge)?
    };
    if options.robust {
        refuse_minority(&best, &stages.judge)?;
    } else {
        best = attempts.finish(best)?;
    }
    // Views that the best does not reach, and that nothing connects to it, make maps of their own.
    let mut maps = Vec::from([best]);
    for start in &starts {
        if maps.iter().all(|found| are_apart(&found.map, start)) {
            attempts.refine_fitted(start)?;
            maps.append(&mut attempts.found);
        }
    }
    if !options.robust {
        maps.iter_mut()
            .for_each(|map| drop_landmarks_at_infinity(problem, map, &stages.infinity));
    }
    strategy::with_components(problem, maps).ok_or(NOTHING)
}

/// The map of the least truncated cost, which counts what it does not reach as outliers, with the others that are as
/// good as its alternatives.
fn lowest(mut found: Vec<Reconstruction>) -> Reconstruction {
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    found.swap_remove(0)
}

/// No start has led to a map.
const NOTHING: Error = Error::Degenerate {
    kind: Degeneracy::NoStart,
    value: 0.0,
    bound: 1.0,
};

/// The starts refined so far and their results.
struct Attempts<'a, 'p> {
    problem: &'a Problem,
    options: &'a SolveOptions,
    /// Whether there are so many views that a plausible map is enough.
    many: bool,
    progress: &'a mut Option<Progress<'p>>,
    found: Vec<Reconstruction>,
    /// The error of the last refinement that failed.
    failure: Error,
}

impl Attempts<'_, '_> {
    /// Whether the maps so far make further starts unnecessary.
    fn suffice(&self) -> bool {
        let plausible = if self.options.robust {
            is_plausible_consensus
        } else {
            is_plausible_posterior
        };
        let judge = &self.options.stages.judge;
        self.many && self.found.iter().any(|found| plausible(found, judge))
    }

    /// Whether one of the minima is as low as the standard deviations predict.
    fn is_plausible(&self) -> bool {
        let judge = &self.options.stages.judge;
        let mut found = self.found.iter();
        found.any(|found| is_plausible_posterior(found, judge))
    }

    /// Refines a start, moved as a whole to where odometry and priors want it.
    fn refine_fitted(&mut self, start: &Map) -> Result<(), Error> {
        let start = aligned_to_priors(self.problem, start);
        self.refine(&start)
    }

    /// Refines a start and keeps what comes of it, completed.
    fn refine(&mut self, start: &Map) -> Result<(), Error> {
        if self.options.robust {
            let found = robust_start::from_start(self.problem, start, self.options, self.progress)?;
            self.found.extend(found);
            return Ok(());
        }
        let Some(mut found) = self.refined(start)? else {
            return Ok(());
        };
        let stages = &self.options.stages;
        for _ in 0..stages.posterior.completions {
            let mut map = found.map.clone();
            place_all(self.problem, &stages.incremental, &mut map);
            if map.determined().count() == found.map.determined().count() {
                break;
            }
            let Some(completed) = self.refined(&map)? else {
                break;
            };
            let both = [found, completed];
            let prices = prices(self.problem, &both, &stages.judge);
            let [before, after] = both;
            let better = prices[1] < prices[0];
            found = if better { after } else { before };
            if !better {
                break;
            }
        }
        self.found.push(found);
        Ok(())
    }

    /// The minimum that a start leads to; `None` when it cannot be refined.
    fn refined(&mut self, start: &Map) -> Result<Option<Reconstruction>, Error> {
        let options = &self.options.refine;
        let mut map = start.clone();
        let mut observer =
            |done, _| report_progress(self.progress, "refine", done, options.max_iterations);
        match recoverable(refine_map(
            self.problem,
            &mut map,
            options,
            Some(&mut observer),
        ))? {
            Ok(report) => Ok(Some(Reconstruction::new(self.problem, &map, report))),
            Err(error) => {
                self.failure = error;
                Ok(None)
            }
        }
    }

    /// Takes out of the best map what cannot be where it is, and refines the rest again.
    fn finish(&mut self, mut best: Reconstruction) -> Result<Reconstruction, Error> {
        let alternatives = core::mem::take(&mut best.alternatives);
        if let Some((map, dropped)) = drop_misplaced(self.problem, &best.map, &self.options.stages.infinity)
            && let Some(mut found) = self.refined(&map)?
        {
            found
                .undetermined
                .retain(|one| dropped.iter().all(|other| other.subject != one.subject));
            found.undetermined.extend(dropped);
            found.undetermined.sort_by_key(|one| one.subject);
            best = found;
        }
        best.alternatives = alternatives;
        Ok(best)
    }

    /// Refines the maps from bearings alone, aligned to odometry and priors, and also as they are: where odometry and
    /// priors have hardly any weight, that may lead to a lower cost.
    fn refine_from_bearings(&mut self) -> Result<(), Error> {
        let alone = self.problem.clone().bearings_only();
        let best = if self.options.robust {
            solve_robust(&alone, self.options, self.progress)
        } else {
            strategy::solve(&alone, self.options, self.progress)
        };
        let best = match recoverable(best)? {
            Ok(best) => best,
            Err(error) => {
                self.failure = error;
                return Ok(());
            }
        };
        let rivals = core::iter::once(&best).chain(&best.alternatives);
        for map in rivals.map(|rival| &rival.map) {
            self.refine_fitted(map)?;
            self.refine(map)?;
        }
        Ok(())
    }
}

/// Whether two maps have no view in common.
fn are_apart(a: &Map, b: &Map) -> bool {
    let mut pairs = a.poses.iter().zip(&b.poses);
    pairs.all(|(a, b)| a.is_none() || b.is_none())
}
