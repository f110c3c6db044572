// SPDX-License-Identifier: MIT OR Apache-2.0
//! The observations: which view sees which landmark at which bearing, odometry and priors.

use super::magnitudes::check_data;
use super::priors::{LandmarkPrior, Odometry, PosePrior, Prior};
use super::sighting::{IndexedSighting, Sighting};
use super::subject::Subject;
use crate::error::Error;
use crate::geometry::{Bearing, Pose, signed_angle};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use nalgebra::{Point2, Vector2};

/// All observations, validated on construction: sightings, sorted by view and then landmark, odometry and
/// priors.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    landmarks: usize,
    sightings: Vec<IndexedSighting>,
    /// Index of the first sighting of each view in `sightings`, and the end.
    view_start: Vec<usize>,
    /// Indices into `sightings`, landmark by landmark.
    by_landmark: Vec<usize>,
    landmark_start: Vec<usize>,
    /// For each sighting, its index in the input.
    input: Vec<usize>,
    /// Whether a bearing is a ray; otherwise it is a line, known modulo pi.
    oriented: bool,
    /// Odometry and priors.
    priors: Vec<Prior>,
}

impl Problem {
    /// A problem from a list of sightings, in any order.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an index that is not below `views` or `landmarks`, [`Error::NotFinite`] and
    /// [`Error::NotPositive`] for an invalid number, [`Error::Duplicate`] when a view sees a landmark twice.
    pub fn new(views: usize, landmarks: usize, sightings: &[Sighting]) -> Result<Self, Error> {
        for (index, sighting) in sightings.iter().enumerate() {
            sighting.check(index, views, landmarks)?;
        }
        let mut input: Vec<usize> = (0..sightings.len()).collect();
        input.sort_by_key(|&k| (sightings[k].view, sightings[k].landmark));
        for pair in input.windows(2) {
            let (a, b) = (&sightings[pair[0]], &sightings[pair[1]]);
            if (a.view, a.landmark) == (b.view, b.landmark) {
                return Err(Error::Duplicate {
                    view: a.view,
                    landmark: a.landmark,
                    first: pair[0],
                    second: pair[1],
                });
            }
        }
        let seen = input.iter().map(|&k| sightings[k].indexed()).collect();
        Ok(Self::index(views, landmarks, seen, input))
    }

    /// A problem from a `views x landmarks` table of bearings \[rad\], row by row; NaN where a view
    /// did not see a landmark. All bearings have the same standard deviation.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] when the table does not have that size, [`Error::NotFinite`] for an
    /// infinite bearing, [`Error::NotPositive`] for an invalid `sigma`.
    pub fn dense(
        views: usize,
        landmarks: usize,
        bearings: &[f64],
        sigma: f64,
    ) -> Result<Self, Error> {
        if views.checked_mul(landmarks) != Some(bearings.len()) {
            return Err(Error::LengthMismatch {
                what: "bearings",
                expected: views.saturating_mul(landmarks),
                got: bearings.len(),
            });
        }
        let sightings: Vec<_> = bearings
            .iter()
            .enumerate()
            .filter(|(_, bearing)| !bearing.is_nan())
            .map(|(k, &bearing)| Sighting {
                view: k / landmarks,
                landmark: k % landmarks,
                bearing,
                sigma,
            })
            .collect();
        Self::new(views, landmarks, &sightings)
    }

    /// The same problem with bearings known only modulo pi: lines, not rays.
    ///
    /// Each heading is then known only modulo pi as well, independently of the others.
    pub fn unoriented(mut self) -> Self {
        self.oriented = false;
        self
    }

    /// The same problem with additional odometry.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a view that the problem does not have, [`Error::SameView`] for a motion from a
    /// view to itself, [`Error::NotFinite`], [`Error::NotPositive`] and [`Error::NotSymmetric`] for invalid
    /// numbers.
    pub fn with_odometry(mut self, odometry: &[Odometry]) -> Result<Self, Error> {
        for (index, motion) in odometry.iter().enumerate() {
            let &Odometry { start, end, .. } = motion;
            check_index("odometry: start", index, start, self.views())?;
            check_index("odometry: end", index, end, self.views())?;
            if start == end {
                return Err(Error::SameView { index, view: start });
            }
            check_pose("odometry: delta", index, &motion.delta)?;
            let root = motion.noise.root("odometry: sigma", index)?;
            // A motion with an unknown component does not determine one pose from the other.
            if (0..3).any(|k| root[k][k] <= 0.0) {
                return Err(Error::NotFinite {
                    what: "odometry: sigma",
                    index,
                });
            }
            self.priors.push(Prior::Motion {
                start,
                end,
                delta: motion.delta,
                root,
            });
        }
        Ok(self)
    }

    /// The same problem with additional priors on poses.
    ///
    /// # Errors
    /// As [`Problem::with_odometry`].
    pub fn with_pose_priors(mut self, priors: &[PosePrior]) -> Result<Self, Error> {
        for (index, prior) in priors.iter().enumerate() {
            check_index("pose priors: view", index, prior.view, self.views())?;
            check_pose("pose priors: pose", index, &prior.pose)?;
            self.priors.push(Prior::Pose {
                view: prior.view,
                pose: prior.pose,
                root: prior.noise.root("pose priors: sigma", index)?,
            });
        }
        Ok(self)
    }

    /// The same problem with additional priors on landmarks.
    ///
    /// # Errors
    /// As [`Problem::with_odometry`].
    pub fn with_landmark_priors(mut self, priors: &[LandmarkPrior]) -> Result<Self, Error> {
        for (index, prior) in priors.iter().enumerate() {
            let &LandmarkPrior {
                landmark, position, ..
            } = prior;
            check_index("landmark priors: landmark", index, landmark, self.landmarks)?;
            for coordinate in [position.x, position.y] {
                check_data("landmark priors: position", index, coordinate)?;
            }
            self.priors.push(Prior::Landmark {
                landmark,
                position,
                root: prior.noise.root("landmark priors: sigma", index)?,
            });
        }
        Ok(self)
    }

    /// Builds the index over sightings that are sorted by view and landmark.
    fn index(
        views: usize,
        landmarks: usize,
        sightings: Vec<IndexedSighting>,
        input: Vec<usize>,
    ) -> Self {
        let mut view_start = vec![0; views + 1];
        let mut landmark_start = vec![0; landmarks + 1];
        for s in &sightings {
            view_start[s.view + 1] += 1;
            landmark_start[s.landmark + 1] += 1;
        }
        for starts in [&mut view_start, &mut landmark_start] {
            for k in 1..starts.len() {
                starts[k] += starts[k - 1];
            }
        }
        let mut next = landmark_start.clone();
        let mut by_landmark = vec![0; sightings.len()];
        for (k, s) in sightings.iter().enumerate() {
            by_landmark[next[s.landmark]] = k;
            next[s.landmark] += 1;
        }
        Self {
            landmarks,
            sightings,
            view_start,
            by_landmark,
            landmark_start,
            input,
            oriented: true,
            priors: Vec::new(),
        }
    }

    /// Number of views.
    pub fn views(&self) -> usize {
        self.view_start.len() - 1
    }

    /// Number of landmarks.
    pub fn landmarks(&self) -> usize {
        self.landmarks
    }

    /// Whether bearings are rays; otherwise they are lines, known only modulo pi.
    pub fn is_oriented(&self) -> bool {
        self.oriented
    }

    /// The same problem without odometry and priors.
    pub(crate) fn bearings_only(mut self) -> Self {
        self.priors.clear();
        self
    }

    /// The same problem without priors, but with its odometry.
    pub(crate) fn with_odometry_only(mut self) -> Self {
        self.priors
            .retain(|prior| matches!(prior, Prior::Motion { .. }));
        self
    }

    /// Whether the standard deviations of the bearings are stated: all of one radian only say that they are equal.
    pub fn states_sigma(&self) -> bool {
        self.sightings.iter().any(|s| s.weight != 1.0)
    }

    /// The same problem with other bearings.
    pub(crate) fn with_bearings(&self, bearing: impl Fn(&IndexedSighting) -> Bearing<f64>) -> Self {
        let mut other = self.clone();
        for s in &mut other.sightings {
            s.bearing = bearing(s);
        }
        other
    }

    /// The same problem without one of the motions and priors.
    pub(crate) fn without_prior(&self, place: usize) -> Self {
        let mut rest = self.clone();
        rest.priors.remove(place);
        rest
    }

    /// Odometry and priors.
    pub(crate) fn priors(&self) -> &[Prior] {
        &self.priors
    }

    /// All sightings, sorted by view and then landmark.
    pub fn sightings(&self) -> &[IndexedSighting] {
        &self.sightings
    }

    /// For each sighting its index in the list or table that the problem was made from; in a table, NaN
    /// entries are not counted.
    pub fn input_order(&self) -> &[usize] {
        &self.input
    }

    /// The bearing residual of a sighting \[rad\]: predicted minus measured, in (-pi, pi]; for lines in
    /// (-pi/2, pi/2].
    #[inline]
    pub(crate) fn residual(
        &self,
        pose: &Pose<f64>,
        point: &Point2<f64>,
        s: &IndexedSighting,
    ) -> f64 {
        let turned = Self::along_and_across(pose, point, s);
        // A landmark exactly on its view has no bearing, and no residual.
        if turned.x == 0.0 && turned.y == 0.0 {
            return 0.0;
        }
        if self.oriented || turned.x >= 0.0 {
            signed_angle(turned.x, turned.y)
        } else {
            signed_angle(-turned.x, -turned.y)
        }
    }

    /// Where a landmark is as its view sees it: along the measured bearing, and across it to the left.
    #[inline]
    pub(crate) fn along_and_across(
        pose: &Pose<f64>,
        point: &Point2<f64>,
        s: &IndexedSighting,
    ) -> Vector2<f64> {
        let seen = pose.inverse_transform_point(point);
        s.bearing.inverse_transform_vector(&seen.coords)
    }

    /// Which landmarks have a prior.
    pub(crate) fn known_landmarks(&self) -> Vec<bool> {
        let mut known = vec![false; self.landmarks()];
        for prior in self.priors() {
            if let Prior::Landmark { landmark, .. } = prior {
                known[*landmark] = true;
            }
        }
        known
    }

    /// The sightings of a view.
    pub fn of_view(&self, view: usize) -> &[IndexedSighting] {
        &self.sightings[self.range_of_view(view)]
    }

    /// The range of [`Problem::sightings`] that belongs to a view.
    pub(crate) fn range_of_view(&self, view: usize) -> Range<usize> {
        self.view_start[view]..self.view_start[view + 1]
    }

    /// The sightings of a landmark, by index into [`Problem::sightings`].
    pub fn of_landmark(&self, landmark: usize) -> &[usize] {
        &self.by_landmark[self.landmark_start[landmark]..self.landmark_start[landmark + 1]]
    }

    /// The same problem with input indices that refer to its own sightings.
    pub(crate) fn on_its_own(mut self) -> Self {
        self.input = (0..self.sightings.len()).collect();
        self
    }

    /// The problem with only the kept sightings, selected by index in [`Problem::sightings`], as if they
    /// were the input; views and landmarks keep their indices.
    pub(crate) fn subset(&self, keep: &[bool]) -> Self {
        let kept = self.sightings.iter().zip(keep).filter(|(_, keep)| **keep);
        let sightings: Vec<IndexedSighting> = kept.map(|(seen, _)| *seen).collect();
        let input = (0..sightings.len()).collect();
        Self {
            oriented: self.oriented,
            priors: self.priors.clone(),
            ..Self::index(self.views(), self.landmarks, sightings, input)
        }
    }

    /// The same problem with other landmarks for its sightings, in the order of [`Problem::sightings`]. No view may have
    /// a landmark twice.
    pub(crate) fn relabelled(&self, landmarks: &[usize]) -> Self {
        let mut all: Vec<(IndexedSighting, usize)> = self
            .sightings
            .iter()
            .zip(landmarks)
            .map(|(seen, &landmark)| IndexedSighting { landmark, ..*seen })
            .zip(self.input.iter().copied())
            .collect();
        all.sort_by_key(|(seen, _)| (seen.view, seen.landmark));
        let (sightings, input) = all.into_iter().unzip();
        Self {
            oriented: self.oriented,
            priors: self.priors.clone(),
            ..Self::index(self.views(), self.landmarks, sightings, input)
        }
    }

    /// The problem with the inliers alone, which are given in the order of the input.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] when there are not as many as sightings.
    pub(crate) fn of_inliers(&self, inliers: &[bool]) -> Result<Self, Error> {
        if inliers.len() != self.input.len() {
            return Err(Error::LengthMismatch {
                what: "inliers",
                expected: self.input.len(),
                got: inliers.len(),
            });
        }
        let kept: Vec<bool> = self.input.iter().map(|&place| inliers[place]).collect();
        Ok(self.subset(&kept))
    }

    /// The part of the problem between the kept views and landmarks, renumbered in order. Input indices
    /// refer to the sightings of this problem.
    pub(crate) fn restrict(&self, keep_view: &[bool], keep_landmark: &[bool]) -> Self {
        let number = |keep: &[bool]| {
            let mut next = 0;
            let numbers: Vec<usize> = keep
                .iter()
                .map(|&k| {
                    next += usize::from(k);
                    next - usize::from(k)
                })
                .collect();
            (numbers, next)
        };
        let (view_number, views) = number(keep_view);
        let (landmark_number, landmarks) = number(keep_landmark);
        let mut sightings = Vec::with_capacity(self.sightings.len());
        let mut input = Vec::with_capacity(self.sightings.len());
        for (k, s) in self.sightings.iter().enumerate() {
            if keep_view[s.view] && keep_landmark[s.landmark] {
                sightings.push(IndexedSighting {
                    view: view_number[s.view],
                    landmark: landmark_number[s.landmark],
                    ..*s
                });
                input.push(k);
            }
        }
        let kept = |prior: &&Prior| {
            prior
                .subjects()
                .iter()
                .flatten()
                .all(|subject| match *subject {
                    Subject::View(view) => keep_view[view],
                    Subject::Landmark(landmark) => keep_landmark[landmark],
                })
        };
        let priors = self.priors.iter().filter(kept);
        let priors =
            priors.map(|prior| prior.moved(|v| view_number[v], |l| landmark_number[l], 1.0));
        Self {
            oriented: self.oriented,
            priors: priors.collect(),
            ..Self::index(views, landmarks, sightings, input)
        }
    }

    /// The same problem with all known positions shifted.
    pub(crate) fn shifted(&self, offset: Vector2<f64>) -> Self {
        let priors = self.priors.iter().map(|prior| prior.shifted(offset));
        Self {
            priors: priors.collect(),
            ..self.clone()
        }
    }

    /// The same problem in another unit of length; bearings do not depend on it.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        for prior in &mut scaled.priors {
            *prior = prior.moved(|view| view, |landmark| landmark, factor);
        }
        scaled
    }
}

fn check_index(what: &'static str, index: usize, value: usize, bound: usize) -> Result<(), Error> {
    if value < bound {
        return Ok(());
    }
    Err(Error::OutOfRange {
        what,
        index,
        value,
        bound,
    })
}

fn check_pose(what: &'static str, index: usize, pose: &Pose<f64>) -> Result<(), Error> {
    let place = &pose.translation.vector;
    for coordinate in [place.x, place.y] {
        check_data(what, index, coordinate)?;
    }
    if pose.rotation.norm_sqr().is_finite() {
        return Ok(());
    }
    Err(Error::NotFinite { what, index })
}
