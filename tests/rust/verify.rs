// SPDX-License-Identifier: MIT OR Apache-2.0
//! Verified maps: `SolveOptions::verify`.

use bearslam::{
    Arena, Certificate, Error, Layout, Loss, Method, Noise, PosePrior, Problem, Reconstruction,
    RefineOptions, Scene, SolveOptions, Strategy, Verdict, refine, simulate, solve,
};

const PLAIN: fn() -> SolveOptions = SolveOptions::default;

fn verify() -> SolveOptions {
    SolveOptions {
        verify: true,
        ..PLAIN()
    }
}

fn scene(views: usize, landmarks: usize, degrees: f64, seed: u64) -> (Scene, Problem) {
    let noise = degrees.to_radians();
    let scene = simulate(
        Layout::Mixed,
        views,
        landmarks,
        noise,
        seed,
        Arena::default(),
    )
    .unwrap();
    let sigma = noise.max(1e-3);
    let problem = Problem::dense(views, landmarks, &scene.bearings, sigma).unwrap();
    (scene, problem)
}

fn certificate(found: &Reconstruction) -> Certificate {
    found.certificate.unwrap()
}

/// Maps of little noise are verified in few cells, and none of them is contradicted by the refinement from the truth.
#[test]
fn maps_are_verified_in_few_cells() {
    // Median and largest number of cells.
    for (views, landmarks, degrees, median, most) in [
        (12, 15, 0.1, 1..=2, 4),
        (12, 15, 0.5, 3..=12, 40),
        (4, 7, 0.1, 1..=1, 4),
        (4, 7, 0.5, 1..=4, 60),
    ] {
        let mut cells = Vec::new();
        for seed in 0..20 {
            let (scene, problem) = scene(views, landmarks, degrees, seed);
            let plain = solve(&problem, &PLAIN(), None).unwrap();
            let found = solve(&problem, &verify(), None).unwrap();
            assert_eq!(plain.certificate, None);
            let shown = certificate(&found);
            assert!(shown.verified(), "{shown}");
            assert!(shown.cone < 0.5 && shown.views.is_some(), "{shown:?}");
            let truth = refine(&problem, &scene.map(), &RefineOptions::default(), None).unwrap();
            assert!(found.cost <= truth.cost * 1.000_01, "{seed}");
            // The map itself is not changed by its verification.
            assert!(found.cost < plain.cost * 0.999 || found.map == plain.map);
            assert!(
                found
                    .alternatives
                    .iter()
                    .all(|other| other.certificate.is_none())
            );
            cells.push(shown.cells);
        }
        cells.sort_unstable();
        assert!(median.contains(&cells[10]), "{cells:?}");
        assert!(cells[19] <= most, "{cells:?}");
    }
}

/// Maps of the first three views in wrong minima, which the search of their cones finds out.
#[test]
fn wrong_minima_are_found_out() {
    let first = |verify| SolveOptions {
        strategy: Strategy::FirstViews(Method::Calibrated { reweights: 1 }),
        verify,
        ..PLAIN()
    };
    for (views, landmarks, seed) in [(4, 7, 69), (5, 8, 1), (5, 8, 56)] {
        let (_, problem) = scene(views, landmarks, 2.23, seed);
        let least = solve(&problem, &PLAIN(), None).unwrap();
        let wrong = solve(&problem, &first(false), None).unwrap();
        assert!(wrong.cost > least.cost * 1.01 && wrong.termination.was_successful());
        let found = solve(&problem, &first(true), None).unwrap();
        let shown = certificate(&found);
        assert!(shown.verified(), "{seed}: {shown:?}");
        assert!((found.cost / least.cost - 1.0).abs() < 1e-5, "{seed}");
        let is_higher = |other: &Reconstruction| other.cost * 1.000_01 > found.cost;
        assert!(found.alternatives.iter().all(is_higher), "{seed}");
    }
}

/// The costs of priors are part of the cost that the bound starts from, and maps of cells are laid into their frame.
#[test]
fn maps_with_priors_are_verified() {
    for seed in 0..12 {
        let (scene, bearings) = scene(8, 10, 0.5, seed);
        // Far from the origin as well.
        let shift = nalgebra::Vector2::new(5e5, -2e6) * (seed % 2) as f64;
        let priors = (0..8).step_by(3).map(|view| {
            let mut pose = scene.poses[view];
            pose.translation.vector += shift;
            PosePrior {
                view,
                pose,
                noise: Noise::Sigmas([0.1, 0.1, 0.05]),
            }
        });
        let problem = bearings
            .with_pose_priors(&priors.collect::<Vec<_>>())
            .unwrap();
        let found = solve(&problem, &verify(), None).unwrap();
        let shown = certificate(&found);
        assert!(shown.verified() && shown.cells >= 1, "{seed}: {shown:?}");
        let mut truth = scene.map();
        for pose in truth.poses.iter_mut().flatten() {
            pose.translation.vector += shift;
        }
        for point in truth.landmarks.iter_mut().flatten() {
            point.coords += shift;
        }
        let truth = refine(&problem, &truth, &RefineOptions::default(), None).unwrap();
        assert!(found.cost <= truth.cost * 1.000_01, "{seed}");
    }
}

/// Why a map is not verified.
#[test]
fn what_cannot_be_verified_says_why() {
    let ended = |problem: &Problem, options: &SolveOptions| {
        let found = solve(problem, options, None).unwrap();
        let shown = certificate(&found);
        assert_eq!(shown.verified(), shown.verdict.reason().is_none());
        assert!(shown.verified() || shown.cells == 0);
        shown.verdict
    };
    // Residuals as large as this leave the tensor free.
    let (_, noisy) = scene(5, 7, 12.0, 3);
    assert_eq!(ended(&noisy, &verify()), Verdict::NoCone);
    let (_, four) = scene(6, 4, 0.1, 3);
    assert_eq!(ended(&four, &verify()), Verdict::TooFewShared);
    let (_, many) = scene(12, 15, 1.0, 3);
    let mut few = verify();
    few.stages.verify.cells = 3;
    assert_eq!(ended(&many, &few), Verdict::TooManyCells);
    let (_, exact) = scene(6, 8, 0.0, 3);
    // Bearings without noise, weighted as if they had some.
    assert_eq!(ended(&exact, &verify()), Verdict::NoLowerMap);
    let (_, plain) = scene(6, 8, 0.5, 3);
    assert_eq!(ended(&plain, &verify()), Verdict::Searched);
    // A refinement that is cut short ends in no minimum.
    let mut short = verify();
    short.refine.max_iterations = 1;
    assert_eq!(ended(&plain, &short), Verdict::NotConverged);
}

/// The bound is one of squared residuals of all bearings.
#[test]
fn other_losses_are_refused() {
    let (_, problem) = scene(6, 9, 0.5, 1);
    let robust = SolveOptions {
        robust: true,
        ..verify()
    };
    let mut huber = verify();
    huber.refine.loss = Loss::Huber(1.345);
    for options in [robust, huber] {
        let refused = solve(&problem, &options, None);
        assert_eq!(refused, Err(Error::NeedsSquares { what: "verify" }));
    }
}

/// The verification reports how far it is, and can be stopped at any time.
#[test]
fn a_verification_can_be_stopped() {
    let (_, problem) = scene(8, 10, 1.0, 1);
    let mut calls = 0;
    let mut told = (0, 0);
    let mut count = |stage: &'static str, done, all| {
        if stage == "verify" {
            calls += 1;
            assert!(done <= all);
            told = (done, all);
        }
        true
    };
    let found = solve(&problem, &verify(), Some(&mut count)).unwrap();
    let cells = certificate(&found).cells;
    assert_eq!(told, (cells - 1, cells));
    assert!(calls > 2 * cells);
    for stop in [1, calls / 2, calls] {
        let mut left = stop;
        let mut count = |stage: &'static str, _, _| {
            left -= usize::from(stage == "verify");
            left > 0
        };
        let stopped = solve(&problem, &verify(), Some(&mut count));
        assert_eq!(stopped, Err(Error::Interrupted));
    }
    // The same bits each time.
    assert_eq!(solve(&problem, &verify(), None).unwrap(), found);
}
