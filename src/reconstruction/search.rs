// SPDX-License-Identifier: MIT OR Apache-2.0
//! The search for the lowest minimum from bearings alone.

pub(crate) mod first_three;
pub(crate) mod four_landmarks;
pub(crate) mod hypotheses;
pub(crate) mod minima;
pub(crate) mod moves;
pub(crate) mod options;
pub(crate) mod plain;
pub(crate) mod tensor_circle;
pub(crate) mod triples;
