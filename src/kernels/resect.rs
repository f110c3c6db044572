// SPDX-License-Identifier: MIT OR Apache-2.0
//! A pose from bearings of known landmarks.

use super::triangular::TriangularFactor;
use crate::error::{Degeneracy, Error};
use crate::geometry::points::horizon;
use crate::geometry::{Bearing, Pose};
use crate::scalar::Real;
use nalgebra::{Complex, Point2, Translation2, UnitComplex};

/// Minimum number of landmarks that determine a view.
pub(crate) const MIN_LANDMARKS_OF_VIEW: usize = 3;

/// A pose and how its sightings agree with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resection<T: Real> {
    /// The pose.
    pub pose: Pose<T>,
    /// How many bearings point away from their landmark (cheirality).
    pub behind: usize,
    /// Root mean square of the sines of the angular errors.
    pub misfit: T,
    /// The same for the worst rotation of the map. If it is no larger than the misfit, the pose is
    /// undetermined: view and landmarks are on one circle.
    pub gap: T,
}

/// The pose from which three or more known landmarks are seen at the measured bearings.
///
/// With the position of a landmark as a complex number x, the bearing `a` from the pose `(p, theta)`
/// satisfies `Im(e^{-ia} (w x + tau)) = 0`, `w = e^{-i theta}`, `tau = -w p`, (T11): one linear row in
/// four unknowns. An orthogonal triangularisation eliminates tau and leaves a 2x2 problem for w of unit
/// length, solved in closed form; the sign is the one that puts most landmarks ahead. (The paper takes
/// the null vector of all four unknowns and scales it afterwards; with only w constrained to unit length
/// the answer does not depend on the origin.) The landmarks are centred and scaled first; rows are
/// divided by the ranges of a first solution.
///
/// `sightings` yields landmarks with their bearings; it is iterated several times.
///
/// # Errors
/// [`Error::TooFew`] for fewer than three landmarks; [`Error::NotFinite`] for a landmark or bearing that
/// is not finite (or whose square overflows); [`Error::Degenerate`] when all landmarks are in one place, in one
/// direction or so nearly that the view is beyond the horizon, or on one circle with the view.
///
/// # Example
/// ```
/// use bearslam::{bearing_to, pose, resect};
/// use nalgebra::Point2;
///
/// let truth = pose(1.0, 2.0, 0.5_f64);
/// let landmarks = [Point2::new(5.0, 0.0), Point2::new(4.0, 6.0), Point2::new(-3.0, 1.0)];
/// let sightings = landmarks.map(|landmark| (landmark, bearing_to(&truth, &landmark).unwrap()));
/// let found = resect(sightings)?;
/// assert!((found.pose.to_homogeneous() - truth.to_homogeneous()).norm() < 1e-13);
/// assert_eq!(found.behind, 0);
/// # Ok::<(), bearslam::Error>(())
/// ```
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 3.5 (the row there has lost two minus signs).
pub fn resect<T: Real, I>(sightings: I) -> Result<Resection<T>, Error>
where
    I: IntoIterator<Item = (Point2<T>, Bearing<T>), IntoIter: Clone>,
{
    let sightings = sightings
        .into_iter()
        .map(|(point, bearing)| (Complex::new(point.x, point.y), bearing.into_inner()));
    let mut count = 0_usize;
    let mut centre = Complex::new(T::zero(), T::zero());
    for (point, bearing) in sightings.clone() {
        centre += point;
        if !(centre.norm_sqr() + bearing.norm_sqr()).is_finite() {
            return Err(Error::NotFinite {
                what: "sightings of a view",
                index: count,
            });
        }
        count += 1;
    }
    if count < 3 {
        return Err(Error::TooFew {
            what: "landmarks of a view",
            needed: MIN_LANDMARKS_OF_VIEW,
            got: count,
        });
    }
    let number = T::lit(count as f64);
    centre /= number;
    let spread = (sightings.clone().fold(T::zero(), |sum, (point, _)| {
        sum + (point - centre).norm_sqr()
    }) / number)
        .sqrt();
    if !(spread > T::zero()) {
        return Err(Error::Degenerate {
            kind: Degeneracy::CoincidentLandmarks,
            value: spread.as_f64(),
            bound: 0.0,
        });
    }
    let scale = T::one() / spread;
    let normalized = sightings.map(|(point, bearing)| ((point - centre) * scale, bearing));

    let first = Line::estimate(normalized.clone(), |_| T::one())?;
    let line = Line::estimate(normalized.clone(), |point| {
        T::one() / (first.seen(point).norm_sqr() + T::eps()).sqrt()
    })?;
    let root = number.sqrt();
    let (misfit, gap) = (
        line.singular_values[0] / root,
        line.singular_values[1] / root,
    );
    let bound = T::eps() * T::lit(64.0);
    if !(gap > bound) {
        return Err(Error::Degenerate {
            kind: Degeneracy::AmbiguousResection,
            value: gap.as_f64(),
            bound: bound.as_f64(),
        });
    }
    let opposite = normalized
        .filter(|(point, bearing)| (bearing.conj() * line.seen(*point)).re < T::zero())
        .count();
    let (sign, behind) = if 2 * opposite > count {
        (-T::one(), count - opposite)
    } else {
        (T::one(), opposite)
    };
    let away = line.offset.norm_sqr().sqrt();
    if !(away <= horizon()) {
        return Err(Error::Degenerate {
            kind: Degeneracy::CommonDirection,
            value: (T::one() / away).as_f64(),
            bound: (T::one() / horizon::<T>()).as_f64(),
        });
    }
    let position = centre - line.offset * line.rotation.conj() * spread;
    Ok(Resection {
        pose: Pose::from_parts(
            Translation2::new(position.re, position.im),
            UnitComplex::new_unchecked(line.rotation.conj() * sign),
        ),
        behind,
        misfit,
        gap,
    })
}

/// A motion `x -> w x + tau` into the frame of the view, up to sign.
struct Line<T: Real> {
    rotation: Complex<T>,
    offset: Complex<T>,
    singular_values: [T; 2],
}

impl<T: Real> Line<T> {
    fn estimate(
        sightings: impl Iterator<Item = (Complex<T>, Complex<T>)>,
        weight: impl Fn(Complex<T>) -> T,
    ) -> Result<Self, Error> {
        let mut factor = TriangularFactor::<T, 4>::new();
        for (point, bearing) in sightings {
            let weight = weight(point);
            let (c, s) = (bearing.re * weight, bearing.im * weight);
            factor.push([
                -s,
                c,
                c * point.im - s * point.re,
                c * point.re + s * point.im,
            ]);
        }
        let [[a, b, p0, p1], [_, d, q0, q1], [_, _, e, f], [_, _, _, g]] = *factor.rows();
        let bound = T::eps() * T::lit(64.0);
        let smaller = a.abs().min(d.abs());
        if !(smaller > bound * a.abs().max(d.abs())) {
            return Err(Error::Degenerate {
                kind: Degeneracy::CommonDirection,
                value: smaller.as_f64(),
                bound: (bound * a.abs().max(d.abs())).as_f64(),
            });
        }
        // Right singular vectors of [[e, f], [0, g]]: a rotation by half the angle of `double`.
        let double = Complex::new(e * e - f * f - g * g, T::lit(2.0) * e * f);
        let length = double.norm_sqr().sqrt();
        let cosine = if length > T::zero() {
            double.re / length
        } else {
            T::one()
        };
        // Sine and cosine of half the angle, the smaller from the larger, so that neither loses digits near the axes.
        let half = T::lit(0.5);
        let large = ((T::one() + cosine.abs()) * half).sqrt();
        let small = if length > T::zero() {
            double.im * half / (length * large)
        } else {
            T::zero()
        };
        let (cos, sin) = if cosine >= T::zero() {
            (large, small)
        } else {
            (small, large)
        };
        // (cos, sin) is the direction that the matrix stretches most; w is orthogonal to it.
        let (w0, w1) = (-sin, cos);
        let norm = |x: T, y: T| (x * x + y * y).sqrt();
        let tau1 = -(q0 * w0 + q1 * w1) / d;
        let tau0 = -(p0 * w0 + p1 * w1 + b * tau1) / a;
        Ok(Self {
            rotation: Complex::new(w0, w1),
            offset: Complex::new(tau0, tau1),
            singular_values: [
                norm(e * w0 + f * w1, g * w1),
                norm(e * cos + f * sin, g * sin),
            ],
        })
    }

    fn seen(&self, point: Complex<T>) -> Complex<T> {
        self.rotation * point + self.offset
    }
}
