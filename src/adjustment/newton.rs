// SPDX-License-Identifier: MIT OR Apache-2.0
//! Newton's method on the full problem, for descents that Gauss-Newton finds hard.
//!
//! Where the bearings hardly hold a direction of the map, the curvature that Gauss-Newton leaves out
//! decides, and it crawls. And the least squares of bearings need not have a minimum at all: the cost
//! may fall towards an infimum that no map attains, as a landmark slides onto a view and that one
//! bearing is explained for free, or as a landmark goes to infinity. On these two boundaries of the space of
//! maps there is a smaller problem with a minimum of its own, (T23): it is tried, and kept
//! when it is lower and the cost rises from it inwards.

use super::bundle::{Bundle, Rows};
use super::bundle_adjustment::{BundleAdjustment, StepSolver};
use super::cholesky;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::{centroid, horizon, spread};
use crate::lm::{BearingRow, Termination};
use crate::problem::Problem;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{Point2, UnitComplex, Vector2, Vector3};

/// Most parameters for which the full matrix is formed.
pub const MAX_FULL: usize = 512;

/// A landmark is tried on a view when it is nearer to it than this part of the distance to any other.
const TOUCHING: f64 = 0.05;

/// A landmark is tried at infinity when it is this much farther from the middle of the views than they.
const FAR: f64 = 20.0;

/// A boundary that was not lower is tried again when the landmark is this part nearer to it.
const CLOSER: f64 = 0.1;

/// Iterations within which a boundary must come out lower.
const ATTEMPT: usize = 10;

/// Ends an adjustment by Newton's method, on the boundaries of the space of maps where that is lower.
///
/// # Errors
/// As [`BundleAdjustment::run`].
pub fn finish(adjustment: &mut BundleAdjustment<'_, '_>) -> Result<Termination, Error> {
    let limit = adjustment.options.max_iterations;
    let mut newton = Newton::new(adjustment.problem);
    loop {
        let attempt = match newton.boundaries.last() {
            Some(entered) if adjustment.cost >= entered.cost => {
                limit.min(adjustment.iterations + ATTEMPT)
            }
            _ => limit,
        };
        let termination = adjustment.run(&mut newton, attempt)?;
        if let Some((boundary, distance)) = newton.next.take() {
            newton.enter(boundary, distance, adjustment);
            continue;
        }
        if let Some(wrong) = newton.wrong_boundary(adjustment) {
            newton.leave(wrong, adjustment);
        } else if termination != Termination::MaxIterations || adjustment.iterations == limit {
            newton.step_inside(adjustment);
            return Ok(termination);
        }
        if adjustment.iterations == limit {
            return Ok(Termination::MaxIterations);
        }
    }
}

/// Whether a landmark is so near to a boundary that the minimum may lie there.
pub fn near_boundary(adjustment: &BundleAdjustment<'_, '_>) -> bool {
    Newton::new(adjustment.problem).wants_pause(
        &adjustment.bundle,
        &adjustment.rows,
        adjustment.cost,
    )
}

/// Where a landmark may leave the plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Boundary {
    /// On the view of a sighting, by index.
    View(usize),
    /// At infinity.
    Infinity(usize),
}

/// A boundary that is tried or kept.
struct BoundaryTrial {
    boundary: Boundary,
    /// How far off the landmark was, and the bundle and its cost then.
    distance: f64,
    bundle: Bundle,
    cost: f64,
}

/// Where the parameters of a landmark begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    /// Two coordinates of its own.
    Point(usize),
    /// Those of the view on which it stands.
    View(usize),
    /// A direction.
    Direction(usize),
}

/// The second-order model of the cost in all parameters.
struct Newton<'a> {
    problem: &'a Problem,
    boundaries: Vec<BoundaryTrial>,
    /// Boundaries that were not lower, and how far off the landmark was.
    refused: Vec<(Boundary, f64)>,
    /// The boundary to be tried next.
    next: Option<(Boundary, f64)>,
    columns: Vec<Column>,
    /// Lower triangles, row by row: of Gauss-Newton, of Newton, and the factor.
    normal: Vec<f64>,
    curved: Vec<f64>,
    factor: Vec<f64>,
    gradient: Vec<f64>,
    delta: Vec<f64>,
}

impl<'a> Newton<'a> {
    fn new(problem: &'a Problem) -> Self {
        let mut newton = Self {
            problem,
            boundaries: Vec::new(),
            refused: Vec::new(),
            next: None,
            columns: Vec::new(),
            normal: Vec::new(),
            curved: Vec::new(),
            factor: Vec::new(),
            gradient: Vec::new(),
            delta: Vec::new(),
        };
        newton.number();
        newton
    }

    /// Gives every landmark its parameters.
    fn number(&mut self) {
        let mut count = 3 * self.problem.views();
        self.columns.clear();
        for landmark in 0..self.problem.landmarks() {
            let trial = self
                .boundaries
                .iter()
                .find(|trial| self.landmark(trial.boundary) == landmark);
            let (column, width) = match trial.map(|trial| trial.boundary) {
                Some(Boundary::View(k)) => (Column::View(3 * self.problem.sightings()[k].view), 0),
                Some(Boundary::Infinity(_)) => (Column::Direction(count), 1),
                None => (Column::Point(count), 2),
            };
            self.columns.push(column);
            count += width;
        }
        self.gradient.clear();
        self.gradient.resize(count, 0.0);
    }

    fn landmark(&self, place: Boundary) -> usize {
        match place {
            Boundary::View(k) => self.problem.sightings()[k].landmark,
            Boundary::Infinity(landmark) => landmark,
        }
    }

    /// Puts a landmark on a boundary.
    fn enter(&mut self, place: Boundary, distance: f64, adjustment: &mut BundleAdjustment<'_, '_>) {
        let mut bundle = adjustment.bundle.clone();
        match place {
            Boundary::View(k) => {
                let s = &self.problem.sightings()[k];
                bundle.landmarks[s.landmark] = bundle.poses[s.view].translation.vector.into();
            }
            Boundary::Infinity(landmark) => {
                let (middle, _) = middle(&bundle);
                let direction = (bundle.landmarks[landmark].coords - middle).normalize();
                bundle.landmarks[landmark] = Point2::from(middle + direction * horizon::<f64>());
            }
        }
        let before = core::mem::replace(&mut adjustment.bundle, bundle);
        self.boundaries.push(BoundaryTrial {
            boundary: place,
            distance,
            bundle: before,
            cost: adjustment.cost,
        });
        self.number();
        adjustment.relinearize();
    }

    /// Goes back to where a boundary was entered, and does not try it again soon.
    fn leave(&mut self, wrong: usize, adjustment: &mut BundleAdjustment<'_, '_>) {
        if let Some(trial) = self.boundaries.drain(wrong..).next() {
            self.refused.retain(|(place, _)| *place != trial.boundary);
            self.refused.push((trial.boundary, trial.distance));
            adjustment.bundle = trial.bundle;
            adjustment.relinearize();
        }
        self.number();
    }

    /// The boundary, if any, that is not lower than the inside, or from which the cost falls inwards.
    fn wrong_boundary(&self, adjustment: &BundleAdjustment<'_, '_>) -> Option<usize> {
        if let Some(last) = self.boundaries.last()
            && adjustment.cost >= last.cost
        {
            return Some(self.boundaries.len() - 1);
        }
        self.boundaries
            .iter()
            .position(|trial| self.falls_inwards(trial.boundary, adjustment))
    }

    fn falls_inwards(&self, place: Boundary, adjustment: &BundleAdjustment<'_, '_>) -> bool {
        let bundle = &adjustment.bundle;
        let landmark = self.landmark(place);
        let seen = self.problem.of_landmark(landmark).iter();
        let slope = match place {
            Boundary::View(k) => {
                let ray = self.ray(bundle, k);
                seen.map(|&k| &adjustment.rows.sightings[k])
                    .fold(0.0, |sum, row| sum + row.gradient.dot(&ray) * row.residual)
            }
            Boundary::Infinity(_) => {
                let (middle, _) = middle(bundle);
                let direction = (bundle.landmarks[landmark].coords - middle).normalize();
                seen.fold(0.0, |sum, &k| {
                    let view = self.problem.sightings()[k].view;
                    let row = &adjustment.rows.sightings[k];
                    let offset = middle - bundle.poses[view].translation.vector;
                    sum + direction.perp(&offset) * row.weight * row.residual
                })
            }
        };
        slope < 0.0
    }

    /// Direction of a measured bearing in the map.
    fn ray(&self, bundle: &Bundle, sighting: usize) -> Vector2<f64> {
        let s = &self.problem.sightings()[sighting];
        let ray = bundle.poses[s.view].rotation.into_inner() * s.bearing.into_inner();
        Vector2::new(ray.re, ray.im)
    }

    /// Moves each landmark that stands on a view off it by next to nothing, at its measured bearing.
    fn step_inside(&self, adjustment: &mut BundleAdjustment<'_, '_>) {
        for trial in &self.boundaries {
            if let Boundary::View(k) = trial.boundary {
                let step = self.ray(&adjustment.bundle, k) * (f64::EPSILON.sqrt() * 0.1);
                adjustment.bundle.landmarks[self.landmark(trial.boundary)] += step;
            }
        }
        if !self.boundaries.is_empty() {
            adjustment.relinearize();
        }
    }

    /// Forms the matrices and the gradient.
    fn assemble(&mut self, bundle: &Bundle, rows: &[BearingRow]) {
        let size = self.gradient.len();
        for matrix in [&mut self.normal, &mut self.curved] {
            matrix.resize(size * size, 0.0);
            for i in 0..size {
                matrix[i * size..=i * size + i].fill(0.0);
            }
        }
        self.gradient.fill(0.0);
        for (s, row) in self.problem.sightings().iter().zip(rows) {
            let p = 3 * s.view;
            let [gx, gy]: [f64; 2] = row.gradient.into();
            // Second derivatives by the landmark; by the position the same, by both the negative.
            let bend = row.residual / row.weight;
            let cross = bend * -2.0 * gx * gy;
            let square = bend * (gx * gx - gy * gy);
            let (x, last, width) = match self.columns[s.landmark] {
                Column::View(place) if place == p => continue,
                Column::View(place) | Column::Point(place) => (place, [gx, gy], 5),
                Column::Direction(place) => (place, [row.weight, 0.0], 4),
            };
            let places = [p, p + 1, p + 2, x, x + 1];
            let derivative = [-gx, -gy, -row.weight, last[0], last[1]];
            for i in 0..width {
                self.gradient[places[i]] += derivative[i] * row.residual;
                for j in 0..width {
                    if places[j] <= places[i] {
                        let place = places[i] * size + places[j];
                        self.normal[place] += derivative[i] * derivative[j];
                        if i != 2 && j != 2 && width == 5 {
                            let entry = match (i % 3, j % 3) {
                                (0, 0) => cross,
                                (1, 1) => -cross,
                                _ => square,
                            };
                            let same = (i < 3) == (j < 3);
                            self.curved[place] += if same { entry } else { -entry };
                        }
                    }
                }
            }
        }
        let trace = (0..size).fold(0.0, |sum, k| sum + self.normal[k * size + k]);
        for direction in self.gauge(bundle) {
            let square = direction.iter().fold(0.0, |sum, d| sum + *d * *d);
            let stiffness = trace / ((size as f64) * square);
            for i in 0..size {
                for j in 0..=i {
                    self.normal[i * size + j] += direction[i] * direction[j] * stiffness;
                }
            }
        }
        for i in 0..size {
            let row = i * size..=i * size + i;
            for (curved, normal) in self.curved[row.clone()].iter_mut().zip(&self.normal[row]) {
                *curved += *normal;
            }
        }
    }

    /// Translations, rotation and scaling of all that is free.
    fn gauge(&self, bundle: &Bundle) -> [Vec<f64>; 4] {
        let mut directions = [(); 4].map(|()| vec![0.0; self.gradient.len()]);
        let mut add = |place: usize, position: &Vector2<f64>| {
            directions[0][place] = 1.0;
            directions[1][place + 1] = 1.0;
            directions[2][place] = -position.y;
            directions[2][place + 1] = position.x;
            directions[3][place] = position.x;
            directions[3][place + 1] = position.y;
        };
        for (view, pose) in bundle.poses.iter().enumerate() {
            add(3 * view, &pose.translation.vector);
        }
        for (column, point) in self.columns.iter().zip(&bundle.landmarks) {
            if let Column::Point(place) = *column {
                add(place, &point.coords);
            }
        }
        for view in 0..bundle.poses.len() {
            directions[2][3 * view + 2] = 1.0;
        }
        for column in &self.columns {
            if let Column::Direction(place) = *column {
                directions[2][place] = 1.0;
            }
        }
        directions
    }

    /// Solves with one of the matrices, damped; the fall of the cost that it predicts.
    fn solve_with(&mut self, damping: f64, curved: bool) -> Option<f64> {
        let size = self.gradient.len();
        let matrix = if curved { &self.curved } else { &self.normal };
        self.factor.resize(size * size, 0.0);
        for i in 0..size {
            let row = i * size..=i * size + i;
            self.factor[row.clone()].copy_from_slice(&matrix[row]);
        }
        for k in 0..size {
            self.factor[k * size + k] += damping * self.normal[k * size + k];
        }
        if !cholesky::factorize(&mut self.factor, size) {
            return None;
        }
        self.delta.clear();
        self.delta.extend(self.gradient.iter().map(|g| -*g));
        cholesky::solve(&self.factor, &mut self.delta);
        let mut predicted = 0.0;
        for (k, (&d, &g)) in self.delta.iter().zip(&self.gradient).enumerate() {
            predicted += d * (damping * self.normal[k * size + k] * d - g);
        }
        let predicted = predicted * 0.5;
        predicted.is_finite().then_some(predicted)
    }

    /// The bundle after the step that has been solved for.
    fn apply(&self, bundle: &Bundle, result: &mut Bundle) {
        let delta = &self.delta;
        let pair = |place: usize| Vector2::new(delta[place], delta[place + 1]);
        let poses: Vec<_> = (0..bundle.poses.len())
            .map(|view| Vector3::from_column_slice(&delta[3 * view..3 * view + 3]))
            .collect();
        let landmarks: Vec<_> = self
            .columns
            .iter()
            .zip(&bundle.landmarks)
            .map(|(column, point)| match *column {
                Column::Point(place) | Column::View(place) => pair(place),
                Column::Direction(place) => {
                    UnitComplex::new(delta[place]) * point.coords - point.coords
                }
            })
            .collect();
        bundle.step(&poses, &landmarks, result);
    }

    /// Whether a boundary may be tried from so far off.
    fn open(&self, place: Boundary, distance: f64) -> bool {
        self.refused
            .iter()
            .find(|(other, _)| *other == place)
            .is_none_or(|(_, then)| distance < *then * CLOSER)
    }
}

/// The middle of the views and their root mean square distance from it.
fn middle(bundle: &Bundle) -> (Vector2<f64>, f64) {
    let views: Vec<_> = bundle.poses.iter().map(|p| p.translation.vector).collect();
    let size = (spread(&views) / (views.len() as f64)).sqrt();
    (centroid(&views), size)
}

impl StepSolver for Newton<'_> {
    fn solve(
        &mut self,
        bundle: &Bundle,
        rows: &Rows,
        damping: f64,
        result: &mut Bundle,
    ) -> Option<f64> {
        self.assemble(bundle, &rows.sightings);
        let predicted = self
            .solve_with(damping, true)
            .or_else(|| self.solve_with(damping, false))?;
        self.apply(bundle, result);
        Some(predicted)
    }

    fn moves_landmark(&self, landmark: usize) -> bool {
        matches!(self.columns[landmark], Column::Point(_))
    }

    fn keeps_refused_damping(&self) -> bool {
        true
    }

    fn wants_pause(&mut self, bundle: &Bundle, rows: &Rows, cost: f64) -> bool {
        // A line of sight goes on behind its view and beyond infinity: there is no boundary.
        if !self.problem.is_oriented() {
            return false;
        }
        if self
            .boundaries
            .last()
            .is_some_and(|trial| cost >= trial.cost)
        {
            return false;
        }
        let (middle, size) = middle(bundle);
        let rows = &rows.sightings;
        let range = |k: usize| rows[k].weight / rows[k].gradient.norm();
        for landmark in (0..self.columns.len()).filter(|&landmark| self.moves_landmark(landmark)) {
            let seen = self.problem.of_landmark(landmark);
            let unseen = 1.0 / 0.0;
            let (mut nearest, mut next) = ((unseen, 0), unseen);
            for &k in seen {
                let range = range(k);
                if range < nearest.0 {
                    next = nearest.0;
                    nearest = (range, k);
                } else {
                    next = next.min(range);
                }
            }
            let distance = nearest.0 / next;
            let place = Boundary::View(nearest.1);
            if distance < TOUCHING && self.open(place, distance) {
                self.next = Some((place, distance));
                return true;
            }
            let away = (bundle.landmarks[landmark].coords - middle).norm();
            let distance = size / away;
            let place = Boundary::Infinity(landmark);
            if distance < (1.0 / FAR) && self.open(place, distance) {
                self.next = Some((place, distance));
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::lm::Loss;

    /// Three views and three landmarks: one on a view, one at infinity, one in the plane.
    fn setting(problem: &Problem) -> (Bundle, Newton<'_>) {
        let far = horizon::<f64>();
        let bundle = Bundle {
            poses: [(0.1, 0.2, 0.3), (2.0, -1.0, 2.5), (-0.7, 0.9, -1.1)]
                .map(|(x, y, theta)| pose(x, y, theta))
                .to_vec(),
            landmarks: vec![
                Point2::new(1.0, 2.0),
                Point2::new(2.0, -1.0),
                Point2::new(0.6 * far, -0.8 * far),
            ],
        };
        let mut newton = Newton::new(problem);
        for place in [Boundary::View(4), Boundary::Infinity(2)] {
            newton.boundaries.push(BoundaryTrial {
                boundary: place,
                distance: 0.0,
                bundle: bundle.clone(),
                cost: 0.0,
            });
        }
        newton.number();
        (bundle, newton)
    }

    /// The curved matrix without the gauge is the derivative of the gradient.
    #[test]
    fn second_derivatives_are_differences_of_the_gradient() {
        let bearings = [0.3, -2.0, 1.5, 2.9, 0.1, -0.4, 1.2, -0.9, 2.2];
        let problem = Problem::dense(3, 3, &bearings, 0.5).unwrap();
        let (bundle, mut newton) = setting(&problem);
        let mut rows = Rows::of(&problem);
        let gradient = |newton: &mut Newton<'_>, bundle: &Bundle| {
            let mut rows = Rows::of(&problem);
            bundle.linearize(&problem, Loss::Squared, &mut rows);
            newton.assemble(bundle, &rows.sightings);
            newton.gradient.clone()
        };
        bundle.linearize(&problem, Loss::Squared, &mut rows);
        newton.assemble(&bundle, &rows.sightings);
        let size = newton.gradient.len();
        assert_eq!(size, 9 + 2 + 1);
        let mut curved = newton.curved.clone();
        // What the gauge has added to the matrix it has added to the plain one as well.
        let trace: f64 = {
            let plain: f64 = rows
                .sightings
                .iter()
                .zip(problem.sightings())
                .filter(|(_, s)| newton.columns[s.landmark] != Column::View(3 * s.view))
                .map(|(row, s)| {
                    let square = row.gradient.norm_squared();
                    let last = match newton.columns[s.landmark] {
                        Column::Direction(_) => row.weight * row.weight,
                        _ => square,
                    };
                    square + row.weight * row.weight + last
                })
                .sum();
            plain
        };
        for direction in newton.gauge(&bundle) {
            let square: f64 = direction.iter().map(|d| d * d).sum();
            let stiffness = trace / (size as f64 * square);
            for i in 0..size {
                for j in 0..=i {
                    curved[i * size + j] -= direction[i] * direction[j] * stiffness;
                }
            }
        }
        let step = 1e-6;
        for parameter in 0..size {
            let sides = [-step, step].map(|length| {
                newton.delta = vec![0.0; size];
                newton.delta[parameter] = length;
                let mut moved = bundle.clone();
                newton.apply(&bundle, &mut moved);
                gradient(&mut newton, &moved)
            });
            for other in 0..size {
                let difference = (sides[1][other] - sides[0][other]) / (2.0 * step);
                let entry = curved[parameter.max(other) * size + parameter.min(other)];
                assert!(
                    (difference - entry).abs() < 1e-5 * (1.0 + entry.abs()),
                    "{parameter} {other}: {difference} {entry}"
                );
            }
        }
    }
}
