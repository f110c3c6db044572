// SPDX-License-Identifier: MIT OR Apache-2.0
//! Whole maps under limited sight:
//! `cargo bench --bench sight [-- TRIALS [SEED [SETTING]]] [known] [verbose] [incremental] [global]`.
//!
//! `known` gives the methods the standard deviation of the bearings, `verbose` prints the details of each
//! failure, the name of a method runs only that method, SETTING runs one line of the table, from 0.
//!
//! Rates of success and times of the incremental and the global method. A scene counts when the
//! Jacobian at the truth has no more than the four null directions of the gauge, after removing views with
//! fewer than three and landmarks with fewer than two sightings; the others are counted separately. A
//! method succeeds when it determines everything that the refinement started at the truth determines, at a
//! cost that exceeds that of the refinement by no more than 1e-5 of it plus 1e-12.

use bearslam::{
    Arena, Error, Layout, Problem, Reconstruction, RefineOptions, Scene, SolveOptions, Strategy,
    refine, simulate, solve,
};
use nalgebra::DMatrix;
use std::time::Instant;

/// Layout, views, landmarks, sight.
const SETTINGS: [(Layout, usize, usize, f64); 5] = [
    (Layout::Trajectory, 100, 60, 1.5),
    (Layout::Trajectory, 100, 60, 2.0),
    (Layout::Trajectory, 100, 100, 1.2),
    (Layout::Trajectory, 40, 60, 2.0),
    (Layout::Mixed, 30, 40, 2.5),
];

const METHODS: [(&str, Strategy); 2] = [
    ("incremental", Strategy::Incremental),
    ("global", Strategy::Global),
];

/// Whether a word is on the command line.
fn chosen(name: &str) -> bool {
    let named: Vec<String> = std::env::args().collect();
    METHODS
        .iter()
        .all(|(other, _)| !named.iter().any(|a| a == other))
        || named.iter().any(|a| a == name)
}

const NOISE_DEG: f64 = 0.5;

fn main() {
    let numbers: Vec<u64> = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse().ok())
        .collect();
    let trials = numbers.first().copied().unwrap_or(100);
    let seed = numbers.get(1).copied().unwrap_or(0);
    let only = numbers.get(2).copied();
    let known = std::env::args().any(|a| a == "known");
    let verbose = std::env::args().any(|a| a == "verbose");
    println!(
        "{trials} scenes a setting from seed {seed}, {NOISE_DEG} degrees, sigma {}\n",
        if known { "known" } else { "unknown" }
    );
    println!(
        "| layout | views | landmarks | sight | method | recovered | mean time \\[ms\\] | worst \\[ms\\] | missed | not counted |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (number, (layout, views, landmarks, sight)) in SETTINGS.into_iter().enumerate() {
        if only.is_some_and(|only| only != number as u64) {
            continue;
        }
        let arena = Arena {
            sight,
            ..Arena::default()
        };
        let noise = NOISE_DEG.to_radians();
        let mut skipped = Vec::new();
        let mut missed = [Vec::new(), Vec::new()];
        let mut times = [Vec::new(), Vec::new()];
        let mut truth_time = 0.0;
        for seed in seed..seed + trials {
            let scene = simulate(layout, views, landmarks, noise, seed, arena).expect("a scene");
            let sigma = if known { noise } else { 1.0 };
            let problem =
                Problem::dense(views, landmarks, &scene.bearings, sigma).expect("a problem");
            if free_directions(&scene, landmarks) > 4 {
                skipped.push(seed);
                continue;
            }
            let begin = Instant::now();
            let truth = refine(&problem, &scene.map(), &RefineOptions::default(), None)
                .expect("a refinement");
            truth_time += begin.elapsed().as_secs_f64();
            for (k, (name, strategy)) in METHODS.into_iter().enumerate() {
                if !chosen(name) {
                    continue;
                }
                let options = SolveOptions {
                    strategy,
                    ..SolveOptions::default()
                };
                let begin = Instant::now();
                let found = solve(&problem, &options, None);
                times[k].push(begin.elapsed().as_secs_f64() * 1e3);
                if !recovered(&found, &truth) {
                    missed[k].push(seed);
                    if verbose {
                        report(name, seed, &found, &truth);
                    }
                }
            }
        }
        let counted = times.iter().map(Vec::len).max().unwrap_or(0);
        for (k, (name, _)) in METHODS.into_iter().enumerate() {
            if !chosen(name) {
                continue;
            }
            println!(
                "| {} | {views} | {landmarks} | {sight} | {name} | {} of {counted} | {:.0} | {:.0} | {:?} | {skipped:?} |",
                layout.name(),
                counted - missed[k].len(),
                times[k].iter().sum::<f64>() / times[k].len() as f64,
                times[k].iter().copied().fold(0.0, f64::max),
                missed[k],
            );
        }
        if verbose {
            println!(
                "refinement from the truth: {:.0} ms",
                truth_time / counted as f64 * 1e3
            );
        }
    }
}

/// Whether a map determines everything that the refinement from the truth does, at no higher cost.
fn recovered(found: &Result<Reconstruction, Error>, truth: &Reconstruction) -> bool {
    let Ok(found) = found else { return false };
    let poses = truth.map.poses.iter().zip(&found.map.poses);
    let landmarks = truth.map.landmarks.iter().zip(&found.map.landmarks);
    poses
        .clone()
        .all(|(truth, found)| truth.is_none() || found.is_some())
        && landmarks
            .clone()
            .all(|(truth, found)| truth.is_none() || found.is_some())
        && found.cost <= truth.cost * (1.0 + 1e-5) + 1e-12
}

fn report(name: &str, seed: u64, found: &Result<Reconstruction, Error>, truth: &Reconstruction) {
    match found {
        Err(error) => println!("{name} {seed}: {error}"),
        Ok(found) => println!(
            "{name} {seed}: cost {:.6e} truth {:.6e} ratio {:.6} {:?} {:?}; undetermined {:?} truth {:?}; {} components; uncertainty {:.3} truth {:.3}",
            found.cost,
            truth.cost,
            found.cost / truth.cost,
            found.termination,
            truth.termination,
            found.undetermined,
            truth.undetermined,
            found.components.len(),
            found.uncertainty,
            truth.uncertainty,
        ),
    }
}

/// Number of null directions of the Jacobian at the truth, over views and landmarks with enough sightings.
fn free_directions(scene: &Scene, landmarks: usize) -> usize {
    let views = scene.poses.len();
    let (mut view, mut landmark) = (vec![true; views], vec![true; landmarks]);
    let seen = |i: usize, j: usize| !scene.bearings[i * landmarks + j].is_nan();
    loop {
        let before = (view.clone(), landmark.clone());
        for i in 0..views {
            view[i] &= (0..landmarks)
                .filter(|&j| landmark[j] && seen(i, j))
                .count()
                >= 3;
        }
        for j in 0..landmarks {
            landmark[j] &= (0..views).filter(|&i| view[i] && seen(i, j)).count() >= 2;
        }
        if before == (view.clone(), landmark.clone()) {
            break;
        }
    }
    let size = 3 * views + 2 * landmarks;
    let mut information = DMatrix::<f64>::zeros(size, size);
    for i in (0..views).filter(|&i| view[i]) {
        for j in (0..landmarks).filter(|&j| landmark[j] && seen(i, j)) {
            let d = scene.landmarks[j].coords - scene.poses[i].translation.vector;
            let g = [-d.y / d.norm_squared(), d.x / d.norm_squared()];
            let x = 3 * views + 2 * j;
            let row = [
                (3 * i, -g[0]),
                (3 * i + 1, -g[1]),
                (3 * i + 2, -1.0),
                (x, g[0]),
                (x + 1, g[1]),
            ];
            for (a, u) in row {
                for (b, v) in row {
                    information[(a, b)] += u * v;
                }
            }
        }
    }
    // Parameters in units of their conditional standard deviations.
    let scale: Vec<f64> = (0..size)
        .map(|k| information[(k, k)].max(f64::MIN_POSITIVE).sqrt())
        .collect();
    for a in 0..size {
        for b in 0..size {
            information[(a, b)] /= scale[a] * scale[b];
        }
    }
    let missing =
        3 * view.iter().filter(|v| !**v).count() + 2 * landmark.iter().filter(|v| !**v).count();
    let values = information.symmetric_eigenvalues();
    // Squares of singular values that are only rounding.
    values.iter().filter(|value| value.abs() < 1e-12).count() - missing
}
