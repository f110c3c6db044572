// SPDX-License-Identifier: MIT OR Apache-2.0
//! All poses and landmarks of a problem as one set of parameters, and the residuals linearised.

use super::prior_rows::{PriorRow, linearize};
use crate::error::Error;
use crate::geometry::points::{unit, within_horizon};
use crate::geometry::{Pose, transform_pose};
use crate::lm::{BearingRow, Loss, Ray, SightingModel, optimize_landmark};
use crate::problem::{IndexedSighting, Map, Problem};
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
    pub sightings: Vec<BearingRow>,
    pub priors: Vec<PriorRow>,
}

impl Rows {
    /// Empty, with capacity for a problem.
    pub fn of(problem: &Problem) -> Self {
        Self {
            sightings: Vec::with_capacity(problem.sightings().len()),
            priors: Vec::with_capacity(problem.priors().len()),
        }
    }
}

#[inline]
fn ray(sighting: &IndexedSighting) -> Ray {
    Ray {
        bearing: sighting.bearing,
        weight: sighting.weight,
    }
}

fn sighting_model(problem: &Problem, loss: Loss) -> SightingModel {
    SightingModel {
        oriented: problem.is_oriented(),
        loss,
    }
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

    /// The unit of length in which it is refined, see [`unit`].
    pub fn unit(&self) -> Result<f64, Error> {
        let views = self.poses.iter().map(|pose| pose.translation.vector);
        unit(views, self.landmarks.iter().map(|point| point.coords))
    }

    /// Moves landmarks beyond the horizon, which are indistinguishable from infinity, back to it.
    pub fn bring_in(&mut self) {
        if let Some(home) = self.poses.first() {
            for point in &mut self.landmarks {
                point.coords = within_horizon(point.coords, &home.translation.vector);
            }
        }
    }

    /// Transforms everything by a similarity.
    pub fn transform(&mut self, similarity: &Similarity2<f64>) {
        for pose in &mut self.poses {
            *pose = transform_pose(similarity, pose);
        }
        for point in &mut self.landmarks {
            *point = similarity.transform_point(point);
        }
    }

    /// Moves everything so that the first view is at the origin.
    pub fn come_home(&mut self) {
        let Some(home) = self.poses.first().map(|pose| pose.translation.vector) else {
            return;
        };
        for pose in &mut self.poses {
            pose.translation.vector -= home;
        }
        for point in &mut self.landmarks {
            point.coords -= home;
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

    /// Linearises everything; returns the cost, half the sum of the losses and of the squares of odometry and priors.
    pub fn linearize(&self, problem: &Problem, loss: Loss, rows: &mut Rows) -> f64 {
        let model = sighting_model(problem, loss);
        let mut sum = if model.is_plain() {
            self.linearize_sightings::<true>(problem, &model, &mut rows.sightings)
        } else {
            self.linearize_sightings::<false>(problem, &model, &mut rows.sightings)
        };
        rows.priors.clear();
        for prior in problem.priors() {
            let row = linearize(prior, &self.poses, &self.landmarks);
            sum += row.square();
            rows.priors.push(row);
        }
        sum * 0.5
    }

    /// The sum of the losses.
    fn linearize_sightings<const PLAIN: bool>(
        &self,
        problem: &Problem,
        model: &SightingModel,
        rows: &mut Vec<BearingRow>,
    ) -> f64 {
        rows.clear();
        let mut sum = 0.0;
        for (view, pose) in self.poses.iter().enumerate() {
            for s in problem.of_view(view) {
                let point = &self.landmarks[s.landmark];
                let (row, value) = BearingRow::weighted::<PLAIN>(pose, point, &ray(s), model);
                sum += value;
                rows.push(row);
            }
        }
        sum
    }

    /// Moves a landmark towards its best position with the poses held fixed, see [`optimize_landmark`].
    pub fn optimize_landmark(&mut self, problem: &Problem, loss: Loss, landmark: usize) {
        let model = sighting_model(problem, loss);
        if model.is_plain() {
            self.optimize_landmark_as::<true>(problem, &model, landmark);
        } else {
            self.optimize_landmark_as::<false>(problem, &model, landmark);
        }
    }

    fn optimize_landmark_as<const PLAIN: bool>(
        &mut self,
        problem: &Problem,
        model: &SightingModel,
        landmark: usize,
    ) {
        let seen = problem.of_landmark(landmark).iter();
        let (best, ..) = optimize_landmark(self.landmarks[landmark], |_, place| {
            let rows = seen.clone().map(|&k| {
                let s = &problem.sightings()[k];
                BearingRow::weighted::<PLAIN>(&self.poses[s.view], place, &ray(s), model)
            });
            rows.collect()
        });
        self.landmarks[landmark] = best;
    }

    /// Applies a step: adds to positions and rotates headings.
    pub fn step(&self, poses: &[Vector3<f64>], landmarks: &[Vector2<f64>], result: &mut Self) {
        for ((to, from), step) in result.poses.iter_mut().zip(&self.poses).zip(poses) {
            let turned = from.rotation.into_inner() * UnitComplex::new(step.z).into_inner();
            // First-order normalisation, so that rounding does not accumulate.
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

    /// Derivatives by a complex step or differences, from the project's reference script.
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

    /// Coming home moves everything by the place of the first view, which no bearing notices.
    #[test]
    fn coming_home_brings_the_first_view_to_the_origin() {
        let problem = Problem::dense(2, 1, &[0.3, -2.0], 0.1).unwrap();
        let away = Bundle {
            poses: vec![
                crate::geometry::pose(40.0, -7.0, 0.3),
                crate::geometry::pose(42.0, -8.0, 2.5),
            ],
            landmarks: vec![Point2::new(41.0, -5.0)],
        };
        let mut home = away.clone();
        home.come_home();
        assert_eq!(home.poses[0].translation.vector, Vector2::zeros());
        assert_eq!(home.poses[1].translation.vector, Vector2::new(2.0, -1.0));
        let costs = [&away, &home]
            .map(|bundle| bundle.linearize(&problem, Loss::Squared, &mut Rows::of(&problem)));
        assert!((costs[0] / costs[1] - 1.0).abs() < 1e-12, "{costs:?}");
    }

    /// The derivatives agree with differences of the residuals.
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
