// SPDX-License-Identifier: MIT OR Apache-2.0
//! The smallest singular vector of a tall matrix from its Gram matrix, without loss of digits.
//!
//! A Gram matrix squares the condition number. This is acceptable for a first, approximate vector. The
//! final one is computed as a correction of the first: the correction is as small as the noise, so the
//! digits that it loses to the squared condition number are negligible beside the noise. Where they are
//! not, the answer is `None`, and the triangular factor is used instead.

use super::Triple;
use super::lanes::{ComplexLanes, Lanes};
use crate::scalar::Real;
use core::ops::{Mul, Sub};
use nalgebra::Complex;

/// Columns of the calibrated system.
const N: usize = 6;

/// The upper triangle of a symmetric matrix; the rest is never read.
pub(super) type Symmetric<T> = [[T; N]; N];

/// Rows in each lane that are multiplied together.
const BLOCK: usize = 4;

/// The sums over all rows of column i times column j, for `j >= i`; the rest is zero.
///
/// `row` makes two rows from two landmarks, one in each lane; a landmark of zeros must give a row of zeros.
#[inline(always)]
pub(super) fn products<T: Real, const C: usize>(
    triples: &[Triple<T>],
    row: impl Fn([ComplexLanes<T>; 3]) -> [Lanes<T>; C],
) -> [[T; C]; N] {
    let zero = Lanes([T::zero(); 2]);
    let mut sums = [[zero; C]; N];
    let mut columns = [[zero; BLOCK]; C];
    for block in triples.chunks(2 * BLOCK) {
        if block.len() < 2 * BLOCK {
            columns = [[zero; BLOCK]; C];
        }
        for (place, two) in (0..BLOCK).zip(block.chunks(2)) {
            let nothing = [Complex::new(T::zero(), T::zero()); 3];
            let (first, second) = match two {
                [first, second] => (complex(first), complex(second)),
                [first] => (complex(first), nothing),
                _ => break,
            };
            let made = row(core::array::from_fn(|k| {
                ComplexLanes::new([first[k], second[k]])
            }));
            for (column, lanes) in columns.iter_mut().zip(made) {
                // Always present; `get_mut` lets the compiler see that nothing panics.
                if let Some(there) = column.get_mut(place) {
                    *there = lanes;
                }
            }
        }
        add(&columns, &mut sums);
    }
    sums.map(|row| row.map(Lanes::sum))
}

/// Adds the products of all pairs of columns.
///
/// Not inlined: otherwise the compiler no longer keeps both lanes in one register.
#[inline(never)]
fn add<T: Real, const C: usize>(columns: &[[Lanes<T>; BLOCK]; C], sums: &mut [[Lanes<T>; C]; N]) {
    for i in 0..N {
        for j in i..C {
            let mut sum = sums[i][j];
            for k in 0..BLOCK {
                sum = sum + columns[i][k] * columns[j][k];
            }
            sums[i][j] = sum;
        }
    }
}

#[inline]
fn complex<T: Real>(triple: &Triple<T>) -> [Complex<T>; 3] {
    triple.map(|bearing| bearing.into_inner())
}

/// Maximum number of steps of either iteration. A matrix that needs more is nearly degenerate.
const MAX_STEPS: usize = 16;

/// The unit vector that the matrix shortens most.
///
/// Inverse iteration on `gram = A^T A`. `None` when a pivot shows that the digits may not suffice, or
/// when the iteration does not converge.
pub(super) fn approximate<T: Real>(gram: &Symmetric<T>) -> Option<[T; N]> {
    let mut gram = *gram;
    let trace = trace(&gram);
    let inverse = factor(&mut gram, trace, T::eps() * trace)?;
    // The first step, from the last axis, which forward substitution does not change.
    let mut vector = [T::zero(); N];
    vector[N - 1] = T::one();
    back_substitute(&gram, &mut vector);
    let mut last = T::zero();
    vector = unit(vector);
    for _ in 0..MAX_STEPS {
        let before = vector;
        solve(&gram, &inverse, &mut vector);
        vector = unit(vector);
        let movement = moved(&before, &vector);

        if stands(movement, last, T::lit(APPROXIMATELY_STILL).max(rounding())) {
            return Some(vector);
        }
        last = movement;
    }
    None
}

/// Squared error of a vector from which weights are computed. The error of the next vector is the product
/// of this error and its own.
const APPROXIMATELY_STILL: f64 = 1e-20;

/// A singular vector, and the two smallest singular values, the smallest first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corrected<T> {
    pub vector: [T; N],
    pub singular_values: [T; 2],
}

/// The smallest singular vector of A near `start`, a unit vector, from `gram = A^T A` and
/// `image = A^T (A start)`.
///
/// With `A start` formed row by row, the rounding of `image` depends on the condition number, not on its
/// square. The correction z, orthogonal to the start, satisfies
/// `(gram - value - change) z = -(image - value start)`, `value = start . image`, `change = image . z`.
/// The matrix is the same in all steps, with the direction of the start stiffened, so that its smallest
/// eigenvalue is about the square of the second singular value. A second vector goes through the same
/// steps and finds that eigenvalue.
///
/// `None` when it is so small that the digits of z may not suffice, or when the iteration does not converge.
pub(super) fn correct<T: Real>(products: &[[T; N + 1]; N], start: &[T; N]) -> Option<Corrected<T>> {
    let mut gram = products.map(|[a, b, c, d, e, f, _]| [a, b, c, d, e, f]);
    let image = products.map(|[.., image]| image);
    let trace = trace(&gram);
    let value = dot(start, &image);
    let fill = trace * T::lit(1.0 / 6.0);
    for i in 0..N {
        let filled = start[i] * fill;
        gram[i][i] -= value;
        for j in i..N {
            gram[i][j] += filled * start[j];
        }
    }
    let inverse = factor(&mut gram, trace, T::zero())?;
    // The correction, and a vector that converges to the second singular vector.
    let base = start.map(|start| Lanes([start, T::zero()]));
    let slope: [Lanes<T>; N] =
        core::array::from_fn(|k| Lanes([start[k] * value - image[k], T::zero()]));
    let mut both = slope.map(|Lanes([slope, _])| Lanes([slope, T::one()]));
    solve(&gram, &inverse, &mut both);
    let mut last = T::zero();
    for _ in 0..MAX_STEPS {
        let before = both;
        let [change, movement] = step(&gram, &inverse, &base, &slope, &mut both);
        if stands(movement, last, rounding()) {
            let mut products = Lanes([T::zero(); 2]);
            for (before, after) in before.iter().zip(&both) {
                let after = after.0[1];
                products = products + Lanes([after * before.0[1], after * after]);
            }
            let Lanes([product, square]) = products;
            let second = product / square;
            let vector = unit(core::array::from_fn(|k| start[k] + both[k].0[0]));
            return (second > enough::<T>() * trace).then(|| Corrected {
                vector,
                singular_values: [
                    (value + change).max(T::zero()).sqrt(),
                    (second + value).sqrt(),
                ],
            });
        }
        last = movement;
    }
    None
}

/// Whether a vector has converged: its squared movement is at most `still`, or the next one will be, with a
/// margin, if it shrinks by the same ratio as from the last to this one.
#[inline(always)]
fn stands<T: Real>(movement: T, last: T, still: T) -> bool {
    movement <= still || movement * movement * T::lit(100.0) <= still * last
}

/// Squared movement that is only rounding, or far below any noise.
#[inline(always)]
fn rounding<T: Real>() -> T {
    (T::eps() * T::eps() * T::lit(64.0)).max(T::lit(1e-24))
}

/// One step of [`correct`]. Returns the change of the eigenvalue from that of the start, and the squared
/// movement of the correction.
///
/// Not inlined, for the same reason as [`add`].
#[inline(never)]
fn step<T: Real>(
    factor: &Symmetric<T>,
    inverse: &[T; N],
    base: &[Lanes<T>; N],
    slope: &[Lanes<T>; N],
    both: &mut [Lanes<T>; N],
) -> [T; 2] {
    let mut change = Lanes([T::zero(); 2]);
    for k in 0..N {
        change = change - slope[k] * both[k];
    }
    let [change, _] = change.0;
    let scale = Lanes([change, T::one()]);
    let mut next: [Lanes<T>; N] = core::array::from_fn(|k| slope[k] + (base[k] + both[k]) * scale);
    solve(factor, inverse, &mut next);
    let mut movement = Lanes([T::zero(); 2]);
    for k in 0..N {
        let apart = next[k] - both[k];
        movement = movement + apart * apart;
    }
    *both = next;
    [change, movement.0[0]]
}

/// Smallest eigenvalue over trace with which the digits suffice, about the cube root of the rounding: the
/// relative error of the correction is then 4e-11 in `f64` and 2e-5 in `f32`.
#[inline(always)]
fn enough<T: Real>() -> T {
    T::lit(if T::eps() > T::lit(1e-10) { 2e-3 } else { 6e-6 })
}

#[inline(always)]
fn trace<T: Real>(matrix: &Symmetric<T>) -> T {
    let mut sum = T::zero();
    for (k, row) in matrix.iter().enumerate() {
        sum += row[k];
    }
    sum
}

/// Replaces the upper triangle of G by that of U in `G = U^T D U`, U with a unit diagonal, and returns the
/// inverse of D. The last entry of D is raised to at least `least`.
///
/// `None` when an entry of D is too small.
#[inline(always)]
fn factor<T: Real>(matrix: &mut Symmetric<T>, trace: T, least: T) -> Option<[T; N]> {
    let bound = enough::<T>() * trace;
    let mut inverse = [T::zero(); N];
    for k in 0..N {
        let pivot = matrix[k][k];
        if k + 1 == N && least > T::zero() {
            inverse[k] = T::one() / pivot.max(least);
            break;
        }
        if !(pivot > bound) {
            return None;
        }
        inverse[k] = T::one() / pivot;
        let above = matrix[k];
        for i in k + 1..N {
            let share = above[i] * inverse[k];
            for j in i..N {
                matrix[i][j] -= share * above[j];
            }
            matrix[k][i] = share;
        }
    }
    Some(inverse)
}

/// Solves `U^T D U x = b` in place.
#[inline(always)]
fn solve<T: Real, V: Copy + Sub<Output = V> + Mul<T, Output = V>>(
    factor: &Symmetric<T>,
    inverse: &[T; N],
    x: &mut [V; N],
) {
    for i in 0..N {
        let value = x[i];
        for j in i + 1..N {
            x[j] = x[j] - value * factor[i][j];
        }
        x[i] = value * inverse[i];
    }
    back_substitute(factor, x);
}

/// Solves `U x = b` in place.
#[inline(always)]
fn back_substitute<T: Real, V: Copy + Sub<Output = V> + Mul<T, Output = V>>(
    factor: &Symmetric<T>,
    x: &mut [V; N],
) {
    for i in (0..N).rev() {
        let mut value = x[i];
        for j in i + 1..N {
            value = value - x[j] * factor[i][j];
        }
        x[i] = value;
    }
}

#[inline(always)]
fn dot<T: Real>(a: &[T; N], b: &[T; N]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (a, b)| sum + *a * *b)
}

#[inline(always)]
fn unit<T: Real>(vector: [T; N]) -> [T; N] {
    let scale = T::one() / dot(&vector, &vector).sqrt();
    vector.map(|value| value * scale)
}

/// The square of the distance between two unit vectors.
#[inline(always)]
fn moved<T: Real>(before: &[T; N], after: &[T; N]) -> T {
    let apart = core::array::from_fn(|k| after[k] - before[k]);
    dot(&apart, &apart)
}
