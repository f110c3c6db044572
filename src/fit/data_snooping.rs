// SPDX-License-Identifier: MIT OR Apache-2.0
//! The verdict on a fit: whether it is too poor for the stated standard deviations, and which observations are at
//! fault, one after the other.

use super::distributions::{lower_tail, normal_exceeded, upper_tail};
use super::global_test::GlobalTest;
use super::redundancy::{Redundancy, redundancy};
use crate::adjustment::refine_map;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::{Loss, Observer, RefineOptions, Termination};
use crate::problem::{Map, Prior, Problem};
use crate::reconstruction::{IdentityOptions, Progress, Reconstruction, report_progress};
use alloc::vec::Vec;

/// Thresholds of the tests.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct TestOptions {
    /// Probability of a right fit below which it is noted that sigma is understated, or overstated.
    pub significance: f64,
    /// Nobody knows sigma better than to this factor: within it a fit is no reason for a warning.
    pub tolerated_factor: f64,
    /// Probability of a fit with errors that are so many times what is stated, below which there is a warning.
    pub tolerated_significance: f64,
    /// Probability of naming an observation of a right fit.
    pub blunder_significance: f64,
    /// Most observations that are named, one after the other.
    pub most_blunders: usize,
    /// Single observations are tested where the probability of the fit is below this, ...
    pub suspicious: f64,
    /// ... or a residual is above so many standard deviations: the tests take as long as a covariance.
    pub suspicious_deviations: f64,
    /// Degrees of freedom for each outlier below which the inliers of a robust map may agree by chance, unless it explains
    /// enough once identities are assigned anew. Of 12 x 15 wrong maps have at most 0.45, maps with 40 % random bearings
    /// 0.6 or more (`benches/identities.rs`).
    pub weak_spare: f64,
    /// The share of the bearings that is enough, as `believed` of [`IdentityOptions`].
    pub believed: f64,
    /// Most numbers, observations times unknowns, with which they are tested nevertheless: a second of work.
    pub most_numbers: usize,
}

impl Default for TestOptions {
    fn default() -> Self {
        Self {
            significance: 1e-3,
            tolerated_factor: 1.5,
            tolerated_significance: 0.02,
            blunder_significance: 5e-4,
            most_blunders: 10,
            suspicious: 0.05,
            suspicious_deviations: 3.0,
            weak_spare: 0.55,
            believed: IdentityOptions::default().believed,
            most_numbers: 20_000_000,
        }
    }
}

/// An observation, by its place in the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Observation {
    /// A sighting.
    Sighting(usize),
    /// A motion.
    Odometry(usize),
    /// A prior on a pose.
    PosePrior(usize),
    /// A prior on a landmark.
    LandmarkPrior(usize),
}

/// What is wrong with a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alarm {
    /// A robust map leaves so many outliers that its inliers may agree by chance, and exchanged identities do not explain
    /// them.
    WeakConsensus {
        /// Number of outliers.
        outliers: usize,
        /// Share of the bearings that the map explains once their identities are assigned anew.
        explained: f64,
    },
    /// The residuals are larger than errors of one and a half times the stated standard deviations would be.
    PoorFit,
    /// An observation contradicts the others, as long as those that are named before it are left out.
    Blunder {
        /// Which one.
        observation: Observation,
        /// Its standardized residual.
        standardized: f64,
    },
    /// The residuals are larger than the stated standard deviations predict, but not by much.
    UnderstatedSigma,
    /// The residuals are smaller than the stated standard deviations predict.
    OverstatedSigma,
}

/// The test of a fit and what it says.
#[derive(Clone, Debug, PartialEq)]
pub struct FitTest {
    /// The test of all observations together.
    pub global: GlobalTest,
    /// What is wrong; empty where nothing is, no standard deviations are stated, or the map has not been refined.
    pub alarms: Vec<Alarm>,
}

/// Tests whether a reconstruction fits its problem as the stated standard deviations predict.
///
/// Observations are named where one contradicts all others: the one with the largest standardized residual, in units of
/// what the others leave, then the next without it. A map with one degree of freedom cannot name one. With outliers
/// (`robust`, truncated losses) the inliers are tested together.
///
/// # Errors
/// [`Error::OutOfMemory`] when the normal equations do not fit into memory, [`Error::Interrupted`] when `progress` says
/// so.
///
/// # Example
/// ```
/// use bearslam::{Alarm, Arena, Layout, Observation, Problem, SolveOptions, simulate, solve, test_fit};
/// let scene = simulate(Layout::Mixed, 6, 12, 0.01, 7, Arena::default())?;
/// let mut bearings = scene.bearings.clone();
/// bearings[30] += 0.5;
/// let problem = Problem::dense(6, 12, &bearings, 0.01)?;
/// let found = solve(&problem, &SolveOptions::default(), None)?;
/// let test = test_fit(&problem, &found, &Default::default(), None)?;
/// assert!(test.alarms.iter().any(|alarm| matches!(
///     alarm,
///     Alarm::Blunder { observation: Observation::Sighting(30), .. }
/// )));
/// # Ok::<(), bearslam::Error>(())
/// ```
///
/// # Reference
/// W. Baarda, "A testing procedure for use in geodetic networks", 1968.
pub fn test_fit(
    problem: &Problem,
    found: &Reconstruction,
    options: &TestOptions,
    progress: Option<Progress<'_>>,
) -> Result<FitTest, Error> {
    let mut progress = progress;
    let global = GlobalTest::of(problem, found);
    let mut alarms = Vec::from_iter(weak_consensus(found, options));
    // The tests are those of a minimum.
    if global.p_value.is_nan() || found.termination == Termination::NotRefined {
        return Ok(FitTest { global, alarms });
    }
    let freedom = global.freedom as f64;
    let tolerated = global.square / (options.tolerated_factor * options.tolerated_factor);
    if global.p_value < options.significance {
        let is_poor = upper_tail(tolerated, freedom) < options.tolerated_significance;
        alarms.push(if is_poor {
            Alarm::PoorFit
        } else {
            Alarm::UnderstatedSigma
        });
    } else if lower_tail(global.square, freedom) < options.significance {
        alarms.push(Alarm::OverstatedSigma);
    }
    if found.loss == Loss::Squared && is_suspicious(problem, found, &global, options) {
        alarms.extend(blunders(problem, found, options, &mut progress)?);
    }
    Ok(FitTest { global, alarms })
}

/// Whether the inliers of a robust map may agree by chance.
fn weak_consensus(found: &Reconstruction, options: &TestOptions) -> Option<Alarm> {
    let all = found.inliers.len() as f64;
    let explained = found.explained? as f64 / all;
    let outliers = found.inliers.iter().filter(|inlier| !**inlier).count();
    let is_weak = (found.freedom as f64) < options.weak_spare * outliers as f64;
    (is_weak && explained < options.believed).then_some(Alarm::WeakConsensus {
        outliers,
        explained,
    })
}

/// Whether single observations are worth the time of their tests.
fn is_suspicious(
    problem: &Problem,
    found: &Reconstruction,
    global: &GlobalTest,
    options: &TestOptions,
) -> bool {
    let views = found.map.poses.iter().flatten().count();
    let landmarks = found.map.landmarks.iter().flatten().count();
    let observations = problem.sightings().len() + problem.priors().len();
    let numbers = observations.saturating_mul(3 * views + 2 * landmarks);
    let mut sightings = problem.sightings().iter().zip(problem.input_order());
    let bound = options.suspicious_deviations;
    numbers <= options.most_numbers
        && (global.p_value < options.suspicious
            || sightings.any(|(s, &place)| {
                found.residuals[place].is_some_and(|r| (r * s.weight).abs() > bound)
            }))
}

/// The observations that contradict the others, one after the other.
fn blunders(
    problem: &Problem,
    found: &Reconstruction,
    options: &TestOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Alarm>, Error> {
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
    Ok(named)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Noise, PosePrior};
    use crate::reconstruction::{SolveOptions, solve};
    use crate::simulate::{Arena, Layout, Outliers, simulate};

    const SIGMA: f64 = 0.01;

    fn tested(problem: &Problem) -> FitTest {
        let found = solve(problem, &SolveOptions::default(), None).unwrap();
        test_fit(problem, &found, &TestOptions::default(), None).unwrap()
    }

    fn bearings() -> Vec<f64> {
        let scene = simulate(Layout::Mixed, 7, 14, SIGMA, 5, Arena::default()).unwrap();
        scene.bearings
    }

    /// A right sigma is no reason for an alarm; one that is a little off, for a note; one that is far off, for a warning.
    /// Sigma that is not stated is never one.
    #[test]
    fn alarms_are_graded_by_how_far_sigma_is_off() {
        let bearings = bearings();
        let alarms = |sigma: f64| tested(&Problem::dense(7, 14, &bearings, sigma).unwrap()).alarms;
        assert_eq!(alarms(SIGMA), []);
        assert_eq!(alarms(SIGMA / 1.4), [Alarm::UnderstatedSigma]);
        assert_eq!(alarms(SIGMA / 3.0)[0], Alarm::PoorFit);
        assert_eq!(alarms(SIGMA * 3.0), [Alarm::OverstatedSigma]);
        let test = tested(&Problem::dense(7, 14, &bearings, 1.0).unwrap());
        assert_eq!(test.alarms, []);
        assert!(test.global.p_value.is_nan() && test.global.sigma0 > 0.0);
    }

    /// Wrong bearings are named one after the other, the worst first.
    #[test]
    fn blunders_are_named_in_order() {
        let mut bearings = bearings();
        bearings[20] += 0.6;
        bearings[61] -= 0.3;
        let problem = Problem::dense(7, 14, &bearings, SIGMA).unwrap();
        let named: Vec<Observation> = tested(&problem)
            .alarms
            .iter()
            .filter_map(|alarm| match alarm {
                Alarm::Blunder { observation, .. } => Some(*observation),
                _ => None,
            })
            .collect();
        assert_eq!(named, [20, 61].map(Observation::Sighting));
    }

    /// So are a wrong motion and a wrong prior, each by its place among its kind.
    #[test]
    fn wrong_motions_and_priors_are_named() {
        let scene = simulate(Layout::Mixed, 7, 14, SIGMA, 5, Arena::default()).unwrap();
        let problem = Problem::dense(7, 14, &scene.bearings, SIGMA).unwrap();
        let odometry = scene.odometry([0.02, 0.02, 0.01], 1).unwrap();
        let mut wrong = odometry.clone();
        wrong[3].delta.translation.vector.x += 0.8;
        // Beyond all tails.
        let mut gross = odometry.clone();
        gross[3].delta.translation.vector.x += 4.0;
        let priors: Vec<PosePrior> = (0..7)
            .map(|view| PosePrior {
                view,
                pose: scene.poses[view],
                noise: Noise::Sigmas([0.05, 0.05, f64::INFINITY]),
            })
            .collect();
        let mut off = priors.clone();
        off[2].pose.translation.vector.y += 1.5;
        let with = |odometry: &[_], priors: &[_]| {
            let problem = problem.clone().with_odometry(odometry).unwrap();
            tested(&problem.with_pose_priors(priors).unwrap()).alarms
        };
        assert_eq!(with(&odometry, &priors), []);
        let names = |alarms: Vec<Alarm>, expected: Observation| {
            let mut blunders = alarms.iter().filter_map(|alarm| match alarm {
                Alarm::Blunder {
                    observation,
                    standardized,
                } => Some((*observation, *standardized)),
                _ => None,
            });
            let (observation, standardized) = blunders.next().unwrap();
            assert_eq!((observation, blunders.next()), (expected, None));
            assert!(standardized > 6.0, "{standardized}");
        };
        names(with(&wrong, &priors), Observation::Odometry(3));
        names(with(&gross, &priors), Observation::Odometry(3));
        names(with(&odometry, &off), Observation::PosePrior(2));
    }

    /// Whoever waits is asked, and may stop the test.
    #[test]
    fn a_test_can_be_stopped() {
        let mut bearings = bearings();
        bearings[20] += 0.6;
        let problem = Problem::dense(7, 14, &bearings, SIGMA).unwrap();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        let mut asked = 0;
        let mut go_on = |_: &'static str, _: usize, _: usize| {
            asked += 1;
            true
        };
        let options = TestOptions::default();
        assert!(test_fit(&problem, &found, &options, Some(&mut go_on)).is_ok());
        assert!(asked > 3, "{asked}");
        let mut stop = |_: &'static str, _: usize, _: usize| false;
        let stopped = test_fit(&problem, &found, &options, Some(&mut stop));
        assert_eq!(stopped, Err(Error::Interrupted));
    }

    /// Without the time, and with one degree of freedom, nothing is named.
    #[test]
    fn nothing_is_named_without_redundancy_or_time() {
        let mut bearings = bearings();
        bearings[20] += 0.6;
        let problem = Problem::dense(7, 14, &bearings, SIGMA).unwrap();
        let mut found = solve(&problem, &SolveOptions::default(), None).unwrap();
        assert_eq!(found.termination, Termination::Converged);
        let hasty = TestOptions {
            most_numbers: 98 * 49 - 1,
            ..TestOptions::default()
        };
        assert_eq!(
            test_fit(&problem, &found, &hasty, None).unwrap().alarms,
            [Alarm::PoorFit]
        );
        found.freedom = 1;
        let test = test_fit(&problem, &found, &TestOptions::default(), None).unwrap();
        assert_eq!(test.alarms, [Alarm::PoorFit]);
    }

    /// The inliers of a robust map fit as if no tail were cut off, and outliers are no blunders.
    #[test]
    fn robust_maps_are_tested_by_their_inliers() {
        let scene = simulate(Layout::Mixed, 10, 15, SIGMA, 5, Arena::default()).unwrap();
        let (scene, _) = scene.contaminate(Outliers::Mixture, 0.2, 1);
        let problem = Problem::dense(10, 15, &scene.bearings, SIGMA).unwrap();
        let options = SolveOptions {
            robust: true,
            ..SolveOptions::default()
        };
        let found = solve(&problem, &options, None).unwrap();
        let test = test_fit(&problem, &found, &TestOptions::default(), None).unwrap();
        assert_eq!(test.alarms, []);
        assert!(test.global.p_value > 1e-3 && test.global.square < 2.0 * found.cost);
    }
}
