// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parameters, residuals and derivatives of the full problem.
//!
//! Residual of a sighting: `r = arg(e^{-i bearing} e^{-i theta} (x - p))`, predicted minus measured in
//! (-pi, pi], over sigma. With `d = x - p` and `g = (-d_y, d_x) / |d|^2`, (T12):
//! `dr/dx = g`, `dr/dp = -g`, `dr/dtheta = -1`.

use super::prior_rows::{TieRow, linearize};
use crate::error::{Degeneracy, Error};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::{extent, horizon};
use crate::geometry::{Pose, signed_angle, transform_pose};
use crate::lm::Loss;
use crate::problem::{Map, Problem, Seen};
use alloc::vec::Vec;
use nalgebra::{Point2, Similarity2, Translation2, UnitComplex, Vector2, Vector3};

/// A complete map: every view and landmark has a value.
#[derive(Clone, Debug)]
pub struct Bundle {
    pub poses: Vec<Pose<f64>>,
    pub landmarks: Vec<Point2<f64>>,
}

/// A problem linearised at a bundle.
#[derive(Clone, Debug)]
pub struct Rows {
    pub sightings: Vec<Row>,
    pub ties: Vec<TieRow>,
}

impl Rows {
    /// Room for those of a problem.
    pub fn of(problem: &Problem) -> Self {
        Self {
            sightings: Vec::with_capacity(problem.sightings().len()),
            ties: Vec::with_capacity(problem.ties().len()),
        }
    }
}

/// A sighting linearised: residual and derivatives, all over sigma, and with a loss times the root of its
/// slope.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Derivative with respect to the landmark, minus that with respect to the position.
    pub gradient: Vector2<f64>,
    /// Minus the derivative with respect to the heading: one over sigma.
    pub weight: f64,
    /// The residual.
    pub residual: f64,
}

impl Row {
    /// A sighting of a landmark from a pose; a line rather than a ray when not `oriented`.
    #[inline]
    fn new(pose: &Pose<f64>, landmark: &Point2<f64>, s: &Seen, oriented: bool) -> Self {
        let offset = landmark.coords - pose.translation.vector;
        let ray = pose.rotation.into_inner() * s.bearing.into_inner();
        let along = ray.re * offset.x + ray.im * offset.y;
        let across = ray.re * offset.y - ray.im * offset.x;
        let square = offset.norm_squared();
        // A landmark exactly on its view may lie in any direction, and pulls nowhere.
        if square <= 0.0 {
            return Self {
                gradient: Vector2::zeros(),
                weight: s.weight,
                residual: 0.0,
            };
        }
        // A line may as well point the other way.
        let (along, across) = if oriented || along >= 0.0 {
            (along, across)
        } else {
            (-along, -across)
        };
        let scale = s.weight / square;
        Self {
            gradient: Vector2::new(-offset.y * scale, offset.x * scale),
            weight: s.weight,
            residual: signed_angle(along, across) * s.weight,
        }
    }

    /// A sighting weighted as a loss asks, and what it adds to twice the cost; `PLAIN` for the squares of
    /// rays, the inner loop of most refinements, which compiles to nothing more than these.
    #[inline]
    fn tempered<const PLAIN: bool>(
        pose: &Pose<f64>,
        landmark: &Point2<f64>,
        s: &Seen,
        oriented: bool,
        loss: Loss,
    ) -> (Self, f64) {
        let mut row = Self::new(pose, landmark, s, PLAIN || oriented);
        if PLAIN {
            return (row, row.residual * row.residual);
        }
        let (value, slope) = loss.evaluate(row.residual * row.residual);
        if slope < 1.0 {
            let root = slope.sqrt();
            row.gradient *= root;
            row.weight *= root;
            row.residual *= root;
        }
        (row, value)
    }

    /// Derivative with respect to the pose `(x, y, theta)`.
    #[inline]
    pub fn pose(&self) -> [f64; 3] {
        [-self.gradient.x, -self.gradient.y, -self.weight]
    }

    /// Derivative with respect to the landmark `(x, y)`.
    #[inline]
    pub fn landmark(&self) -> [f64; 2] {
        [self.gradient.x, self.gradient.y]
    }
}

/// What the views tell about one landmark: information (xx, xy, yy), gradient, sum of losses.
struct Around {
    information: [f64; 3],
    gradient: Vector2<f64>,
    loss: f64,
}

impl Around {
    /// The step of Gauss-Newton; `None` where the views do not fix the landmark.
    #[inline]
    fn step(&self) -> Option<Vector2<f64>> {
        let [xx, xy, yy] = self.information;
        let determinant = xx * yy - xy * xy;
        let [x, y]: [f64; 2] = self.gradient.into();
        let step = Vector2::new(xy * y - yy * x, xy * x - xx * y) / determinant;
        (determinant > 0.0).then_some(step)
    }
}

/// Whether residuals count with their squares, and bearings are rays.
fn is_plain(problem: &Problem, loss: Loss) -> bool {
    problem.is_oriented() && loss == Loss::Squared
}

impl Bundle {
    /// The determined part of a map.
    pub fn from_map(map: &Map) -> Self {
        Self {
            poses: map.poses.iter().flatten().copied().collect(),
            landmarks: map.landmarks.iter().flatten().copied().collect(),
        }
    }

    /// Writes the values back into the determined places of the map they came from.
    pub fn write_to(&self, map: &mut Map) {
        for (to, from) in map.poses.iter_mut().flatten().zip(&self.poses) {
            *to = *from;
        }
        for (to, from) in map.landmarks.iter_mut().flatten().zip(&self.landmarks) {
            *to = *from;
        }
    }

    /// The extent of the views (where they are in one place, of all) as a power of two, so that
    /// scaling by it loses no digit.
    pub fn unit(&self) -> Result<f64, Error> {
        let views = self.poses.iter().map(|pose| pose.translation.vector);
        let all = views
            .clone()
            .chain(self.landmarks.iter().map(|point| point.coords));
        for (index, position) in all.clone().enumerate() {
            if !(position.x.is_finite() && position.y.is_finite()) {
                return Err(Error::NotFinite {
                    what: "positions of the start",
                    index,
                });
            }
        }
        let power = |size: f64| 2.0_f64.powf(size.log2().round());
        let usable = |size: f64| {
            let unit = power(size);
            let square = unit * unit;
            size > 0.0 && square.is_finite() && (1.0 / square).is_finite()
        };
        let sizes = [extent(views), extent(all)];
        match sizes.into_iter().find(|size| usable(*size)) {
            Some(size) => Ok(power(size)),
            None => Err(Error::Degenerate {
                kind: Degeneracy::CoincidentStart,
                value: sizes[1],
                bound: 0.0,
            }),
        }
    }

    /// Brings landmarks that are too far away to be told from infinity to where they can just be.
    pub fn bring_in(&mut self) {
        let horizon = horizon();
        let Some(home) = self.poses.first().map(|pose| pose.translation.vector) else {
            return;
        };
        for point in &mut self.landmarks {
            let offset = point.coords - home;
            if offset.amax() > horizon {
                *point = Point2::from(home + (offset / offset.amax()).normalize() * horizon);
            }
        }
    }

    /// Moves all of it by a similarity.
    pub fn transform(&mut self, similarity: &Similarity2<f64>) {
        for pose in &mut self.poses {
            *pose = transform_pose(similarity, pose);
        }
        for point in &mut self.landmarks {
            *point = similarity.transform_point(point);
        }
    }

    /// Scales all positions.
    pub fn scale(&mut self, factor: f64) {
        for pose in &mut self.poses {
            pose.translation.vector *= factor;
        }
        for point in &mut self.landmarks {
            point.coords *= factor;
        }
    }

    /// Linearises everything; returns the cost, half the sum of the losses and of the squares of the ties.
    pub fn linearize(&self, problem: &Problem, loss: Loss, rows: &mut Rows) -> f64 {
        let mut sum = if is_plain(problem, loss) {
            self.linearize_sightings::<true>(problem, loss, &mut rows.sightings)
        } else {
            self.linearize_sightings::<false>(problem, loss, &mut rows.sightings)
        };
        rows.ties.clear();
        for tie in problem.ties() {
            let row = linearize(tie, &self.poses, &self.landmarks);
            sum += row.square();
            rows.ties.push(row);
        }
        sum * 0.5
    }

    /// The sum of the losses.
    fn linearize_sightings<const PLAIN: bool>(
        &self,
        problem: &Problem,
        loss: Loss,
        rows: &mut Vec<Row>,
    ) -> f64 {
        rows.clear();
        let oriented = problem.is_oriented();
        let mut sum = 0.0;
        for (view, pose) in self.poses.iter().enumerate() {
            for s in problem.of_view(view) {
                let point = &self.landmarks[s.landmark];
                let (row, value) = Row::tempered::<PLAIN>(pose, point, s, oriented, loss);
                sum += value;
                rows.push(row);
            }
        }
        sum
    }

    /// Moves a landmark towards its best place for the poses as they are: a step or two of Gauss-Newton,
    /// as far as the cost falls.
    ///
    /// A linear step takes the landmarks off their rays as the poses turn; put back onto them, the
    /// descent may take longer steps (variable projection).
    pub fn settle_landmark(&mut self, problem: &Problem, loss: Loss, landmark: usize) {
        if is_plain(problem, loss) {
            self.settle_on_rays::<true>(problem, loss, landmark);
        } else {
            self.settle_on_rays::<false>(problem, loss, landmark);
        }
    }

    fn settle_on_rays<const PLAIN: bool>(
        &mut self,
        problem: &Problem,
        loss: Loss,
        landmark: usize,
    ) {
        let start = self.landmarks[landmark];
        let at = self.around::<PLAIN>(problem, loss, landmark, &start);
        let near = |point: &Point2<f64>| point.coords.amax() <= horizon();
        let Some(first) = at.step().map(|step| start + step).filter(near) else {
            return;
        };
        let there = self.around::<PLAIN>(problem, loss, landmark, &first);
        if !(there.loss < at.loss) {
            return;
        }
        // Of the second step only the loss is of interest.
        let second = there.step().map(|step| first + step).filter(near);
        let lower = |point: &Point2<f64>| {
            self.loss_around::<PLAIN>(problem, loss, landmark, point) < there.loss
        };
        self.landmarks[landmark] = second.filter(lower).unwrap_or(first);
    }

    /// The sum of the losses of one landmark at a place.
    #[inline]
    fn loss_around<const PLAIN: bool>(
        &self,
        problem: &Problem,
        loss: Loss,
        landmark: usize,
        point: &Point2<f64>,
    ) -> f64 {
        let oriented = problem.is_oriented();
        let seen = problem.of_landmark(landmark).iter();
        seen.fold(0.0, |sum, &k| {
            let s = &problem.sightings()[k];
            let pose = &self.poses[s.view];
            sum + Row::tempered::<PLAIN>(pose, point, s, oriented, loss).1
        })
    }

    /// What the views tell about one landmark at a place.
    #[inline]
    fn around<const PLAIN: bool>(
        &self,
        problem: &Problem,
        loss: Loss,
        landmark: usize,
        point: &Point2<f64>,
    ) -> Around {
        let mut around = Around {
            information: [0.0; 3],
            gradient: Vector2::zeros(),
            loss: 0.0,
        };
        let oriented = problem.is_oriented();
        for &k in problem.of_landmark(landmark) {
            let s = &problem.sightings()[k];
            let pose = &self.poses[s.view];
            let (row, value) = Row::tempered::<PLAIN>(pose, point, s, oriented, loss);
            let [x, y]: [f64; 2] = row.gradient.into();
            around.information[0] += x * x;
            around.information[1] += x * y;
            around.information[2] += y * y;
            around.gradient += row.gradient * row.residual;
            around.loss += value;
        }
        around
    }

    /// Applies a step: positions are added to, headings turned.
    pub fn step(&self, poses: &[Vector3<f64>], landmarks: &[Vector2<f64>], result: &mut Self) {
        for ((to, from), step) in result.poses.iter_mut().zip(&self.poses).zip(poses) {
            let turned = from.rotation.into_inner() * UnitComplex::new(step.z).into_inner();
            // First-order normalisation keeps rounding from adding up.
            let scale = (3.0 - turned.norm_sqr()) * 0.5;
            *to = Pose::from_parts(
                Translation2::from(from.translation.vector + step.xy()),
                UnitComplex::new_unchecked(turned * scale),
            );
        }
        for ((to, from), step) in result
            .landmarks
            .iter_mut()
            .zip(&self.landmarks)
            .zip(landmarks)
        {
            *to = from + step;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    extern crate std;

    fn number(value: &serde_json::Value) -> f64 {
        value.as_f64().unwrap()
    }

    fn rows(value: &serde_json::Value) -> Vec<Vec<f64>> {
        let row = |row: &serde_json::Value| row.as_array().unwrap().iter().map(number).collect();
        value.as_array().unwrap().iter().map(row).collect()
    }

    /// Derivatives by a complex step or differences, from the project's plain script.
    #[test]
    fn derivatives_are_those_of_the_reference() {
        let text = include_str!("../../tests/data/reference.json");
        let reference: serde_json::Value = serde_json::from_str(text).unwrap();
        let cases = reference["jacobian"].as_array().unwrap();
        assert!(!cases.is_empty());
        for case in cases {
            let (poses, landmarks) = (rows(&case["poses"]), rows(&case["landmarks"]));
            let (m, n) = (poses.len(), landmarks.len());
            let problem = Problem::dense(m, n, &rows(&case["bearings"]).concat(), 0.5).unwrap();
            let bundle = Bundle {
                poses: poses
                    .iter()
                    .map(|p| crate::geometry::pose(p[0], p[1], p[2]))
                    .collect(),
                landmarks: landmarks.iter().map(|p| Point2::new(p[0], p[1])).collect(),
            };
            let mut linearized = Rows::of(&problem);
            bundle.linearize(&problem, Loss::Squared, &mut linearized);
            for ((k, row), expected) in linearized
                .sightings
                .iter()
                .enumerate()
                .zip(rows(&case["jacobian"]))
            {
                let mut found = vec![0.0; 3 * m + 2 * n];
                found[3 * (k / n)..][..3].copy_from_slice(&row.pose());
                found[3 * m + 2 * (k % n)..][..2].copy_from_slice(&row.landmark());
                for (f, e) in found.iter().zip(expected) {
                    // Half the sigma doubles the derivative.
                    assert!((f - 2.0 * e).abs() < 1e-8, "{k}: {f} {e}");
                }
            }
        }
    }

    /// Residual and derivatives belong together: differences of the one are the other.
    #[test]
    fn derivatives_are_differences_of_residuals() {
        let bearings = [0.3, -2.0, 1.5, 2.9, 0.1, -0.4];
        let problem = Problem::dense(2, 3, &bearings, 0.1).unwrap();
        let bundle = Bundle {
            poses: vec![
                crate::geometry::pose(0.1, 0.2, 0.3),
                crate::geometry::pose(2.0, -1.0, 2.5),
            ],
            landmarks: vec![
                Point2::new(1.0, 2.0),
                Point2::new(-3.0, 1.0),
                Point2::new(0.5, -2.0),
            ],
        };
        let mut rows = Rows::of(&problem);
        bundle.linearize(&problem, Loss::Squared, &mut rows);
        let step = 1e-6;
        for parameter in 0..12 {
            let residuals = [-step, step].map(|size| {
                let mut poses = vec![Vector3::zeros(); 2];
                let mut landmarks = vec![Vector2::zeros(); 3];
                if parameter < 6 {
                    poses[parameter / 3][parameter % 3] = size;
                } else {
                    landmarks[(parameter - 6) / 2][parameter % 2] = size;
                }
                let mut moved = bundle.clone();
                bundle.step(&poses, &landmarks, &mut moved);
                let mut rows = Rows::of(&problem);
                moved.linearize(&problem, Loss::Squared, &mut rows);
                rows.sightings
                    .iter()
                    .map(|row| row.residual)
                    .collect::<Vec<f64>>()
            });
            for (k, row) in rows.sightings.iter().enumerate() {
                let difference = (residuals[1][k] - residuals[0][k]) / (2.0 * step);
                let (view, landmark) = (k / 3, k % 3);
                let expected = if parameter < 6 {
                    if parameter / 3 == view {
                        row.pose()[parameter % 3]
                    } else {
                        0.0
                    }
                } else if (parameter - 6) / 2 == landmark {
                    row.landmark()[parameter % 2]
                } else {
                    0.0
                };
                assert!(
                    (difference - expected).abs() < 1e-6,
                    "{k} {parameter}: {difference} {expected}"
                );
            }
        }
    }
}
