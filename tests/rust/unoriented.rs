// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bearings known only modulo pi: lines instead of rays.

use crate::common;
use bearslam::{
    Arena, Error, Layout, Problem, RefineOptions, SolveOptions, Strategy, refine, simulate, solve,
};
use std::f64::consts::{FRAC_PI_2, PI};

/// Turns two bearings in five by pi.
fn turn_some(bearings: &mut [f64]) {
    for (k, bearing) in bearings.iter_mut().enumerate() {
        if (k * 7 + k / 3) % 5 < 2 {
            *bearing += PI;
        }
    }
}

#[test]
fn unoriented_bearings_are_solved_modulo_pi() {
    for seed in 0..10 {
        let mut scene = common::scene(Layout::Mixed, 6, 10, 0.1, seed);
        let sigma = 0.1_f64.to_radians();
        let straight = Problem::dense(6, 10, &scene.bearings, sigma).unwrap();
        let straight = solve(&straight, &SolveOptions::default(), None).unwrap();
        turn_some(&mut scene.bearings);
        let problem = Problem::dense(6, 10, &scene.bearings, sigma)
            .unwrap()
            .unoriented();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        assert!(
            found.cost <= straight.cost * (1.0 + 1e-6),
            "{seed}: {} {}",
            found.cost,
            straight.cost
        );
        let half = FRAC_PI_2;
        assert!(found.residuals.iter().flatten().all(|r| r.abs() <= half));
        assert!(
            found
                .map
                .poses
                .iter()
                .flatten()
                .all(|p| p.rotation.angle().abs() <= half)
        );
    }
}

#[test]
fn limited_sight_is_solved_modulo_pi() {
    let noise = 0.3_f64.to_radians();
    let arena = Arena {
        sight: 2.0,
        ..Arena::default()
    };
    for seed in 0..3 {
        let mut scene = simulate(Layout::Trajectory, 45, 40, noise, seed, arena).unwrap();
        let straight = Problem::dense(45, 40, &scene.bearings, noise).unwrap();
        let straight = solve(&straight, &SolveOptions::default(), None).unwrap();
        turn_some(&mut scene.bearings);
        let problem = Problem::dense(45, 40, &scene.bearings, noise)
            .unwrap()
            .unoriented();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        let limit = straight.cost * (1.0 + 1e-5);
        assert!(found.cost <= limit, "{seed}: {} {limit}", found.cost);
        assert!(found.map.poses.iter().flatten().count() >= 44);
        // The global method needs the signs.
        let options = SolveOptions {
            strategy: Strategy::Global,
            ..SolveOptions::default()
        };
        let error = solve(&problem, &options, None).unwrap_err();
        assert!(matches!(error, Error::NeedsOriented { .. }));
    }
}

/// A landmark exactly on its view has no bearing: zero, not pi.
#[test]
fn a_landmark_on_its_view_has_no_residual() {
    let scene = common::scene(Layout::Mixed, 5, 8, 0.3, 2);
    let problem = common::problem(&scene).unoriented();
    for view in 0..5 {
        let mut start = common::truth(&scene);
        start.landmarks[3] = Some(scene.poses[view].translation.vector.into());
        let options = RefineOptions {
            max_iterations: 0,
            ..RefineOptions::default()
        };
        let found = refine(&problem, &start, &options, None).unwrap();
        let residuals = || found.residuals.iter().flatten();
        assert!(residuals().all(|r| r.abs() <= FRAC_PI_2));
        let squares: f64 = residuals().map(|r| r * r).sum();
        assert!((0.5 * squares - found.cost).abs() < 1e-9, "{squares}");
    }
}
