// SPDX-License-Identifier: MIT OR Apache-2.0
//! The sparse normal equations of bearings, odometry and priors.
//!
//! Parameters are numbered views first (x, y, heading), then landmarks (x, y). The gauge is fixed by anchors: as many
//! single parameters as it has directions, each given more weight. The gradient is orthogonal to the gauge, so anchors
//! choose the step along it and change nothing else; and unlike constraints they keep the matrix sparse.

use super::bundle::{Bundle, Rows};
use super::gauge::{anchors, gauge_directions};
use super::prior_rows::PriorRow;
use super::sparse::SparseCholesky;
use super::step_solver::StepSolver;
use crate::lm::{BearingRow, Prediction};
use crate::problem::{Prior, Problem, Subject};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector2, Vector3};

/// A block column: all parameters of one subject.
#[derive(Clone, Copy)]
struct Column {
    /// Index of its first parameter, and number of its parameters.
    parameter: usize,
    width: usize,
    /// Start of its values, and number of values in each of its columns.
    start: usize,
    height: usize,
}

/// The matrix `J^T J` and the gradient `J^T r`.
pub struct Normal<'a> {
    problem: &'a Problem,
    /// Those of views, then of landmarks.
    columns: Vec<Column>,
    /// For each sighting, the number of entries in its view's column before the block of its landmark.
    sighting_row: Vec<usize>,
    /// The same for each motion and the block of its later view; 0 for a prior.
    tie_row: Vec<usize>,
    /// The lower triangle of the matrix.
    values: Vec<f64>,
    gradient: Vec<f64>,
    /// The values with damping and anchors, as they are factorised.
    held: Vec<f64>,
    /// Parameters that fix the gauge.
    anchors: Vec<usize>,
    cholesky: SparseCholesky,
    delta: Vec<f64>,
    /// Whether a landmark has a prior.
    known: Vec<bool>,
}

impl<'a> Normal<'a> {
    /// Analyses the pattern of a problem; `None` when there is not enough memory.
    pub fn new(problem: &'a Problem) -> Option<Self> {
        let (views, landmarks) = (problem.views(), problem.landmarks());
        // For each view, the later views that a motion connects with it.
        let mut partners = vec![Vec::new(); views];
        for prior in problem.priors() {
            if let Prior::Motion { start, end, .. } = *prior {
                partners[start.min(end)].push(start.max(end));
            }
        }
        let mut columns = Vec::with_capacity(views + landmarks);
        let (mut starts, mut rows) = (vec![0], Vec::new());
        let mut sighting_row = Vec::with_capacity(problem.sightings().len());
        for (view, partners) in partners.iter_mut().enumerate() {
            partners.sort_unstable();
            partners.dedup();
            let seen = problem.of_view(view);
            let height = 3 + 3 * partners.len() + 2 * seen.len();
            columns.push(Column {
                parameter: 3 * view,
                width: 3,
                start: rows.len(),
                height,
            });
            for _ in 0..3 {
                rows.extend(3 * view..3 * view + 3);
                rows.extend(partners.iter().flat_map(|&other| 3 * other..3 * other + 3));
                rows.extend(seen.iter().flat_map(|s| {
                    let place = 3 * views + 2 * s.landmark;
                    place..place + 2
                }));
                starts.push(rows.len());
            }
            sighting_row.extend((0..seen.len()).map(|k| 3 + 3 * partners.len() + 2 * k));
        }
        for landmark in 0..landmarks {
            let parameter = 3 * views + 2 * landmark;
            columns.push(Column {
                parameter,
                width: 2,
                start: rows.len(),
                height: 2,
            });
            for _ in 0..2 {
                rows.extend(parameter..parameter + 2);
                starts.push(rows.len());
            }
        }
        let tie_row = problem.priors().iter().map(|prior| match *prior {
            Prior::Motion { start, end, .. } => {
                let place = partners[start.min(end)].binary_search(&start.max(end));
                3 + 3 * place.unwrap_or(0)
            }
            _ => 0,
        });
        let size = 3 * views + 2 * landmarks;
        let widths: Vec<usize> = columns.iter().map(|column| column.width).collect();
        Some(Self {
            problem,
            sighting_row,
            tie_row: tie_row.collect(),
            columns,
            values: vec![0.0; rows.len()],
            gradient: vec![0.0; size],
            held: Vec::new(),
            anchors: Vec::new(),
            cholesky: SparseCholesky::analyse(&widths, starts, rows)?,
            delta: Vec::new(),
            known: problem.known_landmarks(),
        })
    }

    /// Number of parameters.
    pub fn size(&self) -> usize {
        self.gradient.len()
    }

    fn column(&self, subject: Subject) -> Column {
        match subject {
            Subject::View(view) => self.columns[view],
            Subject::Landmark(landmark) => self.columns[self.problem.views() + landmark],
        }
    }

    /// Forms matrix and gradient, and chooses anchors for the directions of the gauge (`free`).
    pub fn assemble(&mut self, rows: &Rows, free: &[Vec<f64>]) {
        self.values.fill(0.0);
        self.gradient.fill(0.0);
        for (k, (s, row)) in self
            .problem
            .sightings()
            .iter()
            .zip(&rows.sightings)
            .enumerate()
        {
            self.add_sighting(k, s.view, s.landmark, row);
        }
        for (k, row) in rows.priors.iter().enumerate() {
            self.add_tie(k, row);
        }
        self.anchors = anchors(free, |parameter| self.diagonal(parameter));
    }

    fn add_sighting(&mut self, k: usize, view: usize, landmark: usize, row: &BearingRow) {
        let pose = row.pose();
        let point = row.landmark();
        let residual = row.residual;
        let column = self.columns[view];
        for c in 0..3 {
            let values = &mut self.values[column.start + c * column.height..][..column.height];
            for r in c..3 {
                values[r] += pose[c] * pose[r];
            }
            let down = self.sighting_row[k];
            values[down] = pose[c] * point[0];
            values[down + 1] = pose[c] * point[1];
            self.gradient[column.parameter + c] += pose[c] * residual;
        }
        let column = self.columns[self.problem.views() + landmark];
        for c in 0..2 {
            for r in c..2 {
                self.values[column.start + 2 * c + r] += point[c] * point[r];
            }
            self.gradient[column.parameter + c] += point[c] * residual;
        }
    }

    fn add_tie(&mut self, k: usize, row: &PriorRow) {
        let residual = row.residual;
        let ends = [Some(row.first), row.second];
        for (subject, jacobian) in ends.iter().flatten() {
            let column = self.column(*subject);
            for c in 0..column.width {
                for r in c..column.width {
                    let product: f64 = (0..3).map(|i| jacobian[i][c] * jacobian[i][r]).sum();
                    self.values[column.start + c * column.height + r] += product;
                }
                let slope: f64 = (0..3).map(|i| jacobian[i][c] * residual[i]).sum();
                self.gradient[column.parameter + c] += slope;
            }
        }
        if let [Some(first), Some(second)] = ends {
            let (early, late) = if self.column(first.0).parameter < self.column(second.0).parameter
            {
                (first, second)
            } else {
                (second, first)
            };
            let column = self.column(early.0);
            for c in 0..3 {
                for r in 0..3 {
                    let product = (0..3).fold(0.0, |sum, i| sum + early.1[i][c] * late.1[i][r]);
                    let place = column.start + c * column.height + self.tie_row[k] + r;
                    self.values[place] += product;
                }
            }
        }
    }

    /// Index of a parameter's diagonal entry.
    fn place(&self, parameter: usize) -> usize {
        let views = self.problem.views();
        let (subject, c) = if parameter < 3 * views {
            (parameter / 3, parameter % 3)
        } else {
            let parameter = parameter - 3 * views;
            (views + parameter / 2, parameter % 2)
        };
        let column = &self.columns[subject];
        column.start + c * column.height + c
    }

    /// Conditional information of a parameter, with all others known.
    pub fn diagonal(&self, parameter: usize) -> f64 {
        self.values[self.place(parameter)]
    }

    /// Factorises with the diagonal multiplied by `1 + damping`, and the anchors; `false` when the matrix is not
    /// positive definite.
    pub fn factorize(&mut self, damping: f64) -> bool {
        self.held.clone_from(&self.values);
        for parameter in 0..self.size() {
            let place = self.place(parameter);
            let value = self.values[place];
            // A parameter on which no residual depends, for example because of the loss, gets no step.
            self.held[place] = if value > 0.0 {
                value * (1.0 + damping)
            } else {
                1.0
            };
        }
        for &parameter in &self.anchors {
            let place = self.place(parameter);
            self.held[place] += self.values[place].max(f64::MIN_POSITIVE);
        }
        self.cholesky.factorize(&self.held)
    }

    /// The block of a view on the diagonal of the matrix as it is factorised.
    pub fn pose_block(&self, view: usize) -> Matrix3<f64> {
        let column = self.columns[view];
        Matrix3::from_fn(|i, j| self.entry(column, i.min(j), i.max(j)))
    }

    /// The block of a landmark on the diagonal of the matrix as it is factorised.
    pub fn landmark_block(&self, landmark: usize) -> Matrix2<f64> {
        let column = self.columns[self.problem.views() + landmark];
        Matrix2::from_fn(|i, j| self.entry(column, i.min(j), i.max(j)))
    }

    /// The block between view and landmark of a sighting.
    pub fn coupling(&self, sighting: usize) -> Matrix3x2<f64> {
        let column = self.columns[self.problem.sightings()[sighting].view];
        let below = self.sighting_row[sighting];
        Matrix3x2::from_fn(|i, j| self.entry(column, i, below + j))
    }

    /// An entry of the lower triangle as it is factorised, by its place in a column of blocks.
    fn entry(&self, column: Column, across: usize, down: usize) -> f64 {
        self.held[column.start + across * column.height + down]
    }

    /// Solves with the last factor, in place, for sides that lie one after the other.
    pub fn solve(&self, sides: &mut [f64]) {
        self.cholesky.solve(sides);
    }
}

impl StepSolver for Normal<'_> {
    fn solve(
        &mut self,
        bundle: &Bundle,
        rows: &Rows,
        damping: f64,
        result: &mut Bundle,
    ) -> Option<Prediction<f64>> {
        self.assemble(rows, &gauge_directions(self.problem, bundle));
        if !self.factorize(damping) {
            return None;
        }
        let mut delta = core::mem::take(&mut self.delta);
        delta.clear();
        delta.extend(self.gradient.iter().map(|slope| -slope));
        Self::solve(self, &mut delta);
        let (mut left, mut slope) = (0.0, 0.0);
        for (parameter, (&d, &gradient)) in delta.iter().zip(&self.gradient).enumerate() {
            left += d * damping * self.diagonal(parameter) * d;
            slope -= d * gradient;
        }
        for &parameter in &self.anchors {
            left += delta[parameter] * delta[parameter] * self.diagonal(parameter);
        }
        let (poses, landmarks) = delta.split_at(3 * bundle.poses.len());
        let poses: Vec<_> = poses
            .chunks_exact(3)
            .map(|step| Vector3::new(step[0], step[1], step[2]))
            .collect();
        let landmarks: Vec<_> = landmarks
            .chunks_exact(2)
            .map(|step| Vector2::new(step[0], step[1]))
            .collect();
        bundle.step(&poses, &landmarks, result);
        self.delta = delta;
        let predicted = Prediction::new(left, slope - left);
        predicted.gain.is_finite().then_some(predicted)
    }

    fn moves_landmark(&self, landmark: usize) -> bool {
        !self.known[landmark]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::lm::Loss;
    use crate::problem::{LandmarkPrior, Noise, Odometry, PosePrior};
    use crate::simulate::{Arena, Layout, simulate};
    use nalgebra::{DMatrix, DVector};

    /// Four views and five landmarks with odometry in both directions, twice between the same views, and priors.
    fn setting() -> (Problem, Bundle) {
        let scene = simulate(Layout::Enclosed, 4, 5, 0.05, 2, Arena::default()).unwrap();
        let mut bearings = scene.bearings.clone();
        bearings[7] = f64::NAN;
        let problem = Problem::dense(4, 5, &bearings, 0.05).unwrap();
        let motion = |start: usize, end: usize| Odometry {
            start,
            end,
            delta: scene.poses[start].inv_mul(&scene.poses[end]) * pose(0.1, -0.2, 0.05),
            noise: Noise::Covariance([[0.04, 0.01, 0.0], [0.01, 0.09, 0.002], [0.0, 0.002, 0.01]]),
        };
        let motions = [motion(0, 1), motion(3, 1), motion(0, 3), motion(1, 0)];
        let posed = PosePrior {
            view: 2,
            pose: scene.poses[2] * pose(0.3, 0.1, 0.1),
            noise: Noise::Sigmas([0.1, f64::INFINITY, 0.2]),
        };
        let known = LandmarkPrior {
            landmark: 3,
            position: scene.landmarks[3] + Vector2::new(0.1, 0.2),
            noise: Noise::Covariance([[0.02, 0.01], [0.01, 0.03]]),
        };
        let problem = problem.with_odometry(&motions).unwrap();
        let problem = problem.with_pose_priors(&[posed]).unwrap();
        let problem = problem.with_landmark_priors(&[known]).unwrap();
        (problem, Bundle::from_map(&scene.map()))
    }

    /// The Jacobian and the residuals as a whole.
    fn jacobian(problem: &Problem, rows: &Rows) -> (DMatrix<f64>, DVector<f64>) {
        let views = 3 * problem.views();
        let count = rows.sightings.len() + 3 * rows.priors.len();
        let mut jacobian = DMatrix::zeros(count, views + 2 * problem.landmarks());
        let mut residuals = DVector::zeros(count);
        for (k, (s, row)) in problem.sightings().iter().zip(&rows.sightings).enumerate() {
            residuals[k] = row.residual;
            for (i, entry) in row.pose().into_iter().enumerate() {
                jacobian[(k, 3 * s.view + i)] = entry;
            }
            for (i, entry) in row.landmark().into_iter().enumerate() {
                jacobian[(k, views + 2 * s.landmark + i)] = entry;
            }
        }
        for (k, row) in rows.priors.iter().enumerate() {
            let first = rows.sightings.len() + 3 * k;
            for i in 0..3 {
                residuals[first + i] = row.residual[i];
                for (subject, slopes) in [Some(row.first), row.second].into_iter().flatten() {
                    let (place, width) = match subject {
                        Subject::View(view) => (3 * view, 3),
                        Subject::Landmark(landmark) => (views + 2 * landmark, 2),
                    };
                    for (c, slope) in slopes[i].iter().take(width).enumerate() {
                        jacobian[(first + i, place + c)] += slope;
                    }
                }
            }
        }
        (jacobian, residuals)
    }

    /// The sparse equations are those of the Jacobian as a whole, with damping and with anchors where the gauge is free, and
    /// what the model predicts of a step is the decrease of the linear cost.
    #[test]
    fn sparse_equations_are_those_of_the_jacobian() {
        let (tied, bundle) = setting();
        let alone = tied.clone().bearings_only();
        for (problem, free) in [(&tied, 0), (&alone, 4)] {
            let mut rows = Rows::of(problem);
            bundle.linearize(problem, Loss::Squared, &mut rows);
            let (jacobian, residuals) = jacobian(problem, &rows);
            let information = jacobian.tr_mul(&jacobian);
            let gradient = jacobian.tr_mul(&residuals);
            let mut normal = Normal::new(problem).unwrap();
            for damping in [0.0, 0.3, 20.0] {
                let mut moved = bundle.clone();
                let step = StepSolver::solve(&mut normal, &bundle, &rows, damping, &mut moved);
                let gain = step.unwrap().gain;
                let delta = DVector::from_vec(normal.delta.clone());
                assert_eq!(normal.anchors.len(), free);
                let mut left = &information * &delta + &gradient;
                for k in 0..delta.len() {
                    let anchors = normal.anchors.iter().filter(|&&anchor| anchor == k).count();
                    assert!((normal.diagonal(k) / information[(k, k)] - 1.0).abs() < 1e-12);
                    left[k] += (damping + anchors as f64) * information[(k, k)] * delta[k];
                }
                assert!(left.amax() < 1e-7 * gradient.amax(), "{damping}: {left}");
                let after = &residuals + &jacobian * &delta;
                let expected = 0.5 * (residuals.norm_squared() - after.norm_squared());
                assert!(
                    (gain / expected - 1.0).abs() < 1e-6,
                    "{damping}: {gain} {expected}"
                );
                let turned = bundle.poses[1].rotation.angle_to(&moved.poses[1].rotation);
                let around = (turned - delta[5]) / core::f64::consts::TAU;
                assert!((around - around.round()).abs() < 1e-2);
                let [there, here] = [&moved, &bundle].map(|b| b.poses[2].translation.vector);
                let shift = there - here;
                assert!((shift.x - delta[6]).abs() < 1e-9 && (shift.y - delta[7]).abs() < 1e-9);
                let shift = moved.landmarks[4] - bundle.landmarks[4];
                assert!((shift.x - delta[20]).abs() < 1e-9 && (shift.y - delta[21]).abs() < 1e-9);
            }
            for view in 0..4 {
                let expected = information.fixed_view::<3, 3>(3 * view, 3 * view);
                assert!(normal.factorize(0.0));
                let anchored = normal.anchors.iter().any(|anchor| anchor / 3 == view);
                assert!(
                    anchored
                        || (normal.pose_block(view) - expected).norm() < 1e-9 * expected.norm()
                );
            }
        }
        let known = (0..5).filter(|&k| !Normal::new(&tied).unwrap().moves_landmark(k));
        assert!(known.eq([3]));
    }

    /// A parameter on which nothing depends gets no step.
    #[test]
    fn what_nothing_depends_on_stays() {
        let (tied, bundle) = setting();
        let unseen: Vec<bool> = tied.sightings().iter().map(|s| s.landmark != 1).collect();
        let problem = tied.subset(&unseen);
        let mut rows = Rows::of(&problem);
        bundle.linearize(&problem, Loss::Squared, &mut rows);
        let mut normal = Normal::new(&problem).unwrap();
        let mut moved = bundle.clone();
        assert!(StepSolver::solve(&mut normal, &bundle, &rows, 0.1, &mut moved).is_some());
        assert_eq!(moved.landmarks[1], bundle.landmarks[1]);
        assert_ne!(moved.landmarks[2], bundle.landmarks[2]);
    }
}
