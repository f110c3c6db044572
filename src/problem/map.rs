// SPDX-License-Identifier: MIT OR Apache-2.0
//! Poses and landmarks, some of which may be undetermined.

use super::magnitudes::check_estimate;
use super::priors::Prior;
use super::problem::Problem;
use super::sighting::IndexedSighting;
use super::subject::{Count, Missing, Subject, Undetermined, Why};
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::{Pose, transform_pose};
use crate::kernels::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK};
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use nalgebra::{Point2, Similarity2, Translation2, UnitComplex, Vector2};

/// Distance over the size of the map below which a landmark is on a view: a descent leaves it there at some 1e-9.
pub(crate) const ON_VIEW: f64 = 1e-6;

/// Poses and landmarks; `None` where they are not determined.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The pose of each view.
    pub poses: Vec<Option<Pose<f64>>>,
    /// The position of each landmark.
    pub landmarks: Vec<Option<Point2<f64>>>,
}

impl Map {
    /// A map in which nothing is determined.
    pub fn empty(views: usize, landmarks: usize) -> Self {
        Self {
            poses: vec![None; views],
            landmarks: vec![None; landmarks],
        }
    }

    /// Whether every pose and landmark has an estimate.
    pub fn is_complete(&self) -> bool {
        self.poses.iter().all(Option::is_some) && self.landmarks.iter().all(Option::is_some)
    }

    /// How far the landmarks are from one line: their width over their length.
    pub(crate) fn width_over_length(&self) -> f64 {
        let points = self.landmarks.iter().flatten();
        let (middle, direction) = self.line_of_landmarks();
        let (width, length) = points.fold((0.0, 0.0), |(width, length), point| {
            let offset = point.coords - middle;
            let (along, across) = (offset.dot(&direction), offset.perp(&direction));
            (width + across * across, length + along * along)
        });
        (width / length).sqrt()
    }

    /// A point and the direction of the line that the landmarks are nearest to.
    pub(crate) fn line_of_landmarks(&self) -> (Vector2<f64>, Vector2<f64>) {
        let points = || self.landmarks.iter().flatten().map(|point| point.coords);
        let middle = points().sum::<Vector2<f64>>() / points().count().max(1) as f64;
        let moments = points().map(|point| point - middle);
        let (difference, twice) = moments.fold((0.0, 0.0), |(difference, twice), d| {
            (difference + d.x * d.x - d.y * d.y, twice + 2.0 * d.x * d.y)
        });
        // At half the angle of the second moments.
        let (sin, cos) = (0.5 * f64::atan2(twice, difference)).sin_cos();
        (middle, Vector2::new(cos, sin))
    }

    /// The determined views, then landmarks.
    pub(crate) fn determined(&self) -> impl Iterator<Item = Subject> + '_ {
        let views = (0..self.poses.len()).filter(|&k| self.poses[k].is_some());
        let landmarks = (0..self.landmarks.len()).filter(|&k| self.landmarks[k].is_some());
        views
            .map(Subject::View)
            .chain(landmarks.map(Subject::Landmark))
    }

    /// The bearing residual of each sighting of a problem, predicted minus measured in (-pi, pi] (unoriented:
    /// in (-pi/2, pi/2]), in the order of [`Problem::sightings`]; `None` where view or landmark is
    /// undetermined.
    pub fn residuals<'a>(&'a self, problem: &'a Problem) -> impl Iterator<Item = Option<f64>> + 'a {
        problem.sightings().iter().map(|s| {
            let (pose, point) = (self.poses[s.view]?, self.landmarks[s.landmark]?);
            Some(problem.residual(&pose, &point, s))
        })
    }

    /// The positions of the determined views.
    pub(crate) fn view_positions(&self) -> impl Iterator<Item = Vector2<f64>> + Clone + '_ {
        self.poses
            .iter()
            .flatten()
            .map(|pose| pose.translation.vector)
    }

    /// # Errors
    /// [`Error::LengthMismatch`] when the map is not of the problem's size, [`Error::NotFinite`] and
    /// [`Error::Magnitude`] for a bad number.
    pub(crate) fn check(&self, problem: &Problem) -> Result<(), Error> {
        for (what, expected, got) in [
            ("poses", problem.views(), self.poses.len()),
            ("landmarks", problem.landmarks(), self.landmarks.len()),
        ] {
            if expected != got {
                return Err(Error::LengthMismatch {
                    what,
                    expected,
                    got,
                });
            }
        }
        let place = |pose: &Option<Pose<f64>>| pose.map(|pose| pose.translation.vector);
        let poses = self.poses.iter().map(place);
        let landmarks = self.landmarks.iter().map(|p| p.map(|p| p.coords));
        let poses = poses.enumerate().map(|(k, p)| ("poses", k, p));
        let landmarks = landmarks.enumerate().map(|(k, p)| ("landmarks", k, p));
        for (what, index, position) in poses.chain(landmarks) {
            for coordinate in position.iter().flatten() {
                check_estimate(what, index, *coordinate)?;
            }
        }
        Ok(())
    }

    /// The problem restricted to the determined views and landmarks.
    pub(crate) fn restrict(&self, problem: &Problem) -> Problem {
        let views: Vec<bool> = self.poses.iter().map(Option::is_some).collect();
        let landmarks: Vec<bool> = self.landmarks.iter().map(Option::is_some).collect();
        problem.restrict(&views, &landmarks)
    }

    /// Whether this map has all views of another.
    pub(crate) fn has_views_of(&self, other: &Self) -> bool {
        let mut pairs = self.poses.iter().zip(&other.poses);
        pairs.all(|(here, there)| here.is_some() || there.is_none())
    }

    /// Whether two maps have no view in common.
    pub(crate) fn is_apart_from(&self, other: &Self) -> bool {
        let mut pairs = self.poses.iter().zip(&other.poses);
        pairs.all(|(here, there)| here.is_none() || there.is_none())
    }

    /// The map with what another in the same frame has beyond it.
    pub(crate) fn united(&self, other: &Self) -> Self {
        let mut map = self.clone();
        for (place, pose) in map.poses.iter_mut().zip(&other.poses) {
            *place = place.or(*pose);
        }
        for (place, point) in map.landmarks.iter_mut().zip(&other.landmarks) {
            *place = place.or(*point);
        }
        map
    }

    /// The map transformed by a similarity.
    pub fn transformed(&self, similarity: &Similarity2<f64>) -> Self {
        Self {
            poses: self
                .poses
                .iter()
                .map(|pose| pose.map(|pose| transform_pose(similarity, &pose)))
                .collect(),
            landmarks: self
                .landmarks
                .iter()
                .map(|point| point.map(|point| similarity.transform_point(&point)))
                .collect(),
        }
    }

    /// The same map in the gauge of this crate: the first determined view at the origin with heading
    /// 0, and a root-mean-square distance of 1 of the other views from it.
    ///
    /// Unchanged when all views are in one place, or too far apart for the number type.
    pub fn normalized(&self) -> Self {
        let mut views = self.poses.iter().flatten();
        let Some(first) = views.next() else {
            return self.clone();
        };
        let (mut sum, mut count) = (0.0, 0.0);
        for pose in views {
            sum += (pose.translation.vector - first.translation.vector).norm_squared();
            count += 1.0;
        }
        let scale = (count / sum).sqrt();
        if !(scale > 0.0 && scale.is_finite()) {
            return self.clone();
        }
        // Differences first: they are exact however far the map is from its origin, and the sums of a shift are not.
        let home = first.translation.vector;
        let turned =
            Similarity2::from_parts(Translation2::identity(), first.rotation.inverse(), scale);
        let mut map = self.clone();
        for pose in map.poses.iter_mut().flatten() {
            pose.translation.vector -= home;
        }
        for point in map.landmarks.iter_mut().flatten() {
            point.coords -= home;
        }
        let mut map = map.transformed(&turned);
        // Make the first view exact, and rotations unit again.
        for (k, pose) in map.poses.iter_mut().flatten().enumerate() {
            if k == 0 {
                *pose = Pose::identity();
            } else {
                pose.rotation = UnitComplex::from_complex(pose.rotation.into_inner());
            }
        }
        map
    }

    /// Drops views and landmarks that the rest cannot determine, and lists all that have no estimate,
    /// with the reason.
    ///
    /// Each needs as many observations as it has unknowns; a bearing is one, odometry and priors count
    /// with their numbers.
    pub(crate) fn prune(&mut self, problem: &Problem) -> Vec<Undetermined> {
        let priors = PriorsOf::new(problem);
        loop {
            let mut dropped = false;
            for view in 0..self.poses.len() {
                if self.poses[view].is_some()
                    && self.connections_of_view(problem, view) + priors.numbers_of_view(self, view)
                        < MIN_LANDMARKS_OF_VIEW
                {
                    self.poses[view] = None;
                    dropped = true;
                }
            }
            for landmark in 0..self.landmarks.len() {
                if self.landmarks[landmark].is_some()
                    && self.connections_of_landmark(problem, landmark)
                        + priors.numbers_of_landmark(landmark)
                        < MIN_VIEWS_OF_LANDMARK
                {
                    self.landmarks[landmark] = None;
                    dropped = true;
                }
            }
            if !dropped {
                break;
            }
        }
        let views = (0..self.poses.len())
            .filter(|&view| self.poses[view].is_none())
            .map(|view| {
                (
                    Subject::View(view),
                    problem.of_view(view).len() + priors.all_numbers_of_view(view),
                    self.connections_of_view(problem, view) + priors.numbers_of_view(self, view),
                    MIN_LANDMARKS_OF_VIEW,
                )
            });
        let landmarks = (0..self.landmarks.len())
            .filter(|&landmark| self.landmarks[landmark].is_none())
            .map(|landmark| {
                let known = priors.numbers_of_landmark(landmark);
                (
                    Subject::Landmark(landmark),
                    problem.of_landmark(landmark).len() + known,
                    self.connections_of_landmark(problem, landmark) + known,
                    MIN_VIEWS_OF_LANDMARK,
                )
            });
        views
            .chain(landmarks)
            .map(|(subject, all, connected, needed)| Undetermined {
                subject,
                why: if all < needed {
                    Why::TooFewSightings { got: all, needed }
                } else if connected < needed {
                    Why::NotConnected {
                        got: connected,
                        needed,
                    }
                } else {
                    Why::Degenerate
                },
            })
            .collect()
    }

    /// The root mean square distance of the other views from the first; 1 for a single view.
    pub(crate) fn size(&self) -> f64 {
        let mut places = self
            .poses
            .iter()
            .flatten()
            .map(|pose| pose.translation.vector);
        let Some(first) = places.next() else {
            return 1.0;
        };
        let (sum, count) = places.fold((0.0, 0.0), |(sum, count), place| {
            (sum + (place - first).norm_squared(), count + 1.0)
        });
        if sum > 0.0 { (sum / count).sqrt() } else { 1.0 }
    }

    /// The landmarks that are closer than so much to a view that sees them.
    pub(crate) fn landmarks_on_views(&self, problem: &Problem, range: f64) -> Vec<usize> {
        let is_on_view = |landmark: &usize| {
            let mut rays = self.rays(problem, *landmark);
            self.landmarks[*landmark].is_some_and(|point| {
                rays.any(|(pose, _)| (pose.translation.vector - point.coords).norm() < range)
            })
        };
        (0..problem.landmarks()).filter(is_on_view).collect()
    }

    /// The determined views that see a landmark, with the sightings: the rays to triangulate it from.
    pub(crate) fn rays<'a>(
        &'a self,
        problem: &'a Problem,
        landmark: usize,
    ) -> impl Iterator<Item = (Pose<f64>, &'a IndexedSighting)> + Clone {
        problem.of_landmark(landmark).iter().filter_map(move |&k| {
            let s = &problem.sightings()[k];
            self.poses[s.view].map(|pose| (pose, s))
        })
    }

    /// The determined landmarks that a view sees, with the sightings: the points for its resection.
    pub(crate) fn seen<'a>(
        &'a self,
        problem: &'a Problem,
        view: usize,
    ) -> impl Iterator<Item = (Point2<f64>, &'a IndexedSighting)> + Clone {
        let seen = problem.of_view(view).iter();
        seen.filter_map(move |s| self.landmarks[s.landmark].map(|point| (point, s)))
    }

    /// How many determined landmarks a view sees.
    pub(crate) fn connections_of_view(&self, problem: &Problem, view: usize) -> usize {
        self.seen(problem, view).count()
    }

    /// How many determined views see a landmark.
    pub(crate) fn connections_of_landmark(&self, problem: &Problem, landmark: usize) -> usize {
        self.rays(problem, landmark).count()
    }
}

/// `12 views, 15 landmarks; 1 landmark undetermined`: how many there are, and how many are undetermined.
impl fmt::Display for Map {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (views, landmarks) = (self.poses.len(), self.landmarks.len());
        let missing = Missing {
            views: views - self.poses.iter().flatten().count(),
            landmarks: landmarks - self.landmarks.iter().flatten().count(),
        };
        let (views, landmarks) = (Count(views, "view"), Count(landmarks, "landmark"));
        write!(f, "{views}, {landmarks}{missing}")
    }
}

/// The odometry and priors of each subject.
struct PriorsOf {
    /// For each view: how many numbers its priors give, and the views at the other ends of its motions.
    views: Vec<(usize, Vec<usize>)>,
    /// For each landmark: how many numbers its priors give.
    landmarks: Vec<usize>,
}

impl PriorsOf {
    fn new(problem: &Problem) -> Self {
        let mut found = Self {
            views: Vec::new(),
            landmarks: Vec::new(),
        };
        if problem.priors().is_empty() {
            return found;
        }
        found.views.resize(problem.views(), (0, Vec::new()));
        found.landmarks.resize(problem.landmarks(), 0);
        for prior in problem.priors() {
            match prior {
                Prior::Motion { start, end, .. } => {
                    found.views[*start].1.push(*end);
                    found.views[*end].1.push(*start);
                }
                Prior::Pose { view, root, .. } => {
                    found.views[*view].0 += (0..3).filter(|&k| root[k][k] > 0.0).count();
                }
                Prior::Landmark { landmark, .. } => found.landmarks[*landmark] += 2,
            }
        }
        found
    }

    /// How many numbers the priors of a view and its motions from or to views of the map give.
    fn numbers_of_view(&self, map: &Map, view: usize) -> usize {
        let Some((known, others)) = self.views.get(view) else {
            return 0;
        };
        let ends = others.iter().filter(|&&other| map.poses[other].is_some());
        known + 3 * ends.count()
    }

    /// The same with all views at the other ends.
    fn all_numbers_of_view(&self, view: usize) -> usize {
        let own = self.views.get(view);
        own.map_or(0, |(known, others)| known + 3 * others.len())
    }

    fn numbers_of_landmark(&self, landmark: usize) -> usize {
        self.landmarks.get(landmark).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::problem::{Noise, Odometry, Sighting};

    /// A view lacks sightings only where its odometry and priors do not make up for them.
    #[test]
    fn odometry_counts_beside_sightings() {
        let sighting = |view: usize, landmark: usize| Sighting {
            view,
            landmark,
            bearing: 0.1,
            sigma: 1.0,
        };
        let sightings = [
            sighting(0, 0),
            sighting(0, 1),
            sighting(0, 2),
            sighting(1, 0),
        ];
        let problem = Problem::new(2, 3, &sightings).unwrap();
        let why = |problem: &Problem| Map::empty(2, 3).prune(problem)[1].why;
        assert_eq!(why(&problem), Why::TooFewSightings { got: 1, needed: 3 });
        let motion = Odometry {
            start: 0,
            end: 1,
            delta: Pose::identity(),
            noise: Noise::Sigmas([0.1; 3]),
        };
        let problem = problem.with_odometry(&[motion]).unwrap();
        assert_eq!(why(&problem), Why::NotConnected { got: 0, needed: 3 });
    }

    /// A landmark is on a view that is close to it and sees it, whatever its place in the list.
    #[test]
    fn landmarks_are_on_views_that_see_them() {
        let seen = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 0), (1, 1), (1, 3)];
        let sightings = seen.map(|(view, landmark)| Sighting {
            view,
            landmark,
            bearing: 0.1,
            sigma: 0.1,
        });
        let problem = Problem::new(2, 4, &sightings).unwrap();
        let mut map = Map::empty(2, 4);
        map.poses = [(0.0, 0.0), (10.0, 0.0)]
            .map(|(x, y)| Some(pose(x, y, 0.3)))
            .to_vec();
        // Next to the first view, away from both, next to the second, which does not see it, and next to that again.
        let places = [(0.05, 0.0), (5.0, 5.0), (10.0, 0.05), (9.95, 0.0)];
        map.landmarks = places.map(|(x, y)| Some(Point2::new(x, y))).to_vec();
        assert_eq!(map.landmarks_on_views(&problem, 0.1), [0, 3]);
        assert!(map.landmarks_on_views(&problem, 0.01).is_empty());
    }
}
