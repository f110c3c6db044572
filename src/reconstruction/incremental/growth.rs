// SPDX-License-Identifier: MIT OR Apache-2.0
//! Growth of one map from a few poses to everything it can reach.
//!
//! Each round adds the views that the map determines best, at most a quarter of those it has, then landmarks,
//! and refines. What does not fit waits for a later round, when the map is better; when no view passes the
//! gates, they are widened.

use super::super::attempt::attempt;
use super::super::options::{Progress, SolveOptions, report_progress};
use super::options::IncrementalOptions;
use crate::error::Error;
use crate::geometry::Pose;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::Point2;

/// How a growing map places views and landmarks, and which it keeps: by least squares, or robustly where bearings may
/// be wrong.
pub trait PlaceEstimator {
    /// Options of the refinements on the way.
    fn refine_options(&self) -> RefineOptions;

    /// Learns the noise from the residuals of a map.
    fn observe(&mut self, _map: &Map) {}

    /// The mean square of the residuals of a map, by which the branches of a seed are told apart.
    fn variance(&self, map: &Map) -> f64;

    /// The pose of a view if it passes the gate of this index, and how well the map determines it: one over the
    /// standard deviation of its heading.
    fn place_view(&mut self, map: &Map, view: usize, gate: usize) -> Option<(Pose<f64>, f64)>;

    /// The position of a landmark if it passes the gates.
    fn place_landmark(&mut self, map: &Map, landmark: usize) -> Option<Point2<f64>>;

    /// Whether a view of a refined map still fits.
    fn keeps_view(&self, map: &Map, view: usize, pose: &Pose<f64>) -> bool;

    /// Whether a landmark of a refined map still fits.
    fn keeps_landmark(&self, map: &Map, landmark: usize, point: &Point2<f64>) -> bool;
}

/// A growing map.
pub struct IncrementalGrowth<'a, E> {
    problem: &'a Problem,
    options: &'a IncrementalOptions,
    estimator: E,
    /// Views that may be added.
    allowed: &'a [bool],
    pub map: Map,
    /// How often each view has been removed.
    thrown: Vec<u8>,
    /// Index of the current gate.
    level: usize,
}

impl<'a, E: PlaceEstimator> IncrementalGrowth<'a, E> {
    /// Starts from poses without landmarks; `None` when the first refinement fails.
    ///
    /// # Errors
    /// [`Error::Interrupted`] and [`Error::OutOfMemory`].
    pub fn new(
        problem: &'a Problem,
        options: &'a SolveOptions,
        estimator: E,
        allowed: &'a [bool],
        map: Map,
    ) -> Result<Option<Self>, Error> {
        let mut growth = Self {
            problem,
            options: &options.stages.incremental,
            estimator,
            allowed,
            thrown: vec![0; map.poses.len()],
            map,
            level: 0,
        };
        // Nothing is known of the noise of a map without landmarks but what is expected of any.
        growth.estimator.observe(&growth.map);
        growth.triangulate();
        growth.estimator.observe(&growth.map);
        Ok(growth.refine(&mut None)?.then_some(growth))
    }

    /// Number of views in the map.
    pub fn reached(&self) -> usize {
        self.map.poses.iter().flatten().count()
    }

    /// The mean square of its residuals.
    pub fn variance(&self) -> f64 {
        self.estimator.variance(&self.map)
    }

    /// Grows until the map has `enough` views or nothing more can be reached.
    ///
    /// # Errors
    /// As [`IncrementalGrowth::new`].
    pub fn grow(
        &mut self,
        enough: usize,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<(), Error> {
        while self.reached() < enough {
            let added = self.add_views();
            if added == 0 {
                if self.level + 1 == self.options.gates.len() {
                    break;
                }
                self.level += 1;
                continue;
            }
            self.level = 0;
            self.triangulate();
            if !self.refine(progress)? {
                break;
            }
            self.revise();
        }
        Ok(())
    }

    /// Adds the views that the map determines best; returns how many.
    fn add_views(&mut self) -> usize {
        let mut found: Vec<(f64, usize, Pose<f64>)> = Vec::new();
        for view in 0..self.map.poses.len() {
            if self.map.poses[view].is_none()
                && self.allowed[view]
                && self.thrown[view] < self.options.returns
                && let Some((pose, held)) = self.estimator.place_view(&self.map, view, self.level)
            {
                found.push((held, view, pose));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let most = (self.reached() / self.options.views_per_added.max(1)).max(1);
        found.truncate(most);
        for &(_, view, pose) in &found {
            self.map.poses[view] = Some(pose);
        }
        found.len()
    }

    /// Adds the landmarks that the views determine.
    fn triangulate(&mut self) {
        for landmark in 0..self.map.landmarks.len() {
            if self.map.landmarks[landmark].is_none() {
                self.map.landmarks[landmark] = self.estimator.place_landmark(&self.map, landmark);
            }
        }
    }

    /// Refines the whole map for a few iterations; `false` when it cannot be refined.
    fn refine(&mut self, progress: &mut Option<Progress<'_>>) -> Result<bool, Error> {
        let (reached, total) = (self.reached(), self.map.poses.len());
        let mut observer = |_, _| report_progress(progress, "grow", reached, total);
        let refine = self.estimator.refine_options();
        let options = RefineOptions {
            max_iterations: refine.max_iterations.min(self.options.growing_iterations),
            ..refine
        };
        let report = attempt(self.problem, &mut self.map, &options, Some(&mut observer))?;
        if report.is_some() {
            self.estimator.observe(&self.map);
        }
        Ok(report.is_some())
    }

    /// Places anew what does not fit, or removes it.
    fn revise(&mut self) {
        for landmark in 0..self.map.landmarks.len() {
            let Some(point) = self.map.landmarks[landmark] else {
                continue;
            };
            if !self.estimator.keeps_landmark(&self.map, landmark, &point) {
                self.map.landmarks[landmark] = self.estimator.place_landmark(&self.map, landmark);
            }
        }
        for view in 0..self.map.poses.len() {
            let Some(pose) = self.map.poses[view] else {
                continue;
            };
            if !self.estimator.keeps_view(&self.map, view, &pose) {
                let placed = self.estimator.place_view(&self.map, view, self.level);
                self.map.poses[view] = placed.map(|(pose, _)| pose);
                self.thrown[view] += u8::from(self.map.poses[view].is_none());
            }
        }
        self.map.prune(self.problem);
    }
}
