// SPDX-License-Identifier: MIT OR Apache-2.0
//! Error of the relative headings of three views, by method: `cargo bench --bench accuracy [-- SCENES]`.
//!
//! The table of `docs/accuracy.md`: 0.3 degrees of noise, the branch nearer to the truth, median and
//! 90th percentile over the scenes of the larger of the two heading errors. Maximum likelihood is the
//! refinement started at the truth.

use bearslam::{
    Arena, Bearing, Layout, Map, Method, Pose, Problem, RefineOptions, Scene, Triple, refine_map,
    simulate, three_view,
};

const NOISE_DEG: f64 = 0.3;

fn main() {
    let scenes = std::env::args()
        .skip(1)
        .find_map(|argument| argument.parse().ok())
        .unwrap_or(1000);
    let methods = [
        ("projective", Some(Method::Projective)),
        ("calibrated", Some(Method::Calibrated { reweights: 0 })),
        ("1 reweight", Some(Method::Calibrated { reweights: 1 })),
        ("2 reweights", Some(Method::Calibrated { reweights: 2 })),
        ("3 reweights", Some(Method::Calibrated { reweights: 3 })),
        ("maximum likelihood", None),
    ];
    print!("| layout | n |");
    for (name, _) in methods {
        print!(" {name} |");
    }
    println!("\n|---|---|{}", "---|".repeat(methods.len()));
    for (name, layout) in [("mixed", Layout::Mixed), ("enclosed", Layout::Enclosed)] {
        for landmarks in [5, 7, 15, 40] {
            print!("| {name} | {landmarks} |");
            for (_, method) in methods {
                if method.is_some_and(|method| landmarks < method.min_landmarks()) {
                    print!(" – |");
                    continue;
                }
                let mut errors: Vec<f64> = (0..scenes)
                    .map(|seed| heading_error_deg(layout, landmarks, seed, method))
                    .collect();
                errors.sort_by(f64::total_cmp);
                let at =
                    |percent: usize| errors[(errors.len() * percent / 100).min(errors.len() - 1)];
                print!(" {} / {} |", digits(at(50)), digits(at(90)));
            }
            println!();
        }
    }
}

/// Two significant digits.
fn digits(value: f64) -> String {
    if value < 10.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.0}")
    }
}

fn heading_error_deg(layout: Layout, landmarks: usize, seed: u64, method: Option<Method>) -> f64 {
    let noise = NOISE_DEG.to_radians();
    let scene = simulate(layout, 3, landmarks, noise, seed, Arena::default()).expect("a scene");
    let found: Vec<[Pose<f64>; 3]> = match method {
        Some(method) => {
            let triples: Vec<Triple<f64>> = (0..landmarks)
                .map(|j| [0, 1, 2].map(|i| Bearing::new(scene.bearings[i * landmarks + j])))
                .collect();
            match three_view(&triples, method) {
                Ok(found) => found.motions.iter().map(|motion| motion.poses).collect(),
                Err(_) => return 180.0,
            }
        }
        None => vec![most_likely(&scene, landmarks)],
    };
    found
        .iter()
        .map(|poses| {
            (1..3)
                .map(|view| {
                    let found = poses[0].rotation.rotation_to(&poses[view].rotation);
                    let truth = scene.poses[0]
                        .rotation
                        .rotation_to(&scene.poses[view].rotation);
                    found.angle_to(&truth).abs().to_degrees()
                })
                .fold(0.0, f64::max)
        })
        .fold(f64::INFINITY, f64::min)
}

fn most_likely(scene: &Scene, landmarks: usize) -> [Pose<f64>; 3] {
    let problem = Problem::dense(3, landmarks, &scene.bearings, 1.0).expect("a problem");
    let mut map = Map {
        poses: scene.poses.iter().copied().map(Some).collect(),
        landmarks: scene.landmarks.iter().copied().map(Some).collect(),
    };
    refine_map(&problem, &mut map, &RefineOptions::default(), None).expect("a refinement");
    [0, 1, 2].map(|view| map.poses[view].expect("a pose"))
}
