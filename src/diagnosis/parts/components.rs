// SPDX-License-Identifier: MIT OR Apache-2.0
//! Connected parts of a problem, and the views and landmarks with enough sightings to belong to one.

use crate::problem::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Problem};
use alloc::vec;
use alloc::vec::Vec;

/// A part of a problem connected by its sightings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its views, ascending.
    pub views: Vec<usize>,
    /// Its landmarks, ascending.
    pub landmarks: Vec<usize>,
    /// Sightings between them.
    pub sightings: usize,
    /// How many directions of the gauge odometry and priors leave free, 4 without them; and how many observations they
    /// add.
    pub priors: (usize, usize),
}

impl Part {
    /// All views and landmarks of a problem.
    pub(crate) fn whole(problem: &Problem) -> Self {
        Self {
            views: (0..problem.views()).collect(),
            landmarks: (0..problem.landmarks()).collect(),
            sightings: problem.sightings().len(),
            priors: (4, 0),
        }
    }

    /// Redundancy: observations minus unknowns, not counting the free directions of the gauge, (T20). If it is
    /// negative, at least as many directions are free, whatever the geometry.
    pub fn freedom(&self) -> i64 {
        let count = |n: usize| i64::try_from(n).unwrap_or(i64::MAX / 8);
        let (free, numbers) = self.priors;
        count(self.sightings + numbers + free)
            - 3 * count(self.views.len())
            - 2 * count(self.landmarks.len())
    }
}

/// Views and landmarks with enough sightings of each other to be determined.
pub struct Core {
    /// For each view, whether it sees three landmarks of the core.
    pub views: Vec<bool>,
    /// For each landmark, whether two views of the core see it.
    pub landmarks: Vec<bool>,
}

impl Core {
    /// Removes views and landmarks with too few sightings until no such are left.
    pub fn of(problem: &Problem) -> Self {
        let mut core = Self {
            views: vec![true; problem.views()],
            landmarks: vec![true; problem.landmarks()],
        };
        loop {
            let mut dropped = false;
            for view in 0..problem.views() {
                let seen = problem.of_view(view).iter();
                let count = seen.filter(|s| core.landmarks[s.landmark]).count();
                let drop = core.views[view] && count < MIN_LANDMARKS_OF_VIEW;
                core.views[view] &= !drop;
                dropped |= drop;
            }
            for landmark in 0..problem.landmarks() {
                let seen = problem.of_landmark(landmark).iter();
                let count = seen
                    .filter(|&&k| core.views[problem.sightings()[k].view])
                    .count();
                let drop = core.landmarks[landmark] && count < MIN_VIEWS_OF_LANDMARK;
                core.landmarks[landmark] &= !drop;
                dropped |= drop;
            }
            if !dropped {
                return core;
            }
        }
    }

    /// The connected parts, the one with most sightings first.
    pub fn parts(&self, problem: &Problem) -> Vec<Part> {
        let mut part_of_view: Vec<Option<usize>> = vec![None; problem.views()];
        let mut part_of_landmark: Vec<Option<usize>> = vec![None; problem.landmarks()];
        let mut count = 0;
        for start in 0..problem.views() {
            if !self.views[start] || part_of_view[start].is_some() {
                continue;
            }
            part_of_view[start] = Some(count);
            let mut open = vec![start];
            while let Some(view) = open.pop() {
                for s in problem.of_view(view) {
                    if !self.landmarks[s.landmark] || part_of_landmark[s.landmark].is_some() {
                        continue;
                    }
                    part_of_landmark[s.landmark] = Some(count);
                    for &k in problem.of_landmark(s.landmark) {
                        let other = problem.sightings()[k].view;
                        if self.views[other] && part_of_view[other].is_none() {
                            part_of_view[other] = Some(count);
                            open.push(other);
                        }
                    }
                }
            }
            count += 1;
        }
        let empty = Part {
            views: Vec::new(),
            landmarks: Vec::new(),
            sightings: 0,
            priors: (4, 0),
        };
        let mut parts = vec![empty; count];
        for (view, part) in part_of_view.iter().enumerate() {
            if let Some(part) = *part {
                parts[part].views.push(view);
                let seen = problem.of_view(view).iter();
                parts[part].sightings += seen.filter(|s| self.landmarks[s.landmark]).count();
            }
        }
        for (landmark, part) in part_of_landmark.iter().enumerate() {
            if let Some(part) = *part {
                parts[part].landmarks.push(landmark);
            }
        }
        parts.sort_by_key(|part| core::cmp::Reverse(part.sightings));
        parts
    }
}

/// What triangulation and resection can reach from three views: landmarks that two reached views see, and views
/// that see three reached landmarks.
pub fn reached(problem: &Problem, triple: [usize; 3]) -> Core {
    let mut reached = Core {
        views: vec![false; problem.views()],
        landmarks: vec![false; problem.landmarks()],
    };
    for view in triple {
        reached.views[view] = true;
    }
    loop {
        let mut grown = false;
        for landmark in 0..problem.landmarks() {
            let seen = problem.of_landmark(landmark).iter();
            let count = seen
                .filter(|&&k| reached.views[problem.sightings()[k].view])
                .count();
            reached.landmarks[landmark] |= count >= MIN_VIEWS_OF_LANDMARK;
        }
        for view in 0..problem.views() {
            let seen = problem.of_view(view).iter();
            let count = seen.filter(|s| reached.landmarks[s.landmark]).count();
            if !reached.views[view] && count >= MIN_LANDMARKS_OF_VIEW {
                reached.views[view] = true;
                grown = true;
            }
        }
        if !grown {
            return reached;
        }
    }
}
