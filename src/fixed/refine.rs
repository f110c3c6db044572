// SPDX-License-Identifier: MIT OR Apache-2.0
//! Levenberg-Marquardt over all poses and landmarks of a [`FixedMap`].

use super::{FixedMap, Workspace};
use crate::error::Error;
use crate::geometry::Pose;
use crate::geometry::points::{unit, within_horizon};
use crate::kernels::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK};
use crate::lm::{
    BearingRow, LandmarkNormal, LeastSquares, Outcome, Prediction, Ray, RefineOptions,
    SightingModel, Trial, minimize, optimize_landmark, rounding,
};
use crate::scalar::Real;
use nalgebra::{Point2, Translation2, UnitComplex, Vector2};

impl<T: Real, const M: usize, const N: usize> FixedMap<T, M, N> {
    /// Refines the map in place: minimises the sum of losses of wrapped bearing residuals over sigma.
    ///
    /// Levenberg-Marquardt with the landmarks eliminated and moved back onto their rays after each step.
    /// Views and landmarks that the rest does not determine are removed first, see [`FixedMap::prune`]. The
    /// gauge is free and drifts slightly with damped steps; fix it afterwards with
    /// [`FixedMap::normalize`].
    ///
    /// The time is at most that of `max_iterations` iterations. One takes about `7 N M^2 + 9/2 M^3`
    /// multiplications for the step, and every sighting is linearised three times, with an arctangent
    /// each where its error exceeds 1/16 rad; `M` counts the views up to the last determined one. The
    /// stack takes about 2 kB on x86-64, whatever `M` and `N`. A landmark whose maximum-likelihood position
    /// is on a view or at infinity keeps moving towards it until the cost hardly falls or the maximum number
    /// of iterations is reached.
    ///
    /// # Errors
    /// [`Error::BadOption`] for an option out of its range, [`Error::TooFew`] when no view is determined, [`Error::NotFinite`] when the start is not finite,
    /// [`Error::Degenerate`] when all of it is in one place. Removed views and landmarks stay removed.
    ///
    /// # Example
    /// ```
    /// use bearslam::{FixedMap, RefineOptions, Workspace, bearing_to, pose};
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
    /// let outcome = map.refine(&mut Workspace::<f64, 3, 5>::new(), &RefineOptions::default())?;
    /// assert!(outcome.termination.was_successful() && map.rms() < 1e-9);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn refine(
        &mut self,
        workspace: &mut Workspace<T, M, N>,
        options: &RefineOptions<T>,
    ) -> Result<Outcome<T>, Error> {
        options.check()?;
        self.prune();
        let used = self
            .poses
            .iter()
            .zip(1..)
            .filter(|(pose, _)| pose.is_some());
        let Some((_, used)) = used.last() else {
            return Err(Error::TooFew {
                what: "views of the start that see at least three of its landmarks",
                needed: 1,
                got: 0,
            });
        };
        let views = self.poses.iter().flatten();
        let views = views.map(|pose| pose.translation.vector);
        let points = self.landmarks.iter().flatten().map(|point| point.coords);
        let unit = unit(views, points)?;
        self.scale(T::one() / unit);
        if let Some(home) = self.poses.iter().flatten().next() {
            for point in self.landmarks.iter_mut().flatten() {
                point.coords = within_horizon(point.coords, &home.translation.vector);
            }
        }
        let model = SightingModel {
            oriented: true,
            loss: options.loss,
        };
        let outcome = FixedBundle::new(self, workspace, model, used)
            .and_then(|mut bundle| minimize(&mut bundle, options, |_, _| true));
        self.scale(unit);
        outcome
    }

    /// Removes what the rest does not determine: views that see fewer than three determined landmarks, and
    /// landmarks that fewer than two determined views see. Returns how many were removed.
    ///
    /// [`FixedMap::refine`] does this first; call it yourself to get the number.
    pub fn prune(&mut self) -> usize {
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

    fn scale(&mut self, factor: T) {
        for pose in self.poses.iter_mut().flatten() {
            pose.translation.vector *= factor;
        }
        for point in self.landmarks.iter_mut().flatten() {
            point.coords *= factor;
        }
    }
}

/// A map under refinement, linearised in the workspace.
struct FixedBundle<'a, T: Real, const M: usize, const N: usize> {
    map: &'a mut FixedMap<T, M, N>,
    workspace: &'a mut Workspace<T, M, N>,
    model: SightingModel<T>,
    /// Only the first this many views may be determined.
    used: usize,
    cost: T,
    /// The cost of the map in the workspace.
    trial_cost: T,
}

impl<'a, T: Real, const M: usize, const N: usize> FixedBundle<'a, T, M, N> {
    fn new(
        map: &'a mut FixedMap<T, M, N>,
        workspace: &'a mut Workspace<T, M, N>,
        model: SightingModel<T>,
        used: usize,
    ) -> Result<Self, Error> {
        workspace.landmarks = map.landmarks;
        let mut bundle = Self {
            map,
            workspace,
            model,
            used,
            cost: T::zero(),
            trial_cost: T::zero(),
        };
        bundle.cost = bundle.linearize();
        if bundle.cost.is_finite() {
            return Ok(bundle);
        }
        Err(Error::NotFinite {
            what: "residuals of the start",
            index: bundle
                .map
                .rows()
                .position(|(_, _, row)| !row.residual.is_finite())
                .unwrap_or(0),
        })
    }

    /// Linearises all sightings of the map and returns its cost.
    fn linearize(&mut self) -> T {
        let landmarks = self.map.landmarks.iter().zip(&self.map.sightings);
        let mut sum = T::zero();
        for ((point, seen), rows) in landmarks.zip(&mut self.workspace.rows) {
            match point {
                Some(point) => {
                    sum += linearize(&self.map.poses, seen, point, &self.model, rows).loss
                }
                None => *rows = [BearingRow::filled(T::zero()); M],
            }
        }
        sum * T::lit(0.5)
    }
}

/// Linearises the rays to a landmark at a position.
#[inline]
fn linearize<T: Real, const M: usize>(
    poses: &[Option<Pose<T>>; M],
    seen: &[Option<Ray<T>>; M],
    place: &Point2<T>,
    model: &SightingModel<T>,
    rows: &mut [BearingRow<T>; M],
) -> LandmarkNormal<T> {
    if model.is_plain() {
        linearize_as::<true, T, M>(poses, seen, place, model, rows)
    } else {
        linearize_as::<false, T, M>(poses, seen, place, model, rows)
    }
}

fn linearize_as<const PLAIN: bool, T: Real, const M: usize>(
    poses: &[Option<Pose<T>>; M],
    seen: &[Option<Ray<T>>; M],
    place: &Point2<T>,
    model: &SightingModel<T>,
    rows: &mut [BearingRow<T>; M],
) -> LandmarkNormal<T> {
    let views = poses.iter().zip(seen).zip(rows);
    let rows = views.filter_map(|((pose, ray), row)| {
        let (Some(pose), Some(ray)) = (pose, ray) else {
            *row = BearingRow::filled(T::zero());
            return None;
        };
        let (new, loss) = BearingRow::weighted::<PLAIN>(pose, place, ray, model);
        *row = new;
        Some((new, loss))
    });
    rows.collect()
}

impl<T: Real, const M: usize, const N: usize> LeastSquares<T> for FixedBundle<'_, T, M, N> {
    fn cost(&self) -> T {
        self.cost
    }

    /// Writes the map after the step into the workspace, linearised there.
    fn try_step(&mut self, damping: T) -> Option<Trial<T>> {
        let Self {
            map,
            workspace,
            model,
            ..
        } = self;
        if !workspace.solve(&map.poses, self.used, damping) {
            return None;
        }
        let steps = map.poses.iter().zip(&workspace.step);
        for (to, (pose, step)) in workspace.poses.iter_mut().zip(steps) {
            *to = pose.as_ref().map(|pose| moved(pose, step));
        }
        let (mut cost, mut left, mut curvature) = (T::zero(), T::zero(), T::zero());
        let landmarks = map.landmarks.iter().zip(&map.sightings).enumerate();
        for (landmark, (point, seen)) in landmarks {
            let stepped = point.as_ref().zip(workspace.step_of_landmark(landmark));
            let Some((point, (step, [slope, bend]))) = stepped else {
                continue;
            };
            let rows = workspace.rows.get_mut(landmark);
            if let (Some(rows), Some(place)) = (rows, workspace.landmarks.get_mut(landmark)) {
                let spare = &mut workspace.spare;
                let (best, number, loss) = optimize_landmark(point + step, |number, place| {
                    let rows = if number == 1 { &mut *spare } else { &mut *rows };
                    linearize(&workspace.poses, seen, place, model, rows)
                });
                if number == 1 {
                    *rows = *spare;
                }
                *place = Some(best);
                cost += loss;
                left += slope;
                curvature += bend;
            }
        }
        let half = T::lit(0.5);
        self.trial_cost = cost * half;
        Some(Trial {
            cost: self.trial_cost,
            predicted: Prediction::new(left, curvature),
        })
    }

    fn accept(&mut self) {
        self.cost = self.trial_cost;
        self.map.poses = self.workspace.poses;
        self.map.landmarks = self.workspace.landmarks;
    }

    fn reject(&mut self) {
        self.linearize();
    }

    fn rounding(&self) -> T {
        rounding(self.map.rows().map(|(_, _, row)| row.weight))
    }
}

/// A pose after a step.
#[inline]
fn moved<T: Real>(pose: &Pose<T>, [x, y, theta]: &[T; 3]) -> Pose<T> {
    let turned = pose.rotation.into_inner() * UnitComplex::new(*theta).into_inner();
    // First-order normalisation, so that rounding does not accumulate.
    let scale = (T::lit(3.0) - turned.norm_sqr()) * T::lit(0.5);
    Pose::from_parts(
        Translation2::from(pose.translation.vector + Vector2::new(*x, *y)),
        UnitComplex::new_unchecked(turned * scale),
    )
}
