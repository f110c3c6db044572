// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps from bearings with outliers.
//!
//! The cost is half the sum of squared residuals over sigma, each truncated at three sigma. Five random
//! landmarks of three random views give a motion (`sampling`); the motions with most support are grown to
//! whole maps (`expand`) by robust resection and triangulation (`place`), and refined to minima
//! (`consensus`). The search ends when seeds from two triples of views have led to the lowest minimum. That
//! one is improved by changing sightings, views and landmarks one at a time (`exchange`, `reassign`), and
//! confirmed by the non-robust search over its inliers.
//!
//! Exchanged identities agree by chance with as many bearings of a wrong map as the true one has left. So maps are ranked
//! by what they explain once identities are assigned anew (`assignment`, `identities`), and where these explain much more
//! than the inliers, the map is improved under them.
//!
//! Under limited sight a map grows view by view instead (`growth`, `consensus_places`), parts of it are grown again
//! from the rest (`regrow`) or from a seed of their own (`rejoin`), and sightings are exchanged view by view (`toggle`).

mod assignment;
mod candidate;
pub(crate) mod consensus;
mod consensus_places;
mod exchange;
pub(crate) mod expand;
mod growth;
pub(crate) mod identities;
pub(crate) mod motions;
pub(crate) mod options;
pub(crate) mod place;
pub(crate) mod reassign;
mod regrow;
mod rejoin;
mod sampling;
pub(crate) mod solve;
mod toggle;
