// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cells that cover an ellipsoid.

#[cfg(not(feature = "std"))]
use crate::float::Float;
use alloc::vec::Vec;

/// Centres of the cells of a grid that meet the ellipsoid with these semi-axes, along the coordinate axes: together they
/// cover it. Each semi-axis is divided evenly into intervals no longer than `width`. `None` for more than `most` cells.
pub fn cover<const N: usize>(
    semi_axes: &[f64; N],
    width: f64,
    most: usize,
) -> Option<Vec<[f64; N]>> {
    let mut intervals = [0; N];
    for (count, semi_axis) in intervals.iter_mut().zip(semi_axes) {
        let needed = (2.0 * semi_axis / width).ceil();
        // All intervals of one axis meet the ellipsoid.
        if !(width > 0.0 && needed <= most as f64) {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most `most`"
        )]
        let needed = needed as usize;
        *count = needed.max(1);
    }
    let mut grid = Grid {
        semi_axes,
        intervals,
        most,
        centres: Vec::new(),
    };
    grid.add(0, [0.0; N], 1.0).then_some(grid.centres)
}

/// A grid over the box around an ellipsoid.
struct Grid<'a, const N: usize> {
    semi_axes: &'a [f64; N],
    intervals: [usize; N],
    most: usize,
    centres: Vec<[f64; N]>,
}

impl<const N: usize> Grid<'_, N> {
    /// Adds the cells whose first coordinates are given; `left` of the square of the unit ball is left for the others.
    /// `false` when there are too many.
    fn add(&mut self, axis: usize, mut centre: [f64; N], left: f64) -> bool {
        if axis == N {
            self.centres.push(centre);
            return self.centres.len() <= self.most;
        }
        let half = 1.0 / self.intervals[axis] as f64;
        (0..self.intervals[axis]).all(|k| {
            // In units of the semi-axis, as is the coordinate of the cell that is nearest to the centre.
            let middle = (2 * k + 1) as f64 * half - 1.0;
            let nearest = (middle.abs() - half).max(0.0);
            let left = left - nearest * nearest;
            centre[axis] = middle * self.semi_axes[axis];
            left < 0.0 || self.add(axis + 1, centre, left)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudo-random numbers in (-1, 1).
    fn number(seed: usize) -> f64 {
        ((seed as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(2.0) - 1.0
    }

    /// Every point of the ellipsoid is in a cell, and no cell is outside it.
    #[test]
    fn cells_cover_the_ellipsoid() {
        let semi_axes = [0.31, 0.17, 0.04, 0.11];
        let counts = [11, 6, 2, 4];
        let cells = cover(&semi_axes, 0.06, 10_000).unwrap();
        let halves: [f64; 4] = core::array::from_fn(|k| semi_axes[k] / f64::from(counts[k]));
        let mut inside = 0;
        for trial in 0..20_000 {
            let unit: [f64; 4] = core::array::from_fn(|k| number(4 * trial + k));
            if unit.iter().map(|x| x * x).sum::<f64>() > 1.0 {
                continue;
            }
            inside += 1;
            let covers = |cell: &[f64; 4]| {
                (0..4).all(|k| (unit[k] * semi_axes[k] - cell[k]).abs() <= halves[k] * 1.000_001)
            };
            assert!(cells.iter().any(covers), "{unit:?}");
        }
        assert!(inside > 5000);
        for cell in &cells {
            let nearest =
                (0..4).map(|k| ((cell[k].abs() - halves[k]).max(0.0) / semi_axes[k]).powi(2));
            assert!(nearest.sum::<f64>() <= 1.0 + 1e-12);
        }
        // Fewer than those of the box around it.
        let all = counts.iter().product::<i32>() as usize;
        assert!(
            cells.len() < all && 2 * cells.len() > all,
            "{}",
            cells.len()
        );
    }

    #[test]
    fn too_many_cells_are_none() {
        assert_eq!(cover(&[0.01, 0.02], 0.1, 1), Some(Vec::from([[0.0, 0.0]])));
        // 0.2 in intervals of 0.1.
        let two = cover(&[0.1], 0.1, 2).unwrap();
        assert!((two[0][0] + 0.05).abs() < 1e-15 && (two[1][0] - 0.05).abs() < 1e-15);
        assert_eq!(cover(&[0.1], 0.1, 1), None);
        // A disc of 10 x 10.
        let all = cover(&[0.5, 0.5], 0.1, 100).unwrap().len();
        assert!(all < 100 && cover(&[0.5, 0.5], 0.1, all).is_some());
        assert_eq!(cover(&[0.5, 0.5], 0.1, all - 1), None);
        for width in [0.0, f64::NAN, -1.0] {
            assert_eq!(cover(&[0.5, 0.0], width, 100), None);
        }
        assert_eq!(cover(&[f64::NAN], 0.1, 100), None);
        assert_eq!(cover(&[0.0], 0.1, 1), Some(Vec::from([[0.0]])));
        assert_eq!(cover(&[0.0], 0.1, 0), None);
    }
}
