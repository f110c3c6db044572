// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnoses of problems with odometry and priors, and of large ones.

use bearslam::{
    Arena, Frame, Kind, LandmarkPrior, Layout, Loss, Noise, Pose, PosePrior, Problem, Scene,
    bearing_to, covariance, diagnose, pose, simulate,
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
    // Two landmarks are seen by no view, and the noise is less than what is stated.
    let kinds: Vec<Kind> = found.findings.iter().map(|one| one.kind).collect();
    assert_eq!(kinds, [Kind::TooFewSightings, Kind::OverstatedSigma]);
    assert!(!found.singular_values.is_empty() && found.condition > 1.0);
    let scene = wall(200, 30);
    let found = diagnose(&problem(&scene), Some(&scene.map()), None).unwrap();
    assert_eq!(found.extra, 1, "{found}");
    assert!(!found.determined());
    assert!(found.directions[0].free && found.directions[0].movers.len() > 3);
}

/// A given map may place what nothing in the problem holds there: a landmark that no view sees, or only one.
#[test]
fn what_nobody_sees_is_not_determined_by_a_given_map() {
    let arena = Arena {
        sight: 4.0,
        ..Arena::default()
    };
    let scene = simulate(Layout::Trajectory, 20, 12, 0.01, 1, arena).unwrap();
    let odometry = scene.odometry([0.02, 0.02, 0.01], 1).unwrap();
    for left in [0, 1] {
        let mut bearings = scene.bearings.clone();
        let mut seen = 0;
        for row in bearings.chunks_exact_mut(12) {
            seen += usize::from(!row[3].is_nan());
            if seen > left {
                row[3] = f64::NAN;
            }
        }
        let problem = Problem::dense(20, 12, &bearings, 0.01).unwrap();
        let problem = problem.with_odometry(&odometry).unwrap();
        let map = super::common::truth(&scene);
        let found = diagnose(&problem, Some(&map), None).unwrap();
        let told = found.findings.iter().find(|f| f.landmarks == [3]);
        assert!(told.is_some() && !found.determined(), "{left}: {found}");
        assert!(found.to_string().contains("landmark 3"), "{found}");
        // With a position of its own, in the frame of the rest, it needs no sightings.
        let start = PosePrior {
            view: 0,
            pose: scene.poses[0],
            noise: Noise::Sigmas([0.1, 0.1, 0.1]),
        };
        let known = LandmarkPrior {
            landmark: 3,
            position: scene.landmarks[3],
            noise: Noise::Sigmas([0.1, 0.1]),
        };
        let problem = problem.with_landmark_priors(&[known]).unwrap();
        let problem = problem.with_pose_priors(&[start]).unwrap();
        let found = diagnose(&problem, Some(&map), None).unwrap();
        assert!(found.determined(), "{left}: {found}");
    }
}

/// No residual depends on it, so its variance is infinite in the covariance of a given map as well.
#[test]
fn what_nobody_sees_has_infinite_variance() {
    let scene = super::common::scene(Layout::Enclosed, 5, 9, 0.5, 4);
    let mut bearings = scene.bearings.clone();
    bearings
        .chunks_exact_mut(9)
        .for_each(|row| row[3] = f64::NAN);
    let problem = Problem::dense(5, 9, &bearings, 0.01).unwrap();
    let map = super::common::truth(&scene);
    for frame in [Frame::FirstView, Frame::FreeNetwork] {
        let found = covariance(&problem, &map, Loss::Squared, frame, None).unwrap();
        assert_eq!(found.free, 2);
        let unseen = found.landmarks[3].unwrap();
        assert!(
            unseen[(0, 0)].is_infinite() && unseen[(1, 1)].is_infinite(),
            "{unseen}"
        );
        let others = found.landmarks.iter().enumerate().filter(|(k, _)| *k != 3);
        assert!(
            others
                .into_iter()
                .all(|(_, block)| block.unwrap().trace().is_finite())
        );
    }
}
