// SPDX-License-Identifier: MIT OR Apache-2.0
//! Newton's method on the full problem, for descents that are slow with Gauss-Newton.
//!
//! Where the bearings hardly determine a direction of the map, the curvature that Gauss-Newton neglects decides the
//! step. A landmark that the descent drives onto a view or towards infinity is placed on that boundary, where it has
//! fewer parameters or none: see [`Boundaries`].

use super::boundary::{Boundaries, Boundary};
use super::bundle::{Bundle, Rows};
use super::cholesky;
use super::gauge::{anchors, gauge_directions};
use super::prior_rows::PriorRow;
use super::step_solver::{BundleAdjustment, StepSolver};
use crate::error::Error;
use crate::lm::{BearingRow, Prediction, Termination};
use crate::problem::{Problem, Subject};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{UnitComplex, Vector2, Vector3};

/// Maximum number of parameters for which the full matrix is formed: three square matrices of two megabytes each, and
/// some ten milliseconds for a factorisation.
pub const MAX_FULL: usize = 512;

/// Maximum number of iterations, times the cube of the number of parameters, as which their time grows: 1000 of 200
/// parameters, which take a second or two. Gauss-Newton may go on.
const WORK: u64 = 8_000_000_000;

/// The iterations of a problem with so many parameters that may be spent on Newton's method.
pub fn affordable(parameters: usize) -> usize {
    let cube = (parameters.max(1) as u64).saturating_pow(3);
    usize::try_from(WORK / cube).unwrap_or(usize::MAX)
}

/// Completes an adjustment by Newton's method, with landmarks on boundaries where that lowers the cost, until the total
/// number of iterations reaches `limit`.
///
/// # Errors
/// As [`BundleAdjustment::run`].
pub fn finish(
    adjustment: &mut BundleAdjustment<'_, '_>,
    limit: usize,
) -> Result<Termination, Error> {
    let mut newton = Newton::new(Boundaries::new(adjustment.problem), adjustment.problem);
    loop {
        let termination = descend(adjustment, &mut newton, limit)?;
        // Whichever way it ends: on its view a landmark has no bearing, and next to it by rounding has any.
        if newton.boundaries.step_inside(adjustment) {
            return Ok(termination);
        }
        newton.number_parameters();
        if adjustment.iterations >= limit {
            return Ok(Termination::MaxIterations);
        }
    }
}

/// Descends, and enters and leaves boundaries.
fn descend(
    adjustment: &mut BundleAdjustment<'_, '_>,
    newton: &mut Newton<'_>,
    limit: usize,
) -> Result<Termination, Error> {
    loop {
        let end = newton.boundaries.limit_of_run(adjustment, limit);
        let termination = adjustment.run(newton, end)?;
        if newton.boundaries.enter_candidate(adjustment) {
            newton.number_parameters();
            continue;
        }
        if newton.boundaries.leave_wrong(adjustment) {
            newton.number_parameters();
        } else if termination != Termination::MaxIterations || adjustment.iterations == limit {
            return Ok(termination);
        }
        if adjustment.iterations == limit {
            return Ok(Termination::MaxIterations);
        }
    }
}

/// Index of the first parameter of a landmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum NewtonColumn {
    /// Two coordinates of its own.
    Point(usize),
    /// Those of the view that it is on.
    View(usize),
    /// The angle of its direction, at infinity.
    Direction(usize),
}

/// The second-order model of the cost in all parameters.
///
/// Parameters are numbered views first (x, y, heading), then landmarks. Matrices are lower triangles, row by row.
struct Newton<'a> {
    problem: &'a Problem,
    boundaries: Boundaries<'a>,
    /// The columns of each landmark.
    columns: Vec<NewtonColumn>,
    /// `J^T J`, with a stiffness along the gauge.
    normal: Vec<f64>,
    /// The Hessian: the same plus the second derivatives of the residuals.
    curved: Vec<f64>,
    /// The Cholesky factor of one of them, damped.
    factor: Vec<f64>,
    gradient: Vec<f64>,
    /// The step.
    delta: Vec<f64>,
}

impl<'a> Newton<'a> {
    fn new(boundaries: Boundaries<'a>, problem: &'a Problem) -> Self {
        let mut newton = Self {
            problem,
            boundaries,
            columns: Vec::new(),
            normal: Vec::new(),
            curved: Vec::new(),
            factor: Vec::new(),
            gradient: Vec::new(),
            delta: Vec::new(),
        };
        newton.number_parameters();
        newton
    }

    /// Assigns the parameters of every landmark.
    fn number_parameters(&mut self) {
        let mut count = 3 * self.problem.views();
        self.columns.clear();
        for landmark in 0..self.problem.landmarks() {
            let (column, width) = match self.boundaries.of_landmark(landmark) {
                Some(Boundary::View(k)) => {
                    (NewtonColumn::View(3 * self.problem.sightings()[k].view), 0)
                }
                Some(Boundary::Infinity(_)) => (NewtonColumn::Direction(count), 1),
                None => (NewtonColumn::Point(count), 2),
            };
            self.columns.push(column);
            count += width;
        }
        self.gradient.clear();
        self.gradient.resize(count, 0.0);
    }

    /// Forms the matrices and the gradient.
    fn assemble(&mut self, bundle: &Bundle, rows: &Rows) {
        self.add_up(rows);
        self.stiffen_gauge(bundle);
        let size = self.gradient.len();
        for i in 0..size {
            let row = i * size..=i * size + i;
            for (curved, normal) in self.curved[row.clone()].iter_mut().zip(&self.normal[row]) {
                *curved += *normal;
            }
        }
    }

    /// The matrices without the stiffness, `curved` with the second derivatives of the residuals alone, and the gradient.
    fn add_up(&mut self, rows: &Rows) {
        let size = self.gradient.len();
        for matrix in [&mut self.normal, &mut self.curved] {
            matrix.resize(size * size, 0.0);
            for i in 0..size {
                matrix[i * size..=i * size + i].fill(0.0);
            }
        }
        self.gradient.fill(0.0);
        self.add_sightings(&rows.sightings);
        for row in &rows.priors {
            self.add_prior(row);
        }
    }

    /// Adds the sightings to matrices and gradient.
    fn add_sightings(&mut self, rows: &[BearingRow]) {
        let size = self.gradient.len();
        for (s, row) in self.problem.sightings().iter().zip(rows) {
            let p = 3 * s.view;
            let [gx, gy]: [f64; 2] = row.gradient.into();
            // Second derivatives with respect to the landmark; those for the position of the view are the same, mixed
            // ones the negative.
            let bend = row.residual / row.weight;
            let cross = bend * -2.0 * gx * gy;
            let square = bend * (gx * gx - gy * gy);
            let (x, last, width) = match self.columns[s.landmark] {
                NewtonColumn::View(place) if place == p => continue,
                NewtonColumn::View(place) | NewtonColumn::Point(place) => (place, [gx, gy], 5),
                NewtonColumn::Direction(place) => (place, [row.weight, 0.0], 4),
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
    }

    /// Adds odometry or a prior to the normal matrix and the gradient; of the second derivatives only a motion has any,
    /// which are small where odometry is good.
    fn add_prior(&mut self, row: &PriorRow) {
        let size = self.gradient.len();
        let ends = [Some(row.first), row.second].into_iter().flatten();
        let ends = ends.map(|(subject, jacobian)| match subject {
            Subject::View(view) => (3 * view, 3, jacobian),
            Subject::Landmark(landmark) => match self.columns[landmark] {
                NewtonColumn::Point(place) | NewtonColumn::View(place) => (place, 2, jacobian),
                // A landmark with a prior is never at infinity.
                NewtonColumn::Direction(place) => (place, 0, jacobian),
            },
        });
        let parameters: Vec<(usize, [f64; 3])> = ends
            .flat_map(|(place, width, jacobian)| {
                (0..width).map(move |c| (place + c, jacobian.map(|row| row[c])))
            })
            .collect();
        let product = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        for &(i, slope) in &parameters {
            self.gradient[i] += product(slope, row.residual);
            for &(j, other) in parameters.iter().filter(|(j, _)| *j <= i) {
                self.normal[i * size + j] += product(slope, other);
            }
        }
    }

    /// Gives the directions of the gauge the stiffness of an average parameter. The gradient along them is zero,
    /// so this fixes the gauge and, without damping, changes nothing else.
    ///
    /// With odometry and priors, whose standard deviations may differ by many orders of magnitude, an average would lose the
    /// weakest in rounding: anchors take its place.
    fn stiffen_gauge(&mut self, bundle: &Bundle) {
        let size = self.gradient.len();
        let directions = self.gauge(bundle);
        if !self.problem.priors().is_empty() {
            for k in anchors(&directions, |k| self.normal[k * size + k]) {
                self.normal[k * size + k] *= 2.0;
            }
            return;
        }
        let trace = (0..size).fold(0.0, |sum, k| sum + self.normal[k * size + k]);
        for direction in directions {
            let square = direction.iter().fold(0.0, |sum, d| sum + *d * *d);
            let stiffness = trace / ((size as f64) * square);
            for i in 0..size {
                for j in 0..=i {
                    self.normal[i * size + j] += direction[i] * direction[j] * stiffness;
                }
            }
        }
    }

    /// The directions of the gauge that odometry and priors leave free, as directions in parameter space.
    fn gauge(&self, bundle: &Bundle) -> Vec<Vec<f64>> {
        let mut finite = bundle.clone();
        for (column, point) in self.columns.iter().zip(&mut finite.landmarks) {
            if let NewtonColumn::Direction(_) = column {
                *point = bundle.poses[0].translation.vector.into();
            }
        }
        let views = 3 * bundle.poses.len();
        let directions = gauge_directions(self.problem, &finite).into_iter();
        let numbered = directions.map(|all| {
            let mut direction = vec![0.0; self.gradient.len()];
            direction[..views].copy_from_slice(&all[..views]);
            for (column, point) in self.columns.iter().zip(all[views..].chunks_exact(2)) {
                match *column {
                    NewtonColumn::Point(place) => {
                        direction[place..place + 2].copy_from_slice(point)
                    }
                    // It turns as headings do.
                    NewtonColumn::Direction(place) => direction[place] = all[2],
                    NewtonColumn::View(_) => {}
                }
            }
            direction
        });
        numbered.collect()
    }

    /// Solves for the step with the Hessian (`curved`) or the normal matrix, damped. Returns what that model predicts;
    /// `None` when the matrix is not positive definite.
    fn solve_with(&mut self, damping: f64, curved: bool) -> Option<Prediction<f64>> {
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
        let (mut left, mut slope) = (0.0, 0.0);
        for (k, (&d, &g)) in self.delta.iter().zip(&self.gradient).enumerate() {
            left += d * damping * self.normal[k * size + k] * d;
            slope -= d * g;
        }
        let predicted = Prediction::new(left, slope - left);
        predicted.gain.is_finite().then_some(predicted)
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
                NewtonColumn::Point(place) | NewtonColumn::View(place) => pair(place),
                NewtonColumn::Direction(place) => {
                    UnitComplex::new(delta[place]) * point.coords - point.coords
                }
            })
            .collect();
        bundle.step(&poses, &landmarks, result);
    }
}

impl StepSolver for Newton<'_> {
    fn solve(
        &mut self,
        bundle: &Bundle,
        rows: &Rows,
        damping: f64,
        result: &mut Bundle,
    ) -> Option<Prediction<f64>> {
        self.assemble(bundle, rows);
        let predicted = self
            .solve_with(damping, true)
            .or_else(|| self.solve_with(damping, false))?;
        self.apply(bundle, result);
        Some(predicted)
    }

    fn moves_landmark(&self, landmark: usize) -> bool {
        matches!(self.columns[landmark], NewtonColumn::Point(_)) && !self.boundaries.known[landmark]
    }

    fn keeps_refused_damping(&self) -> bool {
        true
    }

    fn wants_pause(&mut self, bundle: &Bundle, rows: &Rows, cost: f64) -> bool {
        self.boundaries.find_candidate(bundle, rows, cost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::points::horizon;
    use crate::geometry::pose;
    use crate::lm::Loss;
    use crate::problem::{LandmarkPrior, Noise, Odometry, PosePrior};
    use nalgebra::Point2;

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
        let boundaries = [Boundary::View(4), Boundary::Infinity(2)];
        let newton = Newton::new(Boundaries::entered(problem, &bundle, &boundaries), problem);
        (bundle, newton)
    }

    #[test]
    fn many_parameters_afford_few_iterations() {
        assert_eq!(
            [0, 50, 200, 400, MAX_FULL].map(affordable),
            [8_000_000_000, 64_000, 1000, 125, 59]
        );
    }

    /// The Hessian without the stiffness of the gauge is the derivative of the gradient.
    #[test]
    fn second_derivatives_are_differences_of_the_gradient() {
        let bearings = [0.3, -2.0, 1.5, 2.9, 0.1, -0.4, 1.2, -0.9, 2.2];
        let alone = Problem::dense(3, 3, &bearings, 0.5).unwrap();
        let (bundle, _) = setting(&alone);
        let sigmas = Noise::Sigmas([0.3, 0.2, 0.1]);
        // Where the motion is exact it has no second derivatives.
        let motion = Odometry {
            start: 2,
            end: 1,
            delta: bundle.poses[2].inv_mul(&bundle.poses[1]),
            noise: sigmas,
        };
        let posed = PosePrior {
            view: 0,
            pose: pose(0.4, -0.1, 0.2),
            noise: sigmas,
        };
        let known = [0, 1].map(|landmark| LandmarkPrior {
            landmark,
            position: Point2::new(1.2, 0.3),
            noise: Noise::Sigmas([0.3, 0.4]),
        });
        let tied = alone.clone().with_odometry(&[motion]).unwrap();
        let tied = tied.with_pose_priors(&[posed]).unwrap();
        for problem in [alone, tied.with_landmark_priors(&known).unwrap()] {
            let (bundle, mut newton) = setting(&problem);
            let mut rows = Rows::of(&problem);
            bundle.linearize(&problem, Loss::Squared, &mut rows);
            newton.add_up(&rows);
            let size = newton.gradient.len();
            assert_eq!(size, 9 + 2 + 1);
            let both = newton.curved.iter().zip(&newton.normal);
            let curved: Vec<f64> = both.map(|(curved, normal)| curved + normal).collect();
            let step = 1e-6;
            for parameter in 0..size {
                let sides = [-step, step].map(|length| {
                    newton.delta = vec![0.0; size];
                    newton.delta[parameter] = length;
                    let mut moved = bundle.clone();
                    newton.apply(&bundle, &mut moved);
                    moved.linearize(&problem, Loss::Squared, &mut rows);
                    newton.add_up(&rows);
                    newton.gradient.clone()
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

    /// No residual changes along what is stiffened, with a landmark at infinity and one on a view.
    #[test]
    fn only_the_free_gauge_is_stiffened() {
        let bearings = [0.3, -2.0, 1.5, 2.9, 0.1, -0.4, 1.2, -0.9, 2.2];
        let alone = Problem::dense(3, 3, &bearings, 0.5).unwrap();
        let known = LandmarkPrior {
            landmark: 0,
            position: Point2::new(1.2, 0.3),
            noise: Noise::Sigmas([0.3, 0.4]),
        };
        let known = alone.clone().with_landmark_priors(&[known]).unwrap();
        for (problem, free) in [(alone, 4), (known, 2)] {
            let (bundle, mut newton) = setting(&problem);
            let mut rows = Rows::of(&problem);
            bundle.linearize(&problem, Loss::Squared, &mut rows);
            newton.add_up(&rows);
            let directions = newton.gauge(&bundle);
            assert_eq!(directions.len(), free);
            let size = newton.gradient.len();
            for direction in directions {
                let slope: f64 = direction
                    .iter()
                    .zip(&newton.gradient)
                    .map(|(d, g)| d * g)
                    .sum();
                // A landmark at infinity is far, but not that far.
                assert!(slope.abs() < 1e-4, "{slope:e}");
                for i in 0..size {
                    let row = (0..size).map(|j| newton.normal[i.max(j) * size + i.min(j)]);
                    let product: f64 = row.zip(&direction).map(|(entry, d)| entry * d).sum();
                    assert!(product.abs() < 1e-4, "{i}: {product:e}");
                }
            }
        }
    }

    /// Fixing the gauge changes nothing else: undamped, the step solves the equations without the stiffness. Damped, those
    /// with so much more on the diagonal; what the model predicts of it is its decrease.
    #[test]
    fn steps_solve_the_equations_without_the_stiffness() {
        let bearings = [0.3, -2.0, 1.5, 2.9, 0.1, -0.4, 1.2, -0.9, 2.2];
        let alone = Problem::dense(3, 3, &bearings, 0.5).unwrap();
        let known = LandmarkPrior {
            landmark: 0,
            position: Point2::new(1.2, 0.3),
            noise: Noise::Sigmas([0.3, 0.4]),
        };
        let known = alone.clone().with_landmark_priors(&[known]).unwrap();
        for problem in [alone, known] {
            let (bundle, mut newton) = setting(&problem);
            let mut rows = Rows::of(&problem);
            bundle.linearize(&problem, Loss::Squared, &mut rows);
            newton.add_up(&rows);
            let before = newton.normal.clone();
            newton.assemble(&bundle, &rows);
            let size = newton.gradient.len();
            let times = |matrix: &[f64], step: &[f64], i: usize| -> f64 {
                let row = (0..size).map(|j| matrix[i.max(j) * size + i.min(j)]);
                row.zip(step).map(|(entry, d)| entry * d).sum()
            };
            // With second derivatives as well, once the damping makes that positive definite.
            for (damping, curved) in [(0.0, false), (0.7, false), (20.0, true)] {
                let predicted = newton.solve_with(damping, curved).unwrap();
                let step = newton.delta.clone();
                let matrix = if curved {
                    &newton.curved
                } else {
                    &newton.normal
                };
                let mut decrease = 0.0;
                for i in 0..size {
                    let product = times(matrix, &step, i);
                    decrease -= step[i] * (newton.gradient[i] + 0.5 * product);
                    let damped = damping * newton.normal[i * size + i] * step[i];
                    let left = product + damped + newton.gradient[i];
                    assert!(left.abs() < 1e-9, "{i}: {left:e}");
                    if damping == 0.0 {
                        let left = times(&before, &step, i) + newton.gradient[i];
                        assert!(left.abs() < 1e-6, "{i}: {left:e}");
                    }
                }
                let gain = predicted.gain / decrease;
                assert!((gain - 1.0).abs() < 1e-6, "{damping}: {gain}");
            }
        }
    }

    /// Each direction of the gauge is as stiff as a parameter is on average; with priors, its anchor twice as stiff as it was.
    #[test]
    fn the_gauge_is_as_stiff_as_an_average_parameter() {
        let bearings = [0.3, -2.0, 1.5, 2.9, 0.1, -0.4, 1.2, -0.9, 2.2];
        let alone = Problem::dense(3, 3, &bearings, 0.5).unwrap();
        let known = LandmarkPrior {
            landmark: 0,
            position: Point2::new(1.2, 0.3),
            noise: Noise::Sigmas([0.3, 0.4]),
        };
        let known = alone.clone().with_landmark_priors(&[known]).unwrap();
        for (problem, anchored) in [(alone, None), (known, Some(2))] {
            let (bundle, mut newton) = setting(&problem);
            let mut rows = Rows::of(&problem);
            bundle.linearize(&problem, Loss::Squared, &mut rows);
            newton.add_up(&rows);
            let before = newton.normal.clone();
            let directions = newton.gauge(&bundle);
            newton.stiffen_gauge(&bundle);
            let size = newton.gradient.len();
            let added = |i: usize, j: usize| {
                let place = i.max(j) * size + i.min(j);
                newton.normal[place] - before[place]
            };
            if let Some(count) = anchored {
                let grown = (0..size).filter(|&k| added(k, k) > 0.0);
                let doubled = |k: usize| (added(k, k) / before[k * size + k] - 1.0).abs() < 1e-12;
                assert!(grown.clone().all(doubled));
                assert_eq!(grown.count(), count);
                continue;
            }
            let mean = (0..size).map(|k| before[k * size + k]).sum::<f64>() / size as f64;
            // What the four add along themselves is that much each.
            let trace: f64 = (0..size).map(|k| added(k, k)).sum();
            assert!((trace / (4.0 * mean) - 1.0).abs() < 1e-9, "{trace} {mean}");
            let unit = |direction: &[f64]| {
                let norm = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
                direction.iter().map(|d| d / norm).collect::<Vec<f64>>()
            };
            let units: Vec<_> = directions.iter().map(|direction| unit(direction)).collect();
            for i in 0..size {
                for j in 0..size {
                    let expected: f64 = units.iter().map(|unit| mean * unit[i] * unit[j]).sum();
                    assert!((added(i, j) - expected).abs() < 1e-9 * mean, "{i} {j}");
                }
            }
        }
    }
}
