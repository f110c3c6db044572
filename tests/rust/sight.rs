// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps under limited sight: components, what is undetermined, both methods.

use crate::common::truth;
use bearslam::{
    Arena, Error, Layout, Pose, Problem, Reconstruction, RefineOptions, Scene, Sighting,
    SolveOptions, Strategy, Subject, Termination, Why, align, bearing_to, initialize, refine,
    simulate, solve,
};
use nalgebra::Point2;

fn with(strategy: Strategy) -> SolveOptions {
    SolveOptions {
        strategy,
        ..SolveOptions::default()
    }
}

/// A loop of views with a range of sight of two metres.
fn trajectory(views: usize, seed: u64) -> (Scene, Problem) {
    let arena = Arena {
        sight: 2.0,
        ..Arena::default()
    };
    let noise = 0.5_f64.to_radians();
    let scene = simulate(Layout::Trajectory, views, 60, noise, seed, arena).unwrap();
    let problem = Problem::dense(views, 60, &scene.bearings, 1.0).unwrap();
    (scene, problem)
}

/// Exact sightings of some landmarks from the views of a range.
fn sightings(
    scene: &Scene,
    views: std::ops::Range<usize>,
    landmarks: std::ops::Range<usize>,
) -> Vec<Sighting> {
    let see = |view: usize, landmark: usize| Sighting {
        view,
        landmark,
        bearing: bearing_to(&scene.poses[view], &scene.landmarks[landmark])
            .unwrap()
            .angle(),
        sigma: 1.0,
    };
    views
        .flat_map(|view| landmarks.clone().map(move |landmark| see(view, landmark)))
        .collect()
}

/// Largest distance of a map from the truth after the similarity that fits its landmarks best.
fn distance(found: &Reconstruction, scene: &Scene) -> f64 {
    let pairs: Vec<(Point2<f64>, Point2<f64>)> = found
        .map
        .landmarks
        .iter()
        .zip(&scene.landmarks)
        .filter_map(|(found, truth)| found.map(|found| (found, *truth)))
        .collect();
    let (source, target): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    let fit = align(&source, &target).unwrap();
    let poses = found.map.poses.iter().zip(&scene.poses);
    let poses = poses.filter_map(|(found, truth): (_, &Pose<f64>)| {
        found.map(|found| (Point2::from(found.translation.vector), truth))
    });
    let views = poses.map(|(found, truth)| {
        (fit.transform_point(&found).coords - truth.translation.vector).norm()
    });
    let landmarks = source.iter().zip(&target);
    let landmarks = landmarks.map(|(found, truth)| (fit.transform_point(found) - truth).norm());
    views.chain(landmarks).fold(0.0, f64::max)
}

#[test]
fn a_trajectory_is_recovered_by_both_methods() {
    for seed in [0, 1] {
        let (scene, problem) = trajectory(40, seed);
        let oracle = refine(&problem, &truth(&scene), &RefineOptions::default(), None).unwrap();
        for strategy in [Strategy::Search, Strategy::Incremental, Strategy::Global] {
            let found = solve(&problem, &with(strategy), None).unwrap();
            assert_eq!(found.undetermined, oracle.undetermined, "{strategy:?}");
            assert!(
                found.cost <= oracle.cost * (1.0 + 1e-5),
                "{strategy:?} {seed}: {} {}",
                found.cost,
                oracle.cost
            );
            assert!(found.components.is_empty());
            // The same bits for the same seed.
            assert_eq!(
                found.map,
                solve(&problem, &with(strategy), None).unwrap().map
            );
            // A start without refinement, which the refinement takes to the same map.
            let start = initialize(&problem, &with(strategy), None).unwrap();
            assert_eq!(start.termination, Termination::NotRefined);
            assert!(start.cost > found.cost);
            assert!(distance(&start, &scene) < 1.0);
        }
    }
}

#[test]
fn many_views_of_everything_are_no_harder() {
    let scene = simulate(Layout::Mixed, 50, 8, 0.005, 3, Arena::default()).unwrap();
    let problem = Problem::dense(50, 8, &scene.bearings, 1.0).unwrap();
    let oracle = refine(&problem, &truth(&scene), &RefineOptions::default(), None).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    assert!(found.cost <= oracle.cost * (1.0 + 1e-5));
    for strategy in [Strategy::Incremental, Strategy::Global] {
        let options = SolveOptions {
            strategy,
            ..SolveOptions::default()
        };
        let found = solve(&problem, &options, None).unwrap();
        assert!(found.cost <= oracle.cost * (1.0 + 1e-5), "{strategy:?}");
    }
}

#[test]
fn separate_components_are_separate_maps() {
    // Views 0 to 5 see landmarks 0 to 8, views 6 to 13 see 9 to 19: nothing connects the two.
    let scene = simulate(Layout::Mixed, 14, 20, 0.0, 7, Arena::default()).unwrap();
    let mut seen = sightings(&scene, 0..6, 0..9);
    seen.extend(sightings(&scene, 6..14, 9..20));
    let problem = Problem::new(14, 20, &seen).unwrap();
    for strategy in [Strategy::Search, Strategy::Incremental, Strategy::Global] {
        let found = solve(&problem, &with(strategy), None).unwrap();
        assert!(
            found.undetermined.is_empty(),
            "{strategy:?} {:?}",
            found.undetermined
        );
        // The larger first.
        assert!(found.map.poses[..6].iter().all(Option::is_none));
        assert!(found.map.poses[6..].iter().all(Option::is_some));
        let [other] = &found.components[..] else {
            panic!("{} components", found.components.len());
        };
        assert!(other.map.poses[..6].iter().all(Option::is_some));
        assert!(other.map.poses[6..].iter().all(Option::is_none));
        assert!(other.undetermined.is_empty());
        for map in [&found, other] {
            assert!(distance(map, &scene) < 1e-6, "{strategy:?}");
            assert!(map.sensitivity.is_finite());
        }
    }
}

#[test]
fn maps_that_share_two_landmarks_become_one() {
    // Landmarks 8 and 9 are seen from both parts: too few to add a view of one part to the other.
    for seed in 0..5 {
        let scene = simulate(Layout::Mixed, 14, 20, 0.0, seed, Arena::default()).unwrap();
        let mut seen = sightings(&scene, 0..6, 0..10);
        seen.extend(sightings(&scene, 6..14, 8..20));
        let problem = Problem::new(14, 20, &seen).unwrap();
        for strategy in [Strategy::Incremental, Strategy::Global] {
            let found = solve(&problem, &with(strategy), None).unwrap();
            assert!(found.components.is_empty(), "{strategy:?} {seed}");
            assert!(found.map.is_complete());
            assert!(distance(&found, &scene) < 1e-6, "{strategy:?} {seed}");
        }
        // One shared landmark leaves scale and rotation free.
        let mut seen = sightings(&scene, 0..6, 0..9);
        seen.extend(sightings(&scene, 6..14, 8..20));
        let problem = Problem::new(14, 20, &seen).unwrap();
        let found = solve(&problem, &with(Strategy::Incremental), None).unwrap();
        assert_eq!(found.components.len(), 1, "{seed}");
        // It has a position in both maps.
        assert!(found.map.landmarks[8].is_some());
        assert!(found.components[0].map.landmarks[8].is_some());
    }
}

/// Two maps that share so many landmarks, and of which single views see single landmarks of the other part: too few to
/// add a view of one to the other.
fn parts(scene: &Scene, shared: usize, across: &[(usize, usize)]) -> Vec<Sighting> {
    let mut seen = sightings(scene, 0..6, 0..8 + shared);
    seen.extend(sightings(scene, 6..14, 8..20));
    for &(view, landmark) in across {
        seen.extend(sightings(scene, view..view + 1, landmark..landmark + 1));
    }
    seen
}

#[test]
fn maps_of_which_views_see_landmarks_of_the_other_become_one() {
    let there = [(0, 12), (1, 13), (3, 15), (5, 18)];
    let back = [(7, 0), (9, 3), (10, 5), (13, 6)];
    let ways: [(usize, &[(usize, usize)]); 6] = [
        (0, &there),
        (0, &back),
        (1, &there[..2]),
        (1, &back[..2]),
        (1, &[there[0], there[2], back[1]]),
        (0, &[there[0], there[1], there[2], there[3], back[2]]),
    ];
    for seed in 0..5 {
        let scene = simulate(Layout::Mixed, 14, 20, 0.0, seed, Arena::default()).unwrap();
        for (shared, across) in ways {
            let problem = Problem::new(14, 20, &parts(&scene, shared, across)).unwrap();
            for problem in [problem.clone(), problem.unoriented()] {
                let found = solve(&problem, &with(Strategy::Incremental), None).unwrap();
                let which = format!("{seed}: {shared} and {across:?} {}", problem.is_oriented());
                assert!(found.components.is_empty(), "{which}");
                assert!(found.map.is_complete(), "{which}");
                assert!(distance(&found, &scene) < 1e-6, "{which}");
            }
        }
    }
}

#[test]
fn what_ties_two_maps_must_agree() {
    let sigma = 0.5_f64.to_radians();
    let across = [(0, 12), (1, 13), (3, 15), (5, 18), (7, 0), (9, 3)];
    let mut kept = 0;
    for seed in 0..5 {
        let scene = simulate(Layout::Mixed, 14, 20, 0.0, seed, Arena::default()).unwrap();
        let mut seen = parts(&scene, 0, &across);
        for one in &mut seen {
            one.sigma = sigma;
        }
        let joined = solve(
            &Problem::new(14, 20, &seen).unwrap(),
            &with(Strategy::Incremental),
            None,
        );
        assert!(joined.unwrap().components.is_empty(), "{seed}");
        // By thirty standard deviations, which a hundred degrees of freedom would still bear.
        let count = seen.len();
        for (one, sign) in seen[count - 6..]
            .iter_mut()
            .zip([1.0, -1.0, 1.0, 1.0, -1.0, -1.0])
        {
            one.bearing += sign * 30.0 * sigma;
        }
        let apart = solve(
            &Problem::new(14, 20, &seen).unwrap(),
            &with(Strategy::Incremental),
            None,
        );
        let apart = apart.unwrap();
        // Unless one map explains it all the same.
        if apart.components.is_empty() {
            assert!(
                2.0 * apart.cost < apart.freedom as f64,
                "{seed} {} {}",
                apart.cost,
                apart.freedom
            );
            continue;
        }
        kept += 1;
        assert_eq!(apart.components.len(), 1, "{seed}");
        assert!(apart.rms < 0.1 * sigma, "{seed}");
    }
    assert!(kept >= 3, "{kept}");
}

#[test]
fn views_that_see_two_landmarks_are_placed_together() {
    // Views 8 and 9 see two landmarks of the map each, and three that only one view of the map sees.
    let across = [
        (8, 0..2),
        (9, 2..4),
        (8, 8..11),
        (9, 8..11),
        (0, 8..9),
        (1, 9..10),
        (2, 10..11),
    ];
    for seed in 0..5 {
        let scene = simulate(Layout::Mixed, 10, 11, 0.0, seed, Arena::default()).unwrap();
        let mut seen = sightings(&scene, 0..8, 0..8);
        for (view, landmarks) in across.clone() {
            seen.extend(sightings(&scene, view..view + 1, landmarks));
        }
        let problem = Problem::new(10, 11, &seen).unwrap();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        assert!(
            found.undetermined.is_empty(),
            "{seed} {:?}",
            found.undetermined
        );
        assert!(distance(&found, &scene) < 1e-6, "{seed}");
    }
}

#[test]
fn what_cannot_be_determined_is_named() {
    let scene = simulate(Layout::Mixed, 12, 22, 0.0, 5, Arena::default()).unwrap();
    // Landmark 19 is seen once, 20 by a view that is itself undetermined, 21 never; view 10 sees two
    // landmarks, view 11 three, of which only two are determined.
    let mut seen = sightings(&scene, 0..10, 0..19);
    seen.extend(sightings(&scene, 3..4, 19..20));
    seen.extend(sightings(&scene, 10..11, 4..6));
    seen.extend(sightings(&scene, 11..12, 2..4));
    seen.extend(sightings(&scene, 11..12, 20..21));
    let problem = Problem::new(12, 22, &seen).unwrap();
    for strategy in [Strategy::Incremental, Strategy::Global] {
        let found = solve(&problem, &with(strategy), None).unwrap();
        assert!(distance(&found, &scene) < 1e-6);
        let named: Vec<(Subject, Why)> = found
            .undetermined
            .iter()
            .map(|undetermined| (undetermined.subject, undetermined.why))
            .collect();
        let few = |got, needed| Why::TooFewSightings { got, needed };
        let cut = |got, needed| Why::NotConnected { got, needed };
        assert_eq!(
            named,
            [
                (Subject::View(10), few(2, 3)),
                (Subject::View(11), cut(2, 3)),
                (Subject::Landmark(19), few(1, 2)),
                (Subject::Landmark(20), few(1, 2)),
                (Subject::Landmark(21), few(0, 2)),
            ],
            "{strategy:?}"
        );
    }
}

#[test]
fn a_view_that_does_not_agree_is_left_out_with_the_reason() {
    let (scene, problem) = trajectory(45, 2);
    // The bearings of one view are arbitrary.
    let wrong = 20;
    let mut bearings = scene.bearings.clone();
    for landmark in 0..60 {
        let bearing = &mut bearings[wrong * 60 + landmark];
        *bearing += (37 * landmark % 60) as f64 * 0.1;
    }
    let spoiled = Problem::dense(45, 60, &bearings, 1.0).unwrap();
    let found = solve(&spoiled, &with(Strategy::Incremental), None).unwrap();
    let why = found
        .undetermined
        .iter()
        .find(|u| u.subject == Subject::View(wrong));
    assert_eq!(why.map(|u| u.why), Some(Why::Misfit));
    // The other views are where they are without it.
    let clean = solve(&problem, &with(Strategy::Incremental), None).unwrap();
    assert!(found.map.poses.iter().flatten().count() == 44);
    assert!(found.rms < 1.5 * clean.rms);
}

#[test]
fn a_problem_that_cannot_start_is_a_typed_error() {
    let scene = simulate(Layout::Mixed, 10, 4, 0.0, 1, Arena::default()).unwrap();
    let problem = Problem::dense(10, 4, &scene.bearings, 1.0).unwrap();
    for strategy in [Strategy::Incremental, Strategy::Global] {
        assert_eq!(
            solve(&problem, &with(strategy), None).unwrap_err(),
            Error::TooFew {
                what: "landmarks seen by the same three views",
                needed: 5,
                got: 4
            }
        );
    }
    let (_, problem) = trajectory(40, 0);
    for strategy in [Strategy::Incremental, Strategy::Global] {
        let mut calls = 0;
        let stopped = solve(
            &problem,
            &with(strategy),
            Some(&mut |_, done, all| {
                calls += 1;
                assert!(done <= all);
                calls < 5
            }),
        );
        assert_eq!(stopped, Err(Error::Interrupted));
        assert_eq!(calls, 5);
    }
}
