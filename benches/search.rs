// SPDX-License-Identifier: MIT OR Apache-2.0
//! How wide must a search be? `cargo bench --bench search --features rayon [-- TRIALS [SEED] [four [verbose]]]`.
//!
//! Failures against time for searches of several widths, over the 75 cells of Dellaert and Stroupe in both
//! layouts and over harder ones. A search fails when its cost exceeds the least known one of the scene, over
//! all widths and the refinement started at the truth, by more than 1e-5 of it.
//!
//! With `four`, scenes of four landmarks instead, which have up to two exact maps each: `solve` must return one as good
//! as the one from the truth, the best map or one of its alternatives. Also counted are the scenes whose own map is not
//! among those returned. Scenes with all landmarks on one wall are counted apart: none has a map of its own, and `solve`
//! (exact bearings) or `diagnose` must name the wall.

use bearslam::{
    Arena, Cell, Degeneracy, Error, Kind, Layout, Map, Problem, Reconstruction, RefineOptions,
    Scene, SearchOptions, SolveOptions, align, diagnose, refine, simulate, solve,
};
use nalgebra::Point2;
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
    let words: Vec<String> = std::env::args().skip(1).collect();
    let mut numbers = words.iter().filter_map(|word| word.parse().ok());
    let trials: u64 = numbers.next().unwrap_or(50);
    let seed: u64 = numbers.next().unwrap_or(0);
    println!("{trials} scenes a cell, seed {seed}");
    if words.iter().any(|word| word == "four") {
        let verbose = words.iter().any(|word| word == "verbose");
        return four_landmarks(trials, seed, verbose);
    }
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

fn scene(cell: &Cell, seed: u64) -> Scene {
    let Cell {
        layout,
        views,
        landmarks,
        noise,
    } = *cell;
    simulate(layout, views, landmarks, noise, seed, Arena::default()).expect("a scene")
}

/// Whether each width fails, and its time \[s\].
fn contest((cell, seed): &(Cell, u64)) -> Vec<(bool, f64)> {
    let scene = scene(cell, *seed);
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

/// Scenes of four landmarks: how many `solve` loses.
fn four_landmarks(trials: u64, seed: u64, verbose: bool) {
    println!(
        "\n| noise | views | scenes | walls | named | errors | lost | own map not returned | maps | mean time \\[us\\] |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for noise in [0.0, 0.1_f64.to_radians()] {
        for views in 4..=12 {
            let cells = [Layout::Mixed, Layout::Enclosed].map(|layout| Cell {
                layout,
                views,
                landmarks: 4,
                noise,
            });
            let scenes: Vec<(Cell, u64)> = cells
                .into_iter()
                .flat_map(|cell| (0..trials).map(move |trial| (cell, cell.scene_seed(seed, trial))))
                .collect();
            let runs: Vec<Four> = scenes.par_iter().map(four).collect();
            let count = |is: fn(&Four) -> bool| runs.iter().filter(|run| is(run)).count();
            let mean = |of: fn(&Four) -> f64| runs.iter().map(of).sum::<f64>() / runs.len() as f64;
            println!(
                "| {:.1} deg | {views} | {} | {} | {} | {} | {} | {} | {:.1} | {:.0} |",
                noise.to_degrees(),
                runs.len(),
                count(|run| run.wall),
                count(|run| run.named),
                count(|run| run.error),
                count(|run| run.lost),
                count(|run| run.unlisted),
                mean(|run| run.maps as f64),
                mean(|run| run.time * 1e6),
            );
            for run in runs
                .iter()
                .filter(|run| verbose && (run.lost || run.wall != run.named))
            {
                println!("    {}", run.what);
            }
        }
    }
}

/// What came of a scene of four landmarks.
struct Four {
    wall: bool,
    named: bool,
    error: bool,
    /// No map returned is as good as the one from the truth; where bearings are exact, none is exact.
    lost: bool,
    /// The minimum next to the truth is not among those returned.
    unlisted: bool,
    maps: usize,
    /// Seconds.
    time: f64,
    what: String,
}

fn four((cell, seed): &(Cell, u64)) -> Four {
    let scene = scene(cell, *seed);
    // Bearings without noise are weighted as if they had some.
    let sigma = if cell.noise > 0.0 { cell.noise } else { 1e-3 };
    let problem =
        Problem::dense(cell.views, cell.landmarks, &scene.bearings, sigma).expect("a problem");
    let options = RefineOptions {
        max_iterations: 1000,
        ..RefineOptions::default()
    };
    let truth = refine(&problem, &scene.map(), &options, None);
    let begin = Instant::now();
    let found = solve(&problem, &SolveOptions::default(), None);
    let time = begin.elapsed().as_secs_f64();
    let maps: Vec<&Reconstruction> = found
        .iter()
        .flat_map(|found| core::iter::once(found).chain(&found.alternatives))
        .collect();
    let wall = is_wall(&scene.landmarks);
    let named = wall
        && match &found {
            Err(Error::Degenerate { kind, .. }) => *kind == Degeneracy::CollinearLandmarks,
            _ => diagnose(&problem, None, None).is_ok_and(|told| {
                let mut findings = told.findings.iter();
                findings.any(|finding| finding.kind == Kind::CollinearLandmarks)
            }),
        };
    let good = |found: &Reconstruction| match &truth {
        _ if cell.noise == 0.0 => found.rms < 1e-10,
        // Both are rounding where the bearings determine no more than the map.
        Ok(truth) => found.cost <= truth.cost * (1.0 + 1e-5) + 1e-12,
        Err(_) => true,
    };
    let lost = !wall && !maps.iter().any(|found| good(found));
    let unlisted = !wall
        && truth.as_ref().is_ok_and(|truth| {
            truth.termination.was_successful()
                && !maps.iter().any(|found| is_same(&found.map, &truth.map))
        });
    let costs: Vec<f64> = maps.iter().map(|found| found.cost).collect();
    let doubt = found.as_ref().map(|found| found.uncertainty);
    let least = truth.as_ref().map(|truth| truth.cost);
    let what = format!("{cell:?} {seed}: truth {least:?}, costs {costs:?}, uncertainty {doubt:?}");
    Four {
        wall,
        named,
        error: !wall && found.is_err(),
        lost,
        unlisted,
        maps: maps.len(),
        time,
        what,
    }
}

/// Whether landmarks are on one line.
fn is_wall(landmarks: &[Point2<f64>]) -> bool {
    let [first, others @ ..] = landmarks else {
        return true;
    };
    others.iter().all(|a| {
        let mut areas = others.iter().map(|b| (a - first).perp(&(b - first)).abs());
        areas.all(|area| area < 1e-9)
    })
}

/// Whether two complete maps differ by a similarity only, up to a thousandth of their size.
fn is_same(one: &Map, other: &Map) -> bool {
    let points = |map: &Map| -> Option<Vec<Point2<f64>>> {
        let views = map.poses.iter();
        let views = views.map(|pose| Some(Point2::from(pose.as_ref()?.translation.vector)));
        views.collect()
    };
    let (Some(one), Some(other)) = (points(one), points(other)) else {
        return false;
    };
    let Ok(laid) = align(&one, &other) else {
        return false;
    };
    one.iter()
        .zip(&other)
        .all(|(a, b)| (laid * a - b).norm() < 1e-3)
}
