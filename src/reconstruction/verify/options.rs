// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the verification of a map.

/// Options of the verification of a map: [`SolveOptions::verify`](crate::SolveOptions::verify).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct VerifyOptions {
    /// Largest width of a cell in each of five coordinates of the unit tensor: the resolution of the search. Their number
    /// grows with up to the fifth power of its inverse.
    pub width: f64,
    /// Maximum number of cells that are searched in all, also where a lower map starts the search anew. With 12 views of
    /// 15 landmarks a cell takes below a millisecond.
    pub cells: usize,
    /// Maximum number of triples of views that are compared: all of up to 23 views.
    pub triples: usize,
}

impl Default for VerifyOptions {
    fn default() -> Self {
        Self {
            width: 0.1,
            cells: 20_000,
            triples: 2000,
        }
    }
}
