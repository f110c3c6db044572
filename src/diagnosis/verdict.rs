// SPDX-License-Identifier: MIT OR Apache-2.0
//! Findings from a map: what is undetermined, what is free, what is weak.
//!
//! Maps of up to some hundred unknowns without odometry and priors are examined by all their singular values, and
//! free directions get the name of a shape. All others are examined by the weakest directions of the sparse normal
//! equations.

use super::finding::{Finding, Kind, Severity, apart};
use super::fit_findings::findings_at;
use super::maps::choose::{Chosen, Evidence};
use super::parts::counting::{concerning, missing};
use super::parts::subproblem::SubProblem;
use super::report::{Diagnosis, NullDirection};
use super::sentences::{Case, finding, finding_in};
use super::shapes::examine::{Examination, examine};
use super::shapes::normalized_map::NormalizedMap;
use crate::error::Error;
use crate::problem::{Map, Subject, Undetermined, Why};
use crate::reconstruction::{Progress, report_progress};
use crate::uncertainty::weakest_directions;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

impl SubProblem {
    /// Adds the findings from the evidence to a diagnosis. `hopeless` when counting has already found too little.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when `progress` says so.
    pub fn judge(
        &self,
        chosen: &Chosen,
        hopeless: bool,
        diagnosis: &mut Diagnosis,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<(), Error> {
        let noise = chosen.noise;
        diagnosis.noise = f64::max(diagnosis.noise, noise);
        let (map, lost, margin) = match &chosen.evidence {
            Evidence::Bearings(normalized) => {
                match examine(normalized, noise, &self.options.shapes) {
                    Some(found) => {
                        self.report_dense(normalized, &found, noise, hopeless, diagnosis)
                    }
                    None => diagnosis.findings.push(self.not_examined(TOO_LARGE)),
                }
                return Ok(());
            }
            Evidence::Map { map, lost, margin } => (map, lost, *margin),
        };
        self.report_absent(map, lost, Case::Usual, diagnosis);
        let unexplained = self.unexplained(map);
        if unexplained.is_none() && !hopeless {
            diagnosis.findings.extend(self.fit(map, progress)?);
        }
        diagnosis.findings.extend(unexplained);
        match NormalizedMap::of_map(&self.problem, map) {
            None => diagnosis
                .findings
                .push(self.not_examined("the map has no size")),
            Some(normalized) => match examine(&normalized, noise, &self.options.shapes) {
                Some(found) => {
                    if margin < self.options.verdict.clear_margin && found.causes.is_empty() {
                        diagnosis.findings.push(self.second_solution(margin));
                    }
                    self.report_dense(&normalized, &found, noise, hopeless, diagnosis);
                }
                None => self.report_sparse(map, Some(noise), hopeless, diagnosis, progress)?,
            },
        }
        diagnosis.mirror_margin = f64::min(diagnosis.mirror_margin, margin);
        Ok(())
    }

    /// Adds what is undetermined in the map although it has sightings.
    pub fn report_absent(
        &self,
        map: &Map,
        lost: &[Undetermined],
        case: Case,
        diagnosis: &mut Diagnosis,
    ) {
        let views = (0..map.poses.len())
            .filter(|&k| map.poses[k].is_none() && !self.problem.of_view(k).is_empty());
        let landmarks = (0..map.landmarks.len())
            .filter(|&k| map.landmarks[k].is_none() && !self.problem.of_landmark(k).is_empty());
        let absent = views
            .map(Subject::View)
            .chain(landmarks.map(Subject::Landmark));
        let far = |subject: &Subject| {
            let mut lost = lost.iter();
            lost.any(|u| u.subject == *subject && u.why == Why::AtInfinity)
        };
        let (infinite, unreached): (Vec<Subject>, Vec<Subject>) = absent.partition(far);
        for (kind, subjects) in [
            (Kind::LandmarksAtInfinity, infinite),
            (Kind::Unreached, unreached),
        ] {
            let subjects = self.outer_all(subjects);
            let found = concerning(case, kind, Severity::Error, subjects);
            diagnosis.findings.extend(found);
        }
    }

    fn unexplained(&self, map: &Map) -> Option<Finding> {
        let (rms, _) = self.rms_and_noise(map);
        let told = format!("{:.1}", rms.to_degrees());
        let (kind, severity) = (Kind::UnexplainedBearings, Severity::Warning);
        (rms > self.options.verdict.max_rms)
            .then(|| self.about_all(Case::Usual, kind, severity, &[("rms", told)]))
    }

    /// The findings of the test of the fit.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] when the normal equations do not fit into memory, [`Error::Interrupted`] when `progress`
    /// says so.
    pub fn fit(
        &self,
        map: &Map,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<Vec<Finding>, Error> {
        findings_at(&self.problem, map, &|subject| self.outer(subject), progress)
    }

    fn second_solution(&self, margin: f64) -> Finding {
        let (kind, severity) = (Kind::SecondSolution, Severity::Warning);
        let told = format!("{margin:.1}");
        self.about_all(Case::Usual, kind, severity, &[("margin", told)])
    }

    /// The finding that only the sightings of the part have been counted.
    pub fn not_examined(&self, why: &str) -> Finding {
        let (kind, severity) = (Kind::NotExamined, Severity::Note);
        self.about_all(Case::Usual, kind, severity, &[("why", why.to_string())])
    }

    /// A finding about the whole part.
    pub fn about_all(
        &self,
        case: Case,
        kind: Kind,
        severity: Severity,
        given: &[(&str, String)],
    ) -> Finding {
        let all = (self.part.views.clone(), self.part.landmarks.clone());
        finding_in(case, kind, severity, all, 0, given)
    }

    /// Adds an examination by all singular values.
    fn report_dense(
        &self,
        normalized: &NormalizedMap,
        found: &Examination,
        noise: f64,
        hopeless: bool,
        diagnosis: &mut Diagnosis,
    ) {
        let spectrum = &found.spectrum;
        if diagnosis.singular_values.is_empty() {
            let values = spectrum.values.iter().map(|value| value / spectrum.scale);
            diagnosis.singular_values = values.take(self.options.verdict.singular_values).collect();
            let held = spectrum.values.get(spectrum.free());
            if let (Some(held), Some(largest)) = (held, spectrum.values.last()) {
                diagnosis.condition = largest / held;
            }
        }
        diagnosis.near_collinear |= found
            .causes
            .iter()
            .any(|cause| cause.kind == Kind::ThreeCollinearViews);
        diagnosis.findings.extend(self.named(normalized, found));
        let named = found.directions.iter().cloned().map(|direction| {
            let cause = direction.cause.map(|cause| found.causes[cause].kind);
            direction.with_cause(cause)
        });
        let unnamed = if found.structural > self.counted(hopeless) {
            Kind::LoosePart
        } else if normalized.views.len() == 3 {
            Kind::LandmarksOnACubic
        } else {
            Kind::UnnamedDirection
        };
        self.report_directions(named.collect(), unnamed, Some(noise), hopeless, diagnosis);
    }

    /// The shapes that leave directions free.
    fn named(&self, normalized: &NormalizedMap, found: &Examination) -> Vec<Finding> {
        let causes = found.causes.iter().enumerate();
        let findings = causes.map(|(k, cause)| {
            let explained = found.directions.iter().filter(|d| d.cause == Some(k));
            let deviation = explained.map(|d| d.deviation).fold(0.0, f64::max);
            // Where two solutions merge, or one point is free, the rest is determined; in a family of maps it is not.
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
            let subjects = self.outer_all(cause.points.iter().map(|&p| normalized.subject(p)));
            finding(cause.kind, severity, subjects, cause.directions)
        });
        findings.collect()
    }

    /// Adds an examination by the sparse normal equations. `noise` is that of the bearings \[rad\]; `None` with
    /// odometry and priors, where the stated standard deviations are used.
    pub fn report_sparse(
        &self,
        map: &Map,
        noise: Option<f64>,
        hopeless: bool,
        diagnosis: &mut Diagnosis,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<(), Error> {
        let sigmas = noise.map_or(1.0, |noise| noise * self.mean_weight());
        let count = self.options.verdict.directions;
        let mut step = 0;
        let watch = &mut || {
            step += 1;
            let goes_on = report_progress(progress, "directions", step, count);
            goes_on.then_some(()).ok_or(Error::Interrupted)
        };
        let found = match weakest_directions(&self.problem, map, count, sigmas, watch) {
            Ok(found) => found,
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(_) => {
                let why = "the normal equations cannot be factorised".to_string();
                let subjects = self.outer_all(map.determined());
                let (kind, severity) = (Kind::NotExamined, Severity::Note);
                let told = finding_in(Case::Usual, kind, severity, subjects, 0, &[("why", why)]);
                diagnosis.findings.push(told);
                return Ok(());
            }
        };
        if diagnosis.singular_values.is_empty() {
            diagnosis.singular_values = found.iter().map(|d| d.singular_value).collect();
            let held = found.iter().find(|d| !d.free);
            diagnosis.condition = held.map_or(f64::NAN, |d| 1.0 / d.singular_value);
        }
        let open = found
            .into_iter()
            .filter(|d| d.free || self.options.shapes.is_weak(d.deviation, d.largest));
        let unnamed = Kind::UnnamedDirection;
        self.report_directions(open.collect(), unnamed, noise, hopeless, diagnosis);
        Ok(())
    }

    /// How many free directions counting has already found.
    fn counted(&self, hopeless: bool) -> usize {
        if hopeless { missing(&self.part) } else { 0 }
    }

    /// Adds free and weak directions, and findings for those that no shape explains: of the kind `unnamed` for free
    /// ones, for weak ones with the `noise` \[rad\] of bearings.
    fn report_directions(
        &self,
        mut directions: Vec<NullDirection>,
        unnamed: Kind,
        noise: Option<f64>,
        hopeless: bool,
        diagnosis: &mut Diagnosis,
    ) {
        for direction in &mut directions {
            for (subject, _) in &mut direction.movers {
                *subject = self.outer(*subject);
            }
        }
        diagnosis.extra += directions.iter().filter(|d| d.free).count();
        let movers = |directions: &[&NullDirection]| {
            let movers = directions.iter().flat_map(|d| d.movers.iter());
            apart(movers.map(|&(subject, _)| subject))
        };
        let open = directions.iter_mut();
        let open = open.filter(|d| d.free && d.cause.is_none());
        for direction in open.skip(self.counted(hopeless)) {
            direction.cause = Some(unnamed);
        }
        let free = directions.iter().filter(|d| d.cause == Some(unnamed));
        let free: Vec<_> = free.collect();
        let weak = directions.iter().filter(|d| !d.free && d.cause.is_none());
        let weak: Vec<_> = weak.collect();
        if !free.is_empty() {
            let subjects = if unnamed == Kind::LandmarksOnACubic {
                (self.part.views.clone(), self.part.landmarks.clone())
            } else {
                movers(&free)
            };
            let found = finding(unnamed, Severity::Error, subjects, free.len());
            diagnosis.findings.push(found);
        }
        if !weak.is_empty() && !hopeless {
            let worst = weak.iter().map(|d| d.largest).fold(0.0, f64::max);
            let mut given = Vec::from([("share", format!("{:.0}", 100.0 * worst))]);
            given.extend(noise.map(|noise| ("noise", format!("{:.3}", noise.to_degrees()))));
            let case = if noise.is_some() {
                Case::Usual
            } else {
                Case::WithPriors
            };
            diagnosis.findings.push(finding_in(
                case,
                Kind::WeaklyDetermined,
                Severity::Warning,
                movers(&weak),
                weak.len(),
                &given,
            ));
        }
        diagnosis.directions.append(&mut directions);
    }
}

const TOO_LARGE: &str = "the map has too many unknowns to compute its singular values";
