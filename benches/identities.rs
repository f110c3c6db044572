// SPDX-License-Identifier: MIT OR Apache-2.0
//! Are maps right when identities are wrong?
//! `cargo bench --bench identities --features rayon [-- TRIALS [SEED [CLASS]] [without]]`.
//!
//! CLASS is one of those below, from 0. `without` ranks maps by cost alone, and assigns no identities.
//!
//! Scenes of 12 x 15, mixed, with a share of the identities exchanged within each view, and with two landmarks under one
//! identity. A map is *true* when its cost over the correct bearings is at most 1.5 times that of the refinement of
//! these from the truth, and the root-mean-square error of its landmarks at most three times what that refinement
//! predicts. A wrong map is *silent* when it has converged, and neither an alternative nor a finding that is a warning
//! says so.

use bearslam::{
    Arena, Cell, Frame, Layout, Loss, Map, Outliers, Problem, Reconstruction, RefineOptions, Scene,
    Severity, Sighting, SolveOptions, TestOptions, align, covariance, fit_findings, refine_map,
    simulate, solve, test_fit,
};
use nalgebra::Point2;
use rayon::prelude::*;
use std::time::Instant;

const SIZE: (usize, usize) = (12, 15);
const CLASSES: [(Outliers, f64); 7] = [
    (Outliers::Exchanged, 0.0),
    (Outliers::Exchanged, 0.3),
    (Outliers::Exchanged, 0.4),
    (Outliers::Exchanged, 0.5),
    // One pair, three pairs, and all.
    (Outliers::Merged, 0.01),
    (Outliers::Merged, 0.09),
    (Outliers::Mixture, 0.4),
];
const NOISES_DEG: [f64; 2] = [0.5, 2.23];

/// Factors of the definition of a true map.
const COST: f64 = 1.5;
const ERROR: f64 = 3.0;
/// Share of the correct bearings that a true map has to cover.
const COVERED: f64 = 0.9;

#[derive(Clone, Copy, PartialEq)]
enum Outcome {
    True,
    TrueWithWarning,
    Silent,
    WrongWithWarning,
    Refused,
}

/// The outcome of one scene.
struct Run {
    outcome: Outcome,
    /// Share of the bearings explained after assignment; 0 when refused.
    explained: f64,
    seconds: f64,
}

fn main() {
    let mut numbers = std::env::args().skip(1).filter_map(|a| a.parse().ok());
    let trials: u64 = numbers.next().unwrap_or(100);
    let seed: u64 = numbers.next().unwrap_or(0);
    let only: Option<u64> = numbers.next();
    let identities = !std::env::args().any(|argument| argument == "without");
    println!("{trials} scenes a row of 12 x 15, mixed, seed {seed}\n");
    println!(
        "| outliers | noise \\[deg\\] | true | of these with a warning | wrong, silent | wrong, warned of | refused \
         | explained: true maps, 5 % | wrong, 95 % | median time \\[ms\\] | mean |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for noise_deg in NOISES_DEG {
        for (class, (kind, share)) in CLASSES.into_iter().enumerate() {
            if only.is_some_and(|only| only != class as u64) {
                continue;
            }
            let cell = Cell {
                layout: Layout::Mixed,
                views: SIZE.0,
                landmarks: SIZE.1,
                noise: noise_deg.to_radians(),
            };
            let runs: Vec<Run> = (0..trials)
                .into_par_iter()
                .map(|trial| run(&cell, kind, share, cell.scene_seed(seed, trial), identities))
                .collect();
            report(kind, share, noise_deg, &runs);
        }
    }
}

fn report(kind: Outliers, share: f64, noise_deg: f64, runs: &[Run]) {
    use Outcome::{Refused, Silent, True, TrueWithWarning, WrongWithWarning};
    let count = |is: &[Outcome]| runs.iter().filter(|run| is.contains(&run.outcome)).count();
    let quantile = |mut values: Vec<f64>, at: f64| {
        values.sort_by(f64::total_cmp);
        let place = (at * values.len() as f64) as usize;
        values
            .get(place.min(values.len().saturating_sub(1)))
            .copied()
    };
    let explained = |is: &[Outcome], at: f64| {
        let of = runs.iter().filter(|run| is.contains(&run.outcome));
        let value = quantile(of.map(|run| 100.0 * run.explained).collect(), at);
        value.map_or("-".into(), |value| format!("{value:.0} %"))
    };
    let times: Vec<f64> = runs.iter().map(|run| 1e3 * run.seconds).collect();
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    println!(
        "| {} {:.0} % | {noise_deg} | {:.1} % | {} | {} | {} | {} | {} | {} | {:.0} | {mean:.0} |",
        kind.name(),
        100.0 * share,
        100.0 * count(&[True, TrueWithWarning]) as f64 / runs.len() as f64,
        count(&[TrueWithWarning]),
        count(&[Silent]),
        count(&[WrongWithWarning]),
        count(&[Refused]),
        explained(&[True, TrueWithWarning], 0.05),
        explained(&[Silent, WrongWithWarning], 0.95),
        quantile(times, 0.5).unwrap_or(0.0),
    );
}

fn run(cell: &Cell, kind: Outliers, share: f64, seed: u64, identities: bool) -> Run {
    let Cell {
        layout,
        views,
        landmarks,
        noise,
    } = *cell;
    let clean = simulate(layout, views, landmarks, noise, seed, Arena::default()).expect("a scene");
    let (scene, wrong) = clean.contaminate(kind, share, seed);
    let problem = Problem::dense(views, landmarks, &scene.bearings, noise).expect("a problem");
    let mut options = SolveOptions {
        robust: true,
        ..SolveOptions::default()
    };
    if !identities {
        // No map explains so much.
        options.stages.identities.believed = 2.0;
        options.stages.identities.telling = 2.0;
    }
    let begin = Instant::now();
    let found = solve(&problem, &options, None);
    let seconds = begin.elapsed().as_secs_f64();
    let Ok(found) = found else {
        return Run {
            outcome: Outcome::Refused,
            explained: 0.0,
            seconds,
        };
    };
    let is_true = is_true(&scene, &wrong, noise, &found.map);
    let outcome = match (is_true, is_silent(&problem, &found)) {
        (true, true) => Outcome::True,
        (true, false) => Outcome::TrueWithWarning,
        (false, true) => Outcome::Silent,
        (false, false) => Outcome::WrongWithWarning,
    };
    Run {
        outcome,
        explained: found.explained.unwrap_or(0) as f64 / problem.sightings().len() as f64,
        seconds,
    }
}

fn is_silent(problem: &Problem, found: &Reconstruction) -> bool {
    let test = test_fit(problem, found, &TestOptions::default(), None).expect("a test");
    let warns = |finding: &bearslam::Finding| finding.severity != Severity::Note;
    found.termination.was_successful()
        && found.alternatives.is_empty()
        && !fit_findings(problem, &test).iter().any(warns)
}

/// Whether a map is that of the correct bearings.
fn is_true(scene: &Scene, wrong: &[bool], noise: f64, map: &Map) -> bool {
    let landmarks = scene.landmarks.len();
    let correct = |covered: &dyn Fn(usize, usize) -> bool| {
        let sightings: Vec<Sighting> = (0..wrong.len())
            .map(|k| (k, k / landmarks, k % landmarks))
            .filter(|&(k, view, landmark)| {
                !wrong[k] && !scene.bearings[k].is_nan() && covered(view, landmark)
            })
            .map(|(k, view, landmark)| Sighting {
                view,
                landmark,
                bearing: scene.bearings[k],
                sigma: noise,
            })
            .collect();
        Problem::new(scene.poses.len(), landmarks, &sightings).expect("a problem")
    };
    let all = correct(&|_, _| true);
    let covered =
        correct(&|view, landmark| map.poses[view].is_some() && map.landmarks[landmark].is_some());
    if (covered.sightings().len() as f64) < COVERED * all.sightings().len() as f64 {
        return false;
    }
    let cost = |problem: &Problem, map: &Map| -> f64 {
        let residuals = map.residuals(problem).flatten();
        0.5 * residuals.map(|r| (r / noise) * (r / noise)).sum::<f64>()
    };
    let mut truth = scene.map();
    if refine_map(&all, &mut truth, &RefineOptions::default(), None).is_err() {
        return false;
    }
    let both: Vec<usize> = (0..landmarks)
        .filter(|&j| map.landmarks[j].is_some() && truth.landmarks[j].is_some())
        .collect();
    let points: Vec<Point2<f64>> = both.iter().filter_map(|&j| map.landmarks[j]).collect();
    let true_points: Vec<Point2<f64>> = both.iter().map(|&j| scene.landmarks[j]).collect();
    let (Ok(similarity), Ok(scale)) = (
        align(&points, &true_points),
        align(&truth_points(&truth, &both), &true_points),
    ) else {
        return false;
    };
    let squares = points.iter().zip(&true_points);
    let error: f64 = squares
        .map(|(p, q)| (similarity * p - q).norm_squared())
        .sum();
    let Ok(predicted) = covariance(&all, &truth, Loss::Squared, Frame::FreeNetwork, None) else {
        return false;
    };
    let variances = both.iter().filter_map(|&j| predicted.landmarks[j]);
    let variance: f64 = variances.map(|block| block.trace()).sum();
    let predicted = variance * scale.scaling() * scale.scaling();
    cost(&covered, map) <= COST * cost(&covered, &truth) && error <= ERROR * ERROR * predicted
}

fn truth_points(map: &Map, of: &[usize]) -> Vec<Point2<f64>> {
    of.iter().filter_map(|&j| map.landmarks[j]).collect()
}
