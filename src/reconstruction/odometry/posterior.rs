// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maximum a posteriori: bearings with odometry and priors, from several starts.
//!
//! One start grows along the odometry and from what is known; another is the map from bearings alone, moved
//! to where odometry and priors want it. The lower cost wins: the result is never worse than without the odometry.
//! Where outliers are expected the first start is one that they do not spoil, and the search from bearings alone,
//! whose work is quadratic in the views, is left out where it could place few of many views.

use super::super::infinity::take_out_unbounded;
use super::super::options::{Progress, SolveOptions, tell};
use super::super::result::Reconstruction;
use super::super::robust::solve::solve_robust;
use super::super::strategy;
use super::growth::anchored;
use super::robust_start;
use crate::adjustment::{fitted, refine_map};
use crate::error::{Degeneracy, Error};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::{Loss, RefineOptions};
use crate::problem::{Map, Problem, Undetermined, Why};
use alloc::vec::Vec;

/// Standard deviations of the cost by which that of the right map may differ from its mean.
const PLAUSIBLE: f64 = 3.0;

/// Views beyond which a plausible cost is enough: no wrong minimum of so many bearings comes so low. With
/// fewer, the map from bearings alone costs little and is always tried.
const MANY_VIEWS: usize = 40;

/// Poses and landmarks of a problem with odometry or priors.
///
/// # Errors
/// As [`solve`], when neither start comes to a map.
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 2.2.
pub fn solve_posterior(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let many = problem.views() > MANY_VIEWS;
    let mut attempts = Attempts {
        problem,
        options,
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
    // By squares most maps grow best, whatever the loss that they are refined with; where a few bearings are
    // wrong, with a loss that they do not bend.
    for loss in [Loss::Squared, Loss::Cauchy(Loss::<f64>::CAUCHY)] {
        if attempts.suffice() {
            break;
        }
        let growing = RefineOptions {
            loss,
            ..options.refine
        };
        let grown = anchored(problem, &growing, attempts.progress)?;
        if let Some(start) = grown.first() {
            attempts.refine_fitted(start)?;
        }
        starts.extend(grown);
    }
    let hopeless = options.robust && many && !robust_start::is_searchable(problem);
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
        robust_start::refuse_minority(&attempts.found[0])?;
    }
    // What the best does not reach, and nothing ties to it, makes maps of its own.
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
            .for_each(|map| take_out_unbounded(problem, map));
    }
    strategy::with_components(problem, maps).ok_or(NOTHING)
}

/// Sightings for each outlier, of which a map has at least so many: `robust` is for up to a third.
const MANY_SIGHTINGS: usize = 3;

/// No start has led to a map.
const NOTHING: Error = Error::Degenerate {
    kind: Degeneracy::NoStart,
    value: 0.0,
    bound: 1.0,
};

/// Starts that are refined, and what has come of them.
struct Attempts<'a, 'p> {
    problem: &'a Problem,
    options: &'a SolveOptions,
    progress: &'a mut Option<Progress<'p>>,
    found: Vec<Reconstruction>,
    /// Why the last one that could not be refined could not.
    failure: Error,
}

impl Attempts<'_, '_> {
    /// Whether no other start is wanted.
    fn suffice(&self) -> bool {
        let plausible = |found| is_plausible(found, self.options.robust);
        self.problem.views() > MANY_VIEWS && self.found.iter().any(plausible)
    }

    /// Refines a start, moved as a whole to where odometry and priors want it.
    fn refine_fitted(&mut self, start: &Map) -> Result<(), Error> {
        let start = fitted(self.problem, start);
        self.refine(&start)
    }

    /// Refines a start and keeps what comes of it.
    fn refine(&mut self, start: &Map) -> Result<(), Error> {
        if self.options.robust {
            let found = robust_start::from_start(self.problem, start, self.options, self.progress)?;
            self.found.extend(found);
            return Ok(());
        }
        let options = &self.options.refine;
        let mut map = start.clone();
        let mut watch = |done, _| tell(self.progress, "refine", done, options.max_iterations);
        match refine_map(self.problem, &mut map, options, Some(&mut watch)) {
            Ok(report) => {
                let found = Reconstruction::new(self.problem, &map, report);
                self.found.push(found);
                Ok(())
            }
            Err(error) => self.give_up(error),
        }
    }

    /// Refines the maps from bearings alone, fitted, and as they are as well: where odometry is worth next to
    /// nothing that may lead lower.
    fn refine_from_bearings(&mut self) -> Result<(), Error> {
        let alone = self.problem.clone().without_ties();
        let best = if self.options.robust {
            solve_robust(&alone, self.options, self.progress)
        } else {
            strategy::solve(&alone, self.options, self.progress)
        };
        let best = match best {
            Ok(best) => best,
            Err(error) => return self.give_up(error),
        };
        let rivals = core::iter::once(&best).chain(&best.alternatives);
        for map in rivals.map(|rival| &rival.map) {
            self.refine_fitted(map)?;
            self.refine(map)?;
        }
        Ok(())
    }

    /// Goes on after an error, unless it is none of the start's.
    fn give_up(&mut self, error: Error) -> Result<(), Error> {
        if error.stops_all() {
            return Err(error);
        }
        self.failure = error;
        Ok(())
    }
}

/// Whether two maps have no view in common.
fn are_apart(a: &Map, b: &Map) -> bool {
    let mut pairs = a.poses.iter().zip(&b.poses);
    pairs.all(|(a, b)| a.is_none() || b.is_none())
}

/// Whether a map is what may be expected of the right one: it reaches all that any start would, and its cost
/// is what the standard deviations say.
///
/// Where outliers are expected it is enough that they are no more than a search finds its way among: real
/// standard deviations are never exact, and many outliers tell a wrong map whatever they are.
fn is_plausible(found: &Reconstruction, robust: bool) -> bool {
    let hopeless = |one: &Undetermined| match one.why {
        // No start would reach it.
        Why::TooFewSightings { .. } => true,
        // Its sightings are among the outliers that are counted.
        Why::TooFewInliers { .. } => robust,
        _ => false,
    };
    if !(found.termination.was_successful() && found.undetermined.iter().all(hopeless)) {
        return false;
    }
    if robust {
        let outliers = found.inliers.iter().filter(|inlier| !**inlier).count();
        return MANY_SIGHTINGS * outliers <= found.inliers.len();
    }
    let freedom = found.freedom as f64;
    let excess = 2.0 * found.cost - freedom;
    excess <= 0.0_f64.max(PLAUSIBLE * (2.0 * freedom).sqrt())
}
