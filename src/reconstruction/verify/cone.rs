// SPDX-License-Identifier: MIT OR Apache-2.0
//! The cone of tensors that every map of lower cost has.
//!
//! Symbols as in `docs/theory.md`, section 7.3.

use super::super::options::{Progress, SolveOptions, goes_on};
use super::super::result::Reconstruction;
use super::super::search::hypotheses::MIN_SHARED;
use super::super::search::triples::{common_bearings, draw};
use crate::adjustment::decompose::singular_values;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::kernels::{CalibratedTensor, Triple};
use crate::problem::Problem;
use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{DMatrix, Vector6};

/// Where the tensor of three views is in every map of lower cost.
pub enum Localisation {
    /// No three views share enough landmarks.
    TooFewShared,
    /// Nowhere: there is no such map.
    Nowhere([usize; 3]),
    /// Anywhere.
    Anywhere,
    /// In a cone.
    Cone(Box<Cone>),
}

/// A cone of tensors of three views, elliptic.
pub struct Cone {
    pub views: [usize; 3],
    /// The bearings of the landmarks that they share.
    pub triples: Vec<Triple<f64>>,
    /// Right singular vectors of the system of three views, that of the smallest singular value first: the axis of the
    /// cone and its five other directions.
    axes: [Vector6<f64>; 6],
    /// Sines of half the opening angle along these five directions, the largest first.
    pub sines: [f64; 5],
}

impl Cone {
    /// Half the largest opening angle \[rad\].
    pub fn angle(&self) -> f64 {
        let [sine, ..] = self.sines;
        sine.atan2((1.0 - sine * sine).max(0.0).sqrt())
    }

    /// The tensor with these coordinates along the five directions; of unit norm, unless they exceed it.
    pub fn tensor(&self, place: &[f64; 5]) -> CalibratedTensor<f64> {
        let square: f64 = place.iter().map(|x| x * x).sum();
        let [axis, others @ ..] = &self.axes;
        let mut vector = axis * (1.0 - square).max(0.0).sqrt();
        for (x, direction) in place.iter().zip(others) {
            vector += direction * *x;
        }
        CalibratedTensor::of_vector(&vector)
    }
}

/// The system of three views that share landmarks, decomposed.
struct System {
    views: [usize; 3],
    /// The bearings of the landmarks, one for each row.
    triples: Vec<Triple<f64>>,
    /// The singular values, the smallest first.
    values: [f64; 6],
    /// Their right singular vectors.
    axes: [Vector6<f64>; 6],
}

/// Bounds the tensors of three views in all maps of lower cost, by the triple that confines them most.
///
/// For a map with residuals rho, every row of the system of three views, at the unit tensor t of the map, is at most
/// the norm of the three phases by which the residuals turn its terms; so |D t| <= 2 |rho|, also with each row over the
/// largest sigma of its bearings and rho over sigma. (T32)
///
/// No t has |D t| < s1, so three views cost at least s1^2 / 8. What is left of the cost of the map for three views is that
/// without the least cost of other triples that have no view in common, R^2 = 2 cost - sum s1^2 / 4, (T33). With the
/// coordinates y of t along the other singular vectors,
///
///   sum over k of (sk^2 - s1^2) yk^2 <= 4 R^2 - s1^2.  (T34)
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so.
pub fn localise(
    problem: &Problem,
    found: &Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Localisation, Error> {
    let stages = &options.stages;
    let most = stages.verify.triples;
    let drawn = draw(problem, MIN_SHARED, most, options.seed, &stages.draw);
    let mut systems = Vec::with_capacity(drawn.len());
    for (done, &views) in drawn.iter().enumerate() {
        goes_on(progress, "verify", done, drawn.len())?;
        systems.extend(decompose(problem, found, views));
    }
    if systems.is_empty() {
        return Ok(Localisation::TooFewShared);
    }
    // The most costly first, so that the disjoint ones that are chosen one by one cost much.
    systems.sort_by(|a, b| b.values[0].total_cmp(&a.values[0]));
    let mut best: Option<(usize, [f64; 5])> = None;
    for (k, system) in systems.iter().enumerate() {
        let [least, others @ ..] = system.values;
        let excess = 4.0 * (2.0 * found.cost - least_cost_beside(problem, &systems, system));
        let excess = excess - least * least;
        if excess < 0.0 {
            return Ok(Localisation::Nowhere(system.views));
        }
        let sines = others.map(|value| (excess / (value * value - least * least)).sqrt());
        let is_narrower = best.is_none_or(|(_, narrowest)| sines[0] < narrowest[0]);
        if sines[0] < 1.0 && is_narrower {
            best = Some((k, sines));
        }
    }
    Ok(best.map_or(Localisation::Anywhere, |(k, sines)| {
        let System {
            views,
            triples,
            axes,
            ..
        } = systems.swap_remove(k);
        Localisation::Cone(Box::new(Cone {
            views,
            triples,
            axes,
            sines,
        }))
    }))
}

/// The sum of s1^2 / 4 over triples of views that have no view in common with each other or with a given one, chosen one
/// by one: at most the sum of the squared residuals of their sightings.
fn least_cost_beside(problem: &Problem, systems: &[System], of: &System) -> f64 {
    let mut used = vec![false; problem.views()];
    of.views.iter().for_each(|&view| used[view] = true);
    let mut sum = 0.0;
    for System { views, values, .. } in systems {
        if values[0] > 0.0 && views.iter().all(|&view| !used[view]) {
            views.iter().for_each(|&view| used[view] = true);
            sum += 0.25 * values[0] * values[0];
        }
    }
    sum
}

/// The system of three views, each row over the largest standard deviation of its bearings. `None` where too few
/// landmarks have residuals in all three.
fn decompose(problem: &Problem, found: &Reconstruction, views: [usize; 3]) -> Option<System> {
    let (triples, landmarks) = common_bearings(problem, views);
    let mut rows = Vec::with_capacity(triples.len());
    for (triple, landmark) in triples.iter().zip(landmarks) {
        rows.extend(weight(problem, found, views, landmark).map(|weight| (*triple, weight)));
    }
    if rows.len() < MIN_SHARED {
        return None;
    }
    // Rows of zeros for those that are missing, so that there are six vectors.
    let mut matrix = DMatrix::zeros(rows.len().max(6), 6);
    for (k, (triple, weight)) in rows.iter().enumerate() {
        for (place, value) in matrix
            .row_mut(k)
            .iter_mut()
            .zip(CalibratedTensor::row(triple))
        {
            *place = value * weight;
        }
    }
    let decomposed = singular_values(&matrix)?;
    // Those of the decomposition begin with the largest.
    let last = |k: usize| 5 - k;
    Some(System {
        views,
        triples: rows.into_iter().map(|(triple, _)| triple).collect(),
        values: core::array::from_fn(|k| decomposed.values[last(k)]),
        axes: core::array::from_fn(|k| Vector6::from_fn(|row, _| decomposed.right[(row, last(k))])),
    })
}

/// One over the largest standard deviation with which three views see a landmark; `None` where the map does not explain
/// one of the sightings.
fn weight(
    problem: &Problem,
    found: &Reconstruction,
    views: [usize; 3],
    landmark: usize,
) -> Option<f64> {
    let mut least = f64::INFINITY;
    for view in views {
        let range = problem.range_of_view(view);
        let seen = &problem.sightings()[range.clone()];
        let place = seen.binary_search_by_key(&landmark, |s| s.landmark).ok()?;
        found.residuals[problem.input_order()[range.start + place]]?;
        least = least.min(seen[place].weight);
    }
    Some(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::geometry::{Pose, bearing_to, pose};
    use crate::lm::RefineOptions;
    use crate::problem::{Map, Sighting};
    use crate::simulate::{Arena, Layout, simulate};
    use nalgebra::{Complex, Point2, UnitComplex};

    /// Pseudo-random numbers in (-1, 1).
    fn number(seed: usize) -> f64 {
        ((seed as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(2.0) - 1.0
    }

    /// The unit tensor of three poses, (T2), as a vector of the system.
    fn tensor(poses: [Pose<f64>; 3]) -> Vector6<f64> {
        let [p, q, r] = poses.map(|pose| Complex::new(pose.translation.x, pose.translation.y));
        let [t0, t1, t2] = poses.map(|pose| pose.rotation.into_inner());
        let a = (p - q).conj() * t0 * t1 * t2.conj();
        let b = (r - p).conj() * t0 * t1.conj() * t2;
        let c = (q - r).conj() * t0.conj() * t1 * t2;
        Vector6::new(a.re, -a.im, b.re, -b.im, c.re, -c.im).normalize()
    }

    /// Any map, near or far: |D t| <= 2 |rho / sigma|, each row over the largest sigma of its bearings.
    #[test]
    fn residuals_bound_the_system() {
        let mut largest = 0.0_f64;
        for trial in 0..2000 {
            let random = |k: usize| number(1000 * trial + k);
            let views = [0, 1, 2].map(|v| pose(random(v), random(10 + v), 3.0 * random(20 + v)));
            let size = [1e-3, 0.1, 3.0][trial % 3];
            let (mut rows, mut squares) = (0.0, 0.0);
            for landmark in 0..8 {
                let random = |k: usize| random(100 + 20 * landmark + k);
                let point = Point2::new(4.0 * random(0), 4.0 * random(1));
                let sigmas = [2, 3, 4].map(|k| 0.01 * (1.1 + random(k)));
                let triple = core::array::from_fn(|view| {
                    let residual = size * random(5 + view);
                    squares += (residual / sigmas[view]).powi(2);
                    bearing_to(&views[view], &point).unwrap() * UnitComplex::new(residual)
                });
                let row = Vector6::from(CalibratedTensor::row(&triple)).dot(&tensor(views));
                rows += (row / sigmas.into_iter().fold(0.0, f64::max)).powi(2);
            }
            let ratio = (rows / squares).sqrt();
            assert!(ratio <= 2.0, "{trial}: {ratio}");
            largest = largest.max(ratio);
        }
        assert!(largest > 0.5, "{largest}");
    }

    /// Where in the ellipsoid a map is: below one inside.
    fn depth(cone: &Cone, map: &Map) -> f64 {
        let tensor = tensor(cone.views.map(|view| map.poses[view].unwrap()));
        let [_, others @ ..] = &cone.axes;
        let both = others.iter().zip(cone.sines);
        both.map(|(axis, sine)| (axis.dot(&tensor) / sine).powi(2))
            .sum()
    }

    /// Whatever a map costs, those that cost less are in its cone: here the least of a scene and others around it.
    #[test]
    fn every_lower_map_is_in_the_cone() {
        let options = SolveOptions::default();
        let (mut cones, mut deepest) = (0, 0.0_f64);
        for seed in 0..60 {
            let (views, landmarks) = [(3, 8), (4, 7), (7, 9)][seed % 3];
            let noise = [0.002, 0.01, 0.03][seed / 3 % 3];
            let scene = simulate(
                Layout::Mixed,
                views,
                landmarks,
                noise,
                seed as u64,
                Arena::default(),
            );
            let scene = scene.unwrap();
            // Standard deviations that differ, and not always those of the noise.
            let sightings = (0..views * landmarks).map(|k| Sighting {
                view: k / landmarks,
                landmark: k % landmarks,
                bearing: scene.bearings[k],
                sigma: noise * (1.5 + number(1000 * seed + k)),
            });
            let sightings: Vec<Sighting> = sightings.collect();
            let problem = Problem::new(views, landmarks, &sightings).unwrap();
            let mut least = scene.map();
            let report = refine_map(&problem, &mut least, &RefineOptions::default(), None);
            let Ok(report) = report else { continue };
            let found = Reconstruction::new(&problem, &least, report.clone());
            for k in 0..20 {
                // Farther and farther from the least map.
                let mut map = least.clone();
                let size = 1e-3 * 1.3_f64.powi(k) * noise / 0.01;
                for (view, place) in map.poses.iter_mut().flatten().enumerate() {
                    let random = |c: usize| size * number(100 * seed + 10 * view + c + k as usize);
                    *place = Pose::new(
                        place.translation.vector + nalgebra::Vector2::new(random(0), random(1)),
                        place.rotation.angle() + random(2),
                    );
                }
                let lower = Reconstruction::new(&problem, &map, report.clone());
                if lower.residuals.iter().any(Option::is_none) {
                    continue;
                }
                // The map that is to be verified costs a little more.
                let mut higher = found.clone();
                higher.cost = lower.cost * 1.000_001;
                match localise(&problem, &higher, &options, &mut None).unwrap() {
                    Localisation::Cone(cone) => {
                        cones += 1;
                        let depth = depth(&cone, &lower.map);
                        assert!(depth <= 1.0, "{seed} {k}: {depth}");
                        deepest = deepest.max(depth);
                        let unit = cone.tensor(&[0.1, 0.2, -0.1, 0.05, 0.0]);
                        let norm: f64 = unit.coefficients.iter().map(Complex::norm_sqr).sum();
                        assert!((norm - 1.0).abs() < 1e-12);
                    }
                    Localisation::Anywhere => {}
                    Localisation::Nowhere(_) | Localisation::TooFewShared => panic!("{seed} {k}"),
                }
            }
        }
        // The bound is not empty either.
        assert!(cones > 300, "{cones}");
        assert!(deepest > 0.1, "{deepest}");
    }

    /// What other triples must cost is counted once for each view.
    #[test]
    fn triples_that_share_views_are_not_counted_twice() {
        let problem = Problem::new(9, 1, &[]).unwrap();
        let system = |views, least| System {
            views,
            triples: Vec::new(),
            values: [least, 9.0, 9.0, 9.0, 9.0, 9.0],
            axes: [Vector6::zeros(); 6],
        };
        let systems = [
            system([0, 1, 2], 8.0),
            system([2, 3, 4], 6.0),
            system([3, 4, 5], 4.0),
            system([5, 6, 7], 2.0),
            system([6, 7, 8], 0.0),
        ];
        for (of, expected) in [(0, 4.0), (1, 1.0), (2, 16.0), (3, 16.0), (4, 20.0)] {
            let sum = least_cost_beside(&problem, &systems, &systems[of]);
            assert_eq!(sum, expected, "{of}");
        }
    }
}
