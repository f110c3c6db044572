// SPDX-License-Identifier: MIT OR Apache-2.0
//! Properties that hold for every scene; and no input makes the code panic or return nonsense.

use crate::common::{error, problem, scene, triples};
use bearslam::{
    Bearing, Error, Layout, Method, Problem, SolveOptions, Triple, resect, solve, three_view,
    triangulate,
};
use nalgebra::Point2;
use proptest::prelude::*;

const CALIBRATED: Method = Method::Calibrated { reweights: 2 };

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn turning_a_view_turns_its_heading_only(seed in 0_u64..10_000, turn in -3.0..3.0_f64) {
        let scene = scene(Layout::Enclosed, 3, 9, 0.2, seed);
        let before = triples(&scene);
        let after: Vec<Triple<f64>> = before
            .iter()
            .map(|[u, v, w]| [*u, *v * Bearing::new(-turn), *w])
            .collect();
        let (a, b) = (three_view(&before, CALIBRATED)?, three_view(&after, CALIBRATED)?);
        for (a, b) in a.motions.iter().zip(&b.motions) {
            for view in 0..3 {
                let shift = a.poses[view].translation.vector - b.poses[view].translation.vector;
                prop_assert!(shift.norm() < 1e-6);
            }
            let turned = a.poses[1].rotation * Bearing::new(turn);
            prop_assert!(turned.angle_to(&b.poses[1].rotation).abs() < 1e-6);
        }
    }

    #[test]
    fn both_motions_fit_modulo_pi(seed in 0_u64..10_000) {
        let scene = scene(Layout::Mixed, 3, 8, 0.0, seed);
        let triples = triples(&scene);
        for motion in three_view(&triples, CALIBRATED)?.motions {
            for triple in &triples {
                let point = motion.landmark(triple).unwrap();
                for (pose, bearing) in motion.poses.iter().zip(triple) {
                    let seen = pose.inverse_transform_point(&point).coords;
                    let sine = (bearing.re * seen.y - bearing.im * seen.x) / seen.norm();
                    prop_assert!(sine.abs() < 1e-6, "{sine:e}");
                }
            }
        }
    }

    #[test]
    fn order_of_views_and_landmarks_does_not_matter(seed in 0_u64..1_000) {
        let scene = scene(Layout::Mixed, 5, 9, 0.0, seed);
        let turned: Vec<f64> = scene.bearings.iter().rev().copied().collect();
        let found = solve(&Problem::dense(5, 9, &turned, 1.0)?, &SolveOptions::default(), None)?;
        let mut map = found.map;
        map.poses.reverse();
        map.landmarks.reverse();
        prop_assert!(error(&map, &scene) < 1e-7);
    }

    #[test]
    fn any_bearings_give_a_finite_answer_or_an_error(
        angles in prop::collection::vec(prop_oneof![-10.0..10.0_f64, Just(0.0), Just(1e300), Just(5e-324)], 3 * 8)
    ) {
        let triples: Vec<Triple<f64>> = angles
            .chunks_exact(3)
            .map(|a| [0, 1, 2].map(|k| Bearing::new(a[k])))
            .collect();
        for method in [CALIBRATED, Method::Projective] {
            if let Ok(found) = three_view(&triples, method) {
                for motion in found.motions {
                    prop_assert!(motion.cost.is_finite());
                    prop_assert!(motion.poses.iter().all(|p| p.to_homogeneous().iter().all(|v| v.is_finite())));
                }
            }
        }
        let problem = Problem::dense(4, 6, &angles, 1.0);
        let found = problem.and_then(|problem| solve(&problem, &SolveOptions::default(), None));
        if let Ok(found) = found {
            prop_assert!(found.cost.is_finite());
            prop_assert!(found.map.poses.iter().flatten().all(|p| p.to_homogeneous().iter().all(|v| v.is_finite())));
        }
    }

    #[test]
    fn any_places_give_a_finite_answer_or_an_error(
        values in prop::collection::vec(prop_oneof![-1e3..1e3_f64, Just(0.0), Just(1e100), Just(1e-100)], 15)
    ) {
        let rays = values.chunks_exact(4).map(|v| (bearslam::pose(v[0], v[1], v[2]), Bearing::new(v[3])));
        if let Ok(found) = triangulate(rays) {
            prop_assert!(found.point.coords.norm().is_finite());
        }
        let seen = values.chunks_exact(3).map(|v| (Point2::new(v[0], v[1]), Bearing::new(v[2])));
        if let Ok(found) = resect(seen) {
            prop_assert!(found.pose.to_homogeneous().iter().all(|v| v.is_finite()));
        }
    }
}

#[test]
fn tensors_vanish_on_their_landmarks() {
    for seed in 0..50 {
        let scene = scene(Layout::Mixed, 3, 9, 0.0, seed);
        let triples = triples(&scene);
        for method in [Method::Calibrated { reweights: 0 }, Method::Projective] {
            let tensor = bearslam::trifocal_tensor(&triples, method).unwrap();
            assert!((tensor.norm() - 1.0).abs() < 1e-14);
            for triple in &triples {
                assert!(tensor.residual(triple).abs() < 1e-11);
                assert!(tensor.sampson_residual(triple).abs() < 1e-8);
            }
        }
        assert_eq!(problem(&scene).sightings().len(), 27);
    }
}

#[test]
fn the_scale_of_a_tensor_does_not_matter() {
    let triples = triples(&scene(Layout::Mixed, 3, 9, 0.0, 4));
    let tensor = bearslam::trifocal_tensor(&triples, CALIBRATED).unwrap();
    let expected = bearslam::epipoles(&tensor).unwrap();
    for scale in [1e-300, 1e300] {
        let scaled = bearslam::TrifocalTensor {
            entries: tensor
                .entries
                .map(|slice| slice.map(|row| row.map(|t| t * scale))),
        };
        let found = bearslam::epipoles(&scaled).unwrap();
        assert!((found.discriminant / expected.discriminant - 1.0).abs() < 1e-9);
        let moved = found.directions[0][0][1] - expected.directions[0][0][1];
        assert!(moved.norm() < 1e-9);
    }
    for bad in [0.0, f64::NAN, f64::INFINITY] {
        let tensor = bearslam::TrifocalTensor {
            entries: [[[bad; 2]; 2]; 2],
        };
        assert!(bearslam::epipoles(&tensor).is_err());
    }
}

#[test]
fn numbers_that_are_not_finite_are_named() {
    let mut triples = triples(&scene(Layout::Enclosed, 3, 12, 0.1, 4));
    triples[1][0] = Bearing::new(f64::NAN);
    for method in [CALIBRATED, Method::Projective] {
        let error = three_view(&triples, method).unwrap_err();
        assert_eq!(
            error,
            Error::NotFinite {
                what: "bearings",
                index: 1
            }
        );
    }
    let good = (bearslam::pose(1.0, 0.0, 0.0), Bearing::new(0.3));
    for bad in [f64::NAN, f64::INFINITY] {
        let rays = [
            good,
            (bearslam::pose(bad, 0.0, 0.0), Bearing::new(0.5)),
            good,
        ];
        assert!(matches!(
            triangulate(rays),
            Err(Error::NotFinite { index: 1, .. })
        ));
        let seen = [1.0, bad, 2.0, 3.0].map(|x| (Point2::new(x, x * x), Bearing::new(0.1 * x)));
        assert!(matches!(
            resect(seen),
            Err(Error::NotFinite { index: 1, .. })
        ));
    }
}

#[test]
fn headings_along_the_axes_lose_no_digits() {
    for quarter in 0..4 {
        let theta = 7e-9 + f64::from(quarter) * std::f64::consts::FRAC_PI_2;
        let pose = bearslam::pose(0.3, -0.2, theta);
        let seen = [(2.0, 1.0), (-1.0, 3.0), (1.0, -2.0), (-2.0, -1.5)].map(|(x, y)| {
            let point = Point2::new(x, y);
            (point, bearslam::bearing_to(&pose, &point).unwrap())
        });
        let found = resect(seen).unwrap().pose;
        assert!(found.rotation.angle_to(&pose.rotation).abs() < 1e-15);
    }
}

#[test]
fn reweighting_brings_headings_nearer_to_the_truth() {
    let median = |reweights: usize| {
        let mut errors: Vec<f64> = (0..200)
            .map(|seed| {
                let scene = scene(Layout::Mixed, 3, 30, 0.3, seed);
                let found = three_view(&triples(&scene), Method::Calibrated { reweights }).unwrap();
                let truth = scene.poses[0]
                    .rotation
                    .rotation_to(&scene.poses[1].rotation);
                let error = |k: usize| found.motions[k].poses[1].rotation.angle_to(&truth).abs();
                error(0).min(error(1))
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        errors[100]
    };
    let (plain, weighted) = (median(0), median(1));
    assert!(weighted < 0.9 * plain, "{weighted} {plain}");
}

#[test]
fn the_first_of_two_motions_is_nearly_always_the_true_one() {
    let mut first = 0;
    for seed in 0..200 {
        let scene = scene(Layout::Mixed, 3, 12, 0.3, seed);
        let found = three_view(&triples(&scene), CALIBRATED).unwrap();
        let truth = scene.poses[0]
            .rotation
            .rotation_to(&scene.poses[1].rotation);
        let [a, b] = found
            .motions
            .map(|m| m.poses[1].rotation.angle_to(&truth).abs());
        first += usize::from(a <= b);
        // The cost is the sum over all sightings to the returned landmarks.
        let motion = &found.motions[1];
        let mut cost = 0.0;
        for triple in triples(&scene) {
            let point = motion.landmark(&triple).unwrap();
            for (pose, bearing) in motion.poses.iter().zip(&triple) {
                let seen = bearslam::bearing_to(pose, &point).unwrap();
                cost += 0.5 * seen.angle_to(bearing).powi(2);
            }
        }
        assert!(
            (motion.cost / cost - 1.0).abs() < 1e-9,
            "{} {cost}",
            motion.cost
        );
    }
    assert!(first > 180, "{first}");
}

#[test]
fn flat_triangles_of_views_are_flagged() {
    let points = [
        (1.0, 2.0),
        (-2.0, 1.0),
        (0.5, -2.0),
        (3.0, 1.5),
        (-1.0, -1.5),
        (2.0, -3.0),
        (0.0, 4.0),
    ];
    let found = |height: f64, noise: f64| {
        let views = [(0.0, 0.0, 0.3), (1.0, 0.0, 1.0), (2.0, height, -0.4)];
        let mut phase = 0.0_f64;
        let triples: Vec<Triple<f64>> = points
            .iter()
            .map(|&(x, y)| {
                views.map(|(a, b, t)| {
                    phase += 1.3;
                    Bearing::new(f64::atan2(y - b, x - a) - t + noise * (phase * phase).sin())
                })
            })
            .collect();
        three_view(&triples, CALIBRATED).unwrap()
    };
    assert!(!found(1.0, 0.0).near_collinear && !found(1.0, 0.0).flattened);
    assert!(found(0.01, 0.0).near_collinear);
    // For one of the two signs the noise violates the triangle inequality.
    let broken = [found(0.0, 0.02), found(0.0, -0.02)];
    assert!(broken.iter().any(|found| found.flattened));
    for found in broken.iter().filter(|found| found.flattened) {
        assert!(found.near_collinear);
        assert_eq!(found.motions[0].poses, found.motions[1].poses);
    }
}
