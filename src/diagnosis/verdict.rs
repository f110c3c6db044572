// SPDX-License-Identifier: MIT OR Apache-2.0
//! From what a map tells to findings.

use super::beyond::weakest;
use super::describe::{configuration, finding};
use super::finding::{Finding, Kind, Severity, apart};
use super::maps::choose::{Evidence, Judged};
use super::parts::subproblem::Own;
use super::report::{Diagnosis, NullDirection};
use super::shapes::examine::{Direction, Examination, examine};
use super::shapes::normalized_map::Figure;
use super::words::both;
use crate::diagnosis::parts::counting;
use crate::problem::{Map, Subject, Undetermined, Why};
use alloc::format;
use alloc::vec::Vec;

/// Residuals \[rad\] above which a map explains nothing.
const PLAUSIBLE_RMS: f64 = 0.1;

/// Residuals of a second map that are less than this many times those of the best leave a doubt.
const CLEAR_MARGIN: f64 = 3.0;

/// Singular values that are reported.
const REPORTED: usize = 8;

impl Own {
    /// Adds what the evidence tells to a diagnosis. `hopeless` when counting has told the worst already.
    pub fn judge(&self, judged: &Judged, hopeless: bool, diagnosis: &mut Diagnosis) {
        let noise = judged.noise;
        diagnosis.noise = f64::max(diagnosis.noise, noise);
        let findings = &mut diagnosis.findings;
        match &judged.evidence {
            Evidence::Figure(figure) => match examine(figure, noise) {
                Some(found) => self.report(figure, &found, noise, hopeless, diagnosis),
                None => findings.push(self.not_examined(TOO_LARGE)),
            },
            Evidence::Map { map, lost, margin } => {
                self.absent(map, lost, findings);
                findings.extend(self.poor_fit(map));
                let figure = Figure::of_map(&self.problem, map);
                let examined = figure.as_ref().map(|figure| examine(figure, noise));
                match (&figure, &examined) {
                    (Some(figure), Some(Some(found))) => {
                        let doubtful = *margin < CLEAR_MARGIN && found.causes.is_empty();
                        if doubtful {
                            findings.push(self.second(*margin));
                        }
                        self.report(figure, found, noise, hopeless, diagnosis);
                    }
                    (Some(_), _) => {
                        let sigmas = noise * self.mean_weight();
                        let outer = |subject| self.outer(subject);
                        weakest(&self.problem, map, sigmas, &outer, diagnosis);
                    }
                    (None, _) => findings.push(self.not_examined("the map has no size")),
                }
                diagnosis.mirror_margin = f64::min(diagnosis.mirror_margin, *margin);
            }
        }
    }

    /// What the map has no value for.
    fn absent(&self, map: &Map, lost: &[Undetermined], findings: &mut Vec<Finding>) {
        let views = map.poses.iter().enumerate();
        let views = views
            .filter(|(_, pose)| pose.is_none())
            .map(|(k, _)| Subject::View(k));
        let landmarks = map.landmarks.iter().enumerate();
        let landmarks = landmarks
            .filter(|(_, point)| point.is_none())
            .map(|(k, _)| Subject::Landmark(k));
        let far = |subject: &Subject| {
            let mut lost = lost.iter();
            lost.any(|u| u.subject == *subject && u.why == Why::AtInfinity)
        };
        let (infinite, absent): (Vec<Subject>, Vec<Subject>) =
            views.chain(landmarks).partition(|subject| far(subject));
        let outer = |list: Vec<Subject>| apart(list.into_iter().map(|subject| self.outer(subject)));
        let ((no_views, infinite), (views, landmarks)) = (outer(infinite), outer(absent));
        if !infinite.is_empty() {
            let kind = Kind::LandmarksAtInfinity;
            findings.push(configuration(kind, Severity::Error, no_views, infinite, 0));
        }
        if views.len() + landmarks.len() > 0 {
            findings.push(finding(
                Kind::Unreached,
                Severity::Error,
                views.clone(),
                landmarks.clone(),
                0,
                &format!("{} are not in the map", both(&views, &landmarks)),
                "A view needs three landmarks of the map that are not on one circle with it, a landmark two \
                 views of the map that are not in line with it.",
            ));
        }
    }

    fn poor_fit(&self, map: &Map) -> Option<Finding> {
        let (rms, _) = self.spread(map);
        (rms > PLAUSIBLE_RMS).then(|| {
            self.about_all(
                Kind::PoorFit,
                Severity::Warning,
                &format!(
                    "the map leaves residuals of {:.1} degrees, so its shape is no evidence",
                    rms.to_degrees()
                ),
                "Look for wrong correspondences, or give a better map.",
            )
        })
    }

    fn second(&self, margin: f64) -> Finding {
        self.about_all(
            Kind::SecondSolution,
            Severity::Warning,
            &format!(
                "another map explains the bearings nearly as well, with residuals {margin:.1} times as large"
            ),
            "Add a view of five of the landmarks: it tells the two apart.",
        )
    }

    /// Adds an examination to a diagnosis.
    fn report(
        &self,
        figure: &Figure,
        found: &Examination,
        noise: f64,
        hopeless: bool,
        diagnosis: &mut Diagnosis,
    ) {
        let spectrum = &found.spectrum;
        if diagnosis.singular_values.is_empty() {
            let values = spectrum.values.iter().map(|value| value / spectrum.scale);
            diagnosis.singular_values = values.take(REPORTED).collect();
            let held = spectrum.values.get(spectrum.free());
            if let (Some(held), Some(largest)) = (held, spectrum.values.last()) {
                diagnosis.condition = largest / held;
            }
        }
        diagnosis.extra += spectrum.free();
        diagnosis.near_collinear |= found
            .causes
            .iter()
            .any(|cause| cause.kind == Kind::ThreeCollinearViews);
        let findings = &mut diagnosis.findings;
        findings.extend(self.named(figure, found));
        findings.extend(self.unnamed(figure, found, hopeless));
        if !hopeless {
            findings.extend(self.weak(figure, found, noise));
        }
        for direction in &found.directions {
            let movers = direction.movers.iter();
            diagnosis.directions.push(NullDirection {
                free: direction.free,
                singular_value: spectrum.values[direction.index] / spectrum.scale,
                deviation: direction.deviation,
                movers: movers
                    .map(|&(point, share)| (self.outer(figure.subject(point)), share))
                    .collect(),
                cause: direction.cause.map(|k| found.causes[k].kind),
            });
        }
    }

    /// The shapes that leave directions free.
    fn named(&self, figure: &Figure, found: &Examination) -> Vec<Finding> {
        let causes = found.causes.iter().enumerate();
        let findings = causes.map(|(k, cause)| {
            let explained = found.directions.iter().filter(|d| d.cause == Some(k));
            let deviation = explained.map(|d| d.deviation).fold(0.0, f64::max);
            // Two solutions that merge are still solutions, and one point off leaves the others; a family
            // of maps is none.
            let bounded = matches!(
                cause.kind,
                Kind::ThreeCollinearViews
                    | Kind::ViewOnCircleOfLandmarks
                    | Kind::LandmarkOnLineOfViews
            );
            let severity = if bounded && deviation <= 1.0 {
                Severity::Warning
            } else {
                Severity::Error
            };
            let points = cause.points.iter();
            let (views, landmarks) = apart(points.map(|&p| self.outer(figure.subject(p))));
            configuration(cause.kind, severity, views, landmarks, cause.directions)
        });
        findings.collect()
    }

    /// Free directions that no shape explains.
    fn unnamed(&self, figure: &Figure, found: &Examination, hopeless: bool) -> Option<Finding> {
        // So many are those of the counting.
        let counted = if hopeless {
            counting::missing(&self.part)
        } else {
            0
        };
        let open = found.directions.iter();
        let open = open.filter(|d| d.free && d.cause.is_none());
        let rest: Vec<_> = open.skip(counted).collect();
        let mut concerned = self.movers(figure, &rest);
        let kind = if found.structural > counted {
            Kind::LoosePart
        } else if figure.views.len() == 3 {
            concerned = (self.part.views.clone(), self.part.landmarks.clone());
            Kind::LandmarksOnACubic
        } else {
            Kind::UnnamedDirection
        };
        let (views, landmarks) = concerned;
        (!rest.is_empty())
            .then(|| configuration(kind, Severity::Error, views, landmarks, rest.len()))
    }

    /// Weak directions that no shape explains.
    fn weak(&self, figure: &Figure, found: &Examination, noise: f64) -> Option<Finding> {
        let weak = found.directions.iter();
        let weak: Vec<_> = weak.filter(|d| !d.free && d.cause.is_none()).collect();
        let (views, landmarks) = self.movers(figure, &weak);
        let worst = weak.iter().map(|d| d.largest).fold(0.0, f64::max);
        (!weak.is_empty()).then(|| {
            finding(
                Kind::WeaklyDetermined,
                Severity::Warning,
                views.clone(),
                landmarks.clone(),
                weak.len(),
                &format!(
                    "noise of {:.3} degrees leaves {} uncertain by up to {:.0} % of the size of the map",
                    noise.to_degrees(),
                    both(&views, &landmarks),
                    100.0 * worst,
                ),
                "Add sightings of them, from other places or of other landmarks.",
            )
        })
    }

    /// Who moves in some directions.
    fn movers(&self, figure: &Figure, directions: &[&Direction]) -> (Vec<usize>, Vec<usize>) {
        let points = directions.iter().flat_map(|d| d.movers.iter());
        apart(points.map(|&(point, _)| self.outer(figure.subject(point))))
    }

    pub fn not_examined(&self, why: &str) -> Finding {
        let message = format!("only the sightings have been counted: {why}");
        self.about_all(Kind::NotExamined, Severity::Note, &message, "")
    }

    /// A finding about the whole part.
    fn about_all(&self, kind: Kind, severity: Severity, message: &str, advice: &str) -> Finding {
        let (views, landmarks) = (self.part.views.clone(), self.part.landmarks.clone());
        finding(kind, severity, views, landmarks, 0, message, advice)
    }
}

const TOO_LARGE: &str = "the map has too many unknowns for all its singular values";
