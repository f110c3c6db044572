// SPDX-License-Identifier: MIT OR Apache-2.0
//! The result of a diagnosis, and its text.

use super::finding::{Finding, Kind, Severity, apart};
use super::parts::components::Part;
use super::sentences::{both, count};
use crate::uncertainty::WeakDirection;
use alloc::vec::Vec;
use core::fmt;

/// A direction of the map that the bearings determine weakly or not at all; its cause is the kind of the finding
/// that explains it.
pub type NullDirection = WeakDirection<Kind>;

/// What the bearings determine and what they do not.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// Number of views.
    pub views: usize,
    /// Number of landmarks.
    pub landmarks: usize,
    /// Number of sightings.
    pub sightings: usize,
    /// Parts connected by sightings, without views and landmarks that have too few; most sightings first.
    pub components: Vec<Part>,
    /// Number of directions that are free beyond the gauge of each part.
    pub extra: usize,
    /// The smallest singular values of the Jacobian of the first part that was examined, without the gauge,
    /// over the norm of its median column: ascending, up to eight. Empty when there was no map.
    pub singular_values: Vec<f64>,
    /// Largest singular value over the smallest that is not zero; NaN when there was no map.
    pub condition: f64,
    /// Standard deviation of a bearing \[rad\] that was assumed: stated by the problem or estimated from the residuals.
    pub noise: f64,
    /// Whether there are three views on one line, or so near it that noise hides the difference.
    pub near_collinear: bool,
    /// How many times larger the residuals of the next best map are, such as the mirror image of three views;
    /// infinite when none was found, NaN when none was sought.
    pub mirror_margin: f64,
    /// Directions that are free or weak, part by part, the weakest first.
    pub directions: Vec<NullDirection>,
    /// What is wrong, the worst first.
    pub findings: Vec<Finding>,
}

impl Diagnosis {
    /// Whether the bearings determine everything.
    pub fn determined(&self) -> bool {
        self.worst()
            .is_none_or(|severity| severity > Severity::Error)
    }

    /// The severity of the worst finding.
    pub fn worst(&self) -> Option<Severity> {
        self.findings.iter().map(|finding| finding.severity).min()
    }

    /// The first finding of a kind.
    pub fn find(&self, kind: Kind) -> Option<&Finding> {
        self.findings.iter().find(|finding| finding.kind == kind)
    }
}

/// Maximum number of directions that are printed, about a screen of text with the findings. `directions` has all.
const MAX_LISTED: usize = 4;

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match self.worst() {
            _ if self.find(Kind::UnexplainedBearings).is_some() => "no map that explains them",
            Some(Severity::Error) => "not determined",
            _ if self
                .find(Kind::PoorFit)
                .or(self.find(Kind::Blunder))
                .is_some() =>
            {
                "determined, but observations contradict each other"
            }
            Some(Severity::Warning) => "determined, but weakly",
            _ => "determined",
        };
        write!(
            f,
            "{} of {} from {}: {verdict}",
            count(self.sightings, "sighting"),
            count(self.landmarks, "landmark"),
            count(self.views, "view")
        )?;
        for finding in &self.findings {
            write!(f, "\n{finding}")?;
        }
        for direction in self.directions.iter().take(MAX_LISTED) {
            let (views, landmarks) = apart(direction.movers.iter().map(|&(subject, _)| subject));
            let moved = both(&views, &landmarks);
            if direction.free {
                write!(f, "\nfree direction: moves {moved}")?;
            } else {
                let percent = direction.deviation * 100.0;
                write!(
                    f,
                    "\nweak direction: {percent:.0} % of the size of the map; moves {moved}"
                )?;
            }
        }
        if self.directions.len() > MAX_LISTED {
            write!(
                f,
                "\nand {} more directions",
                self.directions.len() - MAX_LISTED
            )?;
        }
        Ok(())
    }
}
