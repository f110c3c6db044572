// SPDX-License-Identifier: MIT OR Apache-2.0
//! Comparison with values of independent code: the project's own file, and a shared one if it is present.

use bearslam::{
    Bearing, CalibratedTensor, Method, Pose, Problem, SolveOptions, Triple, align, epipoles, pose,
    projective_tensor, resect, solve, three_view, triangulate,
};
use nalgebra::Point2;
use serde::Deserialize;
use std::f64::consts::PI;
use std::path::PathBuf;

#[derive(Deserialize)]
struct Reference {
    three_view: Vec<ThreeViewCase>,
    many_view: Vec<ManyViewCase>,
    #[serde(default)]
    resection: Vec<ResectionCase>,
    #[serde(default)]
    triangulation: Vec<TriangulationCase>,
    #[serde(default)]
    align: Vec<AlignCase>,
}

#[derive(Deserialize)]
struct ThreeViewCase {
    kind: String,
    n: usize,
    bearings: Vec<Vec<f64>>,
    null_vector: [f64; 6],
    singular_values: Option<Vec<f64>>,
    projective_tensor: Option<Vec<f64>>,
    epipoles: Option<Vec<Vec<Vec<Option<f64>>>>>,
    solutions: Vec<Solution>,
}

#[derive(Deserialize)]
struct Solution {
    poses: Vec<[f64; 3]>,
    landmarks: Vec<[f64; 2]>,
    inconsistent: usize,
}

#[derive(Deserialize)]
struct ManyViewCase {
    kind: String,
    m: usize,
    n: usize,
    bearings: Vec<Vec<Option<f64>>>,
    best_known_cost: f64,
}

#[derive(Deserialize)]
struct ResectionCase {
    landmarks: Vec<[f64; 2]>,
    bearings: Vec<f64>,
    pose: [f64; 3],
}

#[derive(Deserialize)]
struct TriangulationCase {
    poses: Vec<[f64; 3]>,
    bearings: Vec<Vec<Option<f64>>>,
    landmarks: Vec<[f64; 2]>,
}

#[derive(Deserialize)]
struct AlignCase {
    source: Vec<[f64; 2]>,
    target: Vec<[f64; 2]>,
    scale: f64,
    angle: f64,
    translation: [f64; 2],
}

fn own() -> Reference {
    serde_json::from_str(include_str!("../data/reference.json")).unwrap()
}

/// The shared file beside the project, or a visible note that it is missing.
fn shared(test: &str) -> Option<Reference> {
    let folder = std::env::var_os("BEARSLAM_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared"),
        PathBuf::from,
    );
    let path = folder.join("vectors/reference.json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        eprintln!("{test}: SKIPPED, no file {}", path.display());
        return None;
    };
    Some(serde_json::from_str(&text).unwrap())
}

fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

fn triples(bearings: &[Vec<f64>]) -> Vec<Triple<f64>> {
    (0..bearings[0].len())
        .map(|j| [0, 1, 2].map(|i| Bearing::new(bearings[i][j])))
        .collect()
}

fn check_null_vectors(reference: &Reference) {
    for case in &reference.three_view {
        let tensor = CalibratedTensor::estimate(&triples(&case.bearings), 0).unwrap();
        let [a, b, c] = tensor.coefficients;
        let found = [a.re, -a.im, b.re, -b.im, c.re, -c.im];
        let dot: f64 = found
            .iter()
            .zip(&case.null_vector)
            .map(|(f, e)| f * e)
            .sum();
        let sign = dot.signum();
        for (f, e) in found.iter().zip(&case.null_vector) {
            // The reference has a gap of singular values of at least 1e-3: an error of 1e-16 / 1e-3, with a margin.
            assert!((sign * f - e).abs() < 1e-9, "{} {}", case.kind, case.n);
        }
        if let Some(values) = &case.singular_values {
            let smallest = if case.n > 5 { values[5] } else { 0.0 };
            assert!((tensor.singular_values[0] - smallest).abs() < 1e-12);
            assert!(tensor.singular_values[1] > values[4] - 1e-12);
        }
    }
}

fn check_three_view(reference: &Reference) {
    for case in &reference.three_view {
        let name = format!("{} {}", case.kind, case.n);
        let triples = triples(&case.bearings);
        let found = three_view(&triples, Method::Calibrated { reweights: 0 }).unwrap();
        for expected in &case.solutions {
            let poses: Vec<Pose<f64>> = expected
                .poses
                .iter()
                .map(|p| pose(p[0], p[1], p[2]))
                .collect();
            let places: Vec<Point2<f64>> = poses
                .iter()
                .map(|p| p.translation.vector.into())
                .chain(expected.landmarks.iter().map(|&p| p.into()))
                .collect();
            let nearest = found
                .motions
                .iter()
                .map(|motion| {
                    let headings = (1..3)
                        .map(|k| {
                            let found = motion.poses[0]
                                .rotation
                                .rotation_to(&motion.poses[k].rotation);
                            let truth = poses[0].rotation.rotation_to(&poses[k].rotation);
                            // If the signs of a view are tied, its heading depends on the rule for ties.
                            let difference = found.angle_to(&truth).abs();
                            difference.min(PI - difference)
                        })
                        .fold(0.0, f64::max);
                    let mine: Vec<Point2<f64>> = motion
                        .poses
                        .iter()
                        .map(|p| p.translation.vector.into())
                        .chain(triples.iter().map(|t| motion.landmark(t).unwrap()))
                        .collect();
                    let similarity = align(&mine, &places).unwrap();
                    let size = places.iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
                    let distance = mine
                        .iter()
                        .zip(&places)
                        .map(|(a, b)| (similarity.transform_point(a) - b).norm() / size)
                        .fold(0.0, f64::max);
                    (headings.max(distance), motion.inconsistent)
                })
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap();
            assert!(nearest.0 < 1e-8, "{name}: {:e}", nearest.0);
            assert_eq!(nearest.1, expected.inconsistent, "{name}");
        }
    }
}

fn check_many_view(reference: &Reference) {
    for case in &reference.many_view {
        let flat: Vec<f64> = case
            .bearings
            .iter()
            .flatten()
            .map(|b| b.unwrap_or(f64::NAN))
            .collect();
        let problem = Problem::dense(case.m, case.n, &flat, 1.0).unwrap();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        // The reference cost is the sum of squares, ours half of it; for exact data it is only rounding.
        let bound = 0.5 * case.best_known_cost * (1.0 + 1e-6) + 1e-25;
        assert!(
            found.cost <= bound,
            "{} {} {}: {:e} > {bound:e}",
            case.kind,
            case.m,
            case.n,
            found.cost
        );
    }
}

#[test]
fn null_vectors() {
    check_null_vectors(&own());
}

#[test]
fn three_view_solutions() {
    check_three_view(&own());
}

#[test]
fn many_view_costs() {
    check_many_view(&own());
}

#[test]
fn shared_values() {
    if let Some(reference) = shared("shared_values") {
        check_null_vectors(&reference);
        check_three_view(&reference);
        check_many_view(&reference);
    }
}

#[test]
fn projective_tensors() {
    for case in &own().three_view {
        let Some(expected) = &case.projective_tensor else {
            continue;
        };
        let tensor = projective_tensor(&triples(&case.bearings)).unwrap();
        let found = tensor.entries.as_flattened().as_flattened();
        let sign: f64 = found
            .iter()
            .zip(expected)
            .map(|(f, e)| f * e)
            .sum::<f64>()
            .signum();
        for (f, e) in found.iter().zip(expected) {
            assert!((sign * f - e).abs() < 1e-8, "{} {}", case.kind, case.n);
        }
    }
}

#[test]
fn epipoles_under_both_assignments() {
    for case in &own().three_view {
        let Some(expected) = &case.epipoles else {
            continue;
        };
        let tensor = CalibratedTensor::estimate(&triples(&case.bearings), 0)
            .unwrap()
            .tensor();
        let found = epipoles(&tensor).unwrap();
        for wanted in expected {
            let differs = |k: usize| {
                let mut worst = 0.0_f64;
                for i in 0..3 {
                    for j in 0..3 {
                        let Some(angle) = wanted[i][j] else {
                            continue;
                        };
                        let direction = found.directions[k][i][j];
                        // Bearings modulo pi: the sine of the difference.
                        let sine = angle.cos() * direction.y - angle.sin() * direction.x;
                        worst = worst.max(sine.abs());
                    }
                }
                worst
            };
            let nearest = differs(0).min(differs(1));
            assert!(nearest < 1e-8, "{} {}: {nearest:e}", case.kind, case.n);
        }
    }
}

#[test]
fn resections() {
    let cases = own().resection;
    assert!(!cases.is_empty());
    for case in cases {
        let seen = case
            .landmarks
            .iter()
            .zip(&case.bearings)
            .map(|(&p, &b)| (Point2::from(p), Bearing::new(b)));
        let found = resect(seen).unwrap();
        let [x, y, theta] = case.pose;
        assert!((found.pose.translation.vector - nalgebra::Vector2::new(x, y)).norm() < 1e-11);
        assert!(wrapped(found.pose.rotation.angle() - theta).abs() < 1e-11);
        assert_eq!(found.behind, 0);
    }
}

#[test]
fn triangulations() {
    let cases = own().triangulation;
    assert!(!cases.is_empty());
    for case in cases {
        let poses: Vec<Pose<f64>> = case.poses.iter().map(|p| pose(p[0], p[1], p[2])).collect();
        for (j, &expected) in case.landmarks.iter().enumerate() {
            let rays: Vec<_> = poses
                .iter()
                .zip(&case.bearings)
                .filter_map(|(pose, row)| row[j].map(|b| (*pose, Bearing::new(b))))
                .collect();
            let found = triangulate(rays).unwrap();
            assert!((found.point - Point2::from(expected)).norm() < 1e-10);
            assert_eq!(found.behind, 0);
        }
    }
}

#[test]
fn alignments() {
    let cases = own().align;
    assert!(!cases.is_empty());
    for case in cases {
        let points =
            |list: &[[f64; 2]]| list.iter().map(|&p| p.into()).collect::<Vec<Point2<f64>>>();
        let found = align(&points(&case.source), &points(&case.target)).unwrap();
        let [x, y] = case.translation;
        assert!((found.scaling() - case.scale).abs() < 1e-12 * case.scale);
        assert!(wrapped(found.isometry.rotation.angle() - case.angle).abs() < 1e-12);
        let shift = found.isometry.translation.vector - nalgebra::Vector2::new(x, y);
        assert!(shift.norm() < 1e-11);
    }
}
