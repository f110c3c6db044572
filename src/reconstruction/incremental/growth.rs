// SPDX-License-Identifier: MIT OR Apache-2.0
//! Growth of one map from a few poses to everything it can reach.
//!
//! Each round adds the views that the map determines best, at most a quarter of those it has, then landmarks,
//! and refines. What does not fit waits for a later round, when the map is better; when no view passes the
//! gates, they are widened.

use super::super::attempt::attempt;
use super::super::options::{Progress, SolveOptions, report_progress};
use super::gates::{Fit, noise, range_variance};
use super::options::IncrementalOptions;
use super::place;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Pose;
use crate::lm::RefineOptions;
use crate::problem::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Map, Problem};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::Point2;

/// A growing map.
pub struct IncrementalGrowth<'a> {
    problem: &'a Problem,
    options: &'a IncrementalOptions,
    refine: &'a RefineOptions,
    /// Views that may be added.
    allowed: &'a [bool],
    pub map: Map,
    /// Expected root mean square of residuals over sigma.
    noise: f64,
    /// How often each view has been removed.
    thrown: Vec<u8>,
    /// Index of the current gate.
    level: usize,
}

impl<'a> IncrementalGrowth<'a> {
    /// Starts from poses without landmarks; `None` when the first refinement fails.
    ///
    /// # Errors
    /// [`Error::Interrupted`] and [`Error::OutOfMemory`].
    pub fn new(
        problem: &'a Problem,
        options: &'a SolveOptions,
        allowed: &'a [bool],
        map: Map,
    ) -> Result<Option<Self>, Error> {
        let mut growth = Self {
            problem,
            options: &options.stages.incremental,
            refine: &options.refine,
            allowed,
            noise: 0.0,
            thrown: vec![0; map.poses.len()],
            map,
            level: 0,
        };
        // Nothing is known of the noise of a map without landmarks but what is expected of any.
        growth.noise = noise(problem, &growth.map, growth.options);
        growth.triangulate();
        growth.noise = noise(problem, &growth.map, growth.options);
        Ok(growth.refine(&mut None)?.then_some(growth))
    }

    /// Number of views in the map.
    pub fn reached(&self) -> usize {
        self.map.poses.iter().flatten().count()
    }

    /// Expected root mean square of residuals over sigma.
    pub fn noise(&self) -> f64 {
        self.noise
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
                && let Some((pose, held)) = self.place_view(view)
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

    /// The pose of a view if it passes the gates, and how well it is determined: one over the standard
    /// deviation of its heading at the current noise.
    fn place_view(&self, view: usize) -> Option<(Pose<f64>, f64)> {
        if self.map.connections_of_view(self.problem, view)
            < self.options.landmarks_of_view[self.level]
        {
            return None;
        }
        let (found, pose, fit) = place::place_view(self.problem, &self.map, view)?;
        let count = fit.count as f64;
        let weight = self.problem.of_view(view)[0].weight;
        let held = found.gap * count.sqrt() * weight / self.noise;
        let last = self.level + 1 == self.options.gates.len();
        let fits = fit.passes(
            MIN_LANDMARKS_OF_VIEW,
            self.noise,
            self.options.gates[self.level],
        );
        (fits && (last || held * self.options.max_deviation > 1.0)).then_some((pose, held))
    }

    /// Adds the landmarks that the views determine.
    fn triangulate(&mut self) {
        for landmark in 0..self.map.landmarks.len() {
            if self.map.landmarks[landmark].is_none() {
                self.map.landmarks[landmark] = self.place_landmark(landmark);
            }
        }
    }

    /// The position of a landmark if it passes the gates.
    fn place_landmark(&self, landmark: usize) -> Option<Point2<f64>> {
        let (point, fit) = place::place_landmark(self.problem, &self.map, landmark)?;
        let variance = range_variance(self.problem, &self.map, landmark, &point);
        let bound = self.options.max_deviation / self.noise;
        (fit.passes(MIN_VIEWS_OF_LANDMARK, self.noise, self.options.gates[0])
            && variance < bound * bound)
            .then_some(point)
    }

    /// Refines the whole map for a few iterations; `false` when it cannot be refined.
    fn refine(&mut self, progress: &mut Option<Progress<'_>>) -> Result<bool, Error> {
        let (reached, total) = (self.reached(), self.map.poses.len());
        let mut observer = |_, _| report_progress(progress, "grow", reached, total);
        let refine = *self.refine;
        let options = RefineOptions {
            max_iterations: refine.max_iterations.min(self.options.growing_iterations),
            ..refine
        };
        let report = attempt(self.problem, &mut self.map, &options, Some(&mut observer))?;
        if report.is_some() {
            self.noise = noise(self.problem, &self.map, self.options);
        }
        Ok(report.is_some())
    }

    /// Places anew what does not fit, or removes it.
    fn revise(&mut self) {
        for landmark in 0..self.map.landmarks.len() {
            let Some(point) = self.map.landmarks[landmark] else {
                continue;
            };
            let fit = Fit::of_landmark(self.problem, &self.map, landmark, &point);
            if !fit.passes(MIN_VIEWS_OF_LANDMARK, self.noise, self.options.gates[0]) {
                self.map.landmarks[landmark] = self.place_landmark(landmark);
            }
        }
        for view in 0..self.map.poses.len() {
            let Some(pose) = self.map.poses[view] else {
                continue;
            };
            let fit = Fit::of_view(self.problem, &self.map, view, &pose);
            if !fit.passes(MIN_LANDMARKS_OF_VIEW, self.noise, self.options.gates[0]) {
                self.map.poses[view] = self.place_view(view).map(|(pose, _)| pose);
                self.thrown[view] += u8::from(self.map.poses[view].is_none());
            }
        }
        self.map.prune(self.problem);
    }
}
