// SPDX-License-Identifier: MIT OR Apache-2.0
//! Problems solved next to the origin: coordinates in the thousands of kilometres, as those of surveys, leave few digits
//! for a map of a few metres.

use super::attempt::converged;
use super::choice::SAME_COST;
use super::infinity::drop_landmarks_at_infinity;
use super::options::{Progress, SolveOptions};
use super::result::{ROUNDED, Reconstruction};
use super::robust::consensus::OUTLIER;
use crate::adjustment::cost_of_priors;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::{Loss, Termination};
use crate::problem::{Prior, Problem};
use nalgebra::Vector2;

/// The position that priors know first, each coordinate by itself; 0 where they know none.
pub fn home(problem: &Problem) -> Vector2<f64> {
    let axis = |axis: usize| {
        let known = problem.priors().iter().filter_map(|prior| match prior {
            Prior::Motion { .. } => None,
            Prior::Pose { pose, root, .. } => {
                (root[axis][axis] > 0.0).then_some(pose.translation.vector[axis])
            }
            Prior::Landmark { position, root, .. } => {
                (root[axis][axis] > 0.0).then_some(position[axis])
            }
        });
        known.into_iter().next().unwrap_or(0.0)
    };
    Vector2::new(axis(0), axis(1))
}

/// What was found of a problem shifted home, in the frame of the problem. Where the rounding of its coordinates raises the
/// cost, as where a view is nearly on a landmark, the map is refined there once more.
///
/// # Errors
/// Those that stop everything, as [`converged`].
pub fn brought_back(
    problem: &Problem,
    found: Reconstruction,
    home: Vector2<f64>,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let loss = if options.robust {
        Loss::Truncated(OUTLIER)
    } else {
        options.refine.loss
    };
    let (least, termination) = (found.cost, found.termination);
    let mut found = shifted(problem, found, home, loss, options.robust);
    if options.robust || found.cost * SAME_COST <= least {
        return Ok(found);
    }
    found.termination = Termination::NoProgress;
    let mut found = converged(problem, found, options, progress)?;
    if found.termination == Termination::NoProgress {
        found.termination = termination;
    }
    drop_landmarks_at_infinity(problem, &mut found, &options.stages.infinity);
    Ok(found)
}

/// A map with its alternatives and components shifted into the frame of the problem, its residuals and cost those of the
/// coordinates that are reported.
fn shifted(
    problem: &Problem,
    mut found: Reconstruction,
    home: Vector2<f64>,
    loss: Loss,
    robust: bool,
) -> Reconstruction {
    let before = cost_of_priors(&problem.shifted(-home), &found.map);
    for pose in found.map.poses.iter_mut().flatten() {
        pose.translation.vector += home;
    }
    for point in found.map.landmarks.iter_mut().flatten() {
        point.coords += home;
    }
    let mut cost = found.cost + cost_of_priors(problem, &found.map) - before;
    let (mut squares, mut count) = (0.0, 0.0_f64);
    let pairs = problem.sightings().iter().zip(problem.input_order());
    for ((s, &place), residual) in pairs.zip(found.map.residuals(problem)) {
        let Some(old) = found.residuals[place] else {
            continue;
        };
        // Those of landmarks at infinity stay.
        let new = residual.unwrap_or(old);
        if let (Loss::Truncated(width), true) = (loss, new != old) {
            found.inliers[place] = new.abs() * s.weight <= width;
        }
        let loss_of = |r: f64| loss.evaluate((r * s.weight) * (r * s.weight)).0;
        cost += 0.5 * (loss_of(new) - loss_of(old));
        if !robust || found.inliers[place] {
            squares += new * new;
            count += 1.0;
        }
        found.residuals[place] = Some(new);
    }
    if (cost - found.cost).abs() > ROUNDED * found.cost {
        found.cost = cost;
    }
    found.rms = (squares / count.max(1.0)).sqrt();
    for others in [&mut found.alternatives, &mut found.components] {
        let old = core::mem::take(others).into_iter();
        *others = old
            .map(|one| shifted(problem, one, home, loss, robust))
            .collect();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::lm::RefineOptions;
    use crate::simulate::{Arena, Layout, simulate};

    /// A shift moves the map, and changes neither its residuals nor what is told of them.
    #[test]
    fn a_shift_keeps_what_is_told_of_the_residuals() {
        let scene = simulate(Layout::Enclosed, 5, 9, 0.01, 2, Arena::default()).unwrap();
        let problem = Problem::dense(5, 9, &scene.bearings, 0.01).unwrap();
        let mut map = scene.map();
        let report = refine_map(&problem, &mut map, &RefineOptions::default(), None).unwrap();
        let before = Reconstruction::new(&problem, &map, report);
        for home in [Vector2::zeros(), Vector2::new(50.0, -20.0)] {
            let after = shifted(&problem, before.clone(), home, Loss::Squared, false);
            let poses = after.map.poses.iter().zip(&before.map.poses);
            for (after, before) in poses.filter_map(|(a, b)| Some(((*a)?, (*b)?))) {
                let moved = after.translation.vector - before.translation.vector;
                assert!((moved - home).norm() < 1e-12);
            }
            assert!((after.rms / before.rms - 1.0).abs() < 1e-9);
            assert!((after.cost / before.cost - 1.0).abs() < 1e-9);
            let residuals = after.residuals.iter().zip(&before.residuals);
            for (after, before) in residuals {
                assert!((after.unwrap() - before.unwrap()).abs() < 1e-12);
            }
        }
    }
}
