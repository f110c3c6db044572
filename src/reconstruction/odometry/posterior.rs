// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maximum a posteriori: bearings with odometry and priors, from several starts.
//!
//! One start grows along the odometry and from priors; another is the map from bearings alone, aligned to
//! odometry and priors. The lower cost wins: the result is never worse than without the odometry.
//! Where outliers are expected the first start is a robust one, and the search from bearings alone, whose work is
//! quadratic in the views, is skipped where it could place only a few of many views.

use super::super::attempt::recoverable;
use super::super::infinity::drop_landmarks_at_infinity;
use super::super::judge::{is_plausible_consensus, is_plausible_posterior, refuse_minority};
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::result::Reconstruction;
use super::super::robust::solve::solve_robust;
use super::super::strategy;
use super::growth::grow_along_odometry;
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
        let growth = &stages.odometry_growth;
        let grown = grow_along_odometry(problem, &mut placement, growth, attempts.progress)?;
        if let Some(start) = grown.first() {
            attempts.refine_fitted(start)?;
        }
        starts.extend(grown);
    }
    let hopeless = options.robust && many && !robust_start::is_searchable(problem, &stages.robust);
    if !(attempts.suffice() || hopeless) {
        attempts.refine_from_bearings()?;
    }
    let rank = |found: &Reconstruction| (found.undetermined.len(), found.cost);
    attempts.found.sort_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    attempts.found.truncate(1);
    if attempts.found.is_empty() {
        return Err(attempts.failure);
    }
    if options.robust {
        refuse_minority(&attempts.found[0], &stages.judge)?;
    }
    // Starts that share no view with the maps so far give components of their own.
    for start in &starts {
        if attempts
            .found
            .iter()
            .all(|found| are_apart(&found.map, start))
        {
            attempts.refine_fitted(start)?;
        }
    }
    let mut maps = attempts.found;
    if !options.robust {
        maps.iter_mut()
            .for_each(|map| drop_landmarks_at_infinity(problem, map, &stages.infinity));
    }
    strategy::with_components(problem, maps).ok_or(NOTHING)
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

    /// Refines a start after aligning it as a whole to odometry and priors.
    fn refine_fitted(&mut self, start: &Map) -> Result<(), Error> {
        let start = aligned_to_priors(self.problem, start);
        self.refine(&start)
    }

    /// Refines a start and keeps the result.
    fn refine(&mut self, start: &Map) -> Result<(), Error> {
        if self.options.robust {
            let found = robust_start::from_start(self.problem, start, self.options, self.progress)?;
            self.found.extend(found);
            return Ok(());
        }
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
            Ok(report) => {
                let found = Reconstruction::new(self.problem, &map, report);
                self.found.push(found);
            }
            Err(error) => self.failure = error,
        }
        Ok(())
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
