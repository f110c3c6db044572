// SPDX-License-Identifier: MIT OR Apache-2.0
//! Relative motion of three views, and the signs of the bearings that settle it.

use super::Triple;
use super::pair::{ComplexPair, Pair};
use crate::geometry::{Bearing, Pose, signed_angle};
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

/// Headings of views 1 and 2, each known modulo pi, and their positions, known up to a common sign;
/// view 0 is at the origin with heading 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineMotion<T: Real> {
    /// `e^{i theta}` of each view.
    pub headings: [Complex<T>; 2],
    /// Positions as complex numbers.
    pub positions: [Complex<T>; 2],
}

/// Settles every pi of two motions by the signs of the bearings; each landmark goes to `place`, as
/// both motions have it before they are turned and scaled.
///
/// (T8): turning a view by pi turns round the signs of all its sightings, so the majority of its
/// sightings decides; turning all three is turning the map.
///
/// Both motions go through the same operations in step.
pub(super) fn settle<T: Real>(
    lines: &[LineMotion<T>; 2],
    triples: &[Triple<T>],
    mut place: impl FnMut(usize, [Option<Complex<T>>; 2]),
) -> [Settled<T>; 2] {
    let [one, other] = lines;
    let headings: [_; 2] =
        core::array::from_fn(|k| ComplexPair::new([one.headings[k], other.headings[k]]));
    let positions: [_; 2] =
        core::array::from_fn(|k| ComplexPair::new([one.positions[k], other.positions[k]]));
    let mut tallies = [Tally::new(); 3];
    let mut unmet = [0_usize; 2];
    for (index, [u, v, w]) in triples.iter().enumerate() {
        let rays = [
            ComplexPair::new([u.into_inner(); 2]),
            headings[0].turned(v.into_inner()),
            headings[1].turned(w.into_inner()),
        ];
        let offsets = [rays[1].cross(positions[0]), rays[2].cross(positions[1])];
        let across = [
            rays[1].cross(rays[2]),
            rays[2].cross(rays[0]),
            rays[0].cross(rays[1]),
        ];
        // The point as in `meet`, times the weight.
        let weight = across[0] * across[0] + across[1] * across[1] + across[2] * across[2];
        let point = rays[0].scaled(offsets[1] * across[1] - offsets[0] * across[2])
            + rays[2].scaled(offsets[0] * across[0])
            - rays[1].scaled(offsets[1] * across[0]);
        let ahead = [
            rays[0].dot(point),
            rays[1].dot(point - positions[0].scaled(weight)),
            rays[2].dot(point - positions[1].scaled(weight)),
        ];
        // (T10a): one difference of nearly equal numbers instead of three.
        let apart = offsets[0] * across[1] + offsets[1] * across[2];
        let beside = across.map(|across| across * apart);
        let ratios: [Pair<T>; 3] = core::array::from_fn(|view| {
            let ratio = beside[view].zip(ahead[view], |beside, ahead| beside / ahead);
            ratio * ratio
        });
        let share = weight.map(|weight| T::one() / weight);
        let point = point.scaled(share).parts();
        let Pair([one, other]) = ratios[0] + ratios[1] + ratios[2];
        // Each weight is at most 3.
        if one + other <= T::lit(SMALL) && weight.0[0] * weight.0[1] > T::lit(3.0) * parallel() {
            for ((tally, ratio), ahead) in tallies.iter_mut().zip(ratios).zip(ahead) {
                tally.add(ratio.map(squared_arctangent), ahead);
            }
            place(index, point.map(Some));
        } else {
            let meets = weight.0.map(|weight| weight > parallel());
            let here = tallies.iter_mut().zip(beside).zip(ahead);
            here.for_each(|((tally, beside), ahead)| tally.add_far(beside, ahead, meets));
            for k in 0..2 {
                unmet[k] += usize::from(!meets[k]);
            }
            let [one, other] = point;
            place(index, [meets[0].then_some(one), meets[1].then_some(other)]);
        }
    }
    core::array::from_fn(|k| {
        lines[k].turned(triples.len() - unmet[k], &tallies.map(|tally| tally.of(k)))
    })
}

/// Sum of squared determinants of three lines up to which they count as parallel.
#[inline(always)]
fn parallel<T: Real>() -> T {
    T::eps() * T::eps()
}

/// Largest squared tangent for which [`squared_arctangent`] holds.
const SMALL: f64 = 1.0 / 324.0;

/// The square of the arctangent of a small number, from the square of that number.
///
/// The polynomial of degree 4 that meets `arctan(sqrt q)^2 / q` in the five Chebyshev points of
/// 0 to [`SMALL`]: wrong by at most 2.3e-16 of the whole. Where fewer than ten digits are kept, degree 2 and
/// 3.8e-10.
#[inline(always)]
fn squared_arctangent<T: Real>(q: T) -> T {
    let sum = if T::eps() > T::lit(1e-10) {
        let sum = T::lit(0.509_176_806_272_783_7) * q - T::lit(0.666_664_429_769_089_9);
        sum * q + T::lit(0.999_999_999_616_500_2)
    } else {
        let mut sum = T::lit(0.355_055_691_480_551_66);
        for coefficient in [
            -0.419_041_134_324_371_57,
            0.511_111_103_967_614_6,
            -0.666_666_666_663_911_5,
            0.999_999_999_999_999_8,
        ] {
            sum = sum * q + T::lit(coefficient);
        }
        sum
    };
    sum * q
}

/// A motion with every view turned as most of its sightings want.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settled<T: Real> {
    pub motion: Motion<T>,
    /// What the landmarks of the motion modulo pi are to be multiplied with.
    pub scale: T,
}

impl<T: Real> LineMotion<T> {
    /// The motion with every view turned as most of its sightings want; `met` landmarks have a place.
    fn turned(&self, met: usize, tallies: &[[T; 4]; 3]) -> Settled<T> {
        let met = T::lit(met as f64);
        let turned = tallies.map(|[away, ..]| away > met - away);
        let mut cost = T::zero();
        let mut inconsistent = T::zero();
        for (turned, [away, squares, sum, sum_away]) in turned.iter().zip(tallies) {
            cost += *squares;
            let (wrong, sum) = if *turned {
                (met - *away, *sum - *sum_away)
            } else {
                (*away, *sum_away)
            };
            // A sighting that points away misses by pi less the angle.
            cost += (T::pi() * wrong - T::lit(2.0) * sum) * T::pi();
            inconsistent += wrong;
        }
        let [first, second] = self.positions;
        let sign = |turned: bool| if turned { -T::one() } else { T::one() };
        let [sign0, sign1, sign2] = turned.map(sign);
        let scale = sign0 / first.norm_sqr().sqrt();
        let pose = |position: Complex<T>, rotation: Complex<T>| {
            Pose::from_parts(
                Translation2::new(position.re, position.im),
                UnitComplex::new_unchecked(rotation),
            )
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count"
        )]
        let inconsistent = inconsistent.as_f64() as usize;
        let motion = Motion {
            poses: [
                pose(
                    Complex::new(T::zero(), T::zero()),
                    Complex::new(T::one(), T::zero()),
                ),
                pose(first * scale, self.headings[0] * (sign0 * sign1)),
                pose(second * scale, self.headings[1] * (sign0 * sign2)),
            ],
            inconsistent,
            cost: cost * T::lit(0.5),
        };
        Settled { motion, scale }
    }
}

/// Sightings of one view in two motions, by their sign.
#[derive(Clone, Copy)]
struct Tally<T> {
    /// How many point away from their landmark; a number of the same kind as the others, to be in step
    /// with them.
    away: Pair<T>,
    /// Sum of the squares of the angles by which they miss the line.
    squares: Pair<T>,
    /// Sum of these angles: of all sightings, and of those that point away.
    sum: Pair<T>,
    sum_away: Pair<T>,
}

impl<T: Real> Tally<T> {
    fn new() -> Self {
        let zero = Pair([T::zero(); 2]);
        Self {
            away: zero,
            squares: zero,
            sum: zero,
            sum_away: zero,
        }
    }

    /// The numbers of one motion.
    fn of(&self, k: usize) -> [T; 4] {
        [self.away, self.squares, self.sum, self.sum_away]
            .map(|pair| if k == 0 { pair.0[0] } else { pair.0[1] })
    }

    #[inline(always)]
    fn add(&mut self, squares: Pair<T>, ahead: Pair<T>) {
        let angles = squares.map(|square| square.sqrt());
        let if_behind = |ahead, value| if ahead < T::zero() { value } else { T::zero() };
        self.squares = self.squares + squares;
        self.sum = self.sum + angles;
        self.sum_away = self.sum_away + ahead.zip(angles, if_behind);
        self.away = self.away + ahead.map(|ahead| if_behind(ahead, T::one()));
    }

    /// As [`Self::add`] for angles of any size, and for a landmark that has no place in one of the motions.
    #[cold]
    #[inline(never)]
    fn add_far(&mut self, beside: Pair<T>, ahead: Pair<T>, meets: [bool; 2]) {
        let angle = ahead.zip(beside, |ahead, beside| signed_angle(ahead.abs(), beside));
        let if_meets = |value, meets| if meets { value } else { T::zero() };
        self.add(
            (angle * angle).zip(Pair(meets), if_meets),
            ahead.zip(Pair(meets), if_meets),
        );
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

    /// Point transfer: the bearing in view 2 of the landmark that views 0 and 1 see at `u` and `v`.
    ///
    /// Oriented, unlike [`TrifocalTensor::transfer`](super::TrifocalTensor::transfer). The landmark is
    /// where the two lines of sight cross, ahead of the views or not: [`is_ahead`](crate::is_ahead)
    /// tells. `None` when the two are parallel, or cross at view 2.
    ///
    /// # Example
    /// ```
    /// # use bearslam::{three_view, bearing_to, pose, Method};
    /// # let views = [pose(0.0_f64, 0.0, 0.1), pose(3.0, 0.5, 0.7), pose(1.0, 3.0, -0.4)];
    /// # let points = [[1.0, 1.5], [2.0, 4.0], [-1.0, 2.0], [4.0, 3.0], [2.0, -2.0], [0.5, -1.0]];
    /// # let triples = points.map(|point| views.map(|view| bearing_to(&view, &point.into()).unwrap()));
    /// let found = three_view(&triples, Method::Calibrated { reweights: 0 })?;
    /// let [u, v, w] = &triples[0];
    /// let transferred = found.motions[0].transfer(u, v).unwrap();
    /// assert!(transferred.angle_to(w).abs() < 1e-12);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn transfer(&self, u: &Bearing<T>, v: &Bearing<T>) -> Option<Bearing<T>> {
        let [p, q, r] = self
            .poses
            .map(|pose| Complex::new(pose.translation.x, pose.translation.y));
        let [first, second, third] = self.poses.map(|pose| pose.rotation.into_inner());
        let (first, second) = (first * u.into_inner(), second * v.into_inner());
        let across = cross(first, second);
        // The crossing as seen from view 2, times the determinant.
        let seen = second * cross(first, p) - first * cross(second, q) - r * across;
        let seen = if across < T::zero() { -seen } else { seen } * third.conj();
        let norm = seen.norm_sqr().sqrt();
        let size = (p.norm_sqr() + q.norm_sqr() + r.norm_sqr()).sqrt();
        (across.abs() > T::eps() && norm > T::eps() * size)
            .then(|| UnitComplex::new_unchecked(seen * (T::one() / norm)))
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
    (weight > parallel()).then(|| sum * (T::one() / weight))
}

#[inline]
fn cross<T: Real>(a: Complex<T>, b: Complex<T>) -> T {
    a.re * b.im - a.im * b.re
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{bearing_to, pose};

    /// What [`settle`] does for one motion, landmark by landmark and view by view.
    fn plain(line: &LineMotion<f64>, triples: &[Triple<f64>]) -> (Motion<f64>, [bool; 3]) {
        let one = Complex::new(1.0, 0.0);
        let headings = [one, line.headings[0], line.headings[1]];
        let positions = [Complex::new(0.0, 0.0), line.positions[0], line.positions[1]];
        // The angles by which sightings miss the line, of those that point at it and of the others.
        let mut misses = [[(0, 0.0, 0.0); 2]; 3];
        for triple in triples {
            let rays = core::array::from_fn(|view| headings[view] * triple[view].into_inner());
            let Some(point) = meet(&rays, &positions) else {
                continue;
            };
            for view in 0..3 {
                let seen = rays[view].conj() * (point - positions[view]);
                let angle = seen.im.abs().atan2(seen.re.abs());
                let miss = &mut misses[view][usize::from(seen.re < 0.0)];
                miss.0 += 1;
                miss.1 += angle * angle;
                miss.2 += (core::f64::consts::PI - angle).powi(2);
            }
        }
        let turned = misses.map(|[at, away]| away.0 > at.0);
        let mut cost = 0.0;
        let mut inconsistent = 0;
        for (turned, [at, away]) in turned.iter().zip(misses) {
            let (at, away) = if *turned { (away, at) } else { (at, away) };
            cost += at.1 + away.2;
            inconsistent += away.0;
        }
        let sign = |turned: bool| if turned { -1.0 } else { 1.0 };
        let scale = sign(turned[0]) / positions[1].norm();
        let poses = core::array::from_fn(|view| {
            let position = positions[view] * scale;
            let heading = headings[view] * sign(turned[view]) * sign(turned[0]);
            pose(position.re, position.im, heading.arg())
        });
        let motion = Motion {
            poses,
            inconsistent,
            cost: cost / 2.0,
        };
        (motion, turned)
    }

    /// Numbers in (-1, 1) of no pattern.
    fn noise(seed: usize) -> f64 {
        ((seed as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(2.0) - 1.0
    }

    fn line(seed: usize) -> LineMotion<f64> {
        let complex = |k: usize| Complex::new(noise(seed + k), noise(seed + k + 1));
        LineMotion {
            headings: [complex(0), complex(2)].map(|z| z / z.norm()),
            positions: [complex(4), complex(6)],
        }
    }

    #[test]
    fn settling_in_step_is_settling_one_by_one() {
        for trial in 0..300 {
            let lines = [line(100 * trial), line(100 * trial + 8)];
            // Bearings of the first motion with small errors, with large ones, and of no motion at all.
            let error = [1e-3, 0.1, 4.0][trial % 3];
            let mut triples: [Triple<f64>; 7] = core::array::from_fn(|j| {
                let seed = 100 * trial + 16 + 8 * j;
                let point = Point2::new(3.0 * noise(seed), 3.0 * noise(seed + 1));
                core::array::from_fn(|view| {
                    let [heading, place] = match view {
                        0 => [Complex::new(1.0, 0.0), Complex::new(0.0, 0.0)],
                        _ => [lines[0].headings[view - 1], lines[0].positions[view - 1]],
                    };
                    let view_pose = pose(place.re, place.im, heading.arg());
                    let exact = bearing_to(&view_pose, &point).unwrap();
                    exact * UnitComplex::new(error * noise(seed + 2 + view))
                })
            });
            if trial % 5 == 0 {
                // Three rays that are parallel under the first motion.
                triples[3] = [
                    UnitComplex::identity(),
                    UnitComplex::new_unchecked(lines[0].headings[0].conj()),
                    UnitComplex::new_unchecked(-lines[0].headings[1].conj()),
                ];
            }
            let mut places = [[None; 2]; 7];
            let found = settle(&lines, &triples, |index, both| places[index] = both);
            for k in 0..2 {
                let (expected, _) = plain(&lines[k], &triples);
                let Settled { motion, scale } = found[k];
                assert_eq!(motion.inconsistent, expected.inconsistent, "{trial}");
                assert!((motion.cost - expected.cost).abs() < 1e-11 * (1.0 + expected.cost));
                for (found, expected) in motion.poses.iter().zip(&expected.poses) {
                    let apart = found.to_homogeneous() - expected.to_homogeneous();
                    assert!(apart.norm() < 1e-13);
                }
                for (place, triple) in places.iter().zip(&triples) {
                    let place = place[k].map(|place| place * scale);
                    let expected = motion.landmark(triple);
                    assert_eq!(place.is_some(), expected.is_some());
                    if let (Some(place), Some(expected)) = (place, expected) {
                        let apart = Complex::new(expected.x, expected.y) - place;
                        assert!(apart.norm() < 1e-10 * (1.0 + place.norm()), "{trial}");
                    }
                }
            }
        }
    }

    #[test]
    fn squares_of_arctangents() {
        for k in 0..=1000 {
            let q = f64::from(k) / 1000.0 * SMALL;
            let expected = q.sqrt().atan().powi(2);
            assert!((squared_arctangent(q) - expected).abs() <= 4.0 * f64::EPSILON * expected);
        }
    }

    #[test]
    fn transfer_is_the_bearing_of_the_landmark() {
        let mut sides = [0; 2];
        for trial in 0..200 {
            let line = line(50 * trial);
            let views = [
                pose(0.0, 0.0, 0.3),
                pose(
                    line.positions[0].re,
                    line.positions[0].im,
                    line.headings[0].arg(),
                ),
                pose(
                    line.positions[1].re,
                    line.positions[1].im,
                    line.headings[1].arg(),
                ),
            ];
            let motion = Motion {
                poses: views,
                inconsistent: 0,
                cost: 0.0,
            };
            let point = Point2::new(5.0 * noise(50 * trial + 20), 5.0 * noise(50 * trial + 21));
            let [u, v, w] = views.map(|view| bearing_to(&view, &point).unwrap());
            let parallax = (views[0].rotation * u).angle_to(&(views[1].rotation * v));
            if parallax.sin().abs() > 1e-3 {
                sides[usize::from(parallax.sin() < 0.0)] += 1;
                let found = motion.transfer(&u, &v).unwrap();
                assert!(found.angle_to(&w).abs() < 1e-11);
            }
            // The same direction in the map: no crossing.
            let parallel = views[1].rotation.inverse() * views[0].rotation * u;
            assert!(motion.transfer(&u, &parallel).is_none());
        }
        assert!(sides.iter().all(|&side| side > 20));
    }
}
