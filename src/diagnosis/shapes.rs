// SPDX-License-Identifier: MIT OR Apache-2.0
//! The geometry of a map.

pub mod configuration;
pub mod examine;
pub mod moving_points;
pub mod normalized_map;
pub mod shape;
pub mod spectrum;
