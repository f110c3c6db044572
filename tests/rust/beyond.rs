// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnoses of problems with odometry and priors, and of large ones.

use bearslam::{
    Arena, Kind, LandmarkPrior, Layout, Noise, Pose, Problem, Scene, bearing_to, diagnose, pose,
    simulate,
};
use nalgebra::Point2;

/// Views along a lane that see a straight wall, without noise.
fn wall(views: usize, landmarks: usize) -> Scene {
    let poses: Vec<Pose<f64>> = (0..views)
        .map(|k| pose(0.05 * k as f64, (1.3 * k as f64).sin(), 0.1 * k as f64))
        .collect();
    let landmarks: Vec<_> = (0..landmarks)
        .map(|k| Point2::new(0.3 * k as f64, 3.0))
        .collect();
    let bearings = poses
        .iter()
        .flat_map(|pose| {
            landmarks
                .iter()
                .map(move |point| bearing_to(pose, point).unwrap().angle())
        })
        .collect();
    Scene {
        poses,
        landmarks,
        bearings,
    }
}

fn problem(scene: &Scene) -> Problem {
    Problem::dense(
        scene.poses.len(),
        scene.landmarks.len(),
        &scene.bearings,
        0.005,
    )
    .unwrap()
}

#[test]
fn odometry_determines_what_a_wall_does_not() {
    let scene = wall(6, 8);
    let alone = diagnose(&problem(&scene), None, None).unwrap();
    assert_eq!(alone.findings[0].kind, Kind::CollinearLandmarks);
    let odometry = scene.odometry([0.01, 0.01, 0.01], 1).unwrap();
    let tied = problem(&scene).with_odometry(&odometry).unwrap();
    let found = diagnose(&tied, None, None).unwrap();
    assert!(found.determined() && found.extra == 0, "{found}");
    // 48 bearings and 15 numbers of odometry for 34 unknowns, three of which are the gauge.
    assert_eq!(found.components[0].freedom(), 48 + 15 - 34 + 3);
}

/// Views without sightings are placed by odometry.
#[test]
fn odometry_places_views_that_see_nothing() {
    let arena = Arena {
        sight: 3.0,
        ..Arena::default()
    };
    let mut scene = simulate(Layout::Trajectory, 30, 20, 0.005, 1, arena).unwrap();
    let odometry = scene.odometry([0.02, 0.02, 0.01], 1).unwrap();
    scene.bearings[10 * 20..13 * 20].fill(f64::NAN);
    let blind = Problem::dense(30, 20, &scene.bearings, 0.005).unwrap();
    let tied = blind.clone().with_odometry(&odometry).unwrap();
    let found = diagnose(&tied, None, None).unwrap();
    assert!(found.determined(), "{found}");
    let found = diagnose(&blind, None, None).unwrap();
    let finding = &found.findings[0];
    assert_eq!(finding.kind, Kind::TooFewSightings);
    assert_eq!(finding.views, [10, 11, 12]);
}

#[test]
fn priors_leave_what_they_leave() {
    // Two known landmarks fix the frame, but not the free direction of the wall.
    let scene = wall(6, 8);
    let known: Vec<_> = [0, 7]
        .map(|landmark| LandmarkPrior {
            landmark,
            position: scene.landmarks[landmark],
            noise: Noise::Sigmas([0.01, 0.01]),
        })
        .into();
    let tied = problem(&scene).with_landmark_priors(&known).unwrap();
    let found = diagnose(&tied, Some(&scene.map()), None).unwrap();
    assert!(!found.determined());
    assert_eq!(found.extra, 1, "{found}");
    assert_eq!(found.findings[0].kind, Kind::UnnamedDirection);
    // A third one does.
    let third = LandmarkPrior {
        landmark: 3,
        position: scene.landmarks[3],
        noise: Noise::Sigmas([0.01, 0.01]),
    };
    let tied = tied.with_landmark_priors(&[third]).unwrap();
    let found = diagnose(&tied, Some(&scene.map()), None).unwrap();
    assert!(found.determined(), "{found}");
}

#[test]
fn large_maps_are_examined_sparsely() {
    let arena = Arena {
        sight: 1.5,
        ..Arena::default()
    };
    let scene = simulate(Layout::Trajectory, 200, 60, 0.002, 3, arena).unwrap();
    let found = diagnose(&problem(&scene), Some(&scene.map()), None).unwrap();
    assert_eq!(found.extra, 0, "{found}");
    // Two landmarks are seen by no view.
    let seen = |kind| kind == Kind::TooFewSightings;
    assert!(found.findings.iter().all(|one| seen(one.kind)), "{found}");
    assert!(!found.singular_values.is_empty() && found.condition > 1.0);
    let scene = wall(200, 30);
    let found = diagnose(&problem(&scene), Some(&scene.map()), None).unwrap();
    assert_eq!(found.extra, 1, "{found}");
    assert!(!found.determined());
    assert!(found.directions[0].free && found.directions[0].movers.len() > 3);
}
