// SPDX-License-Identifier: MIT OR Apache-2.0
//! Levenberg-Marquardt: damping, acceptance and the end of the descent, whatever system gives the steps.

use super::bundle::{Bundle, Rows};
use super::refine::Watch;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::{RefineOptions, Termination};
use crate::problem::Problem;

/// What proposes steps.
pub trait System {
    /// Solves for the step at a damping and writes the bundle after it into `result`.
    ///
    /// Returns by how much the model of the system expects the cost to fall; `None` when it is not
    /// positive definite.
    fn step(
        &mut self,
        bundle: &Bundle,
        rows: &Rows,
        damping: f64,
        result: &mut Bundle,
    ) -> Option<f64>;

    /// Whether a landmark may be put onto its rays after a step.
    fn settles(&self, _landmark: usize) -> bool {
        true
    }

    /// Whether damping keeps away from where it has just been refused: in a long valley every other step would
    /// be wasted there.
    fn remembers(&self) -> bool {
        false
    }

    /// Whether the descent is to pause here, for a change of the system.
    fn pauses(&mut self, _bundle: &Bundle, _rows: &Rows, _cost: f64) -> bool {
        false
    }
}

/// Why a descent came to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rest {
    /// It is over.
    Ended(Termination),
    /// The system has asked for a pause.
    Paused,
}

/// A bundle on its way to the minimum.
pub struct Descent<'a, 'w> {
    pub problem: &'a Problem,
    pub options: &'a RefineOptions,
    pub bundle: Bundle,
    /// The bundle linearised.
    pub rows: Rows,
    pub cost: f64,
    /// Linear systems solved.
    pub iterations: usize,
    watch: Option<Watch<'w>>,
    trial: Bundle,
    trial_rows: Rows,
}

impl<'a, 'w> Descent<'a, 'w> {
    /// # Errors
    /// [`Error::NotFinite`] when a residual of the start is not finite.
    pub fn new(
        problem: &'a Problem,
        options: &'a RefineOptions,
        watch: Option<Watch<'w>>,
        bundle: Bundle,
    ) -> Result<Self, Error> {
        let mut rows = Rows::of(problem);
        let cost = bundle.linearize(problem, options.loss, &mut rows);
        if !cost.is_finite() {
            return Err(Error::NotFinite {
                what: "residuals of the start",
                index: rows
                    .sightings
                    .iter()
                    .position(|row| !row.residual.is_finite())
                    .unwrap_or(0),
            });
        }
        Ok(Self {
            problem,
            options,
            watch,
            trial: bundle.clone(),
            bundle,
            trial_rows: Rows::of(problem),
            rows,
            cost,
            iterations: 0,
        })
    }

    /// Takes note that the bundle has been moved by other means.
    pub fn relinearize(&mut self) {
        let loss = self.options.loss;
        self.cost = self.bundle.linearize(self.problem, loss, &mut self.rows);
    }

    /// Descends until it ends, the system asks for a pause, or the iterations in all reach `limit`.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when the watch says so.
    pub fn run(&mut self, system: &mut impl System, limit: usize) -> Result<Rest, Error> {
        let zero = self.rounding();
        let tolerance = self.options.tolerance;
        let loss = self.options.loss;
        let mut damping = self.options.damping;
        let mut last_gain = 0.0;
        // The damping at which the last step was refused, for a system that remembers.
        let mut refused = 0.0;
        loop {
            if self.cost <= zero {
                return Ok(Rest::Ended(Termination::ZeroResidual));
            }
            if self.iterations == limit {
                return Ok(Rest::Ended(Termination::MaxIterations));
            }
            if let Some(watch) = &mut self.watch
                && !watch(self.iterations, self.cost)
            {
                return Err(Error::Interrupted);
            }
            self.iterations += 1;
            let mut lower = None;
            let predicted = system.step(&self.bundle, &self.rows, damping, &mut self.trial);
            if let Some(predicted) = predicted {
                for landmark in 0..self.trial.landmarks.len() {
                    if system.settles(landmark) {
                        self.trial.optimize_landmark(self.problem, loss, landmark);
                    }
                }
                let cost = self
                    .trial
                    .linearize(self.problem, loss, &mut self.trial_rows);
                if cost < self.cost {
                    lower = Some((self.cost - cost, predicted));
                    self.cost = cost;
                    core::mem::swap(&mut self.bundle, &mut self.trial);
                    core::mem::swap(&mut self.rows, &mut self.trial_rows);
                } else if predicted <= tolerance * self.cost {
                    return Ok(Rest::Ended(Termination::Converged));
                }
            } else if damping <= 0.0 {
                return Ok(Rest::Ended(Termination::Singular));
            }
            if let Some((gained, predicted)) = lower {
                // Near the minimum each gain is a small, shrinking part of the one before: what is
                // left to gain is at most the next one.
                let rate = gained / last_gain;
                let left = if rate < CONVERGING {
                    gained * rate
                } else {
                    gained
                };
                // Gains that grow as the damping falls are those of a direction it still holds back.
                if left <= tolerance * self.cost && gained <= last_gain {
                    return Ok(Rest::Ended(Termination::Converged));
                }
                if system.pauses(&self.bundle, &self.rows, self.cost) {
                    return Ok(Rest::Paused);
                }
                last_gain = gained;
                let ratio = gained / predicted;
                if ratio > 0.75 {
                    let less = damping * 0.1;
                    if less > refused {
                        damping = less;
                    } else {
                        damping = (damping * refused).sqrt();
                        refused *= FORGET;
                    }
                } else if ratio < 0.25 {
                    damping *= 4.0;
                }
            } else {
                if damping <= 0.0 || damping > MAX_DAMPING {
                    return Ok(Rest::Ended(Termination::NoProgress));
                }
                if system.remembers() {
                    refused = damping;
                }
                damping = (damping * 10.0).max(1e-5);
            }
        }
    }

    /// The cost of residuals that are rounding.
    fn rounding(&self) -> f64 {
        let rounding = ZERO_RESIDUAL_EPS * f64::EPSILON;
        let squares = self.rows.sightings.iter().fold(0.0, |sum, row| {
            sum + (row.weight * rounding) * (row.weight * rounding)
        });
        squares * 0.5
    }
}

/// Ratio of successive gains below which the next one is foreseen.
const CONVERGING: f64 = 0.05;

/// What is left of the refused damping once one between has been chosen: the next steps may need less.
const FORGET: f64 = 0.3;

/// Damping beyond which a step is too small to be one.
const MAX_DAMPING: f64 = 1e8;

/// Residuals of this many units of rounding are zero.
const ZERO_RESIDUAL_EPS: f64 = 8.0;
