// SPDX-License-Identifier: MIT OR Apache-2.0
//! What priors know of single views and landmarks, and views located by that and by the landmarks of a map.
//!
//! A view has three unknowns, and each of these fixes them: a known pose; a motion from or to a placed view; a known
//! position and one landmark; a known heading and two landmarks, or one and a known coordinate; three landmarks, or two
//! and a known coordinate.

use super::super::grow::resect_view;
use super::super::incremental::place::backward;
use super::super::robust::motions::{Motions, PoseTerm, descend_view};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Pose;
use crate::lm::Loss;
use crate::problem::{IndexedSighting, Map, Prior, Problem};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{Complex, Point2, Translation2, UnitComplex, Vector2};

/// Most landmarks whose pairs are tried for a view of known heading: a few dozen pairs are enough, and their number
/// grows with the square.
const PAIRED: usize = 10;

/// Most steps of Gauss-Newton for a view; its three unknowns need a few.
const STEPS: usize = 10;

/// What priors know, in the map frame.
pub struct Known {
    /// Positions of views of which both coordinates are known.
    pub positions: Vec<Option<Vector2<f64>>>,
    /// Of views of which one coordinate is known: its axis and its value.
    coordinates: Vec<Option<(usize, f64)>>,
    /// Headings of views.
    pub headings: Vec<Option<UnitComplex<f64>>>,
    /// Positions of landmarks.
    pub landmarks: Vec<Option<Point2<f64>>>,
    /// The priors of each view.
    terms: Vec<Vec<PoseTerm>>,
}

impl Known {
    pub fn of(problem: &Problem) -> Self {
        let mut known = Self {
            positions: vec![None; problem.views()],
            coordinates: vec![None; problem.views()],
            headings: vec![None; problem.views()],
            landmarks: vec![None; problem.landmarks()],
            terms: (0..problem.views()).map(|_| Vec::new()).collect(),
        };
        for prior in problem.priors() {
            match prior {
                Prior::Landmark {
                    landmark, position, ..
                } => known.landmarks[*landmark] = Some(*position),
                Prior::Pose { view, pose, root } => {
                    let place = pose.translation.vector;
                    match [0, 1].map(|axis| root[axis][axis] > 0.0) {
                        [true, true] => known.positions[*view] = Some(place),
                        [true, false] => known.coordinates[*view] = Some((0, place.x)),
                        [false, true] => known.coordinates[*view] = Some((1, place.y)),
                        [false, false] => {}
                    }
                    if root[2][2] > 0.0 {
                        known.headings[*view] = Some(pose.rotation);
                    }
                    known.terms[*view].push(PoseTerm::prior(pose, root));
                }
                Prior::Motion { .. } => {}
            }
        }
        known
    }

    /// The poses and landmarks that are known as they are.
    pub fn map(&self) -> Map {
        let pairs = self.positions.iter().zip(&self.headings);
        Map {
            poses: pairs
                .map(|(position, heading)| Some(at((*position)?, (*heading)?)))
                .collect(),
            landmarks: self.landmarks.clone(),
        }
    }

    /// The view without a pose that most is known of, with its pose by that and by the landmarks of the map, as
    /// [`locate`](Self::locate) finds it.
    pub fn locate_next(
        &self,
        problem: &Problem,
        map: &Map,
        motions: &Motions,
        framed: bool,
    ) -> Option<(usize, Pose<f64>)> {
        let known = |view: usize| {
            2 * usize::from(self.positions[view].is_some())
                + usize::from(self.coordinates[view].is_some())
                + usize::from(self.headings[view].is_some())
                + 3 * motions.terms(map, view).count()
        };
        let mut missing: Vec<(usize, usize)> = (0..map.poses.len())
            .filter(|&view| map.poses[view].is_none())
            .map(|view| {
                let known = if framed { known(view) } else { 0 };
                (map.connections_of_view(problem, view) + known, view)
            })
            .collect();
        missing.sort_by_key(|&(count, view)| (core::cmp::Reverse(count), view));
        missing.into_iter().find_map(|(_, view)| {
            let pose = self.locate(problem, map, view, motions, framed)?;
            Some((view, pose))
        })
    }

    /// The pose of a view in the map frame from what is known of it and of its landmarks; `None` when that does not fix
    /// it.
    ///
    /// Of the poses that the smallest sets fix, the one that explains most, then the minimum next to it. In a map that is
    /// not `framed`, not in the frame of the priors, landmarks alone count.
    pub fn locate(
        &self,
        problem: &Problem,
        map: &Map,
        view: usize,
        motions: &Motions,
        framed: bool,
    ) -> Option<Pose<f64>> {
        let resected = resect_view(problem, map, view).map(|(pose, _)| pose);
        if !framed {
            return resected;
        }
        let seen: Vec<_> = map.seen(problem, view).collect();
        let mut candidates: Vec<Pose<f64>> = Vec::new();
        candidates.extend(resected);
        match (self.positions[view], self.headings[view]) {
            (Some(position), Some(heading)) => candidates.push(at(position, heading)),
            (Some(position), None) => {
                candidates.extend(
                    seen.iter()
                        .filter_map(|(point, s)| turned_to(position, point, s)),
                );
            }
            (None, Some(heading)) => candidates.extend(by_pairs(problem, heading, &seen)),
            (None, None) => {}
        }
        if let Some(coordinate) = self.coordinates[view] {
            match self.headings[view] {
                Some(heading) => candidates.extend(
                    seen.iter()
                        .filter_map(|(point, s)| on_line(coordinate, heading, point, s)),
                ),
                None => candidates.extend(on_circles(coordinate, &seen)),
            }
        }
        let mut terms = self.terms[view].clone();
        terms.extend(motions.terms(map, view));
        candidates.extend(motions.terms(map, view).map(|term| term.wanted));
        let cost = |pose: &Pose<f64>| -> f64 {
            let priors = self.terms[view].iter();
            priors.map(|term| term.square(pose)).sum::<f64>()
                + motions.cost(problem, map, view, pose)
        };
        let best = candidates
            .into_iter()
            .min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
        let loss = Loss::Cauchy(Loss::<f64>::CAUCHY);
        Some(descend_view(problem, &seen, &terms, loss, best, STEPS))
    }
}

fn at(position: Vector2<f64>, heading: UnitComplex<f64>) -> Pose<f64> {
    Pose::from_parts(Translation2::from(position), heading)
}

/// A view at a position, turned so that it sees a point where it does.
fn turned_to(
    position: Vector2<f64>,
    point: &Point2<f64>,
    s: &IndexedSighting,
) -> Option<Pose<f64>> {
    let offset = point.coords - position;
    let norm = offset.norm();
    (norm > 0.0).then(|| {
        let toward = Complex::new(offset.x / norm, offset.y / norm);
        at(
            position,
            UnitComplex::new_unchecked(toward * s.bearing.into_inner().conj()),
        )
    })
}

/// Views of a heading that see two of their landmarks where they are.
fn by_pairs(
    problem: &Problem,
    heading: UnitComplex<f64>,
    seen: &[(Point2<f64>, &IndexedSighting)],
) -> Vec<Pose<f64>> {
    let mut found = Vec::new();
    for (k, first) in seen.iter().take(PAIRED).enumerate() {
        for second in seen.iter().take(k) {
            found.extend(backward(heading, first, second, problem.is_oriented()));
        }
    }
    found
}

/// A view of a heading that has a coordinate, on the ray backward from a landmark.
fn on_line(
    (axis, value): (usize, f64),
    heading: UnitComplex<f64>,
    point: &Point2<f64>,
    s: &IndexedSighting,
) -> Option<Pose<f64>> {
    let ray = (heading * s.bearing).into_inner();
    let ray = Vector2::new(ray.re, ray.im);
    let range = (point[axis] - value) / ray[axis];
    range
        .is_finite()
        .then(|| at(point.coords - ray * range, heading))
}

/// Views that have a coordinate and see two landmarks under their angle: where the line meets the two circles of the
/// points that do so modulo pi.
fn on_circles(
    (axis, value): (usize, f64),
    seen: &[(Point2<f64>, &IndexedSighting)],
) -> Vec<Pose<f64>> {
    let mut found = Vec::new();
    for (k, (first, one)) in seen.iter().take(PAIRED).enumerate() {
        for (second, two) in seen.iter().take(k) {
            let between = (one.bearing.inverse() * two.bearing).into_inner();
            let half = (second - first) * 0.5;
            let off = Vector2::new(-half.y, half.x) * (between.re / between.im);
            for off in [off, -off] {
                let center = first + half + off;
                let across = value - center[axis];
                let square = (half + off).norm_squared() - across * across;
                if !(square >= 0.0) {
                    continue;
                }
                for along in [square.sqrt(), -square.sqrt()] {
                    let mut place = center.coords;
                    place[axis] = value;
                    place[1 - axis] += along;
                    found.extend(turned_to(place, first, one));
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{bearing_to, pose};
    use crate::problem::{LandmarkPrior, Noise, Odometry, PosePrior, Sighting};

    /// A view in its place among five landmarks that it sees exactly.
    fn setting() -> (Pose<f64>, Map, Problem) {
        let truth = pose(1.0, -2.0, 0.7);
        let points = [
            (4.0, 1.0),
            (-1.0, 3.0),
            (2.5, -3.0),
            (0.0, -5.0),
            (-3.0, -1.0),
        ];
        let mut map = Map::empty(2, 5);
        map.landmarks = points.map(|(x, y)| Some(Point2::new(x, y))).to_vec();
        let sightings = map
            .landmarks
            .iter()
            .flatten()
            .enumerate()
            .map(|(landmark, point)| Sighting {
                view: 0,
                landmark,
                bearing: bearing_to(&truth, point).unwrap().angle(),
                sigma: 0.01,
            });
        let problem = Problem::new(2, 5, &sightings.collect::<Vec<_>>()).unwrap();
        (truth, map, problem)
    }

    fn apart(a: &Pose<f64>, b: &Pose<f64>) -> f64 {
        let error = a.inv_mul(b);
        error.translation.vector.norm() + error.rotation.angle().abs()
    }

    #[test]
    fn what_priors_tell_of_each_view_is_known() {
        let free = f64::INFINITY;
        let prior = |view: usize, sigmas| PosePrior {
            view,
            pose: pose(view as f64, 5.0, 0.3),
            noise: Noise::Sigmas(sigmas),
        };
        let problem = Problem::dense(5, 2, &[0.1; 10], 0.1).unwrap();
        let priors = [
            prior(0, [0.1, 0.1, free]),
            prior(1, [0.1, free, 0.1]),
            prior(2, [free, 0.1, free]),
            prior(3, [0.1; 3]),
        ];
        let problem = problem.with_pose_priors(&priors).unwrap();
        let landmark = LandmarkPrior {
            landmark: 1,
            position: Point2::new(3.0, 4.0),
            noise: Noise::Sigmas([0.1, 0.1]),
        };
        let known = Known::of(&problem.with_landmark_priors(&[landmark]).unwrap());
        let place = |view: usize| Some(Vector2::new(view as f64, 5.0));
        assert_eq!(known.positions, [place(0), None, None, place(3), None]);
        let coordinates = [None, Some((0, 1.0)), Some((1, 5.0)), None, None];
        assert_eq!(known.coordinates, coordinates);
        assert_eq!(
            known
                .headings
                .iter()
                .map(Option::is_some)
                .collect::<Vec<_>>(),
            [false, true, false, true, false]
        );
        assert_eq!(
            known.terms.iter().map(Vec::len).collect::<Vec<_>>(),
            [1, 1, 1, 1, 0]
        );
        let map = known.map();
        assert_eq!(map.landmarks, [None, Some(Point2::new(3.0, 4.0))]);
        let posed: Vec<usize> = (0..5).filter(|&view| map.poses[view].is_some()).collect();
        assert_eq!(posed, [3]);
        assert!(apart(&map.poses[3].unwrap(), &pose(3.0, 5.0, 0.3)) < 1e-12);
    }

    /// Each of the smallest sets that fix a view contains the true pose among its solutions.
    #[test]
    fn the_smallest_sets_fix_a_view() {
        let (truth, map, problem) = setting();
        let seen: Vec<_> = map.seen(&problem, 0).collect();
        let place = truth.translation.vector;
        for (point, s) in &seen {
            let found = turned_to(place, point, s).unwrap();
            assert!(apart(&found, &truth) < 1e-12);
            assert!(turned_to(point.coords, point, s).is_none());
            for axis in 0..2 {
                let found = on_line((axis, place[axis]), truth.rotation, point, s).unwrap();
                assert!(apart(&found, &truth) < 1e-12);
            }
        }
        let pairs = by_pairs(&problem, truth.rotation, &seen);
        assert_eq!(pairs.len(), 10);
        assert!(pairs.iter().all(|found| apart(found, &truth) < 1e-12));
        for axis in 0..2 {
            let found = on_circles((axis, place[axis]), &seen);
            let same = found
                .iter()
                .filter(|found| apart(found, &truth) < 1e-9)
                .count();
            // One of the places on the two circles of each pair.
            assert!(same >= 10, "{same}");
            let others = found.iter().filter(|found| apart(found, &truth) >= 1e-9);
            for other in others.clone() {
                assert!((other.translation.vector[axis] - place[axis]).abs() < 1e-12);
            }
            // A circle far from the line does not meet it.
            assert!(on_circles((axis, 1e3), &seen).is_empty());
        }
    }

    /// From whatever fixes it, a view is located where it stands; a map in a frame of its own counts its landmarks alone.
    #[test]
    fn a_view_is_located_by_what_is_known_of_it() {
        let (truth, map, problem) = setting();
        let free = f64::INFINITY;
        let end = truth * pose(0.5, 0.2, -0.4);
        let with = |sigmas: [f64; 3], moves: bool| {
            let prior = PosePrior {
                view: 0,
                pose: truth,
                noise: Noise::Sigmas(sigmas),
            };
            let motion = Odometry {
                start: 0,
                end: 1,
                delta: pose(0.5, 0.2, -0.4),
                noise: Noise::Sigmas([0.1; 3]),
            };
            let problem = problem.clone().with_pose_priors(&[prior]).unwrap();
            let motion = [motion];
            problem
                .with_odometry(&motion[..usize::from(moves)])
                .unwrap()
        };
        // (what is known of the view, whether a motion is, landmarks that it needs)
        for (sigmas, moves, needed) in [
            ([0.1; 3], false, 0),
            ([free, free, 0.1], true, 0),
            ([0.1, 0.1, free], false, 1),
            ([0.1, free, 0.1], false, 1),
            ([free, 0.1, 0.1], false, 1),
            ([free, free, 0.1], false, 2),
            ([0.1, free, free], false, 2),
            ([free, 0.1, free], false, 2),
            ([free, free, free], false, 3),
        ] {
            let problem = with(sigmas, moves);
            let (known, motions) = (Known::of(&problem), Motions::new(&problem));
            let locate = |count: usize, framed: bool| {
                let mut map = map.clone();
                map.landmarks[count..].fill(None);
                if moves {
                    map.poses[1] = Some(end);
                }
                known.locate(&problem, &map, 0, &motions, framed)
            };
            // With two landmarks and a coordinate there are several places; five decide.
            let enough = if needed == 2 { 5 } else { needed.max(1) };
            let found = locate(enough, true).unwrap();
            assert!(apart(&found, &truth) < 1e-6, "{sigmas:?}: {found}");
            assert!(locate(needed, true).is_some(), "{sigmas:?}");
            if needed > 0 {
                assert_eq!(locate(needed - 1, true), None, "{sigmas:?}");
            }
            assert_eq!(locate(2, false), None);
            assert!(apart(&locate(5, false).unwrap(), &truth) < 1e-6);
        }
    }

    /// A motion holds a view against bearings that do not fix it, and of two views the one that a motion reaches is next.
    #[test]
    fn a_motion_counts_as_much_as_three_landmarks() {
        let (truth, map, problem) = setting();
        let motion = Odometry {
            start: 0,
            end: 1,
            delta: pose(0.5, 0.2, -0.4),
            noise: Noise::Sigmas([0.1, 0.1, 0.05]),
        };
        let end = truth * motion.delta;
        let problem = problem.with_odometry(&[motion]).unwrap();
        let (known, motions) = (Known::of(&problem), Motions::new(&problem));
        for count in 0..=2 {
            let mut map = map.clone();
            map.poses[1] = Some(end);
            map.landmarks[count..].fill(None);
            for point in map.landmarks.iter_mut().flatten() {
                point.y += 0.3;
            }
            let found = known.locate(&problem, &map, 0, &motions, true).unwrap();
            assert!(apart(&found, &truth) < 0.5, "{count}: {found}");
            let next = known.locate_next(&problem, &map, &motions, true);
            assert_eq!(next, Some((0, found)));
            assert_eq!(known.locate_next(&problem, &map, &motions, false), None);
        }
    }
}
