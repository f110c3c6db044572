// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps grown from four landmarks that four or more views see.

use super::super::grow::{grow, score};
use super::tensor_circle::{Circle, ScoredMap, local_minima};
use super::triples::common_bearings;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::align;
use crate::kernels::{DualTensor, Quadruple};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::{Complex, Point2};

/// Minimum number of views that determine four landmarks: each has one equation more than its pose has unknowns, and
/// the landmarks have four.
const MIN_VIEWS: usize = 4;

/// Bisections of an interval between two samples of a circle: to a thousandth of its length, far within the reach of a
/// refinement.
const BISECTIONS: usize = 10;

/// Members of the family of a wall that are tried, evenly spaced in the logarithm of the distance from either end.
const MEMBERS: u32 = 13;

/// How close they come to the ends of the family: this power of 1/e, a four-hundredth of it.
const NEAREST: f64 = 6.0;

/// Four landmarks that four or more views see.
pub struct FourLandmarks {
    landmarks: [usize; 4],
    /// The tensor that fits best, and the directions in which noise moves it most.
    tensors: [DualTensor<f64>; 3],
    /// Index of a triple of views that share them.
    pub triple: usize,
}

impl FourLandmarks {
    /// Each set of four landmarks that one of these triples of views shares and four or more views see.
    pub fn shared(problem: &Problem, triples: &[[usize; 3]]) -> Vec<Self> {
        let mut found: Vec<Self> = Vec::new();
        for (triple, &views) in triples.iter().enumerate() {
            let (_, shared) = common_bearings(problem, views);
            let Ok(landmarks) = <[usize; 4]>::try_from(shared) else {
                continue;
            };
            let views =
                (0..problem.views()).filter_map(|view| bearings_of(problem, view, &landmarks));
            let known = found.iter().any(|other| other.landmarks == landmarks);
            if !known && views.clone().nth(MIN_VIEWS - 1).is_some() {
                found.push(Self {
                    landmarks,
                    tensors: DualTensor::weakest(views),
                    triple,
                });
            }
        }
        found
    }

    /// Both maps in closed form.
    pub fn solutions(&self, problem: &Problem) -> Vec<ScoredMap> {
        let maps = self.grown(problem, &self.tensors[0]).into_iter();
        maps.map(|map| (score(problem, &map), map)).collect()
    }

    /// Maps from the tensors that noise may have turned into the best one: the local minima of the score along circles
    /// through it and the directions that the bearings determine least, and the ends of their arcs of real tensors,
    /// where the landmarks are on a circle and both solutions meet.
    pub fn along_circles(&self, problem: &Problem, circle: Circle) -> Vec<ScoredMap> {
        let directions = [(1.0, 0.0), (0.0, 1.0)];
        let each = |direction| self.along_circle(problem, circle, direction);
        directions.into_iter().flat_map(each).collect()
    }

    /// The same for one circle, through this combination of the two directions.
    fn along_circle(
        &self,
        problem: &Problem,
        circle: Circle,
        (second, third): (f64, f64),
    ) -> Vec<ScoredMap> {
        let at = |cos: f64, sin: f64| {
            DualTensor::combine(&self.tensors, [cos, sin * second, sin * third])
        };
        let mut found = local_minima(problem, circle, |cos, sin| {
            self.grown(problem, &at(cos, sin))
        });
        let tensor = |part: f64| {
            let (sin, cos) = (core::f64::consts::PI * part).sin_cos();
            at(cos, sin * circle.width)
        };
        let is_real = |part| tensor(part).is_real();
        for place in 0..circle.places {
            let [mut low, mut high] = [0, 1].map(|k| (place + k) as f64 / circle.places as f64);
            if is_real(low) == is_real(high) {
                continue;
            }
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                if is_real(middle) == is_real(low) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let maps = self.grown(problem, &tensor(0.5 * (low + high)));
            found.extend(maps.map(|map| (score(problem, &map), map)));
        }
        found
    }

    /// The maps of the two quadrangles of a tensor, empty if it has none.
    fn grown(&self, problem: &Problem, tensor: &DualTensor<f64>) -> [Map; 2] {
        let quadrangles = tensor.quadrangles();
        [0, 1].map(|branch| {
            let mut map = Map::empty(problem.views(), problem.landmarks());
            if let Some(quadrangles) = &quadrangles {
                for (&landmark, &point) in self.landmarks.iter().zip(&quadrangles[branch]) {
                    map.landmarks[landmark] = Some(point);
                }
                grow(problem, &mut map);
            }
            map
        })
    }
}

/// The other map of four landmarks that explains all bearings as well modulo pi.
///
/// `None` unless the map has just four landmarks, all determined.
pub fn twin(problem: &Problem, map: &Map) -> Option<Map> {
    let points = quadrangle(map)?;
    let quadrangles = DualTensor::of_landmarks(&points).quadrangles()?;
    let twin = quadrangles.into_iter().max_by(|a, b| {
        let [a, b] = [a, b].map(|other| unlike(&points, other));
        a.total_cmp(&b)
    })?;
    Some(map_of(problem, twin))
}

/// Members of the family of maps that landmarks on a wall leave, (T19), for a map of just four landmarks: near a wall
/// the cost has several minima along the family.
pub fn along_wall(problem: &Problem, map: &Map) -> Vec<Map> {
    let Some(points) = quadrangle(map) else {
        return Vec::new();
    };
    let (middle, along) = map.line_of_landmarks();
    let local = points.map(|point| {
        let d = point.coords - middle;
        Complex::new(d.dot(&along), along.perp(&d))
    });
    // In this interval of c no landmark passes through infinity: 1 + c x is positive.
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for z in local {
        if z.re > 0.0 {
            low = low.max(-1.0 / z.re);
        } else if z.re < 0.0 {
            high = high.min(-1.0 / z.re);
        }
    }
    if !(low.is_finite() && high.is_finite()) {
        return Vec::new();
    }
    let members = (0..MEMBERS).map(|k| {
        let t = NEAREST * (2.0 * f64::from(k) / f64::from(MEMBERS - 1) - 1.0);
        let c = low + (high - low) / (1.0 + (-t).exp());
        let moved = local.map(|z| z / (z * c + 1.0));
        map_of(problem, moved.map(|z| Point2::new(z.re, z.im)))
    });
    members.collect()
}

/// The landmarks of a map of just four.
fn quadrangle(map: &Map) -> Option<[Point2<f64>; 4]> {
    let all: Vec<_> = map.landmarks.iter().copied().collect::<Option<_>>()?;
    all.try_into().ok()
}

/// The map grown from the landmarks of a problem that has just four.
fn map_of(problem: &Problem, points: [Point2<f64>; 4]) -> Map {
    let mut map = Map::empty(problem.views(), problem.landmarks());
    map.landmarks = points.map(Some).to_vec();
    grow(problem, &mut map);
    map
}

/// How much two quadrangles differ up to a similarity; infinite when they cannot be compared.
fn unlike(one: &[Point2<f64>; 4], other: &[Point2<f64>; 4]) -> f64 {
    let Ok(laid) = align(other, one) else {
        return f64::INFINITY;
    };
    let pairs = one.iter().zip(other);
    pairs.map(|(a, b)| (a - laid * b).norm_squared()).sum()
}

/// The bearings of four landmarks from one view; `None` when it does not see all of them.
fn bearings_of(problem: &Problem, view: usize, four: &[usize; 4]) -> Option<Quadruple<f64>> {
    let seen = problem.of_view(view);
    let place = |landmark: usize| seen.binary_search_by_key(&landmark, |s| s.landmark).ok();
    let [a, b, c, d] = four.map(place);
    Some([a?, b?, c?, d?].map(|place| seen[place].bearing))
}
