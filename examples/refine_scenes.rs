// SPDX-License-Identifier: MIT OR Apache-2.0
//! Times the refinement on the scenes that `benches/peers/scenes.py` writes.
//!
//! `cargo run --release --example refine_scenes FILE` prints a line per scene: views, landmarks, median
//! and least time \[us\], iterations, sum of squared residuals. `benches/peers/run.py` compares it with
//! Ceres and GTSAM by `--also "bearslam, Rust=target/release/examples/refine_scenes"`.

use bearslam::{Map, Problem, RefineOptions, pose, refine_map};
use nalgebra::Point2;
use std::time::Instant;

const REPETITIONS: usize = 15;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: refine_scenes FILE")?;
    let text = std::fs::read_to_string(path)?;
    for scene in text.split("scene").skip(1) {
        let mut numbers = scene.split_whitespace();
        let mut next = || {
            numbers
                .next()
                .ok_or("a scene ends early")?
                .parse::<f64>()
                .map_err(Box::<dyn std::error::Error>::from)
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small counts"
        )]
        let (m, n) = (next()? as usize, next()? as usize);
        let mut take = |count: usize| (0..count).map(|_| next()).collect::<Result<Vec<f64>, _>>();
        let bearings = take(m * n)?;
        let poses = take(3 * m)?;
        let landmarks = take(2 * n)?;
        let problem = Problem::dense(m, n, &bearings, 1.0)?;
        let start = Map {
            poses: poses
                .chunks(3)
                .map(|p| Some(pose(p[0], p[1], p[2])))
                .collect(),
            landmarks: landmarks
                .chunks(2)
                .map(|p| Some(Point2::new(p[0], p[1])))
                .collect(),
        };
        let options = RefineOptions {
            tolerance: 1e-9,
            ..RefineOptions::default()
        };
        let mut times = Vec::new();
        let mut report = None;
        for _ in 0..REPETITIONS {
            let mut map = start.clone();
            let begin = Instant::now();
            let found = refine_map(&problem, &mut map, &options, None)?;
            times.push(begin.elapsed().as_secs_f64() * 1e6);
            report = Some(found);
        }
        times.sort_by(f64::total_cmp);
        let report = report.ok_or("no repetitions")?;
        println!(
            "{m} {n} {} {} {} {}",
            times[REPETITIONS / 2],
            times[0],
            report.iterations,
            2.0 * report.cost
        );
    }
    Ok(())
}
