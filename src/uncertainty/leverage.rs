// SPDX-License-Identifier: MIT OR Apache-2.0
//! Leverage of sightings: how a refined map changes, to first order, when one is added or removed.

use super::variances::add_product;
use crate::adjustment::bundle::{Bundle, Rows};
use crate::adjustment::cholesky;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::Loss;
use crate::problem::{Map, Problem};
use alloc::vec;
use alloc::vec::Vec;

/// Maximum number of entries, sightings times parameters: they take eight megabytes and a few milliseconds.
const MAX_NUMBERS: usize = 1 << 20;

/// The rows of the Jacobian, whitened by the normal equations of the sightings that the map was estimated from.
///
/// With `J` the row of a sighting and `H` the normal matrix, inner products of two of these vectors are
/// `J_k H^-1 J_l^T`: covariances of predicted residuals over those of measured ones, (T29).
pub struct Leverage {
    size: usize,
    /// The vector of each sighting; zero where view or landmark is not in the map.
    rows: Vec<f64>,
    /// Residual over sigma of each sighting whose view and landmark are in the map.
    pub residuals: Vec<Option<f64>>,
}

impl Leverage {
    /// Leverages of all sightings of a problem on a map that has been refined from those `kept`.
    ///
    /// `None` when there are too many, or those that are kept do not determine the map.
    pub fn new(problem: &Problem, map: &Map, kept: &[bool]) -> Option<Self> {
        let reached: Vec<usize> = (0..kept.len())
            .filter(|&k| {
                let s = &problem.sightings()[k];
                map.poses[s.view].is_some() && map.landmarks[s.landmark].is_some()
            })
            .collect();
        let active = map.restrict(problem);
        let bundle = Bundle::from_map(map);
        let views = bundle.poses.len();
        let size = 3 * views + 2 * bundle.landmarks.len();
        if size.saturating_mul(kept.len().max(size)) > MAX_NUMBERS {
            return None;
        }
        let mut linearized = Rows::of(&active);
        bundle.linearize(&active, Loss::Squared, &mut linearized);
        let mut rows = vec![0.0; size * kept.len()];
        let mut residuals = vec![None; kept.len()];
        let mut matrix = vec![0.0; size * size];
        for ((s, row), &k) in active
            .sightings()
            .iter()
            .zip(&linearized.sightings)
            .zip(&reached)
        {
            let (p, x) = (3 * s.view, 3 * views + 2 * s.landmark);
            let ([dx, dy, turn], [gx, gy]) = (row.pose(), row.landmark());
            let (places, entries) = ([p, p + 1, p + 2, x, x + 1], [dx, dy, turn, gx, gy]);
            if kept[k] {
                add_product(&mut matrix, size, &places, &entries);
            }
            for (place, entry) in places.into_iter().zip(entries) {
                rows[k * size + place] = entry;
            }
            residuals[k] = Some(row.residual);
        }
        // Without this the gauge would make the matrix singular; no bearing depends on the gauge.
        for k in 0..size {
            matrix[k * size + k] *= 1.0 + f64::EPSILON.sqrt();
        }
        if !cholesky::factorize(&mut matrix, size) {
            return None;
        }
        for (s, &k) in active.sightings().iter().zip(&reached) {
            cholesky::whiten(&matrix, &mut rows[k * size..][..size], 3 * s.view);
        }
        Some(Self {
            size,
            rows,
            residuals,
        })
    }

    /// `J_k H^-1 J_l^T`; for `k == l` the leverage of a sighting.
    pub fn between(&self, k: usize, l: usize) -> f64 {
        let row = |k: usize| &self.rows[k * self.size..][..self.size];
        cholesky::dot(row(k), row(l))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::lm::RefineOptions;
    use crate::simulate::{Arena, Layout, simulate};

    /// A refined map of four views and seven landmarks without the last view and the second landmark, the sightings that
    /// it is estimated from, and all sightings.
    fn setting() -> (Problem, Problem, Map, Vec<bool>) {
        let scene = simulate(Layout::Enclosed, 5, 8, 1e-6, 3, Arena::default()).unwrap();
        let problem = Problem::dense(5, 8, &scene.bearings, 0.01).unwrap();
        let kept: Vec<bool> = problem
            .sightings()
            .iter()
            .map(|s| s.view != 4 && s.landmark != 1)
            .collect();
        let mut map = scene.map();
        map.poses[4] = None;
        map.landmarks[1] = None;
        let inner = problem.subset(&kept);
        refine_map(&inner, &mut map, &RefineOptions::default(), None).unwrap();
        (problem, inner, map, kept)
    }

    /// Leverages are those of a projection on the space of the parameters, of which the gauge is four: they add up to its
    /// dimension. What the map does not contain has none.
    #[test]
    fn leverages_add_up_to_the_number_of_parameters() {
        let (problem, _, map, kept) = setting();
        let found = Leverage::new(&problem, &map, &kept).unwrap();
        let own = |k: usize| found.between(k, k);
        let sum: f64 = (0..kept.len()).map(own).sum();
        assert!((sum - (3 * 4 + 2 * 7 - 4) as f64).abs() < 1e-4, "{sum}");
        for (k, inside) in kept.iter().enumerate() {
            assert_eq!(found.residuals[k].is_some(), *inside, "{k}");
            assert_eq!(own(k) > 0.0, *inside, "{k}");
            // A projection is its own square.
            let square: f64 = (0..kept.len()).map(|l| found.between(k, l).powi(2)).sum();
            assert!((square - own(k)).abs() < 1e-4, "{k}: {square} {}", own(k));
        }
    }

    /// (T29): without a sighting its residual is larger by a factor of one over one minus its leverage, and the others
    /// change with their inner product.
    #[test]
    fn residuals_without_a_sighting_are_predicted() {
        let (problem, inner, map, kept) = setting();
        let found = Leverage::new(&problem, &map, &kept).unwrap();
        let places: Vec<usize> = (0..kept.len()).filter(|&k| kept[k]).collect();
        for (removed, &k) in places.iter().enumerate() {
            let rest: Vec<bool> = (0..places.len()).map(|l| l != removed).collect();
            let mut without = map.clone();
            let options = RefineOptions::default();
            refine_map(&inner.subset(&rest), &mut without, &options, None).unwrap();
            let by = found.residuals[k].unwrap() / (1.0 - found.between(k, k));
            let residuals: Vec<f64> = without.residuals(&inner).flatten().collect();
            for (l, &place) in places.iter().enumerate() {
                let predicted = found.residuals[place].unwrap() + found.between(k, place) * by;
                let observed = residuals[l] / 0.01;
                // They are up to 6e-3 sigma: so little noise that the bearings are linear over it.
                assert!(
                    (predicted - observed).abs() < 1e-5,
                    "{k} {place}: {predicted} {observed}"
                );
            }
        }
    }
}
