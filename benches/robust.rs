// SPDX-License-Identifier: MIT OR Apache-2.0
//! How often are outliers found? `cargo bench --bench robust --features rayon [-- TRIALS [SEED [PERCENT]]]`.
//!
//! Scenes with half a degree of noise and a fraction of outliers, a third each swapped, turned by pi and
//! random. The reference is the refinement of the true inliers started at the truth, followed to its own
//! fixed point. A solve succeeds when its truncated cost exceeds that of the reference by no more than 1e-5
//! of it. With a percentage, only that fraction of outliers is run.

use bearslam::{
    Arena, Cell, Layout, Map, Outliers, Problem, RefineOptions, Scene, Sighting, SolveOptions,
    refine_map, simulate, solve,
};
use rayon::prelude::*;
use std::time::Instant;

const NOISE_DEG: f64 = 0.5;
const SIZES: [(usize, usize); 2] = [(8, 15), (12, 15)];
const SHARES: [f64; 3] = [0.0, 0.3, 0.5];

/// Standard deviations beyond which a bearing is an outlier.
const OUTLIER: f64 = 3.0;

/// The outcome of one scene.
struct Run {
    success: bool,
    /// Number of true inliers among those found, of inliers found, and of true inliers.
    right: usize,
    taken: usize,
    good: usize,
    /// Seconds.
    time: f64,
}

fn main() {
    let mut numbers = std::env::args().skip(1).filter_map(|a| a.parse().ok());
    let trials: u64 = numbers.next().unwrap_or(1000);
    let seed: u64 = numbers.next().unwrap_or(0);
    let only = numbers.next().map(|percent| percent as f64 / 100.0);
    println!("{trials} scenes a row, {NOISE_DEG} degrees of noise, seed {seed}\n");
    println!(
        "| outliers | layout | views x landmarks | success | precision | recall | median time \\[ms\\] | mean |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for share in SHARES
        .into_iter()
        .filter(|share| only.is_none_or(|only| only == *share))
    {
        for layout in [Layout::Mixed, Layout::Enclosed] {
            for (views, landmarks) in SIZES {
                let cell = Cell {
                    layout,
                    views,
                    landmarks,
                    noise: NOISE_DEG.to_radians(),
                };
                let runs: Vec<Run> = (0..trials)
                    .into_par_iter()
                    .map(|trial| run(&cell, share, cell.scene_seed(seed, trial)))
                    .collect();
                report(&cell, share, &runs);
            }
        }
    }
}

fn report(cell: &Cell, share: f64, runs: &[Run]) {
    let sum = |count: fn(&Run) -> usize| runs.iter().map(count).sum::<usize>() as f64;
    let success = sum(|run| usize::from(run.success)) / runs.len() as f64;
    let right = sum(|run| run.right);
    let (precision, recall) = (right / sum(|run| run.taken), right / sum(|run| run.good));
    let mut times: Vec<f64> = runs.iter().map(|run| run.time * 1e3).collect();
    times.sort_by(f64::total_cmp);
    let (median, mean) = (
        times[times.len() / 2],
        times.iter().sum::<f64>() / times.len() as f64,
    );
    println!(
        "| {:.0} % | {} | {} x {} | {:.2} % | {:.2} % | {:.2} % | {median:.1} | {mean:.1} |",
        100.0 * share,
        cell.layout.name(),
        cell.views,
        cell.landmarks,
        100.0 * success,
        100.0 * precision,
        100.0 * recall
    );
}

fn run(cell: &Cell, share: f64, seed: u64) -> Run {
    let Cell {
        layout,
        views,
        landmarks,
        noise,
    } = *cell;
    let clean = simulate(layout, views, landmarks, noise, seed, Arena::default()).expect("a scene");
    let (scene, wrong) = clean.contaminate(Outliers::Mixture, share, seed);
    let problem = Problem::dense(views, landmarks, &scene.bearings, noise).expect("a problem");
    let options = SolveOptions {
        robust: true,
        ..SolveOptions::default()
    };
    let begin = Instant::now();
    let found = solve(&problem, &options, None);
    let time = begin.elapsed().as_secs_f64();
    let least = from_truth(&scene, &wrong, noise);
    let (cost, inliers) = match found {
        Ok(found) => (found.cost, found.inliers),
        Err(_) => (f64::INFINITY, vec![false; wrong.len()]),
    };
    let success = cost <= least * (1.0 + 1e-5) + 1e-12;
    Run {
        success,
        right: inliers
            .iter()
            .zip(&wrong)
            .filter(|(taken, wrong)| **taken && !**wrong)
            .count(),
        taken: inliers.iter().filter(|taken| **taken).count(),
        good: wrong.iter().filter(|wrong| !**wrong).count(),
        time,
    }
}

/// The truncated cost that the truth leads to.
fn from_truth(scene: &Scene, wrong: &[bool], noise: f64) -> f64 {
    let (views, landmarks) = (scene.poses.len(), scene.landmarks.len());
    let all = Problem::dense(views, landmarks, &scene.bearings, noise).expect("a problem");
    let mut map: Map = scene.map();
    let mut kept: Vec<bool> = wrong.iter().map(|wrong| !wrong).collect();
    // Each change lowers the cost.
    for _ in 0..100 {
        let sightings: Vec<Sighting> = (0..kept.len())
            .filter(|&k| kept[k])
            .map(|k| Sighting {
                view: k / landmarks,
                landmark: k % landmarks,
                bearing: scene.bearings[k],
                sigma: noise,
            })
            .collect();
        let problem = Problem::new(views, landmarks, &sightings).expect("a problem");
        if refine_map(&problem, &mut map, &RefineOptions::default(), None).is_err() {
            break;
        }
        let next = squares(&all, &map, noise)
            .map(|square| square <= OUTLIER * OUTLIER)
            .collect();
        if next == kept {
            break;
        }
        kept = next;
    }
    squares(&all, &map, noise)
        .map(|square| 0.5 * square.min(OUTLIER * OUTLIER))
        .sum()
}

/// The squares of residual over sigma; infinite where view or landmark is undetermined.
fn squares<'a>(problem: &'a Problem, map: &'a Map, noise: f64) -> impl Iterator<Item = f64> + 'a {
    map.residuals(problem)
        .map(move |residual| residual.map_or(f64::INFINITY, |r| (r / noise) * (r / noise)))
}
