// SPDX-License-Identifier: MIT OR Apache-2.0
//! What the verification of a map has shown.

use crate::problem::Count;
use core::fmt;

/// What the verification of a map has shown: [`Reconstruction::certificate`](crate::Reconstruction::certificate).
///
/// Every map of lower cost has the trifocal tensor of three of its views inside a cone; that is proved. The cone is
/// divided into cells of a stated width, and the maps grown from the centre of each are refined; that none of them is
/// lower is a search, no proof.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// The three views whose tensor is confined; `None` where no three were found.
    pub views: Option<[usize; 3]>,
    /// Half the opening angle of the cone of unit tensors \[rad\]: 0 where there is no lower map, NaN without a cone.
    pub cone: f64,
    /// Number of cells whose maps were refined.
    pub cells: usize,
    /// How the verification ended.
    pub verdict: Verdict,
}

impl Certificate {
    /// Whether every map of lower cost is excluded, by the bound alone or by the search of the whole cone.
    pub fn verified(&self) -> bool {
        self.verdict.reason().is_none()
    }
}

/// How the verification of a map ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Verdict {
    /// Verified by the bound alone: no map of all sightings has a lower cost.
    NoLowerMap,
    /// Verified by search: no cell of the cone leads to a lower cost.
    Searched,
    /// The refinement of the map has not converged.
    NotConverged,
    /// The map leaves out what has sightings enough, or consists of several maps.
    Incomplete,
    /// No three views share five landmarks.
    TooFewShared,
    /// The noise is too large to confine the tensor of any three views.
    NoCone,
    /// The cone has more cells than may be searched.
    TooManyCells,
}

impl Verdict {
    /// Why the map is not verified; `None` where it is.
    pub const fn reason(self) -> Option<&'static str> {
        match self {
            Self::NoLowerMap | Self::Searched => None,
            Self::NotConverged => Some("the refinement has not converged"),
            Self::Incomplete => Some("the map leaves out views or landmarks, or consists of parts"),
            Self::TooFewShared => Some("no three views share five landmarks"),
            Self::NoCone => {
                Some("the residuals are too large to confine the tensor of any three views")
            }
            Self::TooManyCells => Some("the cone has more cells than may be searched"),
        }
    }
}

/// One line: `verified: no lower cost in 8 cells of a cone of 4.9 deg`.
impl fmt::Display for Certificate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.verdict.reason() {
            Some(reason) => write!(f, "not verified: {reason}"),
            None if self.verdict == Verdict::Searched => {
                let (cells, degrees) = (Count(self.cells, "cell"), self.cone.to_degrees());
                write!(
                    f,
                    "verified: no lower cost in {cells} of a cone of {degrees:.1} deg"
                )
            }
            None => write!(f, "verified: no map has a lower cost"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn a_certificate_says_what_was_shown() {
        let certificate = |verdict, cells| Certificate {
            views: Some([0, 3, 7]),
            cone: 0.1,
            cells,
            verdict,
        };
        for (verdict, cells, expected) in [
            (
                Verdict::Searched,
                8,
                "verified: no lower cost in 8 cells of a cone of 5.7 deg",
            ),
            (
                Verdict::Searched,
                1,
                "verified: no lower cost in 1 cell of a cone of 5.7 deg",
            ),
            (Verdict::NoLowerMap, 0, "verified: no map has a lower cost"),
            (
                Verdict::TooManyCells,
                0,
                "not verified: the cone has more cells than may be searched",
            ),
        ] {
            let certificate = certificate(verdict, cells);
            assert_eq!(certificate.to_string(), expected);
            assert_eq!(certificate.verified(), expected.starts_with("verified"));
        }
    }
}
