// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sets of points: centroid, spread, extent, horizon.

use crate::error::{Degeneracy, Error};
use crate::scalar::Real;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use nalgebra::Vector2;

/// The mean of some points.
#[cfg(feature = "alloc")]
pub fn centroid(points: &[Vector2<f64>]) -> Vector2<f64> {
    points.iter().fold(Vector2::zeros(), |sum, p| sum + p) / (points.len() as f64)
}

/// The median, the mean of the middle two of an even number; NaN of none.
#[cfg(feature = "alloc")]
pub fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let (half, is_odd) = (values.len() / 2, values.len() % 2 == 1);
    let (below, &mut upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let lower = below.iter().copied().max_by(f64::total_cmp);
    if is_odd {
        upper
    } else {
        lower.map_or(upper, |lower| (lower + upper) * 0.5)
    }
}

/// The median of each coordinate: unlike the centroid it stays where most points are.
#[cfg(feature = "alloc")]
pub fn middle(points: &[Vector2<f64>]) -> Vector2<f64> {
    let along = |axis: usize| median(points.iter().map(|point| point[axis]).collect());
    Vector2::new(along(0), along(1))
}

/// Sum of squared distances from the centroid.
#[cfg(feature = "alloc")]
pub fn spread(points: &[Vector2<f64>]) -> f64 {
    let centre = centroid(points);
    points
        .iter()
        .fold(0.0, |sum, p| sum + (p - centre).norm_squared())
}

/// The longer side of the bounding box of some positions.
pub fn extent<T: Real>(mut places: impl Iterator<Item = Vector2<T>>) -> T {
    let Some(first) = places.next() else {
        return T::zero();
    };
    let (low, high) = places.fold((first, first), |(low, high), place| {
        (low.inf(&place), high.sup(&place))
    });
    (high - low).amax()
}

/// The extent of the views of a start (of all positions, if the views are in one place), rounded to a power of
/// two, so that scaling by it is exact.
///
/// # Errors
/// [`Error::NotFinite`] for a position that is not finite, with its index, views first; [`Error::Degenerate`]
/// when everything is in one place.
pub fn unit<T: Real>(
    views: impl Iterator<Item = Vector2<T>> + Clone,
    landmarks: impl Iterator<Item = Vector2<T>> + Clone,
) -> Result<T, Error> {
    let all = views.clone().chain(landmarks);
    let finite = |place: Vector2<T>| place.x.is_finite() && place.y.is_finite();
    if let Some(index) = all.clone().position(|place| !finite(place)) {
        return Err(Error::NotFinite {
            what: "positions of the start",
            index,
        });
    }
    let power = |size: T| T::lit(2.0).powf(size.log2().round());
    let usable = |size: &T| {
        let unit = power(*size);
        let square = unit * unit;
        *size > T::zero() && square.is_finite() && (T::one() / square).is_finite()
    };
    let whole = extent(all);
    match [extent(views), whole].into_iter().find(usable) {
        Some(size) => Ok(power(size)),
        None => Err(Error::Degenerate {
            kind: Degeneracy::CoincidentStart,
            value: whole.as_f64(),
            bound: 0.0,
        }),
    }
}

/// Range, in extents of the views, at which half of the digits are left for directions: as good as infinity.
pub fn horizon<T: Real>() -> T {
    T::lit(0.1) / T::eps().sqrt()
}

/// Moves a position beyond the horizon around `home`, which is indistinguishable from infinity, back to the
/// horizon.
pub fn within_horizon<T: Real>(place: Vector2<T>, home: &Vector2<T>) -> Vector2<T> {
    let offset = place - home;
    if offset.amax() > horizon() {
        home + (offset / offset.amax()).normalize() * horizon::<T>()
    } else {
        place
    }
}
