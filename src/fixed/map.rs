// SPDX-License-Identifier: MIT OR Apache-2.0
//! The map itself: its data, residuals and gauge.

use crate::error::Error;
use crate::geometry::{Bearing, Pose, transform_pose};
use crate::lm::{BearingRow, Ray};
use crate::scalar::Real;
use nalgebra::{Point2, Similarity2, Translation2, UnitComplex};

/// A map of up to `M` views and `N` landmarks, and the bearings that it is estimated from.
///
/// In `f32` a map of 8 views and 12 landmarks takes 1840 bytes, one of 16 views and 24 landmarks
/// 6752, and the [`Workspace`](super::Workspace) for each 4672 and 17024; in `f64` twice that.
///
/// # Example
/// A map from the scans of three views, then a fourth view, all refined:
/// ```
/// use bearslam::{Branch, FixedMap, RefineOptions, Workspace, bearing_to, pose};
/// use nalgebra::Point2;
///
/// let views = [pose(0.0, 0.0, 0.0), pose(1.0, 0.0, 0.4), pose(0.3, 0.8, -0.7), pose(1.5, 1.0, 2.0_f32)];
/// let points = [(2.0, 1.0), (-1.0, 2.0), (0.5, 3.0), (1.5, -2.0), (-2.0, -1.0), (3.0, 0.5)];
///
/// let mut map = FixedMap::<f32, 4, 6>::new();
/// let mut workspace = Workspace::<f32, 4, 6>::new();
/// for (view, pose) in views.iter().enumerate() {
///     for (landmark, &(x, y)) in points.iter().enumerate() {
///         if let Some(bearing) = bearing_to(pose, &Point2::new(x, y)) {
///             map.see(view, landmark, bearing, 0.01)?;
///         }
///     }
/// }
/// map.start([0, 1, 2], Branch::Best)?;
/// map.add_view(3)?;
/// let outcome = map.refine(&mut workspace, &RefineOptions::default())?;
/// assert!(outcome.termination.was_successful() && map.rms() < 1e-5);
/// assert!((map.landmarks[2].unwrap() - Point2::new(0.5, 3.0)).norm() < 1e-3);
/// # Ok::<(), bearslam::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FixedMap<T: Real, const M: usize, const N: usize> {
    /// The pose of each view; `None` where it is not determined.
    pub poses: [Option<Pose<T>>; M],
    /// The position of each landmark; `None` where it is not determined.
    pub landmarks: [Option<Point2<T>>; N],
    /// By landmark, then by view.
    pub(crate) sightings: [[Option<Ray<T>>; M]; N],
}

impl<T: Real, const M: usize, const N: usize> Default for FixedMap<T, M, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const M: usize, const N: usize> FixedMap<T, M, N> {
    /// An empty map.
    pub const fn new() -> Self {
        Self {
            poses: [None; M],
            landmarks: [None; N],
            sightings: [[None; M]; N],
        }
    }

    /// Stores a sighting, replacing any earlier one of this landmark from this view.
    ///
    /// `sigma` is the standard deviation of the bearing \[rad\].
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a view or landmark beyond the map, [`Error::NotFinite`] for a bearing that
    /// is not finite, [`Error::NotPositive`] for a `sigma` that is not positive (or whose inverse square
    /// over- or underflows).
    pub fn see(
        &mut self,
        view: usize,
        landmark: usize,
        bearing: Bearing<T>,
        sigma: T,
    ) -> Result<(), Error> {
        let weight = T::one() / sigma;
        let square = weight * weight;
        if !(sigma > T::zero() && square > T::zero() && square.is_finite()) {
            return Err(Error::NotPositive {
                what: "sigma",
                index: 0,
                value: sigma.as_f64(),
            });
        }
        if !bearing.norm_sqr().is_finite() {
            return Err(Error::NotFinite {
                what: "bearing",
                index: 0,
            });
        }
        check_view::<M>(view)?;
        check_landmark::<N>(landmark)?;
        if let Some(seen) = self
            .sightings
            .get_mut(landmark)
            .and_then(|seen| seen.get_mut(view))
        {
            *seen = Some(Ray { bearing, weight });
        }
        Ok(())
    }

    /// Removes a view with all its sightings, so that another can take its place.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a view beyond the map.
    pub fn forget_view(&mut self, view: usize) -> Result<(), Error> {
        check_view::<M>(view)?;
        let sightings = self
            .sightings
            .iter_mut()
            .filter_map(|seen| seen.get_mut(view));
        sightings.for_each(|seen| *seen = None);
        self.poses
            .iter_mut()
            .skip(view)
            .take(1)
            .for_each(|pose| *pose = None);
        Ok(())
    }

    /// Removes a landmark with all its sightings, so that another can take its place.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a landmark beyond the map.
    pub fn forget_landmark(&mut self, landmark: usize) -> Result<(), Error> {
        check_landmark::<N>(landmark)?;
        self.sightings
            .iter_mut()
            .skip(landmark)
            .take(1)
            .for_each(|seen| *seen = [None; M]);
        self.landmarks
            .iter_mut()
            .skip(landmark)
            .take(1)
            .for_each(|point| *point = None);
        Ok(())
    }

    /// View, landmark and residual of every sighting between determined views and landmarks: predicted
    /// minus measured bearing \[rad\] in (-pi, pi].
    pub fn residuals(&self) -> impl Iterator<Item = (usize, usize, T)> + '_ {
        self.rows()
            .map(|(view, landmark, row)| (view, landmark, row.residual / row.weight))
    }

    /// Half the sum of squared residuals over sigma.
    pub fn cost(&self) -> T {
        let squares = self.rows().map(|(_, _, row)| row.residual * row.residual);
        squares.fold(T::zero(), |sum, square| sum + square) * T::lit(0.5)
    }

    /// Root mean square of the residuals \[rad\]; 0 when there are none.
    pub fn rms(&self) -> T {
        let (mut sum, mut count) = (T::zero(), T::zero());
        for (_, _, residual) in self.residuals() {
            sum += residual * residual;
            count += T::one();
        }
        if count > T::zero() {
            (sum / count).sqrt()
        } else {
            T::zero()
        }
    }

    /// Brings the map into the gauge of this crate: the first determined view at the origin with heading
    /// 0, and a root-mean-square distance of 1 of the other views from it.
    ///
    /// Unchanged when all views are in one place, or too far apart for the number type.
    pub fn normalize(&mut self) {
        let mut views = self.poses.iter().flatten();
        let Some(first) = views.next().copied() else {
            return;
        };
        let (mut sum, mut count) = (T::zero(), T::zero());
        for pose in views {
            sum += (pose.translation.vector - first.translation.vector).norm_squared();
            count += T::one();
        }
        let scale = (count / sum).sqrt();
        if !(scale > T::zero() && scale.is_finite()) {
            return;
        }
        let home = first.inverse();
        let shift = Translation2::from(home.translation.vector * scale);
        let similarity = Similarity2::from_parts(shift, home.rotation, scale);
        for (k, pose) in self.poses.iter_mut().flatten().enumerate() {
            // Make the first view exact, and rotations unit again.
            *pose = if k == 0 {
                Pose::identity()
            } else {
                let moved = transform_pose(&similarity, pose);
                let rotation = UnitComplex::from_complex(moved.rotation.into_inner());
                Pose::from_parts(moved.translation, rotation)
            };
        }
        for point in self.landmarks.iter_mut().flatten() {
            *point = similarity.transform_point(point);
        }
    }

    /// View, landmark and linearised residual of every sighting between determined views and landmarks.
    pub(super) fn rows(&self) -> impl Iterator<Item = (usize, usize, BearingRow<T>)> + '_ {
        let landmarks = self.landmarks.iter().zip(&self.sightings).enumerate();
        landmarks.flat_map(move |(landmark, (point, seen))| {
            let sightings = self.poses.iter().zip(seen).enumerate();
            sightings.filter_map(move |(view, (pose, seen))| {
                let row = BearingRow::new(pose.as_ref()?, point.as_ref()?, seen.as_ref()?, true);
                Some((view, landmark, row))
            })
        })
    }

    /// The determined landmarks that a view sees, with their bearings.
    pub(super) fn of_view(
        &self,
        view: usize,
    ) -> impl Iterator<Item = (Point2<T>, Bearing<T>)> + Clone + '_ {
        let landmarks = self.landmarks.iter().zip(&self.sightings);
        landmarks.filter_map(move |(point, seen)| {
            let seen = seen.get(view)?.as_ref()?;
            Some(((*point)?, seen.bearing))
        })
    }

    /// The determined views that see a landmark, with their bearings.
    pub(super) fn of_landmark(
        &self,
        landmark: usize,
    ) -> impl Iterator<Item = (Pose<T>, Bearing<T>)> + Clone + '_ {
        let sightings = self.sightings.iter().skip(landmark).take(1).flatten();
        self.poses.iter().zip(sightings).filter_map(|(pose, seen)| {
            let seen = seen.as_ref()?;
            Some(((*pose)?, seen.bearing))
        })
    }
}

pub(super) fn check_view<const M: usize>(view: usize) -> Result<(), Error> {
    check_index("view", view, M)
}

pub(super) fn check_landmark<const N: usize>(landmark: usize) -> Result<(), Error> {
    check_index("landmark", landmark, N)
}

fn check_index(what: &'static str, value: usize, bound: usize) -> Result<(), Error> {
    if value < bound {
        return Ok(());
    }
    Err(Error::OutOfRange {
        what,
        index: 0,
        value,
        bound,
    })
}
