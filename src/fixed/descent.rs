// SPDX-License-Identifier: MIT OR Apache-2.0
//! Levenberg-Marquardt over all poses and landmarks of a [`FixedMap`].

use super::row::{Around, Row, horizon, settle};
use super::{FixedMap, MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Workspace};
use crate::error::{Degeneracy, Error};
use crate::geometry::Pose;
use crate::lm::Termination;
use crate::scalar::Real;
use nalgebra::{Point2, Translation2, UnitComplex, Vector2};

/// Options of [`FixedMap::refine`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedOptions<T: Real> {
    /// Most linear systems to solve: what bounds the time.
    pub max_iterations: usize,
    /// Ends when a step, or the next one as foreseen from the last two, lowers the cost by less than
    /// this part of it.
    pub tolerance: T,
}

impl<T: Real> Default for FixedOptions<T> {
    fn default() -> Self {
        Self {
            max_iterations: 30,
            tolerance: T::lit(1e-10).max(T::eps()),
        }
    }
}

/// What a refinement did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedReport<T: Real> {
    /// Half the sum of squares of residual over sigma.
    pub cost: T,
    /// How it ended.
    pub termination: Termination,
    /// Linear systems solved.
    pub iterations: usize,
    /// Views and landmarks taken out because too few sightings hold them.
    pub dropped: usize,
}

impl<T: Real, const M: usize, const N: usize> FixedMap<T, M, N> {
    /// Refines the map in place: the least sum of squared wrapped bearing residuals over sigma.
    ///
    /// Levenberg-Marquardt with the landmarks eliminated and put back onto their rays after each step.
    /// Views that see fewer than three determined landmarks and landmarks seen by fewer than two
    /// determined views are taken out first. The gauge is free and drifts a little with damped
    /// steps; fix it afterwards with [`FixedMap::normalize`].
    ///
    /// The time is at most that of `max_iterations` iterations. One takes about `7 N M^2 + 9/2 M^3`
    /// multiplications for the step, and every sighting is linearised three times, with an arctangent
    /// each where its error exceeds 1/16 rad; `M` counts the views up to the last determined one. The
    /// stack takes about 2 kB on x86-64, whatever `M` and `N`. A landmark that maximum likelihood puts on
    /// a view or at infinity goes on towards it until the cost hardly falls or the iterations run
    /// out.
    ///
    /// # Errors
    /// [`Error::TooFew`] when no three sightings are left, [`Error::NotFinite`] when the start is not
    /// finite, [`Error::Degenerate`] when it is a single place. What has been taken out stays out.
    ///
    /// # Example
    /// ```
    /// use bearslam::{FixedMap, FixedOptions, Workspace, bearing_to, pose};
    /// use nalgebra::Point2;
    ///
    /// let views = [pose(0.0, 0.0, 0.0), pose(1.0, 0.0, 0.4), pose(0.3, 0.8, -0.7)];
    /// let points = [(2.0, 1.0), (-1.0, 2.0), (0.5, 3.0), (1.5, -2.0), (-2.0, -1.0_f64)];
    /// let mut map = FixedMap::<f64, 3, 5>::new();
    /// for (view, pose) in views.iter().enumerate() {
    ///     map.poses[view] = Some(*pose);
    ///     for (landmark, &(x, y)) in points.iter().enumerate() {
    ///         let bearing = bearing_to(pose, &Point2::new(x, y)).unwrap();
    ///         map.see(view, landmark, bearing, 0.01)?;
    ///         map.landmarks[landmark] = Some(Point2::new(x + 0.1, y - 0.1));
    ///     }
    /// }
    /// let report = map.refine(&mut Workspace::<f64, 3, 5>::new(), &FixedOptions::default())?;
    /// assert!(report.termination.was_successful() && map.rms() < 1e-9);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn refine(
        &mut self,
        workspace: &mut Workspace<T, M, N>,
        options: &FixedOptions<T>,
    ) -> Result<FixedReport<T>, Error> {
        let dropped = self.prune();
        let used = self
            .poses
            .iter()
            .zip(1..)
            .filter(|(pose, _)| pose.is_some());
        let Some((_, used)) = used.last() else {
            return Err(Error::TooFew {
                what: "views of the start that see three landmarks of it",
                needed: 1,
                got: 0,
            });
        };
        let unit = self.unit()?;
        self.scale(T::one() / unit);
        self.bring_in();
        let found = self.descend(workspace, options, used);
        self.scale(unit);
        let (termination, cost, iterations) = found?;
        Ok(FixedReport {
            cost,
            termination,
            iterations,
            dropped,
        })
    }

    /// The descent itself; how it ended, the cost, the number of linear systems solved.
    fn descend(
        &mut self,
        workspace: &mut Workspace<T, M, N>,
        options: &FixedOptions<T>,
        used: usize,
    ) -> Result<(Termination, T, usize), Error> {
        let tolerance = options.tolerance;
        let zero = self.rounding();
        let mut cost = self.linearize(workspace);
        if !cost.is_finite() {
            return Err(Error::NotFinite {
                what: "residuals of the start",
                index: self
                    .rows()
                    .position(|(_, _, row)| !row.residual.is_finite())
                    .unwrap_or(0),
            });
        }
        let mut damping = T::lit(FIRST_DAMPING);
        let mut last_gain = T::zero();
        for iteration in 0..options.max_iterations {
            if cost <= zero {
                return Ok((Termination::ZeroResidual, cost, iteration));
            }
            let mut lower = None;
            if workspace.solve(&self.poses, used, damping) {
                let (after, predicted) = self.try_step(workspace);
                let (after, predicted) = (after, cost - predicted);
                if after < cost {
                    lower = Some((cost - after, predicted));
                    cost = after;
                    self.poses = workspace.poses;
                    self.landmarks = workspace.landmarks;
                } else if predicted <= tolerance * cost {
                    return Ok((Termination::Converged, cost, iteration + 1));
                } else {
                    self.linearize(workspace);
                }
            }
            if let Some((gained, predicted)) = lower {
                // Near the minimum each gain is a small, shrinking part of the one before: what is
                // left to gain is at most the next one.
                let rate = gained / last_gain;
                let left = if rate < T::lit(CONVERGING) {
                    gained * rate
                } else {
                    gained
                };
                // Gains that grow as the damping falls are those of a direction it still holds back.
                if left <= tolerance * cost && gained <= last_gain {
                    return Ok((Termination::Converged, cost, iteration + 1));
                }
                last_gain = gained;
                let ratio = gained / predicted;
                if ratio > T::lit(0.75) {
                    damping *= T::lit(0.1);
                } else if ratio < T::lit(0.25) {
                    damping *= T::lit(4.0);
                }
            } else {
                if damping > T::lit(MAX_DAMPING) {
                    return Ok((Termination::NoProgress, cost, iteration + 1));
                }
                damping = (damping * T::lit(10.0)).max(T::lit(1e-5));
            }
        }
        let termination = if cost <= zero {
            Termination::ZeroResidual
        } else {
            Termination::MaxIterations
        };
        Ok((termination, cost, options.max_iterations))
    }

    /// Writes the map after the step into the workspace, linearised there; its cost, and the cost that
    /// the linear model predicts.
    fn try_step(&self, workspace: &mut Workspace<T, M, N>) -> (T, T) {
        let steps = self.poses.iter().zip(&workspace.step);
        for (to, (pose, step)) in workspace.poses.iter_mut().zip(steps) {
            *to = pose.as_ref().map(|pose| moved(pose, step));
        }
        let (mut cost, mut model) = (T::zero(), T::zero());
        let landmarks = self.landmarks.iter().zip(&self.sightings).enumerate();
        for (landmark, (point, seen)) in landmarks {
            let stepped = point.as_ref().zip(workspace.step_of_landmark(landmark));
            let Some((point, (step, squares))) = stepped else {
                continue;
            };
            let mut to = point + step;
            let rows = workspace.rows.get_mut(landmark);
            if let (Some(rows), Some(place)) = (rows, workspace.landmarks.get_mut(landmark)) {
                cost += settle(&workspace.poses, seen, &mut to, rows, &mut workspace.spare);
                model += squares;
                *place = Some(to);
            }
        }
        (cost * T::lit(0.5), model * T::lit(0.5))
    }

    /// Linearises all sightings; the cost.
    fn linearize(&self, workspace: &mut Workspace<T, M, N>) -> T {
        workspace.landmarks = self.landmarks;
        let landmarks = self.landmarks.iter().zip(&self.sightings);
        let mut sum = T::zero();
        for ((point, seen), rows) in landmarks.zip(&mut workspace.rows) {
            match point {
                Some(point) => sum += Around::new(&self.poses, seen, point, rows).loss,
                None => *rows = [Row::filled(T::zero()); M],
            }
        }
        sum * T::lit(0.5)
    }

    /// Takes out what the rest cannot fix, until all is fixed; how many.
    fn prune(&mut self) -> usize {
        let mut dropped = 0;
        // Each round but the last drops something.
        for _ in 0..=M + N {
            let before = dropped;
            for view in 0..M {
                let weak =
                    self.of_view(view).take(MIN_LANDMARKS_OF_VIEW).count() < MIN_LANDMARKS_OF_VIEW;
                if let Some(pose) = self.poses.get_mut(view)
                    && weak
                    && pose.take().is_some()
                {
                    dropped += 1;
                }
            }
            for landmark in 0..N {
                let weak = self
                    .of_landmark(landmark)
                    .take(MIN_VIEWS_OF_LANDMARK)
                    .count()
                    < MIN_VIEWS_OF_LANDMARK;
                if let Some(point) = self.landmarks.get_mut(landmark)
                    && weak
                    && point.take().is_some()
                {
                    dropped += 1;
                }
            }
            if dropped == before {
                break;
            }
        }
        dropped
    }

    /// The extent of the views (where they are in one place, of all) as a power of two, so that
    /// scaling by it loses no digit.
    fn unit(&self) -> Result<T, Error> {
        let views = self.poses.iter().flatten();
        let views = views.map(|pose| pose.translation.vector);
        let all = views
            .clone()
            .chain(self.landmarks.iter().flatten().map(|point| point.coords));
        let finite = |place: Vector2<T>| place.x.is_finite() && place.y.is_finite();
        if let Some(index) = all.clone().position(|place| !finite(place)) {
            return Err(Error::NotFinite {
                what: "positions of the start",
                index,
            });
        }
        let power = |size: T| T::lit(2.0).powf(size.log2().round());
        let usable = |size: &T| {
            let unit = power(*size);
            let square = unit * unit;
            *size > T::zero() && square.is_finite() && (T::one() / square).is_finite()
        };
        let whole = extent(all);
        match [extent(views), whole].into_iter().find(usable) {
            Some(size) => Ok(power(size)),
            None => Err(Error::Degenerate {
                kind: Degeneracy::CoincidentStart,
                value: whole.as_f64(),
                bound: 0.0,
            }),
        }
    }

    fn scale(&mut self, factor: T) {
        for pose in self.poses.iter_mut().flatten() {
            pose.translation.vector *= factor;
        }
        for point in self.landmarks.iter_mut().flatten() {
            point.coords *= factor;
        }
    }

    /// Brings landmarks that are too far away to be told from infinity to where they can just be.
    fn bring_in(&mut self) {
        let horizon = horizon::<T>();
        let Some(home) = self.poses.iter().flatten().next() else {
            return;
        };
        let home = home.translation.vector;
        for point in self.landmarks.iter_mut().flatten() {
            let offset = point.coords - home;
            if offset.amax() > horizon {
                *point = Point2::from(home + (offset / offset.amax()).normalize() * horizon);
            }
        }
    }

    /// The cost of residuals that are rounding.
    fn rounding(&self) -> T {
        let rounding = T::lit(ZERO_RESIDUAL_EPS) * T::eps();
        let squares = self.rows().fold(T::zero(), |sum, (_, _, row)| {
            let [_, _, weight] = row.slope;
            sum + (weight * rounding) * (weight * rounding)
        });
        squares * T::lit(0.5)
    }
}

/// A pose after a step.
#[inline]
fn moved<T: Real>(pose: &Pose<T>, [x, y, theta]: &[T; 3]) -> Pose<T> {
    let turned = pose.rotation.into_inner() * UnitComplex::new(*theta).into_inner();
    // First-order normalisation keeps rounding from adding up.
    let scale = (T::lit(3.0) - turned.norm_sqr()) * T::lit(0.5);
    Pose::from_parts(
        Translation2::from(pose.translation.vector + Vector2::new(*x, *y)),
        UnitComplex::new_unchecked(turned * scale),
    )
}

/// The longer side of the box around some places.
fn extent<T: Real>(mut places: impl Iterator<Item = Vector2<T>>) -> T {
    let Some(first) = places.next() else {
        return T::zero();
    };
    let (low, high) = places.fold((first, first), |(low, high), place| {
        (low.inf(&place), high.sup(&place))
    });
    (high - low).amax()
}

/// First damping, relative to the diagonal of the normal equations.
const FIRST_DAMPING: f64 = 1e-4;

/// Ratio of successive gains below which the next one is foreseen.
const CONVERGING: f64 = 0.05;

/// Damping beyond which a step is too small to be one.
const MAX_DAMPING: f64 = 1e8;

/// Residuals of this many units of rounding are zero.
const ZERO_RESIDUAL_EPS: f64 = 8.0;
