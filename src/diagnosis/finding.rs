// SPDX-License-Identifier: MIT OR Apache-2.0
//! What can be wrong with a problem, by name.

use crate::problem::Subject;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Something is not determined.
    Error,
    /// Something is determined badly, or hangs on the noise.
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
    /// Parts that no sighting connects.
    Disconnected,
    /// Two views, or one.
    TwoViews,
    /// Three landmarks, or fewer.
    TooFewLandmarks,
    /// Fewer sightings than unknowns.
    Counting,
    /// Views or landmarks that too few sightings tie to the rest.
    Unreached,
    /// All bearings of a view are alike modulo pi: everything is on one line.
    EverythingOnOneLine,
    /// The views are on one line and the landmarks on another.
    LinesOfViewsAndOfLandmarks,
    /// All views, more than three, and all landmarks are on one circle.
    ViewsAndLandmarksOnOneCircle,
    /// Three views and all landmarks are on one circle.
    ThreeViewsAndLandmarksOnOneCircle,
    /// Views in one place: turning on the spot.
    CoincidentViews,
    /// All landmarks are on one line.
    CollinearLandmarks,
    /// There are exactly four landmarks, and they are on one circle.
    FourLandmarksOnACircle,
    /// There are exactly three views, and they are on one line.
    ThreeCollinearViews,
    /// There are exactly three views, and the landmarks are on a cubic curve through them.
    LandmarksOnACubic,
    /// A view on one circle with all landmarks that it sees.
    ViewOnCircleOfLandmarks,
    /// A landmark on one line with all views that see it.
    LandmarkOnLineOfViews,
    /// Landmarks so far away that only their directions are known.
    LandmarksAtInfinity,
    /// A part that can move, turn and grow as a whole against the rest.
    LoosePart,
    /// A free direction that none of the other names explains.
    UnnamedDirection,
    /// A direction that the bearings hold, but weakly.
    WeaklyDetermined,
    /// Another map, such as the mirror image of three views, explains the bearings nearly as well.
    SecondSolution,
    /// No map has been found that explains the bearings.
    PoorFit,
    /// Too many unknowns for the singular values: only the sightings have been counted.
    NotExamined,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 24] = [
        Self::TooFewSightings,
        Self::Disconnected,
        Self::TwoViews,
        Self::TooFewLandmarks,
        Self::Counting,
        Self::Unreached,
        Self::EverythingOnOneLine,
        Self::LinesOfViewsAndOfLandmarks,
        Self::ViewsAndLandmarksOnOneCircle,
        Self::ThreeViewsAndLandmarksOnOneCircle,
        Self::CoincidentViews,
        Self::CollinearLandmarks,
        Self::FourLandmarksOnACircle,
        Self::ThreeCollinearViews,
        Self::LandmarksOnACubic,
        Self::ViewOnCircleOfLandmarks,
        Self::LandmarkOnLineOfViews,
        Self::LandmarksAtInfinity,
        Self::LoosePart,
        Self::UnnamedDirection,
        Self::WeaklyDetermined,
        Self::SecondSolution,
        Self::PoorFit,
        Self::NotExamined,
    ];

    /// The name of the variant in lower case with underscores.
    pub fn name(self) -> &'static str {
        match self {
            Self::TooFewSightings => "too_few_sightings",
            Self::Disconnected => "disconnected",
            Self::TwoViews => "two_views",
            Self::TooFewLandmarks => "too_few_landmarks",
            Self::Counting => "counting",
            Self::Unreached => "unreached",
            Self::EverythingOnOneLine => "everything_on_one_line",
            Self::LinesOfViewsAndOfLandmarks => "lines_of_views_and_of_landmarks",
            Self::ViewsAndLandmarksOnOneCircle => "views_and_landmarks_on_one_circle",
            Self::ThreeViewsAndLandmarksOnOneCircle => "three_views_and_landmarks_on_one_circle",
            Self::CoincidentViews => "coincident_views",
            Self::CollinearLandmarks => "collinear_landmarks",
            Self::FourLandmarksOnACircle => "four_landmarks_on_a_circle",
            Self::ThreeCollinearViews => "three_collinear_views",
            Self::LandmarksOnACubic => "landmarks_on_a_cubic",
            Self::ViewOnCircleOfLandmarks => "view_on_circle_of_landmarks",
            Self::LandmarkOnLineOfViews => "landmark_on_line_of_views",
            Self::LandmarksAtInfinity => "landmarks_at_infinity",
            Self::LoosePart => "loose_part",
            Self::UnnamedDirection => "unnamed_direction",
            Self::WeaklyDetermined => "weakly_determined",
            Self::SecondSolution => "second_solution",
            Self::PoorFit => "poor_fit",
            Self::NotExamined => "not_examined",
        }
    }
}

/// One thing that is wrong, whom it concerns, and what to do about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What kind of thing.
    pub kind: Kind,
    /// How bad.
    pub severity: Severity,
    /// The views that it concerns.
    pub views: Vec<usize>,
    /// The landmarks that it concerns.
    pub landmarks: Vec<usize>,
    /// Free directions that it explains.
    pub directions: usize,
    /// What is wrong.
    pub message: String,
    /// What to add.
    pub advice: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            kind,
            severity,
            message,
            advice,
            ..
        } = self;
        write!(f, "{} ({}): {message}", severity.name(), kind.name())?;
        if !advice.is_empty() {
            write!(f, " {advice}")?;
        }
        Ok(())
    }
}

/// Views and landmarks apart, each in order and once.
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
