// SPDX-License-Identifier: MIT OR Apache-2.0
//! The family of maps with landmarks on a wall, (T19): all members have the same bearings.
//!
//! With the wall as the real axis, `h(z) = z / (1 + c z)` moves landmarks and views, and each view turns
//! by `-arg(1 + c p)`, for any c with `1 + c x > 0` for all landmarks.

use super::super::options::MapOptions;
use super::super::shapes::shape::{Shape, extent, line};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::pose;
use crate::problem::{Map, Problem, Subject, Undetermined, Why};
use alloc::vec::Vec;
use nalgebra::{Complex, Point2, Vector2};

/// How close members come to the ends of the interval of c: this power of 1/e, a four-hundredth of it.
const NEAREST: f64 = 6.0;

/// Golden-section steps around the best member: to a hundred-millionth of the way to its neighbours.
const STEPS: usize = 40;

/// A wall and its views: the wall is the real axis and its extent the unit.
pub struct WallFamily {
    middle: Vector2<f64>,
    along: Vector2<f64>,
    unit: f64,
    views: Vec<Option<(Complex<f64>, f64)>>,
    /// Homogeneous coordinate of each landmark along the wall: the first over the second, which is 0 at
    /// infinity.
    landmarks: Vec<Option<(f64, f64)>>,
    options: MapOptions,
}

impl WallFamily {
    /// The family of a map whose landmarks are nearly on one line. Landmarks at infinity, which the map has no
    /// position for, are finite in other members.
    pub fn of(
        problem: &Problem,
        map: &Map,
        lost: &[Undetermined],
        options: &MapOptions,
    ) -> Option<Self> {
        let place = |p: &Point2<f64>| Vector2::new(p.x, p.y);
        let points: Vec<_> = map.landmarks.iter().flatten().map(place).collect();
        let unit = extent(&points);
        let off = Shape::Line.distances(&points)?;
        if points.len() < 3 || !(unit > 0.0) || off.iter().any(|d| !(d.abs() < options.wall * unit))
        {
            return None;
        }
        let (middle, along) = line(&points);
        let local = |p: Vector2<f64>| {
            let d = (p - middle) / unit;
            Complex::new(d.dot(&along), along.perp(&d))
        };
        let turn = along.y.atan2(along.x);
        let views = map.poses.iter().map(|pose| {
            let pose = (*pose)?;
            let place = local(place(&Point2::from(pose.translation.vector)));
            Some((place, pose.rotation.angle() - turn))
        });
        let views: Vec<_> = views.collect();
        let landmarks = map.landmarks.iter().enumerate().map(|(landmark, point)| {
            if let Some(point) = point {
                return Some((local(place(point)).re, 1.0));
            }
            let infinite = |u: &Undetermined| {
                u.subject == Subject::Landmark(landmark) && u.why == Why::AtInfinity
            };
            if !lost.iter().any(infinite) {
                return None;
            }
            let rays = problem.of_landmark(landmark).iter().filter_map(|&k| {
                let s = &problem.sightings()[k];
                let (_, heading) = views[s.view]?;
                Some((heading + s.bearing.angle()).cos())
            });
            let sum: f64 = rays.sum();
            Some((if sum > 0.0 { 1.0 } else { -1.0 }, 0.0))
        });
        let landmarks = landmarks.collect();
        Some(Self {
            middle,
            along,
            unit,
            views,
            landmarks,
            options: *options,
        })
    }

    /// The interval of c in which no landmark passes through infinity.
    fn interval(&self) -> (f64, f64) {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for &(x, w) in self.landmarks.iter().flatten() {
            // w + c x > 0.
            if x > 0.0 {
                low = low.max(-w / x);
            } else if x < 0.0 {
                high = high.min(-w / x);
            }
        }
        (low, high)
    }

    /// Places of views, and of landmarks along the wall.
    fn member(&self, c: f64) -> (Vec<Vector2<f64>>, Vec<f64>) {
        let views = self.views.iter().flatten().map(|&(p, _)| {
            let moved = p / (p * c + 1.0);
            Vector2::new(moved.re, moved.im)
        });
        let landmarks = self
            .landmarks
            .iter()
            .flatten()
            .map(|&(x, w)| x / (w + c * x));
        (views.collect(), landmarks.collect())
    }

    /// The c of least cost: the best of a grid over the interval, refined by golden-section search between its
    /// neighbours.
    fn least(&self, cost: impl Fn(f64) -> f64) -> Option<f64> {
        let (low, high) = self.interval();
        if !(low.is_finite() && high.is_finite() && low < high) {
            return None;
        }
        // Evenly spaced in the logarithm of the distance from either end, because there are members at all scales.
        let at = |t: f64| low + (high - low) / (1.0 + (-t).exp());
        let step = 2.0 * NEAREST / f64::from(self.options.members);
        let all = (0..=self.options.members).map(|k| step * f64::from(k) - NEAREST);
        let best = all.min_by(|a, b| cost(at(*a)).total_cmp(&cost(at(*b))))?;
        let (mut a, mut b) = (best - step, best + step);
        for _ in 0..STEPS {
            let third = (b - a) * 0.381_966_011_250_105_1;
            if cost(at(a + third)) < cost(at(b - third)) {
                b -= third;
            } else {
                a += third;
            }
        }
        Some(at(0.5 * (a + b)))
    }

    /// The most compact member: the one with the least ratio of the largest distance to the root mean square.
    pub fn compact(&self) -> Option<Map> {
        let c = self.least(|c| {
            let (mut points, wall) = self.member(c);
            points.extend(wall.into_iter().map(|x| Vector2::new(x, 0.0)));
            let middle = points.iter().fold(Vector2::zeros(), |sum, p| sum + p);
            let middle = middle / points.len() as f64;
            let farthest = points
                .iter()
                .map(|p| (p - middle).norm())
                .fold(0.0, f64::max);
            farthest / extent(&points)
        })?;
        Some(self.map(c))
    }

    /// The member whose views are nearest to one line; `None` when no member has them near a line.
    ///
    /// The measure is the turn at the middle one of three views. Distances from a line would not do: near the
    /// ends of the family all views but one move together, and two places are always on a line.
    pub fn aligned(&self) -> Option<Map> {
        let turn = |c: f64| {
            let (views, _) = self.member(c);
            let m = views.len();
            let triples =
                (0..m).flat_map(|i| [1, m / 3].map(|step| [i, (i + step) % m, (i + 2 * step) % m]));
            let squares = triples.map(|[i, j, k]| {
                let turn = straightness(views[i], views[j], views[k]);
                turn * turn
            });
            (squares.sum::<f64>() / (2 * m) as f64).sqrt()
        };
        let c = self.least(turn)?;
        (turn(c) < self.options.straight).then(|| self.map(c))
    }

    fn map(&self, c: f64) -> Map {
        let back = |z: Complex<f64>| {
            let across = Vector2::new(-self.along.y, self.along.x);
            self.middle + (self.along * z.re + across * z.im) * self.unit
        };
        let turn = self.along.y.atan2(self.along.x);
        let poses = self.views.iter().map(|view| {
            let (p, heading) = (*view)?;
            let factor = p * c + 1.0;
            let place = back(p / factor);
            let heading = heading + turn - factor.im.atan2(factor.re);
            Some(pose(place.x, place.y, heading))
        });
        let landmarks = self.landmarks.iter().map(|landmark| {
            let (x, w) = (*landmark)?;
            let place = back(Complex::new(x / (w + c * x), 0.0));
            Some(Point2::new(place.x, place.y))
        });
        Map {
            poses: poses.collect(),
            landmarks: landmarks.collect(),
        }
    }
}

/// The angle \[rad\] by which the path through three points turns at the middle one.
fn straightness(a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>) -> f64 {
    let turn = |from: Vector2<f64>, at: Vector2<f64>, to: Vector2<f64>| {
        let (first, second) = (at - from, to - at);
        first.perp(&second).atan2(first.dot(&second)).abs()
    };
    turn(a, b, c).min(turn(b, c, a)).min(turn(c, a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::Sighting;

    /// Every member has the same bearings, (T19).
    #[test]
    fn members_explain_the_same_bearings() {
        let views: [(f64, f64, f64); 4] = [
            (0.1, 0.2, 0.3),
            (1.4, -0.3, 2.0),
            (2.2, 0.5, -1.0),
            (3.9, 0.1, 0.4),
        ];
        let wall = [-1.0, 0.2, 0.9, 2.0, 3.7, 5.0].map(|x| Point2::new(x, 2.0 + 0.4 * x));
        let map = Map {
            poses: views.map(|(x, y, t)| Some(pose(x, y, t))).into(),
            landmarks: wall.map(Some).into(),
        };
        let mut sightings = Vec::new();
        for (view, (x, y, t)) in views.into_iter().enumerate() {
            for (landmark, p) in wall.iter().enumerate() {
                sightings.push(Sighting {
                    view,
                    landmark,
                    bearing: (p.y - y).atan2(p.x - x) - t,
                    sigma: 1.0,
                });
            }
        }
        let problem = Problem::new(4, 6, &sightings).unwrap();
        let family = WallFamily::of(&problem, &map, &[], &MapOptions::default()).unwrap();
        let (low, high) = family.interval();
        for k in 1..10 {
            let member = family.map(low + (high - low) * f64::from(k) / 10.0);
            for residual in member.residuals(&problem) {
                assert!(residual.unwrap().abs() < 1e-12);
            }
        }
    }
}
