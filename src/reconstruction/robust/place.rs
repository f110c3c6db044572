// SPDX-License-Identifier: MIT OR Apache-2.0
//! One view or one landmark against the rest of the map, when some of its sightings are wrong.
//!
//! The smallest sets of sightings that fix it are tried, three for a view and two for a landmark; the
//! one with the least bounded cost is estimated anew from all that agrees with it.

use super::objective::{square, tally};
use crate::estimation::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Map, Problem, Seen};
use crate::geometry::Pose;
use crate::kernels::{resect, triangulate};
use crate::scalar::Real;
use alloc::vec::Vec;
use nalgebra::{Complex, Point2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Most sets that are tried. When half of the sightings are wrong, one in eight threes is good, and 64
/// miss them all once in 5000.
const SETS: usize = 64;

/// Rounds of estimation from all that agrees.
const ROUNDS: usize = 3;

/// A place, its bounded cost and how many sightings agree with it.
pub struct Placed<P, T: Real> {
    pub place: P,
    pub cost: T,
    pub agreeing: usize,
}

/// Calls `visit` with all sets of `N` out of `count`, or with random ones when there are more than
/// [`SETS`].
fn sets<const N: usize>(count: usize, random: &mut ChaCha8Rng, mut visit: impl FnMut([usize; N])) {
    if count < N {
        return;
    }
    let all = (0..N).fold(1_usize, |product, k| {
        product.saturating_mul(count - k) / (k + 1)
    });
    if all <= SETS {
        let mut set: [usize; N] = core::array::from_fn(|k| k);
        loop {
            visit(set);
            // The last place that can move on; those behind it follow.
            let Some(place) = (0..N).rev().find(|&k| set[k] < count - N + k) else {
                return;
            };
            set[place] += 1;
            for k in place + 1..N {
                set[k] = set[k - 1] + 1;
            }
        }
    }
    for _ in 0..SETS {
        let mut set = [0; N];
        for k in 0..N {
            // One of those that are left, counted past those that are taken.
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

/// The pose of a view, bounded squares of `bound` standard deviations; no worse than the one it has.
///
/// `None` when it sees fewer than three landmarks of the map.
pub fn place_view<T: Real>(
    problem: &Problem<T>,
    map: &Map<T>,
    view: usize,
    bound: f64,
    random: &mut ChaCha8Rng,
) -> Option<Placed<Pose<T>, T>> {
    let seen: Vec<(Point2<T>, Seen<T>)> = problem
        .of_view(view)
        .iter()
        .filter_map(|s| map.landmarks[s.landmark].map(|point| (point, *s)))
        .collect();
    if seen.len() < MIN_LANDMARKS_OF_VIEW {
        return None;
    }
    let squares = |pose: &Pose<T>| {
        let pose = *pose;
        seen.iter().map(move |(point, s)| square(s, &pose, point))
    };
    let mut best = Best::new(bound, map.poses[view], &squares);
    sets(seen.len(), random, |set: [usize; MIN_LANDMARKS_OF_VIEW]| {
        if let Ok(found) = resect(set.map(|k| (seen[k].0, seen[k].1.bearing))) {
            best.offer(found.pose, &squares);
        }
    });
    best.improve(&squares, |agreeing| {
        let agreeing = agreeing.iter().map(|&k| (seen[k].0, seen[k].1.bearing));
        resect(agreeing).ok().map(|found| found.pose)
    })
}

/// The position of a landmark, as [`place_view`].
pub fn place_landmark<T: Real>(
    problem: &Problem<T>,
    map: &Map<T>,
    landmark: usize,
    bound: f64,
    random: &mut ChaCha8Rng,
) -> Option<Placed<Point2<T>, T>> {
    let rays: Vec<(Pose<T>, Seen<T>)> = problem
        .of_landmark(landmark)
        .iter()
        .filter_map(|&k| {
            let s = problem.sightings()[k];
            map.poses[s.view].map(|pose| (pose, s))
        })
        .collect();
    if rays.len() < MIN_VIEWS_OF_LANDMARK {
        return None;
    }
    let squares = |point: &Point2<T>| {
        let point = *point;
        rays.iter().map(move |(pose, s)| square(s, pose, &point))
    };
    let mut best = Best::new(bound, map.landmarks[landmark], &squares);
    sets(
        rays.len(),
        random,
        |[i, j]: [usize; MIN_VIEWS_OF_LANDMARK]| {
            if let Some(point) = crossing(&rays[i], &rays[j]) {
                best.offer(point, &squares);
            }
        },
    );
    best.improve(&squares, |agreeing| {
        let agreeing = agreeing.iter().map(|&k| (rays[k].0, rays[k].1.bearing));
        triangulate(agreeing).ok().map(|found| found.point)
    })
}

/// Where two lines of sight cross; `None` when they are parallel.
fn crossing<T: Real>(a: &(Pose<T>, Seen<T>), b: &(Pose<T>, Seen<T>)) -> Option<Point2<T>> {
    let ray = |(pose, s): &(Pose<T>, Seen<T>)| pose.rotation.into_inner() * s.bearing.into_inner();
    let cross = |a: Complex<T>, b: Complex<T>| a.re * b.im - a.im * b.re;
    let (u, v) = (ray(a), ray(b));
    let offset = b.0.translation.vector - a.0.translation.vector;
    let sine = cross(u, v);
    (sine.abs() > T::eps()).then(|| {
        let range = cross(Complex::new(offset.x, offset.y), v) / sine;
        let origin = a.0.translation.vector;
        Point2::new(origin.x + u.re * range, origin.y + u.im * range)
    })
}

/// The best place so far.
struct Best<P, T: Real> {
    bound: f64,
    place: Option<P>,
    cost: T,
    agreeing: usize,
}

impl<P: Copy, T: Real> Best<P, T> {
    fn new<I: Iterator<Item = T>>(bound: f64, place: Option<P>, squares: impl Fn(&P) -> I) -> Self {
        let mut best = Self {
            bound,
            place: None,
            cost: T::one() / T::zero(),
            agreeing: 0,
        };
        if let Some(place) = place {
            best.offer(place, squares);
        }
        best
    }

    /// Takes a place that is better; returns whether it is.
    fn offer<I: Iterator<Item = T>>(&mut self, place: P, squares: impl Fn(&P) -> I) -> bool {
        match tally(squares(&place), self.bound, self.cost) {
            Some((cost, agreeing)) => {
                (self.place, self.cost, self.agreeing) = (Some(place), cost, agreeing);
                true
            }
            None => false,
        }
    }

    /// Estimates the place anew from the sightings that agree with it, as long as it gets better.
    fn improve<I: Iterator<Item = T>>(
        mut self,
        squares: impl Fn(&P) -> I,
        estimate: impl Fn(&[usize]) -> Option<P>,
    ) -> Option<Placed<P, T>> {
        let most = T::lit(self.bound * self.bound);
        let mut agreeing = Vec::new();
        for _ in 0..ROUNDS {
            agreeing.clear();
            let all = squares(self.place.as_ref()?).enumerate();
            agreeing.extend(all.filter(|(_, square)| *square <= most).map(|(k, _)| k));
            let better = estimate(&agreeing).is_some_and(|place| self.offer(place, &squares));
            if !better {
                break;
            }
        }
        Some(Placed {
            place: self.place?,
            cost: self.cost,
            agreeing: self.agreeing,
        })
    }
}
