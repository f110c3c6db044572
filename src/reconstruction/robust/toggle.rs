// SPDX-License-Identifier: MIT OR Apache-2.0
//! Single sightings of a view or of a landmark that change from inlier to outlier or back, everything else held fixed.
//!
//! The changes that `exchange` predicts for the whole map need its dense normal equations. Here each takes only those of
//! one pose or one position, so that large maps can be tried in full; what gains is refined as a whole afterwards.

use super::super::options::{Progress, SolveOptions, report_progress};
use super::consensus::{Consensus, OUTLIER, fixed_point, inliers, square};
use crate::error::Error;
use crate::geometry::Pose;
use crate::problem::{IndexedSighting, Problem};
use alloc::vec::Vec;
use nalgebra::{Matrix2, Matrix3, Point2, Vector2, Vector3};

/// Changes sightings view by view and landmark by landmark, as long as that lowers the cost of the refined map.
///
/// # Errors
/// Those of the refinement; [`Error::Interrupted`] when `progress` says so.
pub fn toggle(
    problem: &Problem,
    mut best: Consensus,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Consensus, Error> {
    let robust = &options.stages.robust;
    let rounds = robust.exchange_successes;
    for round in 0..rounds {
        if !report_progress(progress, "improve", round, rounds) {
            return Err(Error::Interrupted);
        }
        let mut map = best.map.clone();
        let mut changed = false;
        for view in 0..problem.views() {
            let Some(pose) = map.poses[view] else {
                continue;
            };
            let seen: Vec<_> = map.seen(problem, view).collect();
            let squares = |at: &Pose<f64>| -> Vec<f64> {
                seen.iter()
                    .map(|(point, s)| square(problem, s, at, point))
                    .collect()
            };
            let estimate = |kept: &[bool]| {
                let kept = seen.iter().zip(kept).filter(|(_, kept)| **kept);
                pose_of(
                    problem,
                    &pose,
                    kept.map(|(seen, _)| *seen),
                    robust.motion_steps,
                )
            };
            if let Some(better) = best_toggled(&pose, squares, estimate, robust.toggled) {
                map.poses[view] = Some(better);
                changed = true;
            }
        }
        for landmark in 0..problem.landmarks() {
            let Some(point) = map.landmarks[landmark] else {
                continue;
            };
            let rays: Vec<_> = map.rays(problem, landmark).collect();
            let squares = |at: &Point2<f64>| -> Vec<f64> {
                rays.iter()
                    .map(|(pose, s)| square(problem, s, pose, at))
                    .collect()
            };
            let estimate = |kept: &[bool]| {
                let kept = rays.iter().zip(kept).filter(|(_, kept)| **kept);
                point_of(
                    problem,
                    &point,
                    kept.map(|(ray, _)| *ray),
                    robust.motion_steps,
                )
            };
            if let Some(better) = best_toggled(&point, squares, estimate, robust.toggled) {
                map.landmarks[landmark] = Some(better);
                changed = true;
            }
        }
        if !changed {
            break;
        }
        let kept = inliers(problem, &map, OUTLIER);
        match fixed_point(problem, map, kept, options)? {
            Some(found) if found.is_below(&best) => best = found,
            _ => break,
        }
    }
    Ok(best)
}

/// The best place after a change of one sighting, if it is better than the present one: sightings up to `bound`
/// standard deviations are changed.
fn best_toggled<P>(
    present: &P,
    squares: impl Fn(&P) -> Vec<f64>,
    estimate: impl Fn(&[bool]) -> Option<P>,
    bound: f64,
) -> Option<P> {
    let most = OUTLIER * OUTLIER;
    let cost = |squares: &[f64]| {
        squares
            .iter()
            .fold(0.0, |sum, square| sum + square.min(most))
    };
    let now = squares(present);
    let mut kept: Vec<bool> = now.iter().map(|square| *square <= most).collect();
    // Less is rounding.
    let mut least = cost(&now) * (1.0 - 1e-9) - 1e-9;
    let mut best = None;
    for k in 0..kept.len() {
        if now[k] > bound * bound {
            continue;
        }
        kept[k] = !kept[k];
        if let Some(place) = estimate(&kept) {
            let then = cost(&squares(&place));
            if then < least {
                least = then;
                best = Some(place);
            }
        }
        kept[k] = !kept[k];
    }
    best
}

/// The pose that some sightings of known landmarks determine, near a start, by Gauss-Newton; `None` when they do not.
fn pose_of<'a>(
    problem: &Problem,
    start: &Pose<f64>,
    seen: impl Iterator<Item = (Point2<f64>, &'a IndexedSighting)> + Clone,
    steps: usize,
) -> Option<Pose<f64>> {
    let mut pose = *start;
    for _ in 0..steps {
        let (mut gradient, mut normal) = (Vector3::zeros(), Matrix3::zeros());
        for (point, s) in seen.clone() {
            let local = pose.inverse_transform_point(&point);
            let range = local.coords.norm_squared();
            let row = Vector3::new(local.y / range, -local.x / range, -1.0) * s.weight;
            gradient += row * (problem.residual(&pose, &point, s) * s.weight);
            normal += row * row.transpose();
        }
        let step = normal.cholesky()?.solve(&gradient);
        pose *= Pose::new(Vector2::new(-step.x, -step.y), -step.z);
        if step.norm() < 1e-6 {
            break;
        }
    }
    Some(pose)
}

/// The position that some rays determine, near a start, by Gauss-Newton; `None` when they do not.
fn point_of<'a>(
    problem: &Problem,
    start: &Point2<f64>,
    rays: impl Iterator<Item = (Pose<f64>, &'a IndexedSighting)> + Clone,
    steps: usize,
) -> Option<Point2<f64>> {
    let mut point = *start;
    for _ in 0..steps {
        let (mut gradient, mut normal) = (Vector2::zeros(), Matrix2::zeros());
        for (pose, s) in rays.clone() {
            let offset = point.coords - pose.translation.vector;
            let row = Vector2::new(-offset.y, offset.x) * (s.weight / offset.norm_squared());
            gradient += row * (problem.residual(&pose, &point, s) * s.weight);
            normal += row * row.transpose();
        }
        let step = normal.cholesky()?.solve(&gradient);
        point -= step;
        if step.norm() < 1e-6 {
            break;
        }
    }
    Some(point)
}
