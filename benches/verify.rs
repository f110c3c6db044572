// SPDX-License-Identifier: MIT OR Apache-2.0
//! Which maps can be verified, and in what time? `cargo bench --bench verify --features rayon [-- SCENES [SEED [LINE]]]`.
//!
//! LINE runs one line of the table, from 0.
//!
//! `solve` with `verify` by noise and size, in the mixed layout. A map is *contradicted* when it is verified, and the
//! refinement from the truth, or a wider search, has a cost that is lower by more than 1e-5 of it. *Replaced*: the search
//! of the cone found a lower map than `solve` without it. Times are those of the verification alone.

use bearslam::{
    Arena, Cell, Layout, Problem, RefineOptions, SearchOptions, SolveOptions, Verdict, refine,
    simulate, solve,
};
use rayon::prelude::*;
use std::time::Instant;

const NOISES_DEG: [f64; 4] = [0.1, 0.5, 1.0, 2.23];
const SIZES: [(usize, usize); 3] = [(4, 7), (8, 10), (12, 15)];

/// What came of a scene.
struct Run {
    verdict: Verdict,
    contradicted: bool,
    replaced: bool,
    cells: usize,
    /// Half the opening angle of the cone \[rad\].
    cone: f64,
    /// Seconds.
    time: f64,
}

fn main() {
    let words = std::env::args().skip(1);
    let mut numbers = words.filter_map(|word| word.parse().ok());
    let scenes: u64 = numbers.next().unwrap_or(100);
    let seed: u64 = numbers.next().unwrap_or(0);
    let only = numbers.next();
    println!("{scenes} scenes a line, seed {seed}\n");
    println!(
        "| noise \\[deg\\] | views | landmarks | verified | by the bound alone | no cone | too many cells | other \
         | contradicted | replaced | cone, median \\[deg\\] | cells, median | 90 % | time, median \\[ms\\] | 90 % |"
    );
    println!("|{}", "---|".repeat(15));
    for (size, (views, landmarks)) in SIZES.into_iter().enumerate() {
        for (noise, noise_deg) in NOISES_DEG.into_iter().enumerate() {
            let line = NOISES_DEG.len() * size + noise;
            if only.is_some_and(|only| only != line as u64) {
                continue;
            }
            let cell = Cell {
                layout: Layout::Mixed,
                views,
                landmarks,
                noise: noise_deg.to_radians(),
            };
            let trials: Vec<u64> = (0..scenes).collect();
            let runs = trials
                .par_iter()
                .map(|&trial| run(&cell, cell.scene_seed(seed, trial)));
            print(&cell, &runs.flatten().collect::<Vec<_>>());
        }
    }
}

/// `None` where the problem has no solution.
fn run(cell: &Cell, seed: u64) -> Option<Run> {
    let (views, landmarks) = (cell.views, cell.landmarks);
    let scene = simulate(
        cell.layout,
        views,
        landmarks,
        cell.noise,
        seed,
        Arena::default(),
    );
    let scene = scene.expect("a scene");
    let problem = Problem::dense(views, landmarks, &scene.bearings, cell.noise).expect("a problem");
    let plain = SolveOptions::default();
    let verify = SolveOptions {
        verify: true,
        ..plain
    };
    let wide = SolveOptions {
        search: SearchOptions {
            triples: 40,
            grown: 10,
            candidates: 10,
            swept: 10,
        },
        ..plain
    };
    let begin = Instant::now();
    let before = solve(&problem, &plain, None).ok()?;
    let between = Instant::now();
    let found = solve(&problem, &verify, None).ok()?;
    let time = between.elapsed().as_secs_f64() - (between - begin).as_secs_f64();
    let certificate = found.certificate.expect("a certificate");
    let truth = refine(&problem, &scene.map(), &RefineOptions::default(), None);
    let others = [truth, solve(&problem, &wide, None)];
    let is_lower = |cost: f64, than: f64| cost < than * (1.0 - 1e-5);
    let costs = others
        .iter()
        .flatten()
        .filter(|other| other.undetermined.is_empty());
    Some(Run {
        verdict: certificate.verdict,
        contradicted: certificate.verified()
            && costs
                .map(|other| other.cost)
                .any(|cost| is_lower(cost, found.cost)),
        replaced: is_lower(found.cost, before.cost),
        cells: certificate.cells,
        cone: certificate.cone,
        time,
    })
}

fn print(cell: &Cell, runs: &[Run]) {
    let count = |is: &dyn Fn(&Run) -> bool| runs.iter().filter(|run| is(run)).count();
    let ended = |verdict: Verdict| count(&|run| run.verdict == verdict);
    let (bound, searched) = (ended(Verdict::NoLowerMap), ended(Verdict::Searched));
    let (no_cone, many) = (ended(Verdict::NoCone), ended(Verdict::TooManyCells));
    let of_searched = |of: &dyn Fn(&Run) -> f64| {
        let searched = runs.iter().filter(|run| run.verdict == Verdict::Searched);
        let mut values: Vec<f64> = searched.map(of).collect();
        values.sort_by(f64::total_cmp);
        [50, 90].map(|percent| {
            let place = percent * values.len() / 100;
            values.get(place).copied().unwrap_or(f64::NAN)
        })
    };
    let [cone, _] = of_searched(&|run| run.cone.to_degrees());
    let [cells, most_cells] = of_searched(&|run| run.cells as f64);
    let [time, most_time] = of_searched(&|run| run.time * 1e3);
    println!(
        "| {} | {} | {} | {} of {} | {bound} | {no_cone} | {many} | {} | {} | {} | {cone:.1} | {cells} | {most_cells} \
         | {time:.1} | {most_time:.1} |",
        (cell.noise.to_degrees() * 100.0).round() / 100.0,
        cell.views,
        cell.landmarks,
        bound + searched,
        runs.len(),
        runs.len() - bound - searched - no_cone - many,
        count(&|run| run.contradicted),
        count(&|run| run.replaced),
    );
}
