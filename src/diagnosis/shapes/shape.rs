// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lines, circles and single places: how far points are from the nearest one.

use crate::adjustment::decompose::symmetric_eigen;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use alloc::vec::Vec;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// A shape that points may have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// All in one place.
    Place,
    /// All on one line.
    Line,
    /// All on one circle.
    Circle,
}

/// A circle whose radius is more than this many extents of its points counts as a line: the arc deviates from its
/// chord by less than a fortieth of the extent. This defines what a circle is.
const FLATTEST: f64 = 20.0;

impl Shape {
    /// How many parameters are fitted to find the nearest shape.
    pub fn parameters(self) -> usize {
        match self {
            Self::Place | Self::Line => 2,
            Self::Circle => 3,
        }
    }

    /// The points projected onto the nearest shape; `None` when there is no such shape.
    pub fn project(self, points: &[Vector2<f64>]) -> Option<Vec<Vector2<f64>>> {
        let middle = centroid(points);
        match self {
            Self::Place => Some(points.iter().map(|_| middle).collect()),
            Self::Line => {
                let normal = across(line(points).1);
                let projected = points
                    .iter()
                    .map(|p| p - normal * normal.dot(&(p - middle)));
                Some(projected.collect())
            }
            Self::Circle => {
                let (centre, radius) = circle(points)?;
                let projected = points.iter().map(|p| {
                    let offset = p - centre;
                    centre + offset * (radius / offset.norm())
                });
                Some(projected.collect())
            }
        }
    }

    /// Signed distances of the points from the nearest shape; for a place one for each coordinate.
    pub fn distances(self, points: &[Vector2<f64>]) -> Option<Vec<f64>> {
        let middle = centroid(points);
        match self {
            Self::Place => {
                let each = points.iter().map(|p| p - middle);
                Some(each.flat_map(|d| [d.x, d.y]).collect())
            }
            Self::Line => {
                let normal = across(line(points).1);
                Some(points.iter().map(|p| normal.dot(&(p - middle))).collect())
            }
            Self::Circle => {
                let (centre, radius) = circle(points)?;
                let each = points.iter().map(|p| (p - centre).norm() - radius);
                Some(each.collect())
            }
        }
    }
}

fn centroid(points: &[Vector2<f64>]) -> Vector2<f64> {
    points.iter().fold(Vector2::zeros(), |sum, p| sum + p) / points.len().max(1) as f64
}

/// Root mean square distance from the middle.
pub fn extent(points: &[Vector2<f64>]) -> f64 {
    let middle = centroid(points);
    let squares: f64 = points.iter().map(|p| (p - middle).norm_squared()).sum();
    (squares / points.len().max(1) as f64).sqrt()
}

/// A point and the direction of the line of least squared distances.
pub fn line(points: &[Vector2<f64>]) -> (Vector2<f64>, Vector2<f64>) {
    let middle = centroid(points);
    let mut moments = Matrix2::zeros();
    for p in points {
        let d = p - middle;
        moments += d * d.transpose();
    }
    // The axis is at half the angle of the second moments, free of cancellation even on a perfect line.
    let twice = (2.0 * moments.m12).atan2(moments.m11 - moments.m22);
    let (sin, cos) = (0.5 * twice).sin_cos();
    (middle, Vector2::new(cos, sin))
}

fn across(direction: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-direction.y, direction.x)
}

/// Centre and radius of the circle nearest to the points: an algebraic fit, then two Gauss-Newton steps on
/// the distances. `None` when the points do not distinguish it from a line.
fn circle(points: &[Vector2<f64>]) -> Option<(Vector2<f64>, f64)> {
    let middle = centroid(points);
    let extent = extent(points);
    if !(extent > 0.0) || points.len() < 3 {
        return None;
    }
    let local: Vec<Vector2<f64>> = points.iter().map(|p| (p - middle) / extent).collect();
    // |p|^2 = 2 c p + (r^2 - |c|^2), linear in c and the bracket.
    let mut left = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for p in &local {
        let row = Vector3::new(2.0 * p.x, 2.0 * p.y, 1.0);
        left += row * row.transpose();
        right += row * p.norm_squared();
    }
    let found = symmetric_eigen(left)?;
    if !(found.eigenvalues.min() > f64::EPSILON * found.eigenvalues.max()) {
        return None;
    }
    let solution = left.try_inverse()? * right;
    let mut centre = Vector2::new(solution.x, solution.y);
    let mut radius = (solution.z + centre.norm_squared()).sqrt();
    for _ in 0..2 {
        let mut left = Matrix3::zeros();
        let mut right = Vector3::zeros();
        for p in &local {
            let offset = p - centre;
            let distance = offset.norm();
            if !(distance > 0.0) {
                return None;
            }
            let row = Vector3::new(offset.x / distance, offset.y / distance, 1.0);
            left += row * row.transpose();
            right += row * (distance - radius);
        }
        let step = left.try_inverse()? * right;
        centre += Vector2::new(step.x, step.y);
        radius += step.z;
    }
    (radius > 0.0 && radius < FLATTEST).then(|| (middle + centre * extent, radius * extent))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_circle(angle: f64) -> Vector2<f64> {
        Vector2::new(3.0 + 2.0 * angle.cos(), -1.0 + 2.0 * angle.sin())
    }

    #[test]
    fn points_of_a_shape_have_no_distance_from_it() {
        let circle: Vec<_> = [0.1, 0.9, 2.0, 2.2, 4.0].map(on_circle).into();
        let line: Vec<_> = [0.1, 0.9, 2.0, 2.2, 4.0]
            .map(|x| Vector2::new(x, 0.3 - 2.0 * x))
            .into();
        for (shape, points) in [(Shape::Circle, &circle), (Shape::Line, &line)] {
            let far = shape.distances(points).unwrap();
            assert!(far.iter().all(|d| d.abs() < 1e-14), "{far:?}");
            for (p, q) in points.iter().zip(shape.project(points).unwrap()) {
                assert!((p - q).norm() < 1e-14);
            }
        }
        // A line is not a circle.
        assert!(Shape::Circle.project(&line).is_none());
        assert!(Shape::Line.distances(&circle).unwrap()[0].abs() > 0.1);
    }

    #[test]
    fn snapped_points_share_the_shape() {
        let points: Vec<_> = (0..7)
            .map(|k| on_circle(f64::from(k)) * (1.0 + 0.02 * f64::from(k % 3)))
            .collect();
        for shape in [Shape::Place, Shape::Line, Shape::Circle] {
            let projected = shape.project(&points).unwrap();
            let far = shape.distances(&projected).unwrap();
            assert!(far.iter().all(|d| d.abs() < 1e-6), "{shape:?} {far:?}");
        }
    }
}
