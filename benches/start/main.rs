// SPDX-License-Identifier: MIT OR Apache-2.0
//! Does `solve` find the minimum from whatever is known?
//! `cargo bench --bench start --features rayon [-- [SCENES [SEED]] [CLASS ...] [verbose]]`.
//!
//! Classes of scenes with odometry, beacons, positions, compasses or nothing but bearings under limited sight; a class
//! is named by the beginning of its name. A solve fails when it does not determine all that the refinement started at the
//! truth determines with redundant sightings, or when its cost over the sightings that both explain is higher by more
//! than 1e-5 of it (of 1 where it is below). A landmark may be listed at infinity instead: its bearings still count.
//! It fails silently when it has converged all the same, as one map, with an uncertainty below 0.2 and nothing
//! undetermined.
//! With outliers the cost is the truncated one, and the truth is followed to its own fixed point. Scenes of
//! which the truth itself cannot be refined, or leaves a part of its map free, are not counted.

mod scenes;
mod truth;

use bearslam::{
    Error, Problem, Reconstruction, RefineOptions, SolveOptions, Subject, Why, refine, solve,
};
use rayon::prelude::*;
use scenes::{CLASSES, Class, Instance};
use std::time::Instant;
use truth::truncated_from_truth;

/// What came of one scene.
struct Run {
    seed: u64,
    failed: bool,
    silent: bool,
    what: String,
    /// Seconds.
    time: f64,
    truth_time: f64,
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let mut numbers = words.iter().filter_map(|word| word.parse().ok());
    let scenes: Option<u64> = numbers.next();
    let seed: u64 = numbers.next().unwrap_or(0);
    let verbose = words.iter().any(|word| word == "verbose");
    let names: Vec<&String> = words
        .iter()
        .filter(|word| {
            CLASSES
                .iter()
                .any(|class| class.name.starts_with(word.as_str()))
        })
        .collect();
    println!(
        "| class | scenes | not counted | failures | silent | median time \\[ms\\] | worst \\[ms\\] | truth \\[ms\\] |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for class in CLASSES {
        if !names.is_empty()
            && !names
                .iter()
                .any(|name| class.name.starts_with(name.as_str()))
        {
            continue;
        }
        let scenes = scenes.unwrap_or(class.scenes);
        let runs: Vec<Run> = (seed..seed + scenes)
            .into_par_iter()
            .filter_map(|seed| run(&class, seed))
            .collect();
        report(&class, scenes, &runs, verbose);
    }
}

fn report(class: &Class, scenes: u64, runs: &[Run], verbose: bool) {
    let failures = runs.iter().filter(|run| run.failed).count();
    let silent = runs.iter().filter(|run| run.silent).count();
    let sorted = |time: fn(&Run) -> f64| {
        let mut times: Vec<f64> = runs.iter().map(|run| time(run) * 1e3).collect();
        times.sort_by(f64::total_cmp);
        times
    };
    let (times, truth) = (sorted(|run| run.time), sorted(|run| run.truth_time));
    let middle = |times: &[f64]| times.get(times.len() / 2).copied().unwrap_or(f64::NAN);
    println!(
        "| {} | {} | {} | {failures} ({:.2} %) | {silent} | {:.1} | {:.0} | {:.1} |",
        class.name,
        runs.len(),
        scenes - runs.len() as u64,
        100.0 * failures as f64 / runs.len().max(1) as f64,
        middle(&times),
        times.last().copied().unwrap_or(f64::NAN),
        middle(&truth),
    );
    for run in runs.iter().filter(|run| verbose && run.failed) {
        let silent = if run.silent { "silent: " } else { "" };
        println!("    seed {}: {silent}{}", run.seed, run.what);
    }
}

/// Solves one scene; `None` when its truth cannot be refined.
fn run(class: &Class, seed: u64) -> Option<Run> {
    let instance = (class.build)(seed);
    let begin = Instant::now();
    let truth = least(class, &instance)?;
    let truth_time = begin.elapsed().as_secs_f64();
    let options = SolveOptions {
        robust: class.robust,
        ..SolveOptions::default()
    };
    let begin = Instant::now();
    let found = solve(&instance.problem, &options, None);
    let time = begin.elapsed().as_secs_f64();
    let failed = match (&truth, &found) {
        (_, Err(_)) => true,
        (Least::Cost(least), Ok(found)) => found.cost > least + 1e-5 * least.max(1.0),
        (Least::Map(truth), Ok(found)) => is_missed(&instance.problem, truth, found),
    };
    let silent = failed
        && found.as_ref().is_ok_and(|found| {
            found.termination.was_successful()
                && found.uncertainty < 0.2
                && found.components.is_empty()
                && found.undetermined.is_empty()
        });
    let what = if failed {
        describe(&found, &truth)
    } else {
        String::new()
    };
    Some(Run {
        seed,
        failed,
        silent,
        what,
        time,
        truth_time,
    })
}

/// What a map is measured by.
enum Least {
    /// The minimum that the truth leads to.
    Map(Box<Reconstruction>),
    /// Its truncated cost.
    Cost(f64),
}

fn least(class: &Class, instance: &Instance) -> Option<Least> {
    if class.robust {
        return truncated_from_truth(instance).map(Least::Cost);
    }
    let options = RefineOptions {
        max_iterations: 1000,
        ..RefineOptions::default()
    };
    let truth = refine(&instance.problem, &instance.truth, &options, None).ok()?;
    // A scene that does not determine its own map says nothing about a start.
    let counts = class.free || !(truth.uncertainty >= 1.0);
    (truth.termination.was_successful() && counts).then(|| Least::Map(Box::new(truth)))
}

/// Whether a map lacks what the truth leads to, or fits worse where both explain a sighting.
fn is_missed(problem: &Problem, truth: &Reconstruction, found: &Reconstruction) -> bool {
    let at_infinity = |landmark: usize| {
        let landmark = Subject::Landmark(landmark);
        let mut listed = found.undetermined.iter();
        listed.any(|one| one.subject == landmark && one.why == Why::AtInfinity)
    };
    let lost = |landmark: &usize| {
        truth.map.landmarks[*landmark].is_some()
            && found.map.landmarks[*landmark].is_none()
            && !at_infinity(*landmark)
    };
    let mut poses = truth.map.poses.iter().zip(&found.map.poses);
    let pairs = problem
        .sightings()
        .iter()
        .zip(truth.map.residuals(problem))
        .zip(found.map.residuals(problem));
    let beyond: f64 = pairs
        .filter(|((_, truth), _)| truth.is_none())
        .filter_map(|((sighting, _), found)| Some((found? * sighting.weight).powi(2)))
        .sum();
    // What no redundant sighting checks could be anywhere.
    let components: usize = found.components.iter().map(|one| one.freedom).sum();
    let checked = truth.freedom > found.freedom + components;
    (checked
        && (poses.any(|(truth, found)| truth.is_some() && found.is_none())
            || (0..problem.landmarks()).any(|landmark| lost(&landmark))))
        || found.cost - 0.5 * beyond > truth.cost + 1e-5 * truth.cost.max(1.0)
}

fn describe(found: &Result<Reconstruction, Error>, truth: &Least) -> String {
    let least = match truth {
        Least::Map(truth) => format!(
            "cost {:.4}, freedom {}, undetermined {}",
            truth.cost,
            truth.freedom,
            list(truth)
        ),
        Least::Cost(cost) => format!("cost {cost:.4}"),
    };
    match found {
        Err(error) => format!("{error}; truth {least}"),
        Ok(found) => format!(
            "cost {:.4}, {}, uncertainty {:.3}, {} components, undetermined {}, {} outliers; truth {least}",
            found.cost,
            found.termination,
            found.uncertainty,
            found.components.len(),
            list(found),
            found.inliers.iter().filter(|inlier| !**inlier).count(),
        ),
    }
}

fn list(found: &Reconstruction) -> String {
    let each = found.undetermined.iter();
    let each = each.map(|one| format!("{:?} {:?}", one.subject, one.why));
    format!("[{}]", each.collect::<Vec<_>>().join(", "))
}
