// SPDX-License-Identifier: MIT OR Apache-2.0
//! Landmarks of which only the direction is known.

use super::judge::variance;
use super::result::Reconstruction;
use crate::geometry::points::{median, middle};
use crate::lm::Termination;
use crate::problem::{MIN_VIEWS_OF_LANDMARK, Map, Prior, Problem, Subject, Undetermined, Why};
use crate::uncertainty::unbounded_landmarks;
use alloc::vec::Vec;
use nalgebra::{Point2, Vector2};

/// Options of the decision that a landmark is at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct InfinityOptions {
    /// Root mean square of the residuals \[rad\] above which a map is taken to be wrong: its landmarks are not tested.
    /// Not sensitive.
    pub plausible_rms: f64,
    /// Nothing is this many times as far from the middle of a map as half of its views and landmarks: there, bearings
    /// differ by rounding from those at infinity.
    pub horizon: f64,
}

impl Default for InfinityOptions {
    fn default() -> Self {
        Self {
            plausible_rms: 0.1,
            horizon: 1e6,
        }
    }
}

/// Removes landmarks at infinity from a refined map: their range is undetermined.
///
/// Their bearings have been used: they determine the headings, and the cost counts them. At infinity is what is so
/// within the noise, and what is beyond the horizon in any case.
pub fn drop_landmarks_at_infinity(
    problem: &Problem,
    found: &mut Reconstruction,
    options: &InfinityOptions,
) {
    let mut dropped = beyond_horizon(problem, &found.map, options);
    for landmark in unbounded(problem, found, options) {
        if !dropped.contains(&landmark) {
            dropped.push(landmark);
        }
    }
    // Without them the map is smaller, and so is its horizon.
    while !dropped.is_empty() {
        for landmark in dropped {
            found.map.landmarks[landmark] = None;
            found.undetermined.push(Undetermined {
                subject: Subject::Landmark(landmark),
                why: Why::AtInfinity,
            });
        }
        dropped = beyond_horizon(problem, &found.map, options);
    }
    found
        .undetermined
        .sort_by_key(|undetermined| undetermined.subject);
}

/// A map with its landmarks at infinity put back, far out along their rays, so that their bearings count in a further
/// refinement.
pub fn with_landmarks_at_infinity(problem: &Problem, found: &Reconstruction, sizes: f64) -> Map {
    let mut map = found.map.clone();
    let range = sizes * map.size();
    for landmark in listed_at_infinity(found) {
        map.landmarks[landmark] = far_out(problem, &found.map, landmark, range);
    }
    map
}

/// The landmarks that a map lists at infinity.
pub fn listed_at_infinity(found: &Reconstruction) -> impl Iterator<Item = usize> {
    let listed = found.undetermined.iter();
    listed.filter_map(|one| match (one.subject, one.why) {
        (Subject::Landmark(landmark), Why::AtInfinity) => Some(landmark),
        _ => None,
    })
}

/// A position at this range along the mean ray of a landmark that at least two views see.
pub fn far_out(problem: &Problem, map: &Map, landmark: usize, range: f64) -> Option<Point2<f64>> {
    let mut count = 0_u32;
    let (mut sum, mut from) = (Vector2::zeros(), Vector2::zeros());
    for (pose, s) in map.rays(problem, landmark) {
        let ray = (pose.rotation * s.bearing).into_inner();
        let ray = Vector2::new(ray.re, ray.im);
        // A bearing modulo pi points both ways: take the way of the sum.
        let turned = !problem.is_oriented() && ray.dot(&sum) < 0.0;
        sum += if turned { -ray } else { ray };
        from += pose.translation.vector;
        count += 1;
    }
    if (count as usize) < MIN_VIEWS_OF_LANDMARK || !(sum.norm() > f64::EPSILON) {
        return None;
    }
    let middle = from / f64::from(count);
    Some(Point2::from(middle + sum.normalize() * range))
}

/// The landmarks whose range is undetermined within the noise of the bearings.
fn unbounded(problem: &Problem, found: &Reconstruction, options: &InfinityOptions) -> Vec<usize> {
    // Exact bearings leave no noise to judge by, and of a map that explains nothing no landmark is known.
    if found.freedom == 0
        || found.termination == Termination::ZeroResidual
        || found.rms > options.plausible_rms
    {
        return Vec::new();
    }
    let unbounded = unbounded_landmarks(problem, &found.map, variance(found));
    let lost: usize = unbounded
        .iter()
        .map(|&landmark| problem.of_landmark(landmark).len().saturating_sub(2))
        .sum();
    // When the map depends on them they stay, and its uncertainty shows it.
    if lost >= found.freedom {
        return Vec::new();
    }
    unbounded
}

/// The landmarks farther away than any could be, apart from those that priors know.
fn beyond_horizon(problem: &Problem, map: &Map, options: &InfinityOptions) -> Vec<usize> {
    let Some(horizon) = Horizon::of(map, options) else {
        return Vec::new();
    };
    let known = problem.known_landmarks();
    let landmarks = map.landmarks.iter().enumerate();
    let beyond = landmarks.filter(|(landmark, point)| {
        !known[*landmark] && point.is_some_and(|point| horizon.is_before(&point.coords))
    });
    beyond.map(|(landmark, _)| landmark).collect()
}

/// The views farther away than any could be, apart from those whose position priors know.
pub fn views_beyond_horizon(problem: &Problem, map: &Map, options: &InfinityOptions) -> Vec<usize> {
    let Some(horizon) = Horizon::of(map, options) else {
        return Vec::new();
    };
    let is_known = |view: usize| {
        let mut priors = problem.priors().iter();
        priors.any(|prior| match prior {
            Prior::Pose { view: of, root, .. } => {
                *of == view && root[0][0] > 0.0 && root[1][1] > 0.0
            }
            _ => false,
        })
    };
    let views = map.poses.iter().enumerate();
    let beyond = views.filter(|(view, pose)| {
        pose.is_some_and(|pose| horizon.is_before(&pose.translation.vector)) && !is_known(*view)
    });
    beyond.map(|(view, _)| view).collect()
}

/// The circle around the middle of a map beyond which nothing is told apart.
struct Horizon {
    middle: Vector2<f64>,
    radius: f64,
}

impl Horizon {
    /// `None` for a map without a size, half of which is in one place, and for one that is all within its horizon.
    fn of(map: &Map, options: &InfinityOptions) -> Option<Self> {
        let landmarks = map.landmarks.iter().flatten().map(|point| point.coords);
        let places = map.view_positions().chain(landmarks);
        if is_compact(places.clone(), options.horizon) {
            return None;
        }
        let places: Vec<Vector2<f64>> = places.collect();
        let middle = middle(&places);
        let size = median(places.iter().map(|place| (place - middle).norm()).collect());
        (size > 0.0).then_some(Self {
            middle,
            radius: size * options.horizon,
        })
    }

    /// Whether the horizon is before a place.
    fn is_before(&self, place: &Vector2<f64>) -> bool {
        !((place - self.middle).norm() <= self.radius)
    }
}

/// Whether places are all within their horizon, seen in pairs and without medians; `false` where that does not tell.
///
/// Only one of two places that are a length apart is within half of it from the middle. Where that is so of all pairs,
/// the median distance from the middle is at least a quarter of the length; none is farther from there than two
/// and a half times what the farthest is from the first.
fn is_compact(mut places: impl Iterator<Item = Vector2<f64>> + Clone, horizon: f64) -> bool {
    let mut others = places.clone();
    let Some(first) = others.next() else {
        return true;
    };
    let farthest = others.fold(0.0, |most: f64, place| {
        most.max((place - first).norm_squared())
    });
    let length = 10.0 / horizon;
    let apart =
        |a: Vector2<f64>, b: Vector2<f64>| (a - b).norm_squared() > farthest * (length * length);
    let mut pair = None;
    while let Some(one) = places.next() {
        let Some(other) = places.next() else {
            // The odd one: of it and a pair only one is within.
            return pair.is_some_and(|(a, b)| apart(one, a) && apart(one, b));
        };
        if !apart(one, other) {
            return false;
        }
        pair = Some((one, other));
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::problem::{Noise, PosePrior};
    use nalgebra::Point2;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The first view is as far away as any: the horizon is around the middle.
    #[test]
    fn views_and_landmarks_beyond_the_horizon_are_found_but_for_those_that_priors_know() {
        let map = Map {
            poses: [(3e7, 0.0), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (2.0, 2.0)]
                .map(|(x, y)| Some(pose(x, y, 0.3)))
                .to_vec(),
            landmarks: [(1.0, 2.0), (-1.0, 0.5), (0.0, -2e7), (2.0, 0.1)]
                .map(|(x, y)| Some(Point2::new(x, y)))
                .to_vec(),
        };
        let problem = Problem::dense(5, 4, &[0.1; 20], 0.1).unwrap();
        let options = InfinityOptions::default();
        assert_eq!(views_beyond_horizon(&problem, &map, &options), [0]);
        assert_eq!(beyond_horizon(&problem, &map, &options), [2]);
        let unknown = f64::INFINITY;
        for (sigmas, beyond) in [
            ([1.0; 3], &[][..]),
            ([unknown, unknown, 1.0], &[0]),
            ([1.0, unknown, 1.0], &[0]),
        ] {
            let known = PosePrior {
                view: 0,
                pose: pose(3e7, 0.0, 0.3),
                noise: Noise::Sigmas(sigmas),
            };
            let problem = problem.clone().with_pose_priors(&[known]).unwrap();
            assert_eq!(views_beyond_horizon(&problem, &map, &options), beyond);
        }
    }

    /// What is compact has nothing beyond its horizon, whatever the sizes, with many places that are the same.
    #[test]
    fn compact_places_are_within_their_horizon() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut counts = [0; 2];
        for k in 0..20_000 {
            let mut coordinate = || {
                let most = [1, 7][k % 2];
                10_f64.powi(random.random_range(0..=most))
                    * random.random_range(-1.0..1.0_f64).round()
            };
            let places: Vec<_> = (0..1 + k % 7)
                .map(|_| Vector2::new(coordinate(), coordinate()))
                .collect();
            let middle = middle(&places);
            let away = |place: &Vector2<f64>| (place - middle).norm();
            let radius = 1e3 * median(places.iter().map(away).collect());
            let within = places.iter().all(|place| away(place) <= radius);
            let compact = is_compact(places.into_iter(), 1e3);
            assert!(within || !compact);
            counts[0] += usize::from(compact);
            counts[1] += usize::from(!within);
        }
        assert!(counts.iter().all(|count| *count > 4000), "{counts:?}");
        let square = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (3.0, 2.0)];
        for count in 0..=5 {
            let places = square[..count].iter().map(|&(x, y)| Vector2::new(x, y));
            // One place has no size.
            assert_eq!(is_compact(places, 1e6), count != 1, "{count}");
        }
    }

    /// Far out along the mean ray, from the middle of the views that see the landmark, in sizes of the map.
    #[test]
    fn a_landmark_starts_far_out_along_its_rays() {
        let poses = [(0.0, 2.0), (0.0, 4.0), (0.0, 0.0)];
        let map = Map {
            poses: poses.map(|(x, y)| Some(pose(x, y, 0.0))).to_vec(),
            landmarks: alloc::vec![None; 4],
        };
        let half = core::f64::consts::FRAC_PI_2;
        let nan = f64::NAN;
        let bearings = [
            // Up and down by the same angle; the first one has nothing to the left.
            0.1,
            half,
            half,
            nan, //
            -0.1,
            half + 0.2,
            -half,
            0.3, //
            nan,
            half - 0.2 - core::f64::consts::PI,
            nan,
            nan,
        ];
        let problem = Problem::dense(3, 4, &bearings, 0.1).unwrap();
        let far = far_out(&problem, &map, 0, 60.0).unwrap();
        assert!((far - Point2::new(60.0, 3.0)).norm() < 1e-12, "{far}");
        // Opposite rays have no mean, a single one is not enough.
        assert_eq!(far_out(&problem, &map, 2, 60.0), None);
        assert_eq!(far_out(&problem, &map, 3, 60.0), None);
        // Modulo pi they point the same way.
        let lines = problem.unoriented();
        let far = far_out(&lines, &map, 2, 60.0).unwrap();
        assert!((far - Point2::new(0.0, 63.0)).norm() < 1e-9, "{far}");
        let far = far_out(&lines, &map, 1, 60.0).unwrap();
        assert!((far - Point2::new(0.0, 62.0)).norm() < 1e-9, "{far}");
    }

    /// A refined map whose last landmark is so far away that its rays are parallel within the noise.
    fn distant() -> (Problem, Reconstruction) {
        let arena = crate::simulate::Arena::default();
        let layout = crate::simulate::Layout::Enclosed;
        let scene = crate::simulate::simulate(layout, 5, 9, 0.01, 3, arena).unwrap();
        let mut map = scene.map();
        map.landmarks[8] = Some(Point2::new(3e4, -2e4));
        let mut bearings = scene.bearings;
        for (view, pose) in scene.poses.iter().enumerate() {
            let bearing = crate::geometry::bearing_to(pose, &map.landmarks[8].unwrap());
            bearings[view * 9 + 8] = bearing.unwrap().angle() + 0.002 * view as f64;
        }
        let problem = Problem::dense(5, 9, &bearings, 0.01).unwrap();
        let options = crate::lm::RefineOptions::default();
        let report = crate::adjustment::refine_map(&problem, &mut map, &options, None).unwrap();
        let found = Reconstruction::new(&problem, &map, report);
        (problem, found)
    }

    /// Landmarks are tested only against noise of a plausible map, and stay where it depends on them: the last one leaves
    /// three bearings without a landmark.
    #[test]
    fn landmarks_are_unbounded_within_the_noise_of_a_plausible_map() {
        let (problem, found) = distant();
        let options = InfinityOptions::default();
        let with = |change: fn(&mut Reconstruction)| {
            let mut found = found.clone();
            // So that the variance stays.
            let variance = variance(&found);
            change(&mut found);
            found.cost = 0.5 * variance * found.freedom as f64;
            unbounded(&problem, &found, &options)
        };
        assert_eq!(with(|_| ()), [8]);
        assert_eq!(with(|found| found.freedom = 4), [8]);
        assert_eq!(with(|found| found.freedom = 3), [0; 0]);
        assert_eq!(with(|found| found.freedom = 0), [0; 0]);
        assert_eq!(
            with(|found| found.termination = Termination::ZeroResidual),
            [0; 0]
        );
        assert_eq!(with(|found| found.rms = 0.099), [8]);
        assert_eq!(with(|found| found.rms = 0.101), [0; 0]);
    }

    /// A landmark that is dropped is listed once, and its bearings count when it is put back.
    #[test]
    fn landmarks_at_infinity_are_listed_and_put_back() {
        let (problem, mut found) = distant();
        let whole = found.map.clone();
        let missing = Undetermined {
            subject: Subject::Landmark(2),
            why: Why::Degenerate,
        };
        found.map.landmarks[2] = None;
        found.undetermined = Vec::from([missing]);
        drop_landmarks_at_infinity(&problem, &mut found, &InfinityOptions::default());
        let far = Undetermined {
            subject: Subject::Landmark(8),
            why: Why::AtInfinity,
        };
        assert_eq!(found.undetermined, [missing, far]);
        assert_eq!(found.map.landmarks[8], None);
        let back = with_landmarks_at_infinity(&problem, &found, 60.0);
        assert_eq!(back.landmarks[2], None);
        assert_eq!(back.landmarks[1], whole.landmarks[1]);
        let away = back.landmarks[8].unwrap().coords;
        let expected = whole.landmarks[8].unwrap().coords.normalize();
        assert!((away.normalize() - expected).norm() < 0.1, "{away}");
        assert!(away.norm() > 20.0 * back.size());
    }

    /// Once the farthest are gone, the map is smaller, and others are beyond its horizon.
    #[test]
    fn the_horizon_comes_nearer_as_landmarks_go() {
        let (near, far, farthest) = (1.0, 1e7, 1e14);
        let poses = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
        let landmarks = [
            (near, near),
            (far, 0.0),
            (-far, 0.0),
            (0.0, far),
            (farthest, 0.0),
            (-farthest, 0.0),
            (0.0, farthest),
            (0.0, -farthest),
        ];
        let problem = Problem::dense(3, 8, &[0.1; 24], 0.1).unwrap();
        let (_, mut found) = distant();
        found.map = Map {
            poses: poses.map(|(x, y)| Some(pose(x, y, 0.3))).to_vec(),
            landmarks: landmarks.map(|(x, y)| Some(Point2::new(x, y))).to_vec(),
        };
        (found.freedom, found.undetermined) = (0, Vec::new());
        let options = InfinityOptions::default();
        assert_eq!(beyond_horizon(&problem, &found.map, &options), [4, 5, 6, 7]);
        drop_landmarks_at_infinity(&problem, &mut found, &options);
        assert_eq!(found.map.landmarks.iter().flatten().count(), 1);
        let listed = found.undetermined.iter().map(|one| one.subject);
        assert!(listed.eq((1..8).map(Subject::Landmark)));
        let known = crate::problem::LandmarkPrior {
            landmark: 5,
            position: Point2::origin(),
            noise: Noise::Sigmas([1.0, 1.0]),
        };
        let problem = problem.with_landmark_priors(&[known]).unwrap();
        let mut map = found.map;
        map.landmarks = landmarks.map(|(x, y)| Some(Point2::new(x, y))).to_vec();
        assert_eq!(beyond_horizon(&problem, &map, &options), [4, 6, 7]);
    }
}
