// SPDX-License-Identifier: MIT OR Apache-2.0
//! Views and landmarks by index, and why one of them has no estimate.

use core::fmt;

/// A view or a landmark, by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// A view.
    View(usize),
    /// A landmark.
    Landmark(usize),
}

/// Why a view or landmark has no estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Why {
    /// It has fewer sightings than it needs: three for a view, two for a landmark.
    TooFewSightings {
        /// How many it has.
        got: usize,
        /// How many it needs.
        needed: usize,
    },
    /// Enough sightings, but too few of them connect it with the part of the map that is determined.
    NotConnected {
        /// How many connect it.
        got: usize,
        /// How many it needs.
        needed: usize,
    },
    /// Enough sightings, but too many of them are outliers.
    TooFewInliers {
        /// How many are inliers.
        got: usize,
        /// How many it needs.
        needed: usize,
    },
    /// The start of the refinement has no value for it.
    NoStart,
    /// Its sightings do not determine it: parallel rays, or a view on one circle with its landmarks.
    Degenerate,
    /// Its sightings determine it, but do not agree with the map.
    Misfit,
    /// A landmark so far away that its rays are parallel within their noise: its direction is known,
    /// its range is not.
    AtInfinity,
}

/// A view or landmark without an estimate, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Undetermined {
    /// The view or landmark.
    pub subject: Subject,
    /// The reason.
    pub why: Why,
}

/// A count with its noun: `1 view`, `2 views`.
pub(crate) struct Count(pub usize, pub &'static str);

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(number, noun) = self;
        write!(f, "{number} {noun}{}", if *number == 1 { "" } else { "s" })
    }
}

/// How many views and landmarks have no estimate, as the end of a sentence: `; 1 landmark undetermined`.
pub(crate) struct Missing {
    pub views: usize,
    pub landmarks: usize,
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (views, landmarks) = (Count(self.views, "view"), Count(self.landmarks, "landmark"));
        match (self.views, self.landmarks) {
            (0, 0) => Ok(()),
            (_, 0) => write!(f, "; {views} undetermined"),
            (0, _) => write!(f, "; {landmarks} undetermined"),
            _ => write!(f, "; {views} and {landmarks} undetermined"),
        }
    }
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewSightings { got, needed } => {
                write!(f, "has {got} sightings, needs {needed}")
            }
            Self::NotConnected { got, needed } => write!(
                f,
                "has {got} sightings to the determined part of the map, needs {needed}"
            ),
            Self::TooFewInliers { got, needed } => {
                write!(f, "has {got} sightings that are inliers, needs {needed}")
            }
            Self::NoStart => write!(f, "the start has no value for it"),
            Self::Degenerate => write!(f, "its sightings do not determine it"),
            Self::Misfit => write!(f, "its sightings do not agree with the map"),
            Self::AtInfinity => write!(f, "its rays are parallel within their noise"),
        }
    }
}
