// SPDX-License-Identifier: MIT OR Apache-2.0
//! A part of a problem as a problem of its own: its noise, and what maps of it tell.

use super::super::finding::{Kind, apart};
use super::super::shapes::examine::{Examination, examine};
use super::super::shapes::normalized_map::NormalizedMap;
use super::components::Part;
use crate::adjustment::{RefineOptions, refine_map};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::problem::{Map, Problem, Subject, Undetermined, Why};
use alloc::vec;
use alloc::vec::Vec;

/// A part with its own numbers.
pub struct SubProblem {
    pub problem: Problem,
    /// Who it is in the whole problem.
    pub part: Part,
}

/// A map explains the bearings as well as another when its residuals are at most so many times as large.
const AS_GOOD: f64 = 3.0;

/// Steps that a member of a family gets, and their first damping.
const SETTLING: usize = 4;
const SETTLING_DAMPING: f64 = 1e-2;

/// Rays are parallel when they differ by at most so many standard deviations of a bearing: four of a
/// difference of two.
const PARALLEL: f64 = 6.0;

impl SubProblem {
    pub fn new(problem: &Problem, part: &Part) -> Self {
        let mut views = vec![false; problem.views()];
        let mut landmarks = vec![false; problem.landmarks()];
        part.views.iter().for_each(|&view| views[view] = true);
        part.landmarks
            .iter()
            .for_each(|&landmark| landmarks[landmark] = true);
        Self {
            problem: problem.restrict(&views, &landmarks).on_its_own(),
            part: part.clone(),
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

    /// All of a problem with its odometry and priors.
    pub fn whole(problem: &Problem) -> Self {
        Self {
            problem: problem.clone(),
            part: Part::whole(problem),
        }
    }

    /// Views and landmarks as the whole problem numbers them, each in order and once.
    pub fn outer_all(
        &self,
        subjects: impl IntoIterator<Item = Subject>,
    ) -> (Vec<usize>, Vec<usize>) {
        apart(subjects.into_iter().map(|subject| self.outer(subject)))
    }

    /// A subject as the whole problem numbers it.
    pub fn outer(&self, subject: Subject) -> Subject {
        match subject {
            Subject::View(view) => Subject::View(self.part.views[view]),
            Subject::Landmark(landmark) => Subject::Landmark(self.part.landmarks[landmark]),
        }
    }

    /// Root mean square of the residuals of a map, and the standard deviation of the bearings that they
    /// tell \[rad\]; without freedom to tell it, that they are at least as large as what is left.
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

    /// The noise that the problem states: standard deviations below 1 rad.
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

    /// A member of a family after a few steps of refinement, strongly damped so that it stays where it is
    /// in the family; `None` when it does not explain the bearings as a known map does.
    pub fn refine_member(&self, member: Map, known: &Map, noise: f64) -> Option<Map> {
        let options = RefineOptions {
            max_iterations: SETTLING,
            damping: SETTLING_DAMPING,
            ..RefineOptions::default()
        };
        let mut map = member;
        refine_map(&self.problem, &mut map, &options, None).ok()?;
        self.explains(&map, known, noise).then_some(map)
    }

    /// Whether a map explains the bearings as a known one does, or as well as the noise lets expect.
    pub fn explains(&self, map: &Map, known: &Map, noise: f64) -> bool {
        let bound = AS_GOOD * f64::max(self.rms_and_noise(known).0, noise);
        self.rms_and_noise(map).0 <= bound + f64::EPSILON.sqrt()
    }

    /// What a map tells.
    pub fn examined(&self, map: &Map, noise: f64) -> Option<Examination> {
        NormalizedMap::of_map(&self.problem, map).and_then(|normalized| examine(&normalized, noise))
    }

    /// Whether a map has a shape that leaves directions free.
    pub fn has_shape(&self, map: &Map, kind: Kind, noise: f64) -> bool {
        let found = self.examined(map, noise);
        found.is_some_and(|found| found.causes.iter().any(|cause| cause.kind == kind))
    }

    /// The landmarks that a given map has no place for though its views see them, in directions that are
    /// parallel within the noise.
    pub fn infinite(&self, map: &Map, noise: f64) -> Vec<Undetermined> {
        let bound = PARALLEL * noise + f64::EPSILON.sqrt();
        let parallel = |landmark: usize| {
            let rays: Vec<_> = self
                .problem
                .of_landmark(landmark)
                .iter()
                .filter_map(|&k| {
                    let s = &self.problem.sightings()[k];
                    map.poses[s.view].map(|pose| pose.rotation * s.bearing)
                })
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
