// SPDX-License-Identifier: MIT OR Apache-2.0
//! Time of every stage: `cargo bench --bench speed`.

use bearslam::{
    Arena, Bearing, CalibratedTensor, Frame, Layout, Loss, Map, Method, Outliers, Pose, Problem,
    Real, RefineOptions, Scene, SolveOptions, Strategy, Triple, covariance, diagnose, initialize,
    refine_map, resect, simulate, solve, three_view, triangulate,
};
use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::Point2;
use std::hint::black_box;
use std::time::Duration;

const NOISE: f64 = 1.0;
const SIZES: [(usize, usize); 3] = [(4, 7), (8, 11), (12, 15)];

fn scene(views: usize, landmarks: usize, seed: u64) -> Scene {
    let noise = NOISE.to_radians();
    simulate(
        Layout::Mixed,
        views,
        landmarks,
        noise,
        seed,
        Arena::default(),
    )
    .expect("a scene")
}

fn triples<T: Real>(landmarks: usize, seed: u64) -> Vec<Triple<T>> {
    let scene = scene(3, landmarks, seed);
    (0..landmarks)
        .map(|j| [0, 1, 2].map(|i| Bearing::new(T::lit(scene.bearings[i * landmarks + j]))))
        .collect()
}

fn three_views<T: Real>(criterion: &mut Criterion, scalar: &str) {
    let mut group = criterion.benchmark_group(format!("three_view/{scalar}"));
    for (name, method) in [
        ("calibrated", Method::Calibrated { reweights: 0 }),
        ("reweighted once", Method::Calibrated { reweights: 1 }),
        ("projective", Method::Projective),
    ] {
        for landmarks in [5, 7, 15, 40] {
            if landmarks < method.min_landmarks() {
                continue;
            }
            let triples = triples::<T>(landmarks, 3);
            group.bench_function(BenchmarkId::new(name, landmarks), |bencher| {
                bencher.iter(|| three_view(black_box(&triples), method));
            });
        }
    }
}

/// Both branches with all landmarks: what `bearslam.three_view` of the package returns.
fn three_views_with_landmarks(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("three_view with landmarks/f64");
    for landmarks in [5, 15] {
        let triples = triples::<f64>(landmarks, 3);
        let method = Method::Calibrated { reweights: 0 };
        group.bench_function(BenchmarkId::from_parameter(landmarks), |bencher| {
            bencher.iter(|| {
                let found = three_view(black_box(&triples), method).expect("a solution");
                for motion in &found.motions {
                    for triple in &triples {
                        black_box(motion.landmark(triple));
                    }
                }
            });
        });
    }
}

fn kernels(criterion: &mut Criterion) {
    let scene = scene(12, 15, 3);
    let bearing = |i: usize, j: usize| Bearing::new(scene.bearings[15 * i + j]);
    for views in [2, 3, 12] {
        let rays: Vec<(Pose<f64>, Bearing<f64>)> = (0..views)
            .map(|i| (scene.poses[i], bearing(i, 0)))
            .collect();
        criterion.bench_function(&format!("triangulate/{views} views"), |bencher| {
            bencher.iter(|| triangulate(black_box(&rays).iter().copied()));
        });
    }
    for landmarks in [3, 5, 15] {
        let seen: Vec<(Point2<f64>, Bearing<f64>)> = (0..landmarks)
            .map(|j| (scene.landmarks[j], bearing(0, j)))
            .collect();
        criterion.bench_function(&format!("resect/{landmarks} landmarks"), |bencher| {
            bencher.iter(|| resect(black_box(&seen).iter().copied()));
        });
    }
}

/// A start as far from the truth as a good guess, 10 cm and 5 degrees, without randomness.
fn guess(scene: &Scene) -> Map {
    let wave = |k: usize| (12.9898 * (k as f64 + 1.0)).sin();
    Map {
        poses: scene
            .poses
            .iter()
            .enumerate()
            .map(|(k, p)| {
                let (x, y) = (p.translation.x, p.translation.y);
                let theta = p.rotation.angle() + 0.087 * wave(3 * k + 2);
                Some(bearslam::pose(
                    x + 0.1 * wave(3 * k),
                    y + 0.1 * wave(3 * k + 1),
                    theta,
                ))
            })
            .collect(),
        landmarks: scene
            .landmarks
            .iter()
            .enumerate()
            .map(|(k, p)| {
                let shift = [0.1 * wave(2 * k + 1000), 0.1 * wave(2 * k + 1001)];
                Some(Point2::new(p.x + shift[0], p.y + shift[1]))
            })
            .collect(),
    }
}

fn refinement(criterion: &mut Criterion) {
    for (views, landmarks) in SIZES {
        let scene = scene(views, landmarks, 3);
        let problem = Problem::dense(views, landmarks, &scene.bearings, 1.0).expect("a problem");
        let start = guess(&scene);
        for (name, max_iterations) in [("one iteration", 1), ("to convergence", 100)] {
            let options = RefineOptions {
                max_iterations,
                ..RefineOptions::default()
            };
            criterion.bench_function(&format!("refine/{name}/{views}x{landmarks}"), |bencher| {
                bencher.iter_batched_ref(
                    || start.clone(),
                    |map| refine_map(black_box(&problem), map, &options, None),
                    BatchSize::SmallInput,
                );
            });
        }
    }
}

/// Odometry and priors: a loop of 100 views, each seeing some of 60 landmarks.
fn posterior(criterion: &mut Criterion) {
    let noise = NOISE.to_radians();
    let arena = Arena {
        sight: 1.5,
        ..Arena::default()
    };
    let scene = simulate(Layout::Trajectory, 100, 60, noise, 1, arena).expect("a scene");
    let odometry = scene.odometry([0.02, 0.02, 0.01], 1).expect("odometry");
    let problem = Problem::dense(100, 60, &scene.bearings, noise).expect("a problem");
    let problem = problem.with_odometry(&odometry).expect("a problem");
    let options = SolveOptions::default();
    criterion.bench_function("refine with odometry/100x60", |bencher| {
        bencher.iter_batched_ref(
            || scene.map(),
            |map| refine_map(black_box(&problem), map, &options.refine, None),
            BatchSize::SmallInput,
        );
    });
    criterion.bench_function("solve with odometry/100x60", |bencher| {
        bencher.iter(|| solve(black_box(&problem), &options, None));
    });
    let map = scene.map();
    criterion.bench_function("covariance/100x60", |bencher| {
        bencher.iter(|| {
            covariance(
                black_box(&problem),
                &map,
                Loss::Squared,
                Frame::FirstView,
                None,
            )
        });
    });
}

/// Covariances where the views are few and the landmarks many.
fn many_landmarks(criterion: &mut Criterion) {
    let noise = NOISE.to_radians();
    let mut group = criterion.benchmark_group("covariance");
    group.sample_size(10);
    for (views, landmarks) in [(20, 1000), (20, 4000), (100, 10_000)] {
        let scene = scene(views, landmarks, 3);
        let problem = Problem::dense(views, landmarks, &scene.bearings, noise).expect("a problem");
        let map = scene.map();
        group.bench_function(format!("{views}x{landmarks}"), |bencher| {
            bencher.iter(|| {
                covariance(
                    black_box(&problem),
                    &map,
                    Loss::Squared,
                    Frame::FreeNetwork,
                    None,
                )
            });
        });
    }
}

fn losses(criterion: &mut Criterion) {
    let scene = scene(12, 15, 3);
    let problem = Problem::dense(12, 15, &scene.bearings, NOISE.to_radians()).expect("a problem");
    for (name, loss) in [
        ("huber", Loss::Huber(Loss::<f64>::HUBER)),
        ("cauchy", Loss::Cauchy(Loss::<f64>::CAUCHY)),
        ("truncated", Loss::Truncated(Loss::<f64>::TRUNCATED)),
    ] {
        let options = RefineOptions {
            loss,
            ..RefineOptions::default()
        };
        let start = guess(&scene);
        criterion.bench_function(&format!("refine/{name}/12x15"), |bencher| {
            bencher.iter_batched_ref(
                || start.clone(),
                |map| refine_map(black_box(&problem), map, &options, None),
                BatchSize::SmallInput,
            );
        });
    }
}

fn whole(criterion: &mut Criterion) {
    for (views, landmarks) in SIZES {
        // Several scenes, because the time for one may not be typical.
        let problems: Vec<Problem> = (0..16)
            .map(|seed| {
                let scene = scene(views, landmarks, seed);
                Problem::dense(views, landmarks, &scene.bearings, 1.0).expect("a problem")
            })
            .collect();
        let options = SolveOptions::default();
        let mut next = 0;
        criterion.bench_function(
            &format!("solve from nothing/{views}x{landmarks}"),
            |bencher| {
                bencher.iter(|| {
                    next = (next + 1) % problems.len();
                    solve(black_box(&problems[next]), &options, None)
                });
            },
        );
    }
}

/// 100 views with a range of sight of 2 metres and 60 landmarks: both methods, with and without the last refinement.
fn limited_sight(criterion: &mut Criterion) {
    let arena = Arena {
        sight: 2.0,
        ..Arena::default()
    };
    let problems: Vec<Problem> = (0..4)
        .map(|seed| {
            let noise = 0.5_f64.to_radians();
            let scene = simulate(Layout::Trajectory, 100, 60, noise, seed, arena).expect("a scene");
            Problem::dense(100, 60, &scene.bearings, 1.0).expect("a problem")
        })
        .collect();
    for (name, strategy) in [
        ("incremental", Strategy::Incremental),
        ("global", Strategy::Global),
    ] {
        let options = SolveOptions {
            strategy,
            ..SolveOptions::default()
        };
        let mut next = 0;
        criterion.bench_function(&format!("limited sight/start/{name}/100x60"), |bencher| {
            bencher.iter(|| {
                next = (next + 1) % problems.len();
                initialize(black_box(&problems[next]), &options, None)
            });
        });
        criterion.bench_function(&format!("limited sight/solve/{name}/100x60"), |bencher| {
            bencher.iter(|| {
                next = (next + 1) % problems.len();
                solve(black_box(&problems[next]), &options, None)
            });
        });
    }
}

fn diagnoses(criterion: &mut Criterion) {
    for (views, landmarks) in SIZES {
        let scene = scene(views, landmarks, 5);
        let problem = Problem::dense(views, landmarks, &scene.bearings, 1.0).expect("a problem");
        let found = solve(&problem, &SolveOptions::default(), None).expect("a map");
        criterion.bench_function(&format!("diagnose a map/{views}x{landmarks}"), |bencher| {
            bencher.iter(|| diagnose(black_box(&problem), Some(&found.map), None))
        });
        criterion.bench_function(
            &format!("diagnose from nothing/{views}x{landmarks}"),
            |bencher| bencher.iter(|| diagnose(black_box(&problem), None, None)),
        );
    }
}

/// Half a degree of noise, and a fraction of outliers.
fn contaminated(views: usize, landmarks: usize, share: f64, seed: u64) -> Problem {
    let noise = 0.5_f64.to_radians();
    let arena = Arena::default();
    let scene = simulate(Layout::Mixed, views, landmarks, noise, seed, arena).expect("a scene");
    let (scene, _) = scene.contaminate(Outliers::Mixture, share, seed);
    Problem::dense(views, landmarks, &scene.bearings, noise).expect("a problem")
}

/// The public stages of a robust solve, and the whole.
fn robust(criterion: &mut Criterion) {
    let sample: Vec<Triple<f64>> = triples(5, 3);
    criterion.bench_function("robust/tensor of a sample", |bencher| {
        bencher.iter(|| CalibratedTensor::estimate(black_box(&sample), 0));
    });
    let all: Vec<Triple<f64>> = triples(15, 3);
    let tensor = CalibratedTensor::estimate(&sample, 0).expect("a tensor");
    criterion.bench_function("robust/consensus of 15 landmarks", |bencher| {
        bencher.iter(|| {
            let squares = black_box(&all).iter();
            squares
                .map(|triple| tensor.sampson_square(triple, &[1.0; 3]).min(36.0))
                .sum::<f64>()
        });
    });
    for (views, landmarks) in [(8, 15), (12, 15)] {
        for percent in [0, 30] {
            let problems: Vec<Problem> = (0..16)
                .map(|seed| contaminated(views, landmarks, f64::from(percent) / 100.0, seed))
                .collect();
            let options = SolveOptions {
                robust: true,
                ..SolveOptions::default()
            };
            let mut next = 0;
            let name = format!("robust/solve/{views}x{landmarks}/{percent} % outliers");
            criterion.bench_function(&name, |bencher| {
                bencher.iter(|| {
                    next = (next + 1) % problems.len();
                    solve(black_box(&problems[next]), &options, None)
                });
            });
        }
    }
}

fn all(criterion: &mut Criterion) {
    three_views::<f64>(criterion, "f64");
    three_views::<f32>(criterion, "f32");
    three_views_with_landmarks(criterion);
    kernels(criterion);
    refinement(criterion);
    losses(criterion);
    posterior(criterion);
    many_landmarks(criterion);
    whole(criterion);
    limited_sight(criterion);
    diagnoses(criterion);
    robust(criterion);
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(30)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = all
}
criterion_main!(benches);
