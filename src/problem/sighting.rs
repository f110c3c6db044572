// SPDX-License-Identifier: MIT OR Apache-2.0
//! One bearing: as given, and as a problem stores it.

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
        for (what, value) in [("bearing", self.bearing), ("sigma", self.sigma)] {
            if !value.is_finite() {
                return Err(Error::NotFinite { what, index });
            }
        }
        let weight = 1.0 / self.sigma;
        let square = weight * weight;
        // The square must be finite and positive as well, or the cost is useless.
        if !(self.sigma > 0.0 && square > 0.0 && square.is_finite()) {
            return Err(Error::NotPositive {
                what: "sigma",
                index,
                value: self.sigma,
            });
        }
        Ok(())
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
