// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps grown from four landmarks that four or more views see.

use super::super::grow::{grow, score};
use super::tensor_circle::{Circle, ScoredMap, local_minima};
use super::triples::common_bearings;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::align;
use crate::kernels::{DualTensor, Quadruple};
use crate::problem::{Map, Problem};
use crate::uncertainty::Watch;
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
    ///
    /// # Errors
    /// Those of `watch`.
    pub fn along_circles(
        &self,
        problem: &Problem,
        circle: Circle,
        watch: Watch<'_>,
    ) -> Result<Vec<ScoredMap>, Error> {
        let mut found = self.along_circle(problem, circle, (1.0, 0.0), watch)?;
        found.extend(self.along_circle(problem, circle, (0.0, 1.0), watch)?);
        Ok(found)
    }

    /// The same for one circle, through this combination of the two directions.
    fn along_circle(
        &self,
        problem: &Problem,
        circle: Circle,
        (second, third): (f64, f64),
        watch: Watch<'_>,
    ) -> Result<Vec<ScoredMap>, Error> {
        let at = |cos: f64, sin: f64| {
            DualTensor::combine(&self.tensors, [cos, sin * second, sin * third])
        };
        let mut found = local_minima(problem, circle, watch, |cos, sin| {
            self.grown(problem, &at(cos, sin))
        })?;
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
            watch()?;
            let maps = self.grown(problem, &tensor(0.5 * (low + high)));
            found.extend(maps.map(|map| (score(problem, &map), map)));
        }
        Ok(found)
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

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(views: usize) -> (crate::simulate::Scene, Problem) {
        let arena = crate::simulate::Arena::default();
        let layout = crate::simulate::Layout::Enclosed;
        let scene = crate::simulate::simulate(layout, views, 4, 0.0, 2, arena).unwrap();
        let problem = Problem::dense(views, 4, &scene.bearings, 0.01).unwrap();
        (scene, problem)
    }

    /// How far four landmarks are from others after alignment.
    fn apart(map: &Map, points: &[Point2<f64>]) -> f64 {
        let [a, b] = [quadrangle(map).unwrap(), points.try_into().unwrap()];
        unlike(&b, &a)
    }

    /// Four landmarks and five exact views have two maps, of which one is the truth; the other is its twin, and the truth is
    /// the twin of that.
    #[test]
    fn exact_views_give_two_maps_each_the_twin_of_the_other() {
        let (scene, problem) = exact(5);
        let triples = [[0, 1, 2], [1, 2, 3], [0, 2, 4]];
        let found = FourLandmarks::shared(&problem, &triples);
        // All triples share the same four.
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].landmarks, found[0].triple), ([0, 1, 2, 3], 0));
        let maps = found[0].solutions(&problem);
        assert_eq!(maps.len(), 2);
        let (_, right) = maps
            .iter()
            .find(|(_, map)| apart(map, &scene.landmarks) < 1e-6)
            .unwrap();
        let other = twin(&problem, right).unwrap();
        assert!(apart(&other, &scene.landmarks) > 1e-3);
        let again = twin(&problem, &other).unwrap();
        assert!(apart(&again, &scene.landmarks) < 1e-6);
        let squares: f64 = right.residuals(&problem).flatten().map(|r| r * r).sum();
        assert!(right.is_complete() && squares < 1e-12);
        // Three views are too few.
        let (_, three) = exact(3);
        assert!(FourLandmarks::shared(&three, &[[0, 1, 2]]).is_empty());
        let mut part = right.clone();
        part.landmarks[2] = None;
        assert!(twin(&problem, &part).is_none() && along_wall(&problem, &part).is_empty());
    }

    /// Members of the family of a wall keep landmarks on a line and its order; the one in the middle is the map itself.
    #[test]
    fn the_family_of_a_wall_keeps_its_line() {
        // Nothing is seen, so that no view moves the landmarks.
        let problem = Problem::new(5, 4, &[]).unwrap();
        let mut map = Map::empty(5, 4);
        let along = [-3.0, -1.0, 1.0, 3.0];
        map.landmarks = along.map(|x| Some(Point2::new(x, 2.0 + 0.5 * x))).to_vec();
        let members = along_wall(&problem, &map);
        assert_eq!(members.len(), MEMBERS as usize);
        let middle = &members[MEMBERS as usize / 2];
        let original: Vec<Point2<f64>> = map.landmarks.iter().flatten().copied().collect();
        assert!(apart(middle, &original) < 1e-9);
        for member in &members {
            assert!(member.width_over_length() < 1e-9);
            // No landmark has passed through infinity: their order stays, up to the direction of the line.
            let places: Vec<f64> = member.landmarks.iter().flatten().map(|p| p.x).collect();
            let rises = places.is_sorted() || places.iter().rev().is_sorted();
            assert!(rises, "{places:?}");
        }
        assert!(apart(&members[0], &original) > 0.1);
        assert!(apart(&members[MEMBERS as usize - 1], &original) > 0.1);
    }

    /// In either direction the circle passes through the tensor that fits best, so that exact views have the truth on it.
    #[test]
    fn each_circle_passes_through_the_closed_form() {
        let (scene, problem) = exact(5);
        let four = FourLandmarks::shared(&problem, &[[0, 1, 2]]).remove(0);
        // Of an odd number of samples the middle one is the tensor itself.
        let circle = Circle {
            places: 9,
            width: 1.0,
        };
        for direction in [(1.0, 0.0), (0.0, 1.0)] {
            let found = four
                .along_circle(&problem, circle, direction, &mut || Ok(()))
                .unwrap();
            let mut found = found.iter().filter(|(_, map)| quadrangle(map).is_some());
            let is_truth = |(_, map): &(f64, Map)| apart(map, &scene.landmarks) < 1e-6;
            assert!(found.any(is_truth), "{direction:?}");
        }
    }
}
