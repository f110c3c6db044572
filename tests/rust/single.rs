// SPDX-License-Identifier: MIT OR Apache-2.0
//! The kernels in single precision.

use crate::common::{LAYOUTS, scene};
use bearslam::{Bearing, Method, Pose, Real, Scene, Triple, resect, three_view, triangulate};
use nalgebra::Point2;

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

/// Triangulation of landmark 0, resection of view 0, the third view from five landmarks and from all.
fn closed_forms<T: Real>(scene: &Scene, bearings: &[f64]) -> [Vec<[f64; 2]>; 4] {
    let count = scene.landmarks.len();
    let bearing = |i: usize, j: usize| Bearing::new(bearings[count * i + j]).cast::<T>();
    let pose = |i: usize| -> Pose<T> { scene.poses[i].cast() };
    let landmark =
        |j: usize| Point2::new(T::lit(scene.landmarks[j].x), T::lit(scene.landmarks[j].y));
    let place = |pose: &Pose<T>| [pose.translation.x, pose.translation.y].map(Real::as_f64);
    let triples: Vec<Triple<T>> = (0..count)
        .map(|j| [0, 1, 2].map(|i| bearing(i, j)))
        .collect();
    let third = |triples: &[Triple<T>], reweights| {
        let found = three_view(triples, Method::Calibrated { reweights }).unwrap();
        found.motions.map(|motion| place(&motion.poses[2])).to_vec()
    };
    let point = triangulate((0..3).map(|i| (pose(i), bearing(i, 0))))
        .unwrap()
        .point;
    let view = resect((0..count).map(|j| (landmark(j), bearing(0, j))))
        .unwrap()
        .pose;
    [
        vec![[point.x, point.y].map(Real::as_f64)],
        vec![place(&view)],
        third(&triples[..5], 0),
        third(&triples, 1),
    ]
}

#[test]
fn rounding_is_small_beside_noise() {
    let mut ratios: [Vec<f64>; 4] = Default::default();
    for seed in 0..100 {
        let layout = LAYOUTS[usize::from(seed % 2 == 1)];
        let exact = scene(layout, 3, 12, 0.0, seed);
        let noisy = scene(layout, 3, 12, 0.1, seed);
        let same = exact.landmarks == noisy.landmarks && exact.poses == noisy.poses;
        assert!(same, "the noise is drawn last");
        let truth = closed_forms::<f64>(&exact, &exact.bearings);
        let double = closed_forms::<f64>(&noisy, &noisy.bearings);
        let single = closed_forms::<f32>(&noisy, &noisy.bearings);
        for (k, ratios) in ratios.iter_mut().enumerate() {
            let apart = |a: &[[f64; 2]], b: &[[f64; 2]]| {
                let distances = a
                    .iter()
                    .flat_map(|a| b.iter().map(|b| (a[0] - b[0]).hypot(a[1] - b[1])));
                distances.fold(f64::INFINITY, f64::min)
            };
            ratios.push(apart(&single[k], &double[k]) / apart(&double[k], &truth[k]));
        }
    }
    for mut ratios in ratios {
        ratios.sort_by(f64::total_cmp);
        assert!(
            ratios[50] < 1e-3 && ratios[95] < 1e-2,
            "{} {}",
            ratios[50],
            ratios[95]
        );
        assert!(ratios[50] > 1e-7, "single precision was not used");
    }
}
