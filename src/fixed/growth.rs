// SPDX-License-Identifier: MIT OR Apache-2.0
//! An initial map from three views, and views and landmarks added to it one by one.

use super::map::{FixedMap, check_landmark, check_view};
use crate::error::Error;
use crate::geometry::Bearing;
use crate::kernels::{
    Method, Resection, ThreeView, Triangulation, Triple, resect, three_view, triangulate,
};
use crate::scalar::Real;

/// The choice between the two maps that explain three views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// The one with fewer inconsistent sightings, then the lower cost.
    Best,
    /// The other.
    Other,
}

/// Rounds of Sampson weights at the start: two reach the accuracy of maximum likelihood.
const REWEIGHTS: usize = 2;

impl<T: Real, const M: usize, const N: usize> FixedMap<T, M, N> {
    /// Restarts the map from three views that have at least five landmarks in common.
    ///
    /// All poses and landmarks are discarded, all sightings kept. The three views get the poses of a
    /// motion of [`three_view`]: the first at the origin with heading 0, the second at distance 1.
    /// Landmarks that at least two of them see are triangulated. The motions of both branches are
    /// returned. If they have the same number of inconsistent sightings, continue with both, each in a map
    /// of its own, until the cost with a fourth view decides. The stack holds `3 N` bearings in addition to
    /// what [`three_view`] needs.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a view beyond the map, and those of [`three_view`]; the map is then
    /// unchanged.
    ///
    /// # Example
    /// See [`FixedMap`].
    pub fn start(&mut self, views: [usize; 3], branch: Branch) -> Result<ThreeView<T>, Error> {
        for view in views {
            check_view::<M>(view)?;
        }
        let mut triples = [[Bearing::identity(); 3]; N];
        let mut count = 0;
        for (triple, to) in self.triples(views).zip(&mut triples) {
            *to = triple;
            count += 1;
        }
        let method = Method::Calibrated {
            reweights: REWEIGHTS,
        };
        let found = three_view(triples.get(..count).unwrap_or_default(), method)?;
        let [best, other] = &found.motions;
        let motion = match branch {
            Branch::Best => best,
            Branch::Other => other,
        };
        self.poses = [None; M];
        self.landmarks = [None; N];
        for (view, pose) in views.into_iter().zip(motion.poses) {
            self.poses
                .iter_mut()
                .skip(view)
                .take(1)
                .for_each(|to| *to = Some(pose));
        }
        for landmark in 0..N {
            // A landmark that cannot be triangulated stays undetermined.
            let _ = self.add_landmark(landmark);
        }
        Ok(found)
    }

    /// The landmarks that three views see in common.
    fn triples(&self, views: [usize; 3]) -> impl Iterator<Item = Triple<T>> + '_ {
        self.sightings.iter().filter_map(move |seen| {
            let [a, b, c] = views.map(|view| {
                let seen = seen.get(view)?.as_ref()?;
                Some(seen.bearing)
            });
            Some([a?, b?, c?])
        })
    }

    /// Adds a view, or replaces its pose, by resection from the determined landmarks that it sees.
    ///
    /// Check the result: a view with sightings `behind` it or a large `misfit` contradicts the map, and one
    /// whose `gap` is no larger than the `misfit` is not determined.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a view beyond the map, and those of [`resect`], such as [`Error::TooFew`]
    /// below three landmarks; the map is then unchanged.
    ///
    /// # Example
    /// See [`FixedMap`].
    pub fn add_view(&mut self, view: usize) -> Result<Resection<T>, Error> {
        check_view::<M>(view)?;
        let found = resect(self.of_view(view))?;
        self.poses
            .iter_mut()
            .skip(view)
            .take(1)
            .for_each(|pose| *pose = Some(found.pose));
        Ok(found)
    }

    /// Adds a landmark, or replaces its position, by triangulation from the determined views that see it.
    ///
    /// Check the result: a landmark that is `behind` a view contradicts the map.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a landmark beyond the map, and those of [`triangulate`], such as
    /// [`Error::TooFew`] below two views; the map is then unchanged.
    ///
    /// # Example
    /// ```
    /// use bearslam::{Bearing, FixedMap, pose};
    ///
    /// let mut map = FixedMap::<f64, 2, 1>::new();
    /// map.poses = [Some(pose(0.0, 0.0, 0.0)), Some(pose(2.0, 0.0, 0.0))];
    /// map.see(0, 0, Bearing::new(45_f64.to_radians()), 0.01)?;
    /// assert!(map.add_landmark(0).is_err());
    /// map.see(1, 0, Bearing::new(135_f64.to_radians()), 0.01)?;
    /// assert_eq!(map.add_landmark(0)?.behind, 0);
    /// assert!((map.landmarks[0].unwrap().y - 1.0).abs() < 1e-15);
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn add_landmark(&mut self, landmark: usize) -> Result<Triangulation<T>, Error> {
        check_landmark::<N>(landmark)?;
        let found = triangulate(self.of_landmark(landmark))?;
        let place = self.landmarks.iter_mut().skip(landmark).take(1);
        place.for_each(|point| *point = Some(found.point));
        Ok(found)
    }
}
