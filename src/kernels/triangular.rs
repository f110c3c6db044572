// SPDX-License-Identifier: MIT OR Apache-2.0
//! The triangular factor of a matrix whose rows come one by one.

use super::pair::Pair;
use crate::scalar::Real;
use nalgebra::SVector;

/// Rows that are eliminated together, by one Householder reflection per column.
const BLOCK: usize = 8;

/// The factor R of `A = QR` for a matrix `A` with `N` columns and any number of rows.
///
/// Rows are streamed in and folded into R by orthogonal reflections, so memory is constant and the
/// condition number is that of `A`, not its square. A reflection acts on one row of R and the
/// waiting rows only (the rest of its column is zero already).
///
/// # Example
/// ```
/// use bearslam::TriangularFactor;
/// let mut factor = TriangularFactor::<f64, 2>::new();
/// for row in [[1.0, 1.0], [1.0, 1.0], [2.0, 2.0]] {
///     factor.push(row);
/// }
/// let null = factor.null_space();
/// assert!(null.singular_values[0] < 1e-15);
/// assert!((null.vectors[0].x + null.vectors[0].y).abs() < 1e-15);
/// ```
#[derive(Clone, Debug)]
pub struct TriangularFactor<T: Real, const N: usize> {
    /// R, row by row.
    factor: [[T; N]; N],
    /// Rows not yet folded in, column by column, zero beyond `waiting`.
    block: [[T; BLOCK]; N],
    waiting: usize,
}

/// The two right singular vectors with the smallest singular values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NullSpace<T: Real, const N: usize> {
    /// The two smallest singular values, the smallest first.
    pub singular_values: [T; 2],
    /// Their right singular vectors, of unit length and at right angles.
    pub vectors: [SVector<T, N>; 2],
}

impl<T: Real, const N: usize> Default for TriangularFactor<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const N: usize> TriangularFactor<T, N> {
    /// The factor of a matrix without rows.
    pub fn new() -> Self {
        Self {
            factor: [[T::zero(); N]; N],
            block: [[T::zero(); BLOCK]; N],
            waiting: 0,
        }
    }

    /// Appends a row to the matrix.
    #[inline]
    pub fn push(&mut self, row: [T; N]) {
        let place = self.waiting;
        // Always so; the compiler sees no panic then.
        if place < BLOCK {
            for (column, value) in self.block.iter_mut().zip(row) {
                column[place] = value;
            }
            self.waiting = place + 1;
        }
        if self.waiting >= BLOCK {
            self.fold();
        }
    }

    /// Folds the waiting rows into R.
    fn fold(&mut self) {
        if self.waiting <= BLOCK / 2 {
            self.eliminate::<{ BLOCK / 2 }>();
        } else {
            self.eliminate::<BLOCK>();
        }
        self.waiting = 0;
    }

    /// Folds the first B rows of the block, which are all that wait. B is a constant, so that the
    /// loops over rows become vector operations.
    fn eliminate<const B: usize>(&mut self) {
        for k in 0..N {
            // Copies: the compiler then keeps them in registers.
            let column = head::<T, B>(&self.block[k]);
            let pivot = self.factor[k][k];
            let below = dot(&column, &column);
            // A NaN goes in as well, and comes out in every number.
            if below != T::zero() {
                let norm = (pivot * pivot + below).sqrt();
                let signed = if pivot > T::zero() { -norm } else { norm };
                let first = pivot - signed;
                let scale = T::one() / (norm * (norm + pivot.abs()));
                self.factor[k][k] = signed;
                for j in k + 1..N {
                    let mut other = head::<T, B>(&self.block[j]);
                    let above = self.factor[k][j];
                    let step = (first * above + dot(&column, &other)) * scale;
                    self.factor[k][j] = above - step * first;
                    for i in 0..B {
                        other[i] -= step * column[i];
                    }
                    for (place, value) in self.block[j].iter_mut().zip(other) {
                        *place = value;
                    }
                }
            }
            self.block[k] = [T::zero(); BLOCK];
        }
    }

    /// R, row by row; its lower part is zero.
    pub fn rows(&mut self) -> &[[T; N]; N] {
        if self.waiting > 0 {
            self.fold();
        }
        &self.factor
    }

    /// The two smallest singular values and their right singular vectors.
    ///
    /// Inverse iteration on a pair of vectors: the pair converges with the square of the ratio of
    /// the second to the third smallest singular value, and a 2x2 problem separates it. Ends when
    /// the first vector stands still, or after 40 steps. The second value is then an upper
    /// bound of the true one, tight where it matters: when it is small.
    pub fn null_space(&mut self) -> NullSpace<T, N> {
        // Squared movement of a vector that stands still: far below any noise that is there.
        let still = T::eps() * T::lit(0.1);
        let factor = self.rows();
        let inverse = inverse_pivots(factor);
        let (zero, one) = (T::zero(), T::one());
        let mut vectors = [Pair([zero; 2]); N];
        if let [.., second, first] = &mut vectors[..] {
            *second = Pair([zero, one]);
            *first = Pair([one, zero]);
        }
        back_substitute(factor, &inverse, &mut vectors);
        orthonormalize(&mut vectors);
        let mut values = rayleigh_ritz(factor, &mut vectors);
        let mut last = zero;
        for _ in 0..MAX_STEPS {
            let before = vectors;
            // Orthonormal after each half of the step: a vanishing singular value turns both vectors
            // into its own, and one half is all that double the digits could bear.
            forward_substitute(factor, &inverse, &mut vectors);
            orthonormalize(&mut vectors);
            back_substitute(factor, &inverse, &mut vectors);
            orthonormalize(&mut vectors);
            values = rayleigh_ritz(factor, &mut vectors);
            let movement = moved(&before, &vectors);
            // With room for a next step that shortens it ten times less.
            if movement <= still || movement * movement * T::lit(100.0) <= still * last {
                break;
            }
            last = movement;
        }
        NullSpace {
            singular_values: values,
            vectors: [
                SVector::from_fn(|k, _| vectors[k].0[0]),
                SVector::from_fn(|k, _| vectors[k].0[1]),
            ],
        }
    }
}

/// One over the pivots; for a pivot that is rounding any value of its size serves.
#[inline]
fn inverse_pivots<T: Real, const N: usize>(factor: &[[T; N]; N]) -> [T; N] {
    let mut square = T::zero();
    for (k, row) in factor.iter().enumerate() {
        for value in row.iter().skip(k) {
            square += *value * *value;
        }
    }
    let floor = square.sqrt() * T::eps() + T::eps() * T::eps();
    core::array::from_fn(|k| {
        let pivot = factor[k][k];
        let safe = if pivot.abs() > floor {
            pivot
        } else if pivot < T::zero() {
            -floor
        } else {
            floor
        };
        T::one() / safe
    })
}

/// Most steps of inverse iteration; a pair that needs more is a null space of three dimensions, of
/// which any member is as good as another.
const MAX_STEPS: usize = 40;

/// The first B numbers of a column of waiting rows.
#[inline]
fn head<T: Real, const B: usize>(column: &[T; BLOCK]) -> [T; B] {
    let mut first = [T::zero(); B];
    for (place, value) in first.iter_mut().zip(column) {
        *place = *value;
    }
    first
}

/// The scalar product, as four interleaved sums: their order is fixed, and they fit the vector
/// registers.
#[inline]
fn dot<T: Real, const B: usize>(a: &[T; B], b: &[T; B]) -> T {
    let mut sums = [T::zero(); 4];
    for (a, b) in a.chunks_exact(4).zip(b.chunks_exact(4)) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += *a * *b;
        }
    }
    let [a, b, c, d] = sums;
    (a + c) + (b + d)
}

/// Solves `R x = b` in place, for two right-hand sides.
#[inline(always)]
fn back_substitute<T: Real, const N: usize>(
    factor: &[[T; N]; N],
    inverse: &[T; N],
    x: &mut [Pair<T>; N],
) {
    for i in (0..N).rev() {
        let mut sum = x[i];
        for j in i + 1..N {
            sum = sum - x[j] * factor[i][j];
        }
        x[i] = sum * inverse[i];
    }
}

/// Solves `R^T x = b` in place, for two right-hand sides.
#[inline(always)]
fn forward_substitute<T: Real, const N: usize>(
    factor: &[[T; N]; N],
    inverse: &[T; N],
    x: &mut [Pair<T>; N],
) {
    for i in 0..N {
        let value = x[i] * inverse[i];
        x[i] = value;
        for j in i + 1..N {
            x[j] = x[j] - value * factor[i][j];
        }
    }
}

/// Squared lengths of two vectors.
#[inline(always)]
fn squares<T: Real, const N: usize>(vectors: &[Pair<T>; N]) -> Pair<T> {
    let zero = Pair([T::zero(); 2]);
    vectors.iter().fold(zero, |sum, pair| sum + *pair * *pair)
}

/// The scalar product of two vectors.
#[inline(always)]
fn product<T: Real, const N: usize>(vectors: &[Pair<T>; N]) -> T {
    let zero = T::zero();
    vectors.iter().fold(zero, |sum, Pair([a, b])| sum + *a * *b)
}

#[inline(always)]
fn scale_to_unit<T: Real, const N: usize>(vectors: &mut [Pair<T>; N]) {
    let square = squares(vectors);
    if square
        .0
        .iter()
        .all(|square| square.is_finite() && *square > T::zero())
    {
        let scale = square.map(|square| T::one() / square.sqrt());
        vectors.iter_mut().for_each(|pair| *pair = *pair * scale);
    } else {
        scale_extreme_to_unit(vectors);
    }
}

/// For vectors whose squares overflow or vanish: a null space of several dimensions in `f32`.
#[cold]
#[inline(never)]
fn scale_extreme_to_unit<T: Real, const N: usize>(vectors: &mut [Pair<T>; N]) {
    let zero = Pair([T::zero(); 2]);
    let larger = |most: T, value: T| most.max(value.abs());
    let scale = |size: T| {
        if size > T::zero() {
            T::one() / size
        } else {
            T::one()
        }
    };
    let largest = vectors
        .iter()
        .fold(zero, |most, pair| most.zip(*pair, larger));
    vectors
        .iter_mut()
        .for_each(|pair| *pair = *pair * largest.map(scale));
    let lengths = squares(vectors).map(|square| scale(square.sqrt()));
    vectors.iter_mut().for_each(|pair| *pair = *pair * lengths);
}

#[inline(always)]
fn orthonormalize<T: Real, const N: usize>(vectors: &mut [Pair<T>; N]) {
    scale_to_unit(vectors);
    // Twice is enough, and once when little was taken away.
    for _ in 0..2 {
        let overlap = product(vectors);
        for Pair([first, second]) in vectors.iter_mut() {
            *second -= *first * overlap;
        }
        scale_to_unit(vectors);
        if overlap * overlap < T::lit(0.5) {
            break;
        }
    }
}

/// The squared sine of the angle by which the first vector has moved.
#[inline(always)]
fn moved<T: Real, const N: usize>(before: &[Pair<T>; N], after: &[Pair<T>; N]) -> T {
    let both = || {
        before
            .iter()
            .zip(after)
            .map(|(before, after)| (before.0[0], after.0[0]))
    };
    let cosine = both().fold(T::zero(), |sum, (before, after)| sum + before * after);
    both().fold(T::zero(), |sum, (before, after)| {
        let apart = after - before * cosine;
        sum + apart * apart
    })
}

/// Turns two orthonormal vectors in their plane into the singular vectors of R there, the one with the
/// smaller singular value first; the values.
#[inline(always)]
fn rayleigh_ritz<T: Real, const N: usize>(
    factor: &[[T; N]; N],
    vectors: &mut [Pair<T>; N],
) -> [T; 2] {
    let mut images = [Pair([T::zero(); 2]); N];
    for i in 0..N {
        for j in i..N {
            images[i] = images[i] + vectors[j] * factor[i][j];
        }
    }
    // One-sided Jacobi rotation: makes the two images orthogonal without forming their squares' difference twice.
    let (Pair([aa, bb]), ab) = (squares(&images), product(&images));
    let zeta = (bb - aa) * T::lit(0.5);
    let reach = (zeta * zeta + ab * ab).sqrt();
    let tangent = if reach > T::zero() {
        ab / (zeta.abs() + reach)
            * if zeta < T::zero() {
                -T::one()
            } else {
                T::one()
            }
    } else {
        T::zero()
    };
    let cos = T::one() / (T::one() + tangent * tangent).sqrt();
    let sin = cos * tangent;
    let turn = |Pair([a, b]): &mut Pair<T>| (*a, *b) = (*a * cos - *b * sin, *a * sin + *b * cos);
    images.iter_mut().for_each(turn);
    vectors.iter_mut().for_each(turn);
    let Pair([first, second]) = squares(&images).map(|square| square.sqrt());
    if first <= second {
        [first, second]
    } else {
        vectors.iter_mut().for_each(|pair| pair.0.reverse());
        [second, first]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// A matrix with entries of no pattern.
    fn matrix(rows: usize, seed: f64) -> DMatrix<f64> {
        DMatrix::from_fn(rows, 6, |i, j| {
            ((seed + 12.9898 * i as f64 + 78.233 * j as f64).sin() * 43758.5453).rem_euclid(2.0)
                - 1.0
        })
    }

    fn check(matrix: &DMatrix<f64>, tolerance: f64) {
        let mut factor = TriangularFactor::<f64, 6>::new();
        for row in matrix.row_iter() {
            factor.push(core::array::from_fn(|j| row[j]));
        }
        let null = factor.null_space();
        let full = matrix
            .clone()
            .resize(matrix.nrows().max(6), 6, 0.0)
            .svd(false, true);
        let mut order: Vec<usize> = (0..6).collect();
        order.sort_by(|&i, &j| full.singular_values[i].total_cmp(&full.singular_values[j]));
        let [smallest, second] = [0, 1].map(|k| full.singular_values[order[k]]);
        assert!((null.singular_values[0] - smallest).abs() < 1e-13);
        assert!(null.singular_values[1] > second - 1e-13);
        let expected = full.v_t.unwrap().row(order[0]).transpose();
        let cosine = expected.dot(&DMatrix::from_column_slice(
            6,
            1,
            null.vectors[0].as_slice(),
        ));
        assert!((cosine.abs() - 1.0).abs() < tolerance, "{cosine}");
    }

    extern crate alloc;
    use alloc::vec::Vec;

    #[test]
    fn smallest_singular_vectors_are_those_of_the_full_decomposition() {
        for rows in [5, 6, 7, 8, 9, 15, 16, 17, 40] {
            for seed in 0..20 {
                // A row of three views has a small component along the tensor: its noise.
                let noise = [0.0, 1e-6, 0.02, 0.2][seed % 4];
                let axis = DMatrix::from_fn(6, 1, |i, _| [0.1, -0.5, 0.3, 0.7, 0.2, 0.346][i]);
                let rows = matrix(rows, seed as f64);
                let along =
                    &rows * &axis * (axis.transpose() * ((noise - 1.0) / axis.norm_squared()));
                check(&(rows + along), 1e-12);
            }
        }
    }

    #[test]
    fn rank_deficient_matrices_of_every_kind_are_finite() {
        for rank in 0..5 {
            for rows in [5, 8, 20] {
                let left = matrix(rows, 0.3).columns(0, rank).into_owned();
                let right = matrix(rank, 1.7);
                let product = left * right;
                let mut factor = TriangularFactor::<f64, 6>::new();
                for row in product.row_iter() {
                    factor.push(core::array::from_fn(|j| row[j]));
                }
                let null = factor.null_space();
                for k in 0..2 {
                    assert!(null.singular_values[k] < 1e-13);
                    assert!((null.vectors[k].norm() - 1.0).abs() < 1e-14);
                    assert!(
                        (&product * DMatrix::from_column_slice(6, 1, null.vectors[k].as_slice()))
                            .norm()
                            < 1e-13
                    );
                }
            }
        }
    }
}
