// SPDX-License-Identifier: MIT OR Apache-2.0
//! Time of the evaluation of Dellaert and Stroupe (2002): `cargo bench --bench sweep --features rayon`.
//!
//! 25 sizes, three levels of noise, 50 scenes each: 3750 scenes of one layout, solved without an initial guess
//! and compared, on one thread and on two; the median of several alternating runs, and their ratio.

use bearslam::{Cell, Chunk, Layout, Start, sweep};
use std::time::Instant;

const RUNS: usize = 7;
const TRIALS: u64 = 50;
const CHUNK: u64 = 10;

fn main() {
    for (name, layout) in [("mixed", Layout::Mixed), ("enclosed", Layout::Enclosed)] {
        let chunks = chunks(layout);
        let mut times = [Vec::new(), Vec::new()];
        let mut counts = (0, 0, 0);
        for _ in 0..RUNS {
            for (threads, times) in (1..).zip(&mut times) {
                counts = (0, 0, 0);
                let begin = Instant::now();
                sweep(&chunks, &[Start::Solve], 0, threads, &mut |done| {
                    for tally in done.iter().flat_map(|(_, tallies)| tallies) {
                        counts.0 += tally.trials;
                        counts.1 += tally.failures;
                        counts.2 += tally.nanoseconds;
                    }
                    true
                })
                .expect("a sweep");
                times.push(begin.elapsed().as_secs_f64());
            }
        }
        let [one, two] = times.map(|mut times| {
            times.sort_by(f64::total_cmp);
            times[RUNS / 2]
        });
        let (scenes, failures, nanoseconds) = counts;
        let mean = nanoseconds as f64 / 1e3 / scenes as f64;
        println!(
            "{name}: {scenes} scenes, {failures} failures; one thread {one:.2} s, two {two:.2} s, \
             ratio {:.2}; of that `solve` with two threads {mean:.0} us a scene",
            one / two
        );
    }
}

fn chunks(layout: Layout) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    for noise in [0.1_f64, 0.5, 1.0] {
        for views in [4, 6, 8, 10, 12] {
            for landmarks in [7, 9, 11, 13, 15] {
                let cell = Cell {
                    layout,
                    views,
                    landmarks,
                    noise: noise.to_radians(),
                };
                chunks.extend((0..TRIALS / CHUNK).map(|k| Chunk {
                    cell,
                    trials: k * CHUNK..(k + 1) * CHUNK,
                }));
            }
        }
    }
    chunks
}
