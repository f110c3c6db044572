// SPDX-License-Identifier: MIT OR Apache-2.0
//! Data snooping: which observations contradict the others, one after the other.

use super::alarm::{Alarm, Observation, TestOptions, is_poor};
use super::distributions::normal_exceeded;
use super::global_test::GlobalTest;
use super::redundancy::{Redundancy, redundancy};
use crate::adjustment::refine_map;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::{Observer, RefineOptions};
use crate::problem::{Map, Prior, Problem};
use crate::reconstruction::{Progress, Reconstruction, report_progress};
use alloc::vec::Vec;

/// Whether single observations are worth the time of their tests.
pub fn is_suspicious(
    problem: &Problem,
    found: &Reconstruction,
    global: &GlobalTest,
    options: &TestOptions,
) -> bool {
    let mut sightings = problem.sightings().iter().zip(problem.input_order());
    let bound = options.suspicious_deviations;
    is_testable(problem, found, options)
        && (global.p_value < options.suspicious
            || sightings.any(|(s, &place)| {
                found.residuals[place].is_some_and(|r| (r * s.weight).abs() > bound)
            }))
}

/// Whether they would take no more than the time that is allowed.
pub fn is_testable(problem: &Problem, found: &Reconstruction, options: &TestOptions) -> bool {
    let views = found.map.poses.iter().flatten().count();
    let landmarks = found.map.landmarks.iter().flatten().count();
    let observations = problem.sightings().len() + problem.priors().len();
    let numbers = observations.saturating_mul(3 * views + 2 * landmarks);
    numbers <= options.most_numbers
}

/// The observations that contradict the others, one after the other, and whether what is left fits.
pub fn blunders(
    problem: &Problem,
    found: &Reconstruction,
    options: &TestOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<(Vec<Alarm>, bool), Error> {
    let mut named = Vec::new();
    let mut left = Left {
        problem: problem.clone(),
        inliers: found.inliers.clone(),
        priors: numbered(problem),
        map: found.map.clone(),
        square: 2.0 * found.cost,
        freedom: found.freedom,
    };
    while named.len() < options.most_blunders && left.freedom > 1 {
        let (done, most) = (named.len(), options.most_blunders);
        let mut look = |_, _| report_progress(progress, "test", done, most);
        let checked = redundancy(&left.problem, &left.map, &left.inliers, Some(&mut look));
        let checked = match checked {
            Ok(checked) => checked,
            Err(Error::Degenerate { .. }) => break,
            Err(error) => return Err(error),
        };
        let Some((observation, standardized)) = left.worst(&checked, options) else {
            break;
        };
        named.push(Alarm::Blunder {
            observation,
            standardized,
        });
        if !left.remove(observation, &mut look)? {
            break;
        }
    }
    let fits = !is_poor(left.square, left.freedom, options);
    Ok((named, fits))
}

/// The place of each prior in its kind.
fn numbered(problem: &Problem) -> Vec<Observation> {
    let mut next = [0; 3];
    let mut number = |kind: usize| {
        next[kind] += 1;
        next[kind] - 1
    };
    let priors = problem.priors().iter();
    let numbers = priors.map(|prior| match prior {
        Prior::Motion { .. } => Observation::Odometry(number(0)),
        Prior::Pose { .. } => Observation::PosePrior(number(1)),
        Prior::Landmark { .. } => Observation::LandmarkPrior(number(2)),
    });
    numbers.collect()
}

/// What is left of a problem, and its minimum.
struct Left {
    problem: Problem,
    inliers: Vec<bool>,
    /// Which priors are left.
    priors: Vec<Observation>,
    map: Map,
    square: f64,
    freedom: usize,
}

impl Left {
    /// The observation with the largest standardized residual in units of what the others leave, where that is larger
    /// than chance would have it.
    fn worst(&self, checked: &Redundancy, options: &TestOptions) -> Option<(Observation, f64)> {
        let kinds = [
            &checked.odometry,
            &checked.pose_priors,
            &checked.landmark_priors,
        ];
        let mut kinds = kinds.map(|kind| kind.iter());
        let of_priors = self.priors.iter().filter_map(|&prior| {
            let kind = match prior {
                Observation::Sighting(_) => return None,
                Observation::Odometry(_) => 0,
                Observation::PosePrior(_) => 1,
                Observation::LandmarkPrior(_) => 2,
            };
            Some((prior, (*kinds[kind].next()?)?.standardized))
        });
        let sightings = checked.sightings.iter().enumerate();
        let sightings =
            sightings.filter_map(|(k, one)| Some((Observation::Sighting(k), (*one)?.standardized)));
        let all: Vec<(Observation, f64)> = sightings
            .chain(of_priors)
            .filter(|(_, standardized)| standardized.is_finite())
            .collect();
        let bound = normal_exceeded(options.blunder_significance / all.len().max(1) as f64);
        let in_units = |standardized: f64| {
            let left = (self.square - standardized * standardized).max(0.0);
            let sigma0 = (left / (self.freedom - 1) as f64).sqrt();
            standardized.abs() / sigma0.max(1.0)
        };
        let worst = all
            .into_iter()
            .max_by(|a, b| in_units(a.1).total_cmp(&in_units(b.1)))?;
        (in_units(worst.1) > bound).then_some(worst)
    }

    /// Leaves an observation out and refines the rest; `false` when that cannot be.
    fn remove(&mut self, observation: Observation, look: Observer<'_>) -> Result<bool, Error> {
        match observation {
            Observation::Sighting(k) => self.inliers[k] = false,
            prior => {
                let Some(place) = self.priors.iter().position(|other| *other == prior) else {
                    return Ok(false);
                };
                self.priors.remove(place);
                self.problem = self.problem.without_prior(place);
            }
        }
        let inner = self.problem.of_inliers(&self.inliers)?;
        match refine_map(&inner, &mut self.map, &RefineOptions::default(), Some(look)) {
            Ok(report) if report.undetermined.is_empty() => {
                let rest = Reconstruction::tested(&inner, &self.map, report);
                (self.square, self.freedom) = (2.0 * rest.cost, rest.freedom);
                Ok(true)
            }
            Ok(_) | Err(Error::Degenerate { .. } | Error::TooFew { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }
}
