// SPDX-License-Identifier: MIT OR Apache-2.0
//! Shapes of a map that leave directions free, and whether a map has them.

use super::super::finding::Kind;
use super::super::options::ShapeOptions;
use super::normalized_map::NormalizedMap;
use super::shape::{Shape, extent};
use super::spectrum::Spectrum;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{DMatrix, DVector, Vector2};

/// A named configuration: points on common shapes.
#[derive(Clone, Debug)]
pub struct Configuration {
    pub kind: Kind,
    /// Each shape with its points.
    pub shapes: Vec<(Shape, Vec<usize>)>,
}

/// Exact maps are on a shape up to this many square roots of the rounding error: where two solutions merge, positions
/// have only half the digits. A millionth of the map, far below any noise.
const ROOTS: f64 = 64.0;

/// Step of the central differences of the distances, in sizes of the map: near the cube root of the rounding error,
/// where truncation and rounding errors are about equal.
const STEP: f64 = 1e-6;

impl Configuration {
    /// The configurations that concern a whole map, the most special first.
    pub fn of_all(map: &NormalizedMap, options: &ShapeOptions) -> Vec<Self> {
        let (m, n) = (map.views.len(), map.landmarks.len());
        let views: Vec<usize> = (0..m).collect();
        let landmarks: Vec<usize> = (m..m + n).collect();
        let all: Vec<usize> = (0..m + n).collect();
        let one = |kind, shape, points: &[usize]| Self {
            kind,
            shapes: vec![(shape, points.to_vec())],
        };
        let circle = if m == 3 {
            Kind::ThreeViewsAndLandmarksOnOneCircle
        } else {
            Kind::ViewsAndLandmarksOnOneCircle
        };
        let mut found = vec![
            one(Kind::EverythingOnOneLine, Shape::Line, &all),
            one(circle, Shape::Circle, &all),
        ];
        let close = close_views(map, options.nearly).into_iter();
        found.extend(close.map(|shapes| Self {
            kind: Kind::CoincidentViews,
            shapes,
        }));
        // Some member of the family of a wall often has three views on a line, which is no evidence.
        if m > 3 {
            found.push(Self {
                kind: Kind::LinesOfViewsAndOfLandmarks,
                shapes: vec![
                    (Shape::Line, views.clone()),
                    (Shape::Line, landmarks.clone()),
                ],
            });
        }
        found.push(one(Kind::CollinearLandmarks, Shape::Line, &landmarks));
        if n == 4 {
            found.push(one(Kind::FourLandmarksOnACircle, Shape::Circle, &landmarks));
        }
        if m == 3 {
            found.push(one(Kind::ThreeCollinearViews, Shape::Line, &views));
        }
        found
    }

    /// The configurations that leave a single point free.
    pub fn of_point(map: &NormalizedMap, point: usize) -> Self {
        let mut points = map.neighbours(point);
        points.push(point);
        let (kind, shape) = if point < map.views.len() {
            (Kind::ViewOnCircleOfLandmarks, Shape::Circle)
        } else {
            (Kind::LandmarkOnLineOfViews, Shape::Line)
        };
        Self {
            kind,
            shapes: vec![(shape, points)],
        }
    }

    /// All points on one of the shapes.
    pub fn points(&self) -> impl Iterator<Item = usize> + '_ {
        self.shapes
            .iter()
            .flat_map(|(_, points)| points.iter().copied())
    }

    /// Whether a map has the configuration, exactly or up to the deviations that `noise` \[rad\] in the
    /// bearings can cause in the directions that are not free.
    pub fn fits(
        &self,
        map: &NormalizedMap,
        spectrum: &Spectrum,
        noise: f64,
        options: &ShapeOptions,
    ) -> bool {
        let exact = ROOTS * f64::EPSILON.sqrt();
        let Some(off) = self.distances(&map.points) else {
            return false;
        };
        let unit = self.measures(map);
        if off
            .iter()
            .zip(&unit)
            .any(|(d, unit)| !(d.abs() <= options.nearly * unit))
        {
            return false;
        }
        if off
            .iter()
            .zip(&unit)
            .all(|(d, unit)| d.abs() <= exact * unit)
        {
            return true;
        }
        let count = off.len();
        let mut covariance = DMatrix::from_diagonal(&DVector::from_iterator(
            count,
            unit.iter().map(|unit| (exact * unit) * (exact * unit)),
        ));
        for k in spectrum.free()..spectrum.values.len() {
            let moves = spectrum.moves(map, k);
            let moved = |step: f64| -> Option<DVector<f64>> {
                let points = map.points.iter().zip(&moves).map(|(p, d)| p + d * step);
                self.distances(&points.collect::<Vec<_>>())
                    .map(DVector::from_vec)
            };
            let (Some(up), Some(down)) = (moved(STEP), moved(-STEP)) else {
                return false;
            };
            let deviation = spectrum.deviation(k, noise).min(1.0);
            let slope = (up - down) * (deviation / (2.0 * STEP));
            covariance.ger(1.0, &slope, &slope, 1.0);
        }
        let off = DVector::from_vec(off);
        let Some(factor) = covariance.cholesky() else {
            return false;
        };
        let distance = (off.dot(&factor.solve(&off))).sqrt();
        let taken: usize = self
            .shapes
            .iter()
            .map(|(shape, _)| shape.parameters())
            .sum();
        let expected = (count.saturating_sub(taken) as f64).sqrt();
        // Where two solutions merge the offset grows with the root of the noise, which doubles it in this measure.
        let merging = matches!(
            self.kind,
            Kind::ThreeCollinearViews | Kind::FourLandmarksOnACircle
        );
        distance <= expected + options.sigmas * if merging { 2.0 } else { 1.0 }
    }

    /// The unit of each distance: the unit of its point, or the extent of the shape where that is less, because
    /// points in one place are on any line.
    fn measures(&self, map: &NormalizedMap) -> Vec<f64> {
        let units = map.units();
        let mut all = Vec::new();
        for (shape, members) in &self.shapes {
            let own: Vec<_> = members.iter().map(|&p| map.points[p]).collect();
            let (each, most) = match shape {
                Shape::Place => (2, f64::INFINITY),
                Shape::Line | Shape::Circle => (1, extent(&own)),
            };
            let measure = |&p: &usize| core::iter::repeat_n(f64::min(units[p], most), each);
            all.extend(members.iter().flat_map(measure));
        }
        all
    }

    /// Distances of the points from their shapes.
    fn distances(&self, points: &[Vector2<f64>]) -> Option<Vec<f64>> {
        let mut all = Vec::new();
        for (shape, members) in &self.shapes {
            let own: Vec<_> = members.iter().map(|&p| points[p]).collect();
            all.extend(shape.distances(&own)?);
        }
        Some(all)
    }

    /// The map with its points moved onto the shapes.
    pub fn projected(&self, map: &NormalizedMap) -> Option<NormalizedMap> {
        let mut map = map.clone();
        for (shape, members) in &self.shapes {
            let own: Vec<_> = members.iter().map(|&p| map.points[p]).collect();
            for (&member, place) in members.iter().zip(shape.project(&own)?) {
                map.points[member] = place;
            }
        }
        Some(map)
    }

    /// How many directions the configuration itself leaves free: those of an otherwise generic map of this shape,
    /// minus those that are free in any map with these sightings.
    pub fn freedom_added(
        &self,
        generic: &NormalizedMap,
        structural: usize,
        options: &ShapeOptions,
    ) -> usize {
        self.projected(generic)
            .and_then(|map| Spectrum::of(&map, options))
            .map_or(0, |spectrum| spectrum.free().saturating_sub(structural))
    }
}

/// The map with all points moved slightly, so that it has no shape.
pub fn generic(map: &NormalizedMap, options: &ShapeOptions) -> NormalizedMap {
    let mut map = map.clone();
    let units = map.units();
    for (k, point) in map.points.iter_mut().enumerate() {
        *point += scattered(k) * (options.jitter * units[k]);
    }
    map
}

/// Quasi-random vectors in the square from -1 to 1: a low-discrepancy sequence.
fn scattered(k: usize) -> Vector2<f64> {
    // Powers of the inverse plastic number, the golden ratio of two dimensions.
    let at = |step: f64| {
        let turned = (k as f64 + 1.0) * step;
        2.0 * (turned - turned.floor()) - 1.0
    };
    Vector2::new(at(0.754_877_666_246_692_7), at(0.569_840_290_998_053_3))
}

/// Sets of views that may be in one place: one or two sets if all views are in at most two places, and each pair
/// of three views.
fn close_views(map: &NormalizedMap, nearly: f64) -> Vec<Vec<(Shape, Vec<usize>)>> {
    let views = map.views.len();
    let near = |i: usize, j: usize| (map.points[i] - map.points[j]).norm() < nearly;
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for view in 0..views {
        match sets.iter_mut().find(|set| near(set[0], view)) {
            Some(set) => set.push(view),
            None => sets.push(vec![view]),
        }
    }
    let mut found = Vec::new();
    if sets.len() <= 2 {
        let large = sets.into_iter().filter(|set| set.len() > 1);
        found.push(large.map(|set| (Shape::Place, set)).collect());
    }
    if views == 3 {
        let pairs = [[0, 1], [1, 2], [0, 2]].into_iter();
        let close = pairs.filter(|&[i, j]| near(i, j));
        found.extend(close.map(|pair| vec![(Shape::Place, pair.to_vec())]));
    }
    found
}
