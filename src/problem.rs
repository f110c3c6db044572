// SPDX-License-Identifier: MIT OR Apache-2.0
//! Input and output: sightings, odometry and priors; poses and landmarks.

mod magnitudes;
mod map;
mod noise;
mod priors;
#[expect(clippy::module_inception, reason = "the type that the module is about")]
mod problem;
#[cfg(feature = "serde")]
mod serialized;
mod sighting;
mod subject;

pub(crate) use crate::kernels::{MIN_LANDMARKS_OF_VIEW, MIN_VIEWS_OF_LANDMARK};
pub use magnitudes::{DATA_MAGNITUDES, SIGMA_MAGNITUDES};
pub(crate) use magnitudes::{check_data, check_sigma};
pub use map::Map;
pub(crate) use map::ON_VIEW;
pub use noise::Noise;
pub(crate) use priors::Prior;
pub use priors::{LandmarkPrior, Odometry, PosePrior};
pub use problem::Problem;
pub use sighting::{IndexedSighting, Sighting};
pub(crate) use subject::{Count, Missing};
pub use subject::{Subject, Undetermined, Why};
