// SPDX-License-Identifier: MIT OR Apache-2.0
//! The normal equations of one pose (3x3) or one landmark (2x2), factorised on the stack.

#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::ZERO_PIVOT_EPS;

/// An eliminated block: its damped normal matrix, factorised, and its gradient.
#[derive(Clone, Copy)]
pub struct EliminatedBlock<const E: usize> {
    /// Its Cholesky factor L, diagonal inverted.
    factor: [[f64; E]; E],
    /// `L^-1` times its gradient.
    pub residual: [f64; E],
}

impl<const E: usize> EliminatedBlock<E> {
    /// The block of some sightings, given the derivative and residual of each; `None` when it is not finite.
    #[inline]
    pub fn of_rows(rows: impl Iterator<Item = ([f64; E], f64)>, damping: f64) -> Option<Self> {
        let mut hessian = [[0.0; E]; E];
        let mut gradient = [0.0; E];
        for (row, residual) in rows {
            for i in 0..E {
                gradient[i] += row[i] * residual;
                for j in 0..=i {
                    hessian[i][j] += row[i] * row[j];
                }
            }
        }
        let mut block = Self::new(&hessian, damping)?;
        block.residual = block.forward(gradient);
        Some(block)
    }

    /// Factor of `matrix` (lower triangle) with its diagonal multiplied by `1 + damping`.
    ///
    /// A pivot that is only rounding belongs to a direction that no sighting determines, such as the range of a
    /// landmark at infinity. Its entry in the factor is set to zero, so that the direction gets no step and the
    /// others are solved for as if it did not exist. `None` for a matrix that is not finite.
    fn new(matrix: &[[f64; E]; E], damping: f64) -> Option<Self> {
        let mut factor = *matrix;
        for i in 0..E {
            factor[i][i] *= 1.0 + damping;
            let rounding = factor[i][i] * f64::EPSILON * ZERO_PIVOT_EPS;
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
            factor[i][i] = if factor[i][i] > rounding {
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
    pub fn forward(&self, mut x: [f64; E]) -> [f64; E] {
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
    pub fn backward(&self, mut x: [f64; E]) -> [f64; E] {
        for i in (0..E).rev() {
            x[i] *= self.factor[i][i];
            for j in 0..i {
                let product = self.factor[i][j] * x[i];
                x[j] -= product;
            }
        }
        x
    }

    /// The variance of the first two parameters together, those of other blocks held fixed, for residuals of unit
    /// variance; infinite when a direction of the block is free. Needs a block without damping.
    pub fn position_variance(&self) -> f64 {
        // A zero in the factor marks a free direction, not a known one.
        if (0..E).any(|i| self.factor[i][i] <= 0.0) {
            return f64::INFINITY;
        }
        let mut variance = 0.0;
        for i in 0..E.min(2) {
            let mut unit = [0.0; E];
            unit[i] = 1.0;
            let column = self.forward(unit);
            variance += dot(&column, &column);
        }
        variance
    }
}

/// Inner product.
#[inline]
pub fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + *a * *b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pivot of a few roundings of its diagonal is a free direction, which gets no step; the variance of
    /// what it moves is infinite.
    #[test]
    fn pivots_of_rounding_are_free_directions() {
        // The second pivot is the square of the last entry, without any rounding.
        for (root, free) in [(2.0_f64.powi(-26), true), (2.0_f64.powi(-24), false)] {
            let rows = [([1.0, 1.0], 0.0), ([0.0, root], 1.0)];
            let block = EliminatedBlock::of_rows(rows.into_iter(), 0.0).unwrap();
            let step = block.backward(block.forward([1.0, 0.0]));
            assert_eq!(step[1] == 0.0, free, "{root:e} {step:?}");
            assert_eq!(block.position_variance() == f64::INFINITY, free);
        }
        let bad = EliminatedBlock::of_rows([([f64::NAN, 1.0], 0.0)].into_iter(), 0.0);
        assert!(bad.is_none());
    }

    /// Forward and backward substitution solve the damped equations.
    #[test]
    fn blocks_solve_their_equations() {
        let rows = [
            ([1.0, 2.0, -1.0], 0.3),
            ([0.5, -1.0, 2.0], -0.2),
            ([2.0, 0.1, 0.7], 1.1),
            ([0.0, 1.0, 1.0], 0.5),
        ];
        for damping in [0.0, 0.4] {
            let block = EliminatedBlock::of_rows(rows.into_iter(), damping).unwrap();
            let side = [0.7, -1.3, 0.4];
            let found = block.backward(block.forward(side));
            let gradient: [f64; 3] =
                core::array::from_fn(|i| rows.iter().map(|(row, r)| row[i] * r).sum());
            assert_eq!(block.residual, block.forward(gradient));
            for i in 0..3 {
                let entry = |j: usize| rows.iter().map(|(row, _)| row[i] * row[j]).sum::<f64>();
                let product: f64 = (0..3).map(|j| entry(j) * found[j]).sum();
                let product = product + damping * entry(i) * found[i];
                assert!((product - side[i]).abs() < 1e-12, "{i}");
            }
        }
        let block = EliminatedBlock::of_rows(rows.into_iter(), 0.0).unwrap();
        let unit = |k: usize| core::array::from_fn(|i| f64::from(u8::from(i == k)));
        let variance = |k: usize| block.backward(block.forward(unit(k)))[k];
        let both = variance(0) + variance(1);
        assert!((block.position_variance() / both - 1.0).abs() < 1e-12);
    }
}
