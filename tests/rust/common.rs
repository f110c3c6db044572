// SPDX-License-Identifier: MIT OR Apache-2.0
//! Scenes as problems, and errors with respect to the truth.

use bearslam::{Arena, Bearing, Layout, Map, Pose, Problem, Scene, Triple, simulate};
use nalgebra::Point2;

pub const LAYOUTS: [Layout; 2] = [Layout::Mixed, Layout::Enclosed];

pub fn scene(layout: Layout, views: usize, landmarks: usize, noise_deg: f64, seed: u64) -> Scene {
    let arena = Arena::default();
    simulate(
        layout,
        views,
        landmarks,
        noise_deg.to_radians(),
        seed,
        arena,
    )
    .unwrap()
}

pub fn problem(scene: &Scene) -> Problem {
    let landmarks = scene.landmarks.len();
    Problem::dense(scene.poses.len(), landmarks, &scene.bearings, 1.0).unwrap()
}

pub fn truth(scene: &Scene) -> Map {
    map(&scene.poses, &scene.landmarks)
}

pub fn map(poses: &[Pose<f64>], landmarks: &[Point2<f64>]) -> Map {
    Map {
        poses: poses.iter().copied().map(Some).collect(),
        landmarks: landmarks.iter().copied().map(Some).collect(),
    }
}

/// The bearings of the first three views.
pub fn triples(scene: &Scene) -> Vec<Triple<f64>> {
    let count = scene.landmarks.len();
    (0..count)
        .map(|j| [0, 1, 2].map(|i| Bearing::new(scene.bearings[i * count + j])))
        .collect()
}

/// Largest distance of a complete map from the truth after alignment, over the size of the arena.
pub fn error(found: &Map, scene: &Scene) -> f64 {
    assert!(found.is_complete());
    scene.errors(found).unwrap().position_max / Arena::default().width
}
