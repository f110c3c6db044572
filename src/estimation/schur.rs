// SPDX-License-Identifier: MIT OR Apache-2.0
//! Elimination of one kind of block from the damped normal equations.
//!
//! A sighting ties one pose to one landmark, so either all poses (3x3 blocks) or all landmarks (2x2
//! blocks) can be eliminated one by one, whichever leaves the smaller system. The text is the same:
//! `E` is the size of the blocks that go, `K` that of the blocks that stay.

use super::cholesky;
use crate::scalar::Real;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::SVector;

/// A sighting as the elimination sees it.
#[derive(Clone, Copy)]
pub struct Slot<T: Real, const E: usize, const K: usize> {
    /// Index of the block that stays.
    pub kept: usize,
    /// Derivative with respect to the block that goes.
    pub gone: [T; E],
    /// Derivative with respect to the block that stays.
    pub stay: [T; K],
    /// The residual.
    pub residual: T,
}

/// The sightings grouped by the block that goes; within a group by ascending `kept`.
pub trait Grouped<T: Real, const E: usize, const K: usize> {
    /// Number of blocks that go.
    fn groups(&self) -> usize;
    /// Number of blocks that stay.
    fn kept(&self) -> usize;
    /// The sightings of one group.
    fn group(&self, group: usize) -> impl Iterator<Item = Slot<T, E, K>>;
}

/// The reduced system, and what is needed to bring back the blocks that went.
pub struct Schur<T: Real, const E: usize, const K: usize> {
    /// Row-major, lower triangle: the reduced matrix, then its Cholesky factor.
    matrix: Vec<T>,
    /// Minus the reduced gradient, then the step.
    step: Vec<T>,
    /// Diagonal of the blocks that stay, before elimination and damping.
    diagonal: Vec<T>,
    /// Factors of the blocks that went.
    blocks: Vec<Block<T, E>>,
    /// Of the group at work: `L^-1 gone` times `stay`, one row per row of the block.
    products: [Vec<T>; E],
    slots: Vec<(Slot<T, E, K>, [T; E])>,
}

/// Cholesky factor of a damped block, diagonal inverted.
#[derive(Clone, Copy)]
struct Block<T: Real, const E: usize> {
    factor: [[T; E]; E],
}

impl<T: Real, const E: usize> Block<T, E> {
    /// Factor of `matrix` (lower triangle) with its diagonal grown by `1 + damping`.
    fn new(matrix: &[[T; E]; E], damping: T) -> Option<Self> {
        let mut factor = *matrix;
        for i in 0..E {
            factor[i][i] *= T::one() + damping;
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
            if !(factor[i][i] > T::zero()) {
                return None;
            }
            factor[i][i] = T::one() / factor[i][i].sqrt();
        }
        Some(Self { factor })
    }

    /// `L^-1 x`.
    #[inline]
    fn forward(&self, mut x: [T; E]) -> [T; E] {
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
    fn backward(&self, mut x: [T; E]) -> [T; E] {
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
fn dot<T: Real, const N: usize>(a: &[T; N], b: &[T; N]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (a, b)| sum + *a * *b)
}

impl<T: Real, const E: usize, const K: usize> Schur<T, E, K> {
    pub fn new() -> Self {
        Self {
            matrix: Vec::new(),
            step: Vec::new(),
            diagonal: Vec::new(),
            blocks: Vec::new(),
            products: core::array::from_fn(|_| Vec::new()),
            slots: Vec::new(),
        }
    }

    /// Forms and factorises the reduced system.
    ///
    /// `gauge` are directions of the blocks that stay along which nothing changes; each is given the
    /// stiffness of an average parameter, which fixes it and nothing else: the right-hand side is at
    /// right angles to it. `false` when the system is not positive definite.
    pub fn factorize(
        &mut self,
        grouped: &impl Grouped<T, E, K>,
        damping: T,
        gauge: &[Vec<T>],
    ) -> bool {
        let size = grouped.kept() * K;
        self.matrix.clear();
        self.matrix.resize(size * size, T::zero());
        self.step.clear();
        self.step.resize(size, T::zero());
        self.diagonal.clear();
        self.diagonal.resize(size, T::zero());
        self.blocks.clear();
        for group in 0..grouped.groups() {
            if !self.eliminate(grouped.group(group), size, damping) {
                return false;
            }
        }
        let total = self.diagonal.iter().fold(T::zero(), |sum, d| sum + *d);
        let stiffness = total / T::lit(size as f64);
        for direction in gauge {
            for i in 0..size {
                let scaled = direction[i] * stiffness;
                let row = &mut self.matrix[i * size..=i * size + i];
                for (cell, other) in row.iter_mut().zip(direction) {
                    *cell += scaled * *other;
                }
            }
        }
        for i in 0..size {
            self.matrix[i * size + i] += damping * self.diagonal[i];
        }
        cholesky::factorize(&mut self.matrix, size)
    }

    /// Takes one block out: adds its Schur complement to the reduced system.
    fn eliminate(
        &mut self,
        group: impl Iterator<Item = Slot<T, E, K>>,
        size: usize,
        damping: T,
    ) -> bool {
        let mut hessian = [[T::zero(); E]; E];
        self.slots.clear();
        for slot in group {
            for i in 0..E {
                for j in 0..=i {
                    hessian[i][j] += slot.gone[i] * slot.gone[j];
                }
            }
            self.slots.push((slot, slot.gone));
        }
        let Some(block) = Block::new(&hessian, damping) else {
            return false;
        };
        self.blocks.push(block);

        let mut projected = [T::zero(); E];
        for (slot, whitened) in &mut self.slots {
            *whitened = block.forward(slot.gone);
            for (sum, z) in projected.iter_mut().zip(whitened.iter()) {
                *sum += *z * slot.residual;
            }
        }
        for row in &mut self.products {
            row.clear();
        }
        for (slot, whitened) in &self.slots {
            let left = slot.residual - dot(whitened, &projected);
            let start = slot.kept * K;
            for i in 0..K {
                self.step[start + i] -= slot.stay[i] * left;
                self.diagonal[start + i] += slot.stay[i] * slot.stay[i];
                let row = &mut self.matrix[(start + i) * size..][start..start + K];
                for (cell, other) in row.iter_mut().zip(&slot.stay) {
                    *cell += slot.stay[i] * *other;
                }
            }
            for (row, z) in self.products.iter_mut().zip(whitened) {
                row.extend(slot.stay.map(|k| k * *z));
            }
        }
        // Lower triangle of the outer product, row by row.
        for a in 0..self.slots.len() {
            let kept = self.slots[a].0.kept;
            let first = self.slots[0].0.kept;
            let width = (a + 1) * K;
            for i in 0..K {
                let factors: [T; E] = core::array::from_fn(|e| self.products[e][a * K + i]);
                let row = &mut self.matrix[(kept * K + i) * size..][..(kept + 1) * K];
                let products = self.products.each_ref().map(|row| &row[..width]);
                if kept - first == a {
                    // The blocks so far are neighbours: one run.
                    subtract(&mut row[first * K..], &factors, products);
                } else {
                    for (b, (slot, _)) in self.slots[..=a].iter().enumerate() {
                        subtract(
                            &mut row[slot.kept * K..(slot.kept + 1) * K],
                            &factors,
                            products.map(|row| &row[b * K..(b + 1) * K]),
                        );
                    }
                }
            }
        }
        true
    }

    /// Solves for the step of the blocks that stay and, group by group, of those that went.
    ///
    /// Returns half the sum of squared residuals that the linear model predicts after the step.
    pub fn solve(
        &mut self,
        grouped: &impl Grouped<T, E, K>,
        kept: &mut Vec<SVector<T, K>>,
        gone: &mut Vec<SVector<T, E>>,
    ) -> T {
        let size = self.step.len();
        cholesky::solve(&self.matrix, size, &mut self.step);
        kept.clear();
        kept.extend(
            self.step
                .chunks_exact(K)
                .map(SVector::<T, K>::from_column_slice),
        );
        gone.clear();
        let mut model = T::zero();
        for group in 0..grouped.groups() {
            let mut gradient = [T::zero(); E];
            self.slots.clear();
            for mut slot in grouped.group(group) {
                for i in 0..K {
                    slot.residual += slot.stay[i] * self.step[slot.kept * K + i];
                }
                for i in 0..E {
                    gradient[i] -= slot.gone[i] * slot.residual;
                }
                self.slots.push((slot, slot.gone));
            }
            let block = &self.blocks[group];
            let step = block.backward(block.forward(gradient));
            for (slot, _) in &self.slots {
                let residual = slot.residual + dot(&slot.gone, &step);
                model += residual * residual;
            }
            gone.push(SVector::from(step));
        }
        model * T::lit(0.5)
    }

    /// The direction of the blocks that stay in which the data hold them least, as a displacement one
    /// standard deviation long when residuals have unit variance.
    ///
    /// Inverse iteration on the reduced matrix with its parameters in units of their conditional
    /// standard deviations; needs [`Schur::factorize`] without damping. Also returns the eigenvalue:
    /// 1 when nothing is lost to the blocks that went, 0 when the direction is free.
    pub fn weakest_direction(&self) -> (Vec<T>, T) {
        let size = self.step.len();
        let units: Vec<T> = self.diagonal.iter().map(|d| d.sqrt()).collect();
        let mut vector: Vec<T> = (0..size)
            .map(|k| T::lit(1.0 + 0.1 * ((7 * k + 3) % 11) as f64))
            .collect();
        let mut eigenvalue = T::one();
        for _ in 0..WEAKEST_STEPS {
            let norm = vector.iter().fold(T::zero(), |s, v| s + *v * *v).sqrt();
            let mut next = vec![T::zero(); size];
            for k in 0..size {
                vector[k] /= norm;
                next[k] = vector[k] * units[k];
            }
            cholesky::solve(&self.matrix, size, &mut next);
            let mut product = T::zero();
            for k in 0..size {
                next[k] *= units[k];
                product += next[k] * vector[k];
            }
            eigenvalue = T::one() / product;
            vector = next;
        }
        let norm = vector.iter().fold(T::zero(), |s, v| s + *v * *v).sqrt();
        let length = (T::one() / eigenvalue).max(T::zero()).sqrt() / norm;
        for (v, unit) in vector.iter_mut().zip(&units) {
            *v *= length / *unit;
        }
        (vector, eigenvalue)
    }
}

/// Steps of inverse iteration in [`Schur::weakest_direction`]; the size is wanted to a few percent.
const WEAKEST_STEPS: usize = 6;

/// `row -= sum_e factors[e] products[e]`.
#[inline]
fn subtract<T: Real, const E: usize>(row: &mut [T], factors: &[T; E], products: [&[T]; E]) {
    for (factor, product) in factors.iter().zip(products) {
        for (cell, p) in row.iter_mut().zip(product) {
            *cell -= *factor * *p;
        }
    }
}
