// SPDX-License-Identifier: MIT OR Apache-2.0
//! The null vector of a 5x6 matrix.

use super::lanes::Lanes;
use crate::scalar::Real;
use nalgebra::Vector6;

/// Six numbers, in pairs.
type Row<T> = [Lanes<T>; 3];

/// The unit vector orthogonal to five rows of length about 1, and an upper bound of the smallest
/// singular value of the rows.
///
/// One Householder reflection per row turns it onto its own axis without changing the axes of the
/// earlier rows: `A = L Q`, L triangular, Q the product of the reflections. The reflections turn the last
/// axis into a vector orthogonal to all rows. If the rows are dependent it is one of many, and the bound
/// is only rounding.
///
/// The bound is the smaller of the smallest pivot and `1 / |y|`, where y solves `y^T L = e_5^T`. It is
/// tight where it is small, because y is then nearly the left singular vector.
pub(super) fn null_vector_5x6<T: Real>(rows: &[[T; 6]; 5]) -> (Vector6<T>, T) {
    let [r0, r1, r2, r3, r4] =
        rows.map(|[a, b, c, d, e, f]| [Lanes([a, b]), Lanes([c, d]), Lanes([e, f])]);
    let (v0, l00) = reflection::<T, 0>(&r0);
    let r1 = reflected(r1, &v0);
    let (v1, l11) = reflection::<T, 1>(&r1);
    let r2 = reflected(reflected(r2, &v0), &v1);
    let (v2, l22) = reflection::<T, 2>(&r2);
    let r3 = reflected(reflected(reflected(r3, &v0), &v1), &v2);
    let (v3, l33) = reflection::<T, 3>(&r3);
    let r4 = reflected(reflected(reflected(reflected(r4, &v0), &v1), &v2), &v3);
    let (v4, l44) = reflection::<T, 4>(&r4);

    let (zero, one) = (T::zero(), T::one());
    let last = [Lanes([zero; 2]), Lanes([zero; 2]), Lanes([zero, one])];
    let last = reflected(reflected(last, &v4), &v3);
    let last = reflected(reflected(reflected(last, &v2), &v1), &v0);

    let inverse = |pivot: T| {
        one / if pivot.abs() > T::eps() {
            pivot
        } else {
            T::eps()
        }
    };
    let ([[l10, _], ..], [[l20, l21], ..]) = (r1.map(|p| p.0), r2.map(|p| p.0));
    let ([[l30, l31], [l32, _], _], [[l40, l41], [l42, l43], _]) =
        (r3.map(|p| p.0), r4.map(|p| p.0));
    let y4 = inverse(l44);
    let y3 = -(y4 * l43) * inverse(l33);
    let y2 = -(y4 * l42 + y3 * l32) * inverse(l22);
    let y1 = -(y4 * l41 + y3 * l31 + y2 * l21) * inverse(l11);
    let y0 = -(y4 * l40 + y3 * l30 + y2 * l20 + y1 * l10) * inverse(l00);
    let mut bound = one / (y0 * y0 + y1 * y1 + y2 * y2 + y3 * y3 + y4 * y4).sqrt();
    for pivot in [l00, l11, l22, l33, l44] {
        if pivot.abs() < bound {
            bound = pivot.abs();
        }
    }
    let [Lanes([a, b]), Lanes([c, d]), Lanes([e, f])] = last;
    (Vector6::new(a, b, c, d, e, f), bound)
}

/// The vector v of the reflection `I - v v^T` that turns a row onto axis K without changing the axes
/// before it, and the resulting entry on the axis.
#[inline(always)]
fn reflection<T: Real, const K: usize>(row: &Row<T>) -> (Row<T>, T) {
    let mut vector = *row;
    let mut head = T::zero();
    for (k, lanes) in vector.iter_mut().enumerate() {
        for (side, value) in lanes.0.iter_mut().enumerate() {
            if 2 * k + side < K {
                *value = T::zero();
            }
            if 2 * k + side == K {
                head = *value;
            }
        }
    }
    let square = dot(&vector, &vector);
    let norm = square.sqrt();
    // NaN propagates into every number of the answer.
    let scale = if square == T::zero() {
        T::zero()
    } else {
        T::one() / (square + norm * head.abs()).sqrt()
    };
    let signed = if head > T::zero() { norm } else { -norm };
    for (k, lanes) in vector.iter_mut().enumerate() {
        for (side, value) in lanes.0.iter_mut().enumerate() {
            if 2 * k + side == K {
                *value += signed;
            }
        }
        *lanes = *lanes * scale;
    }
    (vector, -signed)
}

#[inline(always)]
fn reflected<T: Real>(row: Row<T>, vector: &Row<T>) -> Row<T> {
    let step = dot(&row, vector);
    let [a, b, c] = row;
    let [u, v, w] = vector;
    [a - *u * step, b - *v * step, c - *w * step]
}

#[inline(always)]
fn dot<T: Real>(a: &Row<T>, b: &Row<T>) -> T {
    let [x, y, z] = [a[0] * b[0], a[1] * b[1], a[2] * b[2]];
    let Lanes([even, odd]) = x + y + z;
    even + odd
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::triangular::TriangularFactor;
    use nalgebra::SMatrix;

    fn rows(seed: f64) -> [[f64; 6]; 5] {
        core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                ((seed + 12.9898 * i as f64 + 78.233 * j as f64).sin() * 43758.5453).rem_euclid(2.0)
                    - 1.0
            })
        })
    }

    fn factor(rows: &[[f64; 6]; 5]) -> TriangularFactor<f64, 6> {
        let mut factor = TriangularFactor::new();
        rows.iter().for_each(|row| factor.push(*row));
        factor
    }

    #[test]
    fn is_the_null_vector_of_the_triangular_factor() {
        for seed in 0..200 {
            let mut rows = rows(f64::from(seed));
            // Nearly dependent rows: the bound must be small as well.
            let share = [0.0, 0.9, 0.999, 1.0 - 1e-7][seed as usize % 4];
            rows[1] = core::array::from_fn(|j| share * rows[0][j] + (1.0 - share) * rows[1][j]);
            let (vector, bound) = null_vector_5x6(&rows);
            let null = factor(&rows).null_space();
            assert!((vector.norm() - 1.0).abs() < 1e-15);
            assert!((vector.dot(&null.vectors[0]).abs() - 1.0).abs() < 1e-15);
            for row in &rows {
                assert!(vector.dot(&Vector6::from_row_slice(row)).abs() < 2e-15);
            }
            let matrix = SMatrix::<f64, 5, 6>::from_fn(|i, j| rows[i][j]);
            let second = matrix.singular_values().min();
            assert!(bound > second - 1e-15, "{bound} {second}");
            assert!(bound < second * 10.0, "{bound} {second}");
        }
    }

    #[test]
    fn dependent_rows_have_no_bound() {
        for (from, to) in [(0, 1), (0, 4), (3, 4), (1, 2)] {
            let mut rows = rows(0.3);
            rows[to] = rows[from];
            assert!(null_vector_5x6(&rows).1 < 1e-14);
            rows[to] = [0.0; 6];
            assert!(null_vector_5x6(&rows).1 < 1e-14);
        }
        let mut rows = rows(0.3);
        rows[2][3] = f64::NAN;
        assert!(null_vector_5x6(&rows).0.iter().all(|value| value.is_nan()));
    }
}
