// SPDX-License-Identifier: MIT OR Apache-2.0
//! Closed-form estimators without a heap: constant memory for any number of landmarks.

mod calibrated;
#[cfg(feature = "alloc")]
mod four_landmarks;
mod gram;
mod lanes;
mod motion;
mod null_space;
mod null_vector_5x6;
mod projective;
mod resect;
mod signs;
mod tensor;
mod three_view;
mod triangular;
mod triangulate;
mod view_triangle;

pub use calibrated::CalibratedTensor;
#[cfg(feature = "alloc")]
pub(crate) use four_landmarks::{DualTensor, Quadruple};
pub use motion::Motion;
pub use projective::{
    Epipoles, epipoles, intrinsic_homographies, projective_tensor, real_epipoles,
};
pub(crate) use resect::MIN_LANDMARKS_OF_VIEW;
pub use resect::{Resection, resect};
pub use tensor::TrifocalTensor;
pub use three_view::{Method, ThreeView, three_view, three_view_with_landmarks, trifocal_tensor};
#[cfg(feature = "python")]
pub(crate) use three_view::{three_view_while, trifocal_tensor_while};
pub(crate) use triangulate::MIN_VIEWS_OF_LANDMARK;
#[cfg(feature = "alloc")]
pub(crate) use triangulate::{LineOfSight, meeting};
pub use triangulate::{Triangulation, triangulate};

use crate::error::Error;
use crate::geometry::Bearing;
use crate::scalar::Real;

/// One landmark as three views see it: the bearings in the frames of views 0, 1 and 2.
pub type Triple<T> = [Bearing<T>; 3];

/// An error for the first landmark with a bearing that is not finite.
fn check_finite<T: Real>(triples: &[Triple<T>]) -> Result<(), Error> {
    let finite = |triple: &Triple<T>| triple.iter().all(|b| b.re.is_finite() && b.im.is_finite());
    match triples.iter().position(|triple| !finite(triple)) {
        None => Ok(()),
        Some(index) => Err(Error::NotFinite {
            what: "bearings",
            index,
        }),
    }
}
