// SPDX-License-Identifier: MIT OR Apache-2.0
//! How sensitive a map is to noise, in the direction that the bearings determine least.

use super::weak_directions::{Eigenpair, weakest};
use crate::adjustment::bundle::{Bundle, Rows};
use crate::adjustment::elimination::{GroupedSightings, gauge, keeps_landmarks, kept_positions};
use crate::adjustment::gauge::gauge_directions;
use crate::adjustment::normal_equations::Normal;
use crate::adjustment::refine::is_sparse;
use crate::adjustment::schur::{Grouped, Schur};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::spread;
use crate::lm::Loss;
use crate::problem::{Map, Problem, Subject};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{Matrix2, Vector2};

/// How sensitive a map is to noise, and who most of all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// The predicted standard deviation of the map over its size in the direction that the bearings determine least, for
    /// residuals of one sigma; or that of the position of a single view, where that is more. Infinite when the direction
    /// is free, up to rounding: above about `1 / (8 sqrt(eps))` per radian the value is mostly rounding.
    pub deviation: f64,
    /// The view or landmark that moves most along it; `None` where nothing is known.
    pub worst: Option<Subject>,
}

/// How sensitive a refined map is to noise.
pub fn sensitivity(problem: &Problem, map: &Map) -> Sensitivity {
    let restricted;
    let active = if map.is_complete() {
        problem
    } else {
        restricted = map.restrict(problem);
        &restricted
    };
    let bundle = Bundle::from_map(map);
    let (deviation, worst) = if is_sparse(active) {
        weakest_of_all(&bundle, active)
    } else if keeps_landmarks(active) {
        weakest_kept::<3, 2>(&bundle, active)
    } else {
        weakest_kept::<2, 3>(&bundle, active)
    };
    // Places count among what is in the map.
    let nth = |place: Place| {
        let mut all = map.determined().filter(|subject| match place {
            Place::View(_) => matches!(subject, Subject::View(_)),
            Place::Landmark(_) => matches!(subject, Subject::Landmark(_)),
        });
        let (Place::View(k) | Place::Landmark(k)) = place;
        all.nth(k)
    };
    Sensitivity {
        deviation,
        worst: worst.and_then(nth),
    }
}

/// A view or landmark by its place among those in the map.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    View(usize),
    Landmark(usize),
}

/// A sighting over less than this fraction of the map's size is left out. It says little more than that view and
/// landmark are in one place, and beside its huge weight the others would be lost in rounding.
const TOUCHING: f64 = 1e-4;

/// The sensitivity of the views, by the sparse normal equations.
fn weakest_of_all(bundle: &Bundle, problem: &Problem) -> (f64, Option<Place>) {
    let places = kept_positions::<3>(bundle);
    let size = spread(&places);
    let rows = without_touching(bundle, problem, size, places.len());
    let Some(mut normal) = Normal::new(problem) else {
        return (f64::NAN, None);
    };
    normal.assemble(&rows, &gauge_directions(problem, bundle));
    if !normal.factorize(0.0) {
        return (f64::INFINITY, None);
    }
    let views = |pair: &Eigenpair| squares::<3>(&pair.direction[..3 * places.len()]);
    let Ok(found) = weakest(&normal, LOOKED_AT, &mut || Ok(())) else {
        return (f64::INFINITY, None);
    };
    let of_each = found.iter().map(|pair| {
        let squares = views(pair);
        (squares.iter().sum::<f64>(), largest(&squares))
    });
    let most = of_each.fold(
        (0.0, None),
        |most, next| {
            if next.0 > most.0 { next } else { most }
        },
    );
    ((most.0 / size).sqrt(), most.1.map(Place::View))
}

/// The squared steps of positions in blocks of `K` parameters.
fn squares<const K: usize>(direction: &[f64]) -> Vec<f64> {
    let blocks = direction.chunks_exact(K);
    blocks
        .map(|block| block[0] * block[0] + block[1] * block[1])
        .collect()
}

/// The place of the largest number.
fn largest(numbers: &[f64]) -> Option<usize> {
    (0..numbers.len()).max_by(|&a, &b| numbers[a].total_cmp(&numbers[b]))
}

/// Number of weakest directions among which the one that moves the views most is chosen: weak landmarks may come
/// before it.
const LOOKED_AT: usize = 8;

/// The problem linearised, without sightings over almost no distance.
fn without_touching(bundle: &Bundle, problem: &Problem, size: f64, count: usize) -> Rows {
    let mut rows = Rows::of(problem);
    bundle.linearize(problem, Loss::Squared, &mut rows);
    let limit = (count as f64 / (TOUCHING * TOUCHING)) / size;
    for row in &mut rows.sightings {
        if row.gradient.norm_squared() > limit * row.weight * row.weight {
            row.gradient = Vector2::zeros();
            row.weight = 0.0;
        }
    }
    rows
}

fn weakest_kept<const E: usize, const K: usize>(
    bundle: &Bundle,
    problem: &Problem,
) -> (f64, Option<Place>)
where
    for<'x> GroupedSightings<'x>: Grouped<E, K>,
{
    let points = kept_positions::<K>(bundle);
    let size = spread(&points);
    let rows = without_touching(bundle, problem, size, points.len());
    let grouped = GroupedSightings {
        problem,
        rows: &rows.sightings,
    };
    let mut schur = Schur::<E, K>::new();
    if !schur.factorize(&grouped, 0.0, &gauge::<K>(bundle)) {
        return (f64::INFINITY, None);
    }
    let kept = squares::<K>(&weakest_direction(&schur));
    let spread = kept.iter().fold(0.0, |sum, square| sum + square);
    // A single view may be weaker than that although all landmarks are well determined. Single landmarks are
    // found by `unbounded_landmarks`.
    let mean = size / (points.len() as f64);
    if E == 3 {
        let variances = schur.blocks().iter().map(|block| block.position_variance());
        let variances: Vec<f64> = variances.collect();
        if let Some(view) = largest(&variances)
            && variances[view] / mean > spread / size
        {
            return ((variances[view] / mean).sqrt(), Some(Place::View(view)));
        }
    }
    let place = largest(&kept).map(if K == 3 { Place::View } else { Place::Landmark });
    ((spread / size).sqrt(), place)
}

/// Steps of inverse iteration in [`weakest_direction`]: enough to know its length to a few percent.
const WEAKEST_STEPS: usize = 6;

/// The direction in which the data determine the kept blocks least, as a displacement one standard
/// deviation long when residuals have unit variance.
///
/// (T16): inverse iteration on the reduced matrix with its parameters in units of their conditional
/// standard deviations; needs [`Schur::factorize`] without damping.
fn weakest_direction<const E: usize, const K: usize>(schur: &Schur<E, K>) -> Vec<f64> {
    let size = schur.size();
    let units: Vec<f64> = (0..size).map(|k| schur.information(k).sqrt()).collect();
    let mut vector: Vec<f64> = (0..size)
        .map(|k| 1.0 + 0.1 * ((7 * k + 3) % 11) as f64)
        .collect();
    let mut gain = 1.0;
    for _ in 0..WEAKEST_STEPS {
        let norm = vector.iter().fold(0.0, |s, v| s + *v * *v).sqrt();
        let mut next = vec![0.0; size];
        for k in 0..size {
            vector[k] /= norm;
            next[k] = vector[k] * units[k];
        }
        schur.solve_reduced(&mut next);
        gain = 0.0;
        for k in 0..size {
            next[k] *= units[k];
            gain += next[k] * vector[k];
        }
        vector = next;
    }
    let norm = vector.iter().fold(0.0, |s, v| s + *v * *v).sqrt();
    let length = gain.max(0.0).sqrt() / norm;
    for (v, unit) in vector.iter_mut().zip(&units) {
        *v *= length / *unit;
    }
    vector
}

/// The landmarks of a refined map of which only the direction is known: with the views held fixed, the
/// predicted standard deviation of their range exceeds the range itself. Their rays are parallel
/// within their noise, and the position along them where the refinement stopped is arbitrary.
///
/// `variance` is that of the residuals over sigma.
pub fn unbounded_landmarks(problem: &Problem, map: &Map, variance: f64) -> Vec<usize> {
    let mut found = Vec::new();
    let known = |landmark: usize| {
        let subject = Some(Subject::Landmark(landmark));
        problem
            .priors()
            .iter()
            .any(|prior| prior.subjects()[0] == subject)
    };
    for (landmark, point) in map.landmarks.iter().enumerate() {
        let Some(point) = point else { continue };
        let mut information = Matrix2::zeros();
        for (pose, s) in map.rays(problem, landmark) {
            let offset = point.coords - pose.translation.vector;
            let square = offset.norm_squared();
            // Multiplied by the range: information about the position in units of the range.
            let gradient = Vector2::new(-offset.y, offset.x) * (s.weight / square.sqrt());
            information += gradient * gradient.transpose();
        }
        // In a narrow bundle of rays this is the smaller eigenvalue.
        let trace = information.trace();
        let determinant = information.determinant().max(0.0);
        let held = determinant / trace;
        if trace > 0.0 && held < variance && !known(landmark) {
            found.push(landmark);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::decompose::symmetric_eigen;
    use crate::geometry::pose;
    use crate::problem::LandmarkPrior;
    use crate::problem::Noise;
    use crate::simulate::{Arena, Layout, simulate};
    use nalgebra::{DMatrix, Point2};

    type Way = fn(&Bundle, &Problem) -> (f64, Option<Place>);

    /// The ways to compute it, each for problems of any size.
    const WAYS: [Way; 3] = [weakest_of_all, weakest_kept::<3, 2>, weakest_kept::<2, 3>];

    /// A standard deviation over the size of the map: proportional to that of the bearings, and the same in any unit of
    /// length.
    #[test]
    fn sensitivity_is_relative_to_the_size_of_the_map() {
        let scene = simulate(Layout::Mixed, 7, 9, 0.0, 2, Arena::default()).unwrap();
        let problem = |sigma| Problem::dense(7, 9, &scene.bearings, sigma).unwrap();
        let mut bundle = Bundle::from_map(&scene.map());
        let before = WAYS.map(|way| way(&bundle, &problem(0.01)).0);
        for (scale, sigma) in [(1000.0, 0.01), (1e-6, 0.01), (1.0, 0.03)] {
            bundle.scale(scale);
            for (k, (way, before)) in WAYS.iter().zip(before).enumerate() {
                let ratio = way(&bundle, &problem(sigma)).0 / before;
                // Not to the last digit: between these units one of them changes by 12 percent.
                assert!(
                    (ratio / (sigma / 0.01) - 1.0).abs() < 0.25,
                    "{k} {scale}: {ratio}"
                );
            }
        }
    }

    /// The iteration finds the largest eigenvector of the covariance of the kept blocks in units of conditional standard
    /// deviations, one standard deviation long.
    fn check_weakest_direction<const E: usize, const K: usize>(bundle: &Bundle, problem: &Problem)
    where
        for<'x> GroupedSightings<'x>: Grouped<E, K>,
    {
        let mut rows = Rows::of(problem);
        bundle.linearize(problem, Loss::Squared, &mut rows);
        let grouped = GroupedSightings {
            problem,
            rows: &rows.sightings,
        };
        let mut schur = Schur::<E, K>::new();
        assert!(schur.factorize(&grouped, 0.0, &gauge::<K>(bundle)));
        let size = schur.size();
        let mut covariance = DMatrix::identity(size, size);
        for mut column in covariance.column_iter_mut() {
            schur.solve_reduced(column.as_mut_slice());
        }
        let units = |k: usize| schur.information(k).sqrt();
        let whitened =
            DMatrix::from_fn(size, size, |i, j| units(i) * covariance[(i, j)] * units(j));
        let eigen = symmetric_eigen(whitened).unwrap();
        let most = eigen.eigenvalues.imax();
        let found = weakest_direction(&schur);
        let length = eigen.eigenvalues[most].sqrt();
        let expected: Vec<f64> = (0..size)
            .map(|k| eigen.eigenvectors[(k, most)] * length / units(k))
            .collect();
        let norm = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>().sqrt();
        let sign = expected
            .iter()
            .zip(&found)
            .map(|(a, b)| a * b)
            .sum::<f64>()
            .signum();
        let apart: Vec<f64> = expected
            .iter()
            .zip(&found)
            .map(|(a, b)| a * sign - b)
            .collect();
        // As far as six steps of the iteration go.
        assert!(
            norm(&apart) < 0.05 * norm(&expected),
            "{E}: {}",
            norm(&apart) / norm(&expected)
        );
    }

    #[test]
    fn the_weakest_direction_is_the_largest_of_the_covariance() {
        // The landmarks are almost on a line, which is a weak direction.
        let poses = [
            (0.0, 0.0, 0.2),
            (1.0, 0.4, 1.1),
            (2.0, -0.3, -0.8),
            (3.0, 0.5, 2.0),
            (4.0, 0.1, 0.4),
        ];
        let bundle = Bundle {
            poses: poses.map(|(x, y, theta)| pose(x, y, theta)).to_vec(),
            landmarks: (0..7)
                .map(|k| Point2::new(0.8 * f64::from(k), 3.0 + 0.1 * f64::from(k % 3)))
                .collect(),
        };
        let problem = Problem::dense(5, 7, &[0.1; 35], 0.01).unwrap();
        check_weakest_direction::<3, 2>(&bundle, &problem);
        check_weakest_direction::<2, 3>(&bundle, &problem);
    }

    /// A view that sees little is as uncertain as its own bearings leave it, although all landmarks are known well.
    #[test]
    fn a_loose_view_makes_a_map_sensitive() {
        let scene = simulate(Layout::Mixed, 12, 9, 0.0, 2, Arena::default()).unwrap();
        let mut bearings = scene.bearings.clone();
        let whole = Problem::dense(12, 9, &bearings, 0.01).unwrap();
        // What is left to it of its nine landmarks are three.
        bearings[3..9].fill(f64::NAN);
        let part = Problem::dense(12, 9, &bearings, 0.01).unwrap();
        let mut bundle = Bundle::from_map(&scene.map());
        // It stands far off, and sees them within a few degrees.
        bundle.poses[0] = pose(60.0, 40.0, 0.3);
        let mut information = nalgebra::Matrix3::zeros();
        let mut rows = Rows::of(&part);
        bundle.linearize(&part, Loss::Squared, &mut rows);
        for row in &rows.sightings[..3] {
            let row = nalgebra::Vector3::from(row.pose());
            information += row * row.transpose();
        }
        let variance = information.try_inverse().unwrap();
        let points = kept_positions::<2>(&bundle);
        let mean = spread(&points) / points.len() as f64;
        let expected = ((variance[(0, 0)] + variance[(1, 1)]) / mean).sqrt();
        let (found, worst) = weakest_kept::<3, 2>(&bundle, &part);
        assert_eq!(worst, Some(Place::View(0)));
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        assert!(weakest_kept::<3, 2>(&bundle, &whole).0 < found);
    }

    /// Of two views whose rays meet under an angle, a landmark is at infinity when the standard deviation of its range
    /// exceeds the range, unless a prior knows it.
    #[test]
    fn landmarks_without_parallax_are_unbounded() {
        let (sigma, angle) = (0.01_f64, 0.03_f64);
        let half = (angle / 2.0).tan();
        let map = Map {
            poses: Vec::from([Some(pose(-half, 0.0, 0.3)), Some(pose(half, 0.0, 2.0))]),
            landmarks: Vec::from([
                Some(Point2::new(0.0, 1.0)),
                None,
                Some(Point2::new(half, 0.5)),
            ]),
        };
        let problem = Problem::dense(2, 3, &[0.1; 6], sigma).unwrap();
        // Two rays determine the range, in units of itself, up to sqrt(2) sigma over the sine of their angle.
        let bound = (angle.sin() / sigma).powi(2) / 2.0;
        assert_eq!(unbounded_landmarks(&problem, &map, 0.99 * bound), [0; 0]);
        assert_eq!(unbounded_landmarks(&problem, &map, 1.01 * bound), [0]);
        let known = |landmark: usize| LandmarkPrior {
            landmark,
            position: Point2::new(0.0, 1.0),
            noise: Noise::Sigmas([1.0, 1.0]),
        };
        for (landmark, found) in [(0, &[][..]), (2, &[0])] {
            let problem = problem
                .clone()
                .with_landmark_priors(&[known(landmark)])
                .unwrap();
            assert_eq!(unbounded_landmarks(&problem, &map, 1.01 * bound), found);
        }
    }

    /// The one that moves most is named by its index in the problem, whatever is not in the map.
    #[test]
    fn the_worst_is_named() {
        let scene = simulate(Layout::Mixed, 24, 8, 0.0, 2, Arena::default()).unwrap();
        let mut map = scene.map();
        let mut bearings = scene.bearings.clone();
        // View 4 sees no more than three landmarks of the map.
        bearings[4 * 8 + 4..5 * 8].fill(f64::NAN);
        map.poses[4] = Some(pose(60.0, 40.0, 0.3));
        map.poses[1] = None;
        map.landmarks[0] = None;
        let problem = Problem::dense(24, 8, &bearings, 0.01).unwrap();
        assert_eq!(sensitivity(&problem, &map).worst, Some(Subject::View(4)));
        assert_eq!(sensitivity(&problem, &Map::empty(24, 8)).worst, None);
    }
}
