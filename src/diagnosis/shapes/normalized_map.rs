// SPDX-License-Identifier: MIT OR Apache-2.0
//! A map reduced to its geometry: positions, and which view sees which landmark.

#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::problem::{Map, Problem, Subject};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::Vector2;

/// The determined points of a map in units of its size, with the sightings between them.
///
/// Points are numbered views first, then landmarks.
#[derive(Clone, Debug)]
pub struct NormalizedMap {
    /// Index of each view in the problem, ascending.
    pub views: Vec<usize>,
    /// Index of each landmark in the problem, ascending.
    pub landmarks: Vec<usize>,
    /// Position of each point, with their median at the origin.
    pub points: Vec<Vector2<f64>>,
    /// View, landmark (both as numbered here, landmarks from 0), weight over the mean weight.
    pub sightings: Vec<(usize, usize, f64)>,
}

impl NormalizedMap {
    /// The determined part of a map; `None` when no sighting is left, or a number is not finite.
    pub fn of_map(problem: &Problem, map: &Map) -> Option<Self> {
        let views = map.poses.iter().enumerate();
        let views = views.filter_map(|(view, pose)| {
            let p = (*pose)?.translation.vector;
            Some((view, Vector2::new(p.x, p.y)))
        });
        let landmarks = map.landmarks.iter().enumerate();
        let landmarks = landmarks
            .filter_map(|(landmark, point)| point.map(|p| (landmark, Vector2::new(p.x, p.y))));
        Self::new(problem, views, landmarks)
    }

    /// A map from positions; `None` when no sighting is left, or a number is not finite.
    pub fn new(
        problem: &Problem,
        views: impl Iterator<Item = (usize, Vector2<f64>)>,
        landmarks: impl Iterator<Item = (usize, Vector2<f64>)>,
    ) -> Option<Self> {
        let mut normalized = Self {
            views: Vec::new(),
            landmarks: Vec::new(),
            points: Vec::new(),
            sightings: Vec::new(),
        };
        let mut view_number = vec![None; problem.views()];
        let mut landmark_number = vec![None; problem.landmarks()];
        for (view, place) in views {
            view_number[view] = Some(normalized.views.len());
            normalized.views.push(view);
            normalized.points.push(place);
        }
        for (landmark, place) in landmarks {
            landmark_number[landmark] = Some(normalized.landmarks.len());
            normalized.landmarks.push(landmark);
            normalized.points.push(place);
        }
        for s in problem.sightings() {
            if let (Some(view), Some(landmark)) = (view_number[s.view], landmark_number[s.landmark])
            {
                let weight = s.weight;
                normalized.sightings.push((view, landmark, weight));
            }
        }
        let squares: f64 = normalized.sightings.iter().map(|s| s.2 * s.2).sum();
        let mean = (squares / normalized.sightings.len() as f64).sqrt();
        for s in &mut normalized.sightings {
            s.2 /= mean;
        }
        normalized.normalize().then_some(normalized)
    }

    /// Moves the middle to the origin and scales the size to 1; `false` when the map has no size.
    ///
    /// Middle and size are medians, so that landmarks far away do not affect the scale of the others.
    fn normalize(&mut self) -> bool {
        let finite = |p: &Vector2<f64>| p.x.is_finite() && p.y.is_finite();
        if self.sightings.is_empty() || !self.points.iter().all(finite) {
            return false;
        }
        let middle = Vector2::new(
            median(self.points.iter().map(|p| p.x)),
            median(self.points.iter().map(|p| p.y)),
        );
        for point in &mut self.points {
            *point -= middle;
        }
        let mut size = median(self.points.iter().map(Vector2::norm));
        if size <= 0.0 {
            // More than half of all points in one place.
            size = self.points.iter().map(Vector2::norm).fold(0.0, f64::max);
        }
        if !(size > 0.0 && (1.0 / size).is_finite()) {
            return false;
        }
        for point in &mut self.points {
            *point /= size;
        }
        true
    }

    /// Number of a landmark among the points.
    pub fn point_of_landmark(&self, landmark: usize) -> usize {
        self.views.len() + landmark
    }

    /// The subject of a point, by its index in the problem.
    pub fn subject(&self, point: usize) -> Subject {
        match point.checked_sub(self.views.len()) {
            None => Subject::View(self.views[point]),
            Some(landmark) => Subject::Landmark(self.landmarks[landmark]),
        }
    }

    /// The point of a subject of the problem, if it is in the map.
    pub fn point(&self, subject: Subject) -> Option<usize> {
        match subject {
            Subject::View(view) => self.views.binary_search(&view).ok(),
            Subject::Landmark(landmark) => {
                let found = self.landmarks.binary_search(&landmark).ok();
                found.map(|number| self.point_of_landmark(number))
            }
        }
    }

    /// The points at the other ends of the sightings of a point.
    pub fn neighbours(&self, point: usize) -> Vec<usize> {
        let ends = self.sightings.iter().filter_map(|&(view, landmark, _)| {
            let other = self.point_of_landmark(landmark);
            if point == view {
                Some(other)
            } else {
                (point == other).then_some(view)
            }
        });
        ends.collect()
    }

    /// The unit of length for moves of each point, in sizes of the map: 1, or its mean distance from what
    /// it sees or is seen by, where that is more.
    pub fn units(&self) -> Vec<f64> {
        let mut sums = vec![(0.0, 0.0); self.points.len()];
        for &(view, landmark, _) in &self.sightings {
            let landmark = self.point_of_landmark(landmark);
            let distance = (self.points[view] - self.points[landmark]).norm();
            for point in [view, landmark] {
                sums[point].0 += distance;
                sums[point].1 += 1.0;
            }
        }
        let unit = |(sum, count): (f64, f64)| f64::max(1.0, sum / f64::max(count, 1.0));
        sums.into_iter().map(unit).collect()
    }
}

/// The median; 0 when there are no values.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
