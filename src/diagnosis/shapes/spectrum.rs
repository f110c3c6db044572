// SPDX-License-Identifier: MIT OR Apache-2.0
//! How well the bearings determine each direction of a map: the singular values of the Jacobian.

use super::super::options::ShapeOptions;
use super::normalized_map::{NormalizedMap, median};
use crate::adjustment::decompose::singular_values;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use alloc::vec::Vec;
use nalgebra::{DMatrix, DVector, Vector2};

/// The directions of a map beyond the gauge, the least determined first.
///
/// Parameters are `(x, y, theta)` of each view and `(x, y)` of each landmark; headings in radians,
/// positions in the units of [`NormalizedMap::units`], so that a singular value is the bearing error
/// \[rad\] that a move by one such unit makes in all sightings together.
pub struct Spectrum {
    /// Singular values, ascending.
    pub values: Vec<f64>,
    /// The directions, one column each, orthonormal.
    pub directions: DMatrix<f64>,
    /// The reference for calling a singular value zero: the norm of the median column of the Jacobian.
    pub scale: f64,
}

/// A sighting over less than this fraction of the map's size says little more than that two places coincide. Its row,
/// which grows with one over the distance, is bounded, so that the other rows do not vanish beside it.
const TOUCHING: f64 = 1e-3;

/// Singular values below this many square roots of the rounding error are zero: where two solutions merge, exact
/// bearings give positions with only half the digits.
const ROOTS: f64 = 8.0;

impl Spectrum {
    /// The spectrum of a map; `None` when it is too large, or if the decomposition fails.
    pub fn of(map: &NormalizedMap, options: &ShapeOptions) -> Option<Self> {
        let units = parameter_units(map);
        let count = units.len();
        if count > options.max_parameters || map.sightings.len() * count * count > options.max_work
        {
            return None;
        }
        let mut jacobian = rows(map);
        for (mut column, unit) in jacobian.column_iter_mut().zip(&units) {
            column *= *unit;
        }
        let scale = median(jacobian.column_iter().map(|column| column.norm()));
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let reflectors = free_gauge(map, &jacobian, &units, scale);
        for reflector in &reflectors {
            reflect_columns(&mut jacobian, reflector);
        }
        let gauge = reflectors.len();
        let count = count.checked_sub(gauge).filter(|&count| count > 0)?;
        let held = jacobian.columns(gauge, count).into_owned();
        // QR first, so that the size of the decomposition does not depend on the number of sightings.
        let square = if held.nrows() > count {
            held.qr().r()
        } else {
            held.resize_vertically(count, 0.0)
        };
        let found = singular_values(&square)?;
        let mut directions = DMatrix::zeros(units.len(), count);
        for (to, from) in (0..count).rev().enumerate() {
            let mut column = DVector::zeros(units.len());
            let right = found.right.column(from);
            column.rows_mut(gauge, count).copy_from(&right);
            for reflector in reflectors.iter().rev() {
                reflect(&mut column, reflector);
            }
            directions.set_column(to, &column);
        }
        Some(Self {
            values: found.values.into_iter().rev().collect(),
            directions,
            scale,
        })
    }

    /// How many directions the bearings leave free, up to rounding.
    pub fn free(&self) -> usize {
        let bound = ROOTS * f64::EPSILON.sqrt() * self.scale;
        self.values
            .iter()
            .take_while(|&&value| !(value > bound))
            .count()
    }

    /// Standard deviation along a direction in its units, for bearings with this `noise` \[rad\].
    pub fn deviation(&self, direction: usize, noise: f64) -> f64 {
        noise / self.values[direction].max(f64::EPSILON * self.scale)
    }

    /// The moves of the points in a direction, in sizes of the map, for a step of 1.
    pub fn moves(&self, map: &NormalizedMap, direction: usize) -> Vec<Vector2<f64>> {
        let column = self.directions.column(direction);
        let units = map.units();
        let views = map.views.len();
        (0..map.points.len())
            .map(|point| {
                let k = place(views, point);
                Vector2::new(column[k], column[k + 1]) * units[point]
            })
            .collect()
    }
}

/// Where the position of a point is among the parameters.
pub fn place(views: usize, point: usize) -> usize {
    if point < views {
        3 * point
    } else {
        views + 2 * point
    }
}

/// The Jacobian, one row per sighting, (T12).
fn rows(map: &NormalizedMap) -> DMatrix<f64> {
    let views = map.views.len();
    let mut matrix = DMatrix::zeros(map.sightings.len(), 3 * views + 2 * map.landmarks.len());
    for (row, &(view, landmark, weight)) in map.sightings.iter().enumerate() {
        let landmark = map.point_of_landmark(landmark);
        let offset = map.points[landmark] - map.points[view];
        let distance = offset.norm();
        if !(distance > 0.0) {
            continue;
        }
        let weight = weight * f64::min(1.0, distance / TOUCHING);
        let across = Vector2::new(-offset.y, offset.x) / (distance * distance);
        let (p, x) = (place(views, view), place(views, landmark));
        for axis in 0..2 {
            matrix[(row, p + axis)] = -across[axis] * weight;
            matrix[(row, x + axis)] = across[axis] * weight;
        }
        matrix[(row, p + 2)] = -weight;
    }
    matrix
}

/// The unit of each parameter.
fn parameter_units(map: &NormalizedMap) -> Vec<f64> {
    let (views, landmarks) = (map.views.len(), map.landmarks.len());
    let mut units = alloc::vec![1.0; 3 * views + 2 * landmarks];
    for (point, unit) in map.units().into_iter().enumerate() {
        let k = place(views, point);
        units[k] = unit;
        units[k + 1] = unit;
    }
    units
}

/// Householder vectors that rotate the free directions of the gauge into the first axes.
///
/// The gauge is translation, rotation and scale. Only directions that the Jacobian leaves free are used: all four, as
/// long as all rows are bearings.
fn free_gauge(
    map: &NormalizedMap,
    jacobian: &DMatrix<f64>,
    units: &[f64],
    scale: f64,
) -> Vec<DVector<f64>> {
    let views = map.views.len();
    let mut gauge = DMatrix::zeros(units.len(), 4);
    for (point, p) in map.points.iter().enumerate() {
        let k = place(views, point);
        for (direction, moved) in [Vector2::x(), Vector2::y(), Vector2::new(-p.y, p.x), *p]
            .into_iter()
            .enumerate()
        {
            gauge[(k, direction)] = moved.x / units[k];
            gauge[(k + 1, direction)] = moved.y / units[k];
        }
        if point < views {
            gauge[(k + 2, 2)] = 1.0;
        }
    }
    let gauge = gauge.qr().q();
    let Some(held) = singular_values(&(jacobian * &gauge)) else {
        return Vec::new();
    };
    let bound = ROOTS * f64::EPSILON.sqrt() * scale;
    let mut reflectors: Vec<DVector<f64>> = Vec::new();
    for (value, turn) in held.values.iter().zip(held.right.column_iter()) {
        if *value > bound {
            continue;
        }
        let mut axis = &gauge * turn;
        for reflector in &reflectors {
            reflect(&mut axis, reflector);
        }
        let done = reflectors.len();
        axis.rows_mut(0, done).fill(0.0);
        let norm = axis.norm();
        if !(norm > 0.5) {
            continue;
        }
        axis[done] += if axis[done] >= 0.0 { norm } else { -norm };
        axis.unscale_mut(axis.norm());
        reflectors.push(axis);
    }
    reflectors
}

/// Reflects a vector in the plane normal to a unit vector.
fn reflect(vector: &mut DVector<f64>, across: &DVector<f64>) {
    let twice = 2.0 * across.dot(vector);
    vector.axpy(-twice, across, 1.0);
}

/// Reflects each row of a matrix.
fn reflect_columns(matrix: &mut DMatrix<f64>, across: &DVector<f64>) {
    let twice = &*matrix * across * 2.0;
    matrix.ger(-1.0, &twice, across, 1.0);
}
