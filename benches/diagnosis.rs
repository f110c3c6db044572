// SPDX-License-Identifier: MIT OR Apache-2.0
//! How often the diagnosis is right: `cargo bench --bench diagnosis [-- SCENES]`.
//!
//! First, for each row of the table of degenerate configurations, drawn many times: how often it is named at
//! the true map, from exact bearings alone, and from noisy ones. Then, for regular scenes: how often there is
//! a false alarm. With `VERBOSE` in the environment the misses are printed.

#[path = "../tests/rust/shapes.rs"]
#[allow(dead_code, reason = "the tests use all of it")]
mod shapes;

use bearslam::{Arena, Diagnosis, Layout, Problem, Severity, diagnose, simulate};
use shapes::{DEGENERATE, Drawn, HARMLESS};
use std::time::Instant;

const NOISES_DEG: [f64; 3] = [0.01, 0.03, 0.1];
const SIZES: [(usize, usize); 4] = [(4, 7), (5, 9), (8, 11), (12, 15)];

fn named(diagnosis: &Diagnosis, name: &str) -> bool {
    let mut alarms = diagnosis.findings.iter();
    alarms.any(|f| f.kind.name() == name && f.severity < Severity::Note)
}

fn main() {
    let mut numbers = std::env::args().skip(1).filter_map(|a| a.parse().ok());
    let scenes: u64 = numbers.next().unwrap_or(1000);
    let verbose = std::env::var("VERBOSE").is_ok();
    let draws = (scenes / 20).max(5);
    println!("named, of {draws} scenes each\n");
    print!("| row | size | at the truth | with that count | exact bearings");
    for noise in NOISES_DEG {
        print!(" | {noise} deg stated | {noise} deg unstated");
    }
    println!(" |\n|{}", "---|".repeat(5 + 2 * NOISES_DEG.len()));
    for (name, views, landmarks, sizes, extra) in DEGENERATE {
        for &size in sizes {
            let count = |test: &dyn Fn(u64) -> (Drawn, Problem, bool)| {
                (0..draws)
                    .filter(|&seed| {
                        let (scene, problem, given) = test(seed);
                        let truth = scene.truth();
                        let found = diagnose(&problem, given.then_some(&truth), None).unwrap();
                        let right = named(&found, name);
                        if !right && verbose {
                            println!("{name} {size:?} seed {seed}:\n{found}\n");
                        }
                        right
                    })
                    .count()
            };
            let exact = |seed| Drawn::new(views, landmarks, size, 0.0, seed);
            let at_truth = count(&|seed| {
                let scene = exact(seed);
                let problem = scene.problem(1.0);
                (scene, problem, true)
            });
            let counted = (0..draws).filter(|&seed| {
                let scene = exact(seed);
                let found = diagnose(&scene.problem(1.0), Some(&scene.truth()), None).unwrap();
                let finding = found.findings.iter().find(|f| f.kind.name() == name);
                found.extra == extra && finding.is_some_and(|f| f.directions == extra)
            });
            let counted = counted.count();
            let alone = count(&|seed| {
                let scene = exact(seed);
                let problem = scene.problem(1.0);
                (scene, problem, false)
            });
            print!(
                "| {name} | {}x{} | {at_truth} | {counted} | {alone}",
                size.0, size.1
            );
            for noise in NOISES_DEG.map(f64::to_radians) {
                for sigma in [noise, 1.0] {
                    let noisy = count(&|seed| {
                        let scene = Drawn::new(views, landmarks, size, noise, seed);
                        let problem = scene.problem(sigma);
                        (scene, problem, false)
                    });
                    print!(" | {noisy}");
                }
            }
            println!(" |");
        }
    }
    println!(
        "\nharmless relatives: errors, warnings of {draws} scenes each: exact at the truth, exact alone, 0.1 deg\n"
    );
    for (name, views, landmarks, sizes, _) in HARMLESS {
        for &size in sizes {
            let mut counts = [[0; 2]; 3];
            for seed in 0..draws {
                let exact = Drawn::new(views, landmarks, size, 0.0, seed);
                let noisy = Drawn::new(views, landmarks, size, 0.1_f64.to_radians(), seed);
                let found = [
                    diagnose(&exact.problem(1.0), Some(&exact.truth()), None).unwrap(),
                    diagnose(&exact.problem(1.0), None, None).unwrap(),
                    diagnose(&noisy.problem(1.0), None, None).unwrap(),
                ];
                for (k, found) in found.iter().enumerate() {
                    match found.worst() {
                        Some(Severity::Error) => counts[k][0] += 1,
                        Some(Severity::Warning) => counts[k][1] += 1,
                        _ => continue,
                    }
                    if verbose {
                        println!("{name} {size:?} seed {seed} way {k}: {found}\n");
                    }
                }
            }
            println!("| {name} | {}x{} | {counts:?} |", size.0, size.1);
        }
    }
    println!("\ngeneric scenes with an alarm\n");
    let mut total = [[0; 2]; 3];
    let begin = Instant::now();
    for seed in 0..scenes {
        let (views, landmarks) = SIZES[(seed % 4) as usize];
        let layout = [Layout::Mixed, Layout::Enclosed][(seed / 4 % 2) as usize];
        for (way, noise) in [0.0, 0.1, 0.5].into_iter().enumerate() {
            let noise = f64::to_radians(noise);
            let scene = simulate(layout, views, landmarks, noise, seed, Arena::default()).unwrap();
            let problem = Problem::dense(views, landmarks, &scene.bearings, 1.0).unwrap();
            let found = diagnose(&problem, None, None).unwrap();
            total[way][0] += usize::from(found.worst() == Some(Severity::Error));
            total[way][1] += usize::from(found.worst() == Some(Severity::Warning));
            if found.worst().is_some_and(|s| s < Severity::Note) {
                println!("{layout:?} {views}x{landmarks} {noise:.4} seed {seed}: {found}\n");
            }
        }
    }
    let each = begin.elapsed().as_secs_f64() / (3 * scenes) as f64;
    println!(
        "errors, warnings of {scenes} scenes at 0, 0.1, 0.5 deg: {total:?}; {:.2} ms each",
        1e3 * each
    );
}
