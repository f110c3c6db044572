// SPDX-License-Identifier: MIT OR Apache-2.0
//! Elimination of one kind of block from the damped normal equations, (T13).
//!
//! A sighting ties one pose to one landmark, so either all poses (3x3 blocks) or all landmarks (2x2
//! blocks) can be eliminated one by one, whichever leaves the smaller system. The text is the same:
//! `E` is the size of the blocks that go, `K` that of the blocks that stay.

use super::cholesky;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{DMatrix, SVector};

/// A sighting as the elimination sees it.
#[derive(Clone, Copy)]
pub struct Slot<const E: usize, const K: usize> {
    /// Index of the block that stays.
    pub kept: usize,
    /// Derivative with respect to the block that goes.
    pub gone: [f64; E],
    /// Derivative with respect to the block that stays.
    pub stay: [f64; K],
    /// The residual.
    pub residual: f64,
}

/// The sightings grouped by the block that goes; within a group by ascending `kept`.
pub trait Grouped<const E: usize, const K: usize> {
    /// Number of blocks that go.
    fn groups(&self) -> usize;
    /// Number of sightings.
    fn sightings(&self) -> usize;
    /// Number of blocks that stay.
    fn kept(&self) -> usize;
    /// The sightings of one group.
    fn group(&self, group: usize) -> impl Iterator<Item = Slot<E, K>>;
}

/// The reduced system, and what is needed to bring back the blocks that went.
pub struct Schur<const E: usize, const K: usize> {
    /// The reduced matrix, then its Cholesky factor in the upper triangle (column by column, which is
    /// the lower triangle row by row).
    matrix: DMatrix<f64>,
    /// Minus the reduced gradient, then the step.
    step: Vec<f64>,
    /// The blocks on the diagonal of what stays, before elimination and damping.
    diagonal: Vec<[[f64; K]; K]>,
    /// Factors of the blocks that went.
    blocks: Vec<Block<E>>,
    /// The sightings of the group at work, each with `L^-1 gone`: for groups that see little.
    slots: Vec<(Slot<E, K>, [f64; E])>,
    /// Of some groups: `L^-1 gone` times `stay`, a column per parameter that stays, `E` rows per group.
    batch: DMatrix<f64>,
    /// The same transposed, which makes the product a plain one.
    transposed: DMatrix<f64>,
    /// Groups in `batch`.
    batched: usize,
}

/// A damped block that goes.
#[derive(Clone, Copy)]
struct Block<const E: usize> {
    /// Its Cholesky factor L, diagonal inverted.
    factor: [[f64; E]; E],
    /// `L^-1` times its gradient.
    residual: [f64; E],
}

impl<const E: usize> Block<E> {
    /// The block of a group; `None` when it is not finite.
    #[inline]
    fn of_group<const K: usize>(
        group: impl Iterator<Item = Slot<E, K>>,
        damping: f64,
    ) -> Option<Self> {
        let mut hessian = [[0.0; E]; E];
        let mut gradient = [0.0; E];
        for slot in group {
            for i in 0..E {
                gradient[i] += slot.gone[i] * slot.residual;
                for j in 0..=i {
                    hessian[i][j] += slot.gone[i] * slot.gone[j];
                }
            }
        }
        let mut block = Self::new(&hessian, damping)?;
        block.residual = block.forward(gradient);
        Some(block)
    }

    /// Factor of `matrix` (lower triangle) with its diagonal grown by `1 + damping`.
    ///
    /// A pivot that is rounding belongs to a direction that no sighting holds, such as the range of a
    /// landmark at infinity: it gets no step and takes nothing from the others. `None` for a matrix
    /// that is not finite.
    fn new(matrix: &[[f64; E]; E], damping: f64) -> Option<Self> {
        let mut factor = *matrix;
        for i in 0..E {
            factor[i][i] *= 1.0 + damping;
            let floor = factor[i][i] * f64::EPSILON * 4.0;
            for j in 0..i {
                for k in 0..j {
                    let product = factor[i][k] * factor[j][k];
                    factor[i][j] -= product;
                }
                factor[i][j] *= factor[j][j];
            }
            for k in 0..i {
                let square = factor[i][k] * factor[i][k];
                factor[i][i] -= square;
            }
            if !factor[i][i].is_finite() {
                return None;
            }
            factor[i][i] = if factor[i][i] > floor {
                1.0 / factor[i][i].sqrt()
            } else {
                0.0
            };
        }
        Some(Self {
            factor,
            residual: [0.0; E],
        })
    }

    /// `L^-1 x`.
    #[inline]
    fn forward(&self, mut x: [f64; E]) -> [f64; E] {
        for i in 0..E {
            for j in 0..i {
                let product = self.factor[i][j] * x[j];
                x[i] -= product;
            }
            x[i] *= self.factor[i][i];
        }
        x
    }

    /// `L^-T x`.
    #[inline]
    fn backward(&self, mut x: [f64; E]) -> [f64; E] {
        for i in (0..E).rev() {
            x[i] *= self.factor[i][i];
            for j in 0..i {
                let product = self.factor[i][j] * x[i];
                x[j] -= product;
            }
        }
        x
    }
}

#[inline]
fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + *a * *b)
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
    /// The rows of `gauge` are directions of the blocks that stay along which nothing changes; each is given the
    /// stiffness of an average parameter, which fixes it and, without damping, nothing else: the
    /// right-hand side is then at right angles to it. `false` when the system is not positive definite.
    pub fn factorize(
        &mut self,
        grouped: &impl Grouped<E, K>,
        damping: f64,
        gauge: &DMatrix<f64>,
    ) -> bool {
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
        // What is left of the old matrix: nothing, once the first product has been written over it.
        let mut factor = 0.0;
        if !dense {
            self.matrix.as_mut_slice().fill(0.0);
        }
        self.batched = 0;
        for group in 0..grouped.groups() {
            let Some(block) = Block::of_group(grouped.group(group), damping) else {
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
        let total = (0..size).fold(0.0, |sum, k| sum + self.conditional(k));
        let stiffness = total / (size as f64);
        self.matrix.gemm(stiffness, &gauge.transpose(), gauge, 1.0);
        let matrix = self.matrix.as_mut_slice();
        for (k, block) in self.diagonal.iter().enumerate() {
            for i in 0..K {
                let start = (k * K + i) * size + k * K;
                for (j, cell) in matrix[start..start + K].iter_mut().enumerate() {
                    let grown = if i == j { damping } else { 0.0 };
                    *cell += block[i][j] + block[i][j] * grown;
                }
                // What no residual touches, with a loss, stays where it is.
                if block[i][i] <= 0.0 {
                    matrix[start + i] += 1.0;
                }
            }
        }
        cholesky::factorize(self.matrix.as_mut_slice(), size)
    }

    /// Information on one parameter that stays when all others are known.
    fn conditional(&self, parameter: usize) -> f64 {
        let k = parameter % K;
        self.diagonal[parameter / K][k][k]
    }

    /// What a sighting tells about its block that stays, apart from the coupling with others.
    #[inline]
    fn add(&mut self, slot: &Slot<E, K>, block: &Block<E>, whitened: &[f64; E]) {
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

    /// Takes a group out and puts its coupling into the batch; `clear` when groups may leave gaps.
    fn collect(&mut self, block: &Block<E>, group: impl Iterator<Item = Slot<E, K>>, clear: bool) {
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

    /// Subtracts the coupling of the groups in the batch from `factor` times the matrix: one product.
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

    /// Takes a group out block by block: for groups that see little.
    fn scatter(&mut self, block: &Block<E>, group: impl Iterator<Item = Slot<E, K>>) {
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

    /// Solves for the step of the blocks that stay and, group by group, of those that went.
    ///
    /// Returns half the sum of squared residuals that the linear model predicts after the step.
    pub fn solve(
        &mut self,
        grouped: &impl Grouped<E, K>,
        kept: &mut Vec<SVector<f64, K>>,
        gone: &mut Vec<SVector<f64, E>>,
    ) -> f64 {
        cholesky::solve(self.matrix.as_slice(), &mut self.step);
        kept.clear();
        kept.extend(
            self.step
                .chunks_exact(K)
                .map(SVector::<f64, K>::from_column_slice),
        );
        gone.clear();
        let mut model = 0.0;
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
                model += residual * residual;
            }
            gone.push(SVector::from(step));
        }
        model * 0.5
    }

    /// The residual after the step of the blocks that stay.
    #[inline]
    fn after_step(&self, slot: &Slot<E, K>) -> f64 {
        let step = &self.step[slot.kept * K..slot.kept * K + K];
        (0..K).fold(slot.residual, |sum, i| sum + slot.stay[i] * step[i])
    }

    /// The largest variance of the first two parameters together of a block that went, with those that
    /// stay held fixed, for residuals of unit variance; infinite when one is free.
    pub fn loosest_block(&self) -> f64 {
        let mut worst = 0.0;
        for block in &self.blocks {
            let mut variance = 0.0;
            for i in 0..E.min(2) {
                let mut unit = [0.0; E];
                unit[i] = 1.0;
                let column = block.forward(unit);
                variance += dot(&column, &column);
            }
            // A pivot of zero in the factor is a free direction, not a known one.
            let free = (0..E).any(|i| block.factor[i][i] <= 0.0);
            if free || variance > worst {
                worst = if free { 1.0 / 0.0 } else { variance };
            }
        }
        worst
    }

    /// The direction of the blocks that stay in which the data hold them least, as a displacement one
    /// standard deviation long when residuals have unit variance.
    ///
    /// (T16): inverse iteration on the reduced matrix with its parameters in units of their conditional
    /// standard deviations; needs [`Schur::factorize`] without damping.
    pub fn weakest_direction(&self) -> Vec<f64> {
        let size = self.step.len();
        let units: Vec<f64> = (0..size).map(|k| self.conditional(k).sqrt()).collect();
        let mut vector: Vec<f64> = (0..size)
            .map(|k| 1.0 + 0.1 * ((7 * k + 3) % 11) as f64)
            .collect();
        let mut gain = 1.0;
        for _ in 0..WEAKEST_STEPS {
            let norm = vector.iter().fold(0.0, |s, v| s + *v * *v).sqrt();
            let mut next = vec![0.0; size];
            for k in 0..size {
                vector[k] /= norm;
                next[k] = vector[k] * units[k];
            }
            cholesky::solve(self.matrix.as_slice(), &mut next);
            gain = 0.0;
            for k in 0..size {
                next[k] *= units[k];
                gain += next[k] * vector[k];
            }
            vector = next;
        }
        let norm = vector.iter().fold(0.0, |s, v| s + *v * *v).sqrt();
        let length = gain.max(0.0).sqrt() / norm;
        for (v, unit) in vector.iter_mut().zip(&units) {
            *v *= length / *unit;
        }
        vector
    }
}

/// Steps of inverse iteration in [`Schur::weakest_direction`]; the size is wanted to a few percent.
const WEAKEST_STEPS: usize = 6;

/// The coupling is formed by a matrix product when at least one in this many of all pairs of blocks
/// meets in a sighting, and block by block otherwise.
const DENSE_FILL: usize = 8;

/// Groups that one matrix product takes.
const BATCH: usize = 64;
