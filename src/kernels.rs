// SPDX-License-Identifier: MIT OR Apache-2.0
//! Closed-form estimators of fixed size: no heap, constant memory for any number of landmarks.

mod calibrated;
mod motion;
mod projective;
mod resect;
mod tensor;
mod three_view;
mod triangular;
mod triangulate;

pub use calibrated::CalibratedTensor;
pub use motion::Motion;
pub use projective::{
    Epipoles, epipoles, intrinsic_homographies, projective_tensor, real_epipoles,
};
pub use resect::{Resection, resect};
pub use tensor::TrifocalTensor;
pub use three_view::{Method, ThreeView, three_view, trifocal_tensor};
pub use triangular::{NullSpace, TriangularFactor};
pub use triangulate::{Triangulation, triangulate};

use crate::geometry::Bearing;

/// One landmark as three views see it: the bearings in the frames of views 0, 1 and 2.
pub type Triple<T> = [Bearing<T>; 3];
