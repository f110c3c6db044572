// SPDX-License-Identifier: MIT OR Apache-2.0
//! The weakest directions of a map, from the sparse normal equations.

use super::frame::{LIFT, in_frame, inner_constraints};
use crate::adjustment::bundle::{Bundle, Rows};
use crate::adjustment::decompose::symmetric_eigen;
use crate::adjustment::elimination::kept_positions;
use crate::adjustment::gauge::gauge_directions;
use crate::adjustment::normal_equations::Normal;
use crate::error::{Degeneracy, Error};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::spread;
use crate::lm::Loss;
use crate::problem::{Map, Problem, Subject};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::DMatrix;

/// A direction of a map that is determined weakly or not at all. `Cause` is the type by which the caller names causes.
#[derive(Clone, Debug, PartialEq)]
pub struct WeakDirection<Cause> {
    /// Whether it is free, up to rounding; otherwise it is weak.
    pub free: bool,
    /// How well it is determined: the singular value of the Jacobian over the norm of its median column; from the
    /// sparse normal equations, one over the root of the gain. 0 if free.
    pub singular_value: f64,
    /// Predicted standard deviation of the map along it, as a fraction of its size: root mean square over all
    /// positions. Infinite if free.
    pub deviation: f64,
    /// The same for the position that moves most.
    pub largest: f64,
    /// What moves, and its share of the squared moves; largest first.
    pub movers: Vec<(Subject, f64)>,
    /// What explains it.
    pub cause: Option<Cause>,
}

impl<Cause> WeakDirection<Cause> {
    /// The same direction with another cause.
    pub(crate) fn with_cause<Other>(self, cause: Option<Other>) -> WeakDirection<Other> {
        WeakDirection {
            free: self.free,
            singular_value: self.singular_value,
            deviation: self.deviation,
            largest: self.largest,
            movers: self.movers,
            cause,
        }
    }
}

/// An eigenvector of the covariance, one standard deviation long for residuals of unit variance, and its gain: the
/// variance along it over what it would be if each parameter were the only unknown.
pub struct Eigenpair {
    pub direction: Vec<f64>,
    pub gain: f64,
}

/// Gain above which a direction is free: the information along it is then 1e-11 of the conditional information of
/// its parameters, which is rounding.
const FREE: f64 = 1e11;

/// Steps of the iteration in [`weakest`]: enough to know the lengths to a few percent.
const STEPS: usize = 8;

/// The normal equations are singular beyond the free directions, or beyond the arithmetic.
pub const SINGULAR_EQUATIONS: Error = Error::Degenerate {
    kind: Degeneracy::SingularNormalEquations,
    value: 0.0,
    bound: f64::EPSILON,
};

/// Whether the caller wants to go on, asked between steps.
pub type Watch<'a> = &'a mut dyn FnMut() -> Result<(), Error>;

/// The free directions beyond the gauge, at most `count`.
///
/// Priors and odometry may determine a direction far more weakly than bearings determine the others, and it is still
/// not free. So each of their rows gets the weight of a typical bearing here, which does not change the null space.
/// `normal` keeps these weights.
pub fn free_directions(
    normal: &mut Normal<'_>,
    rows: &Rows,
    gauge: &[Vec<f64>],
    count: usize,
    watch: Watch<'_>,
) -> Result<Vec<Vec<f64>>, Error> {
    let mut balanced = rows.clone();
    let squares = rows.sightings.iter().map(|row| row.gradient.norm_squared());
    let mean = squares.sum::<f64>() / rows.sightings.len().max(1) as f64;
    let typical = (if mean > 0.0 { mean } else { 1.0 }).sqrt();
    for prior in &mut balanced.priors {
        for k in 0..3 {
            let both = [Some(prior.first), prior.second].into_iter().flatten();
            let square = both.fold(0.0, |sum, (_, jacobian)| {
                jacobian[k]
                    .iter()
                    .fold(sum, |sum, entry| sum + *entry * *entry)
            });
            if square > 0.0 {
                let factor = typical / square.sqrt();
                prior.first.1[k] = prior.first.1[k].map(|entry| entry * factor);
                if let Some((_, jacobian)) = &mut prior.second {
                    jacobian[k] = jacobian[k].map(|entry| entry * factor);
                }
            }
        }
    }
    normal.assemble(&balanced, gauge);
    if !normal.factorize(0.0) && !normal.factorize(LIFT) {
        return Err(SINGULAR_EQUATIONS);
    }
    let found = weakest(normal, count, watch)?.into_iter();
    let free = found.filter(|weak| !(weak.gain < FREE));
    Ok(free.map(|weak| weak.direction).collect())
}

/// The `count` weakest directions, the weakest first.
///
/// (T16) for a sparse matrix: inverse iteration on a few vectors at once, with the parameters in units of
/// their conditional standard deviations. Needs [`Normal::factorize`].
///
/// # Errors
/// [`SINGULAR_EQUATIONS`] beyond the arithmetic; those of `watch`.
pub fn weakest(
    normal: &Normal<'_>,
    count: usize,
    watch: Watch<'_>,
) -> Result<Vec<Eigenpair>, Error> {
    let size = normal.size();
    let count = count.min(size);
    let units: Vec<f64> = (0..size)
        .map(|parameter| normal.diagonal(parameter).sqrt())
        .collect();
    // Start vectors without any symmetry that the problem may have.
    let mut basis = DMatrix::from_fn(size, count, |k, j| {
        1.0 + 0.37 * (((7 * k + 3 + (5 * k + 1) * j) % (11 + 2 * j)) as f64)
    });
    let mut gains = vec![0.0; count];
    for _ in 0..STEPS {
        watch()?;
        let orthogonal = basis.qr().q();
        let mut next = orthogonal.clone();
        for (k, unit) in units.iter().enumerate() {
            next.row_mut(k).scale_mut(*unit);
        }
        normal.solve(next.as_mut_slice());
        for (k, unit) in units.iter().enumerate() {
            next.row_mut(k).scale_mut(*unit);
        }
        // Rayleigh-Ritz: the eigenproblem in the space that they span.
        let small = orthogonal.transpose() * &next;
        let eigen =
            symmetric_eigen((&small + small.transpose()) * 0.5).ok_or(SINGULAR_EQUATIONS)?;
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        gains = order.iter().map(|&k| eigen.eigenvalues[k]).collect();
        let turned = DMatrix::from_fn(count, count, |i, j| eigen.eigenvectors[(i, order[j])]);
        basis = next * turned;
    }
    let pair = |k: usize| {
        let column = basis.column(k);
        let length = (gains[k].max(0.0)).sqrt() / column.norm();
        let entries = column.iter().zip(&units);
        Eigenpair {
            direction: entries
                .map(|(entry, unit)| {
                    if *unit > 0.0 {
                        entry * length / unit
                    } else {
                        0.0
                    }
                })
                .collect(),
            gain: gains[k],
        }
    };
    Ok((0..count).map(pair).collect())
}

/// The weakest directions of a map beyond its gauge, at most `count`, for residuals of this many `sigmas`, with any
/// odometry and priors and for maps of any size.
///
/// Along the gauge, positions do not move on average. `None` when the equations do not fit into memory or cannot be
/// factorised.
pub fn weakest_directions<Cause>(
    problem: &Problem,
    map: &Map,
    count: usize,
    sigmas: f64,
    watch: Watch<'_>,
) -> Result<Vec<WeakDirection<Cause>>, Error> {
    let subjects: Vec<Subject> = map.determined().collect();
    let active = map.restrict(problem);
    let bundle = Bundle::from_map(map);
    if bundle.poses.is_empty() {
        return Err(SINGULAR_EQUATIONS);
    }
    let mut rows = Rows::of(&active);
    bundle.linearize(&active, Loss::Squared, &mut rows);
    let mut normal = Normal::new(&active).ok_or(Error::OutOfMemory)?;
    let gauge = gauge_directions(&active, &bundle);
    let free = free_directions(&mut normal, &rows, &gauge, count, watch)?;
    normal.assemble(&rows, &gauge);
    if !normal.factorize(0.0) && !normal.factorize(LIFT) {
        return Err(SINGULAR_EQUATIONS);
    }
    let places = kept_positions::<3>(&bundle);
    let size = (spread(&places) / places.len() as f64).sqrt();
    let inner = inner_constraints(&gauge, places.len());
    // The free directions, and the weakest of the others.
    let others = weakest(&normal, count, watch)?.into_iter().skip(free.len());
    let free = free.into_iter().map(|direction| (direction, None));
    let all = free.chain(others.map(|pair| {
        let gain = Some(pair.gain).filter(|gain| *gain != f64::INFINITY);
        (pair.direction, gain)
    }));
    let found = all.map(|(direction, gain)| {
        let moved = in_frame(&gauge, &inner, &[direction]).ok_or(SINGULAR_EQUATIONS)?;
        let squares = squared_moves(&moved[0], places.len());
        let sum: f64 = squares.iter().sum();
        let most = squares.iter().copied().fold(0.0, f64::max);
        let deviation = |square: f64| match gain {
            None => f64::INFINITY,
            Some(_) => sigmas * (square.sqrt() / size),
        };
        Ok(WeakDirection {
            free: gain.is_none(),
            singular_value: gain.map_or(0.0, |gain| 1.0 / gain.max(1.0).sqrt()),
            deviation: deviation(sum / subjects.len() as f64),
            largest: deviation(most),
            movers: largest_first(subjects.iter().copied().zip(squares)),
            cause: None,
        })
    });
    found.collect()
}

/// The squared move of each position, views before landmarks.
fn squared_moves(direction: &[f64], views: usize) -> Vec<f64> {
    let (poses, landmarks) = direction.split_at(3 * views);
    let steps = poses.chunks_exact(3).chain(landmarks.chunks_exact(2));
    steps
        .map(|step| step[0] * step[0] + step[1] * step[1])
        .collect()
}

/// Fraction of the squared moves below which a position is not listed: a tenth of the whole in length. It affects
/// only what is listed.
const LISTED: f64 = 0.01;

/// What moves, with its share of the squared moves, largest first.
pub fn largest_first<T>(squares: impl Iterator<Item = (T, f64)>) -> Vec<(T, f64)> {
    let mut movers: Vec<(T, f64)> = squares.collect();
    let sum: f64 = movers.iter().map(|(_, square)| square).sum();
    movers.iter_mut().for_each(|(_, square)| *square /= sum);
    movers.retain(|(_, share)| *share > LISTED);
    movers.sort_by(|a, b| b.1.total_cmp(&a.1));
    movers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::problem::{LandmarkPrior, Noise};
    use nalgebra::Point2;

    /// Views along a lane and landmarks almost on a line, `depth` off it, which leaves a direction weak.
    fn lane(depth: f64) -> (Bundle, Map) {
        let poses = [
            (0.0, 0.0, 0.2),
            (1.0, 0.4, 1.1),
            (2.0, -0.3, -0.8),
            (3.0, 0.5, 2.0),
            (4.0, 0.1, 0.4),
        ];
        let map = Map {
            poses: poses.map(|(x, y, theta)| Some(pose(x, y, theta))).to_vec(),
            landmarks: (0..7)
                .map(|k| {
                    Some(Point2::new(
                        0.8 * f64::from(k),
                        3.0 + depth * f64::from(k % 3),
                    ))
                })
                .collect(),
        };
        (Bundle::from_map(&map), map)
    }

    fn linearized(problem: &Problem, bundle: &Bundle) -> Rows {
        let mut rows = Rows::of(problem);
        bundle.linearize(problem, Loss::Squared, &mut rows);
        rows
    }

    /// The change of all residuals along a direction, and the largest that a step as long would make.
    fn changes(problem: &Problem, rows: &Rows, direction: &[f64]) -> (f64, f64) {
        let views = 3 * problem.views();
        let (mut along, mut most) = (0.0, 0.0);
        for (s, row) in problem.sightings().iter().zip(&rows.sightings) {
            let steps = direction[3 * s.view..][..3]
                .iter()
                .chain(&direction[views + 2 * s.landmark..][..2]);
            let slopes = row.pose().into_iter().chain(row.landmark());
            let products = steps.zip(slopes).map(|(step, slope)| step * slope);
            along += products.clone().sum::<f64>().powi(2);
            most += products.map(f64::abs).sum::<f64>().powi(2);
        }
        for row in &rows.priors {
            let Subject::Landmark(landmark) = row.first.0 else {
                continue;
            };
            let step = &direction[views + 2 * landmark..][..2];
            for slope in row.first.1 {
                let product = step[0] * slope[0] + step[1] * slope[1];
                along += product * product;
                most += product * product;
            }
        }
        (along.sqrt(), most.sqrt())
    }

    /// The iteration finds the largest eigenvectors of the covariance in units of conditional standard deviations, each one
    /// standard deviation long.
    #[test]
    fn the_weakest_directions_are_the_largest_of_the_covariance() {
        let (bundle, _) = lane(0.1);
        let problem = Problem::dense(5, 7, &[0.1; 35], 0.01).unwrap();
        let rows = linearized(&problem, &bundle);
        let mut normal = Normal::new(&problem).unwrap();
        normal.assemble(&rows, &gauge_directions(&problem, &bundle));
        assert!(normal.factorize(0.0));
        let size = normal.size();
        let mut covariance = DMatrix::identity(size, size);
        normal.solve(covariance.as_mut_slice());
        let unit = |k: usize| normal.diagonal(k).sqrt();
        let whitened = DMatrix::from_fn(size, size, |i, j| unit(i) * covariance[(i, j)] * unit(j));
        let eigen = symmetric_eigen(whitened).unwrap();
        let mut order: Vec<usize> = (0..size).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let found = weakest(&normal, 6, &mut || Ok(())).unwrap();
        assert_eq!(found.len(), 6);
        // The last ones have not converged yet.
        for (pair, &k) in found.iter().zip(&order).take(3) {
            assert!(
                (pair.gain / eigen.eigenvalues[k] - 1.0).abs() < 0.02,
                "{}",
                pair.gain
            );
            let expected =
                (0..size).map(|i| eigen.eigenvectors[(i, k)] * pair.gain.sqrt() / unit(i));
            let expected: Vec<f64> = expected.collect();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let (own, other) = (
                dot(&expected, &expected),
                dot(&pair.direction, &pair.direction),
            );
            assert!((other / own - 1.0).abs() < 0.02, "{own} {other}");
            let cosine = dot(&expected, &pair.direction).abs() / (own * other).sqrt();
            assert!(cosine > 0.99, "{cosine}");
        }
        assert!(found.is_sorted_by(|a, b| a.gain >= b.gain));
        let more = weakest(&normal, size + 5, &mut || Ok(())).unwrap();
        assert_eq!(more.len(), size);
        let stopped = weakest(&normal, 2, &mut || Err(Error::Interrupted));
        assert_eq!(stopped.err(), Some(Error::Interrupted));
    }

    /// Along a free direction no residual changes, and there are as many whatever the standard deviations of priors.
    #[test]
    fn free_directions_do_not_depend_on_the_weights_of_priors() {
        let (bundle, map) = lane(0.0);
        let alone = |sigma| Problem::dense(5, 7, &[0.1; 35], sigma).unwrap();
        let known = |landmark: usize, sigma: f64| LandmarkPrior {
            landmark,
            position: map.landmarks[landmark].unwrap(),
            noise: Noise::Covariance([
                [sigma * sigma, 0.5 * sigma * sigma],
                [0.5 * sigma * sigma, sigma * sigma],
            ]),
        };
        for (sigma, of_bearings) in [
            (1e-5, 0.01),
            (0.1, 0.01),
            (1e5, 0.01),
            (1.0, 1e-8),
            (1.0, 1e4),
        ] {
            for (landmarks, free) in [(&[][..], 1), (&[0, 6], 1), (&[0, 3, 6], 0)] {
                let known: Vec<_> = landmarks.iter().map(|&k| known(k, sigma)).collect();
                let problem = alone(of_bearings);
                let problem = problem.with_landmark_priors(&known).unwrap();
                let rows = linearized(&problem, &bundle);
                let mut normal = Normal::new(&problem).unwrap();
                let gauge = gauge_directions(&problem, &bundle);
                let found = free_directions(&mut normal, &rows, &gauge, 5, &mut || Ok(())).unwrap();
                assert_eq!(found.len(), free, "{sigma} {landmarks:?}");
                for direction in found {
                    let (along, most) = changes(&problem, &rows, &direction);
                    assert!(
                        along < 1e-5 * most,
                        "{sigma} {landmarks:?}: {along:e} {most:e}"
                    );
                }
            }
        }
    }

    /// A direction that is weaker than all others makes up the covariance: its length is that of the standard deviations,
    /// which grow with the residuals and not with the unit of length.
    #[test]
    fn the_deviation_along_the_weakest_direction_is_that_of_the_map() {
        let (_, map) = lane(0.002);
        let problem = Problem::dense(5, 7, &[0.1; 35], 0.01).unwrap();
        let weakest = |map: &Map, sigmas| {
            let found = weakest_directions::<()>(&problem, map, 3, sigmas, &mut || Ok(()));
            found.unwrap()
        };
        let found = weakest(&map, 1.0);
        assert_eq!(found.len(), 3);
        let first = &found[0];
        assert!(!first.free && first.cause.is_none());
        let frame = super::super::frame::Frame::FreeNetwork;
        let covariance =
            super::super::covariance::covariance(&problem, &map, Loss::Squared, frame, None);
        let covariance = covariance.unwrap();
        let of_views = covariance
            .poses
            .iter()
            .flatten()
            .map(|block| block[(0, 0)] + block[(1, 1)]);
        let of_landmarks = covariance
            .landmarks
            .iter()
            .flatten()
            .map(|block| block.trace());
        let variances: Vec<f64> = of_views.chain(of_landmarks).collect();
        let sum: f64 = variances.iter().sum();
        let most = variances.iter().copied().fold(0.0, f64::max);
        let places: Vec<_> = map.view_positions().collect();
        let size = (spread(&places) / 5.0).sqrt();
        for (found, expected) in [(first.deviation, sum / 12.0), (first.largest, most)] {
            let expected = expected.sqrt() / size;
            assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
        }
        // Shares of the squared moves, the largest first.
        let share = (first.largest / first.deviation).powi(2) / 12.0;
        assert!((first.movers[0].1 / share - 1.0).abs() < 1e-9);
        assert!(first.movers.is_sorted_by(|a, b| a.1 >= b.1));
        assert!(first.movers.iter().all(|mover| mover.1 > LISTED));
        assert!(found.is_sorted_by(|a, b| a.singular_value <= b.singular_value));
        let larger = map.transformed(&nalgebra::Similarity2::new(
            nalgebra::Vector2::zeros(),
            0.3,
            8.0,
        ));
        for (other, times) in [(weakest(&map, 3.0), 3.0), (weakest(&larger, 1.0), 1.0)] {
            let ratio = other[0].deviation / first.deviation;
            assert!((ratio / times - 1.0).abs() < 1e-3, "{times}: {ratio}");
        }
    }

    #[test]
    fn movers_are_listed_with_their_shares() {
        let squares = [("a", 1.0), ("b", 50.0), ("c", 0.4), ("d", 48.6)];
        let found = largest_first(squares.into_iter());
        assert_eq!(found.len(), 2);
        assert_eq!([found[0].0, found[1].0], ["b", "d"]);
        assert!((found[0].1 - 0.5).abs() < 1e-12 && (found[1].1 - 0.486).abs() < 1e-12);
    }
}
