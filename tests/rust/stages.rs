// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the stages: any value is allowed, and what a caller sets is used.

use crate::leaves::{leaves, with};
use bearslam::{
    Arena, Error, Layout, Outliers, Problem, SolveOptions, StageOptions, Strategy, simulate, solve,
};
use serde_json::{Value, from_value, json, to_value};

/// Problems that between them reach all stages, with the options that lead there.
fn problems() -> Vec<(Problem, SolveOptions)> {
    let noise = 0.01;
    let arena = |sight| Arena {
        sight,
        ..Arena::default()
    };
    let scene = |layout, views, landmarks, sight| {
        simulate(layout, views, landmarks, noise, 3, arena(sight)).unwrap()
    };
    let dense = |views, landmarks| {
        let scene = scene(Layout::Mixed, views, landmarks, f64::INFINITY);
        Problem::dense(views, landmarks, &scene.bearings, noise).unwrap()
    };
    let trajectory = scene(Layout::Trajectory, 45, 30, 2.5);
    let limited = Problem::dense(45, 30, &trajectory.bearings, noise).unwrap();
    let motions = trajectory.odometry([0.05, 0.05, 0.02], 3).unwrap();
    let tied = limited.clone().with_odometry(&motions).unwrap();
    let (wrong, _) =
        scene(Layout::Mixed, 6, 12, f64::INFINITY).contaminate(Outliers::Mixture, 0.2, 3);
    let wrong = Problem::dense(6, 12, &wrong.bearings, noise).unwrap();
    let (wrong_tied, _) = trajectory.contaminate(Outliers::Mixture, 0.1, 3);
    let wrong_tied = Problem::dense(45, 30, &wrong_tied.bearings, noise).unwrap();
    let wrong_tied = wrong_tied.with_odometry(&motions).unwrap();
    let plain = SolveOptions::default();
    let global = SolveOptions {
        strategy: Strategy::Global,
        ..plain
    };
    let robust = SolveOptions {
        robust: true,
        ..plain
    };
    let verify = SolveOptions {
        verify: true,
        ..plain
    };
    vec![
        (dense(5, 7), plain),
        (dense(5, 4), plain),
        (limited.clone(), plain),
        (limited, global),
        (tied, plain),
        (wrong, robust),
        (wrong_tied, robust),
        (dense(5, 9), verify),
    ]
}

fn stages(value: Value) -> StageOptions {
    from_value(value).unwrap()
}

#[test]
fn no_option_at_zero_makes_a_solve_panic() {
    let default = to_value(StageOptions::default()).unwrap();
    let paths = leaves(&default);
    assert!(paths.len() > 80, "{} options", paths.len());
    let problems = problems();
    let (mut solved, mut failed) = (0, 0);
    for path in &paths {
        let zero = |number: &Value| {
            json!(if number.is_f64() {
                json!(0.0)
            } else {
                json!(0)
            })
        };
        let stages = stages(with(&default, path, zero));
        for (problem, options) in &problems {
            match solve(problem, &SolveOptions { stages, ..*options }, None) {
                Ok(found) => {
                    solved += 1;
                    assert!(found.cost.is_finite(), "{path}");
                }
                Err(Error::Interrupted | Error::OutOfMemory) => panic!("{path}"),
                Err(_) => failed += 1,
            }
        }
    }
    // Most options only say how far to look.
    assert!(solved > 4 * failed, "{solved} solved, {failed} not");
}

#[test]
fn stages_use_the_options_of_the_caller() {
    // For each problem an option without which it is not solved as it is with the defaults.
    let telling = [
        (0, "/minima/first_iterations"),
        (1, "/hypotheses/max_sweeps"),
        (2, "/incremental/seeds"),
        (3, "/positions/rounds"),
        (4, "/odometry_growth/iterations"),
        (5, "/robust/samples"),
        (6, "/robust/sets"),
        (7, "/verify/cells"),
    ];
    let default = to_value(StageOptions::default()).unwrap();
    let problems = problems();
    for (place, path) in telling {
        let (problem, options) = &problems[place];
        let stages = stages(with(&default, path, |_| json!(0)));
        let usual = solve(problem, options, None).unwrap();
        let found = solve(problem, &SolveOptions { stages, ..*options }, None);
        assert!(
            found.is_err() || found.is_ok_and(|found| found != usual),
            "{path}"
        );
    }
}

/// Defaults that follow from what their descriptions say.
#[test]
fn derived_defaults_have_their_values() {
    let stages = StageOptions::default();
    // Another round of sweeps is worth the cost of an outlier, which is that of `Reconstruction::cost`.
    assert_eq!(stages.odometry_sweeps.worth, 4.5);
    // Twice and three times the residuals.
    assert_eq!(stages.incremental.fitting_ratio, 2.0_f64.powi(2));
    assert_eq!(stages.judge.rival_ratio, 3.0_f64.powi(2));
}
