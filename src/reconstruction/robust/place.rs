// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robust placement of one view or one landmark in a map.
//!
//! Minimal samples of its sightings are tried, three for a view and two for a landmark; the place with the
//! least truncated cost is re-estimated from all sightings that agree with it.

use super::consensus::square_within;
use super::options::RobustOptions;
use crate::geometry::Pose;
use crate::kernels::{resect, triangulate};
use crate::problem::{IndexedSighting, MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Map, Problem};
use alloc::vec::Vec;
use nalgebra::{Complex, Point2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A place for a view or a landmark.
pub struct Placed<P> {
    pub place: P,
    /// Sum of the squared residuals of its sightings, each truncated at the bound.
    pub cost: f64,
    /// Which of its sightings agree with it, among those to views or landmarks in the map.
    pub agreeing: Vec<bool>,
    /// Whether it is the present place in the map.
    pub present: bool,
}

impl<P> Placed<P> {
    /// How many sightings agree.
    pub fn count(&self) -> usize {
        self.agreeing.iter().filter(|agrees| **agrees).count()
    }
}

/// Calls `visit` with all sets of `N` out of `count`, or with random ones when there are more than `most`.
pub fn sets<const N: usize>(
    count: usize,
    most: usize,
    random: &mut ChaCha8Rng,
    mut visit: impl FnMut([usize; N]),
) {
    if count < N {
        return;
    }
    let all = (0..N).fold(1_usize, |product, k| {
        product.saturating_mul(count - k) / (k + 1)
    });
    if all <= most {
        let mut set: [usize; N] = core::array::from_fn(|k| k);
        loop {
            visit(set);
            // The last index that can advance; those behind it follow.
            let Some(place) = (0..N).rev().find(|&k| set[k] < count - N + k) else {
                return;
            };
            set[place] += 1;
            for k in place + 1..N {
                set[k] = set[k - 1] + 1;
            }
        }
    }
    for _ in 0..most {
        let mut set = [0; N];
        for k in 0..N {
            // Draw among the indices that are left, skipping those that are taken.
            let mut pick = random.random_range(0..count - k);
            set[..k].sort_unstable();
            for &taken in &set[..k] {
                pick += usize::from(pick >= taken);
            }
            set[k] = pick;
        }
        visit(set);
    }
}

/// Up to `count` poses of a view with which different sightings agree to within `bound` standard
/// deviations, the best first. The present pose is one of the candidates.
///
/// Empty when it sees fewer than three landmarks of the map.
pub fn place_view(
    problem: &Problem,
    map: &Map,
    view: usize,
    bound: f64,
    count: usize,
    options: &RobustOptions,
    random: &mut ChaCha8Rng,
) -> Vec<Placed<Pose<f64>>> {
    let seen: Vec<(Point2<f64>, &IndexedSighting)> = map.seen(problem, view).collect();
    if seen.len() < MIN_LANDMARKS_OF_VIEW {
        return Vec::new();
    }
    let squares = |pose: &Pose<f64>| {
        let pose = *pose;
        seen.iter()
            .map(move |(point, s)| square_within(problem, s, &pose, point, bound))
    };
    let mut best = Best::new(bound, count, options, &squares);
    if let Some(pose) = map.poses[view] {
        best.offer(pose, true);
        if best.is_beyond_doubt(seen.len(), MIN_LANDMARKS_OF_VIEW) {
            return best.places;
        }
    }
    sets(
        seen.len(),
        options.sets.saturating_mul(count),
        random,
        |set: [usize; MIN_LANDMARKS_OF_VIEW]| {
            if let Ok(found) = resect(set.map(|k| (seen[k].0, seen[k].1.bearing))) {
                best.offer(found.pose, false);
            }
        },
    );
    best.improved(|agreeing| {
        let agreeing = seen.iter().zip(agreeing).filter(|(_, agrees)| **agrees);
        let agreeing = agreeing.map(|((point, s), _)| (*point, s.bearing));
        resect(agreeing).ok().map(|found| found.pose)
    })
}

/// Positions of a landmark, as [`place_view`].
pub fn place_landmark(
    problem: &Problem,
    map: &Map,
    landmark: usize,
    bound: f64,
    count: usize,
    options: &RobustOptions,
    random: &mut ChaCha8Rng,
) -> Vec<Placed<Point2<f64>>> {
    let rays: Vec<(Pose<f64>, &IndexedSighting)> = map.rays(problem, landmark).collect();
    if rays.len() < MIN_VIEWS_OF_LANDMARK {
        return Vec::new();
    }
    let squares = |point: &Point2<f64>| {
        let point = *point;
        rays.iter()
            .map(move |(pose, s)| square_within(problem, s, pose, &point, bound))
    };
    let mut best = Best::new(bound, count, options, &squares);
    if let Some(point) = map.landmarks[landmark] {
        best.offer(point, true);
        if best.is_beyond_doubt(rays.len(), MIN_VIEWS_OF_LANDMARK) {
            return best.places;
        }
    }
    sets(
        rays.len(),
        options.sets.saturating_mul(count),
        random,
        |set: [usize; MIN_VIEWS_OF_LANDMARK]| {
            if let Some(point) = crossing(set.map(|k| &rays[k])) {
                best.offer(point, false);
            }
        },
    );
    best.improved(|agreeing| {
        let agreeing = rays.iter().zip(agreeing).filter(|(_, agrees)| **agrees);
        let agreeing = agreeing.map(|((pose, s), _)| (*pose, s.bearing));
        triangulate(agreeing).ok().map(|found| found.point)
    })
}

/// Where two lines of sight cross; `None` when they are parallel.
fn crossing(rays: [&(Pose<f64>, &IndexedSighting); 2]) -> Option<Point2<f64>> {
    let cross = |a: Complex<f64>, b: Complex<f64>| a.re * b.im - a.im * b.re;
    let [u, v] = rays.map(|(pose, s)| pose.rotation.into_inner() * s.bearing.into_inner());
    let [from, to] = rays.map(|(pose, _)| pose.translation.vector);
    let sine = cross(u, v);
    (sine.abs() > f64::EPSILON).then(|| {
        let range = cross(Complex::new(to.x - from.x, to.y - from.y), v) / sine;
        Point2::new(from.x + u.re * range, from.y + u.im * range)
    })
}

/// The best places so far.
struct Best<'a, P, F> {
    most: f64,
    count: usize,
    options: &'a RobustOptions,
    squares: &'a F,
    /// The best first.
    places: Vec<Placed<P>>,
}

impl<'a, P: Copy, F, I> Best<'a, P, F>
where
    F: Fn(&P) -> I,
    I: Iterator<Item = f64>,
{
    fn new(bound: f64, count: usize, options: &'a RobustOptions, squares: &'a F) -> Self {
        Self {
            most: bound * bound,
            count,
            options,
            squares,
            places: Vec::new(),
        }
    }

    /// Keeps a place that is among the best. Of places with the same inliers it keeps the best, or the
    /// present one, which the refinement of the map has already optimised.
    fn offer(&mut self, place: P, present: bool) {
        let Some(worst) = self.count.checked_sub(1) else {
            return;
        };
        let limit = match self.places.get(worst) {
            Some(last) => last.cost,
            None => 1.0 / 0.0,
        };
        let mut cost = 0.0;
        for square in (self.squares)(&place) {
            cost += square.min(self.most);
            if !(cost < limit) {
                return;
            }
        }
        let agreeing: Vec<bool> = (self.squares)(&place)
            .map(|square| square <= self.most)
            .collect();
        if let Some(same) = self.places.iter().position(|p| p.agreeing == agreeing) {
            if self.places[same].present || self.places[same].cost <= cost {
                return;
            }
            self.places.remove(same);
        }
        let rank = self.places.partition_point(|p| p.cost <= cost);
        self.places.insert(
            rank,
            Placed {
                place,
                cost,
                agreeing,
                present,
            },
        );
        self.places.truncate(self.count);
    }

    /// Whether only the best place is requested and so many sightings agree with the present one that none
    /// could be better: another place shares few more inliers with it than a minimal sample, and its others
    /// are among the remaining sightings.
    fn is_beyond_doubt(&self, all: usize, fixing: usize) -> bool {
        let present = self.places.first();
        self.count == 1
            && present.is_some_and(|present| {
                2 * present.count() > (all + fixing).saturating_add(self.options.shared_by_chance)
            })
    }

    /// Re-estimates each place from the sightings that agree with it, and keeps what is better.
    fn improved(mut self, estimate: impl Fn(&[bool]) -> Option<P>) -> Vec<Placed<P>> {
        for _ in 0..self.options.place_rounds {
            let better: Vec<P> = self
                .places
                .iter()
                .filter_map(|placed| estimate(&placed.agreeing))
                .collect();
            for place in better {
                self.offer(place, false);
            }
        }
        self.places
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn drawn<const N: usize>(count: usize, most: usize) -> Vec<[usize; N]> {
        let mut found = Vec::new();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        sets(count, most, &mut random, |set: [usize; N]| found.push(set));
        found
    }

    /// All sets where there are few, otherwise random ones, none with an index twice.
    #[test]
    fn sets_are_listed_or_drawn() {
        assert_eq!(drawn::<2>(3, 3), [[0, 1], [0, 2], [1, 2]]);
        assert_eq!(drawn::<2>(1, 5), [[0; 2]; 0]);
        assert_eq!(drawn::<2>(2, 5), [[0, 1]]);
        let all = drawn::<3>(6, 20);
        assert_eq!(all.len(), 20);
        assert!(all.is_sorted() && all.iter().all(|set| set.is_sorted_by(|a, b| a < b)));
        let some = drawn::<3>(7, 34);
        assert_eq!(some.len(), 34);
        let mut times = [0; 7];
        for mut set in some.into_iter().chain(drawn::<3>(7, 30)) {
            set.sort_unstable();
            assert!(set.is_sorted_by(|a, b| a < b) && set[2] < 7);
            set.into_iter().for_each(|k| times[k] += 1);
        }
        assert!(times.iter().all(|&times| times > 15), "{times:?}");
    }

    #[test]
    fn two_rays_cross_where_they_meet() {
        let truth = Point2::new(1.0, 3.0);
        let poses = [
            crate::geometry::pose(0.0, 0.0, 0.3),
            crate::geometry::pose(2.0, 0.5, 1.0),
        ];
        let bearings =
            poses.map(|pose| crate::geometry::bearing_to(&pose, &truth).unwrap().angle());
        let problem = Problem::dense(2, 1, &bearings, 0.01).unwrap();
        let rays = [0, 1].map(|k: usize| (poses[k], &problem.sightings()[k]));
        let found = crossing([&rays[0], &rays[1]]).unwrap();
        assert!((found - truth).norm() < 1e-12, "{found}");
        assert!(crossing([&rays[0], &rays[0]]).is_none());
    }

    /// On a line, places are offered to marks at whole numbers.
    fn best_of(offers: &[(f64, bool)], count: usize) -> Vec<(f64, bool)> {
        let marks = [0.0, 1.0, 5.0, 6.0];
        let squares = |at: &f64| {
            let at = *at;
            marks
                .into_iter()
                .map(move |mark: f64| (at - mark) * (at - mark))
        };
        let options = RobustOptions::default();
        let mut best = Best::new(1.5, count, &options, &squares);
        for &(place, present) in offers {
            best.offer(place, present);
        }
        assert!(best.places.is_sorted_by(|a, b| a.cost <= b.cost));
        best.places
            .iter()
            .map(|placed| (placed.place, placed.present))
            .collect()
    }

    /// The best places with different inliers are kept; of those with the same the best, or the present one.
    #[test]
    fn the_best_places_have_different_inliers() {
        let [left, right] = [(0.4, false), (5.5, false)];
        assert_eq!(best_of(&[left, right, (3.0, false)], 2), [right, left]);
        assert_eq!(best_of(&[left, right], 1), [right]);
        assert_eq!(best_of(&[right, left], 1), [right]);
        assert_eq!(best_of(&[left, (0.5, false)], 3), [(0.5, false)]);
        assert_eq!(best_of(&[(0.5, false), left], 3), [(0.5, false)]);
        assert_eq!(best_of(&[(0.4, true), (0.5, false)], 3), [(0.4, true)]);
        assert_eq!(best_of(&[left], 0), []);
    }

    /// Four of eight sightings may leave a better place with a sample in common, seven of eight do not.
    #[test]
    fn a_place_is_beyond_doubt_when_no_other_could_agree_with_as_many() {
        let options = RobustOptions::default();
        assert_eq!(options.shared_by_chance, 2);
        let squares = |at: &usize| {
            let agreeing = *at;
            (0..8).map(move |k| if k < agreeing { 0.0 } else { 100.0 })
        };
        for (agreeing, count, sure) in [(7, 1, true), (6, 1, false), (7, 2, false)] {
            let mut best = Best::new(3.0, count, &options, &squares);
            assert!(!best.is_beyond_doubt(8, 3));
            best.offer(agreeing, true);
            assert_eq!(best.is_beyond_doubt(8, 3), sure, "{agreeing} {count}");
        }
    }
}
