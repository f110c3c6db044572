// SPDX-License-Identifier: MIT OR Apache-2.0
//! Noise-free scenes: is the truth recovered? `cargo bench --bench recovery --features rayon [-- SCENES]`.
//!
//! Every scene of every size ends in one of the columns:
//! - `found`: the map equals the truth up to a similarity, to 1e-7 of the scene's size;
//! - `twin`: another map explains the bearings exactly, and the truth is among its alternatives;
//! - `degenerate`: an error that names the degeneracy;
//! - `ill-conditioned`: the result says so, by its sensitivity (above 1e4 per radian) or by reaching the maximum
//!   number of iterations;
//! - `lost`: none of these.

use bearslam::{
    Arena, Layout, Problem, Reconstruction, Scene, SolveOptions, Termination, simulate, solve_batch,
};

/// What happened to the scenes of one size.
#[derive(Default)]
struct Counts {
    found: usize,
    twin: usize,
    degenerate: usize,
    ill_conditioned: usize,
    lost: usize,
    worst: f64,
}

impl Counts {
    fn add(&mut self, other: &Self) {
        self.found += other.found;
        self.twin += other.twin;
        self.degenerate += other.degenerate;
        self.ill_conditioned += other.ill_conditioned;
        self.lost += other.lost;
        self.worst = self.worst.max(other.worst);
    }
}

impl std::fmt::Display for Counts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            found,
            twin,
            degenerate,
            ill_conditioned,
            lost,
            worst,
        } = self;
        write!(
            f,
            "{found} | {twin} | {degenerate} | {ill_conditioned} | {lost} | {worst:.1e}"
        )
    }
}

/// Largest error of a map that counts as found, over the size of the arena.
const ERROR: f64 = 1e-7;

/// Sensitivity per radian above which a result counts as ill-conditioned.
const SENSITIVITY: f64 = 1e4;

fn main() {
    let scenes = std::env::args()
        .skip(1)
        .find_map(|argument| argument.parse().ok())
        .unwrap_or(1000);
    println!("{scenes} scenes a row, error below {ERROR:e} of the scene");
    table(scenes);
}

fn table(scenes: u64) {
    let head = "| views | landmarks | layout | found | twin | degenerate | ill-conditioned | lost | worst |";
    let rule = format!("|{}", "---|".repeat(9));
    println!("{head}\n{rule}");
    let few = [4, 5, 6, 8, 12].map(|views| (views, 4));
    let many = [3, 4, 5, 6, 8, 10, 12]
        .into_iter()
        .flat_map(|views| [5, 6, 7, 8, 10, 12, 15].map(|landmarks| (views, landmarks)));
    let mut classes: Vec<(String, Counts)> = Vec::new();
    for (views, landmarks) in few.into_iter().chain(many) {
        for (name, layout) in [("mixed", Layout::Mixed), ("enclosed", Layout::Enclosed)] {
            let counts = count(layout, views, landmarks, scenes);
            println!("| {views} | {landmarks} | {name} | {counts} |");
            let class = match (views, landmarks) {
                (_, 4) => "4..12 | 4",
                (3, 5) => "3 | 5",
                (3, _) => "3 | 6..15",
                (_, 5) => "4..12 | 5",
                _ => "4..12 | 6..15",
            };
            let class = format!("| {class} | {name} |");
            match classes.iter_mut().find(|(other, _)| *other == class) {
                Some((_, sum)) => sum.add(&counts),
                None => classes.push((class, counts)),
            }
        }
    }
    println!("\nTogether:\n{head}\n{rule}");
    for (class, counts) in classes {
        println!("{class} {counts} |");
    }
}

fn count(layout: Layout, views: usize, landmarks: usize, scenes: u64) -> Counts {
    let scenes: Vec<Scene> = (0..scenes)
        .map(|seed| {
            simulate(layout, views, landmarks, 0.0, seed, Arena::default()).expect("a scene")
        })
        .collect();
    let problems: Vec<Problem> = scenes
        .iter()
        .map(|scene| Problem::dense(views, landmarks, &scene.bearings, 1.0).expect("a problem"))
        .collect();
    let mut counts = Counts::default();
    for (scene, found) in scenes
        .iter()
        .zip(solve_batch(&problems, &SolveOptions::default()))
    {
        let Ok(found) = found else {
            counts.degenerate += 1;
            continue;
        };
        let error = error(&found, scene);
        let near = |other: &Reconstruction| self::error(other, scene) < ERROR;
        if error < ERROR {
            counts.found += 1;
            counts.worst = counts.worst.max(error);
        } else if found.alternatives.iter().any(near) {
            counts.twin += 1;
        } else if found.sensitivity > SENSITIVITY || found.termination == Termination::MaxIterations
        {
            counts.ill_conditioned += 1;
        } else {
            counts.lost += 1;
        }
    }
    counts
}

/// Largest distance from the truth after alignment, over the size of the arena.
fn error(found: &Reconstruction, scene: &Scene) -> f64 {
    if !found.map.is_complete() {
        return f64::INFINITY;
    }
    let errors = scene.errors(&found.map);
    errors.map_or(f64::INFINITY, |errors| {
        errors.position_max / Arena::default().width
    })
}
