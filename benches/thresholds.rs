// SPDX-License-Identifier: MIT OR Apache-2.0
//! What hangs on each threshold?
//! `cargo bench --bench thresholds --features rayon,serde [-- [SCENES [SEED]] [NAME...]]`.
//!
//! Every option of every stage of a reconstruction is set to half and to double of its default, integers rounded and at
//! least 1, arrays element by element, all others as they are, and the scenes of the families that use its stage are
//! solved: SCENES times those that a family counts, eight times when not said. A solve fails when it has an error,
//! leaves out what the refinement from the truth determines, or costs more than that refinement or the solve with the
//! defaults by more than 1e-5. A line says how many fail at half, default and double, and the time of half and double
//! over that of the default.
//!
//! `diagnosis` does the same for the options of a diagnosis: how many findings change, of the rows of degenerate
//! configurations, of their harmless relatives, and of sparse scenes with and without odometry. NAME is part of the
//! path of an option, such as `robust/sets`, `incremental` or `diagnosis/maps`; without one all stages of a
//! reconstruction are run. Times are those of the clock: on a busy machine they say little.

#[path = "../tests/rust/leaves.rs"]
mod leaves;
#[path = "../tests/rust/shapes.rs"]
#[allow(dead_code, reason = "the tests use all of it")]
mod shapes;

use bearslam::{
    Arena, Diagnosis, DiagnosisOptions, Layout, Loss, Map, Outliers, Problem, Reconstruction,
    RefineOptions, Scene, SolveOptions, StageOptions, Strategy, diagnose_with, refine, simulate,
    solve,
};
use leaves::{leaves, with};
use rayon::prelude::*;
use serde_json::{Value, from_value, json, to_value};
use shapes::{DEGENERATE, Drawn, HARMLESS};
use std::time::Instant;

/// Relative excess of a cost over the least that is known from which a solve has missed it.
const MISSED: f64 = 1e-5;

/// Kinds of scenes: name, the stages that solve them, scenes counted once, and the scene of a number.
type Family = (
    &'static str,
    &'static [&'static str],
    u64,
    fn(u64) -> (Scene, Problem, SolveOptions),
);

const FAMILIES: [Family; 7] = [
    (
        "search",
        &[
            "sight",
            "draw",
            "hypotheses",
            "minima",
            "moves",
            "judge",
            "infinity",
        ],
        30,
        search,
    ),
    (
        "limited sight",
        &["sight", "draw", "incremental", "moves", "judge", "infinity"],
        2,
        limited,
    ),
    (
        "global",
        &["draw", "relative_headings", "averaging", "positions"],
        2,
        global,
    ),
    (
        "odometry",
        &["posterior", "odometry_growth", "stride", "judge"],
        3,
        odometry,
    ),
    ("outliers", &["robust", "judge", "infinity"], 2, outliers),
    ("four landmarks, outliers", &["robust"], 2, few_outliers),
    (
        "odometry, outliers",
        &[
            "robust",
            "posterior",
            "odometry_growth",
            "robust_growth",
            "odometry_sweeps",
            "judge",
        ],
        1,
        odometry_outliers,
    ),
];

fn scene(layout: Layout, size: (usize, usize), degrees: f64, seed: u64, sight: f64) -> Scene {
    let arena = Arena {
        sight,
        ..Arena::default()
    };
    simulate(layout, size.0, size.1, degrees.to_radians(), seed, arena).expect("a scene")
}

fn dense(scene: &Scene, sigma: f64) -> Problem {
    let size = (scene.poses.len(), scene.landmarks.len());
    Problem::dense(size.0, size.1, &scene.bearings, sigma).expect("a problem")
}

/// The sigma of half of the scenes is stated, that of the others is not.
fn sigma(degrees: f64, seed: u64) -> f64 {
    if seed.is_multiple_of(2) {
        1.0
    } else {
        degrees.to_radians()
    }
}

fn layout(seed: u64) -> Layout {
    [Layout::Mixed, Layout::Enclosed][(seed / 2 % 2) as usize]
}

/// The paper's layouts, small: one to two and a quarter degrees, three views and four landmarks upwards.
fn search(seed: u64) -> (Scene, Problem, SolveOptions) {
    let views = [3, 4, 4, 5, 6, 8, 12][(seed % 7) as usize];
    let landmarks = [4, 5, 6, 7, 9][(seed % 5) as usize];
    let degrees = [1.0, 2.23][(seed % 2) as usize];
    let size = (views, landmarks.max(if views == 3 { 5 } else { 4 }));
    let scene = scene(layout(seed), size, degrees, seed, f64::INFINITY);
    let problem = dense(&scene, sigma(degrees, seed / 4));
    (scene, problem, SolveOptions::default())
}

/// Views along a loop that see a part of the landmarks, and views anywhere.
fn limited(seed: u64) -> (Scene, Problem, SolveOptions) {
    let (layout, size, sight) = [
        (Layout::Trajectory, (50, 50), 1.8),
        (Layout::Trajectory, (35, 50), 2.0),
        (Layout::Mixed, (24, 32), 2.5),
    ][(seed % 3) as usize];
    let scene = scene(layout, size, 0.5, seed, sight);
    let problem = dense(&scene, sigma(0.5, seed));
    (scene, problem, SolveOptions::default())
}

fn global(seed: u64) -> (Scene, Problem, SolveOptions) {
    let (scene, problem, options) = limited(seed);
    let strategy = Strategy::Global;
    let options = SolveOptions {
        strategy,
        ..options
    };
    (scene, problem, options)
}

/// A long loop with odometry, of which each view sees a few landmarks.
fn odometry(seed: u64) -> (Scene, Problem, SolveOptions) {
    let (views, landmarks, sight) =
        [(150, 40, 1.2), (60, 30, 1.2), (30, 20, 1.5)][(seed % 3) as usize];
    let scene = scene(Layout::Trajectory, (views, landmarks), 1.0, seed, sight);
    let motions = scene.odometry([0.1, 0.1, 0.05], seed).expect("odometry");
    let problem = dense(&scene, 1.0_f64.to_radians());
    let problem = problem.with_odometry(&motions).expect("a problem");
    (scene, problem, SolveOptions::default())
}

/// With outliers expected.
fn robust() -> SolveOptions {
    SolveOptions {
        robust: true,
        ..SolveOptions::default()
    }
}

/// Three bearings in ten are wrong.
fn outliers(seed: u64) -> (Scene, Problem, SolveOptions) {
    let clean = scene(layout(seed), (8, 15), 0.5, seed, f64::INFINITY);
    let (scene, _) = clean.contaminate(Outliers::Mixture, 0.3, seed);
    let problem = dense(&scene, 0.5_f64.to_radians());
    (scene, problem, robust())
}

/// So few landmarks that no three views share five: plain hypotheses start.
fn few_outliers(seed: u64) -> (Scene, Problem, SolveOptions) {
    let clean = scene(layout(seed), (10, 4), 0.5, seed, f64::INFINITY);
    let (scene, _) = clean.contaminate(Outliers::Mixture, 0.05, seed);
    let problem = dense(&scene, 0.5_f64.to_radians());
    (scene, problem, robust())
}

/// A loop with odometry; one bearing in seven is wrong.
fn odometry_outliers(seed: u64) -> (Scene, Problem, SolveOptions) {
    let clean = scene(Layout::Trajectory, (50, 25), 1.0, seed, 1.5);
    let motions = clean.odometry([0.1, 0.1, 0.05], seed).expect("odometry");
    let (scene, _) = clean.contaminate(Outliers::Mixture, 0.15, seed);
    let problem = dense(&scene, 1.0_f64.to_radians());
    let problem = problem.with_odometry(&motions).expect("a problem");
    (scene, problem, robust())
}

/// A problem, what it should lead to, and how it is solved with the defaults.
struct Case {
    problem: Problem,
    options: SolveOptions,
    /// Views and landmarks that the refinement from the truth determines, and the least cost known.
    reached: usize,
    least: f64,
    default: Run,
}

/// What a solve has come to, and its seconds.
#[derive(Clone, Copy)]
struct Run {
    reached: usize,
    cost: f64,
    time: f64,
}

fn reached(found: &Reconstruction) -> usize {
    let count =
        |map: &Map| map.poses.iter().flatten().count() + map.landmarks.iter().flatten().count();
    count(&found.map)
        + found
            .components
            .iter()
            .map(|c| count(&c.map))
            .sum::<usize>()
}

fn run(problem: &Problem, options: &SolveOptions) -> Run {
    let begin = Instant::now();
    let found = solve(problem, options, None);
    let time = begin.elapsed().as_secs_f64();
    let (reached, cost) = found.map_or((0, f64::INFINITY), |f| (reached(&f), f.cost));
    Run {
        reached,
        cost,
        time,
    }
}

impl Case {
    fn new((scene, problem, options): (Scene, Problem, SolveOptions)) -> Self {
        // What a robust solve minimises is this loss.
        let loss = if options.robust {
            Loss::Truncated(Loss::<f64>::TRUNCATED)
        } else {
            Loss::Squared
        };
        let refinement = RefineOptions {
            loss,
            ..RefineOptions::default()
        };
        let truth = refine(&problem, &scene.map(), &refinement, None);
        let (wanted, cost) = truth.map_or((0, f64::INFINITY), |t| (reached(&t), t.cost));
        let default = run(&problem, &options);
        Self {
            reached: wanted.min(default.reached.max(1)),
            least: cost.min(default.cost),
            problem,
            options,
            default,
        }
    }

    fn fails(&self, run: &Run) -> bool {
        run.reached < self.reached || !(run.cost <= self.least * (1.0 + MISSED) + 1e-12)
    }
}

/// Half or double of a number.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a small number, at least 1"
)]
fn scaled(number: &Value, factor: f64) -> Value {
    let value = number.as_f64().expect("a number") * factor;
    if number.is_f64() {
        json!(value)
    } else {
        json!(value.round().max(1.0) as u64)
    }
}

fn shown(value: &Value) -> String {
    value.to_string().replace(',', ", ")
}

/// One line for each option of the stages whose path contains one of the names.
fn reconstruction(scenes: u64, seed: u64, names: &[String]) {
    let default = to_value(StageOptions::default()).expect("options");
    let cases: Vec<Vec<Case>> = FAMILIES
        .iter()
        .map(|(_, _, count, draw)| {
            (seed..seed + count * scenes)
                .into_par_iter()
                .map(|seed| Case::new(draw(seed)))
                .collect()
        })
        .collect();
    for ((name, _, _, _), cases) in FAMILIES.iter().zip(&cases) {
        let failures = cases.iter().filter(|c| c.fails(&c.default)).count();
        let time: f64 = cases.iter().map(|c| c.default.time).sum();
        println!("{name}: {failures} of {} fail, {time:.1} s", cases.len());
    }
    println!("\n| option | default | scenes | half | default | double | time half | double |");
    println!("|---|---|---|---|---|---|---|---|");
    for path in leaves(&default) {
        if !names.is_empty() && !names.iter().any(|name| path.contains(name)) {
            continue;
        }
        let stage = path.split('/').nth(1).expect("a stage");
        let used: Vec<&Case> = FAMILIES
            .iter()
            .zip(&cases)
            .filter(|((_, stages, _, _), _)| stages.contains(&stage))
            .flat_map(|(_, cases)| cases)
            .collect();
        assert!(!used.is_empty(), "no family solves with {path}");
        let usual: f64 = used.iter().map(|case| case.default.time).sum();
        let [half, double] = [0.5, 2.0].map(|factor| {
            let changed = with(&default, &path, |number| scaled(number, factor));
            let stages: StageOptions = from_value(changed).expect("options");
            let runs: Vec<(bool, f64)> = used
                .par_iter()
                .map(|case| {
                    let options = SolveOptions {
                        stages,
                        ..case.options
                    };
                    let run = run(&case.problem, &options);
                    (case.fails(&run), run.time)
                })
                .collect();
            let failures = runs.iter().filter(|(fails, _)| *fails).count();
            (
                failures,
                runs.iter().map(|(_, time)| time).sum::<f64>() / usual,
            )
        });
        println!(
            "| {} | {} | {} | {} | {} | {} | {:.2} | {:.2} |",
            &path[1..],
            shown(default.pointer(&path).expect("an option")),
            used.len(),
            half.0,
            used.iter().filter(|case| case.fails(&case.default)).count(),
            double.0,
            half.1,
            double.1
        );
    }
}

/// Problems to diagnose, some with a map.
fn diagnosed(scenes: u64, seed: u64) -> Vec<(Problem, Option<Map>)> {
    let mut all = Vec::new();
    let noise = 0.1_f64.to_radians();
    for seed in seed..seed + scenes {
        for (_, views, landmarks, sizes, _) in DEGENERATE.iter().chain(&HARMLESS) {
            for &size in *sizes {
                let exact = Drawn::new(*views, *landmarks, size, 0.0, seed);
                let noisy = Drawn::new(*views, *landmarks, size, noise, seed);
                all.push((exact.problem(1.0), Some(exact.truth())));
                all.push((exact.problem(1.0), None));
                all.push((noisy.problem(noise), None));
            }
        }
        for sight in [1.5, 2.5] {
            let sparse = scene(Layout::Trajectory, (12, 12), 0.1, seed, sight);
            let problem = dense(&sparse, noise);
            let motions = sparse.odometry([0.05, 0.05, 0.02], seed).expect("odometry");
            let tied = problem.clone().with_odometry(&motions);
            all.push((problem, None));
            all.push((tied.expect("a problem"), None));
        }
    }
    all
}

/// What a diagnosis says, without the words.
fn said(diagnosis: &Diagnosis) -> Vec<String> {
    let findings = diagnosis.findings.iter().map(|f| {
        format!(
            "{} {:?} {:?} {:?} {}",
            f.kind.name(),
            f.severity,
            f.views,
            f.landmarks,
            f.directions
        )
    });
    findings.collect()
}

/// One line for each option of a diagnosis whose path contains one of the names.
fn diagnosis(scenes: u64, seed: u64, names: &[String]) {
    let default = to_value(DiagnosisOptions::default()).expect("options");
    let problems = diagnosed(scenes, seed);
    let all = |options: &DiagnosisOptions| -> (Vec<Vec<String>>, f64) {
        let runs: Vec<(Vec<String>, f64)> = problems
            .par_iter()
            .map(|(problem, map)| {
                let begin = Instant::now();
                let found = diagnose_with(problem, map.as_ref(), options, None);
                let time = begin.elapsed().as_secs_f64();
                (said(&found.expect("a diagnosis")), time)
            })
            .collect();
        let time = runs.iter().map(|(_, time)| time).sum();
        (runs.into_iter().map(|(said, _)| said).collect(), time)
    };
    let (usual, time) = all(&DiagnosisOptions::default());
    println!("{} diagnoses, {time:.1} s\n", usual.len());
    println!(
        "| option | default | changed by half | changed by double | time half | double |\n|---|---|---|---|---|---|"
    );
    for path in leaves(&default) {
        let full = format!("diagnosis{path}");
        if !names.iter().any(|name| full.contains(name)) {
            continue;
        }
        let [half, double] = [0.5, 2.0].map(|factor| {
            let changed = with(&default, &path, |number| scaled(number, factor));
            let (found, taken) = all(&from_value(changed).expect("options"));
            let changes = found.iter().zip(&usual).filter(|(a, b)| a != b).count();
            (changes, taken / time)
        });
        println!(
            "| {full} | {} | {} | {} | {:.2} | {:.2} |",
            shown(default.pointer(&path).expect("an option")),
            half.0,
            double.0,
            half.1,
            double.1
        );
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let mut numbers = words.iter().filter_map(|word| word.parse().ok());
    let scenes: u64 = numbers.next().unwrap_or(8);
    let seed: u64 = numbers.next().unwrap_or(0);
    // Cargo adds `--bench`.
    let names = words
        .iter()
        .filter(|word| word.parse::<u64>().is_err() && !word.starts_with('-'));
    let (of_diagnosis, of_stages): (Vec<String>, Vec<String>) = names
        .cloned()
        .partition(|name| name.starts_with("diagnosis"));
    if !of_diagnosis.is_empty() {
        diagnosis(scenes, seed, &of_diagnosis);
    }
    if of_diagnosis.is_empty() || !of_stages.is_empty() {
        println!("{scenes} times the scenes of each family, seed {seed}");
        reconstruction(scenes, seed, &of_stages);
    }
}
