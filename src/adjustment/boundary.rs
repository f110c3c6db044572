// SPDX-License-Identifier: MIT OR Apache-2.0
//! Landmarks on the boundary of the space of maps: on a view, or at infinity.
//!
//! Least squares on bearings need not have a minimum. The cost may fall towards an infimum that no map attains:
//! as a landmark moves onto a view, which makes the residual of that bearing zero, or as it goes to infinity. On
//! either boundary there is a smaller problem with a minimum of its own. A landmark that comes close to one is
//! placed on it. It stays there if the cost is lower than before and rises from the boundary inwards, (T23);
//! otherwise the descent returns to where it entered the boundary.

use super::bundle::{Bundle, Rows};
use super::step_solver::BundleAdjustment;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::{centroid, horizon, spread};
use crate::problem::{Problem, Subject};
use alloc::vec::Vec;
use nalgebra::{Point2, Vector2};

// The first three constants decide only when a boundary is tried, which costs time; whether the landmark stays
// there is decided by comparing costs.

/// Range of a landmark from its nearest view, as a fraction of that from the next one, below which it is tried
/// on that view.
const TOUCHING: f64 = 0.05;

/// Distance of a landmark from the middle of the views, in root mean square distances of the views from it,
/// beyond which it is tried at infinity.
const FAR: f64 = 20.0;

/// Fraction of its distance at the last attempt below which a landmark is tried again on a boundary that was not
/// lower: each attempt is ten times closer than the one before, so there are only a few.
const CLOSER: f64 = 0.1;

/// Distance of a landmark at infinity from the middle of the views, in root mean square distances of the views from it,
/// below which it is at infinity no more: the descent has enlarged the map until its parallax is within reach of the
/// bearings. It is entered at some 1e7.
const NO_LONGER_INFINITE: f64 = 1e4;

/// Iterations within which a boundary must become lower than the interior: bounds the time of a failed attempt.
const ATTEMPT: usize = 10;

/// A part of the boundary of the space of maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Boundary {
    /// The landmark of the sighting with this index is on its view.
    View(usize),
    /// The landmark with this index is at infinity.
    Infinity(usize),
}

impl Boundary {
    /// The landmark on this boundary.
    fn landmark(self, problem: &Problem) -> usize {
        match self {
            Self::View(sighting) => problem.sightings()[sighting].landmark,
            Self::Infinity(landmark) => landmark,
        }
    }
}

/// A boundary that is tried or kept, and the state before it was entered.
struct BoundaryTrial {
    boundary: Boundary,
    /// Relative distance of the landmark from the boundary: see [`TOUCHING`], and one over [`FAR`].
    distance: f64,
    /// The bundle before, and its cost.
    bundle: Bundle,
    cost: f64,
}

/// The boundaries that the landmarks of a problem are on.
pub struct Boundaries<'a> {
    problem: &'a Problem,
    /// Which landmarks have a prior.
    pub known: Vec<bool>,
    /// In the order in which they were entered.
    entered: Vec<BoundaryTrial>,
    /// Those that were not lower, and the distance at the last attempt.
    refused: Vec<(Boundary, f64)>,
    /// The one to be tried next, and the distance from it.
    candidate: Option<(Boundary, f64)>,
}

impl<'a> Boundaries<'a> {
    pub fn new(problem: &'a Problem) -> Self {
        Self {
            problem,
            known: problem.known_landmarks(),
            entered: Vec::new(),
            refused: Vec::new(),
            candidate: None,
        }
    }

    /// The boundary that a landmark is on, if any.
    pub fn of_landmark(&self, landmark: usize) -> Option<Boundary> {
        let mut boundaries = self.entered.iter().map(|trial| trial.boundary);
        boundaries.find(|boundary| boundary.landmark(self.problem) == landmark)
    }

    /// The total number of iterations at which the next run must end, at most `limit`.
    pub fn limit_of_run(&self, adjustment: &BundleAdjustment<'_, '_>, limit: usize) -> usize {
        if self.is_undecided(adjustment.cost) {
            limit.min(adjustment.iterations + ATTEMPT)
        } else {
            limit
        }
    }

    /// Whether the last boundary is not yet lower than the interior.
    fn is_undecided(&self, cost: f64) -> bool {
        self.entered.last().is_some_and(|last| cost >= last.cost)
    }

    /// Looks for a landmark close to a boundary, for [`Boundaries::enter_candidate`] to enter; returns whether
    /// there is one.
    pub fn find_candidate(&mut self, bundle: &Bundle, rows: &Rows, cost: f64) -> bool {
        // A bearing modulo pi continues behind its view and through infinity: there is no boundary.
        if !self.problem.is_oriented() || self.is_undecided(cost) {
            return false;
        }
        let (middle, size) = middle(bundle);
        for landmark in 0..bundle.landmarks.len() {
            if self.of_landmark(landmark).is_some() {
                continue;
            }
            let (sighting, distance) = self.nearest_view(landmark, rows);
            let away = (bundle.landmarks[landmark].coords - middle).norm();
            let candidates = [
                (Boundary::View(sighting), distance, TOUCHING),
                (Boundary::Infinity(landmark), size / away, 1.0 / FAR),
            ];
            for (boundary, distance, bound) in candidates {
                if distance < bound && self.may_try(boundary, distance) {
                    self.candidate = Some((boundary, distance));
                    return true;
                }
            }
        }
        false
    }

    /// The sighting of a landmark from its nearest view, and its range as a fraction of that from the next one.
    fn nearest_view(&self, landmark: usize, rows: &Rows) -> (usize, f64) {
        let rows = &rows.sightings;
        let (mut nearest, mut next) = ((f64::INFINITY, 0), f64::INFINITY);
        for &k in self.problem.of_landmark(landmark) {
            let range = rows[k].weight / rows[k].gradient.norm();
            if range < nearest.0 {
                next = nearest.0;
                nearest = (range, k);
            } else {
                next = next.min(range);
            }
        }
        (nearest.1, nearest.0 / next)
    }

    /// Whether a boundary, which may have been refused before, is worth an attempt from this distance.
    fn may_try(&self, boundary: Boundary, distance: f64) -> bool {
        self.refused
            .iter()
            .find(|(other, _)| *other == boundary)
            .is_none_or(|(_, then)| distance < *then * CLOSER)
            && match boundary {
                // A prior keeps it near.
                Boundary::Infinity(landmark) => !self.known[landmark],
                Boundary::View(_) => true,
            }
    }

    /// Moves the landmark of the candidate onto its boundary; `false` when there is no candidate.
    pub fn enter_candidate(&mut self, adjustment: &mut BundleAdjustment<'_, '_>) -> bool {
        let Some((boundary, distance)) = self.candidate.take() else {
            return false;
        };
        let mut bundle = adjustment.bundle.clone();
        match boundary {
            Boundary::View(k) => {
                let s = &self.problem.sightings()[k];
                bundle.landmarks[s.landmark] = bundle.poses[s.view].translation.vector.into();
            }
            Boundary::Infinity(landmark) => {
                let (middle, _) = middle(&bundle);
                let direction = (bundle.landmarks[landmark].coords - middle).normalize();
                bundle.landmarks[landmark] = Point2::from(middle + direction * horizon::<f64>());
            }
        }
        let before = core::mem::replace(&mut adjustment.bundle, bundle);
        self.entered.push(BoundaryTrial {
            boundary,
            distance,
            bundle: before,
            cost: adjustment.cost,
        });
        adjustment.relinearize();
        true
    }

    /// Undoes the first boundary that is not lower than the interior, or from which the cost falls inwards, or that has
    /// come near, and all boundaries entered after it; `false` when there is none.
    pub fn leave_wrong(&mut self, adjustment: &mut BundleAdjustment<'_, '_>) -> bool {
        let wrong = if self.is_undecided(adjustment.cost) {
            Some(self.entered.len() - 1)
        } else {
            let mut boundaries = self.entered.iter().map(|trial| trial.boundary);
            boundaries.position(|boundary| {
                self.falls_inwards(boundary, adjustment) || self.has_come_near(boundary, adjustment)
            })
        };
        wrong.is_some_and(|wrong| self.leave_from(wrong, adjustment))
    }

    /// Undoes a boundary and all that were entered after it; `false` when there is none.
    fn leave_from(&mut self, wrong: usize, adjustment: &mut BundleAdjustment<'_, '_>) -> bool {
        let Some(trial) = self.entered.drain(wrong..).next() else {
            return false;
        };
        self.refused
            .retain(|(boundary, _)| *boundary != trial.boundary);
        self.refused.push((trial.boundary, trial.distance));
        adjustment.bundle = trial.bundle;
        adjustment.relinearize();
        true
    }

    /// Whether the cost falls as the landmark leaves its boundary, violating (T23).
    fn falls_inwards(&self, boundary: Boundary, adjustment: &BundleAdjustment<'_, '_>) -> bool {
        let bundle = &adjustment.bundle;
        let landmark = boundary.landmark(self.problem);
        let seen = self.problem.of_landmark(landmark).iter();
        let slope = match boundary {
            Boundary::View(k) => {
                let ray = self.ray(bundle, k);
                let rows = &adjustment.rows;
                let seen = seen.map(|&k| &rows.sightings[k]);
                let of_sightings: f64 = seen.map(|row| row.gradient.dot(&ray) * row.residual).sum();
                let known = rows.priors.iter();
                let of_priors: f64 = known
                    .filter(|row| row.first.0 == Subject::Landmark(landmark))
                    .flat_map(|row| row.first.1.iter().zip(row.residual))
                    .map(|(slope, residual)| (slope[0] * ray.x + slope[1] * ray.y) * residual)
                    .sum();
                of_sightings + of_priors
            }
            Boundary::Infinity(_) => {
                let (middle, _) = middle(bundle);
                let direction = (bundle.landmarks[landmark].coords - middle).normalize();
                seen.fold(0.0, |sum, &k| {
                    let view = self.problem.sightings()[k].view;
                    let row = &adjustment.rows.sightings[k];
                    let offset = middle - bundle.poses[view].translation.vector;
                    sum + direction.perp(&offset) * row.weight * row.residual
                })
            }
        };
        slope < 0.0
    }

    /// Whether a landmark at infinity has come near, because the map has grown.
    fn has_come_near(&self, boundary: Boundary, adjustment: &BundleAdjustment<'_, '_>) -> bool {
        let Boundary::Infinity(landmark) = boundary else {
            return false;
        };
        let (middle, size) = middle(&adjustment.bundle);
        let away = (adjustment.bundle.landmarks[landmark].coords - middle).norm();
        !(away > size * NO_LONGER_INFINITE)
    }

    /// Direction of a measured bearing in the map.
    fn ray(&self, bundle: &Bundle, sighting: usize) -> Vector2<f64> {
        let s = &self.problem.sightings()[sighting];
        let ray = bundle.poses[s.view].rotation.into_inner() * s.bearing.into_inner();
        Vector2::new(ray.re, ray.im)
    }

    /// Moves each landmark that is on a view off it along its measured bearing, because on the view it has no
    /// bearing; the distance is too small to change the cost. Where it does change it, because other views are in the same
    /// place, the state before the first boundary returns, and `false`.
    pub fn step_inside(&mut self, adjustment: &mut BundleAdjustment<'_, '_>) -> bool {
        for trial in &self.entered {
            if let Boundary::View(k) = trial.boundary {
                let view = self.problem.sightings()[k].view;
                let place = adjustment.bundle.poses[view].translation.vector.amax();
                // Far from the origin, so much that rounding leaves its bearing.
                let step = f64::EPSILON.sqrt() * 0.1 * place.max(1.0);
                let step = self.ray(&adjustment.bundle, k) * step;
                adjustment.bundle.landmarks[trial.boundary.landmark(self.problem)] += step;
            }
        }
        let Some(entered_at) = self.entered.first().map(|first| first.cost) else {
            return true;
        };
        adjustment.relinearize();
        adjustment.cost < entered_at || !self.leave_from(0, adjustment)
    }
}

/// Whether a landmark is so close to a boundary that the minimum may lie there.
pub fn near_boundary(adjustment: &BundleAdjustment<'_, '_>) -> bool {
    Boundaries::new(adjustment.problem).find_candidate(
        &adjustment.bundle,
        &adjustment.rows,
        adjustment.cost,
    )
}

/// The middle of the views and their root mean square distance from it.
fn middle(bundle: &Bundle) -> (Vector2<f64>, f64) {
    let views: Vec<_> = bundle.poses.iter().map(|p| p.translation.vector).collect();
    let size = (spread(&views) / (views.len() as f64)).sqrt();
    (centroid(&views), size)
}

#[cfg(test)]
impl<'a> Boundaries<'a> {
    /// With landmarks that are on these boundaries of a bundle.
    pub fn entered(problem: &'a Problem, bundle: &Bundle, boundaries: &[Boundary]) -> Self {
        let trials = boundaries.iter().map(|&boundary| BoundaryTrial {
            boundary,
            distance: 0.0,
            bundle: bundle.clone(),
            cost: 0.0,
        });
        Self {
            entered: trials.collect(),
            ..Self::new(problem)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::lm::RefineOptions;
    use crate::problem::{LandmarkPrior, Noise};

    /// Four views and landmarks in the plane, the last one twice as far from its nearest view as from none.
    fn bundle(last: Point2<f64>) -> Bundle {
        let poses = [
            (0.0, 0.0, 0.3),
            (2.0, 0.0, 2.5),
            (2.0, 2.0, -1.1),
            (0.0, 2.0, 0.9),
        ];
        Bundle {
            poses: poses.map(|(x, y, theta)| pose(x, y, theta)).to_vec(),
            landmarks: Vec::from([Point2::new(1.0, 0.7), Point2::new(0.8, 3.0), last]),
        }
    }

    fn bearings(k: u32) -> [f64; 12] {
        core::array::from_fn(|s| (f64::from(k) + 2.7 * s as f64).sin() * 3.0)
    }

    fn adjusted<'a>(
        problem: &'a Problem,
        options: &'a RefineOptions,
        bundle: Bundle,
    ) -> BundleAdjustment<'a, 'static> {
        BundleAdjustment::new(problem, options, None, bundle).unwrap()
    }

    /// A landmark is tried on a view at a twentieth of its distance from the next one, and at infinity from twenty sizes of
    /// the map on; modulo pi never, and at infinity not where a prior keeps it.
    #[test]
    fn landmarks_close_to_a_boundary_are_candidates() {
        let options = RefineOptions::default();
        let problem = Problem::dense(4, 3, &bearings(1), 0.1).unwrap();
        let known = LandmarkPrior {
            landmark: 2,
            position: Point2::new(3.0, 3.0),
            noise: Noise::Sigmas([1.0, 1.0]),
        };
        let tied = problem.clone().with_landmark_priors(&[known]).unwrap();
        // The middle of the views is at (1, 1), their root mean square distance from it the root of two.
        let size = 2.0_f64.sqrt();
        let away = |sizes: f64| Point2::new(1.0 - size * sizes, 1.0);
        // On the way from the view at (2, 0) to that at (2, 2).
        let between = |share: f64| Point2::new(2.0, 2.0 * share / (1.0 + share));
        let sighting = 3 + 2;
        for (last, expected) in [
            (Point2::new(1.5, 1.5), None),
            (between(0.049), Some((Boundary::View(sighting), 0.049))),
            (between(0.051), None),
            (between(-0.04), Some((Boundary::View(sighting), 0.04 / 1.0))),
            (away(19.9), None),
            (away(20.1), Some((Boundary::Infinity(2), 1.0 / 20.1))),
        ] {
            let bundle = bundle(last);
            let at = adjusted(&problem, &options, bundle.clone());
            let mut boundaries = Boundaries::new(&problem);
            let found = boundaries.find_candidate(&bundle, &at.rows, at.cost);
            assert_eq!(found, expected.is_some(), "{last}");
            assert_eq!(near_boundary(&at), found, "{last}");
            if let (Some((boundary, distance)), Some((expected, share))) =
                (boundaries.candidate, expected)
            {
                assert_eq!(boundary, expected, "{last}");
                let off = if last.y < 0.0 { 0.1 } else { 1e-9 };
                assert!(
                    (distance / share - 1.0).abs() < off,
                    "{last}: {distance} {share}"
                );
            }
            let lines = problem.clone().unoriented();
            assert!(!near_boundary(&adjusted(&lines, &options, bundle.clone())));
            let near = near_boundary(&adjusted(&tied, &options, bundle));
            assert_eq!(
                near,
                matches!(expected, Some((Boundary::View(_), _))),
                "{last}"
            );
        }
    }

    /// What was refused from a distance is tried again from a tenth of it.
    #[test]
    fn a_refused_boundary_is_tried_again_ten_times_closer() {
        let problem = Problem::dense(4, 3, &bearings(1), 0.1).unwrap();
        let mut boundaries = Boundaries::new(&problem);
        let [view, infinity] = [Boundary::View(5), Boundary::Infinity(2)];
        boundaries.refused = Vec::from([(infinity, 0.01), (view, 0.03)]);
        assert!(!boundaries.may_try(view, 0.0031) && boundaries.may_try(view, 0.0029));
        assert!(!boundaries.may_try(infinity, 0.0011) && boundaries.may_try(infinity, 0.0009));
        assert!(boundaries.may_try(Boundary::View(4), 0.04));
        boundaries.known[2] = true;
        assert!(!boundaries.may_try(infinity, 0.0009) && boundaries.may_try(view, 0.0029));
    }

    /// On a boundary the cost falls inwards where a short step off it lowers the cost.
    #[test]
    fn the_slope_at_a_boundary_is_that_of_the_cost() {
        let options = RefineOptions::default();
        let (mut falls, mut rises) = (0, 0);
        for k in 0..20 {
            let alone = Problem::dense(4, 3, &bearings(k), 0.5).unwrap();
            let known = LandmarkPrior {
                landmark: 2,
                position: Point2::new(2.3, 0.4 - 0.05 * f64::from(k)),
                noise: Noise::Covariance([[0.3, 0.1], [0.1, 0.2]]),
            };
            let known = alone.clone().with_landmark_priors(&[known]).unwrap();
            for problem in [&alone, &known] {
                let sighting = 3 + 2;
                let view = Boundary::View(sighting);
                let place = bundle(Point2::new(2.0, 0.0));
                let boundaries = Boundaries::entered(problem, &place, &[view]);
                let ray = boundaries.ray(&place, sighting);
                let falling = boundaries.falls_inwards(view, &adjusted(problem, &options, place));
                // Off the view its own bearing has no residual, along the ray.
                let cost = |step: f64| {
                    let off = bundle(Point2::from(Vector2::new(2.0, 0.0) + ray * step));
                    adjusted(problem, &options, off).cost
                };
                let change = cost(2e-5) - cost(1e-5);
                assert_eq!(falling, change < 0.0, "{k}: {change:e}");
                falls += usize::from(falling);
                rises += usize::from(!falling);
            }
            let direction = Vector2::new((0.9 * f64::from(k)).cos(), (0.9 * f64::from(k)).sin());
            let at = |range: f64| bundle(Point2::from(Vector2::new(1.0, 1.0) + direction * range));
            let far = at(horizon::<f64>());
            let infinity = Boundary::Infinity(2);
            let boundaries = Boundaries::entered(&alone, &far, &[infinity]);
            let falling = boundaries.falls_inwards(infinity, &adjusted(&alone, &options, far));
            let cost = |range: f64| adjusted(&alone, &options, at(range)).cost;
            let change = cost(1e4) - cost(2e4);
            assert_eq!(falling, change < 0.0, "{k}: {change:e}");
        }
        assert!(falls > 5 && rises > 5, "{falls} {rises}");
    }

    /// A landmark enters a view at its place and infinity straight away from the middle of the views; what is not lower, or
    /// falls inwards, goes back to where it came from with all that was entered since, and is remembered.
    #[test]
    fn wrong_boundaries_are_left_the_way_they_were_entered() {
        let options = RefineOptions::default();
        let problem = Problem::dense(4, 3, &bearings(4), 0.1).unwrap();
        let start = bundle(Point2::new(1.9, 0.1));
        let mut at = adjusted(&problem, &options, start.clone());
        let before = at.cost;
        let mut boundaries = Boundaries::new(&problem);
        assert!(!boundaries.enter_candidate(&mut at) && !boundaries.leave_wrong(&mut at));
        boundaries.candidate = Some((Boundary::Infinity(1), 0.02));
        assert!(boundaries.enter_candidate(&mut at));
        boundaries.candidate = Some((Boundary::View(5), 0.04));
        assert!(boundaries.enter_candidate(&mut at));
        assert_eq!(at.bundle.landmarks[2], Point2::new(2.0, 0.0));
        let out = at.bundle.landmarks[1] - Point2::new(1.0, 1.0);
        assert!((out.norm() / horizon::<f64>() - 1.0).abs() < 1e-12);
        let along = start.landmarks[1] - Point2::new(1.0, 1.0);
        assert!((out.normalize() - along.normalize()).norm() < 1e-12);
        assert_eq!(at.bundle.landmarks[0], start.landmarks[0]);
        assert_eq!(
            at.cost,
            at.bundle
                .linearize(&problem, options.loss, &mut Rows::of(&problem))
        );
        let entered = [0, 1].map(|k: usize| boundaries.entered[k].boundary);
        assert_eq!(entered, [Boundary::Infinity(1), Boundary::View(5)]);
        assert_eq!(boundaries.of_landmark(1), Some(entered[0]));
        assert_eq!(boundaries.of_landmark(0), None);
        // Not lower than before it was entered: the last one goes, and later the first.
        at.cost = f64::INFINITY;
        assert_eq!(boundaries.limit_of_run(&at, 100), ATTEMPT);
        assert!(boundaries.leave_wrong(&mut at));
        assert_eq!(at.bundle.landmarks[2], start.landmarks[2]);
        assert_eq!(boundaries.refused, [(Boundary::View(5), 0.04)]);
        assert_eq!(boundaries.entered.len(), 1);
        at.cost = f64::INFINITY;
        assert!(boundaries.leave_wrong(&mut at));
        assert_eq!(at.bundle.landmarks, start.landmarks);
        assert_eq!(at.cost, before);
        assert_eq!(boundaries.refused.len(), 2);
        assert_eq!(boundaries.limit_of_run(&at, 100), 100);
        // Refused again, only the last distance is remembered.
        boundaries.candidate = Some((Boundary::View(5), 0.003));
        assert!(boundaries.enter_candidate(&mut at) && boundaries.leave_from(0, &mut at));
        assert_eq!(boundaries.refused[1], (Boundary::View(5), 0.003));
        assert_eq!(boundaries.refused.len(), 2);
    }

    /// A landmark at infinity has come near once the map has grown to a ten-thousandth of its distance.
    #[test]
    fn a_landmark_at_infinity_comes_near_as_the_map_grows() {
        let options = RefineOptions::default();
        let problem = Problem::dense(4, 3, &bearings(4), 0.1).unwrap();
        let size = 2.0_f64.sqrt();
        for (sizes, near) in [(0.99e4, true), (1.01e4, false)] {
            let place = bundle(Point2::new(1.0, 1.0 + sizes * size));
            let at = adjusted(&problem, &options, place.clone());
            let boundaries = Boundaries::entered(&problem, &place, &[]);
            assert_eq!(boundaries.has_come_near(Boundary::Infinity(2), &at), near);
            assert!(!boundaries.has_come_near(Boundary::View(5), &at));
        }
    }

    /// In the end a landmark on a view stands next to it, where it is seen, and the cost stays; where another view in the
    /// same place makes it rise, the state before returns.
    #[test]
    fn landmarks_step_off_their_views_along_their_rays() {
        let options = RefineOptions::default();
        let problem = Problem::dense(4, 3, &bearings(4), 0.1).unwrap();
        for away in [0.0, 3e4] {
            let moved = |last: Point2<f64>| {
                let mut bundle = bundle(last);
                bundle.transform(&nalgebra::Similarity2::new(
                    Vector2::new(away, 0.0),
                    0.0,
                    1.0,
                ));
                bundle
            };
            let start = moved(Point2::new(1.7, 0.2));
            let mut at = adjusted(&problem, &options, start.clone());
            let mut boundaries = Boundaries::new(&problem);
            assert!(boundaries.step_inside(&mut at));
            assert_eq!(at.bundle.landmarks, start.landmarks);
            boundaries.candidate = Some((Boundary::View(5), 0.04));
            assert!(boundaries.enter_candidate(&mut at));
            let on_view = at.cost;
            boundaries.entered[0].cost = 2.0 * on_view;
            assert!(boundaries.step_inside(&mut at));
            let view = at.bundle.poses[1].translation.vector;
            let off = at.bundle.landmarks[2].coords - view;
            assert!(off.norm() > 1e-9 && off.norm() < 1e-3, "{off}");
            let ray = boundaries.ray(&at.bundle, 5);
            assert!((off.normalize() - ray).norm() < 1e-2, "{off} {ray}");
            assert!((at.cost / on_view - 1.0).abs() < 1e-2 * (1.0 + away));
            boundaries.entered[0].cost = 0.5 * on_view;
            assert!(!boundaries.step_inside(&mut at));
            assert_eq!(at.bundle.landmarks, start.landmarks);
        }
    }
}
