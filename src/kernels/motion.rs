// SPDX-License-Identifier: MIT OR Apache-2.0
//! Relative motion of three views, and the signs of the bearings that settle it.

use super::Triple;
use crate::geometry::{Pose, signed_angle};
use crate::scalar::Real;
use nalgebra::{Complex, Point2, Translation2, UnitComplex};

/// Three poses that explain the bearings of three views, and how well.
///
/// Gauge: view 0 at the origin with heading 0, unit baseline between views 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T: Real> {
    /// The poses of views 0, 1 and 2.
    pub poses: [Pose<T>; 3],
    /// How many sightings point away from their landmark, after the heading of every view has been
    /// settled by the majority of its sightings.
    pub inconsistent: usize,
    /// Half the sum of squared bearing residuals \[rad^2\] of all sightings at the landmarks of
    /// [`Motion::landmark`]; a sighting that points away counts with nearly pi.
    pub cost: T,
}

/// Three headings, each known modulo pi, and three positions, known up to a common sign.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineMotion<T: Real> {
    /// `e^{i theta}` of each view.
    pub headings: [Complex<T>; 3],
    /// Positions as complex numbers; the first is 0.
    pub positions: [Complex<T>; 3],
}

impl<T: Real> LineMotion<T> {
    /// Settles every pi by the signs of the bearings.
    ///
    /// (T8): turning a view by pi turns round the signs of all its sightings, so the majority of its
    /// sightings decides; turning all three is turning the map.
    pub fn settle(&self, triples: &[Triple<T>]) -> Motion<T> {
        // Per view the sightings that point at their landmark and those that point away: number, sum
        // and sum of squares of the angles by which they miss the line.
        let mut tallies = [[Tally::default(); 2]; 3];
        for triple in triples {
            let rays = self.rays(triple);
            let Some(point) = meet(&rays, &self.positions) else {
                continue;
            };
            for view in 0..3 {
                let seen = rays[view].conj() * (point - self.positions[view]);
                let angle = signed_angle(seen.re.abs(), seen.im).abs();
                tallies[view][usize::from(seen.re < T::zero())].add(angle);
            }
        }
        let turned = tallies.map(|[at, away]| away.count > at.count);
        let mut cost = T::zero();
        let mut inconsistent = 0;
        for view in 0..3 {
            let [at, away] = if turned[view] {
                [tallies[view][1], tallies[view][0]]
            } else {
                tallies[view]
            };
            cost += at.squares + away.squares_from_behind();
            inconsistent += away.count;
        }
        let map_sign = if turned[0] { -T::one() } else { T::one() };
        let scale = map_sign / self.positions[1].norm_sqr().sqrt();
        let poses = core::array::from_fn(|view| {
            let sign = if turned[view] == turned[0] {
                T::one()
            } else {
                -T::one()
            };
            let position = self.positions[view] * scale;
            Pose::from_parts(
                Translation2::new(position.re, position.im),
                UnitComplex::new_unchecked(self.headings[view] * sign),
            )
        });
        Motion {
            poses,
            inconsistent,
            cost: cost * T::lit(0.5),
        }
    }

    fn rays(&self, triple: &Triple<T>) -> [Complex<T>; 3] {
        core::array::from_fn(|view| self.headings[view] * triple[view].into_inner())
    }
}

/// Sightings of one view with one sign.
#[derive(Clone, Copy)]
struct Tally<T: Real> {
    count: usize,
    sum: T,
    squares: T,
}

impl<T: Real> Default for Tally<T> {
    fn default() -> Self {
        Self {
            count: 0,
            sum: T::zero(),
            squares: T::zero(),
        }
    }
}

impl<T: Real> Tally<T> {
    #[inline]
    fn add(&mut self, angle: T) {
        self.count += 1;
        self.sum += angle;
        self.squares += angle * angle;
    }

    /// Sum of squares of pi less the angles.
    fn squares_from_behind(&self) -> T {
        let count = T::lit(self.count as f64);
        (T::pi() * count - T::lit(2.0) * self.sum) * T::pi() + self.squares
    }
}

impl<T: Real> Motion<T> {
    /// The landmark where three rays meet best: the least sum of squared distances to the three
    /// lines.
    ///
    /// `None` when the three rays are parallel.
    pub fn landmark(&self, triple: &Triple<T>) -> Option<Point2<T>> {
        let rays =
            core::array::from_fn(|view| (self.poses[view].rotation * triple[view]).into_inner());
        let positions = self
            .poses
            .map(|pose| Complex::new(pose.translation.x, pose.translation.y));
        meet(&rays, &positions).map(|point| Point2::new(point.re, point.im))
    }
}

/// The point with the least sum of squared distances to three lines.
///
/// By Jacobi's formula, (T10), it is the mean of the three pairwise intersections weighted with their
/// squared determinants: a sum of squares, so no digit is lost to cancellation as it is in normal
/// equations.
#[inline]
fn meet<T: Real>(rays: &[Complex<T>; 3], positions: &[Complex<T>; 3]) -> Option<Complex<T>> {
    let offsets: [T; 3] = core::array::from_fn(|k| cross(rays[k], positions[k]));
    let mut sum = Complex::new(T::zero(), T::zero());
    let mut weight = T::zero();
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let determinant = cross(rays[i], rays[j]);
        sum += (rays[j] * offsets[i] - rays[i] * offsets[j]) * determinant;
        weight += determinant * determinant;
    }
    (weight > T::eps() * T::eps()).then(|| sum * (T::one() / weight))
}

#[inline]
fn cross<T: Real>(a: Complex<T>, b: Complex<T>) -> T {
    a.re * b.im - a.im * b.re
}
