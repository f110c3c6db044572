// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors by method, and against the Cramer-Rao bound: `cargo bench --bench accuracy [-- SCENES]`.
//!
//! The first table of `docs/accuracy.md`: three views with 0.3 degrees of noise and the branch closer to the
//! truth; median and 90th percentile, over the scenes, of the larger of the two heading errors. Maximum
//! likelihood is the refinement started at the truth.
//!
//! The second table: root mean square, over the scenes, of the error divided by its bound, for positions and
//! for headings; over all scenes, and without the hundredth in which it is largest.

use bearslam::{
    Arena, Bearing, Errors, Layout, Map, Method, Pose, Problem, RefineOptions, Scene, SolveOptions,
    Triple, refine_map, simulate, solve, three_view,
};

const NOISE_DEG: f64 = 0.3;

fn main() {
    let scenes = std::env::args()
        .skip(1)
        .find_map(|argument| argument.parse().ok())
        .unwrap_or(1000);
    let methods = [
        ("projective", Some(Method::Projective)),
        ("calibrated", Some(Method::Calibrated { reweights: 0 })),
        ("1 reweight", Some(Method::Calibrated { reweights: 1 })),
        ("2 reweights", Some(Method::Calibrated { reweights: 2 })),
        ("3 reweights", Some(Method::Calibrated { reweights: 3 })),
        ("maximum likelihood", None),
    ];
    print!("| layout | n |");
    for (name, _) in methods {
        print!(" {name} |");
    }
    println!("\n|---|---|{}", "---|".repeat(methods.len()));
    for (name, layout) in [("mixed", Layout::Mixed), ("enclosed", Layout::Enclosed)] {
        for landmarks in [5, 7, 15, 40] {
            print!("| {name} | {landmarks} |");
            for (_, method) in methods {
                if method.is_some_and(|method| landmarks < method.min_landmarks()) {
                    print!(" – |");
                    continue;
                }
                let mut errors: Vec<f64> = (0..scenes)
                    .map(|seed| heading_error_deg(layout, landmarks, seed, method))
                    .collect();
                errors.sort_by(f64::total_cmp);
                let at =
                    |percent: usize| errors[(errors.len() * percent / 100).min(errors.len() - 1)];
                print!(" {} / {} |", digits(at(50)), digits(at(90)));
            }
            println!();
        }
    }
    against_the_bound(scenes);
}

/// The table of errors divided by their bounds.
fn against_the_bound(scenes: u64) {
    println!("\n| layout | noise \\[deg\\] | views | landmarks | method | positions | headings |");
    println!("|---|---|---|---|---|---|---|");
    for (name, layout) in [("mixed", Layout::Mixed), ("enclosed", Layout::Enclosed)] {
        for noise_deg in [0.1_f64, 0.5] {
            let row = |views: usize,
                       landmarks: usize,
                       method: &str,
                       solver: &dyn Fn(&Scene) -> Vec<Map>| {
                let noise = noise_deg.to_radians();
                let ratios: Vec<(f64, f64)> = (0..scenes)
                    .filter_map(|seed| {
                        let arena = Arena::default();
                        let scene = simulate(layout, views, landmarks, noise, seed, arena).ok()?;
                        let bound = scene.bound(noise)?;
                        let errors = solver(&scene).into_iter();
                        let errors = errors.filter_map(|map| scene.errors(&map).ok());
                        let least =
                            |a: &Errors, b: &Errors| a.heading_rms.total_cmp(&b.heading_rms);
                        let errors = errors.min_by(least)?;
                        Some((
                            errors.position_rms / bound.position_rms,
                            errors.heading_rms / bound.heading_rms,
                        ))
                    })
                    .collect();
                let (positions, headings): (Vec<f64>, Vec<f64>) = ratios.into_iter().unzip();
                println!(
                    "| {name} | {noise_deg} | {views} | {landmarks} | {method} | {} | {} |",
                    both_means(positions),
                    both_means(headings)
                );
            };
            for (views, landmarks) in [(4, 7), (4, 15), (8, 7), (8, 11), (12, 15)] {
                row(views, landmarks, "`solve`", &|scene| {
                    let problem =
                        Problem::dense(views, landmarks, &scene.bearings, noise_deg.to_radians());
                    let found = solve(&problem.expect("a problem"), &SolveOptions::default(), None);
                    found.map(|found| found.map).into_iter().collect()
                });
            }
            for landmarks in [15, 40] {
                for reweights in [0, 1, 2] {
                    row(
                        3,
                        landmarks,
                        &format!("closed form, reweighted {reweights} times"),
                        &|scene| closed_form(scene, landmarks, reweights),
                    );
                }
            }
        }
    }
}

/// Both maps of three views.
fn closed_form(scene: &Scene, landmarks: usize, reweights: usize) -> Vec<Map> {
    let triples = triples(scene, landmarks);
    let found = three_view(&triples, Method::Calibrated { reweights });
    let motions = found.map(|found| found.motions).into_iter().flatten();
    motions
        .map(|motion| Map {
            poses: motion.poses.iter().copied().map(Some).collect(),
            landmarks: triples
                .iter()
                .map(|triple| motion.landmark(triple))
                .collect(),
        })
        .collect()
}

fn triples(scene: &Scene, landmarks: usize) -> Vec<Triple<f64>> {
    (0..landmarks)
        .map(|j| [0, 1, 2].map(|i| Bearing::new(scene.bearings[i * landmarks + j])))
        .collect()
}

/// Root mean square of all values, and of all but the largest hundredth.
fn both_means(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    let mean =
        |values: &[f64]| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
    let most = values.len() - values.len() / 100;
    format!("{:.3} / {:.3}", mean(&values), mean(&values[..most]))
}

/// Two significant digits.
fn digits(value: f64) -> String {
    if value < 10.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.0}")
    }
}

fn heading_error_deg(layout: Layout, landmarks: usize, seed: u64, method: Option<Method>) -> f64 {
    let noise = NOISE_DEG.to_radians();
    let scene = simulate(layout, 3, landmarks, noise, seed, Arena::default()).expect("a scene");
    let found: Vec<[Pose<f64>; 3]> = match method {
        Some(method) => match three_view(&triples(&scene, landmarks), method) {
            Ok(found) => found.motions.iter().map(|motion| motion.poses).collect(),
            Err(_) => return 180.0,
        },
        None => vec![most_likely(&scene, landmarks)],
    };
    found
        .iter()
        .map(|poses| {
            (1..3)
                .map(|view| {
                    let found = poses[0].rotation.rotation_to(&poses[view].rotation);
                    let truth = scene.poses[0]
                        .rotation
                        .rotation_to(&scene.poses[view].rotation);
                    found.angle_to(&truth).abs().to_degrees()
                })
                .fold(0.0, f64::max)
        })
        .fold(f64::INFINITY, f64::min)
}

fn most_likely(scene: &Scene, landmarks: usize) -> [Pose<f64>; 3] {
    let problem = Problem::dense(3, landmarks, &scene.bearings, 1.0).expect("a problem");
    let mut map = Map {
        poses: scene.poses.iter().copied().map(Some).collect(),
        landmarks: scene.landmarks.iter().copied().map(Some).collect(),
    };
    refine_map(&problem, &mut map, &RefineOptions::default(), None).expect("a refinement");
    [0, 1, 2].map(|view| map.poses[view].expect("a pose"))
}
