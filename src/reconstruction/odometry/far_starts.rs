// SPDX-License-Identifier: MIT OR Apache-2.0
//! Starts of robots that hardly move: all landmarks equally far away.
//!
//! Where the rays to a landmark hardly spread, triangulation places it by the noise, near the views or behind them, and a
//! descent from there ends in a minimum of its own. From a circle around the views the landmarks move together to where
//! odometry and bearings want them.

use super::super::infinity::far_out;
use super::options::PosteriorOptions;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::extent;
use crate::kernels::triangulate;
use crate::problem::{Map, Prior, Problem};
use alloc::vec::Vec;

/// The map with every landmark that no prior knows on a circle around the views, once for each radius in units of the
/// distance that the views may have moved; none where all landmarks that three views see have more than this parallax,
/// of many views half of them.
pub fn far_starts(
    problem: &Problem,
    start: &Map,
    min_parallax: f64,
    options: &PosteriorOptions,
) -> Vec<Map> {
    let known = problem.known_landmarks();
    let is_flat = |&landmark: &usize| {
        let rays = start.rays(problem, landmark);
        rays.clone().nth(2).is_some()
            && !triangulate(rays.map(|(pose, s)| (pose, s.bearing)))
                .is_ok_and(|found| found.parallax > min_parallax)
    };
    let unknown = (0..problem.landmarks()).filter(|&landmark| !known[landmark]);
    let flat = unknown.clone().filter(is_flat).count();
    // Beyond so many views a few such landmarks are left to what they end in.
    let enough = if problem.views() > options.many_views {
        (problem.landmarks() / 2).max(1)
    } else {
        1
    };
    if flat < enough {
        return Vec::new();
    }
    let moved = moved(problem, start);
    let on_circle = |radius: &f64| {
        let mut map = start.clone();
        for landmark in unknown.clone() {
            if let Some(place) = far_out(problem, start, landmark, radius * moved) {
                map.landmarks[landmark] = Some(place);
            }
        }
        map
    };
    options.far_radii.iter().map(on_circle).collect()
}

/// The extent of the views, and what the odometry leaves open of it.
fn moved(problem: &Problem, start: &Map) -> f64 {
    let views = start.poses.iter().flatten();
    let extent = extent(views.map(|pose| pose.translation.vector));
    let variances = problem.priors().iter().filter_map(|prior| match prior {
        Prior::Motion { root, .. } => {
            let information: f64 = root.iter().map(|row| row[0] * row[0]).sum();
            (information > 0.0).then(|| information.recip())
        }
        _ => None,
    });
    extent + variances.sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Noise, Odometry};
    use crate::simulate::{Arena, Layout, simulate};
    use alloc::vec;

    /// A robot that stands still has its landmarks on a circle, along its bearings; one that moves needs none.
    #[test]
    fn landmarks_are_on_a_circle_where_rays_hardly_spread() {
        let scene = simulate(Layout::Mixed, 4, 6, 0.0, 5, Arena::default()).unwrap();
        let still: Vec<f64> = (0..4).flat_map(|_| scene.bearings[..6].to_vec()).collect();
        let odometry: Vec<Odometry> = (0..3)
            .map(|view| Odometry {
                start: view,
                end: view + 1,
                delta: crate::geometry::pose(0.0, 0.0, 0.0),
                noise: Noise::Sigmas([0.2, 0.2, 0.1]),
            })
            .collect();
        let problem = Problem::dense(4, 6, &still, 0.01).unwrap();
        let problem = problem.with_odometry(&odometry).unwrap();
        let mut start = scene.map();
        start.poses = vec![Some(scene.poses[0]); 4];
        let options = PosteriorOptions::default();
        let found = far_starts(&problem, &start, 0.05, &options);
        let home = scene.poses[0];
        for (map, radius) in found.iter().zip(options.far_radii) {
            for (truth, place) in scene.landmarks.iter().zip(&map.landmarks) {
                let away = place.unwrap().coords - home.translation.vector;
                let moved = 0.2 * 3.0_f64.sqrt();
                assert!((away.norm() / (radius * moved) - 1.0).abs() < 1e-9);
                let toward = truth.coords - home.translation.vector;
                assert!(away.angle(&toward) < 1e-6);
            }
        }
        assert_eq!(found.len(), options.far_radii.len());

        let moving = Problem::dense(4, 6, &scene.bearings, 0.01).unwrap();
        assert!(far_starts(&moving, &scene.map(), 1e-3, &options).is_empty());
    }
}
