// SPDX-License-Identifier: MIT OR Apache-2.0
//! The choice of the map to examine.

pub mod choose;
pub mod explaining_map;
pub mod four_landmarks;
pub mod from_bearings;
pub mod wall_family;
