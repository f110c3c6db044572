// SPDX-License-Identifier: MIT OR Apache-2.0
//! The verdict on a fit: whether it is too poor for the stated standard deviations, and what is at fault.

use super::alarm::{Alarm, TestOptions, is_poor};
use super::data_snooping::{blunders, is_suspicious, is_testable};
use super::distributions::lower_tail;
use super::global_test::GlobalTest;
use super::left_out::left_out;
use super::wrong_sensor::{turned_a_little, turned_or_mirrored};
use crate::error::Error;
use crate::lm::{Loss, Termination};
use crate::problem::Problem;
use crate::reconstruction::{Progress, Reconstruction};
use alloc::vec::Vec;

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
/// what the others leave, then the next without it. A map with one degree of freedom cannot name one. So are views and
/// landmarks that the map leaves out because their bearings contradict it, or the one bearing that does. With outliers
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
    // The tests are those of a minimum, and of squares.
    let is_tested = problem.states_sigma()
        && found.termination != Termination::NotRefined
        && matches!(found.loss, Loss::Squared | Loss::Truncated(_));
    if !is_tested {
        return Ok(FitTest { global, alarms });
    }
    if found.freedom == 0 {
        // There is nothing to test but what is left out.
    } else if is_poor(global.square, global.freedom, options) {
        alarms.push(Alarm::PoorFit);
    } else if global.p_value < options.significance {
        alarms.push(Alarm::UnderstatedSigma);
    } else if lower_tail(global.square, global.freedom as f64) < options.significance {
        alarms.push(Alarm::OverstatedSigma);
    }
    if found.loss == Loss::Squared {
        let left = left_out(problem, found, options);
        let (named, fits) = if is_suspicious(problem, found, &global, options) {
            blunders(problem, found, options, &mut progress)?
        } else {
            (Vec::new(), true)
        };
        // A sensor that is off shows in many observations, of which some would be named.
        let is_significant = global.p_value < options.significance && (named.len() != 1 || !fits);
        let is_several = matches!(&left[..], [Alarm::LeftOut { subjects }] if subjects.len() > 1);
        let mut sensor = None;
        if !problem.priors().is_empty() && is_testable(problem, found, options) {
            if is_significant {
                sensor = turned_a_little(problem, found, options, &mut progress)?;
            }
            let is_poor = alarms == [Alarm::PoorFit] && is_significant;
            if sensor.is_none() && (is_poor || is_several) {
                sensor = turned_or_mirrored(problem, found, options, &mut progress)?;
            }
        }
        match sensor {
            Some(sensor) => alarms.push(sensor),
            None => alarms.extend(named.into_iter().chain(left)),
        }
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

#[cfg(test)]
mod tests {
    use super::super::alarm::Observation;
    use super::*;
    use crate::problem::{Noise, PosePrior, Subject, Undetermined, Why};
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

    /// A view of which one bearing is far off is left out of the map: the bearing is named; where all of them are off, the
    /// view is. So with landmarks.
    #[test]
    fn what_is_left_out_is_named() {
        let scene = simulate(Layout::Mixed, 10, 8, SIGMA, 5, Arena::default()).unwrap();
        let alarms = |subject: Subject, wrong: &[usize]| {
            let mut bearings = scene.bearings.clone();
            for (k, &place) in wrong.iter().enumerate() {
                bearings[place] += 1.5 + 0.7 * k as f64;
            }
            let right = Problem::dense(10, 8, &scene.bearings, SIGMA).unwrap();
            let problem = Problem::dense(10, 8, &bearings, SIGMA).unwrap();
            let mut found = solve(&right, &SolveOptions::default(), None).unwrap();
            match subject {
                Subject::View(view) => found.map.poses[view] = None,
                Subject::Landmark(landmark) => found.map.landmarks[landmark] = None,
            }
            let why = Why::Misfit;
            found.undetermined = Vec::from([Undetermined { subject, why }]);
            left_out(&problem, &found, &TestOptions::default())
        };
        let (view, landmark) = (Subject::View(2), Subject::Landmark(3));
        for subject in [view, landmark] {
            let alarms = alarms(subject, &[19]);
            let [
                Alarm::Blunder {
                    observation,
                    standardized,
                },
            ] = alarms[..]
            else {
                panic!("{alarms:?}");
            };
            assert_eq!(observation, Observation::Sighting(19));
            assert!(standardized > 20.0, "{standardized}");
        }
        for (subject, wrong) in [
            (view, &[16, 18, 19, 22][..]),
            (landmark, &[3, 19, 35, 59, 75]),
        ] {
            let subjects = Vec::from([subject]);
            assert_eq!(alarms(subject, wrong), [Alarm::LeftOut { subjects }]);
        }
        assert_eq!(alarms(view, &[]), []);
        assert_eq!(alarms(landmark, &[]), []);
    }

    /// A sensor that is turned, a little or a lot, is found out by odometry, as is one that counts clockwise; of two
    /// robots the one whose sensor it is. The rest of the fit is then good.
    #[test]
    fn wrong_sensors_are_found_out() {
        let scene = simulate(Layout::Mixed, 10, 12, SIGMA, 5, Arena::default()).unwrap();
        let odometry = scene.odometry([0.02, 0.02, 0.01], 1).unwrap();
        let alarms = |change: &dyn Fn(usize, f64) -> f64, motions: &[usize]| {
            let changed: Vec<f64> = scene
                .bearings
                .iter()
                .enumerate()
                .map(|(k, b)| change(k / 12, *b))
                .collect();
            let problem = Problem::dense(10, 12, &changed, SIGMA).unwrap();
            let given: Vec<_> = motions.iter().map(|&k| odometry[k]).collect();
            let problem = problem.with_odometry(&given).unwrap();
            tested(&problem).alarms
        };
        let all: Vec<usize> = (0..9).collect();
        assert_eq!(alarms(&|_, b| b, &all), []);
        for turn in [0.1, -0.3, 1.7, 3.1] {
            let found = alarms(&|_, b| b + turn, &all);
            let Some(Alarm::TurnedBearings { views, angle }) = found.last() else {
                panic!("{turn}: {found:?}");
            };
            assert_eq!(views.len(), 10);
            assert!((angle - turn).abs() < 0.03, "{turn}: {angle}");
        }
        let mirrored = alarms(&|_, b| -b, &all);
        assert_eq!(mirrored.last(), Some(&Alarm::MirroredBearings));
        // Two robots: views 0 to 4, and 5 to 9.
        let apart: Vec<usize> = (0..9).filter(|k| *k != 4).collect();
        let found = alarms(&|view, b| if view > 4 { b + 0.2 } else { b }, &apart);
        let [Alarm::PoorFit, Alarm::TurnedBearings { views, angle }] = &found[..] else {
            panic!("{found:?}");
        };
        assert_eq!(views[..], [5, 6, 7, 8, 9]);
        assert!((angle - 0.2).abs() < 0.03, "{angle}");
    }
}
