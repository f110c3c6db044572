// SPDX-License-Identifier: MIT OR Apache-2.0
//! What solves for the steps of a bundle adjustment, and the adjustment as a problem for the Levenberg-Marquardt loop.

use super::bundle::{Bundle, Rows};
use crate::error::Error;
use crate::lm::{
    LeastSquares, Observer, Prediction, RefineOptions, Termination, Trial, minimize, rounding,
};
use crate::problem::Problem;

/// A solver for the steps of a bundle.
pub trait StepSolver {
    /// Solves for the step at a damping and writes the bundle after it into `result`.
    ///
    /// Returns what the model predicts of it; `None` when the system is not positive definite.
    fn solve(
        &mut self,
        bundle: &Bundle,
        rows: &Rows,
        damping: f64,
        result: &mut Bundle,
    ) -> Option<Prediction<f64>>;

    /// Whether a landmark may be optimised by itself after a step.
    fn moves_landmark(&self, _landmark: usize) -> bool {
        true
    }

    /// See [`LeastSquares::keeps_refused_damping`].
    fn keeps_refused_damping(&self) -> bool {
        false
    }

    /// See [`LeastSquares::wants_pause`].
    fn wants_pause(&mut self, _bundle: &Bundle, _rows: &Rows, _cost: f64) -> bool {
        false
    }
}

/// The state of a bundle adjustment.
pub struct BundleAdjustment<'a, 'w> {
    pub problem: &'a Problem,
    pub options: &'a RefineOptions,
    pub bundle: Bundle,
    /// The bundle linearised.
    pub rows: Rows,
    pub cost: f64,
    /// Linear systems solved.
    pub iterations: usize,
    observer: Option<Observer<'w>>,
    /// The bundle after a step.
    trial: Bundle,
    trial_rows: Rows,
    trial_cost: f64,
}

impl<'a, 'w> BundleAdjustment<'a, 'w> {
    /// # Errors
    /// [`Error::NotFinite`] when a residual of the start is not finite.
    pub fn new(
        problem: &'a Problem,
        options: &'a RefineOptions,
        observer: Option<Observer<'w>>,
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
            observer,
            trial: bundle.clone(),
            bundle,
            trial_rows: Rows::of(problem),
            rows,
            cost,
            trial_cost: cost,
            iterations: 0,
        })
    }

    /// Linearises the bundle again after a change other than a step.
    pub fn relinearize(&mut self) {
        let loss = self.options.loss;
        self.cost = self.bundle.linearize(self.problem, loss, &mut self.rows);
    }

    /// Descends until it terminates, the solver wants a pause, or the total number of iterations reaches `limit`.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when the observer says so.
    pub fn run(
        &mut self,
        solver: &mut impl StepSolver,
        limit: usize,
    ) -> Result<Termination, Error> {
        let before = self.iterations;
        let options = RefineOptions {
            max_iterations: limit.saturating_sub(before),
            ..*self.options
        };
        let mut observer = self.observer.take();
        let mut stepped = Stepped {
            adjustment: self,
            solver,
        };
        let outcome = minimize(&mut stepped, &options, |done, cost| {
            observer
                .as_mut()
                .is_none_or(|observer| observer(before + done, cost))
        });
        self.observer = observer;
        let outcome = outcome?;
        self.iterations += outcome.iterations;
        Ok(outcome.termination)
    }
}

/// A bundle adjustment with the solver for its steps.
struct Stepped<'s, 'a, 'w, S: StepSolver> {
    adjustment: &'s mut BundleAdjustment<'a, 'w>,
    solver: &'s mut S,
}

impl<S: StepSolver> LeastSquares<f64> for Stepped<'_, '_, '_, S> {
    fn cost(&self) -> f64 {
        self.adjustment.cost
    }

    fn try_step(&mut self, damping: f64) -> Option<Trial<f64>> {
        let at = &mut *self.adjustment;
        let predicted = self
            .solver
            .solve(&at.bundle, &at.rows, damping, &mut at.trial)?;
        let (problem, loss) = (at.problem, at.options.loss);
        for landmark in 0..at.trial.landmarks.len() {
            if self.solver.moves_landmark(landmark) {
                at.trial.optimize_landmark(problem, loss, landmark);
            }
        }
        at.trial_cost = at.trial.linearize(problem, loss, &mut at.trial_rows);
        Some(Trial {
            cost: at.trial_cost,
            predicted,
        })
    }

    fn accept(&mut self) {
        let at = &mut *self.adjustment;
        at.cost = at.trial_cost;
        core::mem::swap(&mut at.bundle, &mut at.trial);
        core::mem::swap(&mut at.rows, &mut at.trial_rows);
    }

    fn reject(&mut self) {}

    fn rounding(&self) -> f64 {
        rounding(self.adjustment.rows.sightings.iter().map(|row| row.weight))
    }

    fn keeps_refused_damping(&self) -> bool {
        self.solver.keeps_refused_damping()
    }

    fn wants_pause(&mut self) -> bool {
        let at = &*self.adjustment;
        self.solver.wants_pause(&at.bundle, &at.rows, at.cost)
    }
}
