// SPDX-License-Identifier: MIT OR Apache-2.0
//! What several starts with odometry and priors lead to, completed and compared.

use super::super::attempt::{converged, recoverable};
use super::super::behind::without_landmarks_behind;
use super::super::choice::{SAME_COST, better, choose, prices};
use super::super::far_views::without_far_views;
use super::super::incremental::heading_sweep::place_by_headings;
use super::super::infinity::views_beyond_horizon;
use super::super::judge::{
    is_incomplete, is_plausible_consensus, is_plausible_posterior, is_too_costly, variance,
};
use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::result::Reconstruction;
use super::super::robust::motions::Motions;
use super::super::robust::solve::solve_robust;
use super::super::search::moves::moved_maps;
use super::super::search::options::MoveOptions;
use super::super::stages::StageOptions;
use super::super::{persist, strategy};
use super::choices::Choices;
use super::complete::complete;
use super::growth::grow_from_priors;
use super::known::Known;
use super::least_squares::LeastSquaresPlacement;
use super::ray_ends::other_ends;
use super::robust_start;
use crate::adjustment::{aligned_to_priors, refine_map};
use crate::error::Error;
use crate::lm::{Loss, RefineOptions, Termination};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// The starts refined so far and their results.
pub struct Attempts<'a, 'p> {
    pub problem: &'a Problem,
    pub options: &'a SolveOptions,
    /// Whether there are so many views that a plausible map is enough.
    pub many: bool,
    pub known: Known,
    pub motions: Motions,
    pub progress: &'a mut Option<Progress<'p>>,
    pub found: Vec<Reconstruction>,
}

impl Attempts<'_, '_> {
    /// Whether the maps so far make further starts unnecessary.
    pub fn suffice(&self) -> bool {
        let plausible = if self.options.robust {
            is_plausible_consensus
        } else {
            is_plausible_posterior
        };
        let judge = &self.options.stages.judge;
        self.many && self.found.iter().any(|found| plausible(found, judge))
    }

    /// Maps grown by least squares with a loss, and with some choices.
    pub fn grow(
        &mut self,
        seeds: &[Map],
        loss: Loss<f64>,
        choices: &mut Choices,
    ) -> Result<Vec<Map>, Error> {
        let stages = &self.options.stages;
        let refine = RefineOptions {
            loss,
            ..self.options.refine
        };
        let mut placement = LeastSquaresPlacement::new(self.problem, &refine, stages);
        grow_from_priors(
            self.problem,
            &mut placement,
            seeds,
            stages,
            choices,
            self.progress,
        )
    }

    /// The best map, or a better one that grows with other choices, where it leaves out what has sightings enough or is too
    /// costly.
    pub fn grown_otherwise(
        &mut self,
        mut best: Option<Reconstruction>,
        seeds: &[Map],
    ) -> Result<Option<Reconstruction>, Error> {
        let judge = &self.options.stages.judge;
        for k in 0..self.options.stages.posterior.regrowths {
            if best
                .as_ref()
                .is_some_and(|best| !is_incomplete(best) && !self.is_too_costly(best))
            {
                break;
            }
            let mut choices = Choices::of_seed(self.options.seed.wrapping_add(k as u64));
            let grown = self.grow(seeds, Loss::Squared, &mut choices)?;
            if let Some(start) = grown.first() {
                self.refine_fitted(start)?;
            }
            for found in core::mem::take(&mut self.found) {
                best = match best {
                    None => Some(found).filter(|found| !self.is_too_costly(found)),
                    Some(best) => Some(better(self.problem, [best, found], judge)),
                };
            }
        }
        best.map(|best| converged(self.problem, best, self.options, self.progress))
            .transpose()
    }

    /// Whether a minimum is higher than the standard deviations predict.
    fn is_too_costly(&self, found: &Reconstruction) -> bool {
        let bound = self.options.stages.judge.plausible_deviations;
        is_too_costly(self.problem, found, bound)
    }

    /// Whether all minima are.
    pub fn are_too_costly(&self) -> bool {
        self.found.iter().all(|found| self.is_too_costly(found))
    }

    /// Refines a start, moved as a whole to where odometry and priors want it.
    pub fn refine_fitted(&mut self, start: &Map) -> Result<(), Error> {
        let start = aligned_to_priors(self.problem, start);
        self.refine(&start)
    }

    /// The best of what has been found.
    pub fn take_best(&mut self) -> Result<Option<Reconstruction>, Error> {
        if self.options.robust {
            Ok(lowest(core::mem::take(&mut self.found)))
        } else {
            self.best()
        }
    }

    /// Refines a start and keeps what comes of it, completed.
    fn refine(&mut self, start: &Map) -> Result<(), Error> {
        if self.options.robust {
            let found = robust_start::from_start(self.problem, start, self.options, self.progress)?;
            self.found.extend(found);
            return Ok(());
        }
        let found = self.whole(start)?;
        self.found.extend(found);
        Ok(())
    }

    /// The minimum that a start leads to, completed.
    pub fn whole(&mut self, start: &Map) -> Result<Option<Reconstruction>, Error> {
        let first = self.options.stages.posterior.first_iterations;
        let found = self.refined(start, first)?;
        found.map(|found| self.completed(found)).transpose()
    }

    /// A map with what all that is known adds to it, as long as that makes it better. Views that are beyond its horizon are
    /// placed anew.
    fn completed(&mut self, found: Reconstruction) -> Result<Reconstruction, Error> {
        let (problem, options) = (self.problem, self.options);
        if self.many
            || views_beyond_horizon(problem, &found.map, &options.stages.infinity).is_empty()
        {
            return self.with_missing(found);
        }
        let near = without_far_views(problem, found.clone(), options, self.progress);
        let Ok(near) = recoverable(near)? else {
            return self.with_missing(found);
        };
        let near = self.with_missing(near)?;
        if near.map.has_views_of(&found.map) && !self.is_too_costly(&near) {
            Ok(near)
        } else {
            self.with_missing(found)
        }
    }

    /// A map with the views and landmarks that it lacks, as long as that makes it better.
    fn with_missing(&mut self, mut found: Reconstruction) -> Result<Reconstruction, Error> {
        let stages = &self.options.stages;
        for _ in 0..stages.posterior.completions {
            let mut map = found.map.clone();
            let (known, motions) = (&self.known, &self.motions);
            complete(self.problem, &stages.incremental, known, motions, &mut map);
            if map.determined().count() == found.map.determined().count() {
                break;
            }
            let Some(completed) = self.refined(&map, stages.posterior.first_iterations)? else {
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
        Ok(found)
    }

    /// The minimum that a start leads to in so many iterations; `None` when it cannot be refined.
    fn refined(&mut self, start: &Map, iterations: usize) -> Result<Option<Reconstruction>, Error> {
        let options = RefineOptions {
            max_iterations: self.options.refine.max_iterations.min(iterations),
            ..self.options.refine
        };
        let mut map = start.clone();
        let mut observer =
            |done, _| report_progress(self.progress, "refine", done, options.max_iterations);
        match recoverable(refine_map(
            self.problem,
            &mut map,
            &options,
            Some(&mut observer),
        ))? {
            Ok(report) => Ok(Some(Reconstruction::new(self.problem, &map, report))),
            Err(_) => Ok(None),
        }
    }

    /// The best of what has been found; those that have not converged go on before, as far as they may
    /// become the best.
    fn best(&mut self) -> Result<Option<Reconstruction>, Error> {
        let stages = &self.options.stages;
        let mut found = core::mem::take(&mut self.found);
        let prices = prices(self.problem, &found, &stages.judge);
        let least = prices.iter().copied().fold(f64::INFINITY, f64::min);
        let mut order: Vec<usize> = (0..found.len()).collect();
        order.sort_by(|&a, &b| prices[a].total_cmp(&prices[b]));
        for k in order.into_iter().take(stages.posterior.finished) {
            if prices[k] <= least * stages.judge.rival_ratio {
                found[k] = converged(self.problem, found[k].clone(), self.options, self.progress)?;
            }
        }
        if found.is_empty() {
            return Ok(None);
        }
        let mut best = choose(self.problem, found, &stages.judge)?;
        let rivals = core::mem::take(&mut best.alternatives);
        best = self.with_moves(best)?;
        if !self.many && is_incomplete(&best) {
            best = place_by_headings(self.problem, best, self.options, self.progress)?;
            best = self.completed(best)?;
        }
        let mut found = Vec::new();
        for one in core::iter::once(best).chain(rivals) {
            let (options, progress) = (self.options, &mut *self.progress);
            found.push(without_landmarks_behind(
                self.problem,
                one,
                options,
                progress,
            )?);
        }
        Ok(Some(choose(self.problem, found, &stages.judge)?))
    }

    /// A map with single landmarks in other places, as long as that makes it better: its views are held by odometry and
    /// priors.
    fn with_moves(&mut self, mut best: Reconstruction) -> Result<Reconstruction, Error> {
        let StageOptions { moves, judge, .. } = &self.options.stages;
        for _ in 0..moves.rounds {
            if best.cost == 0.0 || best.termination == Termination::ZeroResidual {
                break;
            }
            let size = best.map.size();
            let moves = MoveOptions {
                off: moves.off * size,
                away: moves.away * size,
                ..*moves
            };
            let tried = if is_too_costly(self.problem, &best, judge.costly_deviations) {
                moves.persistent_tried
            } else {
                moves.tried
            };
            let mut moved = Vec::new();
            if self.problem.views() <= self.options.stages.incremental.moved_views {
                let variance = variance(&best).max(1.0);
                moved = moved_maps(self.problem, &best.map, variance, [tried, 0], &moves);
            }
            let moved = moved.into_iter().map(|map| (map, moves.iterations));
            let ends = other_ends(self.problem, &best, size, &self.options.stages);
            let ends = ends
                .into_iter()
                .map(|map| (map, self.options.stages.posterior.first_iterations));
            let mut lower = false;
            for (map, iterations) in moved.chain(ends) {
                let found = self.refined(&map, iterations)?;
                if let Some(found) = found
                    && found.undetermined.len() <= best.undetermined.len()
                    && found.cost < best.cost * SAME_COST
                {
                    best = converged(self.problem, found, self.options, self.progress)?;
                    lower = true;
                    break;
                }
            }
            if !lower {
                break;
            }
        }
        Ok(best)
    }

    /// Refines the maps from bearings alone, aligned to odometry and priors, and also as they are: where odometry and
    /// priors have hardly any weight, that may lead to a lower cost.
    pub fn refine_from_bearings(&mut self) -> Result<(), Error> {
        let alone = self.problem.clone().bearings_only();
        let best = if self.options.robust {
            solve_robust(&alone, self.options, self.progress)
        } else if self.many {
            strategy::lowest(&alone, self.options, self.progress)
        } else {
            persist::solve(&alone, self.options, self.progress)
        };
        let best = match recoverable(best)? {
            Ok(best) => best,
            Err(_) => return Ok(()),
        };
        let rivals = core::iter::once(&best).chain(&best.alternatives);
        for map in rivals.map(|rival| &rival.map) {
            self.refine_fitted(map)?;
            self.refine(map)?;
        }
        Ok(())
    }
}

/// The map of the least truncated cost, which counts what it does not reach as outliers.
fn lowest(found: Vec<Reconstruction>) -> Option<Reconstruction> {
    found.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// Of maps that have not converged the cheapest goes on, however late it was found.
    #[test]
    fn the_cheapest_map_is_refined_to_the_end() {
        let scene = simulate(Layout::Trajectory, 8, 20, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(8, 20, &scene.bearings, 0.01).unwrap();
        let odometry = scene.odometry([0.05, 0.05, 0.02], 1).unwrap();
        let problem = problem.with_odometry(&odometry).unwrap();
        let mut options = SolveOptions::default();
        (
            options.stages.posterior.finished,
            options.stages.moves.rounds,
        ) = (1, 0);
        let mut attempts = Attempts {
            problem: &problem,
            options: &options,
            many: false,
            known: Known::of(&problem),
            motions: Motions::new(&problem),
            progress: &mut None,
            found: Vec::new(),
        };
        let mut off = scene.map();
        for pose in off.poses.iter_mut().flatten() {
            pose.translation.vector *= 1.5;
        }
        for iterations in [1, 3] {
            let found = attempts.refined(&off, iterations).unwrap().unwrap();
            assert_eq!(found.termination, Termination::MaxIterations);
            attempts.found.push(found);
        }
        // The first would not be worth it.
        attempts.found[0].cost = 100.0 * attempts.found[1].cost;
        let best = attempts.best().unwrap().unwrap();
        assert!(best.termination.was_successful(), "{}", best.termination);
    }
}
