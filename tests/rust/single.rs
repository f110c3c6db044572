// SPDX-License-Identifier: MIT OR Apache-2.0
//! Single precision is first class.

use crate::common::{LAYOUTS, error, scene};
use bearslam::{Bearing, Method, Problem, SolveOptions, Triple, solve, three_view};

#[test]
fn exact_bearings_give_back_the_scene() {
    let (mut found, mut all) = (0, 0);
    for (views, landmarks) in [(4, 6), (5, 8), (8, 11), (12, 15)] {
        for layout in LAYOUTS {
            for seed in 0..20 {
                let scene = scene(layout, views, landmarks, 0.0, seed);
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "single precision is the subject"
                )]
                let bearings: Vec<f32> = scene.bearings.iter().map(|&b| b as f32).collect();
                let problem = Problem::dense(views, landmarks, &bearings, 1.0).unwrap();
                let result = solve(&problem, &SolveOptions::default(), None);
                all += 1;
                found += usize::from(result.is_ok_and(|r| error(&r.map, &scene) < 1e-3));
            }
        }
    }
    // The rest is ill-conditioned for seven digits; the recovery bench counts them by kind.
    assert!(100 * found >= 97 * all, "{found} of {all}");
}

#[test]
fn three_views_agree_with_double_precision() {
    for seed in 0..20 {
        let scene = scene(LAYOUTS[1], 3, 12, 0.1, seed);
        let at = |i: usize, j: usize| scene.bearings[12 * i + j];
        let double: Vec<Triple<f64>> = (0..12)
            .map(|j| [0, 1, 2].map(|i| Bearing::new(at(i, j))))
            .collect();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "single precision is the subject"
        )]
        let single: Vec<Triple<f32>> = (0..12)
            .map(|j| [0, 1, 2].map(|i| Bearing::new(at(i, j) as f32)))
            .collect();
        let method = Method::Calibrated { reweights: 1 };
        let double = three_view(&double, method).unwrap();
        let single = three_view(&single, method).unwrap();
        if double.near_collinear {
            continue;
        }
        for view in 1..3 {
            let a = double.motions[0].poses[view].rotation.angle();
            let b = f64::from(single.motions[0].poses[view].rotation.angle());
            assert!((a - b).sin().abs() < 1e-2, "{seed} {a} {b}");
        }
    }
}
