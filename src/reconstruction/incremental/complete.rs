// SPDX-License-Identifier: MIT OR Apache-2.0
//! The end of a growth: a place for everything that has one.

use super::super::expand::resect_view;
use super::gates::{Fit, noise};
use super::growth::GATES;
use crate::estimation::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK, Map, Problem};
use crate::kernels::triangulate;
use crate::scalar::Real;
use nalgebra::{Point2, Vector2};

/// Where the rays of a landmark meet, if they do ahead of all views that have a pose.
pub fn meeting<T: Real>(
    problem: &Problem<T>,
    map: &Map<T>,
    landmark: usize,
) -> Option<Point2<T>> {
    let rays = problem.of_landmark(landmark).iter().filter_map(|&k| {
        let s = &problem.sightings()[k];
        map.poses[s.view].map(|pose| (pose, s.bearing))
    });
    rays.clone().nth(MIN_VIEWS_OF_LANDMARK - 1)?;
    triangulate(rays)
        .ok()
        .filter(|found| found.behind == 0)
        .map(|found| found.point)
}

/// Puts in everything that the gates have kept out and that has a place at all, for the last refinement.
///
/// A landmark whose rays do not meet goes far out along them: the refinement tells whether it is at
/// infinity.
pub fn complete<T: Real>(problem: &Problem<T>, map: &mut Map<T>, allowed: &[bool]) {
    let size = size(map);
    for _ in 0..2 {
        for landmark in 0..map.landmarks.len() {
            if map.landmarks[landmark].is_none() {
                map.landmarks[landmark] = meeting(problem, map, landmark)
                    .or_else(|| far_out(problem, map, landmark, size));
            }
        }
        for view in 0..map.poses.len() {
            if map.poses[view].is_none()
                && allowed[view]
                && let Some((pose, _)) = resect_view(problem, map, view)
            {
                let fit = Fit::of_view(problem, map, view, &pose);
                let noise = noise(problem, map);
                if fit.passes(MIN_LANDMARKS_OF_VIEW, noise, GATES[GATES.len() - 1]) {
                    map.poses[view] = Some(pose);
                }
            }
        }
    }
}

/// So many times the size of the map is far out.
const FAR: f64 = 30.0;

/// A place far out along the mean ray of a landmark that two views see.
fn far_out<T: Real>(
    problem: &Problem<T>,
    map: &Map<T>,
    landmark: usize,
    size: T,
) -> Option<Point2<T>> {
    let mut count = 0;
    let mut sum = Vector2::zeros();
    let mut from = Vector2::zeros();
    for &k in problem.of_landmark(landmark) {
        let s = &problem.sightings()[k];
        if let Some(pose) = map.poses[s.view] {
            let ray = pose.rotation.into_inner() * s.bearing.into_inner();
            sum += Vector2::new(ray.re, ray.im);
            from += pose.translation.vector;
            count += 1;
        }
    }
    if count < MIN_VIEWS_OF_LANDMARK || !(sum.norm() > T::eps()) {
        return None;
    }
    let middle = from / T::lit(count as f64);
    Some(Point2::from(middle + sum.normalize() * (size * T::lit(FAR))))
}

/// The root mean square distance of the views from the first.
fn size<T: Real>(map: &Map<T>) -> T {
    let mut views = map.poses.iter().flatten().map(|pose| pose.translation.vector);
    let Some(first) = views.next() else {
        return T::one();
    };
    let (sum, count) = views.fold((T::zero(), T::one()), |(sum, count), view| {
        (sum + (view - first).norm_squared(), count + T::one())
    });
    (sum / count).sqrt()
}
