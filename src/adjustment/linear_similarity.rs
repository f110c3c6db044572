// SPDX-License-Identifier: MIT OR Apache-2.0
//! Similarities from linear equations.
//!
//! A similarity `M p + t` with `M = [c -d; d c]` is linear in `(c, d, t)`, and so is whatever says where a moved point is:
//! its place, one coordinate of it, or a line through it.

use super::decompose::singular_values;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use alloc::vec::Vec;
use nalgebra::{
    Complex, DMatrix, DVector, Point2, Similarity2, Translation2, UnitComplex, Vector2,
};

/// Unknowns of a similarity.
pub const UNKNOWNS: usize = 4;

/// Ratio of the singular values below which the equations leave a direction free. Not an option: it is far above
/// rounding.
const RANK: f64 = 1e-6;

/// Equations of the similarity that moves given points to where they should be.
#[derive(Default)]
pub struct LinearSimilarity {
    rows: Vec<([f64; UNKNOWNS], f64)>,
}

impl LinearSimilarity {
    /// Requires that the moved point lies on the line through `through` with this normal, whose length is the weight.
    pub fn add_line(&mut self, point: &Point2<f64>, normal: &Vector2<f64>, through: &Point2<f64>) {
        let turned = Vector2::new(-point.y, point.x);
        let row = [
            normal.dot(&point.coords),
            normal.dot(&turned),
            normal.x,
            normal.y,
        ];
        self.rows.push((row, normal.dot(&through.coords)));
    }

    /// Requires that the moved point is at a place.
    pub fn add_point(&mut self, point: &Point2<f64>, place: &Point2<f64>) {
        self.add_line(point, &Vector2::x(), place);
        self.add_line(point, &Vector2::y(), place);
    }

    /// Number of equations.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// The similarity with the least squares of all equations, with its rank: below four, directions that they leave free
    /// are zero. `None` when the scale comes out as zero.
    pub fn solve(&self) -> Option<(Similarity2<f64>, usize)> {
        let rows = &self.rows;
        let matrix = DMatrix::from_fn(rows.len(), UNKNOWNS, |row, column| rows[row].0[column]);
        let right = DVector::from_iterator(rows.len(), rows.iter().map(|row| row.1));
        let found = singular_values(&matrix)?;
        let bound = RANK * found.values[0];
        let rank = found.values.iter().filter(|&&value| value > bound).count();
        let mut solution = DVector::zeros(UNKNOWNS);
        for k in 0..rank {
            let along = found.left.column(k).dot(&right) / found.values[k];
            solution += found.right.column(k) * along;
        }
        let turn = Complex::new(solution[0], solution[1]);
        let scale = turn.norm_sqr().sqrt();
        (scale > 0.0 && scale.is_finite()).then(|| {
            let similarity = Similarity2::from_parts(
                Translation2::new(solution[2], solution[3]),
                UnitComplex::new_unchecked(turn / scale),
                scale,
            );
            (similarity, rank)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points and lines of an exact similarity give it back; what they leave free shows in the rank.
    #[test]
    fn exact_equations_give_the_similarity() {
        let truth = Similarity2::new(Vector2::new(5.0, -7.0), 2.0, 0.3);
        let points = [(1.0, 2.0), (-3.0, 0.5), (2.0, -4.0), (0.0, 1.0)];
        let points = points.map(|(x, y)| Point2::new(x, y));
        let line = |equations: &mut LinearSimilarity, k: usize, angle: f64| {
            let normal = Vector2::new(angle.cos(), angle.sin()) * (1.0 + k as f64);
            let along = Vector2::new(-normal.y, normal.x);
            equations.add_line(&points[k], &normal, &(truth * points[k] + along * 0.7));
        };
        // (points, lines, rank)
        for (whole, lines, rank) in [
            (2, 0, 4),
            (4, 0, 4),
            (1, 2, 4),
            (0, 4, 4),
            (1, 0, 2),
            (1, 1, 3),
        ] {
            let mut equations = LinearSimilarity::default();
            for point in &points[..whole] {
                equations.add_point(point, &(truth * point));
            }
            for k in 0..lines {
                line(&mut equations, 3 - k, 0.4 + 1.1 * k as f64);
            }
            assert_eq!(equations.count(), 2 * whole + lines);
            let (found, full) = equations.solve().unwrap();
            assert_eq!(full, rank, "{whole} {lines}");
            for point in &points[..if rank == 4 { 4 } else { whole }] {
                assert!(
                    (found * point - truth * point).norm() < 1e-9,
                    "{whole} {lines}"
                );
            }
        }
        let mut nowhere = LinearSimilarity::default();
        nowhere.add_point(&points[0], &Point2::origin());
        nowhere.add_point(&points[1], &Point2::origin());
        assert!(nowhere.solve().is_none());
        assert!(LinearSimilarity::default().solve().is_none());
    }
}
