// SPDX-License-Identifier: MIT OR Apache-2.0
//! Single sightings of a view or of a landmark that change from inlier to outlier or back, everything else held fixed.
//!
//! The changes that `exchange` predicts for the whole map need its dense normal equations. Here each takes only those of
//! one pose or one position, so that large maps can be tried in full; what gains is refined as a whole afterwards.

use super::super::options::{Progress, SolveOptions, report_progress};
use super::consensus::{Consensus, OUTLIER, fixed_point, inliers, square};
use super::motions::descend_view;
use crate::error::Error;
use crate::geometry::Pose;
use crate::lm::Loss;
use crate::problem::{IndexedSighting, Problem};
use alloc::vec::Vec;
use nalgebra::{Matrix2, Point2, Vector2};

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
            let square_at = |at: &Pose<f64>, (point, s): &(Point2<f64>, &IndexedSighting)| {
                square(problem, s, at, point)
            };
            let estimate = |kept: &[_]| {
                let (loss, steps) = (Loss::Squared, robust.motion_steps);
                descend_view(problem, kept, &[], loss, pose, steps)
            };
            if let Some(better) = toggled(&pose, &seen, square_at, estimate, robust.toggled) {
                map.poses[view] = Some(better);
                changed = true;
            }
        }
        for landmark in 0..problem.landmarks() {
            let Some(point) = map.landmarks[landmark] else {
                continue;
            };
            let rays: Vec<_> = map.rays(problem, landmark).collect();
            let square_at = |at: &Point2<f64>, (pose, s): &(Pose<f64>, &IndexedSighting)| {
                square(problem, s, pose, at)
            };
            let estimate = |kept: &[_]| descend_landmark(problem, kept, point, robust.motion_steps);
            if let Some(better) = toggled(&point, &rays, square_at, estimate, robust.toggled) {
                map.landmarks[landmark] = Some(better);
                changed = true;
            }
        }
        if !changed {
            break;
        }
        let kept = inliers(problem, &map, OUTLIER);
        match fixed_point(problem, map, kept, best.limit(robust), options)? {
            Some(found) if found.is_below(&best) => best = found,
            _ => break,
        }
    }
    Ok(best)
}

/// The best place after a change of one of its sightings, if it is better than the present one: sightings up to `bound`
/// standard deviations are changed.
fn toggled<P, S: Copy>(
    present: &P,
    sightings: &[S],
    square_at: impl Fn(&P, &S) -> f64,
    estimate: impl Fn(&[S]) -> P,
    bound: f64,
) -> Option<P> {
    let most = OUTLIER * OUTLIER;
    let cost = |place: &P| -> f64 {
        let squares = sightings.iter().map(|s| square_at(place, s).min(most));
        squares.sum()
    };
    let now: Vec<f64> = sightings.iter().map(|s| square_at(present, s)).collect();
    // Less is rounding.
    let mut least = cost(present) * (1.0 - 1e-9) - 1e-9;
    let mut best = None;
    let mut kept = Vec::with_capacity(sightings.len());
    for changed in (0..now.len()).filter(|&k| now[k] <= bound * bound) {
        kept.clear();
        let is_kept = |k: usize| (now[k] <= most) != (k == changed);
        kept.extend((0..now.len()).filter(|&k| is_kept(k)).map(|k| sightings[k]));
        let place = estimate(&kept);
        let then = cost(&place);
        if then < least {
            least = then;
            best = Some(place);
        }
    }
    best
}

/// The minimum next to a position of the squares of its bearings, by at most so many steps of Gauss-Newton.
fn descend_landmark(
    problem: &Problem,
    rays: &[(Pose<f64>, &IndexedSighting)],
    start: Point2<f64>,
    steps: usize,
) -> Point2<f64> {
    let mut point = start;
    for _ in 0..steps {
        let (mut gradient, mut normal) = (Vector2::zeros(), Matrix2::zeros());
        for (pose, s) in rays {
            let offset = point.coords - pose.translation.vector;
            let row = Vector2::new(-offset.y, offset.x) * (s.weight / offset.norm_squared());
            gradient += row * (problem.residual(pose, &point, s) * s.weight);
            normal += row * row.transpose();
        }
        let Some(factor) = normal.cholesky() else {
            break;
        };
        let step = factor.solve(&gradient);
        point -= step;
        if step.norm() < 1e-6 {
            break;
        }
    }
    point
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a line, places cost their squared distances from marks, three of which at most count.
    #[test]
    fn a_sighting_is_changed_where_that_lowers_the_cost() {
        let mean = |kept: &[f64]| kept.iter().sum::<f64>() / kept.len().max(1) as f64;
        let square = |at: &f64, mark: &f64| (at - mark) * (at - mark);
        // Drawn towards an outlier that is just within the bound, the mean of the others is better without it.
        let marks = [0.0, 0.1, -0.1, 0.0, 3.4];
        let found = toggled(&0.7, &marks, square, mean, 9.0).unwrap();
        assert!(found.abs() < 1e-12, "{found}");
        // One that was left out comes back in.
        let marks = [0.0, 0.1, -0.1, 3.1];
        let found = toggled(&0.0, &marks, square, mean, 9.0).unwrap();
        assert!((found - 0.775).abs() < 1e-12, "{found}");
        assert_eq!(toggled(&0.0, &marks, square, mean, 3.0), None);
        // At the best place nothing is.
        assert_eq!(toggled(&0.0, &[0.0, 0.1, -0.1], square, mean, 9.0), None);
    }

    #[test]
    fn a_landmark_descends_to_its_rays() {
        let truth = Point2::new(1.0, 3.0);
        let poses = [(0.0, 0.0, 0.3), (2.0, 0.5, 1.0), (-1.0, 1.0, 2.0)];
        let poses = poses.map(|(x, y, theta)| crate::geometry::pose(x, y, theta));
        let bearings: Vec<f64> = poses
            .iter()
            .map(|pose| crate::geometry::bearing_to(pose, &truth).unwrap().angle())
            .collect();
        let problem = Problem::dense(3, 1, &bearings, 0.01).unwrap();
        let rays: Vec<_> = poses.into_iter().zip(problem.sightings()).collect();
        let found = descend_landmark(&problem, &rays, Point2::new(1.2, 2.7), 10);
        assert!((found - truth).norm() < 1e-9, "{found}");
        // A single ray leaves a direction free.
        let start = Point2::new(1.2, 2.7);
        assert_eq!(descend_landmark(&problem, &rays[..0], start, 10), start);
        assert_eq!(descend_landmark(&problem, &rays, start, 0), start);
    }
}
