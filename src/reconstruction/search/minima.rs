// SPDX-License-Identifier: MIT OR Apache-2.0
//! Refinement of hypotheses to minima: which are refined, for how long, and when the search ends.
//!
//! A hypothesis in the basin of a good minimum converges in a few iterations; what has not converged by then is in
//! the basin of a bad one or poorly determined. So all candidates get a few iterations, and the best of those that
//! have not converged get more. The search ends when a minimum is as low as the noise predicts, or two triples of
//! views have led to it.

use super::super::attempt::recoverable;
use super::super::choice::{SAME_COST, same};
use super::super::judge::{is_plausible, variance};
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::result::Reconstruction;
use super::super::stages::StageOptions;
use super::four_landmarks::{along_wall, twin};
use super::hypotheses::Hypothesis;
use super::moves::moved_maps;
use super::options::MoveOptions;
use crate::adjustment::refine_map;
use crate::error::{Degeneracy, Error};
use crate::lm::{RefineOptions, Termination};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// Minima found so far, and candidates that have not converged.
pub struct Minima<'a, 'p> {
    problem: &'a Problem,
    refine: &'a RefineOptions,
    stages: &'a StageOptions,
    pub progress: &'a mut Option<Progress<'p>>,
    /// With the index of the triple that each comes from.
    minima: Vec<(Reconstruction, usize)>,
    unfinished: Vec<(Reconstruction, usize)>,
    /// The error of the last refinement that failed.
    failure: Option<Error>,
}

impl<'a, 'p> Minima<'a, 'p> {
    pub fn new(
        problem: &'a Problem,
        options: &'a SolveOptions,
        progress: &'a mut Option<Progress<'p>>,
    ) -> Self {
        Self {
            problem,
            refine: &options.refine,
            stages: &options.stages,
            progress,
            minima: Vec::new(),
            unfinished: Vec::new(),
            failure: None,
        }
    }

    /// Adds a minimum that is known.
    pub fn add(&mut self, found: Reconstruction) {
        self.minima.push((found, usize::MAX));
    }

    /// Gives each hypothesis a few iterations; with `stop`, until a minimum is beyond doubt. Returns
    /// whether one is.
    ///
    /// # Errors
    /// [`Error::Interrupted`] and [`Error::OutOfMemory`].
    pub fn try_out(
        &mut self,
        hypotheses: impl ExactSizeIterator<Item = Hypothesis>,
        stop: bool,
    ) -> Result<bool, Error> {
        let total = hypotheses.len();
        let first = self
            .refine
            .max_iterations
            .min(self.stages.minima.first_iterations);
        for (done, Hypothesis { map, triple }) in hypotheses.enumerate() {
            let Some(found) = self.refine(map, first, 0, (done, total))? else {
                continue;
            };
            if found.termination == Termination::MaxIterations {
                self.unfinished.push((found, triple));
                continue;
            }
            let beyond_doubt =
                stop && (is_plausible(&found, &self.stages.judge) || self.confirms(&found, triple));
            self.minima.push((found, triple));
            if beyond_doubt {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether a minimum is the lowest known, and another triple has led to it before.
    fn confirms(&self, found: &Reconstruction, triple: usize) -> bool {
        let judge = &self.stages.judge;
        let mut others = self.minima.iter();
        others
            .clone()
            .all(|(other, _)| other.cost >= found.cost * SAME_COST)
            && others.any(|(other, from)| *from != triple && same(&other.map, &found.map, judge))
    }

    /// Refines the best unfinished candidates to their minima, until one is beyond doubt; returns whether one
    /// is. With `all`, refines every candidate that may be as good as the best minimum.
    ///
    /// # Errors
    /// As [`Minima::try_out`].
    pub fn finish(&mut self, all: bool) -> Result<bool, Error> {
        let mut unfinished = core::mem::take(&mut self.unfinished);
        unfinished.sort_by(|a, b| a.0.cost.total_cmp(&b.0.cost));
        let total = if all {
            unfinished.len()
        } else {
            self.stages.minima.max_finished
        };
        let mut done = 0;
        for (found, triple) in unfinished {
            // Exact bearings may have several exact maps.
            let hopeless = self.minima.iter().any(|(other, _)| {
                other.termination != Termination::ZeroResidual
                    && found.cost > other.cost * self.stages.minima.hopeless_ratio
            });
            if hopeless {
                continue;
            }
            if done == total {
                self.unfinished.push((found, triple));
                continue;
            }
            let used = found.iterations;
            let most = self.stages.minima.finished_iterations;
            let left = self.refine.max_iterations.min(most).saturating_sub(used);
            if let Some(found) = self.refine(found.map, left, used, (done, total))? {
                let beyond_doubt = !all
                    && found.freedom >= self.stages.minima.sure_freedom
                    && (is_plausible(&found, &self.stages.judge) || self.confirms(&found, triple));
                self.minima.push((found, triple));
                if beyond_doubt {
                    return Ok(true);
                }
            }
            done += 1;
        }
        Ok(false)
    }

    /// Tries the family of a wall from the best minimum of four landmarks.
    ///
    /// # Errors
    /// As [`Minima::try_out`].
    pub fn follow_wall(&mut self) -> Result<(), Error> {
        let best = self.lowest();
        let maps = best.map_or(Vec::new(), |best| along_wall(self.problem, &best.map));
        let triple = usize::MAX;
        let starts = maps.into_iter().map(|map| Hypothesis { map, triple });
        self.try_out(starts, false)?;
        self.finish(true)?;
        // What has not converged is somewhere in the valley of a minimum that has.
        let least = self.lowest().map_or(0.0, |best| best.cost);
        let is_minimum = |found: &Reconstruction| found.termination.was_successful();
        self.minima
            .retain(|(found, _)| is_minimum(found) || found.cost <= least);
        Ok(())
    }

    /// Adds the twin of the best minimum of four landmarks, which has the same cost unless bearings tell directions.
    ///
    /// # Errors
    /// As [`Minima::try_out`].
    pub fn add_twin(&mut self) -> Result<(), Error> {
        let twin = self.lowest().and_then(|best| twin(self.problem, &best.map));
        if let Some(map) = twin {
            let most = self.stages.minima.finished_iterations;
            let iterations = self.refine.max_iterations.min(most);
            if let Some(found) = self.refine(map, iterations, 0, (0, 1))? {
                self.add(found);
            }
        }
        Ok(())
    }

    /// The minimum of least cost.
    fn lowest(&self) -> Option<&Reconstruction> {
        let minima = self.minima.iter().map(|(found, _)| found);
        minima.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// Whether one of the minima explains the bearings to rounding.
    pub fn has_exact(&self) -> bool {
        self.minima
            .iter()
            .any(|(found, _)| found.termination == Termination::ZeroResidual)
    }

    /// Tries single landmarks and views of the best minimum in other places, as long as that lowers the cost.
    ///
    /// # Errors
    /// As [`Minima::try_out`].
    pub fn try_moves(&mut self, options: &MoveOptions) -> Result<(), Error> {
        let known = self.minima.len();
        for _ in 0..options.rounds {
            let Some(best) = self.lowest() else { break };
            if best.freedom == 0 || best.termination == Termination::ZeroResidual {
                break;
            }
            let cost = best.cost;
            let variance = variance(best);
            let maps = moved_maps(
                self.problem,
                &best.map,
                variance,
                [options.tried; 2],
                options,
            );
            let total = maps.len();
            let mut lower = false;
            for (done, map) in maps.into_iter().enumerate() {
                let iterations = self.refine.max_iterations.min(options.iterations);
                let Some(found) = self.refine(map, iterations, 0, (done, total))? else {
                    continue;
                };
                let is_lower = found.cost < cost * SAME_COST;
                lower |= is_lower;
                if is_lower || found.termination.was_successful() {
                    self.add(found);
                }
            }
            if !lower {
                break;
            }
        }
        // What is no minimum was only on the way to a lower one.
        let least = self.lowest().map_or(0.0, |best| best.cost);
        let moved = self.minima.split_off(known.min(self.minima.len()));
        let counts =
            |found: &Reconstruction| found.termination.was_successful() || found.cost <= least;
        self.minima
            .extend(moved.into_iter().filter(|(found, _)| counts(found)));
        Ok(())
    }

    /// The minima, or why there are none.
    ///
    /// # Errors
    /// Those of [`refine_map`] for the last start, when none could be refined.
    pub fn into_found(self) -> Result<Vec<Reconstruction>, Error> {
        match self.failure {
            // It would speak of a start, of which the caller knows nothing.
            Some(Error::TooFew { .. }) if self.minima.is_empty() => Err(Error::Degenerate {
                kind: Degeneracy::NoHypothesis,
                value: 0.0,
                bound: 1.0,
            }),
            Some(error) if self.minima.is_empty() => Err(error),
            _ => Ok(self.minima.into_iter().map(|(found, _)| found).collect()),
        }
    }

    /// Refines a map; `None` when it cannot be.
    fn refine(
        &mut self,
        mut map: Map,
        max_iterations: usize,
        used: usize,
        (done, total): (usize, usize),
    ) -> Result<Option<Reconstruction>, Error> {
        let options = RefineOptions {
            max_iterations,
            ..*self.refine
        };
        let mut observer = |_, _| report_progress(self.progress, "refine", done, total);
        let refined = refine_map(self.problem, &mut map, &options, Some(&mut observer));
        match recoverable(refined)? {
            Ok(mut report) => {
                report.iterations += used;
                Ok(Some(Reconstruction::new(self.problem, &map, report)))
            }
            Err(error) => {
                self.failure = Some(error);
                Ok(None)
            }
        }
    }
}
