// SPDX-License-Identifier: MIT OR Apache-2.0
//! One map on its way from a few poses to everything it can reach.
//!
//! A round adds the views that the map holds best, up to a quarter more than it has, then landmarks,
//! and refines. What does not fit waits for a later round, when the map is better; when nothing else
//! is left the gates open wider.

use super::super::options::{Progress, tell};
use super::gates::{Fit, noise, range_variance};
use super::locate;
use crate::adjustment::refine_map;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Pose;
use crate::lm::RefineOptions;
use crate::problem::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Map, Problem};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::Point2;

/// A view or landmark fits within so many times the noise. At first its neighbours are no better than
/// itself, hence more than the usual three; wider, where a loop closes over the drift of the map; at
/// last whatever has a pose at all.
pub const GATES: [f64; 3] = [5.0, 20.0, 80.0];

/// A round may add one view to so many.
const SHARE: usize = 4;

/// Landmarks that hold a view, one of which checks it; without the check when nothing else is left.
const HOLDING: [usize; 3] = [4, 4, MIN_LANDMARKS_OF_VIEW];

/// A heading is taken when its standard deviation is below this \[rad\], a landmark when that of its
/// range is below this part of it. Beyond, the first order no longer tells what they do to others.
const MAX_DEVIATION: f64 = 0.25;

/// How often a view may be thrown out and come back.
const RETURNS: u8 = 3;

/// Iterations of a refinement in between: enough to take out the drift; the end is exact.
const ITERATIONS: usize = 6;

/// A map that grows.
pub struct Growth<'a> {
    problem: &'a Problem,
    options: RefineOptions,
    /// Views that may be added.
    allowed: &'a [bool],
    pub map: Map,
    /// Residuals over sigma to be expected.
    noise: f64,
    /// How often each view has been thrown out.
    thrown: Vec<u8>,
    /// Index into [`GATES`].
    level: usize,
}

impl<'a> Growth<'a> {
    /// From poses without landmarks; `None` when the landmarks that they see cannot be refined with
    /// them.
    ///
    /// # Errors
    /// [`Error::Interrupted`] and [`Error::OutOfMemory`].
    pub fn new(
        problem: &'a Problem,
        options: &RefineOptions,
        allowed: &'a [bool],
        map: Map,
    ) -> Result<Option<Self>, Error> {
        let mut growth = Self {
            problem,
            options: RefineOptions {
                max_iterations: options.max_iterations.min(ITERATIONS),
                ..*options
            },
            allowed,
            noise: 0.0,
            thrown: vec![0; map.poses.len()],
            map,
            level: 0,
        };
        // Nothing is known of the noise of a map without landmarks but what is expected of any.
        growth.noise = noise(problem, &growth.map);
        growth.triangulate();
        growth.noise = noise(problem, &growth.map);
        Ok(growth.refine(&mut None)?.then_some(growth))
    }

    /// Number of views in the map.
    pub fn reached(&self) -> usize {
        self.map.poses.iter().flatten().count()
    }

    /// Residuals over sigma to be expected.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// Grows until the map has `enough` views or nothing more can be reached.
    ///
    /// # Errors
    /// As [`Growth::new`].
    pub fn grow(
        &mut self,
        enough: usize,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<(), Error> {
        while self.reached() < enough {
            let added = self.add_views();
            if added == 0 {
                if self.level + 1 == GATES.len() {
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

    /// Adds the views that the map holds best; returns how many.
    fn add_views(&mut self) -> usize {
        let mut found: Vec<(f64, usize, Pose<f64>)> = Vec::new();
        for view in 0..self.map.poses.len() {
            if self.map.poses[view].is_none()
                && self.allowed[view]
                && self.thrown[view] < RETURNS
                && let Some((pose, held)) = self.locate(view)
            {
                found.push((held, view, pose));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let most = (self.reached() / SHARE).max(1);
        found.truncate(most);
        for &(_, view, pose) in &found {
            self.map.poses[view] = Some(pose);
        }
        found.len()
    }

    /// The pose of a view that passes the gates, and how far it is held: one over the standard
    /// deviation of its heading, in units of the noise.
    fn locate(&self, view: usize) -> Option<(Pose<f64>, f64)> {
        if self.map.connections_of_view(self.problem, view) < HOLDING[self.level] {
            return None;
        }
        let (found, pose, fit) = locate::view(self.problem, &self.map, view)?;
        let count = fit.count as f64;
        let weight = self.problem.of_view(view)[0].weight;
        let held = found.gap * count.sqrt() * weight / self.noise;
        let last = self.level + 1 == GATES.len();
        let fits = fit.passes(MIN_LANDMARKS_OF_VIEW, self.noise, GATES[self.level]);
        (fits && (last || held * MAX_DEVIATION > 1.0)).then_some((pose, held))
    }

    /// Adds the landmarks that the views hold.
    fn triangulate(&mut self) {
        for landmark in 0..self.map.landmarks.len() {
            if self.map.landmarks[landmark].is_none() {
                self.map.landmarks[landmark] = self.place(landmark);
            }
        }
    }

    /// The place of a landmark that passes the gates.
    fn place(&self, landmark: usize) -> Option<Point2<f64>> {
        let (point, fit) = locate::landmark(self.problem, &self.map, landmark)?;
        let variance = range_variance(self.problem, &self.map, landmark, &point);
        let bound = MAX_DEVIATION / self.noise;
        (fit.passes(MIN_VIEWS_OF_LANDMARK, self.noise, GATES[0]) && variance < bound * bound)
            .then_some(point)
    }

    /// A few steps of refinement of the whole; `false` when it cannot be refined.
    fn refine(&mut self, progress: &mut Option<Progress<'_>>) -> Result<bool, Error> {
        let (reached, total) = (self.reached(), self.map.poses.len());
        let mut watch = |_, _| tell(progress, "grow", reached, total);
        match refine_map(self.problem, &mut self.map, &self.options, Some(&mut watch)) {
            Ok(_) => {
                self.noise = noise(self.problem, &self.map);
                Ok(true)
            }
            Err(error) if error.stops_all() => Err(error),
            Err(_) => Ok(false),
        }
    }

    /// Finds other places for what does not fit, or throws it out.
    fn revise(&mut self) {
        for landmark in 0..self.map.landmarks.len() {
            let Some(point) = self.map.landmarks[landmark] else {
                continue;
            };
            let fit = Fit::of_landmark(self.problem, &self.map, landmark, &point);
            if !fit.passes(MIN_VIEWS_OF_LANDMARK, self.noise, GATES[0]) {
                self.map.landmarks[landmark] = self.place(landmark);
            }
        }
        for view in 0..self.map.poses.len() {
            let Some(pose) = self.map.poses[view] else {
                continue;
            };
            let fit = Fit::of_view(self.problem, &self.map, view, &pose);
            if !fit.passes(MIN_LANDMARKS_OF_VIEW, self.noise, GATES[0]) {
                self.map.poses[view] = self.locate(view).map(|(pose, _)| pose);
                self.thrown[view] += u8::from(self.map.poses[view].is_none());
            }
        }
        self.map.prune(self.problem);
    }
}
