// SPDX-License-Identifier: MIT OR Apache-2.0
//! The directions of a map that the bearings leave free or determine weakly, and the shapes that explain them.

use super::super::finding::Kind;
use super::super::options::ShapeOptions;
use super::configuration::{Configuration, generic};
use super::moving_points::moving_points;
use super::normalized_map::NormalizedMap;
use super::shape::Shape;
use super::spectrum::{Spectrum, place};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::uncertainty::WeakDirection;
use alloc::vec;
use alloc::vec::Vec;

/// A shape that leaves directions free.
pub struct Cause {
    pub kind: Kind,
    /// The points concerned.
    pub points: Vec<usize>,
    /// How many directions it leaves free, or weak.
    pub directions: usize,
}

/// The result of examining a map.
pub struct Examination {
    pub spectrum: Spectrum,
    /// The free and weak directions. Subjects are those of the map's problem; the cause is an index into `causes`.
    pub directions: Vec<WeakDirection<usize>>,
    /// The index of each in the spectrum.
    indices: Vec<usize>,
    pub causes: Vec<Cause>,
    /// Directions that are free in any map with these sightings.
    pub structural: usize,
    options: ShapeOptions,
}

/// Names the free and weak directions of a map for bearings of this standard deviation \[rad\]; `None`
/// when its spectrum cannot be computed.
pub fn examine(map: &NormalizedMap, noise: f64, options: &ShapeOptions) -> Option<Examination> {
    let spectrum = Spectrum::of(map, options)?;
    let noise = noise.max(4.0 * f64::EPSILON);
    let (indices, directions) = open_directions(map, &spectrum, noise, options);
    let mut found = Examination {
        spectrum,
        directions,
        indices,
        options: *options,
        causes: Vec::new(),
        structural: 0,
    };
    // There is nothing to explain when all directions are well determined and the map has no shape.
    let all: Vec<_> = Configuration::of_all(map, options)
        .into_iter()
        .filter(|configuration| configuration.fits(map, &found.spectrum, noise, options))
        .collect();
    if found.directions.is_empty() && all.is_empty() {
        return Some(found);
    }
    let generic = generic(map, options);
    found.structural = Spectrum::of(&generic, options)?.free();
    if noise < options.max_noise {
        found.name_whole(map, &generic, noise, &all);
        found.name_points(map, &generic, noise);
    }
    Some(found)
}

/// The free and weak directions, and their indices in the spectrum.
fn open_directions(
    map: &NormalizedMap,
    spectrum: &Spectrum,
    noise: f64,
    options: &ShapeOptions,
) -> (Vec<usize>, Vec<WeakDirection<usize>>) {
    let free = spectrum.free();
    let views = map.views.len();
    let count = map.points.len() as f64;
    let (mut indices, mut found) = (Vec::new(), Vec::new());
    for index in 0..spectrum.values.len() {
        let deviation = spectrum.deviation(index, noise);
        let column = spectrum.directions.column(index);
        let squares = (0..map.points.len()).map(|point| {
            let k = place(views, point);
            column[k] * column[k] + column[k + 1] * column[k + 1]
        });
        let (sum, most) = squares.fold((0.0, 0.0), |(sum, most), square| {
            (sum + square, f64::max(most, square))
        });
        let mean = deviation * (sum / count).sqrt();
        let one = deviation * most.sqrt();
        if index < free || options.is_weak(mean, one) {
            let movers = moving_points(map, &spectrum.moves(map, index)).into_iter();
            indices.push(index);
            found.push(WeakDirection {
                free: index < free,
                singular_value: spectrum.values[index] / spectrum.scale,
                deviation: if index < free { f64::INFINITY } else { mean },
                largest: if index < free { f64::INFINITY } else { one },
                movers: movers
                    .map(|(point, share)| (map.subject(point), share))
                    .collect(),
                cause: None,
            });
        }
    }
    (indices, found)
}

impl Examination {
    /// Searches for configurations of the whole map.
    fn name_whole(
        &mut self,
        map: &NormalizedMap,
        generic: &NormalizedMap,
        noise: f64,
        all: &[Configuration],
    ) {
        let mut projected = map.clone();
        for configuration in all {
            let named: usize = self.causes.iter().map(|cause| cause.directions).sum();
            let free = self.spectrum.free();
            // All that is free has been explained.
            if !self.causes.is_empty() && named + self.structural >= free {
                return;
            }
            if !configuration.fits(&projected, &self.spectrum, noise, &self.options) {
                continue;
            }
            let directions = configuration.freedom_added(generic, self.structural, &self.options);
            if directions == 0 {
                continue;
            }
            let Some(next) = configuration.projected(&projected) else {
                continue;
            };
            projected = next;
            self.accept(configuration, directions, &projected);
        }
    }

    /// Whether there are more unexplained directions than any map with these sightings has.
    fn is_open(&self) -> bool {
        let open = self.directions.iter().filter(|d| d.cause.is_none()).count();
        open > self.structural
    }

    /// Makes a configuration the cause of the directions that lie in its null space.
    fn accept(
        &mut self,
        configuration: &Configuration,
        directions: usize,
        projected: &NormalizedMap,
    ) {
        let mut points: Vec<usize> = configuration.points().collect();
        points.sort_unstable();
        let cause = self.causes.len();
        self.causes.push(Cause {
            kind: configuration.kind,
            points,
            directions,
        });
        let Some(spectrum) = Spectrum::of(projected, &self.options) else {
            return;
        };
        let null = spectrum.directions.columns(0, spectrum.free());
        for (direction, &index) in self.directions.iter_mut().zip(&self.indices) {
            let column = self.spectrum.directions.column(index);
            let inside = null.tr_mul(&column).norm_squared();
            if direction.cause.is_none() && inside > self.options.explained {
                direction.cause = Some(cause);
            }
        }
    }

    /// Searches for points that move alone, and for walls of only some landmarks.
    fn name_points(&mut self, map: &NormalizedMap, generic: &NormalizedMap, noise: f64) {
        for _ in 0..self.options.causes {
            let open = self.directions.iter().filter(|d| d.cause.is_none());
            let mut candidates: Vec<Configuration> = Vec::new();
            for direction in open {
                let moved = direction.movers.iter();
                let moved = moved.filter_map(|&(subject, _)| map.point(subject));
                if let Some(&(subject, share)) = direction.movers.first()
                    && share > self.options.alone
                    && let Some(point) = map.point(subject)
                {
                    candidates.push(Configuration::of_point(map, point));
                }
                let landmarks: Vec<usize> =
                    moved.filter(|&point| point >= map.views.len()).collect();
                if landmarks.len() > 2 && landmarks.len() < map.landmarks.len() {
                    candidates.push(Configuration {
                        kind: Kind::CollinearLandmarks,
                        shapes: vec![(Shape::Line, landmarks)],
                    });
                }
            }
            let known = self.causes.len();
            for configuration in candidates {
                if !configuration.fits(map, &self.spectrum, noise, &self.options) {
                    continue;
                }
                let directions =
                    configuration.freedom_added(generic, self.structural, &self.options);
                if directions > 0
                    && let Some(projected) = configuration.projected(map)
                {
                    self.accept(&configuration, directions, &projected);
                    break;
                }
            }
            if self.causes.len() == known || !self.is_open() {
                return;
            }
        }
    }
}
