// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps from bearings with outliers.

use crate::common::{LAYOUTS, error, scene};
use bearslam::{
    Arena, Error, Layout, Map, Outliers, Problem, Reconstruction, RefineOptions, Scene, Sighting,
    SolveOptions, Subject, Why, refine, refine_map, simulate, solve,
};

const NOISE_DEG: f64 = 0.5;

fn options() -> SolveOptions {
    SolveOptions {
        robust: true,
        ..SolveOptions::default()
    }
}

fn sigma() -> f64 {
    NOISE_DEG.to_radians()
}

fn problem(scene: &Scene) -> Problem {
    let (views, landmarks) = (scene.poses.len(), scene.landmarks.len());
    Problem::dense(views, landmarks, &scene.bearings, sigma()).unwrap()
}

/// Half the sum of squares, each truncated at 9.
fn bounded_cost(problem: &Problem, map: &Map) -> f64 {
    map.residuals(problem)
        .map(|residual| residual.map_or(9.0, |r| (r / sigma()).powi(2).min(9.0)))
        .sum::<f64>()
        / 2.0
}

/// The refinement of the good bearings, started at the truth.
fn from_truth(scene: &Scene, wrong: &[bool]) -> Map {
    let columns = scene.landmarks.len();
    let good: Vec<Sighting> = (0..wrong.len())
        .filter(|&k| !wrong[k])
        .map(|k| Sighting {
            view: k / columns,
            landmark: k % columns,
            bearing: scene.bearings[k],
            sigma: sigma(),
        })
        .collect();
    let problem = Problem::new(scene.poses.len(), columns, &good).unwrap();
    let mut map = scene.map();
    refine_map(&problem, &mut map, &RefineOptions::default(), None).unwrap();
    map
}

/// Properties that every robust result must have.
fn check(problem: &Problem, found: &Reconstruction) {
    let sightings = problem.sightings().len();
    assert_eq!(found.inliers.len(), sightings);
    assert_eq!(found.residuals.len(), sightings);
    let mut cost = 0.0;
    for (&inlier, residual) in found.inliers.iter().zip(&found.residuals) {
        let size = residual.map_or(f64::INFINITY, |r| r.abs() / sigma());
        assert_eq!(inlier, size <= 3.0);
        cost += (size * size).min(9.0) / 2.0;
    }
    assert!((found.cost - cost).abs() < 1e-9 * cost.max(1e-9));
}

#[test]
fn three_outliers_in_ten_are_found() {
    let (mut missed, mut scenes) = (0, 0);
    let (mut right, mut taken, mut good) = (0, 0, 0);
    for layout in LAYOUTS {
        for (views, landmarks) in [(8, 15), (12, 15)] {
            for seed in 0..10 {
                let clean = scene(layout, views, landmarks, NOISE_DEG, seed);
                let (scene, wrong) = clean.contaminate(Outliers::Mixture, 0.3, seed);
                let problem = problem(&scene);
                let found = solve(&problem, &options(), None).unwrap();
                check(&problem, &found);
                let least = bounded_cost(&problem, &from_truth(&scene, &wrong));
                missed += usize::from(found.cost > least * (1.0 + 1e-5));
                scenes += 1;
                for (&inlier, &wrong) in found.inliers.iter().zip(&wrong) {
                    right += usize::from(inlier && !wrong);
                    taken += usize::from(inlier);
                    good += usize::from(!wrong);
                }
            }
        }
    }
    // `cargo bench --bench robust` has the rates over 1000 scenes each.
    assert!(missed <= 1, "{missed} of {scenes}");
    assert!(right * 100 >= taken * 98, "precision {right} of {taken}");
    assert!(right * 100 >= good * 98, "recall {right} of {good}");
}

#[test]
fn good_bearings_give_the_map_of_the_plain_solve() {
    for layout in LAYOUTS {
        for (views, landmarks) in [(4, 9), (8, 11), (12, 15)] {
            for seed in 0..5 {
                let scene = scene(layout, views, landmarks, NOISE_DEG, seed);
                let problem = problem(&scene);
                let plain = solve(&problem, &SolveOptions::default(), None).unwrap();
                let beyond = plain.residuals.iter().flatten();
                if beyond.clone().any(|r| r.abs() > 3.0 * sigma()) {
                    continue;
                }
                let robust = solve(&problem, &options(), None).unwrap();
                check(&problem, &robust);
                // The non-robust map is a fixed point; there may be lower ones with fewer inliers.
                assert!(robust.cost <= plain.cost * (1.0 + 1e-9));
                if robust.inliers.iter().all(|inlier| *inlier) {
                    for (a, b) in plain.map.landmarks.iter().zip(&robust.map.landmarks) {
                        let distance = match (a, b) {
                            (Some(a), Some(b)) => (a - b).norm() / (1.0 + a.coords.norm()),
                            (None, None) => 0.0,
                            _ => f64::INFINITY,
                        };
                        assert!(distance < 1e-6, "{layout:?} {views} {seed}: {distance:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn exact_bearings_among_wrong_ones_give_back_the_scene() {
    for layout in LAYOUTS {
        for seed in 0..5 {
            let clean = scene(layout, 8, 15, 0.0, seed);
            let (scene, wrong) = clean.contaminate(Outliers::Mixture, 0.2, seed);
            let found = solve(&problem(&scene), &options(), None).unwrap();
            // A wrong bearing may be within three sigma by chance, and then bends the map slightly.
            let errors = scene.errors(&found.map).unwrap();
            assert!(errors.position_rms < 0.05, "{layout:?} {seed}: {errors:?}");
            let lost = found
                .inliers
                .iter()
                .zip(&wrong)
                .filter(|(i, w)| !**i && !**w);
            assert_eq!(lost.count(), 0, "{layout:?} {seed}");
        }
    }
}

#[test]
fn each_kind_of_outlier_is_told() {
    let clean = scene(Layout::Mixed, 8, 15, NOISE_DEG, 3);
    for kind in 0..3 {
        let mut scene = clean.clone();
        // Ten bearings of different views and landmarks, or ten pairs.
        let mut wrong = vec![false; scene.bearings.len()];
        for k in 0..10 {
            let (a, b) = ((k % 8) * 15 + k, (k % 8) * 15 + (k + 5) % 15);
            match kind {
                0 => {
                    scene.bearings.swap(a, b);
                    wrong[b] = true;
                }
                1 => scene.bearings[a] += std::f64::consts::PI,
                _ => scene.bearings[a] += 0.5 + 0.4 * k as f64,
            }
            wrong[a] = true;
        }
        let found = solve(&problem(&scene), &options(), None).unwrap();
        for (k, (&inlier, &wrong)) in found.inliers.iter().zip(&wrong).enumerate() {
            assert!(
                !(inlier && wrong),
                "kind {kind}: {k} is wrong and taken for good"
            );
        }
        assert!(error(&found.map, &scene) < 0.05);
    }
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    let (scene, _) =
        scene(Layout::Enclosed, 8, 15, NOISE_DEG, 5).contaminate(Outliers::Mixture, 0.3, 5);
    let first = solve(&problem(&scene), &options(), None).unwrap();
    let second = solve(&problem(&scene), &options(), None).unwrap();
    assert_eq!(first.map, second.map);
    assert_eq!(first.inliers, second.inliers);
}

#[test]
fn limited_sight_and_wrong_bearings() {
    let arena = Arena {
        sight: 3.5,
        ..Arena::default()
    };
    let clean = simulate(Layout::Trajectory, 20, 30, sigma(), 2, arena).unwrap();
    let (scene, wrong) = clean.contaminate(Outliers::Mixture, 0.2, 2);
    let problem = problem(&scene);
    assert!(problem.sightings().len() < 20 * 30);
    let found = solve(&problem, &options(), None).unwrap();
    check(&problem, &found);
    let wrong = scene
        .bearings
        .iter()
        .zip(&wrong)
        .filter(|(b, _)| !b.is_nan());
    let (mut right, mut taken, mut good) = (0, 0, 0);
    for (&inlier, (_, &wrong)) in found.inliers.iter().zip(wrong) {
        right += usize::from(inlier && !wrong);
        taken += usize::from(inlier);
        good += usize::from(!wrong);
    }
    assert!(right * 100 >= taken * 97, "precision {right} of {taken}");
    assert!(right * 100 >= good * 97, "recall {right} of {good}");
}

/// A drive under limited sight with a share of wrong bearings, and which sightings are wrong.
fn drive(views: usize, landmarks: usize, outliers: f64, seed: u64) -> (Problem, Vec<bool>) {
    let arena = Arena {
        sight: if views < 200 { 2.0 } else { 1.5 },
        ..Arena::default()
    };
    let clean = simulate(Layout::Trajectory, views, landmarks, sigma(), seed, arena).unwrap();
    let (scene, wrong) = clean.contaminate(Outliers::Mixture, outliers, seed);
    let problem = problem(&scene);
    let bearings = scene.bearings.iter().zip(wrong);
    let wrong = bearings
        .filter(|(b, _)| !b.is_nan())
        .map(|(_, wrong)| wrong);
    (problem, wrong.collect())
}

#[test]
fn long_drives_are_solved_among_wrong_bearings() {
    for (views, outliers, seed) in [(60, 0.1, 0), (60, 0.2, 1), (200, 0.1, 2), (300, 0.0, 3)] {
        let (problem, wrong) = drive(views, 2 * views / 3, outliers, seed);
        let found = solve(&problem, &options(), None).unwrap();
        check(&problem, &found);
        let told = found.inliers.iter().zip(&wrong);
        let right = told.clone().filter(|(inlier, wrong)| **inlier && !**wrong);
        let good = wrong.iter().filter(|wrong| !**wrong).count();
        let taken = found.inliers.iter().filter(|inlier| **inlier).count();
        let right = right.count();
        assert!(
            right * 1000 >= taken * 985,
            "{views}: precision {right} of {taken}"
        );
        assert!(
            right * 100 >= good * 98,
            "{views}: recall {right} of {good}"
        );
        assert!(found.uncertainty < 0.05, "{views}: {}", found.uncertainty);
    }
}

/// Wrong bearings in a short drive of which each view sees little: no seed leads to the lowest map, but growing parts of
/// it again does.
#[test]
fn parts_that_grew_wrongly_are_grown_again() {
    let mut better = 0;
    for seed in 0..4 {
        let (problem, _) = drive(20, 30, 0.1, seed);
        let found = solve(&problem, &options(), None).unwrap();
        check(&problem, &found);
        let mut once = options();
        once.stages.regrowth.work = 0;
        let grown = solve(&problem, &once, None).map_or(f64::INFINITY, |grown| grown.cost);
        assert!(
            found.cost < grown * (1.0 + 1e-9),
            "{} above {grown}",
            found.cost
        );
        better += usize::from(found.cost < grown * 0.99);
    }
    assert!(better >= 1, "{better}");
}

/// Few sightings tie the parts of these drives, and some of them are wrong: growth from either part does not get past
/// them, but the other part is found from a seed of its own.
#[test]
fn parts_that_few_bearings_tie_are_joined() {
    let mut better = 0;
    for seed in [55, 60] {
        let (problem, _) = drive(20, 30, 0.1, seed);
        let found = solve(&problem, &options(), None).unwrap();
        check(&problem, &found);
        let mut from_the_rest = options();
        from_the_rest.stages.regrowth.apart_percent = 0;
        let grown = solve(&problem, &from_the_rest, None).unwrap();
        assert!(
            found.cost < grown.cost * (1.0 + 1e-9),
            "{seed}: {} of {}",
            found.cost,
            grown.cost
        );
        better += usize::from(found.cost < 0.9 * grown.cost);
    }
    assert!(better > 0);
}

#[test]
fn what_too_few_good_bearings_see_is_undetermined() {
    let mut scene = scene(Layout::Mixed, 8, 15, NOISE_DEG, 3);
    // The last landmark has two sightings, one of which points away.
    for view in 0..8 {
        scene.bearings[view * 15 + 14] = if view < 2 {
            scene.bearings[view * 15 + 14] + std::f64::consts::PI * view as f64
        } else {
            f64::NAN
        };
    }
    let problem = problem(&scene);
    let found = solve(&problem, &options(), None).unwrap();
    check(&problem, &found);
    let last = found
        .undetermined
        .iter()
        .find(|undetermined| undetermined.subject == Subject::Landmark(14));
    assert!(matches!(last.unwrap().why, Why::TooFewInliers { .. }));
    assert!(found.map.landmarks[..14].iter().all(Option::is_some));
}

#[test]
fn random_bearings_end_without_a_panic() {
    let (scene, _) =
        scene(Layout::Mixed, 5, 7, NOISE_DEG, 1).contaminate(Outliers::Mixture, 1.0, 1);
    if let Ok(found) = solve(&problem(&scene), &options(), None) {
        check(&problem(&scene), &found);
    }
}

#[test]
fn few_landmarks_and_few_views() {
    for (views, landmarks) in [(3, 5), (3, 9), (4, 4), (5, 4), (4, 6)] {
        for seed in 0..5 {
            let scene = scene(Layout::Mixed, views, landmarks, 0.1, seed);
            if let Ok(found) = solve(&problem(&scene), &options(), None) {
                check(&problem(&scene), &found);
            }
        }
    }
    // A third view shares too few landmarks.
    let few = Problem::dense(3, 4, &[0.1; 12], 0.01).unwrap();
    assert!(matches!(
        solve(&few, &options(), None),
        Err(Error::TooFew { .. })
    ));
}

#[test]
fn a_sigma_that_tells_nothing_is_an_error() {
    let scene = scene(Layout::Mixed, 5, 9, NOISE_DEG, 1);
    let coarse = Problem::dense(5, 9, &scene.bearings, 1.0).unwrap();
    let error = solve(&coarse, &options(), None).unwrap_err();
    assert!(matches!(error, Error::SigmaTooLarge { index: 0, value, .. } if value == 1.0));
    assert!(format!("{error}").contains("standard deviation"));
}

#[test]
fn progress_can_stop_it() {
    let (scene, _) =
        scene(Layout::Mixed, 8, 15, NOISE_DEG, 1).contaminate(Outliers::Mixture, 0.3, 1);
    for stop in [1, 4, 8] {
        let mut calls = 0;
        let mut watch = |_: &'static str, _, _| {
            calls += 1;
            calls < stop
        };
        let stopped = solve(&problem(&scene), &options(), Some(&mut watch));
        assert_eq!(stopped.unwrap_err(), Error::Interrupted);
    }
}

#[test]
fn contamination_is_what_it_says() {
    let clean = scene(Layout::Mixed, 12, 15, NOISE_DEG, 1);
    let (dirty, wrong) = clean.contaminate(Outliers::Mixture, 0.3, 7);
    let count = |kind: fn(f64) -> bool| {
        let pairs = clean.bearings.iter().zip(&dirty.bearings);
        pairs
            .filter(|(a, b)| a != b && kind((**a - **b).abs()))
            .count()
    };
    assert_eq!(wrong.iter().filter(|wrong| **wrong).count(), 54);
    let turned = count(|d| (d - std::f64::consts::PI).abs() < 1e-12);
    assert_eq!(turned, 18);
    // Swapped bearings: the same numbers in other places of the row.
    let swapped = (0..180)
        .filter(|&k| wrong[k] && clean.bearings[k / 15 * 15..][..15].contains(&dirty.bearings[k]))
        .count();
    assert_eq!(swapped, 18);
    assert_eq!(clean.contaminate(Outliers::Mixture, 0.3, 7), (dirty, wrong));
    assert_eq!(clean.contaminate(Outliers::Mixture, 0.0, 7).0, clean);
}

#[test]
fn outliers_are_of_the_kind_and_number_asked_for() {
    let clean = scene(Layout::Trajectory, 12, 15, NOISE_DEG, 1);
    let partial = {
        let arena = Arena {
            sight: 2.5,
            ..Arena::default()
        };
        simulate(Layout::Trajectory, 12, 15, 0.01, 3, arena).unwrap()
    };
    for scene in [clean, partial] {
        let seen = scene.bearings.iter().filter(|b| b.is_finite()).count();
        for kind in Outliers::ALL {
            assert_eq!(scene.contaminate(kind, 0.0, 7).1, [false; 180]);
            for percent in [3, 20, 40, 100] {
                let share = percent as f64 / 100.0;
                let (dirty, wrong) = scene.contaminate(kind, share, 7);
                assert_eq!(
                    format!("{:?}", scene.contaminate(kind, share, 7)),
                    format!("{:?}", (&dirty, &wrong))
                );
                let count = wrong.iter().filter(|wrong| **wrong).count();
                let asked = (percent * seen + 50) / 100;
                let changed = |k: usize| scene.bearings[k].to_bits() != dirty.bearings[k].to_bits();
                if kind == Outliers::Merged {
                    // The last pair has twelve sightings or fewer, at most half of them wrong.
                    assert!(count < asked + 6);
                    let left =
                        (0..15).filter(|j| (0..12).any(|i| dirty.bearings[i * 15 + j].is_finite()));
                    assert!(count >= asked || left.count() == 8);
                } else {
                    assert!(count == asked || count + 1 == asked && kind != Outliers::Uniform);
                    assert!((0..180).all(|k| changed(k) == wrong[k]));
                }
            }
        }
    }
}

#[test]
fn exchanged_identities_are_derangements_within_views() {
    let clean = scene(Layout::Mixed, 12, 15, NOISE_DEG, 1);
    // Two outliers are in one view; of three none is alone.
    for (all, most) in [(2, 1), (3, 1), (72, 12), (180, 12)] {
        let share = all as f64 / 180.0;
        let (dirty, wrong) = clean.contaminate(Outliers::Exchanged, share, 5);
        let mut views = 0;
        for view in 0..12 {
            let row = view * 15..(view + 1) * 15;
            let sorted = |bearings: &[f64]| {
                let mut row = bearings[row.clone()].to_vec();
                row.sort_by(f64::total_cmp);
                row
            };
            assert_eq!(sorted(&dirty.bearings), sorted(&clean.bearings));
            let count = wrong[row.clone()].iter().filter(|wrong| **wrong).count();
            assert_ne!(count, 1);
            views += usize::from(count > 0);
        }
        assert!(views <= most && views > 0);
        assert_eq!(wrong.iter().filter(|w| **w).count(), all);
    }
}

#[test]
fn merged_landmarks_share_one_identity() {
    let clean = scene(Layout::Mixed, 12, 15, NOISE_DEG, 1);
    let (dirty, wrong) = clean.contaminate(Outliers::Merged, 0.01, 5);
    let columns = |is: &dyn Fn(usize) -> bool| -> Vec<usize> {
        (0..15)
            .filter(|&j| (0..12).any(|i| is(i * 15 + j)))
            .collect()
    };
    // One pair: one landmark is left without a sighting, its bearings are the outliers of the other.
    let (lost, named) = (
        columns(&|k| dirty.bearings[k].is_nan()),
        columns(&|k| wrong[k]),
    );
    let ([lost], [named]) = (&lost[..], &named[..]) else {
        panic!("{lost:?}, {named:?}");
    };
    let mut of_lost = 0;
    for view in 0..12 {
        let [lost, named] = [lost, named].map(|j| view * 15 + j);
        assert!(dirty.bearings[lost].is_nan());
        let from = if wrong[named] { lost } else { named };
        assert_eq!(dirty.bearings[named], clean.bearings[from]);
        of_lost += usize::from(wrong[named]);
    }
    assert!((1..=6).contains(&of_lost));
    let others = (0..180).filter(|k| ![*lost, *named].contains(&(k % 15)));
    assert!(
        others
            .clone()
            .all(|k| dirty.bearings[k] == clean.bearings[k] && !wrong[k])
    );
}

#[test]
fn random_bearings_have_no_consensus() {
    for seed in 0..4 {
        let exact = scene(Layout::Mixed, 8, 12, 0.5, seed);
        let (noise, _) = exact.contaminate(Outliers::Mixture, 1.0, seed);
        let error = solve(&problem(&noise), &options(), None).unwrap_err();
        assert!(
            matches!(error, Error::NoConsensus { .. } | Error::Degenerate { .. }),
            "{error}"
        );
    }
}

/// Under limited sight the map grows view by view, and what it agrees with by chance is no map either.
/// A search without success takes a time that hardly grows with the views.
#[test]
fn many_views_are_searched_in_fewer_rounds() {
    let rounds_of = |views: usize| {
        let scene = simulate(Layout::Mixed, views, 8, sigma(), 3, Arena::default()).unwrap();
        let mut rounds = 0;
        let mut progress = |stage: &str, _: usize, total: usize| {
            if stage == "search" {
                rounds = total;
            }
            rounds == 0
        };
        let stopped = solve(&problem(&scene), &options(), Some(&mut progress));
        assert_eq!(stopped.unwrap_err(), Error::Interrupted);
        rounds
    };
    assert_eq!([5, 20, 40].map(rounds_of), [24, 24, 12]);
}

#[test]
fn random_bearings_under_limited_sight_have_no_consensus() {
    let arena = Arena {
        sight: 3.5,
        ..Arena::default()
    };
    // A scene in which growth reaches enough for a map.
    let exact = simulate(Layout::Trajectory, 20, 30, sigma(), 2, arena).unwrap();
    let (noise, _) = exact.contaminate(Outliers::Mixture, 1.0, 2);
    let error = solve(&problem(&noise), &options(), None).unwrap_err();
    assert!(matches!(error, Error::NoConsensus { .. }), "{error}");
}

/// Whether the inliers are the true ones, except for a few of either kind.
fn tells(found: &[bool], truth: &[bool]) -> bool {
    let wrong = found.iter().zip(truth).filter(|(a, b)| a != b).count();
    wrong * 50 <= truth.len()
}

#[test]
fn outliers_among_odometry() {
    let noise = 0.5_f64.to_radians();
    let arena = Arena {
        sight: 2.5,
        ..Arena::default()
    };
    for seed in 0..5 {
        let exact = simulate(Layout::Trajectory, 30, 25, noise, seed, arena).unwrap();
        let (scene, wrong) = exact.contaminate(Outliers::Mixture, 0.2, seed);
        let odometry = exact.odometry([0.02, 0.02, 0.01], seed).unwrap();
        let problem = Problem::dense(30, 25, &scene.bearings, noise).unwrap();
        let problem = problem.with_odometry(&odometry).unwrap();
        let found = solve(&problem, &options(), None).unwrap();
        let seen: Vec<bool> = scene
            .bearings
            .iter()
            .zip(&wrong)
            .filter(|(bearing, _)| !bearing.is_nan())
            .map(|(_, wrong)| !wrong)
            .collect();
        assert!(tells(&found.inliers, &seen), "{seed}");
        assert!(
            exact.errors(&found.map).unwrap().position_rms < 0.2,
            "{seed}"
        );
    }
}

/// Three robots with only three bearings per view, one in ten wrong, and sigmas stated too large: bearings alone do
/// not determine a map, one outlier spoils a triangulation, and the cost is not what the stated sigmas predict.
#[test]
fn robots_that_see_little_at_a_time() {
    let (views, landmarks, noise) = (240, 30, 0.4_f64.to_radians());
    let arena = Arena {
        sight: 2.0,
        ..Arena::default()
    };
    for seed in 0..4 {
        let mut exact = simulate(Layout::Trajectory, views, landmarks, noise, seed, arena).unwrap();
        for view in 0..views {
            let seen = (0..landmarks).map(|k| view * landmarks + (k + 7 * view) % landmarks);
            let seen: Vec<usize> = seen.filter(|&k| !exact.bearings[k].is_nan()).collect();
            for &k in seen.iter().skip(3) {
                exact.bearings[k] = f64::NAN;
            }
        }
        let odometry = exact.odometry([0.02, 0.02, 0.02], seed).unwrap();
        let apart = odometry.into_iter().filter(|o| o.end % 80 != 0);
        let apart: Vec<_> = apart.collect();
        let with_odometry = |bearings: &[f64]| {
            let problem = Problem::dense(views, landmarks, bearings, 1.5 * noise).unwrap();
            problem.with_odometry(&apart).unwrap()
        };
        let (scene, wrong) = exact.contaminate(Outliers::Mixture, 0.1, seed);
        let pairs = scene.bearings.iter().zip(&wrong);
        let good: Vec<f64> = pairs
            .map(|(bearing, wrong)| if *wrong { f64::NAN } else { *bearing })
            .collect();
        let best = refine(&with_odometry(&good), &exact.map(), &options().refine, None).unwrap();

        let mut searched = false;
        let mut watch = |stage: &'static str, _, _| {
            searched |= stage == "search";
            true
        };
        let problem = with_odometry(&scene.bearings);
        let found = solve(&problem, &options(), Some(&mut watch)).unwrap();
        assert!(!searched, "{seed}");
        assert_eq!(found.undetermined, best.undetermined, "{seed}");
        // Odometry determines the scale: no part of the map is misplaced.
        let [error, least] = [&found, &best].map(|found| exact.errors(&found.map).unwrap());
        assert!(
            error.position_rms < 1.5 * least.position_rms,
            "{seed}: {} {}",
            error.position_rms,
            least.position_rms
        );
        let seen = (0..wrong.len()).filter(|&k| !scene.bearings[k].is_nan());
        let seen: Vec<bool> = seen.map(|k| !wrong[k]).collect();
        assert!(tells(&found.inliers, &seen), "{seed}");
    }
}

#[test]
fn outliers_among_lines() {
    let noise = 0.2_f64.to_radians();
    for seed in 0..5 {
        let exact = scene(Layout::Mixed, 10, 15, 0.2, seed);
        let (scene, _) = exact.contaminate(Outliers::Mixture, 0.15, seed);
        let problem = Problem::dense(10, 15, &scene.bearings, noise)
            .unwrap()
            .unoriented();
        // A bearing off by pi is an inlier modulo pi.
        let good: Vec<bool> = exact
            .bearings
            .iter()
            .zip(&scene.bearings)
            .map(|(a, b)| (a - b).sin().abs() < 1e-9)
            .collect();
        let found = solve(&problem, &options(), None).unwrap();
        assert!(tells(&found.inliers, &good), "{seed}");
        assert!(
            exact.errors(&found.map).unwrap().position_rms < 0.3,
            "{seed}"
        );
    }
}
