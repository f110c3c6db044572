// SPDX-License-Identifier: MIT OR Apache-2.0
//! How wide must a search be? `cargo bench --bench search --features rayon [-- TRIALS [SEED]]`.
//!
//! Failures against time for searches of several widths, over the 75 cells of Dellaert and Stroupe in both
//! layouts and over harder ones. A search fails when its cost exceeds the least known one of the scene, over
//! all widths and the refinement started at the truth, by more than 1e-5 of it.

use bearslam::{
    Arena, Cell, Layout, Problem, RefineOptions, SearchOptions, SolveOptions, refine, simulate,
    solve,
};
use rayon::prelude::*;
use std::time::Instant;

/// Triples, grown, candidates, swept.
const WIDTHS: [[usize; 4]; 9] = [
    [1, 1, 1, 0],
    [6, 1, 1, 0],
    [24, 1, 1, 0],
    [24, 3, 3, 0],
    [24, 6, 6, 0],
    [24, 6, 6, 1],
    [24, 6, 6, 2],
    [24, 6, 6, 4],
    [40, 10, 10, 10],
];

/// Name, degrees of noise, views, landmarks.
type Family = (
    &'static str,
    &'static [f64],
    &'static [usize],
    &'static [usize],
);

const FAMILIES: [Family; 4] = [
    (
        "the paper's",
        &[0.1, 0.5, 1.0],
        &[4, 6, 8, 10, 12],
        &[7, 9, 11, 13, 15],
    ),
    ("4 views", &[1.0], &[4], &[7, 8, 9, 10]),
    ("5 and 6 landmarks", &[1.0], &[4, 5, 6, 8, 12], &[5, 6]),
    (
        "2.23 degrees",
        &[2.23],
        &[4, 6, 8, 10, 12],
        &[7, 9, 11, 13, 15],
    ),
];

fn main() {
    let mut numbers = std::env::args().skip(1).filter_map(|a| a.parse().ok());
    let trials: u64 = numbers.next().unwrap_or(50);
    let seed: u64 = numbers.next().unwrap_or(0);
    println!("{trials} scenes a cell, seed {seed}");
    for (name, noises, views, landmarks) in FAMILIES {
        let mut cells = Vec::new();
        for layout in [Layout::Mixed, Layout::Enclosed] {
            for noise in noises.iter().map(|degrees| degrees.to_radians()) {
                for &views in views {
                    cells.extend(landmarks.iter().map(|&landmarks| Cell {
                        layout,
                        views,
                        landmarks,
                        noise,
                    }));
                }
            }
        }
        let scenes: Vec<(Cell, u64)> = cells
            .into_iter()
            .flat_map(|cell| (0..trials).map(move |trial| (cell, cell.scene_seed(seed, trial))))
            .collect();
        let results: Vec<Vec<(bool, f64)>> = scenes.par_iter().map(contest).collect();
        println!("\n{name}, {} scenes\n", scenes.len());
        println!("| triples | grown | candidates | swept | failures | mean time \\[us\\] |");
        println!("|---|---|---|---|---|---|");
        for (k, [triples, grown, candidates, swept]) in WIDTHS.into_iter().enumerate() {
            let failures = results.iter().filter(|result| result[k].0).count();
            let time: f64 = results.iter().map(|result| result[k].1).sum();
            let mean = time * 1e6 / scenes.len() as f64;
            println!("| {triples} | {grown} | {candidates} | {swept} | {failures} | {mean:.0} |");
        }
    }
}

/// Whether each width fails, and its time \[s\].
fn contest((cell, seed): &(Cell, u64)) -> Vec<(bool, f64)> {
    let arena = Arena::default();
    let scene = simulate(
        cell.layout,
        cell.views,
        cell.landmarks,
        cell.noise,
        *seed,
        arena,
    )
    .expect("a scene");
    let problem =
        Problem::dense(cell.views, cell.landmarks, &scene.bearings, cell.noise).expect("a problem");
    let truth = refine(&problem, &scene.map(), &RefineOptions::default(), None);
    let runs = WIDTHS.map(|[triples, grown, candidates, swept]| {
        let options = SolveOptions {
            search: SearchOptions {
                triples,
                grown,
                candidates,
                swept,
            },
            ..SolveOptions::default()
        };
        let begin = Instant::now();
        let found = solve(&problem, &options, None);
        let time = begin.elapsed().as_secs_f64();
        (found.map_or(f64::INFINITY, |found| found.cost), time)
    });
    let least = runs
        .iter()
        .map(|run| run.0)
        .fold(truth.map_or(f64::INFINITY, |found| found.cost), f64::min);
    runs.iter()
        .map(|(cost, time)| (!(*cost <= least * (1.0 + 1e-5) + 1e-12), *time))
        .collect()
}
