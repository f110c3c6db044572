// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cheirality: the signs of the bearings resolve headings modulo pi.

use super::Triple;
use super::lanes::{ComplexLanes, Lanes};
use super::motion::{Motion, parallel};
use crate::geometry::{Pose, signed_angle};
use crate::scalar::Real;
use nalgebra::{Complex, Translation2, UnitComplex};

/// Headings of views 1 and 2, each known modulo pi, and their positions, known up to a common sign;
/// view 0 is at the origin with heading 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineMotion<T: Real> {
    /// `e^{i theta}` of views 1 and 2.
    pub headings: [Complex<T>; 2],
    /// Positions as complex numbers.
    pub positions: [Complex<T>; 2],
}

/// Resolves the headings modulo pi of two motions by the signs of the bearings. `place` gets the position
/// of each landmark under both motions, before these are turned and scaled.
///
/// (T8): turning a view by pi reverses the signs of all its sightings, so the majority of its sightings
/// decides; turning all three views is turning the map.
///
/// Both motions go through the same operations, each in its lane.
pub(super) fn resolve_signs<T: Real>(
    lines: &[LineMotion<T>; 2],
    triples: &[Triple<T>],
    mut place: impl FnMut(usize, [Option<Complex<T>>; 2]),
) -> [OrientedMotion<T>; 2] {
    let [one, other] = lines;
    let headings: [_; 2] =
        core::array::from_fn(|k| ComplexLanes::new([one.headings[k], other.headings[k]]));
    let positions: [_; 2] =
        core::array::from_fn(|k| ComplexLanes::new([one.positions[k], other.positions[k]]));
    let mut tallies = [SignTally::new(); 3];
    let mut unmet = [0_usize; 2];
    for (index, [u, v, w]) in triples.iter().enumerate() {
        let rays = [
            ComplexLanes::new([u.into_inner(); 2]),
            headings[0].turned(v.into_inner()),
            headings[1].turned(w.into_inner()),
        ];
        let offsets = [rays[1].cross(positions[0]), rays[2].cross(positions[1])];
        let across = [
            rays[1].cross(rays[2]),
            rays[2].cross(rays[0]),
            rays[0].cross(rays[1]),
        ];
        // The point as in `meet`, multiplied by the weight.
        let weight = across[0] * across[0] + across[1] * across[1] + across[2] * across[2];
        let point = rays[0].scaled(offsets[1] * across[1] - offsets[0] * across[2])
            + rays[2].scaled(offsets[0] * across[0])
            - rays[1].scaled(offsets[1] * across[0]);
        let ahead = [
            rays[0].dot(point),
            rays[1].dot(point - positions[0].scaled(weight)),
            rays[2].dot(point - positions[1].scaled(weight)),
        ];
        // (T10a): only one difference of nearly equal numbers instead of three.
        let apart = offsets[0] * across[1] + offsets[1] * across[2];
        let beside = across.map(|across| across * apart);
        let ratios: [Lanes<T>; 3] = core::array::from_fn(|view| {
            let ratio = beside[view].zip(ahead[view], |beside, ahead| beside / ahead);
            ratio * ratio
        });
        let share = weight.map(|weight| T::one() / weight);
        let point = point.scaled(share).parts();
        let Lanes([one, other]) = ratios[0] + ratios[1] + ratios[2];
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

/// Largest squared tangent for which [`squared_arctangent`] holds.
const SMALL: f64 = 1.0 / 324.0;

/// The square of the arctangent of a small number, from the square of that number.
///
/// The polynomial of degree 4 that interpolates `arctan(sqrt q)^2 / q` at the five Chebyshev points of
/// \[0, [`SMALL`]\], with a relative error of at most 2.3e-16. For types with fewer than ten digits, degree 2
/// and 3.8e-10.
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

/// A motion with every view turned so that most of its sightings point at their landmarks.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrientedMotion<T: Real> {
    pub motion: Motion<T>,
    /// Factor for the landmarks of the motion modulo pi.
    pub scale: T,
}

impl<T: Real> LineMotion<T> {
    /// The oriented motion; `met` landmarks have a position.
    fn turned(&self, met: usize, tallies: &[[T; 4]; 3]) -> OrientedMotion<T> {
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
            // The residual of a sighting that points away is pi minus the angle.
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
        OrientedMotion { motion, scale }
    }
}

/// Sums over the sightings of one view in two motions, by sign.
#[derive(Clone, Copy)]
struct SignTally<T> {
    /// How many point away from their landmark; of the same type as the others, to share their lanes.
    away: Lanes<T>,
    /// Sum of the squared angles to the line of sight.
    squares: Lanes<T>,
    /// Sum of these angles, over all sightings and over those that point away.
    sum: Lanes<T>,
    sum_away: Lanes<T>,
}

impl<T: Real> SignTally<T> {
    fn new() -> Self {
        let zero = Lanes([T::zero(); 2]);
        Self {
            away: zero,
            squares: zero,
            sum: zero,
            sum_away: zero,
        }
    }

    /// The sums of one motion.
    fn of(&self, k: usize) -> [T; 4] {
        [self.away, self.squares, self.sum, self.sum_away]
            .map(|lanes| if k == 0 { lanes.0[0] } else { lanes.0[1] })
    }

    #[inline(always)]
    fn add(&mut self, squares: Lanes<T>, ahead: Lanes<T>) {
        let angles = squares.map(|square| square.sqrt());
        let if_behind = |ahead, value| if ahead < T::zero() { value } else { T::zero() };
        self.squares = self.squares + squares;
        self.sum = self.sum + angles;
        self.sum_away = self.sum_away + ahead.zip(angles, if_behind);
        self.away = self.away + ahead.map(|ahead| if_behind(ahead, T::one()));
    }

    /// As [`Self::add`] for angles of any size, and for a landmark without a position in one of the motions.
    #[cold]
    #[inline(never)]
    fn add_far(&mut self, beside: Lanes<T>, ahead: Lanes<T>, meets: [bool; 2]) {
        let angle = ahead.zip(beside, |ahead, beside| signed_angle(ahead.abs(), beside));
        let if_meets = |value, meets| if meets { value } else { T::zero() };
        self.add(
            (angle * angle).zip(Lanes(meets), if_meets),
            ahead.zip(Lanes(meets), if_meets),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::meet;
    use super::*;
    use crate::geometry::{bearing_to, pose};
    use nalgebra::Point2;

    /// The same as [`resolve_signs`] for one motion, landmark by landmark and view by view.
    fn plain(line: &LineMotion<f64>, triples: &[Triple<f64>]) -> (Motion<f64>, [bool; 3]) {
        let one = Complex::new(1.0, 0.0);
        let headings = [one, line.headings[0], line.headings[1]];
        let positions = [Complex::new(0.0, 0.0), line.positions[0], line.positions[1]];
        // The angles to the line of sight, of sightings that point at the landmark and of those that point away.
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

    /// Pseudo-random numbers in (-1, 1).
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
    fn resolving_in_lanes_is_resolving_one_by_one() {
        for trial in 0..300 {
            let lines = [line(100 * trial), line(100 * trial + 8)];
            // Bearings of the first motion with small errors, with large ones, and entirely random.
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
            let found = resolve_signs(&lines, &triples, |index, both| places[index] = both);
            for k in 0..2 {
                let (expected, _) = plain(&lines[k], &triples);
                let OrientedMotion { motion, scale } = found[k];
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
}
