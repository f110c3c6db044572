// SPDX-License-Identifier: MIT OR Apache-2.0
//! Serialisation of poses as `[x, y, theta]` \[length, rad\] and of points as `[x, y]`.
//!
//! Any number read as theta gives a valid rotation, unlike a pair of numbers read as a complex number.

/// `#[serde(with = ...)]` of a pose.
pub mod pose {
    use crate::geometry::{Pose, pose, xytheta};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(pose: &Pose<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        xytheta(pose).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Pose<f64>, D::Error> {
        <[f64; 3]>::deserialize(deserializer).map(|[x, y, theta]| pose(x, y, theta))
    }
}

/// `#[serde(with = ...)]` of a point.
pub mod point {
    use nalgebra::Point2;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(point: &Point2<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        [point.x, point.y].serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Point2<f64>, D::Error> {
        <[f64; 2]>::deserialize(deserializer).map(Point2::from)
    }
}
