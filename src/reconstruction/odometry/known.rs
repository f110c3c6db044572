// SPDX-License-Identifier: MIT OR Apache-2.0
//! What priors know of single views and landmarks, and views located by that and by the landmarks of a map.
//!
//! A view has three unknowns, and each of these fixes them: a known pose; a motion from or to a placed view; a known
//! position and one landmark; a known heading and two landmarks, or one and a known coordinate; three landmarks, or two
//! and a known coordinate.

use super::super::grow::resect_view;
use super::super::robust::motions::{Motions, PoseTerm, descend_view};
use super::choices::Choices;
use super::smallest_sets::{at, by_pairs, on_circles, on_line, turned_to};
use crate::geometry::Pose;
use crate::lm::Loss;
use crate::problem::{Map, Prior, Problem};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{Point2, UnitComplex, Vector2};

/// Most steps of Gauss-Newton for a view; its three unknowns need a few.
const STEPS: usize = 10;

/// By how much the squares of a place of a view may exceed the least before it is no other choice: that of an outlier.
const AS_GOOD: f64 = Loss::<f64>::TRUNCATED * Loss::<f64>::TRUNCATED;

/// Places of a view are the same when their headings \[rad\], and positions over the size of the map, differ by less.
const SAME: f64 = 0.03;

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
    /// [`places`](Self::places) finds it; or another view and place that are about as good.
    pub fn locate_next(
        &self,
        problem: &Problem,
        map: &Map,
        motions: &Motions,
        framed: bool,
        choices: &mut Choices,
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
                let other = choices.among(2);
                (map.connections_of_view(problem, view) + known + other, view)
            })
            .collect();
        missing.sort_by_key(|&(count, view)| (core::cmp::Reverse(count), view));
        missing.into_iter().find_map(|(_, view)| {
            let places = self.places(problem, map, view, motions, framed, choices.vary());
            let count = places.len();
            let chosen = places.into_iter().nth(choices.among(count));
            chosen.map(|pose| (view, pose))
        })
    }

    /// The poses of a view in the map frame from what is known of it and of its landmarks; none when that does not fix it.
    ///
    /// Of the poses that the smallest sets fix, the one that explains most, then the minimum next to it; with `others` all
    /// the minima that explain about as much. In a map that is not `framed`, not in the frame of the priors, landmarks
    /// alone count.
    fn places(
        &self,
        problem: &Problem,
        map: &Map,
        view: usize,
        motions: &Motions,
        framed: bool,
        others: bool,
    ) -> Vec<Pose<f64>> {
        let resected = resect_view(problem, map, view).map(|(pose, _)| pose);
        if !framed {
            return resected.into_iter().collect();
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
        let mut ranked: Vec<_> = candidates.iter().map(|pose| (cost(pose), pose)).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        let least = ranked.first().map_or(f64::INFINITY, |best| best.0);
        ranked.retain(|(cost, _)| *cost <= least + AS_GOOD);
        let tried = if others { ranked.len() } else { 1 };
        let loss = Loss::Cauchy(Loss::<f64>::CAUCHY);
        let far = SAME * map.size();
        let mut found: Vec<Pose<f64>> = Vec::new();
        for (_, start) in ranked.into_iter().take(tried) {
            let place = descend_view(problem, &seen, &terms, loss, *start, STEPS);
            let is_new = |other: &Pose<f64>| {
                let error = other.inv_mul(&place);
                error.translation.vector.norm() > far || error.rotation.angle().abs() > SAME
            };
            if found.iter().all(is_new) {
                found.push(place);
            }
        }
        found
    }
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
            // A circle that hardly misses the line touches it, one far from the line does not meet it.
            let [first, second] = [seen[0], seen[1]];
            let between = (first.1.bearing.inverse() * second.1.bearing).angle();
            let chord = second.0 - first.0;
            let radius = chord.norm() / (2.0 * between.sin().abs());
            let middle = first.0 + chord * 0.5;
            let most = middle[axis].abs() + 2.0 * radius;
            let touching = (0..4000).map(|k| most * (k as f64 / 2000.0 - 1.0));
            let touching = touching.filter(|&value| {
                let places = on_circles((axis, value), &[first, second]);
                places.windows(2).any(|two| two[0] == two[1])
            });
            assert!(touching.count() > 0);
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
                known
                    .places(&problem, &map, 0, &motions, framed, false)
                    .pop()
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

    /// A coordinate and two landmarks leave two places open and more: the choices are between all of them.
    #[test]
    fn a_view_may_be_in_several_places() {
        let (truth, map, problem) = setting();
        let free = f64::INFINITY;
        let prior = PosePrior {
            view: 0,
            pose: truth,
            noise: Noise::Sigmas([0.1, free, free]),
        };
        let problem = problem.with_pose_priors(&[prior]).unwrap();
        let (known, motions) = (Known::of(&problem), Motions::new(&problem));
        let mut several = 0;
        for first in 0..4 {
            let mut two = map.clone();
            two.landmarks[..first].fill(None);
            two.landmarks[first + 2..].fill(None);
            let places = known.places(&problem, &two, 0, &motions, true, true);
            assert!(places.iter().any(|place| apart(place, &truth) < 1e-6));
            several += usize::from(places.len() > 1);
            let best = known.places(&problem, &two, 0, &motions, true, false);
            assert_eq!(best, places[..1]);
            let mut chosen = Vec::new();
            for seed in 0..20 {
                let mut choices = Choices::of_seed(seed);
                let next = known.locate_next(&problem, &two, &motions, true, &mut choices);
                let place = next.unwrap().1;
                if !chosen.contains(&place) {
                    chosen.push(place);
                }
            }
            assert_eq!(chosen.len(), places.len());
        }
        assert!(several > 0);
        // Five landmarks leave one.
        assert_eq!(
            known.places(&problem, &map, 0, &motions, true, true).len(),
            1
        );
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
            let found = known.places(&problem, &map, 0, &motions, true, false)[0];
            assert!(apart(&found, &truth) < 0.5, "{count}: {found}");
            let next = known.locate_next(&problem, &map, &motions, true, &mut Choices::best());
            assert_eq!(next, Some((0, found)));
            let apart = known.locate_next(&problem, &map, &motions, false, &mut Choices::best());
            assert_eq!(apart, None);
        }
    }
}
