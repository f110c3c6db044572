// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cholesky factorisation of a sparse symmetric matrix with a fixed pattern and changing values: faer with its
//! fill-reducing ordering, on one thread, so that the same matrix gives the same bits.
//!
//! The unknowns come in blocks, all of which have the same neighbours: the ordering is that of the graph of the blocks,
//! which has a ninth of the entries.

use alloc::vec;
use alloc::vec::Vec;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::linalg::{SupernodalThreshold, amd};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};

/// Operations for each entry of the factor, over forty, from which it is computed by dense blocks: a fifth of what faer
/// takes, since all unknowns come in blocks.
const SUPERNODAL: SupernodalThreshold = SupernodalThreshold(0.2);

/// The pattern of the lower triangle, column by column, and the factor of the last values.
pub struct SparseCholesky {
    size: usize,
    column_start: Vec<usize>,
    rows: Vec<usize>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    work: MemBuffer,
}

impl SparseCholesky {
    /// Analyses a pattern: the start of each column in `rows`, and the end. Entries above the diagonal are
    /// allowed and not read. `blocks` are the sizes of blocks of unknowns whose columns have the same rows below the
    /// block.
    ///
    /// `None` when there is not enough memory.
    pub fn analyse(blocks: &[usize], column_start: Vec<usize>, rows: Vec<usize>) -> Option<Self> {
        let size = blocks.iter().sum();
        let forward = ordering(blocks, &column_start, &rows)?;
        let mut backward = vec![0; size];
        for (to, &from) in forward.iter().enumerate() {
            backward[from] = to;
        }
        let symbolic = factorize_symbolic_cholesky(
            pattern(size, &column_start, &rows),
            Side::Lower,
            SymmetricOrdering::Custom(PermRef::new_checked(&forward, &backward, size)),
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SUPERNODAL,
                ..Default::default()
            },
        )
        .ok()?;
        let need = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default());
        let work = MemBuffer::try_new(need).ok()?;
        Some(Self {
            size,
            column_start,
            rows,
            factor: vec![0.0; symbolic.len_val()],
            symbolic,
            work,
        })
    }

    /// Factorises the matrix with these values in the places of the pattern; `false` when it is not
    /// positive definite in this arithmetic.
    pub fn factorize(&mut self, values: &[f64]) -> bool {
        if values.iter().any(|value| !value.is_finite()) {
            return false;
        }
        let pattern = pattern(self.size, &self.column_start, &self.rows);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                SparseColMatRef::new(pattern, values),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.work),
                Spec::default(),
            )
            .is_ok()
    }

    /// Solves in place for right-hand sides stored one after the other.
    pub fn solve(&self, sides: &mut [f64]) {
        let count = sides.len() / self.size.max(1);
        let need = self.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq);
        let mut work = MemBuffer::new(need);
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(sides, self.size, count),
            Par::Seq,
            MemStack::new(&mut work),
        );
    }
}

/// The order in which unknowns are eliminated: by approximate minimum degree of their blocks.
fn ordering(blocks: &[usize], column_start: &[usize], rows: &[usize]) -> Option<Vec<usize>> {
    let count = blocks.len();
    let mut first = Vec::with_capacity(count);
    let mut block_of = Vec::new();
    for (block, &width) in blocks.iter().enumerate() {
        first.push(block_of.len());
        block_of.resize(block_of.len() + width, block);
    }
    let (mut starts, mut neighbours) = (vec![0], Vec::new());
    for &parameter in &first {
        let begin = neighbours.len();
        let column = &rows[column_start[parameter]..column_start[parameter + 1]];
        for &row in column {
            // The rows of a block follow each other.
            if neighbours[begin..].last() != Some(&block_of[row]) {
                neighbours.push(block_of[row]);
            }
        }
        starts.push(neighbours.len());
    }
    let graph = pattern(count, &starts, &neighbours);
    let (mut forward, mut backward) = (vec![0; count], vec![0; count]);
    let need = amd::order_maybe_unsorted_scratch::<usize>(count, neighbours.len());
    let mut work = MemBuffer::try_new(need).ok()?;
    let control = amd::Control::default();
    let work = MemStack::new(&mut work);
    amd::order_maybe_unsorted(&mut forward, &mut backward, graph, control, work).ok()?;
    let of_block = |block: &usize| first[*block]..first[*block] + blocks[*block];
    Some(forward.iter().flat_map(of_block).collect())
}

fn pattern<'a>(
    size: usize,
    column_start: &'a [usize],
    rows: &'a [usize],
) -> SymbolicSparseColMatRef<'a, usize> {
    SymbolicSparseColMatRef::new_checked(size, size, column_start, None, rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn agrees_with_the_dense_factor() {
        // An arrow matrix with a chain: it has fill, and a good ordering to be found.
        let size = 40;
        let (mut start, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        let mut dense = DMatrix::<f64>::zeros(size, size);
        for column in 0..size {
            for row in column..size {
                let entry = match row - column {
                    0 => 4.0 + column as f64,
                    1 => -1.0,
                    _ if column == 0 => 0.3,
                    _ => continue,
                };
                rows.push(row);
                values.push(entry);
                dense[(row, column)] = entry;
                dense[(column, row)] = entry;
            }
            start.push(rows.len());
        }
        let mut sparse = SparseCholesky::analyse(&[1; 40], start, rows).unwrap();
        assert!(sparse.factorize(&values));
        let side = DVector::from_fn(2 * size, |k, _| (k as f64).sin());
        let mut found = side.as_slice().to_vec();
        sparse.solve(&mut found);
        let inverse = dense.cholesky().unwrap();
        for part in 0..2 {
            let expected = inverse.solve(&side.rows(part * size, size).into_owned());
            let found = DVector::from_column_slice(&found[part * size..][..size]);
            assert!((expected - found).norm() < 1e-13);
        }
        for bad in [-1.0, f64::NAN] {
            values[0] = bad;
            assert!(!sparse.factorize(&values));
        }
    }

    /// A hub that all others touch is eliminated last, and blocks stay together.
    #[test]
    fn blocks_are_ordered_as_a_graph() {
        let blocks = [3, 2, 3, 2, 2];
        let (mut start, mut rows) = (vec![0], Vec::new());
        let all: Vec<usize> = (0..12).collect();
        for (block, range) in [(0, 0..3), (1, 3..5), (2, 5..8), (3, 8..10), (4, 10..12)] {
            for _ in 0..blocks[block] {
                rows.extend(if block == 0 {
                    &all[..]
                } else {
                    &all[range.clone()]
                });
                start.push(rows.len());
            }
        }
        let found = ordering(&blocks, &start, &rows).unwrap();
        assert_eq!(found[9..], [0, 1, 2]);
        let mut sorted = found.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, all);
        for pair in [[3, 4], [5, 6], [6, 7], [8, 9], [10, 11]] {
            assert!(found.windows(2).any(|next| next == pair), "{found:?}");
        }
    }
}
