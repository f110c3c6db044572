// SPDX-License-Identifier: MIT OR Apache-2.0
//! The C interface reports invalid arguments, and gives the same answers as the crate.
#![allow(unsafe_code, reason = "calls as C makes them")]

use bearslam::capi::*;
use bearslam::{Bearing, Method, bearing_to, pose, three_view};
use core::ptr::{null, null_mut};
use nalgebra::Point2;
use std::ffi::CStr;

const VIEWS: usize = 3;
const POINTS: usize = 7;

/// Bearings of three views, by view, and the true poses and landmarks.
fn scene() -> ([f64; VIEWS * POINTS], [f64; 3 * VIEWS], [f64; 2 * POINTS]) {
    let poses = [0.0, 0.0, 0.0, 4.0, -0.5, 0.7, 1.5, 4.0, -0.4];
    let landmarks = [
        1.5, 1.5, 3.0, 3.0, -1.5, 2.0, 5.5, 2.0, 2.0, -2.0, -1.0, -1.0, 6.0, 1.0,
    ];
    let mut bearings = [0.0; VIEWS * POINTS];
    for (k, angle) in bearings.iter_mut().enumerate() {
        let [x, y, heading] = poses.as_chunks().0[k / POINTS];
        let [a, b] = landmarks.as_chunks().0[k % POINTS];
        let exact = bearing_to(&pose(x, y, heading), &Point2::new(a, b)).unwrap();
        *angle = exact.angle() + 1e-3 * (37.0 * k as f64).sin();
    }
    (bearings, poses, landmarks)
}

struct ThreeViews {
    status: BearslamStatus,
    poses: [f64; 18],
    landmarks: Vec<f64>,
    inconsistent: [usize; 2],
    solutions: usize,
}

fn call_three_view(bearings: &[f64], method: i32, reweights: usize) -> ThreeViews {
    let count = bearings.len() / 3;
    let mut found = ThreeViews {
        status: BearslamStatus::Ok,
        poses: [7.0; 18],
        landmarks: vec![7.0; 4 * count],
        inconsistent: [7; 2],
        solutions: 7,
    };
    // SAFETY: arrays of the sizes that the call asks for.
    found.status = unsafe {
        bearslam_three_view(
            bearings.as_ptr(),
            count,
            method,
            reweights,
            found.poses.as_mut_ptr(),
            found.landmarks.as_mut_ptr(),
            found.inconsistent.as_mut_ptr(),
            &raw mut found.solutions,
        )
    };
    if !matches!(found.status, BearslamStatus::Ok) {
        assert_eq!((found.poses, found.solutions), ([7.0; 18], 7));
        assert!(found.landmarks.iter().all(|number| *number == 7.0));
    }
    found
}

#[test]
fn three_views_are_those_of_the_crate() {
    let (mut bearings, ..) = scene();
    // The first landmark is hidden from view 1: only the others are found, at the same places.
    bearings[POINTS] = f64::NAN;
    let found = call_three_view(&bearings, 0, 1);
    assert_eq!(found.status, BearslamStatus::Ok);
    let triples: Vec<_> = (1..POINTS)
        .map(|j| [0, 1, 2].map(|i| Bearing::new(bearings[POINTS * i + j])))
        .collect();
    let expected = three_view(&triples, Method::Calibrated { reweights: 1 }).unwrap();
    assert_eq!(found.solutions, 2);
    for k in 0..2 {
        let motion = &expected.motions[k];
        assert_eq!(found.inconsistent[k], motion.inconsistent);
        for i in 0..3 {
            let p = &motion.poses[i];
            let expected = [p.translation.x, p.translation.y, p.rotation.angle()];
            assert_eq!(found.poses[9 * k + 3 * i..][..3], expected);
        }
        let landmarks = &found.landmarks[2 * POINTS * k..][..2 * POINTS];
        assert!(landmarks[..2].iter().all(|number| number.is_nan()));
        for (j, triple) in triples.iter().enumerate() {
            let point = motion.landmark(triple).unwrap();
            assert_eq!(landmarks[2 * j + 2..][..2], [point.x, point.y]);
        }
    }
}

#[test]
fn three_views_tell_what_is_wrong() {
    let (bearings, ..) = scene();
    let told =
        |bearings: &[f64], method, reweights| call_three_view(bearings, method, reweights).status;
    assert_eq!(told(&bearings, 1, 0), BearslamStatus::Ok);
    assert_eq!(told(&bearings, 2, 0), BearslamStatus::UnknownMethod);
    assert_eq!(told(&bearings, -1, 0), BearslamStatus::UnknownMethod);
    assert_eq!(told(&bearings, 0, usize::MAX), BearslamStatus::TooLarge);
    assert_eq!(told(&[0.5; 3 * 65], 0, 0), BearslamStatus::TooLarge);
    assert_eq!(told(&[0.5; 3 * 64], 0, 0), BearslamStatus::Degenerate);
    assert_eq!(told(&[0.5; 3 * 4], 0, 0), BearslamStatus::TooFew);
    assert_eq!(told(&[], 0, 0), BearslamStatus::TooFew);
    assert_eq!(told(&[f64::NAN; 30], 0, 0), BearslamStatus::TooFew);
    let mut infinite = bearings;
    infinite[3] = f64::INFINITY;
    assert_eq!(told(&infinite, 0, 0), BearslamStatus::NotFinite);
}

#[test]
fn pointers_are_checked() {
    let (bearings, poses, landmarks) = scene();
    let mut place = [7.0; 3];
    // SAFETY: pointers that a check must reject, and sizes larger than any memory.
    unsafe {
        let null_pose = bearslam_triangulate(null(), bearings.as_ptr(), 3, place.as_mut_ptr());
        assert_eq!(null_pose, BearslamStatus::NullPointer);
        let null_place = bearslam_resect(landmarks.as_ptr(), bearings.as_ptr(), POINTS, null_mut());
        assert_eq!(null_place, BearslamStatus::NullPointer);
        let askew = poses.as_ptr().byte_add(1);
        let askew = bearslam_triangulate(askew, bearings.as_ptr(), 1, place.as_mut_ptr());
        assert_eq!(askew, BearslamStatus::Misaligned);
        for count in [usize::MAX, usize::MAX / 3 + 1, usize::MAX / 24] {
            let (poses, bearings) = (poses.as_ptr(), bearings.as_ptr());
            let large = bearslam_triangulate(poses, bearings, count, place.as_mut_ptr());
            assert_eq!(large, BearslamStatus::TooLarge);
        }
    }
    assert_eq!(place, [7.0; 3]);
}

#[test]
fn a_point_behind_a_view_has_a_status_of_its_own() {
    // Rays that diverge; their lines intersect behind both views. With the second bearing beyond the first they meet.
    let poses = [0.0, 0.0, 0.0, 10.0, 0.0, 0.0];
    let poses32 = [0.0_f32, 0.0, 0.0, 10.0, 0.0, 0.0];
    let (mut point, mut point32) = ([7.0; 2], [7.0_f32; 2]);
    let mut call = |second: f64, second32: f32| {
        // SAFETY: arrays of the sizes that the calls ask for.
        let told = unsafe {
            [
                bearslam_triangulate(
                    poses.as_ptr(),
                    [0.5, second].as_ptr(),
                    2,
                    point.as_mut_ptr(),
                ),
                bearslam_triangulate_f32(
                    poses32.as_ptr(),
                    [0.5, second32].as_ptr(),
                    2,
                    point32.as_mut_ptr(),
                ),
            ]
        };
        (told, point, point32)
    };
    let behind = [BearslamStatus::Behind; 2];
    assert_eq!(call(0.2, 0.2), (behind, [7.0; 2], [7.0; 2]));
    let (told, point, point32) = call(2.0, 2.0);
    assert_eq!(told, [BearslamStatus::Ok; 2]);
    assert!(point[1] > 0.0 && point32[1] > 0.0);
    // One of three: the third view looks away from where the others see the landmark.
    let (mut place, mixed) = ([7.0; 2], [0.5, 2.0, 0.63 - core::f64::consts::PI]);
    let three = [0.0, 0.0, 0.0, 10.0, 0.0, 0.0, 2.0, 0.0, 0.0];
    // SAFETY: arrays of the sizes that the call asks for.
    let told =
        unsafe { bearslam_triangulate(three.as_ptr(), mixed.as_ptr(), 3, place.as_mut_ptr()) };
    assert_eq!((told, place), (BearslamStatus::Behind, [7.0; 2]));
}

#[test]
fn rays_and_landmarks_in_both_precisions() {
    let (bearings, poses, landmarks) = scene();
    let column = [bearings[0], bearings[POINTS], bearings[2 * POINTS]];
    let narrow = |numbers: &[f64]| -> Vec<f32> {
        #[allow(clippy::cast_possible_truncation, reason = "single precision is meant")]
        numbers.iter().map(|number| *number as f32).collect()
    };
    let (mut point, mut point32) = ([0.0; 2], [0.0_f32; 2]);
    let (mut seat, mut seat32) = ([0.0; 3], [0.0_f32; 3]);
    // SAFETY: arrays of the sizes that the calls ask for.
    unsafe {
        let status =
            bearslam_triangulate(poses.as_ptr(), column.as_ptr(), VIEWS, point.as_mut_ptr());
        assert_eq!(status, BearslamStatus::Ok);
        let (p, b) = (narrow(&poses), narrow(&column));
        let status = bearslam_triangulate_f32(p.as_ptr(), b.as_ptr(), VIEWS, point32.as_mut_ptr());
        assert_eq!(status, BearslamStatus::Ok);
        let status = bearslam_resect(
            landmarks.as_ptr(),
            bearings[POINTS..].as_ptr(),
            POINTS,
            seat.as_mut_ptr(),
        );
        assert_eq!(status, BearslamStatus::Ok);
        let (l, b) = (narrow(&landmarks), narrow(&bearings[POINTS..]));
        let status = bearslam_resect_f32(l.as_ptr(), b.as_ptr(), POINTS, seat32.as_mut_ptr());
        assert_eq!(status, BearslamStatus::Ok);
    }
    for (found, truth) in point
        .iter()
        .zip(&landmarks)
        .chain(seat.iter().zip(&poses[3..]))
    {
        assert!((found - truth).abs() < 0.02);
    }
    for (single, double) in point32.iter().zip(&point).chain(seat32.iter().zip(&seat)) {
        assert!((f64::from(*single) - double).abs() < 1e-5);
    }
}

/// The result of a refinement of `views` x `points`: status, map, cost and iterations.
struct Refined {
    status: BearslamStatus,
    poses: Vec<f64>,
    landmarks: Vec<f64>,
    cost: f64,
    iterations: usize,
}

/// Refines from the truth, in `bytes` bytes of garbage that start `off` bytes beyond an aligned address.
fn call_refine(
    views: usize,
    points: usize,
    sigma: f64,
    steps: usize,
    (off, bytes): (usize, usize),
) -> Refined {
    let (bearings, poses, landmarks) = scene();
    let mut seen = vec![f64::NAN; views * points];
    for (k, angle) in bearings.iter().enumerate() {
        if k / POINTS < views && k % POINTS < points {
            seen[points * (k / POINTS) + k % POINTS] = *angle;
        }
    }
    let mut found = Refined {
        status: BearslamStatus::Ok,
        poses: poses
            .iter()
            .copied()
            .chain([f64::NAN; 60])
            .take(3 * views)
            .collect(),
        landmarks: landmarks
            .iter()
            .copied()
            .chain([f64::NAN; 60])
            .take(2 * points)
            .collect(),
        cost: 7.0,
        iterations: 7,
    };
    let mut memory = vec![u64::MAX; bytes / 8 + 2];
    // SAFETY: arrays of the sizes that the call asks for.
    found.status = unsafe {
        bearslam_refine(
            seen.as_ptr(),
            sigma,
            views,
            points,
            found.poses.as_mut_ptr(),
            found.landmarks.as_mut_ptr(),
            steps,
            0.0,
            &raw mut found.cost,
            &raw mut found.iterations,
            memory.as_mut_ptr().byte_add(off).cast(),
            bytes,
        )
    };
    // Nothing outside the memory has been written.
    let bytes_kept = bytes_of(&memory)
        .skip(off + bytes)
        .all(|byte| byte == u8::MAX);
    assert!(bytes_kept);
    found
}

fn bytes_of(words: &[u64]) -> impl Iterator<Item = u8> {
    words.iter().flat_map(|word| word.to_ne_bytes())
}

#[test]
fn refinement_is_the_same_in_both_rooms() {
    let small = call_refine(3, 7, 1e-3, 30, (0, bearslam_refine_size(3, 7)));
    let large = call_refine(16, 32, 1e-3, 30, (0, bearslam_refine_size(16, 32)));
    for found in [&small, &large] {
        assert_eq!(found.status, BearslamStatus::Ok);
        assert!(found.cost > 0.0 && found.cost < 10.0 && found.iterations > 1);
        assert_eq!(found.poses[..3], [0.0; 3]);
        let reach: f64 = found.poses[3..9]
            .as_chunks::<3>()
            .0
            .iter()
            .map(|[x, y, _]| x * x + y * y)
            .sum();
        assert!((reach / 2.0 - 1.0).abs() < 1e-12);
        assert!((found.poses[5] - 0.7).abs() < 0.01);
    }
    let pairs = small.poses.iter().chain(&small.landmarks);
    let others = large.poses[..9].iter().chain(&large.landmarks[..14]);
    assert!(pairs.zip(others).all(|(a, b)| (a - b).abs() < 1e-9));
    // Undetermined views and landmarks stay undetermined.
    assert!(
        large.poses[9..]
            .iter()
            .chain(&large.landmarks[14..])
            .all(|number| number.is_nan())
    );
}

#[test]
fn refinement_tells_what_is_wrong() {
    let size = bearslam_refine_size(3, 7);
    let told = |views, points, sigma, memory| call_refine(views, points, sigma, 30, memory).status;
    assert_eq!(told(3, 7, 0.0, (0, size)), BearslamStatus::NotPositive);
    assert_eq!(told(3, 7, f64::NAN, (0, size)), BearslamStatus::NotPositive);
    assert_eq!(
        told(3, 7, 1e-3, (0, size - 1)),
        BearslamStatus::MemoryTooSmall
    );
    assert_eq!(told(3, 7, 1e-3, (4, size)), BearslamStatus::Misaligned);
    assert_eq!(
        told(16, 32, 1e-3, (0, size)),
        BearslamStatus::MemoryTooSmall
    );
    assert_eq!(told(17, 7, 1e-3, (0, 1 << 20)), BearslamStatus::TooLarge);
    assert_eq!(told(3, 33, 1e-3, (0, 1 << 20)), BearslamStatus::TooLarge);
    assert_eq!(told(3, 2, 1e-3, (0, size)), BearslamStatus::TooFew);
    assert_eq!(told(0, 0, 1e-3, (0, size)), BearslamStatus::TooFew);
    assert_eq!(bearslam_refine_size(17, 1), 0);
    assert_eq!(bearslam_refine_size_f32(1, 33), 0);
    assert!(bearslam_refine_size_f32(16, 32) < bearslam_refine_size(16, 32));
    let stopped = call_refine(3, 7, 1e-3, 1, (0, size));
    assert_eq!(stopped.status, BearslamStatus::NotConverged);
    assert_eq!(stopped.iterations, 1);
    assert_eq!(stopped.poses[..3], [0.0; 3]);
}

#[test]
fn every_status_has_its_words() {
    let text = |status| {
        // SAFETY: never null, and static.
        unsafe { CStr::from_ptr(bearslam_status_text(status)) }
            .to_str()
            .unwrap()
    };
    let last = BearslamStatus::Unexpected as i32;
    let all: std::collections::BTreeSet<_> = (0..=last).map(text).collect();
    assert_eq!(all.len(), 13);
    assert!(!all.contains("no such status"));
    assert_eq!(text(last + 1), "no such status");
    assert_eq!(text(-1), "no such status");
}
