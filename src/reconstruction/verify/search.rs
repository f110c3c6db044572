// SPDX-License-Identifier: MIT OR Apache-2.0
//! The search of a cone, cell by cell, for a map of lower cost.

use super::super::attempt::recoverable;
use super::super::choice::{SAME_COST, same};
use super::super::grow::grow;
use super::super::home::{brought_back, home};
use super::super::judge::{judged, mean_weight, rounding};
use super::super::odometry::complete::Completion;
use super::super::options::{Progress, SolveOptions, goes_on, report_progress};
use super::super::result::Reconstruction;
use super::super::search::hypotheses::Hypothesis;
use super::super::search::minima::Minima;
use super::super::strategy::finished;
use super::cone::Cone;
use crate::adjustment::aligned_to_priors;
use crate::adjustment::gauge::gauge_and_prior_numbers;
use crate::error::Error;
use crate::problem::{Map, Problem};
use alloc::borrow::Cow;
use alloc::vec::Vec;
use nalgebra::Vector2;

/// A search for maps of lower cost.
pub struct ConeSearch<'a> {
    pub problem: &'a Problem,
    pub options: &'a SolveOptions,
    /// How many cells may still be searched.
    pub left: usize,
    /// Where priors are, and the problem next to the origin.
    home: Vector2<f64>,
    near: Cow<'a, Problem>,
    /// What places views and landmarks by odometry and priors, where there are any.
    completion: Option<Completion>,
}

impl<'a> ConeSearch<'a> {
    pub fn new(problem: &'a Problem, options: &'a SolveOptions) -> Self {
        let tied = !problem.priors().is_empty();
        let home = if tied {
            home(problem)
        } else {
            Vector2::zeros()
        };
        let near = if tied {
            Cow::Owned(problem.shifted(-home))
        } else {
            Cow::Borrowed(problem)
        };
        Self {
            problem,
            options,
            left: options.stages.verify.cells,
            home,
            completion: tied.then(|| Completion::of(&near)),
            near,
        }
    }

    /// The first map of lower cost that a cell leads to; `None` where none does.
    ///
    /// From the tensor at the centre of each cell both motions are grown to maps and refined, as the hypotheses of any
    /// search are. A lower map counts when it explains all that the best does and remains lower once it is finished.
    ///
    /// # Errors
    /// Those that stop everything.
    pub fn lower(
        &mut self,
        best: &Reconstruction,
        cone: &Cone,
        cells: &[[f64; 5]],
        progress: &mut Option<Progress<'_>>,
    ) -> Result<Option<Reconstruction>, Error> {
        let total = cells.len();
        // With it, what is far above it is given up.
        let mut known = best.clone();
        known.alternatives.clear();
        // What is lower, but not once it is finished.
        let mut refused: Vec<Reconstruction> = Vec::new();
        for (done, cell) in cells.iter().enumerate() {
            goes_on(progress, "verify", done, total)?;
            self.left -= 1;
            let mut told = |_: &'static str, _, _| report_progress(progress, "verify", done, total);
            let mut watch: Option<Progress<'_>> = Some(&mut told);
            let mut minima = Minima::new(&self.near, self.options, &mut watch);
            minima.add(known.clone());
            minima.try_out(self.hypotheses(cone, cell).into_iter(), false)?;
            minima.finish(true)?;
            let judge = &self.options.stages.judge;
            for found in minima.into_found()? {
                let is_refused = |other: &Reconstruction| same(&other.map, &found.map, judge);
                if !self.is_lower(&found, best) || refused.iter().any(is_refused) {
                    continue;
                }
                let finished = recoverable(self.finished(found.clone(), &mut watch))?;
                match finished {
                    Ok(finished) if self.is_lower(&finished, best) => return Ok(Some(finished)),
                    _ => refused.push(found),
                }
            }
        }
        Ok(None)
    }

    /// The maps that both motions of the tensor at the centre of a cell grow to.
    fn hypotheses(&self, cone: &Cone, cell: &[f64; 5]) -> Vec<Hypothesis> {
        let motions = cone.tensor(cell).motions(&cone.triples);
        // Without motions two views of the tensor are in one place.
        let Ok([first, second]) = motions else {
            return Vec::new();
        };
        // Of three views on a line both are the same.
        let both = first.poses != second.poses;
        let motions = core::iter::once(first).chain(both.then_some(second));
        let maps = motions.map(|motion| {
            let mut map = Map::empty(self.near.views(), self.near.landmarks());
            for (&view, pose) in cone.views.iter().zip(motion.poses) {
                map.poses[view] = Some(pose);
            }
            grow(&self.near, &mut map);
            if let Some(completion) = &self.completion {
                map = aligned_to_priors(&self.near, &map);
                completion.complete(&self.near, &self.options.stages.incremental, &mut map);
            }
            Hypothesis { map, triple: 0 }
        });
        maps.collect()
    }

    /// Whether a map costs less than the best by more than rounding, and explains all that it does.
    fn is_lower(&self, found: &Reconstruction, best: &Reconstruction) -> bool {
        let count = self.problem.sightings().len() as f64;
        let rounding = 0.5 * rounding(mean_weight(self.problem)) * count;
        let mut both = found.residuals.iter().zip(&best.residuals);
        let numbers = |found: &Reconstruction| gauge_and_prior_numbers(self.problem, &found.map).1;
        found.cost < best.cost * SAME_COST - rounding
            && both.all(|(found, best)| found.is_some() || best.is_none())
            && numbers(found) >= numbers(best)
    }

    /// A lower map refined to the end and tested, as a result of `solve` is.
    fn finished(
        &self,
        found: Reconstruction,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<Reconstruction, Error> {
        let found = finished(&self.near, self.options, found, progress)?;
        if self.completion.is_none() {
            return Ok(found);
        }
        let found = brought_back(self.problem, found, self.home, self.options, progress)?;
        judged(self.problem, found)
    }
}
