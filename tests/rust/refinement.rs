// SPDX-License-Identifier: MIT OR Apache-2.0
//! Levenberg-Marquardt over all poses and landmarks.

use crate::common::{LAYOUTS, error, problem, scene, truth};
use bearslam::{
    Error, Layout, Map, Noise, PosePrior, Problem, RefineOptions, Sighting, Termination, refine,
    refine_map,
};

/// The truth, shifted and turned by some centimetres and degrees.
fn guess(scene: &bearslam::Scene, size: f64) -> Map {
    let mut map = truth(scene);
    let mut phase = 0.0_f64;
    let mut next = || {
        phase += 1.7;
        size * (phase * phase).sin()
    };
    for pose in map.poses.iter_mut().flatten() {
        let (x, y, theta) = (
            pose.translation.x,
            pose.translation.y,
            pose.rotation.angle(),
        );
        *pose = bearslam::pose(x + next(), y + next(), theta + next());
    }
    for point in map.landmarks.iter_mut().flatten() {
        point.x += next();
        point.y += next();
    }
    map
}

#[test]
fn the_truth_of_exact_bearings_is_kept() {
    let scene = scene(Layout::Mixed, 5, 8, 0.0, 1);
    let mut map = truth(&scene);
    let report = refine_map(&problem(&scene), &mut map, &RefineOptions::default(), None).unwrap();
    assert_eq!(report.termination, Termination::ZeroResidual);
    assert_eq!(report.iterations, 0);
    assert_eq!(map, truth(&scene));
}

#[test]
fn exact_bearings_pull_a_guess_to_the_truth() {
    // Both ways: with more landmarks than poses the landmarks are eliminated, with fewer the poses.
    for (views, landmarks) in [(4, 30), (30, 4), (8, 11)] {
        for layout in LAYOUTS {
            let scene = scene(layout, views, landmarks, 0.0, 2);
            let mut map = guess(&scene, 0.05);
            let options = RefineOptions::default();
            let report = refine_map(&problem(&scene), &mut map, &options, None).unwrap();
            assert!(report.termination.was_successful(), "{report:?}");
            assert!(error(&map, &scene) < 1e-8, "{views}x{landmarks} {report:?}");
        }
    }
}

/// Beyond the horizon a landmark is as good as at infinity. There it is brought back to where its bearings still change
/// with its position, and the cost stays.
#[test]
fn a_landmark_beyond_the_horizon_is_brought_back() {
    let scene = scene(Layout::Mixed, 6, 9, 0.5, 2);
    let home = scene.poses[0].translation.vector;
    let options = RefineOptions {
        max_iterations: 0,
        ..RefineOptions::default()
    };
    let mut costs = Vec::new();
    for away in [1e6, 1e9, 1e20, 1e45] {
        let mut map = truth(&scene);
        let point = scene.landmarks[2].coords;
        map.landmarks[2] = Some((home + away * (point - home)).into());
        let report = refine_map(&problem(&scene), &mut map, &options, None).unwrap();
        // Half of the digits are left for directions.
        let far = (map.landmarks[2].unwrap().coords - home).norm();
        assert!(far > 1e5 && far < 1e9, "{away:e}: {far:e}");
        costs.push(report.cost);
    }
    assert!(
        costs
            .iter()
            .all(|cost| (cost / costs[0] - 1.0).abs() < 1e-5),
        "{costs:?}"
    );
}

#[test]
fn a_minimum_is_a_minimum() {
    let scene = scene(Layout::Mixed, 8, 11, 1.0, 3);
    let problem = problem(&scene);
    let before: f64 = truth(&scene)
        .residuals(&problem)
        .flatten()
        .map(|r| 0.5 * r * r)
        .sum();
    let found = refine(&problem, &truth(&scene), &RefineOptions::default(), None).unwrap();
    assert!(found.cost < before);
    assert_eq!(found.termination, Termination::Converged);
    // Moving any parameter slightly either way raises the cost: the gradient is zero.
    let cost = |map: &Map| {
        map.residuals(&problem)
            .flatten()
            .map(|r| 0.5 * r * r)
            .sum::<f64>()
    };
    assert!((cost(&found.map) / found.cost - 1.0).abs() < 1e-12);
    for landmark in 0..11 {
        for (dx, dy) in [(1e-3, 0.0), (-1e-3, 0.0), (0.0, 1e-3), (0.0, -1e-3)] {
            let mut moved = found.map.clone();
            let point = moved.landmarks[landmark].as_mut().unwrap();
            point.x += dx;
            point.y += dy;
            assert!(cost(&moved) > found.cost);
        }
    }
    for view in 1..8 {
        for step in [-1e-3, 1e-3] {
            for axis in 0..3 {
                let mut moved = found.map.clone();
                let pose = moved.poses[view].as_mut().unwrap();
                let mut values = [
                    pose.translation.x,
                    pose.translation.y,
                    pose.rotation.angle(),
                ];
                values[axis] += step;
                *pose = bearslam::pose(values[0], values[1], values[2]);
                assert!(cost(&moved) > found.cost);
            }
        }
    }
}

#[test]
fn undamped_is_gauss_newton() {
    let scene = scene(Layout::Enclosed, 8, 11, 0.5, 5);
    let problem = problem(&scene);
    let damped = refine(
        &problem,
        &guess(&scene, 0.02),
        &RefineOptions::default(),
        None,
    )
    .unwrap();
    let options = RefineOptions {
        damping: 0.0,
        ..RefineOptions::default()
    };
    let undamped = refine(&problem, &guess(&scene, 0.02), &options, None).unwrap();
    assert!(undamped.termination.was_successful());
    assert!((undamped.cost / damped.cost - 1.0).abs() < 1e-9);
}

#[test]
fn weights_are_repetitions() {
    // A sighting with half the sigma counts four times.
    let scene = scene(Layout::Mixed, 4, 8, 1.0, 6);
    let sightings: Vec<Sighting> = (0..32)
        .map(|k| Sighting {
            view: k / 8,
            landmark: k % 8,
            bearing: scene.bearings[k],
            sigma: if k % 3 == 0 { 0.5 } else { 1.0 },
        })
        .collect();
    let problem = Problem::new(4, 8, &sightings).unwrap();
    let found = refine(&problem, &truth(&scene), &RefineOptions::default(), None).unwrap();
    let sum: f64 = found
        .residuals
        .iter()
        .enumerate()
        .map(|(k, r)| r.unwrap().powi(2) * if k % 3 == 0 { 4.0 } else { 1.0 })
        .sum();
    assert!((0.5 * sum / found.cost - 1.0).abs() < 1e-12);
    let plain = Problem::dense(4, 8, &scene.bearings, 1.0).unwrap();
    let plain = refine(&plain, &truth(&scene), &RefineOptions::default(), None).unwrap();
    assert!(plain.cost < found.cost);
}

#[test]
fn sparse_and_dense_elimination_agree() {
    // Groups with many sightings use matrix products, groups with few are scattered.
    for (sight, dense) in [(5.0, true), (2.1, false)] {
        let arena = bearslam::Arena {
            width: 14.0,
            height: 10.0,
            sight,
        };
        let (views, landmarks) = (80, 120);
        let scene =
            bearslam::simulate(Layout::Trajectory, views, landmarks, 0.003, 3, arena).unwrap();
        let problem = Problem::dense(views, landmarks, &scene.bearings, 1.0).unwrap();
        assert_eq!(problem.sightings().len() * 8 >= views * landmarks, dense);
        let found = refine(&problem, &truth(&scene), &RefineOptions::default(), None).unwrap();
        assert!(
            found.termination.was_successful(),
            "{:?}",
            found.termination
        );
        let known = found.map.poses.iter().flatten().count() * 3
            + found.map.landmarks.iter().flatten().count() * 2;
        let sightings = found.residuals.iter().flatten().count();
        let sigma = (2.0 * found.cost / (sightings + 4 - known) as f64).sqrt();
        assert!((sigma / 0.003 - 1.0).abs() < 0.15, "{sigma}");
    }
}

#[test]
fn wrong_starts_are_errors() {
    let scene = scene(Layout::Mixed, 4, 7, 0.0, 0);
    let problem = problem(&scene);
    let mut short = truth(&scene);
    short.poses.pop();
    let options = RefineOptions::default();
    assert_eq!(
        refine_map(&problem, &mut short, &options, None),
        Err(Error::LengthMismatch {
            what: "poses",
            expected: 4,
            got: 3
        })
    );
    let mut empty = Map::empty(4, 7);
    assert!(matches!(
        refine_map(&problem, &mut empty, &options, None),
        Err(Error::TooFew { .. })
    ));
    let mut infinite = truth(&scene);
    infinite.landmarks[0].as_mut().unwrap().x = f64::INFINITY;
    assert!(matches!(
        refine_map(&problem, &mut infinite, &options, None),
        Err(Error::NotFinite { .. })
    ));
    let mut interrupted = guess(&scene, 0.1);
    assert_eq!(
        refine_map(
            &problem,
            &mut interrupted,
            &options,
            Some(&mut |_, _| false)
        ),
        Err(Error::Interrupted)
    );
}

#[test]
fn a_landmark_on_its_view_does_not_stop_the_work() {
    let scene = scene(Layout::Mixed, 5, 8, 0.5, 0);
    let mut map = truth(&scene);
    map.landmarks[2] = Some(map.poses[1].unwrap().translation.vector.into());
    let report = refine_map(&problem(&scene), &mut map, &RefineOptions::default(), None).unwrap();
    assert!(report.cost.is_finite());
}

#[test]
fn the_scale_of_the_start_does_not_matter() {
    let scene = scene(Layout::Mixed, 4, 9, 0.6, 1);
    let problem = problem(&scene);
    let options = RefineOptions::default();
    let expected = refine(&problem, &truth(&scene), &options, None)
        .unwrap()
        .cost;
    for scale in [1e-150, 1e-20, 1e8, 1e20, 1e58] {
        let similarity = nalgebra::Similarity2::new(nalgebra::Vector2::zeros(), 0.0, scale);
        let mut map = truth(&scene).transformed(&similarity);
        let report = refine_map(&problem, &mut map, &options, None).unwrap();
        assert!(
            (report.cost / expected - 1.0).abs() < 1e-9,
            "{scale:e} {report:?}"
        );
    }
    let mut place = truth(&scene);
    for pose in place.poses.iter_mut().flatten() {
        pose.translation.vector.fill(1.0);
    }
    for point in place.landmarks.iter_mut().flatten() {
        point.coords.fill(1.0);
    }
    let error = refine_map(&problem, &mut place, &options, None).unwrap_err();
    assert!(matches!(error, Error::Degenerate { .. }), "{error}");
}

/// Half the sum of squared residuals, landmarks at infinity included.
fn cost_of(found: &bearslam::Reconstruction) -> f64 {
    let residuals = found.residuals.iter();
    residuals.map(|r| r.unwrap().powi(2)).sum::<f64>() / 2.0
}

/// Distance between the landmark and the view that are nearest to each other.
fn smallest_range(map: &Map) -> f64 {
    let landmarks = || map.landmarks.iter().flatten();
    let ranges =
        map.poses.iter().flatten().flat_map(|pose| {
            landmarks().map(|point| (point.coords - pose.translation.vector).norm())
        });
    ranges.fold(f64::INFINITY, f64::min)
}

#[test]
fn a_landmark_that_moves_onto_a_view_gets_there() {
    // Maximum likelihood puts a landmark of these scenes onto a view.
    for (views, landmarks, seed) in [(12, 15, 45), (12, 15, 127), (4, 7, 90), (4, 9, 5)] {
        let scene = scene(Layout::Mixed, views, landmarks, 1.0, seed);
        let problem = problem(&scene);
        let options = RefineOptions::default();
        let found = refine(&problem, &truth(&scene), &options, None).unwrap();
        assert!(found.termination.was_successful(), "{seed}");
        assert!(found.iterations < 60, "{seed} {}", found.iterations);
        assert!(smallest_range(&found.map) < 1e-6, "{seed}");
        assert!((cost_of(&found) / found.cost - 1.0).abs() < 1e-6, "{seed}");
        // Another start leads to the same infimum.
        let other = refine(&problem, &guess(&scene, 0.02), &options, None).unwrap();
        assert!((other.cost / found.cost - 1.0).abs() < 1e-6, "{seed}");
    }
}

/// Positions that are known do not keep a landmark off a view; from there the descent goes on to the minimum.
#[test]
fn a_landmark_moves_onto_a_view_of_known_position() {
    let mut moved = 0;
    for seed in 0..400 {
        let scene = scene(Layout::Mixed, 4, 9, 1.5, seed);
        let known = scene
            .poses
            .iter()
            .enumerate()
            .map(|(view, pose)| PosePrior {
                view,
                pose: *pose,
                noise: Noise::Sigmas([0.05, 0.05, f64::INFINITY]),
            });
        let known: Vec<PosePrior> = known.collect();
        let problem = problem(&scene).with_pose_priors(&known).unwrap();
        let options = RefineOptions::default();
        let found = refine(&problem, &truth(&scene), &options, None).unwrap();
        if smallest_range(&found.map) < 1e-6 {
            moved += 1;
            assert!(found.termination.was_successful(), "{seed}");
            let other = refine(&problem, &guess(&scene, 0.02), &options, None).unwrap();
            assert!(
                (other.cost / found.cost - 1.0).abs() < 1e-6,
                "{seed}: {} {}",
                found.cost,
                other.cost
            );
        }
    }
    assert!(moved > 3, "{moved}");
}

#[test]
fn a_landmark_near_a_view_stays_off_it_where_that_is_better() {
    // Exact bearings: the true landmark is close to a view, and not on it.
    let mut scene = scene(Layout::Mixed, 6, 8, 0.0, 3);
    let home = scene.poses[2].translation.vector;
    scene.landmarks[5] = nalgebra::Point2::from(home + nalgebra::Vector2::new(0.004, 0.002));
    for (i, pose) in scene.poses.iter().enumerate() {
        scene.bearings[i * 8 + 5] = bearslam::bearing_to(pose, &scene.landmarks[5])
            .unwrap()
            .angle();
    }
    let options = RefineOptions::default();
    let report = {
        let mut map = guess(&scene, 0.001);
        let report = refine_map(&problem(&scene), &mut map, &options, None).unwrap();
        assert!(error(&map, &scene) < 1e-8, "{report:?}");
        report
    };
    assert!(report.cost < 1e-12);
}

#[test]
fn the_bearings_of_a_landmark_at_infinity_count() {
    let mut checked = 0;
    for seed in 0..200 {
        let scene = scene(Layout::Enclosed, 4, 9, 1.5, seed);
        let problem = problem(&scene);
        let found = refine(&problem, &truth(&scene), &RefineOptions::default(), None).unwrap();
        let lost = found.undetermined.iter();
        let at_infinity = lost.filter(|one| one.why == bearslam::Why::AtInfinity);
        let at_infinity = at_infinity.count();
        if at_infinity > 0 {
            checked += 1;
            assert!(found.residuals.iter().all(Option::is_some));
            assert!((cost_of(&found) / found.cost - 1.0).abs() < 1e-9);
            let is_on_view = |point: &&nalgebra::Point2<f64>| {
                let mut poses = found.map.poses.iter().flatten();
                poses.any(|pose| (pose.translation.vector - point.coords).norm() < 1e-6)
            };
            let on_views = found.map.landmarks.iter().flatten().filter(is_on_view);
            let directions = at_infinity + on_views.count();
            assert_eq!(found.freedom, 36 + 4 - 12 - 18 + directions);
        }
    }
    assert!(checked > 0);
}
