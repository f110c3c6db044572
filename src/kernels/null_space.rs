// SPDX-License-Identifier: MIT OR Apache-2.0
//! The two smallest singular values of a triangular matrix, and their vectors.

use super::lanes::Lanes;
use crate::scalar::Real;
use nalgebra::SVector;

/// The two right singular vectors with the smallest singular values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NullSpace<T: Real, const N: usize> {
    /// The two smallest singular values, the smallest first.
    pub singular_values: [T; 2],
    /// Their right singular vectors, orthonormal.
    pub vectors: [SVector<T, N>; 2],
}

/// Maximum number of steps of inverse iteration. A plane that needs more lies in a null space of at least three
/// dimensions, in which any plane is as good as another.
const MAX_STEPS: usize = 40;

/// The two smallest singular values of a triangular matrix, given row by row, and their right singular vectors.
///
/// Inverse iteration on two vectors at once: their plane converges with the square of the ratio of
/// the second to the third smallest singular value, and a 2x2 problem separates them. Ends when
/// the first vector has converged, or after 40 steps. The second value is then an upper
/// bound of the true one, tight where it matters: when it is small.
// Inlined: a stack frame of its own would take 400 bytes more for eight columns.
#[inline(always)]
pub(super) fn null_space<T: Real, const N: usize>(factor: &[[T; N]; N]) -> NullSpace<T, N> {
    // Squared movement of a vector that has converged: far below any noise.
    let still = T::eps() * T::lit(0.1);
    let inverse = inverse_pivots(factor);
    let (zero, one) = (T::zero(), T::one());
    let mut vectors = [Lanes([zero; 2]); N];
    if let [.., second, first] = &mut vectors[..] {
        *second = Lanes([zero, one]);
        *first = Lanes([one, zero]);
    }
    back_substitute(factor, &inverse, &mut vectors);
    orthonormalize(&mut vectors);
    let mut values = rayleigh_ritz(factor, &mut vectors);
    let mut last = zero;
    for _ in 0..MAX_STEPS {
        let before = vectors;
        // Orthonormalise after each half step: a vanishing singular value turns both vectors
        // towards its own, and after two halves no digits of the second would be left.
        forward_substitute(factor, &inverse, &mut vectors);
        orthonormalize(&mut vectors);
        back_substitute(factor, &inverse, &mut vectors);
        orthonormalize(&mut vectors);
        values = rayleigh_ritz(factor, &mut vectors);
        let movement = moved(&before, &vectors);
        // With a margin for a next step that converges ten times slower.
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

/// One over the pivots; a pivot that is only rounding may be replaced by any value of its size.
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

/// Solves `R x = b` in place, for two right-hand sides.
#[inline(always)]
fn back_substitute<T: Real, const N: usize>(
    factor: &[[T; N]; N],
    inverse: &[T; N],
    x: &mut [Lanes<T>; N],
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
    x: &mut [Lanes<T>; N],
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
fn squares<T: Real, const N: usize>(vectors: &[Lanes<T>; N]) -> Lanes<T> {
    let zero = Lanes([T::zero(); 2]);
    vectors
        .iter()
        .fold(zero, |sum, lanes| sum + *lanes * *lanes)
}

/// The scalar product of two vectors.
#[inline(always)]
fn product<T: Real, const N: usize>(vectors: &[Lanes<T>; N]) -> T {
    let zero = T::zero();
    vectors
        .iter()
        .fold(zero, |sum, Lanes([a, b])| sum + *a * *b)
}

#[inline(always)]
fn scale_to_unit<T: Real, const N: usize>(vectors: &mut [Lanes<T>; N]) {
    let square = squares(vectors);
    if square
        .0
        .iter()
        .all(|square| square.is_finite() && *square > T::zero())
    {
        let scale = square.map(|square| T::one() / square.sqrt());
        vectors.iter_mut().for_each(|lanes| *lanes = *lanes * scale);
    } else {
        scale_extreme_to_unit(vectors);
    }
}

/// For vectors whose squares overflow or vanish: a null space of several dimensions in `f32`.
#[cold]
#[inline(never)]
fn scale_extreme_to_unit<T: Real, const N: usize>(vectors: &mut [Lanes<T>; N]) {
    let zero = Lanes([T::zero(); 2]);
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
        .fold(zero, |most, lanes| most.zip(*lanes, larger));
    vectors
        .iter_mut()
        .for_each(|lanes| *lanes = *lanes * largest.map(scale));
    let lengths = squares(vectors).map(|square| scale(square.sqrt()));
    vectors
        .iter_mut()
        .for_each(|lanes| *lanes = *lanes * lengths);
}

#[inline(always)]
fn orthonormalize<T: Real, const N: usize>(vectors: &mut [Lanes<T>; N]) {
    scale_to_unit(vectors);
    // Twice is enough, and once when little was subtracted.
    for _ in 0..2 {
        let overlap = product(vectors);
        for Lanes([first, second]) in vectors.iter_mut() {
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
fn moved<T: Real, const N: usize>(before: &[Lanes<T>; N], after: &[Lanes<T>; N]) -> T {
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

/// Rotates two orthonormal vectors in their plane into the singular vectors of R there, the one with the
/// smaller singular value first; returns the values.
#[inline(always)]
fn rayleigh_ritz<T: Real, const N: usize>(
    factor: &[[T; N]; N],
    vectors: &mut [Lanes<T>; N],
) -> [T; 2] {
    let mut images = [Lanes([T::zero(); 2]); N];
    for i in 0..N {
        for j in i..N {
            images[i] = images[i] + vectors[j] * factor[i][j];
        }
    }
    // A one-sided Jacobi rotation makes the two images orthogonal.
    let (Lanes([aa, bb]), ab) = (squares(&images), product(&images));
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
    let turn = |Lanes([a, b]): &mut Lanes<T>| (*a, *b) = (*a * cos - *b * sin, *a * sin + *b * cos);
    images.iter_mut().for_each(turn);
    vectors.iter_mut().for_each(turn);
    let Lanes([first, second]) = squares(&images).map(|square| square.sqrt());
    if first <= second {
        [first, second]
    } else {
        vectors.iter_mut().for_each(|lanes| lanes.0.reverse());
        [second, first]
    }
}
