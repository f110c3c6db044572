// SPDX-License-Identifier: MIT OR Apache-2.0
//! Schur complement: elimination of poses or landmarks from the damped normal equations, (T13).
//!
//! A sighting connects one pose with one landmark, so either all poses (3x3 blocks) or all landmarks (2x2
//! blocks) can be eliminated one by one, whichever leaves the smaller system. The code is the same for
//! both: `E` is the size of the eliminated blocks, `K` that of the kept blocks.

use super::block::{EliminatedBlock, dot};
use super::cholesky;
use crate::lm::Prediction;
use alloc::vec::Vec;
use nalgebra::{DMatrix, SVector};

/// The coupling is formed by a matrix product when at least one in this many of all pairs of blocks shares a
/// sighting, and block by block otherwise. It affects time only.
const DENSE_FILL: usize = 8;

/// Groups in one matrix product: enough for the product to be fast, few enough for the two factors to stay in the
/// cache.
const BATCH: usize = 64;

/// A sighting in the form needed by the elimination.
#[derive(Clone, Copy)]
pub struct Slot<const E: usize, const K: usize> {
    /// Index of the kept block.
    pub kept: usize,
    /// Derivative with respect to the eliminated block.
    pub gone: [f64; E],
    /// Derivative with respect to the kept block.
    pub stay: [f64; K],
    /// The residual.
    pub residual: f64,
}

/// The sightings grouped by eliminated block; within a group by ascending `kept`.
pub trait Grouped<const E: usize, const K: usize> {
    /// Number of eliminated blocks.
    fn groups(&self) -> usize;
    /// Number of sightings.
    fn sightings(&self) -> usize;
    /// Number of kept blocks.
    fn kept(&self) -> usize;
    /// The sightings of one group.
    fn group(&self, group: usize) -> impl Iterator<Item = Slot<E, K>>;
}

/// The reduced system, and what is needed for the back-substitution of the eliminated blocks.
pub struct Schur<const E: usize, const K: usize> {
    /// The reduced matrix, then its Cholesky factor in the upper triangle (column by column, which is
    /// the lower triangle row by row).
    matrix: DMatrix<f64>,
    /// Minus the reduced gradient, then the step.
    step: Vec<f64>,
    /// The diagonal blocks of the kept part, before elimination and damping.
    diagonal: Vec<[[f64; K]; K]>,
    /// Factors of the eliminated blocks.
    blocks: Vec<EliminatedBlock<E>>,
    /// The sightings of the current group, each with `L^-1 gone`; for groups with few sightings.
    slots: Vec<(Slot<E, K>, [f64; E])>,
    /// For some groups, `L^-1 gone` times `stay`: a column per kept parameter, `E` rows per group.
    batch: DMatrix<f64>,
    /// The same transposed, so that the product needs no transposition.
    transposed: DMatrix<f64>,
    /// Number of groups in `batch`.
    batched: usize,
}

impl<const E: usize, const K: usize> Schur<E, K> {
    pub fn new() -> Self {
        Self {
            matrix: DMatrix::zeros(0, 0),
            step: Vec::new(),
            diagonal: Vec::new(),
            blocks: Vec::new(),
            slots: Vec::new(),
            batch: DMatrix::zeros(0, 0),
            transposed: DMatrix::zeros(0, 0),
            batched: 0,
        }
    }

    /// Forms and factorises the reduced system.
    ///
    /// The rows of `gauge` are directions of the kept blocks along which no residual changes; each is given the
    /// stiffness of an average parameter. The right-hand side is orthogonal to them, so this fixes the gauge and,
    /// without damping, changes nothing else. `false` when the system is not positive definite.
    pub fn factorize(
        &mut self,
        grouped: &impl Grouped<E, K>,
        damping: f64,
        gauge: &DMatrix<f64>,
    ) -> bool {
        if !self.eliminate(grouped, damping) {
            return false;
        }
        let size = self.size();
        let total = (0..size).fold(0.0, |sum, k| sum + self.information(k));
        let stiffness = total / (size as f64);
        self.matrix.gemm(stiffness, &gauge.transpose(), gauge, 1.0);
        self.add_diagonal(damping);
        cholesky::factorize(self.matrix.as_mut_slice(), size)
    }

    /// Eliminates the groups: subtracts their coupling from the matrix, and forms the reduced gradient and the
    /// diagonal blocks, which are not yet added to the matrix. `false` when a block is not finite.
    fn eliminate(&mut self, grouped: &impl Grouped<E, K>, damping: f64) -> bool {
        let size = grouped.kept() * K;
        if self.matrix.nrows() != size {
            self.matrix = DMatrix::zeros(size, size);
        }
        self.step.clear();
        self.step.resize(size, 0.0);
        self.diagonal.clear();
        self.diagonal.resize(grouped.kept(), [[0.0; K]; K]);
        self.blocks.clear();
        let dense = grouped.sightings() * DENSE_FILL >= grouped.groups() * grouped.kept();
        let height = grouped.groups().min(BATCH) * E;
        if dense && self.batch.shape() != (height, size) {
            self.batch = DMatrix::zeros(height, size);
            self.transposed = DMatrix::zeros(size, height);
        }
        let complete = grouped.sightings() == grouped.groups() * grouped.kept();
        // Factor of the old matrix: the first product overwrites it.
        let mut factor = 0.0;
        if !dense {
            self.matrix.as_mut_slice().fill(0.0);
        }
        self.batched = 0;
        for group in 0..grouped.groups() {
            let rows = grouped.group(group).map(|slot| (slot.gone, slot.residual));
            let Some(block) = EliminatedBlock::of_rows(rows, damping) else {
                return false;
            };
            if dense {
                self.collect(&block, grouped.group(group), !complete);
                if self.batched == BATCH {
                    self.subtract_batch(&mut factor);
                }
            } else {
                self.scatter(&block, grouped.group(group));
            }
            self.blocks.push(block);
        }
        if self.batched > 0 {
            self.subtract_batch(&mut factor);
        }
        true
    }

    /// Adds the blocks on the diagonal, damped, to the matrix.
    fn add_diagonal(&mut self, damping: f64) {
        let size = self.size();
        let matrix = self.matrix.as_mut_slice();
        for (k, block) in self.diagonal.iter().enumerate() {
            for i in 0..K {
                let start = (k * K + i) * size + k * K;
                for (j, cell) in matrix[start..start + K].iter_mut().enumerate() {
                    let grown = if i == j { damping } else { 0.0 };
                    *cell += block[i][j] + block[i][j] * grown;
                }
                // A parameter on which no residual depends, for example because of the loss, gets no step.
                if block[i][i] <= 0.0 {
                    matrix[start + i] += 1.0;
                }
            }
        }
    }

    /// Number of kept parameters.
    pub fn size(&self) -> usize {
        self.step.len()
    }

    /// Conditional information of a kept parameter, with all others known.
    pub fn information(&self, parameter: usize) -> f64 {
        let k = parameter % K;
        self.diagonal[parameter / K][k][k]
    }

    /// The eliminated blocks, factorised.
    pub fn blocks(&self) -> &[EliminatedBlock<E>] {
        &self.blocks
    }

    /// Solves the reduced system for another right-hand side, in place.
    pub fn solve_reduced(&self, side: &mut [f64]) {
        cholesky::solve(self.matrix.as_slice(), side);
    }

    /// Adds a sighting to the reduced gradient and to the diagonal block of its kept block, without the coupling.
    #[inline]
    fn add(&mut self, slot: &Slot<E, K>, block: &EliminatedBlock<E>, whitened: &[f64; E]) {
        let left = slot.residual - dot(whitened, &block.residual);
        let step = &mut self.step[slot.kept * K..slot.kept * K + K];
        let diagonal = &mut self.diagonal[slot.kept];
        for i in 0..K {
            step[i] -= slot.stay[i] * left;
            for j in 0..K {
                diagonal[i][j] += slot.stay[i] * slot.stay[j];
            }
        }
    }

    /// Eliminates a group and stores its coupling in the batch; `clear` when groups may leave gaps.
    fn collect(
        &mut self,
        block: &EliminatedBlock<E>,
        group: impl Iterator<Item = Slot<E, K>>,
        clear: bool,
    ) {
        if clear && self.batched == 0 {
            self.batch.as_mut_slice().fill(0.0);
            self.transposed.as_mut_slice().fill(0.0);
        }
        let (size, height) = self.transposed.shape();
        let row = self.batched * E;
        for slot in group {
            let whitened = block.forward(slot.gone);
            self.add(&slot, block, &whitened);
            let parameter = slot.kept * K;
            let products = slot.stay.map(|k| whitened.map(|z| k * z));
            for (i, products) in products.iter().enumerate() {
                let place = (parameter + i) * height + row;
                self.batch.as_mut_slice()[place..place + E].copy_from_slice(products);
            }
            for e in 0..E {
                let place = (row + e) * size + parameter;
                self.transposed.as_mut_slice()[place..place + K]
                    .copy_from_slice(&products.map(|products| products[e]));
            }
        }
        self.batched += 1;
    }

    /// Subtracts the coupling of the groups in the batch from `factor` times the matrix, by one product.
    fn subtract_batch(&mut self, factor: &mut f64) {
        let rows = self.batched * E;
        self.matrix.gemm(
            -1.0,
            &self.transposed.columns(0, rows),
            &self.batch.rows(0, rows),
            *factor,
        );
        *factor = 1.0;
        self.batched = 0;
    }

    /// Eliminates a group block by block; for groups with few sightings.
    fn scatter(&mut self, block: &EliminatedBlock<E>, group: impl Iterator<Item = Slot<E, K>>) {
        self.slots.clear();
        for slot in group {
            let whitened = block.forward(slot.gone);
            self.add(&slot, block, &whitened);
            self.slots.push((slot, whitened));
        }
        for (a, (this, z)) in self.slots.iter().enumerate() {
            for (other, y) in &self.slots[..=a] {
                let product = dot(z, y);
                for i in 0..K {
                    for j in 0..K {
                        self.matrix[(other.kept * K + j, this.kept * K + i)] -=
                            product * this.stay[i] * other.stay[j];
                    }
                }
            }
        }
    }

    /// Solves for the step of the kept blocks and, group by group, of the eliminated ones.
    ///
    /// Returns what the linear model predicts of the step.
    pub fn solve(
        &mut self,
        grouped: &impl Grouped<E, K>,
        kept: &mut Vec<SVector<f64, K>>,
        gone: &mut Vec<SVector<f64, E>>,
    ) -> Prediction<f64> {
        cholesky::solve(self.matrix.as_slice(), &mut self.step);
        kept.clear();
        kept.extend(
            self.step
                .chunks_exact(K)
                .map(SVector::<f64, K>::from_column_slice),
        );
        gone.clear();
        let (mut left, mut curvature) = (0.0, 0.0);
        for group in 0..grouped.groups() {
            let mut gradient = [0.0; E];
            for slot in grouped.group(group) {
                let residual = self.after_step(&slot);
                for i in 0..E {
                    gradient[i] -= slot.gone[i] * residual;
                }
            }
            let block = &self.blocks[group];
            let step = block.backward(block.forward(gradient));
            for slot in grouped.group(group) {
                let residual = self.after_step(&slot) + dot(&slot.gone, &step);
                let decrease = slot.residual - residual;
                left += decrease * residual;
                curvature += decrease * decrease;
            }
            gone.push(SVector::from(step));
        }
        Prediction::new(left, curvature)
    }

    /// The residual after the step of the kept blocks.
    #[inline]
    fn after_step(&self, slot: &Slot<E, K>) -> f64 {
        let step = &self.step[slot.kept * K..slot.kept * K + K];
        (0..K).fold(slot.residual, |sum, i| sum + slot.stay[i] * step[i])
    }
}
