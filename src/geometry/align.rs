// SPDX-License-Identifier: MIT OR Apache-2.0
//! The similarity that maps one set of points to another.

use crate::error::{Degeneracy, Error};
use crate::geometry::Pose;
use crate::scalar::Real;
use nalgebra::{Complex, Point2, Similarity2, Translation2, UnitComplex};

/// The similarity `target = s R source + t` with the least sum of squared distances.
///
/// In the plane Umeyama's problem is linear: with both sets centred and written as complex numbers,
/// `s e^{i angle} = sum(conj(source) target) / sum |source|^2`. No reflection is ever returned.
///
/// # Errors
/// [`Error::LengthMismatch`] for sets of different size, [`Error::TooFew`] for fewer than two points,
/// [`Error::NotFinite`] for a point that is not finite, [`Error::Degenerate`] when all points of a set are in
/// one place.
///
/// # Example
/// ```
/// use nalgebra::Point2;
/// let source = [Point2::new(0.0, 0.0), Point2::new(1.0, 0.0)];
/// let target = [Point2::new(2.0, 2.0), Point2::new(2.0, 5.0)];
/// let similarity = bearslam::align(&source, &target)?;
/// assert!((similarity.scaling() - 3.0_f64).abs() < 1e-15);
/// # Ok::<(), bearslam::Error>(())
/// ```
///
/// # Reference
/// S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
/// PAMI 13(4), 1991, equations (40) to (42).
pub fn align<T: Real>(source: &[Point2<T>], target: &[Point2<T>]) -> Result<Similarity2<T>, Error> {
    if source.len() != target.len() {
        return Err(Error::LengthMismatch {
            what: "target",
            expected: source.len(),
            got: target.len(),
        });
    }
    if source.len() < 2 {
        return Err(Error::TooFew {
            what: "points to align",
            needed: 2,
            got: source.len(),
        });
    }
    let (from, to) = (centroid(source), centroid(target));
    let is_finite = |p: &Point2<T>| p.x.is_finite() && p.y.is_finite();
    for (what, points, mean) in [("source", source, from), ("target", target, to)] {
        // A point that is not finite makes the mean so as well, but the mean of finite points may overflow: only
        // then check each point.
        if !is_finite(&mean)
            && let Some(index) = points.iter().position(|p| !is_finite(p))
        {
            return Err(Error::NotFinite { what, index });
        }
    }
    let mut cross = Complex::new(T::zero(), T::zero());
    let (mut spread, mut spread_to) = (T::zero(), T::zero());
    for (s, t) in source.iter().zip(target) {
        let s = Complex::new(s.x - from.x, s.y - from.y);
        let t = Complex::new(t.x - to.x, t.y - to.y);
        cross += s.conj() * t;
        spread += s.norm_sqr();
        spread_to += t.norm_sqr();
    }
    let length = cross.norm_sqr().sqrt();
    let bound = T::eps() * (spread * spread_to).sqrt();
    let scale = length / spread;
    if !(length > bound && scale > T::zero() && scale.is_finite()) {
        return Err(Error::Degenerate {
            kind: Degeneracy::UncorrelatedPoints,
            value: length.as_f64(),
            bound: bound.as_f64(),
        });
    }
    let rotation = UnitComplex::new_unchecked(cross / length);
    let moved = rotation * from.coords * scale;
    Ok(Similarity2::from_parts(
        Translation2::from(to.coords - moved),
        rotation,
        scale,
    ))
}

/// The pose after transforming the plane by a similarity.
pub fn transform_pose<T: Real>(similarity: &Similarity2<T>, pose: &Pose<T>) -> Pose<T> {
    let position = similarity.transform_point(&pose.translation.vector.into());
    Pose::from_parts(
        Translation2::from(position.coords),
        similarity.isometry.rotation * pose.rotation,
    )
}

/// The mean, summed by coordinate: a vector as the running sum would be packed in a register and unpacked for
/// each point.
fn centroid<T: Real>(points: &[Point2<T>]) -> Point2<T> {
    let (mut x, mut y) = (T::zero(), T::zero());
    for point in points {
        x += point.x;
        y += point.y;
    }
    let count = T::lit(points.len() as f64);
    Point2::new(x / count, y / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn recovers_a_known_similarity() {
        let truth = Similarity2::new(Vector2::new(3.0, -1.0), 0.7, 2.5);
        let source = [
            Point2::new(0.3, 0.1),
            Point2::new(-1.0, 2.0),
            Point2::new(4.0, 1.0),
        ];
        let target = source.map(|p| truth.transform_point(&p));
        let found = align(&source, &target).unwrap();
        assert!((found.to_homogeneous() - truth.to_homogeneous()).norm() < 1e-14);
        let pose = Pose::new(Vector2::new(1.0, 1.0), 3.0);
        let angle = transform_pose(&found, &pose).rotation.angle();
        assert!((angle - (3.7 - core::f64::consts::TAU)).abs() < 1e-14);
    }

    #[test]
    fn one_place_is_degenerate() {
        let place = [Point2::new(1.0, 1.0); 3];
        let other = [
            Point2::new(1.0, 1.0),
            Point2::new(2.0, 1.0),
            Point2::new(1.0, 5.0),
        ];
        assert!(matches!(
            align(&place, &other),
            Err(Error::Degenerate { .. })
        ));
        assert!(matches!(
            align(&other, &place),
            Err(Error::Degenerate { .. })
        ));
        assert!(matches!(
            align(&other[..1], &place[..1]),
            Err(Error::TooFew { .. })
        ));
    }
}
