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
