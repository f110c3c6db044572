// SPDX-License-Identifier: MIT OR Apache-2.0
//! Does `solve` reach the global minimum? `cargo bench --bench minima [-- SCENES [NOISE_DEG]]`.
//!
//! Against the refinement started at the truth, scene by scene: `missed` when the cost of `solve` is
//! higher by more than 1e-5 of it, `better` when it is lower by more than that. `touching` counts the
//! misses in which either map has a landmark on top of a view: the cost then falls towards an infimum
//! that no map attains, and where a refinement stops on the way is chance.

use bearslam::{Arena, Layout, Map, Problem, SolveOptions, refine, simulate, solve};
use std::time::{Duration, Instant};

/// Distance of a landmark from a view, in units of the map, that counts as touching.
const TOUCHING: f64 = 1e-4;

fn main() {
    let numbers: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .collect();
    let scenes: u64 = numbers.first().and_then(|a| a.parse().ok()).unwrap_or(500);
    let noise_deg: f64 = numbers.get(1).and_then(|a| a.parse().ok()).unwrap_or(1.0);
    let noise = noise_deg.to_radians();
    println!("{scenes} scenes a row, noise {noise_deg} degrees");
    println!(
        "| views | landmarks | layout | missed | touching | better | errors | mean time \\[us\\] |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (views, landmarks) in [
        (4, 5),
        (6, 6),
        (4, 7),
        (8, 7),
        (12, 7),
        (4, 15),
        (8, 11),
        (12, 15),
    ] {
        for (name, layout) in [("mixed", Layout::Mixed), ("enclosed", Layout::Enclosed)] {
            let (mut missed, mut touching, mut better, mut errors) = (0, 0, 0, 0);
            let mut time = Duration::ZERO;
            for seed in 0..scenes {
                let arena = Arena::default();
                let scene =
                    simulate(layout, views, landmarks, noise, seed, arena).expect("a scene");
                let problem =
                    Problem::dense(views, landmarks, &scene.bearings, noise).expect("a problem");
                let truth = Map {
                    poses: scene.poses.iter().copied().map(Some).collect(),
                    landmarks: scene.landmarks.iter().copied().map(Some).collect(),
                };
                let options = SolveOptions::default();
                let oracle = refine(&problem, &truth, &options.refine, None).expect("a refinement");
                let begin = Instant::now();
                let found = solve(&problem, &options, None);
                time += begin.elapsed();
                let Ok(found) = found else {
                    errors += 1;
                    continue;
                };
                better += usize::from(found.cost < oracle.cost * (1.0 - 1e-5));
                if found.cost > oracle.cost * (1.0 + 1e-5) {
                    missed += 1;
                    touching += usize::from(touches(&found.map) || touches(&oracle.map));
                }
            }
            let mean = time.as_secs_f64() * 1e6 / scenes as f64;
            println!(
                "| {views} | {landmarks} | {name} | {missed} | {touching} | {better} | {errors} | {mean:.0} |"
            );
        }
    }
}

/// Whether a landmark of a normalised map is on top of a view.
fn touches(map: &Map<f64>) -> bool {
    map.poses.iter().flatten().any(|pose| {
        map.landmarks
            .iter()
            .flatten()
            .any(|point| (point.coords - pose.translation.vector).norm() < TOUCHING)
    })
}
