// SPDX-License-Identifier: MIT OR Apache-2.0
//! A part of a problem as a problem of its own: its noise, and the examination of its maps.

use super::super::finding::{Kind, apart};
use super::super::options::DiagnosisOptions;
use super::super::shapes::examine::{Examination, examine};
use super::super::shapes::normalized_map::NormalizedMap;
use super::components::Part;
use crate::adjustment::refine_map;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem, Subject, Undetermined, Why};
use crate::reconstruction::{Progress, report_progress};
use alloc::vec;
use alloc::vec::Vec;

/// A part of a problem, renumbered.
pub struct SubProblem {
    pub problem: Problem,
    /// The indices of its views and landmarks in the whole problem.
    pub part: Part,
    pub options: DiagnosisOptions,
}

impl SubProblem {
    pub fn new(problem: &Problem, part: &Part, options: &DiagnosisOptions) -> Self {
        let mut views = vec![false; problem.views()];
        let mut landmarks = vec![false; problem.landmarks()];
        part.views.iter().for_each(|&view| views[view] = true);
        part.landmarks
            .iter()
            .for_each(|&landmark| landmarks[landmark] = true);
        Self {
            problem: problem.restrict(&views, &landmarks).on_its_own(),
            part: part.clone(),
            options: *options,
        }
    }

    /// The same part of a map.
    pub fn map(&self, map: &Map) -> Map {
        let views = self.part.views.iter();
        let landmarks = self.part.landmarks.iter();
        Map {
            poses: views.map(|&view| map.poses[view]).collect(),
            landmarks: landmarks.map(|&k| map.landmarks[k]).collect(),
        }
    }

    /// All of a problem, with its odometry and priors.
    pub fn whole(problem: &Problem, options: &DiagnosisOptions) -> Self {
        Self {
            problem: problem.clone(),
            part: Part::whole(problem),
            options: *options,
        }
    }

    /// Views and landmarks by their indices in the whole problem, each sorted and without duplicates.
    pub fn outer_all(
        &self,
        subjects: impl IntoIterator<Item = Subject>,
    ) -> (Vec<usize>, Vec<usize>) {
        apart(subjects.into_iter().map(|subject| self.outer(subject)))
    }

    /// A subject by its index in the whole problem.
    pub fn outer(&self, subject: Subject) -> Subject {
        match subject {
            Subject::View(view) => Subject::View(self.part.views[view]),
            Subject::Landmark(landmark) => Subject::Landmark(self.part.landmarks[landmark]),
        }
    }

    /// Root mean square of the residuals of a map \[rad\], and the standard deviation of a bearing \[rad\] estimated
    /// from it by the degrees of freedom; without any it is the root mean square itself, a lower bound.
    pub fn rms_and_noise(&self, map: &Map) -> (f64, f64) {
        let weight = self.mean_weight();
        let (mut squares, mut count) = (0.0, 0.0);
        let seen = self.problem.sightings().iter();
        for (s, residual) in seen.zip(map.residuals(&self.problem)) {
            if let Some(r) = residual {
                let r = r * s.weight / weight;
                squares += r * r;
                count += 1.0;
            }
        }
        let views = map.poses.iter().flatten().count();
        let landmarks = map.landmarks.iter().flatten().count();
        let freedom = count + 4.0 - (3 * views + 2 * landmarks) as f64;
        let rms = (squares / f64::max(count, 1.0)).sqrt();
        let noise = if freedom > 0.0 {
            (squares / freedom).sqrt()
        } else {
            rms
        };
        (rms, noise)
    }

    /// The noise stated by the problem: only if all standard deviations are below 1 rad.
    pub fn stated_noise(&self) -> Option<f64> {
        let mut weights = self.problem.sightings().iter().map(|s| s.weight);
        weights
            .all(|weight| weight > 1.0)
            .then(|| 1.0 / self.mean_weight())
    }

    /// Root mean square of one over sigma.
    pub fn mean_weight(&self) -> f64 {
        let seen = self.problem.sightings();
        let squares = seen.iter().map(|s| s.weight * s.weight);
        (squares.sum::<f64>() / seen.len().max(1) as f64).sqrt()
    }

    /// A member of a family after a few iterations of refinement, strongly damped so that it does not move along the
    /// family; `None` when it does not explain the bearings as well as a known map.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when `progress` says so.
    pub fn refine_member(
        &self,
        member: Map,
        known: &Map,
        noise: f64,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<Option<Map>, Error> {
        let options = RefineOptions {
            max_iterations: self.options.maps.member_iterations,
            damping: self.options.maps.member_damping,
            ..RefineOptions::default()
        };
        let mut map = member;
        let total = options.max_iterations;
        let mut observer = |done, _| report_progress(progress, "refine", done, total);
        match refine_map(&self.problem, &mut map, &options, Some(&mut observer)) {
            Err(error @ Error::Interrupted) => Err(error),
            Err(_) => Ok(None),
            Ok(_) => Ok(self.explains(&map, known, noise).then_some(map)),
        }
    }

    /// Whether a map explains the bearings as well as a known one, or as the noise predicts.
    pub fn explains(&self, map: &Map, known: &Map, noise: f64) -> bool {
        let bound = self.options.maps.as_good * f64::max(self.rms_and_noise(known).0, noise);
        self.rms_and_noise(map).0 <= bound + f64::EPSILON.sqrt()
    }

    /// Examines a map by its singular values; `None` when it has no size or is too large.
    pub fn examined(&self, map: &Map, noise: f64) -> Option<Examination> {
        NormalizedMap::of_map(&self.problem, map)
            .and_then(|normalized| examine(&normalized, noise, &self.options.shapes))
    }

    /// Whether a map has the shape of this kind, and this shape leaves directions free.
    pub fn has_shape(&self, map: &Map, kind: Kind, noise: f64) -> bool {
        let found = self.examined(map, noise);
        found.is_some_and(|found| found.causes.iter().any(|cause| cause.kind == kind))
    }

    /// The landmarks at infinity of a given map: those without a position whose rays are parallel within the noise.
    pub fn infinite(&self, map: &Map, noise: f64) -> Vec<Undetermined> {
        let bound = self.options.maps.parallel * noise + f64::EPSILON.sqrt();
        let parallel = |landmark: usize| {
            let rays: Vec<_> = map
                .rays(&self.problem, landmark)
                .map(|(pose, s)| pose.rotation * s.bearing)
                .collect();
            let off = |ray| rays[0].angle_to(ray).abs();
            rays.len() > 1 && rays.iter().all(|ray| off(ray) < bound)
        };
        (0..map.landmarks.len())
            .filter(|&landmark| map.landmarks[landmark].is_none() && parallel(landmark))
            .map(|landmark| Undetermined {
                subject: Subject::Landmark(landmark),
                why: Why::AtInfinity,
            })
            .collect()
    }
}
