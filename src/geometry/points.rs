// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sets of points: centroid, spread, extent.

#[cfg(not(feature = "std"))]
use crate::float::Float;
use nalgebra::Vector2;

/// The mean of some points.
pub fn centroid(points: &[Vector2<f64>]) -> Vector2<f64> {
    points.iter().fold(Vector2::zeros(), |sum, p| sum + p) / (points.len() as f64)
}

/// Sum of squared distances from the centroid.
pub fn spread(points: &[Vector2<f64>]) -> f64 {
    let centre = centroid(points);
    points
        .iter()
        .fold(0.0, |sum, p| sum + (p - centre).norm_squared())
}

/// The longer side of the box around some places.
pub fn extent(places: impl Iterator<Item = Vector2<f64>> + Clone) -> f64 {
    let Some(first) = places.clone().next() else {
        return 0.0;
    };
    let (low, high) = places.fold((first, first), |(low, high), place| {
        (low.inf(&place), high.sup(&place))
    });
    (high - low).amax()
}

/// Range, in extents of the views, that leaves half of the digits to tell directions: as good as infinity.
pub fn horizon() -> f64 {
    0.1 / f64::EPSILON.sqrt()
}
