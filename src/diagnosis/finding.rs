// SPDX-License-Identifier: MIT OR Apache-2.0
//! What can be wrong with a problem. `sentences` holds the name and the texts of each kind.

use crate::problem::Subject;
use alloc::string::String;
use alloc::vec::Vec;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Something is not determined.
    Error,
    /// Something is poorly determined, or only as long as the noise is small.
    Warning,
    /// Worth knowing.
    Note,
}

impl Severity {
    /// The name of the variant in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Note => "note",
        }
    }
}

/// The kind of a finding. `docs/diagnosis.md` explains each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Kind {
    /// Views or landmarks with fewer sightings than determine them.
    TooFewSightings,
    /// Parts not connected by any sighting.
    Disconnected,
    /// At most two views.
    TwoViews,
    /// At most three landmarks.
    TooFewLandmarks,
    /// Fewer sightings than unknowns.
    Counting,
    /// Views or landmarks that the map cannot be extended to.
    Unreached,
    /// All bearings of each view are equal modulo pi: everything is on one line.
    EverythingOnOneLine,
    /// The views are on one line and the landmarks on another.
    LinesOfViewsAndOfLandmarks,
    /// All views, more than three, and all landmarks are on one circle.
    ViewsAndLandmarksOnOneCircle,
    /// Three views and all landmarks are on one circle.
    ThreeViewsAndLandmarksOnOneCircle,
    /// Views in one place: pure rotation.
    CoincidentViews,
    /// All landmarks are on one line.
    CollinearLandmarks,
    /// There are exactly four landmarks, and they are on one circle.
    FourLandmarksOnACircle,
    /// There are exactly three views, and they are on one line.
    ThreeCollinearViews,
    /// There are exactly three views, and the landmarks are on a cubic curve through them.
    LandmarksOnACubic,
    /// A view on one circle with all landmarks that it sees (the danger circle of resection).
    ViewOnCircleOfLandmarks,
    /// A landmark on one line with all views that see it: direction known, range not.
    LandmarkOnLineOfViews,
    /// Landmarks so far away that only their directions are known.
    LandmarksAtInfinity,
    /// A part that can move, turn or change its scale as a whole relative to the rest.
    LoosePart,
    /// A free direction that no other kind explains.
    UnnamedDirection,
    /// A direction that the bearings determine so weakly that noise moves the map far along it.
    WeaklyDetermined,
    /// Another map, such as the mirror image of three views, explains the bearings nearly as well.
    SecondSolution,
    /// No map has been found that explains the bearings.
    UnexplainedBearings,
    /// So many bearings are outliers that the others may agree by chance, and exchanged identities do not explain them.
    WeakConsensus,
    /// The residuals are too large for the stated standard deviations.
    PoorFit,
    /// An observation contradicts the others.
    Blunder,
    /// All bearings of a sensor are turned by one angle.
    TurnedBearings,
    /// The bearings are clockwise.
    MirroredBearings,
    /// The residuals are somewhat larger than the stated standard deviations predict.
    UnderstatedSigma,
    /// The residuals are smaller than the stated standard deviations predict.
    OverstatedSigma,
    /// No examination of a map was possible: only the sightings have been counted.
    NotExamined,
}

/// One thing that is wrong, what it concerns, and what to do about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Its kind.
    pub kind: Kind,
    /// How bad it is.
    pub severity: Severity,
    /// The views concerned.
    pub views: Vec<usize>,
    /// The landmarks concerned.
    pub landmarks: Vec<usize>,
    /// Number of free directions that it explains.
    pub directions: usize,
    /// What is wrong.
    pub message: String,
    /// What to add.
    pub advice: String,
}

/// Separates views and landmarks, each sorted and without duplicates.
pub fn apart(subjects: impl IntoIterator<Item = Subject>) -> (Vec<usize>, Vec<usize>) {
    let (mut views, mut landmarks) = (Vec::new(), Vec::new());
    for subject in subjects {
        match subject {
            Subject::View(view) => views.push(view),
            Subject::Landmark(landmark) => landmarks.push(landmark),
        }
    }
    for list in [&mut views, &mut landmarks] {
        list.sort_unstable();
        list.dedup();
    }
    (views, landmarks)
}
