// SPDX-License-Identifier: MIT OR Apache-2.0
//! Levenberg-Marquardt, the only minimisation loop of this crate.
//!
//! Minimises `F(z) = 1/2 |r(z)|^2`, with a robust [`Loss`](super::Loss) `1/2 sum rho(r_k^2)`. At the estimate
//! the residuals are linearised, `r(z + d) = r + J d`, and the step `d` solves the normal equations with
//! their diagonal grown by the damping `l`, (T13):
//!
//! ```text
//! (J^T J + l diag(J^T J)) d = -J^T r
//! ```
//!
//! With `l = 0` this is the Gauss-Newton step; the larger `l` is, the shorter the step and the closer to
//! steepest descent in parameters scaled by their own information, so `l` is dimensionless. It is
//! controlled by the gain ratio (T15), the actual over the predicted decrease of the cost:
//!
//! | the step | is | and the damping |
//! |---|---|---|
//! | gains more than 3/4 of the prediction | accepted | falls to a tenth |
//! | gains at least a quarter | accepted | stays |
//! | gains less | accepted | grows fourfold |
//! | gains nothing, or cannot be solved for | rejected | grows tenfold |
//!
//! The descent has converged when a gain, or the predicted next one, is below the tolerance, or when the
//! model predicts no more than that. It has not converged if a gain grows while the damping shrinks, if the
//! damping has grown, or if the model promises more of a longer step in the same direction, because the damping
//! then still limits the step. Where the damping has grown until no step gains more than rounding, it falls back to
//! where it usually begins; the descent ends without progress when none from there up gains anything.
//!
//! The loop is independent of poses, landmarks and matrices, which belong to a [`LeastSquares`] problem. It
//! uses no heap and cannot panic.
//!
//! # Reference
//! K. Madsen, H. Nielsen, O. Tingleff, "Methods for non-linear least squares problems", 2004, section 3.2.

use super::options::{
    AFTER_GOOD_STEP, AFTER_POOR_STEP, AFTER_REFUSED_STEP, CONVERGING, FORGET_REFUSED, GOOD_STEP,
    LIMITING_DAMPING, MAX_DAMPING, MIN_RAISED_DAMPING, NEAR_MINIMUM, POOR_STEP, RENEWED_DAMPING,
    RESOLVED_EPS, RefineOptions, ZERO_RESIDUAL_EPS,
};
use super::prediction::Prediction;
use super::termination::Termination;
use crate::error::Error;
use crate::scalar::Real;

/// A problem that holds an estimate, and proposes steps from it.
pub trait LeastSquares<T: Real> {
    /// The cost of the estimate.
    fn cost(&self) -> T;

    /// Solves for the step at a damping and evaluates the estimate after it, the trial.
    ///
    /// `None` when the damped normal equations are not positive definite.
    fn try_step(&mut self, damping: T) -> Option<Trial<T>>;

    /// Makes the last trial the estimate.
    fn accept(&mut self);

    /// Discards the last trial. Not called when the loop ends with it.
    fn reject(&mut self);

    /// The cost of residuals due to rounding, see [`rounding`].
    fn rounding(&self) -> T;

    /// Whether the damping avoids the value at which a step was just rejected: in a long valley every other
    /// step would be wasted there.
    fn keeps_refused_damping(&self) -> bool {
        false
    }

    /// Whether the loop must stop at the estimate just accepted, so that the caller can change the problem
    /// and continue.
    fn wants_pause(&mut self) -> bool {
        false
    }
}

/// The estimate after a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial<T: Real> {
    /// Its cost.
    pub cost: T,
    /// The decrease of the cost that the model predicts.
    pub predicted: Prediction<T>,
}

/// The result of a minimisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome<T: Real = f64> {
    /// How it ended; [`Termination::MaxIterations`] also where the problem wanted a pause.
    pub termination: Termination,
    /// Half the sum of the losses of residuals over sigma.
    pub cost: T,
    /// Linear systems solved.
    pub iterations: usize,
}

/// Descends from the estimate of a problem to a minimum of its cost.
///
/// `observer` is called before each iteration with the number of those done and the cost; `false`
/// stops the work.
///
/// # Errors
/// [`Error::BadOption`] for an option out of its range, [`Error::Interrupted`] when `observer` says so.
pub fn minimize<T: Real>(
    problem: &mut impl LeastSquares<T>,
    options: &RefineOptions<T>,
    mut observer: impl FnMut(usize, T) -> bool,
) -> Result<Outcome<T>, Error> {
    options.check()?;
    let zero = T::zero();
    let tolerance = options.tolerance;
    // Otherwise gains that end the descent are those of rounding, and say nothing of the steps.
    let resolved = tolerance > T::lit(RESOLVED_EPS) * T::eps();
    let gauss_newton = options.damping <= zero;
    // Whether damping, not the minimum, makes a step gain little.
    let is_held_back =
        |predicted: &Prediction<T>, cost: T| resolved && predicted.held_back > tolerance * cost;
    let rounding = problem.rounding();
    let mut cost = problem.cost();
    let mut iterations = 0;
    let mut damping = options.damping;
    let mut last_gain = zero;
    // The damping of the last accepted step.
    let mut last_damping = damping;
    // The damping at which the last step was rejected, for a problem that keeps it.
    let mut refused = zero;
    // The smallest damping since the last accepted step, and the cost when the damping last fell back.
    let mut least_damping = damping;
    let mut renewed_at = None;
    let termination = loop {
        if damping > T::lit(MAX_DAMPING) {
            // Steps this short gain no more than rounding, whatever longer ones would gain.
            let untried = least_damping > T::lit(RENEWED_DAMPING);
            let worth = tolerance.max(T::lit(RESOLVED_EPS) * T::eps());
            if !untried || renewed_at.is_some_and(|then| cost >= then * (T::one() - worth)) {
                break Termination::NoProgress;
            }
            damping = T::lit(RENEWED_DAMPING);
            renewed_at = Some(cost);
            refused = zero;
        }
        least_damping = least_damping.min(damping);
        if cost <= rounding {
            break Termination::ZeroResidual;
        }
        if iterations >= options.max_iterations {
            break Termination::MaxIterations;
        }
        if !observer(iterations, cost) {
            return Err(Error::Interrupted);
        }
        iterations += 1;
        match problem.try_step(damping) {
            Some(Trial {
                cost: lower,
                predicted,
            }) if lower < cost => {
                let gained = cost - lower;
                cost = lower;
                problem.accept();
                let limited = resolved && is_limited(damping, last_damping);
                last_damping = damping;
                let ratio = gained / predicted.gain;
                // Near the minimum each gain is a small and shrinking fraction of the one before, so that
                // the remaining gain is about the next one. Far from it the first gains say nothing of the last.
                let rate = gained / last_gain;
                let near = !resolved || last_gain <= T::lit(NEAR_MINIMUM) * cost;
                let left = if rate < T::lit(CONVERGING) && near {
                    gained * rate
                } else {
                    gained
                };
                // A poor step may gain little where a better one would gain much.
                let poor =
                    resolved && ratio < T::lit(POOR_STEP) && predicted.gain > tolerance * cost;
                if left <= tolerance * cost
                    && gained <= last_gain
                    && !(limited || poor || is_held_back(&predicted, cost))
                {
                    break Termination::Converged;
                }
                if problem.wants_pause() {
                    break Termination::MaxIterations;
                }
                last_gain = gained;
                if ratio > T::lit(GOOD_STEP) {
                    let less = damping * T::lit(AFTER_GOOD_STEP);
                    if less > refused {
                        damping = less;
                    } else {
                        damping = (damping * refused).sqrt();
                        refused *= T::lit(FORGET_REFUSED);
                    }
                } else if ratio < T::lit(POOR_STEP) {
                    damping *= T::lit(AFTER_POOR_STEP);
                }
                least_damping = damping;
                continue;
            }
            Some(trial)
                if trial.predicted.gain <= tolerance * cost
                    && !(resolved && is_limited(damping, last_damping))
                    && !is_held_back(&trial.predicted, cost) =>
            {
                break Termination::Converged;
            }
            Some(_) if gauss_newton => break Termination::Overshot,
            None if gauss_newton => break Termination::Singular,
            Some(_) => problem.reject(),
            None => {}
        }
        if problem.keeps_refused_damping() {
            refused = damping;
        }
        damping = (damping * T::lit(AFTER_REFUSED_STEP)).max(T::lit(MIN_RAISED_DAMPING));
    };
    Ok(Outcome {
        termination,
        cost,
        iterations,
    })
}

/// Whether the damping limits the step, so that a small gain is no sign of a minimum: it is large, or has been raised since
/// the last accepted step. A rejected step that undoes a lowering raises nothing, up to rounding.
#[inline]
fn is_limited<T: Real>(damping: T, last: T) -> bool {
    damping > T::lit(LIMITING_DAMPING) || damping > T::lit(2.0) * last
}

/// The cost of residuals due to rounding, from one over sigma of each sighting.
#[inline]
pub fn rounding<T: Real>(weights: impl Iterator<Item = T>) -> T {
    let angle = T::lit(ZERO_RESIDUAL_EPS) * T::eps();
    let squares = weights.fold(T::zero(), |sum, weight| {
        sum + (weight * angle) * (weight * angle)
    });
    squares * T::lit(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley: residuals `10 (y - x^2)` and `1 - x`.
    struct Valley {
        at: [f64; 2],
        trial: [f64; 2],
        accepted: usize,
        rejected: usize,
        pauses_after: usize,
    }

    impl Valley {
        fn residuals([x, y]: [f64; 2]) -> [f64; 2] {
            [10.0 * (y - x * x), 1.0 - x]
        }

        fn cost_at(place: [f64; 2]) -> f64 {
            let [a, b] = Self::residuals(place);
            0.5 * (a * a + b * b)
        }

        fn from(at: [f64; 2]) -> Self {
            Self {
                at,
                trial: at,
                accepted: 0,
                rejected: 0,
                pauses_after: usize::MAX,
            }
        }
    }

    impl LeastSquares<f64> for Valley {
        fn cost(&self) -> f64 {
            Self::cost_at(self.at)
        }

        fn try_step(&mut self, damping: f64) -> Option<Trial<f64>> {
            let [x, y] = self.at;
            let [a, b] = Self::residuals(self.at);
            // Rows of the Jacobian: (-20 x, 10) and (-1, 0).
            let (xx, xy, yy) = (400.0 * x * x + 1.0, -200.0 * x, 100.0);
            let (gx, gy) = (-20.0 * x * a - b, 10.0 * a);
            let (dxx, dyy) = (xx * (1.0 + damping), yy * (1.0 + damping));
            let determinant = dxx * dyy - xy * xy;
            let dx = (xy * gy - dyy * gx) / determinant;
            let dy = (xy * gx - dxx * gy) / determinant;
            self.trial = [x + dx, y + dy];
            let change = [-20.0 * x * dx + 10.0 * dy, -dx];
            let [after_a, after_b] = [a + change[0], b + change[1]];
            let left = -(change[0] * after_a + change[1] * after_b);
            let curvature = change[0] * change[0] + change[1] * change[1];
            Some(Trial {
                cost: Self::cost_at(self.trial),
                predicted: Prediction::new(left, curvature),
            })
        }

        fn accept(&mut self) {
            self.at = self.trial;
            self.accepted += 1;
        }

        fn reject(&mut self) {
            self.rejected += 1;
        }

        fn rounding(&self) -> f64 {
            rounding([1.0; 2].into_iter())
        }

        fn wants_pause(&mut self) -> bool {
            self.accepted == self.pauses_after
        }
    }

    #[test]
    fn it_follows_a_valley_to_its_end() {
        let mut valley = Valley::from([-1.2, 1.0]);
        let mut costs = [f64::INFINITY; 101];
        let observer = |iteration: usize, cost| {
            costs[iteration] = cost;
            true
        };
        let outcome = minimize(&mut valley, &RefineOptions::default(), observer).unwrap();
        assert!(outcome.termination.was_successful(), "{outcome:?}");
        assert!(outcome.cost < 1e-20 && (valley.at[0] - 1.0).abs() < 1e-9);
        assert_eq!(outcome.cost, valley.cost());
        assert!(valley.rejected > 0 && valley.accepted + valley.rejected <= outcome.iterations);
        let seen = &costs[..outcome.iterations];
        assert!(seen.windows(2).all(|pair| pair[1] <= pair[0]));
    }

    #[test]
    fn it_ends_where_it_is_told() {
        let options = RefineOptions {
            max_iterations: 3,
            ..RefineOptions::default()
        };
        let outcome = minimize(&mut Valley::from([-1.2, 1.0]), &options, |_, _| true).unwrap();
        assert_eq!(
            (outcome.termination, outcome.iterations),
            (Termination::MaxIterations, 3)
        );
        let found = minimize(&mut Valley::from([-1.2, 1.0]), &options, |done, _| done < 2);
        assert_eq!(found, Err(Error::Interrupted));

        let mut paused = Valley::from([-1.2, 1.0]);
        paused.pauses_after = 2;
        let outcome = minimize(&mut paused, &RefineOptions::default(), |_, _| true).unwrap();
        assert_eq!(paused.accepted, 2);
        assert_eq!(outcome.cost, paused.cost());

        // Already there.
        let outcome = minimize(
            &mut Valley::from([1.0, 1.0]),
            &RefineOptions::default(),
            |_, _| true,
        );
        let outcome = outcome.unwrap();
        assert_eq!(
            (outcome.termination, outcome.iterations),
            (Termination::ZeroResidual, 0)
        );
    }

    #[test]
    fn without_damping_it_is_gauss_newton() {
        // The full step from here goes up: (-1.2, 1) to (1, -3.84).
        let options = RefineOptions {
            damping: 0.0,
            ..RefineOptions::default()
        };
        let outcome = minimize(&mut Valley::from([-1.2, 1.0]), &options, |_, _| true).unwrap();
        assert_eq!(
            (outcome.termination, outcome.iterations),
            (Termination::Overshot, 1)
        );
    }

    /// Steps with given gains and predicted gains, from a cost of 1; after the last nothing changes.
    struct Script {
        cost: f64,
        steps: &'static [(f64, f64)],
        gain: f64,
        held_back: f64,
    }

    impl LeastSquares<f64> for Script {
        fn cost(&self) -> f64 {
            self.cost
        }

        fn try_step(&mut self, _: f64) -> Option<Trial<f64>> {
            let (&(gain, predicted), left) = self.steps.split_first().unwrap_or((&(0.0, 0.0), &[]));
            (self.gain, self.steps) = (gain, left);
            let predicted = Prediction {
                gain: predicted,
                held_back: self.held_back,
            };
            Some(Trial {
                cost: self.cost - gain,
                predicted,
            })
        }

        fn accept(&mut self) {
            self.cost -= self.gain;
        }

        fn reject(&mut self) {}

        fn rounding(&self) -> f64 {
            0.0
        }
    }

    fn iterations(cost: f64, steps: &'static [(f64, f64)], damping: f64) -> (Termination, usize) {
        held_back(0.0, cost, steps, damping)
    }

    /// As many, where each step leaves this much to a longer one.
    fn held_back(
        held_back: f64,
        cost: f64,
        steps: &'static [(f64, f64)],
        damping: f64,
    ) -> (Termination, usize) {
        let mut script = Script {
            cost,
            steps,
            gain: 0.0,
            held_back,
        };
        let options = RefineOptions {
            damping,
            ..RefineOptions::default()
        };
        let outcome = minimize(&mut script, &options, |_, _| true).unwrap();
        (outcome.termination, outcome.iterations)
    }

    #[test]
    fn a_small_gain_is_a_minimum_only_where_nothing_limits_the_step() {
        // Two gains, the second tiny and as predicted.
        const TWO: &[(f64, f64)] = &[(0.1, 0.1), (1e-12, 1e-12), (0.2, 0.2)];
        assert_eq!(iterations(1.0, TWO, 1e-4), (Termination::Converged, 2));
        // Under damping that limits it the next may gain much.
        assert!(iterations(1.0, TWO, 1e3).1 > 3);
        // So may a longer step in the same direction, says the model.
        assert!(held_back(1e-3, 1.0, TWO, 1e-4).1 > 3);
        // After a rejected step the damping has risen.
        const RAISED: &[(f64, f64)] = &[
            (0.1, 0.1),
            (-1.0, 0.1),
            (-1.0, 0.1),
            (1e-12, 1e-12),
            (0.2, 0.2),
        ];
        assert!(iterations(1.0, RAISED, 1e-4).1 > 5);
        const NO_MORE: &[(f64, f64)] = &[
            (0.1, 0.1),
            (-1.0, 0.1),
            (-1.0, 0.1),
            (-1.0, 1e-12),
            (0.2, 0.2),
        ];
        assert!(iterations(1.0, NO_MORE, 1e-4).1 > 5);
        // A step that gains a thousandth of what the model promises has overshot.
        const POOR: &[(f64, f64)] = &[(0.1, 0.1), (1e-11, 1e-3), (0.2, 0.2)];
        assert!(iterations(1.0, POOR, 1e-4).1 > 3);
        // Nor does the ratio of two gains tell the next, far from the minimum.
        const FAR: &[(f64, f64)] = &[(1e15, 1e15), (0.1, 0.1), (0.2, 0.2)];
        assert!(iterations(1e15 + 1.0, FAR, 1e-4).1 > 3);
    }

    /// A cost of which short steps gain no more than rounding: none above a damping.
    struct Rounding {
        cost: f64,
        bound: f64,
        tried: usize,
    }

    impl LeastSquares<f64> for Rounding {
        fn cost(&self) -> f64 {
            self.cost
        }

        fn try_step(&mut self, damping: f64) -> Option<Trial<f64>> {
            self.tried += 1;
            let gain = if damping < self.bound { 0.9 } else { 0.0 } * (self.cost - 1.0);
            Some(Trial {
                cost: self.cost - gain,
                predicted: Prediction::new(self.cost - 1.0, 0.0),
            })
        }

        fn accept(&mut self) {
            self.cost -= 0.9 * (self.cost - 1.0);
        }

        fn reject(&mut self) {}

        fn rounding(&self) -> f64 {
            0.0
        }
    }

    #[test]
    fn there_is_no_progress_only_where_no_damping_makes_any() {
        let ends = |damping: f64, bound: f64| {
            let mut problem = Rounding {
                cost: 10.0,
                bound,
                tried: 0,
            };
            let options = RefineOptions {
                damping,
                ..RefineOptions::default()
            };
            let outcome = minimize(&mut problem, &options, |_, _| true).unwrap();
            (outcome.termination, outcome.cost, problem.tried)
        };
        for damping in [1e-4, 1.0, 1e8] {
            let (termination, cost, _) = ends(damping, 0.1);
            assert_eq!(termination, Termination::Converged);
            assert!(cost < 1.0 + 1e-6, "{damping}: {cost}");
        }
        // All from the usual damping up to the largest are tried, once.
        let (termination, cost, tried) = ends(1e6, 1e-5);
        assert_eq!((termination, cost), (Termination::NoProgress, 10.0));
        assert_eq!(tried, 3 + 13);
        assert_eq!(ends(1e-4, 1e-5).2, 13);
    }
}
