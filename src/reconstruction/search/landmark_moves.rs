// SPDX-License-Identifier: MIT OR Apache-2.0
//! Alternative positions of single landmarks of a minimum.
//!
//! With the views held fixed, the cost of one landmark may have several minima: at a view, at infinity,
//! and in between. Two minima of the whole often differ in one such position and little else, and no
//! hypothesis that is linear in the landmarks distinguishes them.

use super::super::sight::filled;
use super::options::LandmarkMoveOptions;
use crate::kernels::triangulate;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::{Point2, Vector2};

/// Maps that differ from a minimum in the place of one landmark, the most promising first.
///
/// `variance` is that of the residuals over sigma.
pub fn moved_landmarks(
    problem: &Problem,
    map: &Map,
    variance: f64,
    options: &LandmarkMoveOptions,
) -> Vec<Map> {
    let LandmarkMoveOptions { off, away, .. } = *options;
    let worth = if filled(problem) < options.partial {
        options.partial_worth
    } else {
        options.worth
    };
    let slack = worth * variance;
    let mut found: Vec<(f64, usize, Point2<f64>)> = Vec::new();
    for (landmark, point) in map.landmarks.iter().enumerate() {
        let Some(point) = point else { continue };
        let cost = |place: &Point2<f64>, but: Option<usize>, bound: f64| {
            let mut sum = 0.0;
            for (pose, s) in map.rays(problem, landmark) {
                if but != Some(s.view) {
                    let residual = problem.residual(&pose, place, s) * s.weight;
                    sum += residual * residual * 0.5;
                    if sum > bound {
                        return None;
                    }
                }
            }
            Some(sum)
        };
        let infinite = 1.0 / 0.0;
        let Some(now) = cost(point, None, infinite) else {
            continue;
        };
        let mut add = |place: Point2<f64>, but: Option<usize>, begin: Point2<f64>| {
            if let Some(there) = cost(&place, but, now + slack)
                && (begin - point).norm() > off
            {
                found.push((there - now, landmark, begin));
            }
        };
        let mut direction = Vector2::zeros();
        for (pose, s) in map.rays(problem, landmark) {
            let ray = pose.rotation.into_inner() * s.bearing.into_inner();
            let ray = Vector2::new(ray.re, ray.im);
            let view = Point2::from(pose.translation.vector);
            direction += ray;
            add(view, Some(s.view), view + ray * off);
        }
        let far = Point2::from(direction * (away / direction.norm()));
        add(Point2::from(far.coords * away), None, far);
        let rays = map.rays(problem, landmark);
        if let Ok(found) = triangulate(rays.map(|(pose, s)| (pose, s.bearing))) {
            add(found.point, None, found.point);
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
        .into_iter()
        .map(|(_, landmark, place)| {
            let mut map = map.clone();
            map.landmarks[landmark] = Some(place);
            map
        })
        .collect()
}
