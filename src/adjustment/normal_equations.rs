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
