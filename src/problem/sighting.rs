// SPDX-License-Identifier: MIT OR Apache-2.0
//! One bearing: as given, and as a problem stores it.

use super::magnitudes::{check_data, check_sigma};
use crate::error::Error;
use crate::geometry::Bearing;

/// One bearing from a view to a landmark.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Sighting {
    /// Index of the view.
    pub view: usize,
    /// Index of the landmark.
    pub landmark: usize,
    /// Angle from the heading of the view, counter-clockwise \[rad\].
    pub bearing: f64,
    /// Standard deviation of the bearing \[rad\]; 1 where only the relative weight matters.
    pub sigma: f64,
}

/// A sighting as the problem stores it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndexedSighting {
    /// Index of the view.
    pub view: usize,
    /// Index of the landmark.
    pub landmark: usize,
    /// The bearing as a unit vector.
    pub bearing: Bearing<f64>,
    /// One over the standard deviation.
    pub weight: f64,
}

impl Sighting {
    /// Rejects indices that are out of range and numbers that are invalid.
    pub(super) fn check(&self, index: usize, views: usize, landmarks: usize) -> Result<(), Error> {
        for (what, value, bound) in [
            ("view", self.view, views),
            ("landmark", self.landmark, landmarks),
        ] {
            if value >= bound {
                return Err(Error::OutOfRange {
                    what,
                    index,
                    value,
                    bound,
                });
            }
        }
        check_data("bearing", index, self.bearing)?;
        check_sigma("sigma", index, self.sigma)
    }

    /// The sighting as a problem stores it.
    pub(super) fn indexed(&self) -> IndexedSighting {
        IndexedSighting {
            view: self.view,
            landmark: self.landmark,
            bearing: Bearing::new(self.bearing),
            weight: 1.0 / self.sigma,
        }
    }
}
