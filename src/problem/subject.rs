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
    /// It has fewer sightings than determine it: three for a view, two for a landmark.
    TooFewSightings {
        /// How many there are.
        got: usize,
        /// How many it takes.
        needed: usize,
    },
    /// Enough sightings, but too few of them connect it with the part of the map that is determined.
    NotConnected {
        /// How many connect it.
        got: usize,
        /// How many it takes.
        needed: usize,
    },
    /// Enough sightings, but the rest of the map contradicts too many of them.
    TooFewInliers {
        /// How many it does not contradict.
        got: usize,
        /// How many it takes.
        needed: usize,
    },
    /// The start of the refinement has no value for it.
    NoStart,
    /// Its sightings do not fix it: parallel rays, or a view on one circle with its landmarks.
    Degenerate,
    /// Its sightings fix it, but at a place where they do not agree with the map.
    Misfit,
    /// A landmark so far away that its rays are parallel within their noise: its direction is known,
    /// its range is not.
    AtInfinity,
}

/// A view or landmark without an estimate, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Undetermined {
    /// Which.
    pub subject: Subject,
    /// Why.
    pub why: Why,
}

/// A number of things: `1 view`, `2 views`.
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
                write!(
                    f,
                    "has {got} sightings that are no outliers, needs {needed}"
                )
            }
            Self::NoStart => write!(f, "the start has no value for it"),
            Self::Degenerate => write!(f, "its sightings do not fix it"),
            Self::Misfit => write!(f, "its sightings do not agree with the map"),
            Self::AtInfinity => write!(f, "its rays are parallel within their noise"),
        }
    }
}
