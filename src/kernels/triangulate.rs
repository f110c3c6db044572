// SPDX-License-Identifier: MIT OR Apache-2.0
//! A landmark from bearings taken at known poses.

use super::triangular::TriangularFactor;
use crate::error::{Degeneracy, Error};
use crate::geometry::{Bearing, Pose};
use crate::scalar::Real;
use nalgebra::{Complex, Point2};

/// Minimum number of views that determine a landmark.
pub(crate) const MIN_VIEWS_OF_LANDMARK: usize = 2;

/// A landmark and how its sightings agree with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangulation<T: Real> {
    /// The landmark.
    pub point: Point2<T>,
    /// How many bearings point away from it (cheirality).
    pub behind: usize,
    /// Smaller over larger singular value of the rays' directions: the parallax, 0 for parallel
    /// rays, 1 for rays at right angles.
    pub parallax: T,
}

/// The point closest to two or more rays.
///
/// Least squares of the distances to the lines of sight, each divided by the range of a first
/// solution, so that the sine of the angular error is minimised. Rows are folded into a triangular factor
/// with the positions centred, so that neither the distance from the origin nor the number of views
/// costs digits.
///
/// `sightings` yields poses with the bearings measured there; it is iterated several times.
///
/// # Errors
/// [`Error::TooFew`] for fewer than two rays, [`Error::NotFinite`] for a pose or bearing that is not
/// finite (or whose square overflows), [`Error::Degenerate`] when the parallax is only rounding (parallel
/// rays, or two views along one line of sight).
///
/// # Example
/// ```
/// use bearslam::{Bearing, pose, triangulate};
/// let sightings = [
///     (pose(0.0, 0.0, 0.0), Bearing::new(45_f64.to_radians())),
///     (pose(2.0, 0.0, 0.0), Bearing::new(135_f64.to_radians())),
/// ];
/// let landmark = triangulate(sightings)?.point;
/// assert!((landmark.x - 1.0).abs() < 1e-15 && (landmark.y - 1.0).abs() < 1e-15);
/// # Ok::<(), bearslam::Error>(())
/// ```
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 3.4.
pub fn triangulate<T: Real, I>(sightings: I) -> Result<Triangulation<T>, Error>
where
    I: IntoIterator<Item = (Pose<T>, Bearing<T>), IntoIter: Clone>,
{
    let sightings = sightings.into_iter();
    meeting(sightings.map(|(pose, bearing)| LineOfSight::new(&pose, &bearing)))
}

/// Where a bearing is taken in the map, and its direction there.
#[derive(Clone, Copy)]
pub(crate) struct LineOfSight<T: Real> {
    position: Complex<T>,
    direction: Complex<T>,
}

impl<T: Real> LineOfSight<T> {
    /// The line of a bearing that is taken at a pose.
    #[inline]
    pub fn new(pose: &Pose<T>, bearing: &Bearing<T>) -> Self {
        Self {
            position: Complex::new(pose.translation.x, pose.translation.y),
            direction: pose.rotation.into_inner() * bearing.into_inner(),
        }
    }
}

/// [`triangulate`] from lines of sight, which a caller may have gathered: they are iterated several times.
///
/// # Errors
/// As [`triangulate`].
pub(crate) fn meeting<T: Real>(
    lines: impl Iterator<Item = LineOfSight<T>> + Clone,
) -> Result<Triangulation<T>, Error> {
    let mut count = 0_usize;
    let mut centre = Complex::new(T::zero(), T::zero());
    for line in lines.clone() {
        centre += line.position;
        if !(line.direction.norm_sqr() + centre.norm_sqr()).is_finite() {
            return Err(Error::NotFinite {
                what: "rays of a landmark",
                index: count,
            });
        }
        count += 1;
    }
    if count < 2 {
        return Err(Error::TooFew {
            what: "rays of a landmark",
            needed: MIN_VIEWS_OF_LANDMARK,
            got: count,
        });
    }
    centre /= T::lit(count as f64);
    let (first, _) = solve(lines.clone(), centre, |_| T::one())?;
    let (offset, parallax) = solve(lines.clone(), centre, |position| {
        let range = (first - position).norm_sqr().sqrt();
        if range > T::zero() {
            T::one() / range
        } else {
            T::one()
        }
    })?;
    let behind = lines
        .filter(|line| {
            let seen = line.direction.conj() * (offset - (line.position - centre));
            seen.re < T::zero()
        })
        .count();
    let point = offset + centre;
    Ok(Triangulation {
        point: Point2::new(point.re, point.im),
        behind,
        parallax,
    })
}

/// Weighted least squares of `cross(ray, x - position) = 0`, relative to `centre`, and the parallax.
fn solve<T: Real>(
    lines: impl Iterator<Item = LineOfSight<T>>,
    centre: Complex<T>,
    weight: impl Fn(Complex<T>) -> T,
) -> Result<(Complex<T>, T), Error> {
    let mut factor = TriangularFactor::<T, 3>::new();
    for LineOfSight {
        position,
        direction,
    } in lines
    {
        let position = position - centre;
        let weight = weight(position);
        let offset = direction.re * position.im - direction.im * position.re;
        factor.push([
            -direction.im * weight,
            direction.re * weight,
            offset * weight,
        ]);
    }
    let [[a, b, p], [_, d, q], _] = *factor.rows();
    // Singular values of [[a, b], [0, d]]: their product is |a d|, their squares add to the norm.
    let norm = a * a + b * b + d * d;
    let product = (a * d).abs();
    let sum = (norm + T::lit(2.0) * product).sqrt();
    let difference = (norm - T::lit(2.0) * product).max(T::zero()).sqrt();
    let larger = (sum + difference) * T::lit(0.5);
    let parallax = product / (larger * larger);
    let bound = T::eps() * T::lit(16.0);
    if !(parallax > bound) {
        return Err(Error::Degenerate {
            kind: Degeneracy::ParallelRays,
            value: parallax.as_f64(),
            bound: bound.as_f64(),
        });
    }
    let y = q / d;
    Ok((Complex::new((p - b * y) / a, y), parallax))
}
