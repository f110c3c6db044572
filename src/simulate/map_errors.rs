// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of a map with respect to the truth.

use super::Scene;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::{align, transform_pose};
use crate::problem::Map;
use alloc::vec::Vec;
use nalgebra::{Point2, Translation2, UnitComplex, Vector2};

/// Errors of a map with respect to the truth, after the similarity that aligns all positions best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Root mean square distance of views and landmarks from their true positions.
    pub position_rms: f64,
    /// Largest such distance.
    pub position_max: f64,
    /// Root mean square error of the headings \[rad\].
    pub heading_rms: f64,
    /// Largest error of a heading \[rad\].
    pub heading_max: f64,
}

impl Scene {
    /// The errors of the determined views and landmarks of a map; undetermined ones do not count.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] when the map is not of the scene's size, otherwise as
    /// [`align`](crate::align).
    ///
    /// # Example
    /// ```
    /// use bearslam::{Arena, Layout, Problem, SolveOptions, simulate, solve};
    /// let scene = simulate(Layout::Mixed, 5, 9, 0.0, 1, Arena::default())?;
    /// let problem = Problem::dense(5, 9, &scene.bearings, 1.0)?;
    /// let found = solve(&problem, &SolveOptions::default(), None)?;
    /// assert!(scene.errors(&found.map)?.position_max < 1e-9);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn errors(&self, map: &Map) -> Result<Errors, Error> {
        for (what, expected, got) in [
            ("poses", self.poses.len(), map.poses.len()),
            ("landmarks", self.landmarks.len(), map.landmarks.len()),
        ] {
            if expected != got {
                return Err(Error::LengthMismatch {
                    what,
                    expected,
                    got,
                });
            }
        }
        let wide = |v: &Vector2<f64>| Point2::new(v.x, v.y);
        let views = self
            .poses
            .iter()
            .zip(&map.poses)
            .filter_map(|(truth, found)| {
                let found = found.as_ref()?;
                Some((
                    truth.translation.vector.into(),
                    wide(&found.translation.vector),
                ))
            });
        let landmarks = self.landmarks.iter().zip(&map.landmarks);
        let landmarks =
            landmarks.filter_map(|(truth, found)| Some((*truth, wide(&found.as_ref()?.coords))));
        let (truth, found): (Vec<_>, Vec<_>) = views.chain(landmarks).unzip();
        let similarity = align(&found, &truth)?;
        let mut positions = ErrorSums::default();
        for (truth, found) in truth.iter().zip(&found) {
            positions.add((similarity.transform_point(found) - truth).norm());
        }
        let mut headings = ErrorSums::default();
        for (truth, found) in self.poses.iter().zip(&map.poses) {
            if let Some(found) = found {
                let rotation = found.rotation.into_inner();
                let found = crate::geometry::Pose::from_parts(
                    Translation2::identity(),
                    UnitComplex::from_complex(nalgebra::Complex::new(rotation.re, rotation.im)),
                );
                let found = transform_pose(&similarity, &found);
                headings.add(found.rotation.angle_to(&truth.rotation).abs());
            }
        }
        Ok(Errors {
            position_rms: positions.rms(),
            position_max: positions.largest,
            heading_rms: headings.rms(),
            heading_max: headings.largest,
        })
    }
}

/// Sums over the sizes of errors.
#[derive(Default)]
struct ErrorSums {
    count: f64,
    squares: f64,
    largest: f64,
}

impl ErrorSums {
    fn add(&mut self, size: f64) {
        self.count += 1.0;
        self.squares += size * size;
        self.largest = self.largest.max(size);
    }

    fn rms(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }
}
