// SPDX-License-Identifier: MIT OR Apache-2.0
//! How much a map owes to each sighting.

use super::bundle::Bundle;
use super::cholesky;
use super::map::Map;
use super::problem::Problem;
use super::variances::add_product;
use crate::scalar::Real;
use alloc::vec;
use alloc::vec::Vec;

/// Most parameters for which leverages are computed: a factorisation of that size takes a few
/// milliseconds.
const MAX_PARAMETERS: usize = 512;

/// The variance of the predicted bearing of each sighting of a problem over that of the measured one,
/// when a map has been refined to those that are `kept`: the leverage of a sighting that is, (T25).
///
/// `None` for a sighting that the map does not reach. Nothing when there are too many parameters, or
/// what is kept does not hold the map.
pub fn leverages<T: Real>(
    problem: &Problem<T>,
    map: &Map<T>,
    kept: &[bool],
) -> Option<Vec<Option<T>>> {
    let reached: Vec<bool> = problem
        .sightings()
        .iter()
        .map(|s| map.poses[s.view].is_some() && map.landmarks[s.landmark].is_some())
        .collect();
    let active = map.restrict(problem);
    let bundle = Bundle::from_map(map);
    let (views, landmarks) = (bundle.poses.len(), bundle.landmarks.len());
    let size = 3 * views + 2 * landmarks;
    if size > MAX_PARAMETERS {
        return None;
    }
    let mut rows = Vec::new();
    bundle.linearize(&active, &mut rows);
    let entries = active.sightings().iter().zip(&rows).map(|(s, row)| {
        let (p, x) = (3 * s.view, 3 * views + 2 * s.landmark);
        let ([dx, dy, turn], [gx, gy]) = (row.pose(), row.landmark());
        ([p, p + 1, p + 2, x, x + 1], [dx, dy, turn, gx, gy])
    });
    let kept_of_reached = kept.iter().zip(&reached).filter(|(_, reached)| **reached);
    let mut matrix = vec![T::zero(); size * size];
    for ((places, row), (kept, _)) in entries.clone().zip(kept_of_reached) {
        if *kept {
            add_product(&mut matrix, size, &places, &row);
        }
    }
    // The gauge must not make it singular, and no bearing depends on it.
    for k in 0..size {
        matrix[k * size + k] *= T::one() + T::eps().sqrt();
    }
    if !cholesky::factorize(&mut matrix, size) {
        return None;
    }
    let mut found = entries.map(|(places, row)| {
        let mut x = vec![T::zero(); size];
        for (place, value) in places.into_iter().zip(row) {
            x[place] = value;
        }
        cholesky::inverse_form(&matrix, &mut x, places[0])
    });
    Some(
        reached
            .iter()
            .map(|reached| if *reached { found.next() } else { None })
            .collect(),
    )
}
