// SPDX-License-Identifier: MIT OR Apache-2.0
//! The calls that are proved free of panics and measured.

use crate::scene::{LANDMARKS, Scene, Scenes};
use bearslam::{
    Bearing, Branch, CalibratedTensor, FixedMap, Loss, Method, Real, RefineOptions, Triple,
    Workspace, align, bearing_to, epipoles, is_ahead, projective_tensor, real_epipoles, resect,
    signed_angle, three_view, three_view_with_landmarks, transform_pose, triangulate,
    trifocal_tensor,
};
use core::ffi::CStr;
use core::hint::black_box;

/// A call of the crate on data of a scene.
#[cfg_attr(
    target_os = "none",
    expect(dead_code, reason = "names are for the host")
)]
pub struct Kernel {
    pub name: &'static CStr,
    pub scalar: &'static CStr,
    pub call: fn(&Scenes),
}

/// One line per call: its name, and what it does with the scene `s`.
macro_rules! kernels {
    ($($name:literal => $function:ident($s:ident) $body:block)*) => {
        $(
            #[inline(never)]
            fn $function<T: Real>($s: &Scene<T>) $body
        )*
        pub static KERNELS: [Kernel; [$($name),*].len() * 2] = [$(
            Kernel { name: $name, scalar: c"f32", call: |s| $function(&s.single) },
            Kernel { name: $name, scalar: c"f64", call: |s| $function(&s.double) },
        )*];
    };
}

/// The first `count` landmarks of a scene; the compiler does not know how many.
fn first<U>(all: &[U], count: usize) -> &[U] {
    all.get(..black_box(count)).unwrap_or(all)
}

/// Three views, and the landmarks of both motions.
#[inline(always)]
fn solve<T: Real>(triples: &[Triple<T>], method: Method) {
    let mut landmarks = [[None; 2]; LANDMARKS];
    if let Some(landmarks) = landmarks.get_mut(..triples.len()) {
        let _ = black_box(three_view_with_landmarks(triples, method, landmarks));
        black_box(landmarks);
    }
}

/// The same, with each landmark computed separately.
#[inline(always)]
fn solve_one_by_one<T: Real>(triples: &[Triple<T>], method: Method) {
    if let Ok(found) = black_box(three_view(triples, method)) {
        for motion in &found.motions {
            for triple in triples {
                black_box(motion.landmark(triple));
            }
        }
    }
}

kernels! {
    c"three views, 5 landmarks" => five(s) {
        solve(first(&s.triples, 5), Method::Calibrated { reweights: 0 });
    }
    c"three views, 5 landmarks, landmarks one by one" => five_one_by_one(s) {
        solve_one_by_one(first(&s.triples, 5), Method::Calibrated { reweights: 0 });
    }
    c"three views, 15 landmarks, one reweight" => fifteen(s) {
        solve(first(&s.triples, 15), Method::Calibrated { reweights: 1 });
    }
    c"three views, 15 landmarks, one reweight, no landmarks" => fifteen_motions(s) {
        let _ = black_box(three_view(first(&s.triples, 15), Method::Calibrated { reweights: 1 }));
    }
    c"three views, 7 landmarks, projective" => seven(s) {
        solve(first(&s.triples, 7), Method::Projective);
    }
    c"trifocal tensor, 15 landmarks" => tensor(s) {
        let _ = black_box(trifocal_tensor(first(&s.triples, 15), Method::Calibrated { reweights: 1 }));
    }
    c"projective tensor and epipoles, 15 landmarks" => projective(s) {
        if let Ok(tensor) = black_box(projective_tensor(first(&s.triples, 15))) {
            let _ = black_box(epipoles(&tensor));
            let _ = black_box(real_epipoles(&tensor));
        }
    }
    c"triangulate, 2 rays" => two_rays(s) {
        let rays = first(&s.poses, 2).iter().zip(&s.bearings);
        let _ = black_box(triangulate(rays.map(|(pose, [bearing, ..])| (*pose, *bearing))));
    }
    c"triangulate, 10 rays" => ten_rays(s) {
        let rays = first(&s.poses, 10).iter().zip(&s.bearings);
        let _ = black_box(triangulate(rays.map(|(pose, [bearing, ..])| (*pose, *bearing))));
    }
    c"resect, 3 landmarks" => three_landmarks(s) {
        let [bearings, ..] = &s.bearings;
        let _ = black_box(resect(first(&s.landmarks, 3).iter().copied().zip(bearings.iter().copied())));
    }
    c"resect, 10 landmarks" => ten_landmarks(s) {
        let [bearings, ..] = &s.bearings;
        let _ = black_box(resect(first(&s.landmarks, 10).iter().copied().zip(bearings.iter().copied())));
    }
    c"transfer and cheirality, 15 landmarks" => transfer(s) {
        if let Ok(found) = black_box(three_view(first(&s.triples, 15), Method::Calibrated { reweights: 0 })) {
            for motion in &found.motions {
                let [pose, ..] = &motion.poses;
                for triple in &s.triples {
                    let [u, v, _] = triple;
                    black_box(motion.transfer(u, v));
                    black_box(motion.landmark(triple).map(|point| is_ahead(pose, u, &point)));
                }
            }
        }
    }
    c"tensors, 15 landmarks" => tensors(s) {
        let triples = first(&s.triples, 15);
        if let Ok(found) = CalibratedTensor::estimate(triples, black_box(2)) {
            let tensor = black_box(found.tensor());
            black_box((found.kappa(), found.quality()));
            let _ = black_box(found.motions(triples));
            for triple in triples {
                let [u, v, _] = triple;
                black_box((tensor.sampson_residual(triple), tensor.transfer(u, v)));
                black_box(found.sampson_square(triple, &[T::one(); 3]));
            }
        }
        let pair = CalibratedTensor::null_pair(first(&s.triples, 4));
        black_box(CalibratedTensor::combine(&pair, T::one(), T::one()));
    }
    c"pose, bearing, angle" => angles(s) {
        let [pose, ..] = &s.poses;
        let [point, ..] = &s.landmarks;
        let heading = signed_angle(black_box(pose.rotation.re), pose.rotation.im);
        let pose = black_box(bearslam::pose(point.x, point.y, heading));
        black_box(Bearing::new(bearing_to(&pose, point).map_or(heading, |bearing| bearing.angle())));
    }
    c"fixed map, 4x12: start, add, refine" => fixed(s) {
        let mut map = FixedMap::<T, 4, 12>::new();
        for (view, bearings) in first(&s.bearings, 4).iter().enumerate() {
            for (landmark, bearing) in first(bearings, 12).iter().enumerate() {
                let _ = black_box(map.see(view, landmark, *bearing, T::lit(0.01)));
            }
        }
        for branch in [Branch::Other, Branch::Best] {
            let _ = black_box(map.start(black_box([0, 1, 2]), branch));
        }
        let _ = black_box((map.add_view(black_box(3)), map.add_landmark(black_box(7))));
        let mut workspace = Workspace::default();
        let options = RefineOptions { max_iterations: black_box(5), ..RefineOptions::default() };
        let _ = black_box(map.refine(&mut workspace, &options));
        map.normalize();
        black_box((map.cost(), map.rms()));
        let _ = black_box((map.forget_view(black_box(1)), map.forget_landmark(black_box(1))));
    }
    c"fixed map, 4x12: refine with a loss" => robust(s) {
        let mut map = FixedMap::<T, 4, 12>::new();
        for (view, (pose, bearings)) in s.poses.iter().zip(first(&s.bearings, 4)).enumerate() {
            for (landmark, bearing) in first(bearings, 12).iter().enumerate() {
                let _ = map.see(view, landmark, *bearing, T::lit(0.01));
            }
            map.poses.iter_mut().skip(view).take(1).for_each(|place| *place = Some(*pose));
        }
        for (place, landmark) in map.landmarks.iter_mut().zip(&s.landmarks) {
            *place = Some(*landmark);
        }
        let loss = black_box(Loss::Cauchy(T::lit(Loss::<T>::CAUCHY)));
        let options = RefineOptions { max_iterations: black_box(5), loss, ..RefineOptions::default() };
        let _ = black_box(map.refine(&mut Workspace::default(), &options));
    }
    c"align, 15 points" => similarity(s) {
        if let Ok(found) = black_box(align(first(&s.landmarks, 15), first(&s.moved, 15))) {
            for pose in &s.poses {
                black_box(transform_pose(&found, pose));
            }
        }
    }
}
