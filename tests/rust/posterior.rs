// SPDX-License-Identifier: MIT OR Apache-2.0
//! Odometry and priors.

use crate::common;
use bearslam::{
    Arena, Error, Frame, LandmarkPrior, Layout, Loss, Map, Noise, Odometry, Pose, PosePrior,
    Problem, RefineOptions, Scene, Sighting, SolveOptions, covariance, pose, refine, simulate,
    solve,
};
use nalgebra::{Matrix3, Point2, Similarity2, Vector2, Vector3};

const NOISE: f64 = 0.009;
const SIGMAS: [f64; 3] = [0.02, 0.02, 0.01];

fn trajectory(views: usize, landmarks: usize, seed: u64) -> Scene {
    let arena = Arena {
        sight: 2.0,
        ..Arena::default()
    };
    simulate(Layout::Trajectory, views, landmarks, NOISE, seed, arena).unwrap()
}

fn bearings(scene: &Scene) -> Problem {
    let (views, landmarks) = (scene.poses.len(), scene.landmarks.len());
    Problem::dense(views, landmarks, &scene.bearings, NOISE).unwrap()
}

fn with_odometry(scene: &Scene, seed: u64) -> Problem {
    let odometry = scene.odometry(SIGMAS, seed).unwrap();
    bearings(scene).with_odometry(&odometry).unwrap()
}

fn from_truth(problem: &Problem, scene: &Scene) -> f64 {
    let found = refine(problem, &scene.map(), &RefineOptions::default(), None);
    found.unwrap().cost
}

#[test]
fn odometry_and_bearings_reach_the_minimum_of_the_truth() {
    for seed in 0..10 {
        let scene = trajectory(60, 30, seed);
        let problem = with_odometry(&scene, seed);
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        let best = from_truth(&problem, &scene);
        assert!(
            found.cost <= best * (1.0 + 1e-6),
            "{seed}: {} {best}",
            found.cost
        );
        assert!(found.map.is_complete() || !found.undetermined.is_empty());
        // Twice the cost equals the degrees of freedom within four standard deviations.
        let freedom = found.freedom as f64;
        assert!((2.0 * found.cost - freedom).abs() < 4.0 * (2.0 * freedom).sqrt());
        // The scale is that of the odometry, the frame that of the first view.
        let first = found.map.poses[0].unwrap();
        assert!(first.translation.vector.norm() < 1e-12 && first.rotation.angle().abs() < 1e-12);
        let home = scene.poses[0].inverse();
        for (pose, truth) in found.map.poses.iter().zip(&scene.poses) {
            let error = pose.unwrap().translation.vector - (home * truth).translation.vector;
            assert!(error.norm() < 0.5, "{seed} {error}");
        }
    }
}

/// Loop closure: a robot returns to an earlier place after its odometry has drifted far.
#[test]
fn a_long_trajectory_closes_its_loops() {
    let arena = Arena {
        sight: 7.0,
        width: 80.0,
        height: 56.0,
    };
    let scene = simulate(Layout::Trajectory, 500, 100, 0.005, 1, arena).unwrap();
    let odometry = scene.odometry([0.2, 0.2, 0.1], 1).unwrap();
    let problem = Problem::dense(500, 100, &scene.bearings, 0.005).unwrap();
    let problem = problem.with_odometry(&odometry).unwrap();
    let best = refine(&problem, &scene.map(), &RefineOptions::default(), None).unwrap();
    let mut told = 0;
    let mut progress = |stage: &'static str, done: usize, all: usize| {
        told += usize::from(stage == "odometry");
        done <= all
    };
    let found = solve(&problem, &SolveOptions::default(), Some(&mut progress)).unwrap();
    assert!(
        found.cost <= best.cost * (1.0 + 1e-6),
        "{} {}",
        found.cost,
        best.cost
    );
    // The same views and landmarks are undetermined as in the refinement from the truth.
    assert_eq!(found.undetermined, best.undetermined);
    assert!(told > 20, "{told}");
    // Stop in the middle of a long piece.
    let mut left = told / 2;
    let mut stop = |_: &'static str, _, _| {
        left = left.saturating_sub(1);
        left > 0
    };
    let stopped = solve(&problem, &SolveOptions::default(), Some(&mut stop));
    assert!(matches!(stopped, Err(Error::Interrupted)));
}

/// The first half of the views is one robot, the second half another with separate odometry.
#[test]
fn two_robots_without_a_common_frame_are_one_problem() {
    let scene = trajectory(40, 30, 5);
    let odometry: Vec<_> = scene.odometry(SIGMAS, 1).unwrap();
    let apart: Vec<_> = odometry.into_iter().filter(|o| o.start != 19).collect();
    let problem = bearings(&scene).with_odometry(&apart).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    assert!(found.cost <= from_truth(&problem, &scene) * (1.0 + 1e-6));
    assert!(scene.errors(&found.map).unwrap().position_rms < 0.1);
}

/// Two robots that share no landmark give two maps, each in the scale of its odometry.
#[test]
fn what_nothing_ties_together_stays_apart() {
    let scene = trajectory(40, 30, 5);
    let mut sightings = Vec::new();
    for (k, &bearing) in scene
        .bearings
        .iter()
        .enumerate()
        .filter(|(_, b)| !b.is_nan())
    {
        // The second robot sees the same landmarks under other indices.
        let (view, landmark) = (k / 30, k % 30 + 30 * (k / 600));
        sightings.push(Sighting {
            view,
            landmark,
            bearing,
            sigma: NOISE,
        });
    }
    let odometry: Vec<_> = scene.odometry(SIGMAS, 1).unwrap();
    let apart: Vec<_> = odometry.into_iter().filter(|o| o.start != 19).collect();
    let problem = Problem::new(40, 60, &sightings).unwrap();
    let problem = problem.with_odometry(&apart).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    assert_eq!(found.components.len(), 1);
    let other = &found.components[0];
    for view in 0..40 {
        let [here, there] = [&found, other].map(|map| map.map.poses[view].is_some());
        assert!(here != there, "{view}");
    }
    let step = apart[0].delta.translation.vector.norm();
    for map in [&found.map, &other.map] {
        let mut poses = map.poses.iter().flatten();
        let (a, b) = (poses.next().unwrap(), poses.next().unwrap());
        let length = (b.translation.vector - a.translation.vector).norm();
        assert!((length / step - 1.0).abs() < 0.5, "{length} {step}");
    }
}

#[test]
fn never_worse_than_from_bearings_alone() {
    for seed in 0..20 {
        let scene = common::scene(Layout::Mixed, 8, 11, 0.5, seed);
        // Odometry so bad that it gives no useful start.
        let odometry = scene.odometry([3.0, 3.0, 2.0], seed).unwrap();
        let alone = Problem::dense(8, 11, &scene.bearings, NOISE).unwrap();
        let problem = alone.clone().with_odometry(&odometry).unwrap();
        let options = SolveOptions::default();
        let found = solve(&problem, &options, None).unwrap();
        let without = solve(&alone, &options, None).unwrap();
        let after = refine(&problem, &without.map, &options.refine, None).unwrap();
        assert!(found.cost <= after.cost * (1.0 + 1e-9), "{seed}");
    }
}

#[test]
fn known_landmarks_fix_the_frame() {
    let scene = common::scene(Layout::Enclosed, 6, 9, 0.1, 4);
    let known: Vec<_> = [0, 3, 5]
        .map(|landmark| LandmarkPrior {
            landmark,
            position: scene.landmarks[landmark],
            noise: Noise::Sigmas([1e-4, 1e-4]),
        })
        .into();
    let sigma = 0.1_f64.to_radians();
    let problem = Problem::dense(6, 9, &scene.bearings, sigma).unwrap();
    let problem = problem.with_landmark_priors(&known).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    for (point, truth) in found.map.landmarks.iter().zip(&scene.landmarks) {
        assert!((point.unwrap() - truth).norm() < 0.1);
    }
    for (pose, truth) in found.map.poses.iter().zip(&scene.poses) {
        assert!((pose.unwrap().translation.vector - truth.translation.vector).norm() < 0.1);
        assert!(pose.unwrap().rotation.angle_to(&truth.rotation).abs() < 0.05);
    }
    let covariance = covariance(&problem, &found.map, Loss::Squared, Frame::Priors, None).unwrap();
    assert!(covariance.poses[0].unwrap().trace() > 0.0);
    assert!((covariance.landmarks[0].unwrap()[(0, 0)].sqrt() / 1e-4 - 1.0).abs() < 0.1);
}

/// Priors that only fix the datum do not change the residuals of the bearings, whatever the datum.
#[test]
fn one_known_place_costs_nothing() {
    let unknown = f64::INFINITY;
    for seed in 0..6 {
        let scene = common::scene(Layout::Enclosed, 8, 12, 0.5, seed);
        let alone = Problem::dense(8, 12, &scene.bearings, NOISE).unwrap();
        let cost = solve(&alone, &SolveOptions::default(), None).unwrap().cost;
        let limit = cost * (1.0 + 1e-6);
        for sigma in [1e-3, 0.1, 10.0] {
            for robust in [false, true] {
                let options = SolveOptions {
                    robust,
                    ..SolveOptions::default()
                };
                let landmark = LandmarkPrior {
                    landmark: 5,
                    position: Point2::new(10.0, 3.0),
                    noise: Noise::Sigmas([sigma; 2]),
                };
                let problem = alone.clone().with_landmark_priors(&[landmark]).unwrap();
                let found = solve(&problem, &options, None).unwrap();
                assert!(
                    found.cost <= limit,
                    "{seed} {sigma} {robust}: {} {cost}",
                    found.cost
                );
                for heading in [sigma, unknown] {
                    let view = PosePrior {
                        view: 3,
                        pose: pose(1.0, 2.0, 0.5),
                        noise: Noise::Sigmas([sigma, sigma, heading]),
                    };
                    let problem = alone.clone().with_pose_priors(&[view]).unwrap();
                    let found = solve(&problem, &options, None).unwrap();
                    assert!(
                        found.cost <= limit,
                        "{seed} {sigma} {robust}: {} {cost}",
                        found.cost
                    );
                }
            }
        }
    }
}

/// A compass resolves the headings that bearings modulo pi leave ambiguous.
#[test]
fn a_compass_and_lines() {
    for seed in 0..6 {
        let scene = common::scene(Layout::Enclosed, 8, 12, 0.5, seed);
        let lines = Problem::dense(8, 12, &scene.bearings, NOISE)
            .unwrap()
            .unoriented();
        let alone = solve(&lines, &SolveOptions::default(), None).unwrap();
        let compass: Vec<_> = scene
            .poses
            .iter()
            .enumerate()
            .map(|(view, &pose)| PosePrior {
                view,
                pose,
                noise: Noise::Sigmas([f64::INFINITY, f64::INFINITY, 0.02]),
            })
            .collect();
        let problem = lines.with_pose_priors(&compass).unwrap();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        // Eight headings, each one term of about a half.
        assert!(
            found.cost < alone.cost + 15.0,
            "{seed}: {} {}",
            found.cost,
            alone.cost
        );
        for (pose, truth) in found.map.poses.iter().zip(&scene.poses) {
            assert!(
                pose.unwrap().rotation.angle_to(&truth.rotation).abs() < 0.2,
                "{seed}"
            );
        }
    }
}

/// Odometry with a standard deviation a million times that of the bearings still determines the scale.
#[test]
fn loose_odometry_beside_sharp_bearings() {
    let scene = common::scene(Layout::Enclosed, 8, 12, 0.0, 2);
    let odometry = scene.odometry([0.1, 0.1, 0.1], 1).unwrap();
    for sigma in [1e-5, 1e-7] {
        let problem = Problem::dense(8, 12, &scene.bearings, sigma).unwrap();
        let problem = problem.with_odometry(&odometry).unwrap();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        let frame = Frame::FirstView;
        let covariance = covariance(&problem, &found.map, Loss::Squared, frame, None).unwrap();
        assert_eq!(covariance.free, 0);
        let trace = covariance.landmarks[4].unwrap().trace();
        assert!(trace > 1e-4 && trace < 1.0, "{sigma}: {trace}");
    }
}

/// With bearings alone four beacons on a square leave a direction free; with known positions they do not.
#[test]
fn known_beacons_localise_one_view_after_the_other() {
    let beacons = [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0)].map(|(x, y)| Point2::new(x, y));
    let poses: Vec<Pose<f64>> = (0..9)
        .map(|k| {
            pose(
                1.5 + 1.5 * f64::from(k / 3),
                1.5 + 1.5 * f64::from(k % 3),
                0.3 * f64::from(k),
            )
        })
        .collect();
    let table: Vec<f64> = poses
        .iter()
        .flat_map(|p| beacons.map(|b| bearslam::bearing_to(p, &b).unwrap().angle()))
        .collect();
    let priors: Vec<_> = (0..4)
        .map(|landmark| LandmarkPrior {
            landmark,
            position: beacons[landmark],
            noise: Noise::Sigmas([0.01, 0.01]),
        })
        .collect();
    let problem = Problem::dense(9, 4, &table, 0.01).unwrap();
    let problem = problem.with_landmark_priors(&priors).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    for (pose, truth) in found.map.poses.iter().zip(&poses) {
        let error = pose.unwrap().to_homogeneous() - truth.to_homogeneous();
        assert!(error.norm() < 1e-6);
    }
}

#[test]
fn a_compass_and_one_known_pose() {
    let scene = common::scene(Layout::Mixed, 6, 9, 0.0, 2);
    let unknown = f64::INFINITY;
    let priors: Vec<_> = scene
        .poses
        .iter()
        .enumerate()
        .map(|(view, &pose)| PosePrior {
            view,
            pose,
            noise: Noise::Sigmas(if view == 2 {
                [0.1, 0.1, 0.01]
            } else {
                [unknown, unknown, 0.01]
            }),
        })
        .collect();
    let problem = Problem::dense(6, 9, &scene.bearings, NOISE).unwrap();
    let problem = problem.with_pose_priors(&priors).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    // Headings and one place are known, the scale is not.
    for (pose, truth) in found.map.poses.iter().zip(&scene.poses) {
        assert!(pose.unwrap().rotation.angle_to(&truth.rotation).abs() < 1e-6);
    }
    let there = found.map.poses[2].unwrap().translation.vector;
    assert!((there - scene.poses[2].translation.vector).norm() < 1e-6);
}

#[test]
fn covariances_of_odometry_are_accepted_in_full() {
    let scene = trajectory(30, 20, 3);
    let mut odometry = scene.odometry(SIGMAS, 3).unwrap();
    let as_sigmas = bearings(&scene).with_odometry(&odometry).unwrap();
    for motion in &mut odometry {
        let square = Vector3::from(SIGMAS).map(|s| s * s);
        motion.noise = Noise::Covariance([
            [square.x, 0.0, 0.0],
            [0.0, square.y, 0.0],
            [0.0, 0.0, square.z],
        ]);
    }
    let as_covariance = bearings(&scene).with_odometry(&odometry).unwrap();
    let options = SolveOptions::default();
    let [a, b] = [as_sigmas, as_covariance].map(|problem| solve(&problem, &options, None).unwrap());
    assert!((a.cost - b.cost).abs() < 1e-9 * a.cost);
}

#[test]
fn wrong_odometry_and_priors_are_named() {
    let problem = || Problem::dense(2, 1, &[0.1, 0.2], 1.0).unwrap();
    let motion = Odometry {
        start: 0,
        end: 1,
        delta: pose(1.0, 0.0, 0.0),
        noise: Noise::Sigmas([0.1, 0.1, 0.1]),
    };
    for (bad, message) in [
        (
            Odometry { end: 7, ..motion },
            "odometry: end: expected indices below 2, got 7 at index 0",
        ),
        (
            Odometry { end: 0, ..motion },
            "odometry: expected motions between two views, got one from view 0 to itself at index 0",
        ),
        (
            Odometry {
                noise: Noise::Sigmas([0.1, -0.1, 0.1]),
                ..motion
            },
            "odometry: sigma: expected positive numbers, got -0.1 at index 0",
        ),
        (
            Odometry {
                delta: pose(f64::NAN, 0.0, 0.0),
                ..motion
            },
            "odometry: delta: expected finite numbers, got NaN or infinity at index 0",
        ),
    ] {
        let error = problem().with_odometry(&[bad]).unwrap_err();
        assert_eq!(error.to_string(), message);
    }
    let prior = LandmarkPrior {
        landmark: 1,
        position: Point2::new(0.0, 0.0),
        noise: Noise::Sigmas([1.0, 1.0]),
    };
    let error = problem().with_landmark_priors(&[prior]).unwrap_err();
    assert!(matches!(error, Error::OutOfRange { .. }));
}

/// Views and landmarks that only odometry connects are determined; unconnected ones are not.
#[test]
fn odometry_carries_views_that_see_nothing() {
    let scene = common::scene(Layout::Mixed, 5, 8, 0.0, 9);
    let sightings: Vec<_> = (0..40)
        .filter(|k| k / 8 != 4 && k % 8 != 7)
        .map(|k| Sighting {
            view: k / 8,
            landmark: k % 8,
            bearing: scene.bearings[k],
            sigma: NOISE,
        })
        .collect();
    let odometry = scene.odometry(SIGMAS, 0).unwrap();
    let problem = Problem::new(5, 8, &sightings).unwrap();
    let problem = problem.with_odometry(&odometry).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    assert!(found.map.poses.iter().all(Option::is_some));
    assert!(found.map.landmarks[7].is_none() && found.undetermined.len() == 1);
    let cov = covariance(&problem, &found.map, Loss::Squared, Frame::FirstView, None).unwrap();
    assert!(cov.poses[4].unwrap().trace() > cov.poses[3].unwrap().trace());
    assert!(cov.landmarks[7].is_none());
}

fn flatten(map: &Map) -> Vec<f64> {
    let poses = map.poses.iter().flatten();
    let poses = poses.flat_map(|p| [p.translation.x, p.translation.y, p.rotation.angle()]);
    poses
        .chain(map.landmarks.iter().flatten().flat_map(|p| [p.x, p.y]))
        .collect()
}

/// The covariance agrees with the scatter of many draws.
#[test]
fn covariance_is_the_scatter_of_estimates() {
    let noise = 0.05_f64.to_radians();
    let exact = common::scene(Layout::Enclosed, 6, 10, 0.0, 8);
    let problem = Problem::dense(6, 10, &exact.bearings, noise).unwrap();
    let truth = refine(&problem, &exact.map(), &RefineOptions::default(), None).unwrap();
    let predicted =
        covariance(&problem, &truth.map, Loss::Squared, Frame::FirstView, None).unwrap();
    let centre = flatten(&truth.map);
    let mut squares = vec![0.0; centre.len()];
    let draws = 400_u32;
    let mut phase = 0.5_f64;
    let mut normal = || {
        // The sum of twelve uniform numbers is close enough to Gaussian for a variance.
        (0..12)
            .map(|_| {
                phase = (phase * 997.13 + 0.731).fract();
                phase
            })
            .sum::<f64>()
            - 6.0
    };
    for _ in 0..draws {
        let bearings: Vec<f64> = exact
            .bearings
            .iter()
            .map(|b| b + noise * normal())
            .collect();
        let problem = Problem::dense(6, 10, &bearings, noise).unwrap();
        let found = refine(&problem, &exact.map(), &RefineOptions::default(), None).unwrap();
        for (sum, (a, b)) in squares
            .iter_mut()
            .zip(flatten(&found.map).iter().zip(&centre))
        {
            *sum += (a - b).powi(2) / f64::from(draws);
        }
    }
    let poses = predicted
        .poses
        .iter()
        .flatten()
        .flat_map(|c| (0..3).map(move |k| c[(k, k)]));
    let points = predicted
        .landmarks
        .iter()
        .flatten()
        .flat_map(|c| (0..2).map(move |k| c[(k, k)]));
    for (k, (found, expected)) in squares.iter().zip(poses.chain(points)).enumerate() {
        if k < 3 {
            assert!(
                *found < 1e-20 && expected.abs() < 1e-20,
                "{found} {expected}"
            );
        } else {
            // Four standard deviations of a variance from 400 draws are 28 %.
            assert!(
                (found / expected - 1.0).abs() < 0.3,
                "{k}: {found} {expected}"
            );
        }
    }
}

/// What the frame fixes has neither variance nor covariance, without a trace of rounding, and a covariance is symmetric.
#[test]
fn a_fixed_heading_has_no_covariance() {
    for seed in 0..20 {
        let scene = common::scene(Layout::Enclosed, 6, 9, 0.5, seed);
        let known = LandmarkPrior {
            landmark: 2,
            position: scene.landmarks[2],
            noise: Noise::Sigmas([0.1, 0.2]),
        };
        let problem = bearings(&scene).with_landmark_priors(&[known]).unwrap();
        let frame = Frame::FirstView;
        let found = covariance(&problem, &scene.map(), Loss::Squared, frame, None).unwrap();
        // The landmark is known, so the first view has a position of its own, and its heading is the datum.
        let first = found.poses[0].unwrap();
        assert!(
            first[(0, 0)] > 1e-6 && first[(1, 1)] > 1e-6,
            "{seed} {first}"
        );
        assert!(first[(2, 2)] < 1e-15, "{seed} {first}");
        for pose in found.poses.iter().flatten() {
            assert_eq!(*pose, pose.transpose(), "{seed}");
        }
        for point in found.landmarks.iter().flatten() {
            assert_eq!(*point, point.transpose(), "{seed}");
        }
    }
}

#[test]
fn a_free_direction_has_infinite_variance_and_the_rest_its_own() {
    // Three views of a wall and nothing else: one direction is free.
    let poses = [
        pose(0.0, 0.0, 0.1),
        pose(1.0, 0.3, -0.2),
        pose(2.5, -0.4, 0.4),
        pose(1.5, -1.0, 0.0),
    ];
    let wall: Vec<_> = (0..8)
        .map(|k| Point2::new(f64::from(k) * 0.7 - 1.0, 2.0))
        .collect();
    let table: Vec<f64> = poses
        .iter()
        .flat_map(|p| {
            wall.iter()
                .map(|x| bearslam::bearing_to(p, x).unwrap().angle())
        })
        .collect();
    let problem = Problem::dense(4, 8, &table, 0.01).unwrap();
    let map = common::map(&poses, &wall);
    for frame in [Frame::FirstView, Frame::FreeNetwork] {
        let found = covariance(&problem, &map, Loss::Squared, frame, None).unwrap();
        assert_eq!(found.free, 1, "{frame:?}");
        let moves = |c: &&Matrix3<f64>| c.diagonal().iter().any(|v| v.is_infinite());
        let infinite = found.poses.iter().flatten().filter(moves).count();
        assert!(infinite >= 3, "{infinite}");
    }
    let error = covariance(&problem, &map, Loss::Squared, Frame::Priors, None).unwrap_err();
    assert!(
        matches!(error, Error::Degenerate { value: 4.0, .. }),
        "{error}"
    );
}

/// Where one coordinate of the positions is known, the first view is at zero along the other, and the map shifted along it
/// is no alternative.
#[test]
fn a_map_on_a_lane_is_no_rival_of_itself() {
    for (seed, along) in (0..10).flat_map(|seed| [(seed, 0), (seed, 1)]) {
        let scene = simulate(Layout::Mixed, 8, 12, 0.005, seed, Arena::default()).unwrap();
        let mut sigmas = [0.05, 0.05, f64::INFINITY];
        sigmas[along] = f64::INFINITY;
        let poses = scene.poses.iter().enumerate();
        let priors: Vec<_> = poses
            .map(|(view, &pose)| PosePrior {
                view,
                pose,
                noise: Noise::Sigmas(sigmas),
            })
            .collect();
        let odometry = scene.odometry([0.05, 0.05, 0.02], seed).unwrap();
        let problem = Problem::dense(8, 12, &scene.bearings, 0.005).unwrap();
        let problem = problem.with_odometry(&odometry).unwrap();
        let problem = problem.with_pose_priors(&priors).unwrap();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        let first = found.map.poses[0].unwrap().translation.vector;
        assert!(first[along].abs() < 1e-12, "{seed} {along}: {first}");
        let truth = scene.poses[0].translation.vector[1 - along];
        assert!((first[1 - along] - truth).abs() < 0.2, "{seed}: {first}");
        for rival in &found.alternatives {
            let cost = rival.cost;
            assert!(
                cost > found.cost * 1.001,
                "{seed} {along}: {cost} {}",
                found.cost
            );
        }
        // A start that is shifted along it leads to the same map.
        let shift = Vector2::from_fn(|k, _| if k == along { 3.0 } else { 0.0 });
        let shifted = found.map.transformed(&Similarity2::new(shift, 0.0, 1.0));
        let again = refine(&problem, &shifted, &RefineOptions::default(), None).unwrap();
        let position = again.map.landmarks[3].unwrap() - found.map.landmarks[3].unwrap();
        assert!(position.norm() < 1e-6, "{seed} {along}: {position}");
        let frame = Frame::FirstView;
        let covariance = covariance(&problem, &found.map, Loss::Squared, frame, None).unwrap();
        let variances = covariance.poses[0].unwrap().diagonal();
        assert!(
            variances[along] < 1e-12 && variances[1 - along] > 1e-6,
            "{variances}"
        );
    }
}

/// Three views have two maps modulo pi, and loose odometry does not tell which is right.
#[test]
fn alternatives_come_with_odometry() {
    let mut with_rivals = 0;
    for seed in 0..60 {
        let scene = simulate(Layout::Enclosed, 3, 5, NOISE, seed, Arena::default()).unwrap();
        let odometry = scene.odometry([2.0, 2.0, 2.0], seed).unwrap();
        let problem = bearings(&scene).with_odometry(&odometry).unwrap();
        let Ok(found) = solve(&problem, &SolveOptions::default(), None) else {
            continue;
        };
        with_rivals += usize::from(!found.alternatives.is_empty());
        let costs = || found.alternatives.iter().map(|rival| rival.cost);
        assert!(costs().is_sorted() && costs().all(|cost| cost >= found.cost * (1.0 - 1e-6)));
        let options = RefineOptions {
            max_iterations: 0,
            ..RefineOptions::default()
        };
        for rival in &found.alternatives {
            // The cost is that of the map.
            let again = refine(&problem, &rival.map, &options, None).unwrap().cost;
            let same = (again - rival.cost).abs() < 1e-6 * (1.0 + rival.cost);
            assert!(
                same || !rival.undetermined.is_empty(),
                "{seed}: {again} {}",
                rival.cost
            );
        }
    }
    assert!(with_rivals >= 5, "{with_rivals}");
}
