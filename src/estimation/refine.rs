// SPDX-License-Identifier: MIT OR Apache-2.0
//! Levenberg-Marquardt over all poses and landmarks.

use super::bundle::Bundle;
use super::linearized::{Linearized, gauge, keeps_landmarks};
use super::map::{Map, Undetermined};
use super::problem::Problem;
use super::schur::{Grouped, Schur};
use crate::error::Error;
use crate::scalar::Real;
use alloc::vec::Vec;
use nalgebra::{SVector, Vector2, Vector3};

/// Options of the refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefineOptions<T: Real> {
    /// Most linear systems to solve.
    pub max_iterations: usize,
    /// First damping, relative to the diagonal of the normal equations. Zero is Gauss-Newton: full
    /// steps, ending when one does not lower the cost.
    pub damping: T,
    /// Ends when a step, or the next one as foreseen from the last two, lowers the cost by less than
    /// this part of it.
    pub tolerance: T,
}

impl<T: Real> Default for RefineOptions<T> {
    fn default() -> Self {
        Self {
            max_iterations: 100,
            damping: T::lit(1e-4),
            tolerance: T::lit(1e-10).max(T::eps()),
        }
    }
}

/// How a refinement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Termination {
    /// No refinement was asked for.
    NotRefined,
    /// A further step would lower the cost by less than the tolerance.
    Converged,
    /// The residuals are zero up to rounding.
    ZeroResidual,
    /// No step lowers the cost, however much it is damped.
    NoProgress,
    /// The iterations ran out.
    MaxIterations,
    /// The normal equations are singular beyond the gauge and damping is zero.
    Singular,
}

impl Termination {
    /// Whether the result is a minimum.
    pub fn was_successful(self) -> bool {
        matches!(
            self,
            Self::Converged | Self::ZeroResidual | Self::NoProgress
        )
    }

    /// The name of the variant in lower case with underscores.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotRefined => "not_refined",
            Self::Converged => "converged",
            Self::ZeroResidual => "zero_residual",
            Self::NoProgress => "no_progress",
            Self::MaxIterations => "max_iterations",
            Self::Singular => "singular",
        }
    }
}

/// What a refinement did.
#[derive(Clone, Debug, PartialEq)]
pub struct Report<T: Real> {
    /// Half the sum of squared residuals over sigma.
    pub cost: T,
    /// How it ended.
    pub termination: Termination,
    /// Linear systems solved.
    pub iterations: usize,
    /// Views and landmarks that had no start or too few sightings, and why.
    pub undetermined: Vec<Undetermined>,
}

/// Called once per iteration with the number of iterations and the cost; `false` stops the work.
pub type Watch<'a> = &'a mut dyn FnMut(usize, f64) -> bool;

/// Largest system that is solved densely: 16384 parameters, two gigabytes.
const MAX_DENSE: usize = 1 << 14;

/// Refines a map in place: the least sum of squared wrapped bearing residuals over sigma.
///
/// Views and landmarks without a value are left out, as are those that the rest does not fix; they
/// are listed in the report. The gauge is free and drifts a little with damped steps; fix it
/// afterwards with [`Map::normalized`].
///
/// # Errors
/// [`Error::LengthMismatch`] when the map is not of the problem's size, [`Error::TooFew`] when no
/// three sightings are left, [`Error::NotFinite`] when the start is not finite,
/// [`Error::Degenerate`] when it is a single place, [`Error::TooLarge`] when the reduced system
/// exceeds 16384 unknowns, [`Error::Interrupted`] when `watch` says so.
///
/// # Reference
/// B. Triggs et al., "Bundle adjustment: a modern synthesis", 2000; K. Madsen et al., "Methods for
/// non-linear least squares problems", 2004, section 3.2.
pub fn refine_map<T: Real>(
    problem: &Problem<T>,
    map: &mut Map<T>,
    options: &RefineOptions<T>,
    watch: Option<Watch<'_>>,
) -> Result<Report<T>, Error> {
    for (what, expected, got) in [
        ("poses", problem.views(), map.poses.len()),
        ("landmarks", problem.landmarks(), map.landmarks.len()),
    ] {
        if expected != got {
            return Err(Error::LengthMismatch {
                what,
                expected,
                got,
            });
        }
    }
    let undetermined = map.prune(problem);
    let mut bundle = Bundle::from_map(map);
    if bundle.poses.is_empty() {
        return Err(Error::TooFew {
            what: "views of the start that see three landmarks of it",
            needed: 1,
            got: 0,
        });
    }
    let restricted;
    let active = if undetermined.is_empty() {
        problem
    } else {
        restricted = map.restrict(problem);
        &restricted
    };
    let unit = bundle.unit()?;
    bundle.scale(T::one() / unit);
    let (cost, termination, iterations) = if keeps_landmarks(active) {
        minimize::<T, 3, 2>(&mut bundle, active, options, watch)?
    } else {
        minimize::<T, 2, 3>(&mut bundle, active, options, watch)?
    };
    bundle.scale(unit);
    bundle.write_to(map);
    Ok(Report {
        cost,
        termination,
        iterations,
        undetermined,
    })
}

/// A step, as blocks that stay and blocks that went.
trait Step<T: Real> {
    /// The bundle after the step.
    fn apply(&self, bundle: &Bundle<T>, result: &mut Bundle<T>);
}

impl<T: Real> Step<T> for (Vec<Vector2<T>>, Vec<Vector3<T>>) {
    fn apply(&self, bundle: &Bundle<T>, result: &mut Bundle<T>) {
        bundle.step(&self.1, &self.0, result);
    }
}

impl<T: Real> Step<T> for (Vec<Vector3<T>>, Vec<Vector2<T>>) {
    fn apply(&self, bundle: &Bundle<T>, result: &mut Bundle<T>) {
        bundle.step(&self.0, &self.1, result);
    }
}

/// Levenberg-Marquardt with blocks of size `E` eliminated and blocks of size `K` kept.
///
/// Returns cost, termination and the number of linear systems solved.
fn minimize<T: Real, const E: usize, const K: usize>(
    bundle: &mut Bundle<T>,
    problem: &Problem<T>,
    options: &RefineOptions<T>,
    mut watch: Option<Watch<'_>>,
) -> Result<(T, Termination, usize), Error>
where
    for<'x> Linearized<'x, T>: Grouped<T, E, K>,
    (Vec<SVector<T, K>>, Vec<SVector<T, E>>): Step<T>,
{
    if K * kept::<T, E, K>(problem) > MAX_DENSE {
        return Err(Error::TooLarge {
            what: "unknowns of the reduced system",
            bound: MAX_DENSE,
            got: K * kept::<T, E, K>(problem),
        });
    }
    let mut rows = Vec::with_capacity(problem.sightings().len());
    let mut trial_rows = Vec::with_capacity(problem.sightings().len());
    let mut trial = bundle.clone();
    let mut schur = Schur::<T, E, K>::new();
    let mut step = (Vec::new(), Vec::new());
    let mut cost = bundle.linearize(problem, &mut rows);
    if !cost.is_finite() {
        return Err(Error::NotFinite {
            what: "residuals of the start",
            index: rows
                .iter()
                .position(|row| !row.residual.is_finite())
                .unwrap_or(0),
        });
    }
    let rounding = T::lit(ZERO_RESIDUAL_EPS) * T::eps();
    let zero = rows.iter().fold(T::zero(), |sum, row| {
        sum + (row.weight * rounding) * (row.weight * rounding)
    }) * T::lit(0.5);
    let mut damping = options.damping;
    let mut iterations = 0;
    let mut last_gain = T::zero();
    loop {
        if cost <= zero {
            return Ok((cost, Termination::ZeroResidual, iterations));
        }
        if iterations == options.max_iterations {
            return Ok((cost, Termination::MaxIterations, iterations));
        }
        if let Some(watch) = &mut watch
            && !watch(iterations, cost.as_f64())
        {
            return Err(Error::Interrupted);
        }
        iterations += 1;
        let linearized = Linearized {
            problem,
            rows: &rows,
        };
        let mut lower = None;
        if schur.factorize(&linearized, damping, &gauge::<T, K>(bundle)) {
            let predicted = cost - schur.solve(&linearized, &mut step.0, &mut step.1);
            step.apply(bundle, &mut trial);
            let trial_cost = trial.linearize(problem, &mut trial_rows);
            if trial_cost < cost {
                lower = Some((cost - trial_cost, predicted));
                cost = trial_cost;
                core::mem::swap(bundle, &mut trial);
                core::mem::swap(&mut rows, &mut trial_rows);
            } else if predicted <= options.tolerance * cost {
                return Ok((cost, Termination::Converged, iterations));
            }
        } else if damping <= T::zero() {
            return Ok((cost, Termination::Singular, iterations));
        }
        if let Some((gained, predicted)) = lower {
            // Near the minimum each gain is a small, shrinking part of the one before: what is left
            // to gain is at most the next one.
            let rate = gained / last_gain;
            let left = if rate < T::lit(CONVERGING) {
                gained * rate
            } else {
                gained
            };
            if left <= options.tolerance * cost {
                return Ok((cost, Termination::Converged, iterations));
            }
            last_gain = gained;
            let ratio = gained / predicted;
            if ratio > T::lit(0.75) {
                damping *= T::lit(0.1);
            } else if ratio < T::lit(0.25) {
                damping *= T::lit(4.0);
            }
        } else {
            if damping <= T::zero() || damping > T::lit(MAX_DAMPING) {
                return Ok((cost, Termination::NoProgress, iterations));
            }
            damping = (damping * T::lit(10.0)).max(T::lit(1e-5));
        }
    }
}

fn kept<T: Real, const E: usize, const K: usize>(problem: &Problem<T>) -> usize
where
    for<'x> Linearized<'x, T>: Grouped<T, E, K>,
{
    Linearized { problem, rows: &[] }.kept()
}

/// Ratio of successive gains below which the next one is foreseen.
const CONVERGING: f64 = 0.05;

/// Damping beyond which a step is too small to be one.
const MAX_DAMPING: f64 = 1e8;

/// Residuals of this many units of rounding are zero.
const ZERO_RESIDUAL_EPS: f64 = 8.0;
