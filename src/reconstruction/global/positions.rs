// SPDX-License-Identifier: MIT OR Apache-2.0
//! All positions and landmarks from known headings: one homogeneous linear system.

use super::options::PositionOptions;
use crate::geometry::Pose;
use crate::problem::{MIN_VIEWS_OF_LANDMARK, Map, Problem};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{DMatrix, DVector, Matrix2, Point2, Translation2, UnitComplex, Vector2};

/// A sighting as a line: the direction of its ray in the map frame, and the weight of its row.
struct DirectedRay {
    view: usize,
    along: Vector2<f64>,
    weight: f64,
    /// Weight without the range.
    sharpness: f64,
}

impl DirectedRay {
    /// The unit normal of the ray, times the weight.
    fn row(&self) -> Vector2<f64> {
        Vector2::new(-self.along.y, self.along.x) * self.weight
    }
}

/// The rays of one landmark.
struct RayBundle {
    landmark: usize,
    rays: Vec<DirectedRay>,
    point: Vector2<f64>,
}

impl RayBundle {
    /// Inverse of the landmark's normal matrix; `None` when the rays are nearly parallel.
    fn inverse(&self, options: &PositionOptions) -> Option<Matrix2<f64>> {
        let mut information = Matrix2::zeros();
        for ray in &self.rays {
            information += ray.row() * ray.row().transpose();
        }
        let trace = information.trace();
        (information.determinant() > trace * trace * options.spread)
            .then(|| information.try_inverse())
            .flatten()
    }
}

/// The map of the views that have a heading; `None` when the rays determine nothing.
///
/// With `n` the unit normal of a ray, the row `n . (x_j - p_i) = 0` divided by the range is the sine of
/// the angular error, (T30). Landmarks are eliminated in closed form. The positions are the eigenvector of
/// the reduced system with the smallest eigenvalue, other than the two translations. Inverse iteration
/// finds it, starting in the direction that moves all landmarks ahead of the views that see them.
pub fn solve(
    problem: &Problem,
    headings: &[Option<UnitComplex<f64>>],
    options: &PositionOptions,
) -> Option<Map> {
    let mut slot = vec![usize::MAX; headings.len()];
    let mut views = Vec::new();
    for (view, heading) in headings.iter().enumerate() {
        if heading.is_some() {
            slot[view] = views.len();
            views.push(view);
        }
    }
    let mut bundles: Vec<RayBundle> = (0..problem.landmarks())
        .map(|landmark| {
            let rays = problem.of_landmark(landmark).iter().filter_map(|&k| {
                let s = &problem.sightings()[k];
                let ray = (headings[s.view]? * s.bearing).into_inner();
                Some(DirectedRay {
                    view: slot[s.view],
                    along: Vector2::new(ray.re, ray.im),
                    weight: s.weight,
                    sharpness: s.weight,
                })
            });
            RayBundle {
                landmark,
                rays: rays.collect(),
                point: Vector2::zeros(),
            }
        })
        .filter(|bundle| bundle.rays.len() >= MIN_VIEWS_OF_LANDMARK)
        .collect();
    let mut positions: Option<DVector<f64>> = None;
    for _ in 0..options.rounds {
        positions = Some(round(views.len(), &mut bundles, positions, options)?);
        reweight(&mut bundles, positions.as_ref()?, options);
    }
    let positions = positions?;
    let mut map = Map::empty(problem.views(), problem.landmarks());
    for (slot, &view) in views.iter().enumerate() {
        let position = Translation2::new(positions[2 * slot], positions[2 * slot + 1]);
        map.poses[view] = headings[view].map(|heading| Pose::from_parts(position, heading));
    }
    for bundle in &bundles {
        map.landmarks[bundle.landmark] = Some(Point2::from(bundle.point));
    }
    map.prune(problem);
    map.poses.iter().any(Option::is_some).then_some(map)
}

/// Solves the system with the current weights and sets the landmarks.
fn round(
    views: usize,
    bundles: &mut Vec<RayBundle>,
    start: Option<DVector<f64>>,
    options: &PositionOptions,
) -> Option<DVector<f64>> {
    let mut matrix = DMatrix::zeros(2 * views, 2 * views);
    let mut ahead = DVector::zeros(2 * views);
    bundles.retain(|bundle| bundle.inverse(options).is_some());
    for bundle in bundles.iter() {
        let inverse = bundle.inverse(options)?;
        let pull = bundle
            .rays
            .iter()
            .fold(Vector2::zeros(), |sum, ray| sum + ray.along * ray.weight);
        for a in &bundle.rays {
            let row = a.row();
            let through = inverse * row;
            add(
                &mut ahead,
                a.view,
                row * through.dot(&pull) - a.along * a.weight,
            );
            for b in &bundle.rays {
                let other = b.row();
                let mut factor = -through.dot(&other);
                if core::ptr::eq(a, b) {
                    factor += 1.0;
                }
                for i in 0..2 {
                    for j in 0..2 {
                        matrix[(2 * a.view + i, 2 * b.view + j)] += row[i] * other[j] * factor;
                    }
                }
            }
        }
    }
    // Gauge: the translations get the stiffness of an average view, and the whole diagonal a little more
    // than rounding.
    let mean = matrix.diagonal().sum() / (2.0 * views as f64);
    let stiffness = mean / (views as f64);
    for a in 0..views {
        for b in 0..views {
            matrix[(2 * a, 2 * b)] += stiffness;
            matrix[(2 * a + 1, 2 * b + 1)] += stiffness;
        }
        for i in 2 * a..2 * a + 2 {
            matrix[(i, i)] += mean * f64::EPSILON * 100.0;
        }
    }
    let factor = matrix.cholesky()?;
    let mut positions = start.unwrap_or_else(|| ahead.clone());
    for _ in 0..options.steps {
        factor.solve_mut(&mut positions);
        let norm = positions.norm();
        if !(norm > 0.0 && norm.is_finite()) {
            return None;
        }
        positions /= norm;
    }
    if positions.dot(&ahead) < 0.0 {
        positions.neg_mut();
    }
    for bundle in bundles {
        let inverse = bundle.inverse(options)?;
        let mut sum = Vector2::zeros();
        for ray in &bundle.rays {
            let row = ray.row();
            sum += row * row.dot(&at(&positions, ray.view));
        }
        bundle.point = inverse * sum;
    }
    Some(positions)
}

/// Divides the rows by the current ranges.
fn reweight(bundles: &mut [RayBundle], positions: &DVector<f64>, options: &PositionOptions) {
    let range =
        |bundle: &RayBundle, ray: &DirectedRay| (bundle.point - at(positions, ray.view)).norm();
    let mut ranges: Vec<f64> = bundles
        .iter()
        .flat_map(|bundle| bundle.rays.iter().map(move |ray| range(bundle, ray)))
        .collect();
    ranges.sort_by(|a, b| a.total_cmp(b));
    let Some(&median) = ranges.get(ranges.len() / 2) else {
        return;
    };
    for bundle in bundles {
        for k in 0..bundle.rays.len() {
            let range = range(bundle, &bundle.rays[k]).max(median * options.nearest);
            // In units of the median, so that the system keeps its size.
            bundle.rays[k].weight = bundle.rays[k].sharpness * median / range;
        }
    }
}

fn at(positions: &DVector<f64>, view: usize) -> Vector2<f64> {
    Vector2::new(positions[2 * view], positions[2 * view + 1])
}

fn add(vector: &mut DVector<f64>, view: usize, value: Vector2<f64>) {
    vector[2 * view] += value.x;
    vector[2 * view + 1] += value.y;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{bearing_to, pose};

    fn exact() -> (
        crate::simulate::Scene,
        Problem,
        Vec<Option<UnitComplex<f64>>>,
    ) {
        let arena = crate::simulate::Arena::default();
        let layout = crate::simulate::Layout::Enclosed;
        let scene = crate::simulate::simulate(layout, 6, 9, 0.0, 2, arena).unwrap();
        let problem = Problem::dense(6, 9, &scene.bearings, 0.01).unwrap();
        let headings = scene.poses.iter().map(|pose| Some(pose.rotation)).collect();
        (scene, problem, headings)
    }

    /// Exact headings and bearings give the exact map, not its mirror image through a point.
    #[test]
    fn exact_headings_give_the_exact_map() {
        let (scene, problem, mut headings) = exact();
        // With more steps of the iteration than a first map needs.
        let options = PositionOptions {
            steps: 30,
            ..PositionOptions::default()
        };
        let truth = scene.map().normalized();
        let found = solve(&problem, &headings, &options).unwrap();
        let close = |found: &Map, truth: &Map| {
            let pairs = found.poses.iter().zip(&truth.poses);
            for (pose, truth) in pairs.filter_map(|(a, b)| Some(((*a)?, (*b)?))) {
                assert!((pose.translation.vector - truth.translation.vector).norm() < 1e-6);
            }
            let pairs = found.landmarks.iter().zip(&truth.landmarks);
            for (point, truth) in pairs.filter_map(|(a, b)| Some(((*a)?, (*b)?))) {
                assert!((point - truth).norm() < 1e-6);
            }
        };
        assert!(found.is_complete());
        close(&found.normalized(), &truth);
        headings[4] = None;
        let found = solve(&problem, &headings, &options).unwrap();
        assert_eq!(found.poses[4], None);
        assert!(found.landmarks.iter().all(Option::is_some));
        let mut part = scene.map();
        part.poses[4] = None;
        close(&found.normalized(), &part.normalized());
        headings[1..].fill(None);
        assert!(solve(&problem, &headings, &options).is_none());
    }

    /// After a round each ray weighs as much as its landmark is near, in units of the median, but the nearest not more than
    /// a bound.
    #[test]
    fn rays_are_weighed_by_their_range() {
        let options = PositionOptions::default();
        let ray = |view: usize| DirectedRay {
            view,
            along: Vector2::x(),
            weight: 1.0,
            sharpness: 2.0,
        };
        let mut bundles = Vec::from([RayBundle {
            landmark: 0,
            rays: (0..5).map(ray).collect(),
            point: Vector2::zeros(),
        }]);
        let nearest = options.nearest * 0.1;
        let positions =
            DVector::from_vec(vec![1.0, 0.0, 0.0, 2.0, 4.0, 0.0, 0.0, -nearest, 0.0, -8.0]);
        reweight(&mut bundles, &positions, &options);
        let weights: Vec<f64> = bundles[0].rays.iter().map(|ray| ray.weight).collect();
        for (found, expected) in weights
            .iter()
            .zip([4.0, 2.0, 1.0, 2.0 / options.nearest, 0.5])
        {
            assert!((found / expected - 1.0).abs() < 1e-12, "{weights:?}");
        }
    }

    /// Landmarks come to be ahead of the views that see them, also of views that drive towards all of them.
    #[test]
    fn a_drive_towards_the_landmarks_is_not_turned_around() {
        let mut truth = Map::empty(4, 5);
        truth.poses = (0..4)
            .map(|k| Some(pose(0.1 * f64::from(k * k), f64::from(k), 0.5)))
            .collect();
        let points = [(-6.0, 8.0), (-3.0, 9.0), (2.0, 7.0), (5.0, 9.5), (7.0, 8.5)];
        truth.landmarks = points.map(|(x, y)| Some(Point2::new(x, y))).to_vec();
        let bearings = truth.poses.iter().flatten().flat_map(|pose| {
            let points = truth.landmarks.iter().flatten();
            points.map(|point| bearing_to(pose, point).unwrap().angle())
        });
        let bearings: Vec<f64> = bearings.collect();
        let problem = Problem::dense(4, 5, &bearings, 0.01).unwrap();
        let headings = truth.poses.iter().map(|pose| Some(pose.as_ref()?.rotation));
        let headings: Vec<_> = headings.collect();
        let found = solve(&problem, &headings, &PositionOptions::default()).unwrap();
        assert!(found.is_complete());
        for pose in found.poses.iter().flatten() {
            let mut points = found.landmarks.iter().flatten();
            assert!(
                points.all(|point| point.y > pose.translation.y),
                "{found:?}"
            );
        }
    }
}
