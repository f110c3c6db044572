// SPDX-License-Identifier: MIT OR Apache-2.0
//! Scenes for every row of the table of degenerate configurations, and for similar regular ones.

use bearslam::{Map, Pose, Problem, bearing_to, pose};
use nalgebra::{Point2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use std::f64::consts::{PI, TAU};

/// Where points are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Draw {
    Anywhere,
    Line,
    OtherLine,
    /// On a line, except for the last one.
    LineButOne,
    Circle,
    /// On the same circle, in the gaps.
    CircleBetween,
    /// Anywhere, but the first two in one place.
    TwoCoincide,
    /// All in one place.
    Coincide,
    Square,
    Trapezoid,
}

/// A row of the table: name of the finding, views, landmarks, sizes, extra directions.
pub type Row = (&'static str, Draw, Draw, &'static [(usize, usize)], usize);

/// The rows that leave directions free.
pub const DEGENERATE: [Row; 12] = [
    (
        "two_views",
        Draw::Anywhere,
        Draw::Anywhere,
        &[(2, 5), (2, 12)],
        2,
    ),
    ("counting", Draw::Anywhere, Draw::Anywhere, &[(3, 4)], 1),
    (
        "too_few_landmarks",
        Draw::Anywhere,
        Draw::Anywhere,
        &[(4, 3), (6, 3)],
        2,
    ),
    (
        "three_collinear_views",
        Draw::Line,
        Draw::Anywhere,
        &[(3, 5), (3, 12)],
        1,
    ),
    (
        "coincident_views",
        Draw::TwoCoincide,
        Draw::Anywhere,
        &[(3, 8)],
        2,
    ),
    (
        "coincident_views",
        Draw::Coincide,
        Draw::Anywhere,
        &[(3, 8), (6, 8)],
        7,
    ),
    (
        "four_landmarks_on_a_circle",
        Draw::Anywhere,
        Draw::Square,
        &[(4, 4), (7, 4)],
        1,
    ),
    (
        "collinear_landmarks",
        Draw::Anywhere,
        Draw::Line,
        &[(5, 8), (10, 15), (3, 9)],
        1,
    ),
    (
        "lines_of_views_and_of_landmarks",
        Draw::OtherLine,
        Draw::Line,
        &[(5, 8)],
        2,
    ),
    (
        "everything_on_one_line",
        Draw::Line,
        Draw::Line,
        &[(4, 6)],
        8,
    ),
    (
        "views_and_landmarks_on_one_circle",
        Draw::Circle,
        Draw::CircleBetween,
        &[(5, 8)],
        5,
    ),
    (
        "three_views_and_landmarks_on_one_circle",
        Draw::Circle,
        Draw::CircleBetween,
        &[(3, 8)],
        3,
    ),
];

/// Similar configurations that leave no direction free.
pub const HARMLESS: [Row; 8] = [
    (
        "generic",
        Draw::Anywhere,
        Draw::Anywhere,
        &[(4, 4), (3, 10), (5, 8)],
        0,
    ),
    (
        "collinear views",
        Draw::Line,
        Draw::Anywhere,
        &[(4, 8), (8, 8), (10, 8)],
        0,
    ),
    (
        "three collinear views and one off",
        Draw::LineButOne,
        Draw::Anywhere,
        &[(4, 8)],
        0,
    ),
    (
        "two coincident views of four",
        Draw::TwoCoincide,
        Draw::Anywhere,
        &[(4, 8)],
        0,
    ),
    (
        "four landmarks not on a circle",
        Draw::Anywhere,
        Draw::Trapezoid,
        &[(4, 4), (7, 4)],
        0,
    ),
    (
        "a wall and one landmark off it",
        Draw::Anywhere,
        Draw::LineButOne,
        &[(5, 8), (10, 15)],
        0,
    ),
    (
        "views on a circle",
        Draw::Circle,
        Draw::Anywhere,
        &[(5, 8)],
        0,
    ),
    (
        "landmarks on a circle",
        Draw::Anywhere,
        Draw::Circle,
        &[(5, 8)],
        0,
    ),
];

/// A drawn scene.
pub struct Drawn {
    pub poses: Vec<Pose<f64>>,
    pub landmarks: Vec<Point2<f64>>,
    /// Bearings, views times landmarks.
    pub table: Vec<f64>,
}

impl Drawn {
    /// Points of the two kinds, no landmark closer to a view than 0.15, with noise \[rad\].
    pub fn new(
        views: Draw,
        landmarks: Draw,
        (m, n): (usize, usize),
        noise: f64,
        seed: u64,
    ) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        loop {
            let places = draw(views, m, &mut random);
            let points = draw(landmarks, n, &mut random);
            let near = |a: &Vector2<f64>, b: &Vector2<f64>| (a - b).norm() < 0.15;
            if places.iter().any(|a| points.iter().any(|b| near(a, b))) {
                continue;
            }
            let poses: Vec<_> = places
                .iter()
                .map(|p| pose(p.x, p.y, PI - TAU * random.random::<f64>()))
                .collect();
            let landmarks: Vec<_> = points.into_iter().map(Point2::from).collect();
            return Self::measured(poses, landmarks, noise, &mut random);
        }
    }

    fn measured(
        poses: Vec<Pose<f64>>,
        landmarks: Vec<Point2<f64>>,
        noise: f64,
        random: &mut ChaCha8Rng,
    ) -> Self {
        let normal = Normal::new(0.0, noise).unwrap();
        let mut table = Vec::new();
        for pose in &poses {
            for landmark in &landmarks {
                table.push(bearing_to(pose, landmark).unwrap().angle() + normal.sample(random));
            }
        }
        Self {
            poses,
            landmarks,
            table,
        }
    }

    /// The same scene with more views and landmarks, all of which see each other.
    pub fn with(&self, views: &[Pose<f64>], landmarks: &[Point2<f64>]) -> Self {
        let poses = [self.poses.as_slice(), views].concat();
        let landmarks = [self.landmarks.as_slice(), landmarks].concat();
        Self::measured(poses, landmarks, 0.0, &mut ChaCha8Rng::seed_from_u64(0))
    }

    pub fn problem(&self, sigma: f64) -> Problem {
        Problem::dense(self.poses.len(), self.landmarks.len(), &self.table, sigma).unwrap()
    }

    pub fn truth(&self) -> Map {
        Map {
            poses: self.poses.iter().copied().map(Some).collect(),
            landmarks: self.landmarks.iter().copied().map(Some).collect(),
        }
    }
}

fn draw(kind: Draw, count: usize, random: &mut ChaCha8Rng) -> Vec<Vector2<f64>> {
    let between =
        |low: f64, high: f64, random: &mut ChaCha8Rng| low + (high - low) * random.random::<f64>();
    let anywhere = |random: &mut ChaCha8Rng| {
        Vector2::new(between(-3.0, 3.0, random), between(-2.5, 2.5, random))
    };
    let line = |count: usize, height: f64, slope: f64, random: &mut ChaCha8Rng| {
        let step = 6.0 / (count.max(2) - 1) as f64;
        (0..count)
            .map(|k| {
                let x = -3.0 + step * k as f64 + between(-0.2, 0.2, random);
                Vector2::new(x, height + slope * x)
            })
            .collect::<Vec<_>>()
    };
    let circle = |phase: f64, random: &mut ChaCha8Rng| {
        (0..count)
            .map(|k| {
                let at = phase + TAU * (k as f64 + between(-0.3, 0.3, random)) / count as f64;
                Vector2::new(0.4 + 2.5 * at.cos(), -0.2 + 2.5 * at.sin())
            })
            .collect::<Vec<_>>()
    };
    match kind {
        Draw::Anywhere => (0..count).map(|_| anywhere(random)).collect(),
        Draw::Line => line(count, 0.7, 0.3, random),
        Draw::OtherLine => line(count, -1.6, -0.4, random),
        Draw::LineButOne => {
            let mut points = line(count - 1, 0.7, 0.3, random);
            points.push(Vector2::new(0.3, 2.1));
            points
        }
        Draw::Circle => circle(0.0, random),
        Draw::CircleBetween => circle(0.37, random),
        Draw::TwoCoincide => {
            let mut points: Vec<_> = (0..count).map(|_| anywhere(random)).collect();
            points[1] = points[0];
            points
        }
        Draw::Coincide => vec![anywhere(random); count],
        Draw::Square => [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
            .map(|(x, y)| Vector2::new(x, y))
            .into(),
        Draw::Trapezoid => [(0.0, 0.0), (3.0, 0.0), (1.4, 1.5), (0.2, 1.5)]
            .map(|(x, y)| Vector2::new(x, y))
            .into(),
    }
}
