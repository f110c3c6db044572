// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps from bearings some of which are wrong.
//!
//! What is minimised is half the sum of squared residuals over sigma, each counted up to the square of three
//! sigma at most. Five random landmarks of three random views give a motion (`sampling`); those
//! on which most other landmarks agree are grown to whole maps (`expand`) with estimates that outliers
//! do not move (`place`), and lowered to minima (`consensus`). It is enough when seeds from two triples
//! of views have led to the lowest. That one is improved by changing sightings, views and landmarks one
//! at a time (`exchange`, `reassign`), and confirmed by the plain search over its inliers.

pub(crate) mod consensus;
mod exchange;
pub(crate) mod expand;
pub(crate) mod motions;
pub(crate) mod options;
pub(crate) mod place;
pub(crate) mod reassign;
mod sampling;
pub(crate) mod solve;
