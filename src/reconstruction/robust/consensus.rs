// SPDX-License-Identifier: MIT OR Apache-2.0
//! The truncated cost of a robust map, and the descent from a rough map to a fixed point.
//!
//! The truncated cost is half the sum of squared residuals over sigma, each at most that of an outlier. Alternating
//! refinement and selection of the inliers never raises it. It ends at a fixed point: the inliers of the refined map
//! are those that it was refined from.

use super::super::attempt::attempt;
use super::super::choice::same;
use super::super::judge::JudgeOptions;
use super::super::options::SolveOptions;
use super::super::result::Reconstruction;
use super::options::RobustOptions;
use crate::adjustment::gauge::in_reported_frame;
use crate::adjustment::{Report, cost_of_priors};
use crate::error::Error;
use crate::geometry::Pose;
use crate::lm::{Loss, RefineOptions, Termination};
use crate::problem::{IndexedSighting, Map, Problem};
use alloc::vec::Vec;
use nalgebra::Point2;

/// Number of standard deviations beyond which a bearing is an outlier. Not an option: it defines the cost.
pub const OUTLIER: f64 = Loss::<f64>::TRUNCATED;

/// A cost is lower than another only when it is below this fraction of it, a wider margin than the tolerance of the
/// refinement. Not an option: closer costs are equal up to rounding.
const LOWER: f64 = 1.0 - 1e-9;

/// The options with squares for the loss: outliers are told apart by this stage, and what is left counts in full.
pub fn with_squares(options: &SolveOptions) -> SolveOptions {
    SolveOptions {
        refine: RefineOptions {
            loss: Loss::Squared,
            ..options.refine
        },
        ..*options
    }
}

/// The options with Cauchy's loss, which outliers hardly move, for the refinements on the way.
pub fn with_cauchy(options: &SolveOptions) -> SolveOptions {
    SolveOptions {
        refine: RefineOptions {
            loss: Loss::Cauchy(Loss::<f64>::CAUCHY),
            ..options.refine
        },
        ..*options
    }
}

/// A map at a fixed point: the refinement of its inliers.
#[derive(Clone)]
pub struct Consensus {
    pub map: Map,
    pub inliers: Vec<bool>,
    /// Half the sum of squares, those of outliers truncated.
    pub cost: f64,
    pub report: Report,
}

/// The square of residual over sigma of one sighting: the one measure of how well a bearing agrees with a pose and
/// a landmark.
#[inline]
pub fn square(
    problem: &Problem,
    seen: &IndexedSighting,
    pose: &Pose<f64>,
    point: &Point2<f64>,
) -> f64 {
    let residual = problem.residual(pose, point, seen) * seen.weight;
    residual * residual
}

/// The same, or infinity for a sighting that is beyond `bound` standard deviations: mostly without an arctangent.
#[inline]
pub fn square_within(
    problem: &Problem,
    seen: &IndexedSighting,
    pose: &Pose<f64>,
    point: &Point2<f64>,
    bound: f64,
) -> f64 {
    let turned = Problem::along_and_across(pose, point, seen);
    let across = turned.y * seen.weight;
    // No angle is smaller than its sine.
    if across * across > (bound * bound) * turned.norm_squared() * BEYOND_ROUNDING {
        return f64::INFINITY;
    }
    square(problem, seen, pose, point)
}

/// A factor far beyond rounding, and far below any difference of squares that matters.
const BEYOND_ROUNDING: f64 = 1.0 + 1e-12;

/// The same for each sighting of a problem, in their order; `None` where an end is undetermined.
pub fn squares<'a>(problem: &'a Problem, map: &'a Map) -> impl Iterator<Item = Option<f64>> + 'a {
    problem
        .sightings()
        .iter()
        .map(|s| match (&map.poses[s.view], &map.landmarks[s.landmark]) {
            (Some(pose), Some(point)) => Some(square(problem, s, pose, point)),
            _ => None,
        })
}

/// Half the sum of the squares, each at most that of `bound`, which also counts for a sighting whose view or
/// landmark is not in the map. Odometry and priors count in full.
pub fn cost(problem: &Problem, map: &Map, bound: f64) -> f64 {
    let most = bound * bound;
    let bearings = squares(problem, map).fold(0.0, |sum, square| {
        sum + square.map_or(most, |square| square.min(most))
    });
    bearings * 0.5 + cost_of_priors(problem, map)
}

/// The sightings that a map explains to within `bound` standard deviations.
pub fn inliers(problem: &Problem, map: &Map, bound: f64) -> Vec<bool> {
    let most = bound * bound;
    squares(problem, map)
        .map(|square| square.is_some_and(|square| square <= most))
        .collect()
}

/// Refines a map from its inliers within `bound`. Views and landmarks that are left without enough
/// sightings are dropped.
///
/// A map that cannot be refined stays as it is.
///
/// # Errors
/// [`Error::Interrupted`] and [`Error::OutOfMemory`] of the refinement.
pub fn descend(
    problem: &Problem,
    map: &mut Map,
    bound: f64,
    iterations: usize,
    options: &SolveOptions,
) -> Result<(), Error> {
    let kept = problem.subset(&inliers(problem, map, bound));
    refined(&kept, map, iterations, options).map(|_| ())
}

/// Refines a map; `None` when it cannot be.
fn refined(
    problem: &Problem,
    map: &mut Map,
    iterations: usize,
    options: &SolveOptions,
) -> Result<Option<Report>, Error> {
    let options = RefineOptions {
        max_iterations: options.refine.max_iterations.min(iterations),
        ..options.refine
    };
    attempt(problem, map, &options, None)
}

/// The fixed point that a set of inliers leads to.
///
/// Only of a set that stays the same, and costs no more than `limit` by then, is the map refined to the end: slow maps
/// would take all their iterations for every set on the way, and for each that is never the best. Under a limit they
/// take no more iterations than many comparisons can afford.
///
/// `None` when they do not determine a map.
///
/// # Errors
/// As [`descend`].
pub fn fixed_point(
    problem: &Problem,
    mut map: Map,
    mut kept: Vec<bool>,
    limit: f64,
    options: &SolveOptions,
) -> Result<Option<Consensus>, Error> {
    let robust = &options.stages.robust;
    let most = if limit < f64::INFINITY {
        robust.compared_iterations(3 * problem.views() + 2 * problem.landmarks())
    } else {
        robust.finished_iterations
    };
    let mut changes = 0;
    let mut iterations = robust.changing_iterations;
    while changes < robust.inlier_changes {
        let subset = problem.subset(&kept);
        let Some(report) = refined(&subset, &mut map, iterations, options)? else {
            return Ok(None);
        };
        let next = inliers(problem, &map, OUTLIER);
        if next != kept {
            kept = next;
            changes += 1;
            iterations = robust.changing_iterations;
            continue;
        }
        let cost = cost(problem, &map, OUTLIER);
        if report.termination == Termination::MaxIterations && iterations < most && cost <= limit {
            iterations = most;
        } else {
            return Ok(Some(Consensus {
                cost,
                map,
                inliers: kept,
                report,
            }));
        }
    }
    Ok(None)
}

/// The fixed point near a rough map, refined as that of [`fixed_point`].
///
/// # Errors
/// As [`descend`].
pub fn to_consensus(
    problem: &Problem,
    mut map: Map,
    limit: f64,
    options: &SolveOptions,
) -> Result<Option<Consensus>, Error> {
    let robust = &options.stages.robust;
    for bound in robust.narrowing_bounds {
        let iterations = robust.narrowing_iterations;
        descend(problem, &mut map, bound, iterations, options)?;
    }
    let kept = inliers(problem, &map, OUTLIER);
    fixed_point(problem, map, kept, limit, options)
}

/// The fixed point that a start leads to by way of the minimum with Cauchy's loss, which outliers hardly move.
///
/// # Errors
/// Those of the refinement.
pub fn cauchy_consensus(
    problem: &Problem,
    mut map: Map,
    limit: f64,
    options: &SolveOptions,
) -> Result<Option<Consensus>, Error> {
    let soft = RefineOptions {
        tolerance: options.stages.robust.cauchy_tolerance,
        ..with_cauchy(options).refine
    };
    // If the whole cannot be refined, its inliers may still be.
    attempt(problem, &mut map, &soft, None)?;
    to_consensus(problem, map, limit, options)
}

/// The options with which sets of inliers are compared: their maps need not be refined to the end, which takes most of
/// the time, and few of them are kept.
pub fn without_finish(options: &SolveOptions) -> SolveOptions {
    let mut rough = *options;
    rough.stages.robust.finished_iterations = options.stages.robust.changing_iterations;
    rough
}

impl Consensus {
    /// A fixed point with these inliers and this cost, of no map.
    #[cfg(test)]
    pub fn with_inliers(inliers: &[bool], cost: f64) -> Self {
        Self {
            map: Map::empty(1, 1),
            inliers: inliers.to_vec(),
            cost,
            report: Report {
                cost,
                termination: Termination::Converged,
                iterations: 0,
                undetermined: Vec::new(),
                loss: Loss::Squared,
            },
        }
    }

    /// The same refined further, in at most so many iterations, where a comparison has ended its refinement.
    ///
    /// # Errors
    /// As [`descend`].
    pub fn finished(
        self,
        problem: &Problem,
        iterations: usize,
        options: &SolveOptions,
    ) -> Result<Self, Error> {
        if self.report.termination != Termination::MaxIterations {
            return Ok(self);
        }
        let (map, kept) = (self.map.clone(), self.inliers.clone());
        let mut options = *options;
        options.stages.robust.finished_iterations = iterations;
        let finished = fixed_point(problem, map, kept, f64::INFINITY, &options)?;
        Ok(finished.unwrap_or(self))
    }

    /// The cost up to which a rough map may be below this one when it is refined to the end.
    pub fn limit(&self, options: &RobustOptions) -> f64 {
        self.cost + options.finished_outliers * OUTLIER * OUTLIER / 2.0
    }

    /// From the result of a non-robust solve.
    pub fn of(problem: &Problem, found: Reconstruction) -> Self {
        Self {
            inliers: inliers(problem, &found.map, OUTLIER),
            cost: cost(problem, &found.map, OUTLIER),
            report: Report {
                cost: found.cost,
                termination: found.termination,
                iterations: found.iterations,
                undetermined: found.undetermined,
                loss: Loss::Squared,
            },
            map: found.map,
        }
    }

    /// Whether two fixed points have nearly the same inliers: at least this percentage of the inliers of
    /// either are inliers of both.
    pub fn agrees(&self, other: &Self, percent: usize) -> bool {
        let (mut both, mut either) = (0, 0);
        for (&a, &b) in self.inliers.iter().zip(&other.inliers) {
            both += usize::from(a && b);
            either += usize::from(a || b);
        }
        100 * both >= percent.saturating_mul(either)
    }

    /// Whether it costs less than another by more than the tolerance of the refinement.
    pub fn is_below(&self, other: &Self) -> bool {
        self.cost < other.cost * LOWER
    }

    /// Whether two fixed points are one.
    pub fn is_same(&self, other: &Self, problem: &Problem, judge: &JudgeOptions) -> bool {
        let [a, b] = [self, other].map(|one| in_reported_frame(problem, &one.map));
        self.inliers == other.inliers && same(&a, &b, judge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::simulate::{Arena, Layout, simulate};
    use alloc::vec;

    /// A map that is slow, because its damping starts high, is refined to the end only where that may be of use.
    #[test]
    fn only_what_may_be_the_best_is_refined_to_the_end() {
        let scene = simulate(Layout::Mixed, 6, 9, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(6, 9, &scene.bearings, 0.01).unwrap();
        let mut options = SolveOptions::default();
        options.refine.damping = 1e6;
        let mut start = scene.map();
        for pose in start.poses.iter_mut().flatten() {
            pose.translation.vector *= 1.0 + 1e-3;
        }
        let all = vec![true; 54];
        let ended = |limit| {
            let (map, kept) = (start.clone(), all.clone());
            let found = fixed_point(&problem, map, kept, limit, &options).unwrap();
            let found = found.unwrap();
            (found.report.termination, found.cost)
        };
        let (rough, cost) = ended(0.0);
        assert_eq!(rough, Termination::MaxIterations);
        assert_eq!(ended(cost * 0.999), (rough, cost));
        let (finished, least) = ended(cost * 1.001);
        assert!(
            finished == Termination::Converged && least < cost,
            "{least} {cost}"
        );
        assert_eq!(ended(f64::INFINITY), (finished, least));
        // With more unknowns than can be afforded no map is finished for a comparison.
        options.stages.robust.finished_unknowns = 10;
        let ended = |limit| {
            let (map, kept) = (start.clone(), all.clone());
            let found = fixed_point(&problem, map, kept, limit, &options).unwrap();
            found.unwrap()
        };
        let compared = ended(1e9);
        assert_eq!((compared.report.termination, compared.cost), (rough, cost));
        let last = compared.finished(&problem, 100, &options).unwrap();
        assert_eq!((last.report.termination, last.inliers), (finished, all));
        assert!((last.cost / least - 1.0).abs() < 1e-9);
    }

    /// From every direction, with rays and with lines.
    #[test]
    fn squares_within_a_bound_are_squares() {
        let rays = Problem::dense(1, 1, &[0.7], 0.1).unwrap();
        let lines = rays.clone().unoriented();
        let view = pose(0.4, -0.2, 1.1);
        for problem in [rays, lines] {
            let seen = &problem.sightings()[0];
            let (mut told, mut left) = (0, 0);
            for k in 0..720 {
                let turned = f64::from(k).to_radians() * 0.5;
                let point = Point2::new(0.4 + 3.0 * turned.cos(), -0.2 + 3.0 * turned.sin());
                let square = square(&problem, seen, &view, &point);
                let found = square_within(&problem, seen, &view, &point, OUTLIER);
                if square <= OUTLIER * OUTLIER {
                    assert_eq!(found, square);
                    left += 1;
                } else {
                    assert!(found > OUTLIER * OUTLIER);
                    told += usize::from(found == f64::INFINITY);
                }
            }
            assert!(told > 400 && left > 60, "{told} {left}");
        }
    }

    /// A map of one view and four landmarks ahead, off their bearings by these standard deviations.
    fn off(deviations: [f64; 4]) -> (Problem, Map) {
        let map = Map {
            poses: Vec::from([Some(pose(0.0, 0.0, 0.0))]),
            landmarks: [0.1, 0.4, 0.9, 1.5]
                .map(|angle: f64| Some(Point2::new(3.0 * angle.cos(), 3.0 * angle.sin())))
                .to_vec(),
        };
        let bearings: [f64; 4] =
            core::array::from_fn(|k| [0.1, 0.4, 0.9, 1.5][k] + 0.01 * deviations[k]);
        (Problem::dense(1, 4, &bearings, 0.01).unwrap(), map)
    }

    /// Outliers, and what the map does not have, cost as much as the bound.
    #[test]
    fn the_cost_is_truncated() {
        let (problem, mut map) = off([1.0, -2.9, 3.1, -40.0]);
        let most = 0.5 * OUTLIER * OUTLIER;
        let expected = 0.5 * (1.0 + 2.9 * 2.9) + 2.0 * most;
        assert!((cost(&problem, &map, OUTLIER) / expected - 1.0).abs() < 1e-9);
        assert_eq!(inliers(&problem, &map, OUTLIER), [true, true, false, false]);
        assert_eq!(inliers(&problem, &map, 3.2), [true, true, true, false]);
        let known = crate::problem::LandmarkPrior {
            landmark: 3,
            position: map.landmarks[3].unwrap() + nalgebra::Vector2::new(0.0, 0.2),
            noise: crate::problem::Noise::Sigmas([0.1, 0.1]),
        };
        let tied = problem.clone().with_landmark_priors(&[known]).unwrap();
        assert!((cost(&tied, &map, OUTLIER) / (expected + 2.0) - 1.0).abs() < 1e-9);
        map.landmarks[0] = None;
        let expected = 0.5 * 2.9 * 2.9 + 3.0 * most;
        assert!((cost(&problem, &map, OUTLIER) / expected - 1.0).abs() < 1e-9);
        assert_eq!(
            inliers(&problem, &map, OUTLIER),
            [false, true, false, false]
        );
    }

    #[test]
    fn fixed_points_agree_by_their_shared_inliers() {
        let report = Report {
            cost: 1.0,
            termination: Termination::Converged,
            iterations: 1,
            undetermined: Vec::new(),
            loss: Loss::Squared,
        };
        let with = |outliers: core::ops::Range<usize>, cost: f64| Consensus {
            map: off([0.0; 4]).1,
            inliers: (0..20).map(|k| !outliers.contains(&k)).collect(),
            cost,
            report: report.clone(),
        };
        // Eighteen of twenty are inliers of both.
        let (a, b) = (with(0..1, 1.0), with(1..2, 1.0 - 1e-8));
        assert!(a.agrees(&b, 90) && !a.agrees(&b, 91));
        assert!(b.is_below(&a) && !a.is_below(&b));
        assert!(!with(0..1, 1.0 - 1e-10).is_below(&a));
        let (problem, judge) = (off([0.0; 4]).0, JudgeOptions::default());
        assert!(a.is_same(&with(0..1, 2.0), &problem, &judge));
        assert!(!a.is_same(&b, &problem, &judge));
        let mut moved = a.clone();
        moved.map.poses.fill(None);
        assert!(!a.is_same(&moved, &problem, &judge));
    }
}
