// SPDX-License-Identifier: MIT OR Apache-2.0
//! Which points move in a direction, after removing the similarity that leaves most points where they are.

use super::normalized_map::NormalizedMap;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::uncertainty::largest_first;
use alloc::vec::Vec;
use nalgebra::{Complex, Vector2};

/// Rounds of reweighting, twice as many as the weights usually need to converge.
const ROUNDS: usize = 25;

/// Moves below this fraction of the largest are rounding of the fit; a bound on the weights.
const ROUNDING: f64 = 1e-6;

/// The points that move and their shares of the squared moves, largest first.
///
/// A similarity of the whole changes no bearing, so it may be subtracted. The one chosen minimises the sum of moves,
/// not of their squares, so that as many points as possible stay where they are.
pub fn moving_points(map: &NormalizedMap, moves: &[Vector2<f64>]) -> Vec<(usize, f64)> {
    let units = map.units();
    let left = without_similarity(map, moves, &units);
    largest_first(left.into_iter().map(|length| length * length).enumerate())
}

/// How far each point moves, in its units.
fn without_similarity(map: &NormalizedMap, moves: &[Vector2<f64>], units: &[f64]) -> Vec<f64> {
    let complex = |v: &Vector2<f64>| Complex::new(v.x, v.y);
    let places: Vec<_> = map.points.iter().map(complex).collect();
    let moves: Vec<_> = moves.iter().map(complex).collect();
    let mut weights: Vec<f64> = units.iter().map(|unit| 1.0 / unit).collect();
    let mut left: Vec<f64> = Vec::new();
    let largest = moves.iter().map(|z| z.norm_sqr()).fold(0.0, f64::max);
    let floor = ROUNDING * largest.sqrt();
    for _ in 0..ROUNDS {
        // move = shift + turn * place, weighted least squares.
        let (mut sum, mut place, mut moved) = (0.0, Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
        for ((w, z), d) in weights.iter().zip(&places).zip(&moves) {
            sum += w;
            place += z * *w;
            moved += d * *w;
        }
        let (place, moved) = (place / sum, moved / sum);
        let (mut square, mut product) = (0.0, Complex::new(0.0, 0.0));
        for ((w, z), d) in weights.iter().zip(&places).zip(&moves) {
            square += w * (z - place).norm_sqr();
            product += (z - place).conj() * (d - moved) * *w;
        }
        let turn = if square > 0.0 {
            product / square
        } else {
            Complex::new(0.0, 0.0)
        };
        let rest = places.iter().zip(&moves).zip(units).map(|((z, d), unit)| {
            let off = d - moved - turn * (z - place);
            off.norm_sqr().sqrt() / unit
        });
        left = rest.collect();
        for ((weight, length), unit) in weights.iter_mut().zip(&left).zip(units) {
            *weight = 1.0 / (unit * (length + floor));
        }
    }
    left
}
