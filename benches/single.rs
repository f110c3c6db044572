// SPDX-License-Identifier: MIT OR Apache-2.0
//! Error of single precision compared with that of noise: `cargo bench --bench single [-- scenes]`.
//!
//! For each kernel: distance of the `f32` result from the `f64` result on the same noisy bearings, divided by
//! the root mean square distance of the `f64` result from the truth over eight draws of the noise. Scenes
//! alternate between both layouts.

use bearslam::{
    Arena, Bearing, Layout, Method, Pose, Real, Scene, Triple, align, resect, simulate, three_view,
    triangulate,
};
use nalgebra::Point2;

const NOISE_DEG: f64 = 0.1;
const DRAWS: u64 = 8;
const VIEWS: usize = 10;
const LANDMARKS: usize = 15;

#[derive(Clone, Copy)]
enum Kernel {
    ThreeView(usize, Method),
    Transfer,
    Triangulate(usize),
    Resect(usize),
    Align,
}

const KERNELS: [(&str, Kernel); 11] = [
    (
        "three views, 5 landmarks",
        Kernel::ThreeView(5, Method::Calibrated { reweights: 0 }),
    ),
    (
        "three views, 7 landmarks",
        Kernel::ThreeView(7, Method::Calibrated { reweights: 0 }),
    ),
    (
        "three views, 15 landmarks, one reweight",
        Kernel::ThreeView(15, Method::Calibrated { reweights: 1 }),
    ),
    (
        "three views, 7 landmarks, projective",
        Kernel::ThreeView(7, Method::Projective),
    ),
    (
        "three views, 15 landmarks, projective",
        Kernel::ThreeView(15, Method::Projective),
    ),
    ("transfer", Kernel::Transfer),
    ("triangulate, 2 rays", Kernel::Triangulate(2)),
    ("triangulate, 10 rays", Kernel::Triangulate(10)),
    ("resect, 3 landmarks", Kernel::Resect(3)),
    ("resect, 10 landmarks", Kernel::Resect(10)),
    ("align, 15 points", Kernel::Align),
];

/// The input of the kernels, in one scalar type.
struct Input<T: Real> {
    poses: Vec<Pose<T>>,
    landmarks: Vec<Point2<T>>,
    /// View by view.
    bearings: Vec<Bearing<T>>,
    /// The landmarks with independent errors.
    moved: Vec<Point2<T>>,
}

/// One noisy input in both scalar types.
fn inputs(scene: &Scene, seed: u64, noise: f64) -> (Input<f64>, Input<f32>) {
    let mut random = Random(seed);
    let bearings: Vec<f64> = scene
        .bearings
        .iter()
        .map(|bearing| bearing + noise * random.normal())
        .collect();
    let size = Arena::default().width;
    let moved: Vec<[f64; 2]> = scene
        .landmarks
        .iter()
        .map(|p| [p.x, p.y].map(|value| value + noise * size * random.normal()))
        .collect();
    (
        input(scene, &bearings, &moved),
        input(scene, &bearings, &moved),
    )
}

fn input<T: Real>(scene: &Scene, bearings: &[f64], moved: &[[f64; 2]]) -> Input<T> {
    let point = |x: f64, y: f64| Point2::new(T::lit(x), T::lit(y));
    Input {
        poses: scene.poses.iter().map(|pose| pose.cast()).collect(),
        landmarks: scene.landmarks.iter().map(|p| point(p.x, p.y)).collect(),
        bearings: bearings.iter().map(|&b| Bearing::new(b).cast()).collect(),
        moved: moved.iter().map(|&[x, y]| point(x, y)).collect(),
    }
}

impl<T: Real> Input<T> {
    fn triples(&self, count: usize) -> Vec<Triple<T>> {
        (0..count)
            .map(|j| [0, 1, 2].map(|i| self.bearings[i * LANDMARKS + j]))
            .collect()
    }
}

impl Kernel {
    /// All solutions, each as a list of numbers; empty where the kernel returns an error.
    fn solve<T: Real>(self, input: &Input<T>) -> Vec<Vec<f64>> {
        match self {
            Self::ThreeView(count, method) => three_view(&input.triples(count), method)
                .map(|found| found.motions.map(|motion| numbers(&motion.poses[1..])))
                .into_iter()
                .flatten()
                .collect(),
            Self::Transfer => {
                let Ok(mut found) =
                    three_view(&input.triples(5), Method::Calibrated { reweights: 0 })
                else {
                    return Vec::new();
                };
                // With the true motion: the error of the motion is measured above.
                let poses = [0, 1, 2].map(|view| input.poses[view]);
                found.motions[0].poses = poses;
                let [u, v] = [0, 1].map(|view| input.bearings[view * LANDMARKS]);
                let transferred = found.motions[0].transfer(&u, &v);
                transferred
                    .map(|bearing| vec![bearing.re.as_f64(), bearing.im.as_f64()])
                    .into_iter()
                    .collect()
            }
            Self::Triangulate(count) => {
                let rays = (0..count).map(|i| (input.poses[i], input.bearings[i * LANDMARKS]));
                triangulate(rays)
                    .map(|found| vec![found.point.x.as_f64(), found.point.y.as_f64()])
                    .into_iter()
                    .collect()
            }
            Self::Resect(count) => {
                let seen = input
                    .landmarks
                    .iter()
                    .copied()
                    .zip(input.bearings.iter().copied());
                resect(seen.take(count))
                    .map(|found| numbers(&[found.pose]))
                    .into_iter()
                    .collect()
            }
            Self::Align => align(&input.landmarks, &input.moved)
                .map(|found| {
                    let (rotation, shift) = (found.isometry.rotation, found.isometry.translation);
                    let scale = found.scaling();
                    [rotation.re * scale, rotation.im * scale, shift.x, shift.y]
                        .map(Real::as_f64)
                        .to_vec()
                })
                .into_iter()
                .collect(),
        }
    }
}

fn numbers<T: Real>(poses: &[Pose<T>]) -> Vec<f64> {
    poses
        .iter()
        .flat_map(|pose| {
            let (place, turn) = (pose.translation, pose.rotation);
            [place.x, place.y, turn.re, turn.im].map(Real::as_f64)
        })
        .collect()
}

/// Distance of the nearest of the solutions.
fn nearest<'a>(solutions: &'a [Vec<f64>], from: &[f64]) -> Option<(f64, &'a Vec<f64>)> {
    let distance = |found: &Vec<f64>| {
        let squares = found.iter().zip(from).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>().sqrt()
    };
    let found = solutions.iter().map(|found| (distance(found), found));
    found.min_by(|a, b| a.0.total_cmp(&b.0))
}

fn main() {
    let scenes = std::env::args()
        .skip(1)
        .find_map(|argument| argument.parse().ok())
        .unwrap_or(10_000);
    println!("Error of `f32` over the error caused by {NOISE_DEG} deg of noise, {scenes} scenes\n");
    println!("| kernel | median | 95 % | above 5 % | only `f32` refuses | both refuse |");
    println!("|---|---|---|---|---|---|");
    for (name, kernel) in KERNELS {
        let (mut ratios, mut alone, mut both) = (Vec::new(), 0, 0);
        for seed in 0..scenes {
            let layout = [Layout::Mixed, Layout::Enclosed][usize::from(seed % 2 == 1)];
            let scene = simulate(layout, VIEWS, LANDMARKS, 0.0, seed, Arena::default());
            match ratio(kernel, &scene.expect("a scene"), seed) {
                Some(value) if value.is_finite() => ratios.push(value),
                Some(_) => alone += 1,
                None => both += 1,
            }
        }
        ratios.sort_by(f64::total_cmp);
        let at = |percent: usize| 100.0 * ratios[ratios.len() * percent / 100];
        let above = ratios.iter().filter(|&&ratio| ratio > 0.05).count();
        let share = 100.0 * above as f64 / ratios.len() as f64;
        println!(
            "| {name} | {:.3} % | {:.3} % | {share:.2} % | {alone} | {both} |",
            at(50),
            at(95)
        );
    }
}

/// Infinite where only the `f32` kernel fails, `None` where both do.
fn ratio(kernel: Kernel, scene: &Scene, seed: u64) -> Option<f64> {
    let exact = kernel.solve(&inputs(scene, seed, 0.0).0);
    let truth = match kernel {
        // Of the two solutions the one nearer to the scene.
        Kernel::ThreeView(..) => {
            let inverse = scene.poses[0].inverse();
            let relative = [1, 2].map(|view| inverse * scene.poses[view]);
            let scale = 1.0 / relative[0].translation.vector.norm();
            let poses = relative.map(|mut pose| {
                pose.translation.vector *= scale;
                pose
            });
            nearest(&exact, &numbers(&poses))?.1.clone()
        }
        _ => exact.first()?.clone(),
    };
    let noise = NOISE_DEG.to_radians();
    let mut squares = 0.0;
    let mut first = None;
    for draw in 0..DRAWS {
        let (double, single) = inputs(scene, DRAWS * seed + draw, noise);
        let double = kernel.solve(&double);
        let (distance, found) = nearest(&double, &truth)?;
        squares += distance * distance;
        if draw == 0 {
            first = Some((found.clone(), kernel.solve(&single)));
        }
    }
    let (double, single) = first?;
    let error = nearest(&single, &double).map_or(f64::INFINITY, |(distance, _)| distance);
    Some(error / (squares / DRAWS as f64).sqrt())
}

/// Splitmix64, and normal numbers from it.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}
