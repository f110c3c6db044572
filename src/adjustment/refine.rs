// SPDX-License-Identifier: MIT OR Apache-2.0
//! Levenberg-Marquardt over all poses and landmarks.

use super::boundary;
use super::bundle::{Bundle, Rows};
use super::elimination::{GroupedSightings, gauge, keeps_landmarks};
use super::gauge::FixedByPriors;
use super::newton;
use super::normal_equations::Normal;
use super::prior_rows::linearize;
use super::schur::{Grouped, Schur};
use super::step_solver::{BundleAdjustment, StepSolver};
use crate::error::Error;
use crate::lm::{Loss, Observer, Prediction, RefineOptions, Termination};
use crate::problem::{Map, Problem, Undetermined};
use alloc::vec::Vec;
use nalgebra::{SVector, Vector2, Vector3};

/// Largest reduced system, in unknowns, that is solved densely: up to it that was measured to be faster.
const MAX_DENSE: usize = 600;

/// Iterations after which Gauss-Newton counts as slow and Newton's method takes over: from good starts fewer are
/// enough.
const SOON: usize = 8;

/// The summary of a refinement.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Half the sum of the losses of residuals over sigma and of the squares of odometry and priors.
    pub cost: f64,
    /// How it ended.
    pub termination: Termination,
    /// Linear systems solved.
    pub iterations: usize,
    /// Views and landmarks that had no start or too few sightings, and why.
    pub undetermined: Vec<Undetermined>,
    /// The loss that was applied to the residuals.
    pub loss: Loss,
}

/// Refines a map in place: minimises the sum of squared wrapped bearing residuals over sigma, under the loss of
/// the options, plus the squares of odometry and priors.
///
/// Views and landmarks without a value are left out, as are those that the rest does not determine; they
/// are listed in the report. The gauge is free and drifts slightly with damped steps; fix it afterwards
/// with [`Map::normalized`].
///
/// # Errors
/// [`Error::BadOption`] for an option out of its range, [`Error::LengthMismatch`] when the map is not of the problem's size, [`Error::TooFew`] when no view of the
/// start is determined, [`Error::NotFinite`] when the start is not finite, [`Error::Degenerate`] when all of it
/// is in one place, [`Error::OutOfMemory`] when the normal equations do not fit into memory,
/// [`Error::Interrupted`] when `observer` says so.
///
/// # Reference
/// B. Triggs et al., "Bundle adjustment: a modern synthesis", 2000; K. Madsen et al., "Methods for
/// non-linear least squares problems", 2004, section 3.2.
pub fn refine_map(
    problem: &Problem,
    map: &mut Map,
    options: &RefineOptions,
    observer: Option<Observer<'_>>,
) -> Result<Report, Error> {
    options.check()?;
    map.check(problem)?;
    let undetermined = map.prune(problem);
    let mut bundle = Bundle::from_map(map);
    if bundle.poses.is_empty() {
        return Err(Error::TooFew {
            what: "views of the start that see at least three of its landmarks",
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
    bundle.scale(1.0 / unit);
    bundle.bring_in();
    // Odometry and priors have a unit of length, too.
    let scaled;
    let active = if active.priors().is_empty() {
        active
    } else {
        scaled = active.scaled(1.0 / unit);
        &scaled
    };
    let mut adjustment = BundleAdjustment::new(active, options, observer, bundle)?;
    let mut termination = descend(&mut adjustment)?;
    let mut unit = unit;
    let fixed = FixedByPriors::of(active);
    for _ in 0..RESCALINGS {
        if adjustment.iterations >= options.max_iterations {
            break;
        }
        let Some(grown) = drifted(&adjustment.bundle, &fixed) else {
            break;
        };
        if active.priors().is_empty() {
            adjustment.bundle.come_home();
            adjustment.bundle.scale(1.0 / grown);
            unit *= grown;
        } else {
            let Some(frame) = fixed.frame(&adjustment.bundle) else {
                break;
            };
            adjustment.bundle.transform(&frame);
        }
        adjustment.bundle.bring_in();
        adjustment.relinearize();
        termination = descend(&mut adjustment)?;
    }
    let BundleAdjustment {
        mut bundle,
        cost,
        iterations,
        ..
    } = adjustment;
    bundle.scale(unit);
    bundle.write_to(map);
    Ok(Report {
        cost,
        termination,
        iterations,
        undetermined,
        loss: options.loss,
    })
}

/// Times that a map whose size or place has drifted is refined again in another unit.
const RESCALINGS: usize = 3;

/// Sizes of a map, and distances from its origin in sizes, beyond which digits are lost and landmarks at infinity are
/// no longer there.
const DRIFTED: f64 = 1e4;

/// The size of a map that has drifted, as the power of two in which it should go on; `None` where it has not.
///
/// Nothing holds what priors leave free of the gauge: a step along a direction that is hardly determined may enlarge a
/// map a million times, and one towards a single known position may shrink it to a point there.
fn drifted(bundle: &Bundle, fixed: &FixedByPriors) -> Option<f64> {
    if fixed.scale {
        return None;
    }
    let grown = bundle.unit().ok()?;
    let first = bundle.poses.first()?.translation.vector.amax();
    let stays = grown <= DRIFTED && grown * DRIFTED >= 1.0;
    let is_home = fixed.place() || first <= DRIFTED * grown;
    (!(stays && is_home)).then_some(grown)
}

/// Descends with the solver that suits the problem.
fn descend(adjustment: &mut BundleAdjustment<'_, '_>) -> Result<Termination, Error> {
    let problem = adjustment.problem;
    if is_sparse(problem) {
        minimize_sparse(adjustment)
    } else if keeps_landmarks(problem) {
        minimize_reduced::<3, 2>(adjustment)
    } else {
        minimize_reduced::<2, 3>(adjustment)
    }
}

/// The part of the cost that comes from odometry and priors.
pub fn cost_of_priors(problem: &Problem, map: &Map) -> f64 {
    if problem.priors().is_empty() {
        return 0.0;
    }
    let active = map.restrict(problem);
    let bundle = Bundle::from_map(map);
    let priors = active.priors().iter();
    priors.fold(0.0, |sum, prior| {
        sum + linearize(prior, &bundle.poses, &bundle.landmarks).square()
    }) * 0.5
}

/// Whether a problem is solved by the sparse normal equations of all unknowns rather than by the dense ones that
/// remain after eliminating poses or landmarks.
///
/// Odometry couples poses, which then cannot be eliminated one by one, and priors fix part of the gauge: such
/// problems are sparse. Otherwise the size decides.
pub fn is_sparse(problem: &Problem) -> bool {
    let kept = (2 * problem.landmarks()).min(3 * problem.views());
    !problem.priors().is_empty() || kept > MAX_DENSE
}

/// Minimises by the sparse normal equations.
fn minimize_sparse(adjustment: &mut BundleAdjustment<'_, '_>) -> Result<Termination, Error> {
    let mut normal = Normal::new(adjustment.problem).ok_or(Error::OutOfMemory)?;
    minimize_by(adjustment, &mut normal)
}

/// Minimises with blocks of size `E` eliminated and blocks of size `K` kept.
fn minimize_reduced<const E: usize, const K: usize>(
    adjustment: &mut BundleAdjustment<'_, '_>,
) -> Result<Termination, Error>
where
    for<'x> GroupedSightings<'x>: Grouped<E, K>,
    (Vec<SVector<f64, K>>, Vec<SVector<f64, E>>): Step,
{
    let mut reduced = Reduced {
        problem: adjustment.problem,
        schur: Schur::new(),
        step: (Vec::new(), Vec::new()),
    };
    minimize_by(adjustment, &mut reduced)
}

/// Times that a descent with odometry or priors begins anew where Newton's method has ended.
const RENEWALS: usize = 3;

/// Share of its cost by which such a descent must have lowered it to begin anew.
const WORTH: f64 = 1e-3;

/// Minimises by Gauss-Newton steps; small problems that do not converge soon, or only at a boundary, continue with
/// Newton's method for as many iterations as are affordable.
///
/// Odometry and priors may be so much sharper or weaker than bearings that a descent ends where its damping holds back
/// the weakest: it begins anew until that gains no more.
fn minimize_by(
    adjustment: &mut BundleAdjustment<'_, '_>,
    solver: &mut impl StepSolver,
) -> Result<Termination, Error> {
    let mut before = adjustment.cost;
    let (mut termination, mut by_newton) = minimize_once(adjustment, solver)?;
    if adjustment.problem.priors().is_empty() {
        return Ok(termination);
    }
    for _ in 0..RENEWALS {
        let is_lower = adjustment.cost < before * (1.0 - WORTH);
        if !(by_newton && termination.was_successful() && is_lower) {
            break;
        }
        before = adjustment.cost;
        let renewed = minimize_once(adjustment, solver)?;
        // A descent that gains nothing says no more than the one before.
        if adjustment.cost < before * (1.0 - WORTH) {
            (termination, by_newton) = renewed;
        }
    }
    Ok(termination)
}

/// A descent, and whether Newton's method has ended it.
fn minimize_once(
    adjustment: &mut BundleAdjustment<'_, '_>,
    solver: &mut impl StepSolver,
) -> Result<(Termination, bool), Error> {
    let problem = adjustment.problem;
    let limit = adjustment.options.max_iterations;
    let parameters = 3 * problem.views() + 2 * problem.landmarks();
    let small = parameters <= newton::MAX_FULL;
    let squared = adjustment.options.loss == Loss::Squared;
    let newton = small && squared && adjustment.options.damping > 0.0;
    let first = if newton {
        limit.min(adjustment.iterations + SOON)
    } else {
        limit
    };
    let affordable = limit.min(newton::affordable(parameters));
    let termination = adjustment.run(solver, first)?;
    let suits = match termination {
        Termination::MaxIterations => first < limit,
        Termination::Converged => newton && boundary::near_boundary(adjustment),
        _ => false,
    };
    if !suits {
        return Ok((termination, false));
    }
    if adjustment.iterations < affordable {
        let termination = newton::finish(adjustment, affordable)?;
        if termination != Termination::MaxIterations || affordable == limit {
            return Ok((termination, true));
        }
    } else if termination == Termination::Converged {
        return Ok((termination, false));
    }
    Ok((adjustment.run(solver, limit)?, false))
}

/// The reduced normal equations of Gauss-Newton.
struct Reduced<'a, const E: usize, const K: usize> {
    problem: &'a Problem,
    schur: Schur<E, K>,
    /// Steps of the kept and of the eliminated blocks.
    step: (Vec<SVector<f64, K>>, Vec<SVector<f64, E>>),
}

impl<const E: usize, const K: usize> StepSolver for Reduced<'_, E, K>
where
    for<'x> GroupedSightings<'x>: Grouped<E, K>,
    (Vec<SVector<f64, K>>, Vec<SVector<f64, E>>): Step,
{
    fn solve(
        &mut self,
        bundle: &Bundle,
        rows: &Rows,
        damping: f64,
        result: &mut Bundle,
    ) -> Option<Prediction<f64>> {
        let grouped = GroupedSightings {
            problem: self.problem,
            rows: &rows.sightings,
        };
        if !self.schur.factorize(&grouped, damping, &gauge::<K>(bundle)) {
            return None;
        }
        let (kept, gone) = &mut self.step;
        let predicted = self.schur.solve(&grouped, kept, gone);
        self.step.apply(bundle, result);
        Some(predicted)
    }
}

/// A step, as those of the kept and of the eliminated blocks.
trait Step {
    /// The bundle after the step.
    fn apply(&self, bundle: &Bundle, result: &mut Bundle);
}

impl Step for (Vec<Vector2<f64>>, Vec<Vector3<f64>>) {
    fn apply(&self, bundle: &Bundle, result: &mut Bundle) {
        bundle.step(&self.1, &self.0, result);
    }
}

impl Step for (Vec<Vector3<f64>>, Vec<Vector2<f64>>) {
    fn apply(&self, bundle: &Bundle, result: &mut Bundle) {
        bundle.step(&self.0, &self.1, result);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use nalgebra::Point2;

    /// A map goes on in another unit when its size is beyond ten thousand units, or one of them beyond its size, or when it
    /// is ten thousand sizes away from the origin.
    #[test]
    fn maps_that_have_grown_shrunk_or_gone_away_have_drifted() {
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)];
        let free = FixedByPriors::of(&Problem::new(1, 1, &[]).unwrap());
        let drifted_by = |factor: f64, away: (f64, f64)| {
            let mut bundle = Bundle {
                poses: square
                    .map(|(x, y)| pose(x + away.0, y + away.1, 0.3))
                    .to_vec(),
                landmarks: Vec::from([Point2::new(0.5, 0.5)]),
            };
            bundle.scale(factor);
            drifted(&bundle, &free)
        };
        let home = (0.0, 0.0);
        assert_eq!(drifted_by(1.0, home), None);
        for power in [13, -13] {
            assert_eq!(drifted_by(2.0_f64.powi(power), home), None, "{power}");
        }
        for power in [14, 40, -14, -40] {
            let factor = 2.0_f64.powi(power);
            assert_eq!(drifted_by(factor, home), Some(factor), "{power}");
        }
        for factor in [0.5, 1.0, 4.0] {
            for (x, y) in [(1.0, 0.0), (0.0, -1.0)] {
                assert_eq!(drifted_by(factor, (9e3 * x, 9e3 * y)), None);
                assert_eq!(drifted_by(factor, (1.1e4 * x, 1.1e4 * y)), Some(factor));
            }
        }
    }
}
