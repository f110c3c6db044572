// SPDX-License-Identifier: MIT OR Apache-2.0
//! The diagnosis: first what the sightings tell, then what a map tells.

use super::appearance::apparent;
use super::counting;
use super::describe::{configuration, finding};
use super::examine::{Examination, examine};
use super::family::Family;
use super::figure::Figure;
use super::finding::{Finding, Kind, Severity, apart};
use super::report::{Diagnosis, NullDirection};
use super::spectrum::MAX_PARAMETERS;
use super::structure::{Core, Part, tied};
use super::words::both;
use crate::error::Error;
use crate::estimation::{Map, Problem, RefineOptions, Subject, Undetermined, Why, refine_map};
use crate::reconstruction::{Progress, Witness, explaining, mirror_images, seed, witness};
use crate::scalar::Real;
use alloc::format;
use alloc::vec::Vec;
use nalgebra::ComplexField;

/// What the bearings determine and what they do not, with names for the reasons.
///
/// Counts sightings, finds parts, and looks at the singular values of the Jacobian at a map: the given
/// one, or one that explains the bearings, whether they determine it or not. Free and weak directions
/// are explained by shapes of the map: landmarks along a wall, views in one place, everything on one
/// circle and so on. The noise is that of the problem where its standard deviations are below 1,
/// else that of the residuals.
///
/// Never fails on degenerate, empty or disconnected problems: that is what it is for.
///
/// # Errors
/// [`Error::LengthMismatch`] when the map is not of the problem's size, [`Error::Interrupted`] when
/// `progress` says so.
///
/// # Example
/// ```
/// use bearslam::{Kind, Problem, diagnose};
/// // Five views of eight landmarks along a wall, two units away.
/// let mut table = Vec::new();
/// for (x, y) in [(0.0, 0.0), (1.1, 0.6), (2.0, -0.4), (3.2, 0.3), (4.1, -0.2_f64)] {
///     table.extend((0..8).map(|j| (2.0 - y).atan2(0.6 * f64::from(j) - x)));
/// }
/// let problem = Problem::dense(5, 8, &table, 1.0)?;
/// let diagnosis = diagnose(&problem, None, None)?;
/// assert!(!diagnosis.determined());
/// assert_eq!(diagnosis.findings[0].kind, Kind::CollinearLandmarks);
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn diagnose<T: Real>(
    problem: &Problem<T>,
    map: Option<&Map<T>>,
    progress: Option<Progress<'_>>,
) -> Result<Diagnosis, Error> {
    if let Some(map) = map {
        for (what, expected, got) in [
            ("poses", problem.views(), map.poses.len()),
            ("landmarks", problem.landmarks(), map.landmarks.len()),
        ] {
            if expected != got {
                return Err(Error::LengthMismatch {
                    what,
                    expected,
                    got,
                });
            }
        }
    }
    let core = Core::of(problem);
    let parts = core.parts(problem);
    let mut diagnosis = Diagnosis {
        views: problem.views(),
        landmarks: problem.landmarks(),
        sightings: problem.sightings().len(),
        components: parts.clone(),
        extra: 0,
        singular_values: Vec::new(),
        condition: f64::NAN,
        noise: 0.0,
        near_collinear: false,
        mirror_margin: f64::NAN,
        directions: Vec::new(),
        findings: Vec::new(),
    };
    let findings = &mut diagnosis.findings;
    findings.extend(counting::unseen(problem));
    findings.extend(counting::outside(problem, &core));
    findings.extend(counting::apart(&parts));
    if parts.is_empty() {
        let whole = Part {
            views: (0..problem.views()).collect(),
            landmarks: (0..problem.landmarks()).collect(),
            sightings: problem.sightings().len(),
        };
        diagnosis.extra = counting::missing(&whole);
        findings.extend(counting::too_little(&whole));
    }
    let mut progress = progress;
    for part in &parts {
        let mut work = Work::new(problem, part, map, &mut diagnosis);
        work.run(&mut progress)?;
    }
    diagnosis
        .findings
        .sort_by_key(|finding| (finding.severity, finding.kind));
    Ok(diagnosis)
}

/// One part at work.
struct Work<'a, T: Real> {
    part: &'a Part,
    /// The part as a problem of its own.
    problem: Problem<T>,
    given: Option<Map<T>>,
    diagnosis: &'a mut Diagnosis,
}

/// Residuals \[rad\] above which a map explains nothing.
const PLAUSIBLE_RMS: f64 = 0.1;

/// Noise \[rad\] up to which bearings are looked at for shapes when a map has told the noise, which it
/// may have from a wrong minimum: half a degree.
const APPARENT_NOISE: f64 = 0.01;

/// A map explains the bearings as well as another when its residuals are at most so many times as large.
const AS_GOOD: f64 = 3.0;

/// Steps that a member of a family gets, and their first damping.
const SETTLING: usize = 4;
const SETTLING_DAMPING: f64 = 1e-2;

/// Residuals of a second map that are less than this many times those of the best leave a doubt.
const CLEAR_MARGIN: f64 = 3.0;

impl<'a, T: Real> Work<'a, T> {
    fn new(
        problem: &Problem<T>,
        part: &'a Part,
        map: Option<&Map<T>>,
        diagnosis: &'a mut Diagnosis,
    ) -> Self {
        let mut views = alloc::vec![false; problem.views()];
        let mut landmarks = alloc::vec![false; problem.landmarks()];
        part.views.iter().for_each(|&view| views[view] = true);
        part.landmarks
            .iter()
            .for_each(|&landmark| landmarks[landmark] = true);
        Self {
            part,
            problem: problem.restrict(&views, &landmarks).on_its_own(),
            given: map.map(|map| Map {
                poses: part.views.iter().map(|&view| map.poses[view]).collect(),
                landmarks: part.landmarks.iter().map(|&k| map.landmarks[k]).collect(),
            }),
            diagnosis,
        }
    }

    fn run(&mut self, progress: &mut Option<Progress<'_>>) -> Result<(), Error> {
        let too_little = counting::too_little(self.part);
        let hopeless = too_little.is_some();
        self.diagnosis.findings.extend(too_little);
        let stated = self.stated_noise();
        if let Some(map) = self.given.take() {
            self.of_given(&map, stated, hopeless);
            return Ok(());
        }
        if hopeless {
            self.diagnosis.extra += counting::missing(self.part);
            return Ok(());
        }
        if let Some(figure) = apparent(&self.problem, stated.unwrap_or(0.0)) {
            self.of_figure(&figure, stated.unwrap_or(0.0), false);
            return Ok(());
        }
        let seed = seed(&self.problem);
        let tied = seed.map(|seed| tied(&self.problem, seed));
        self.diagnosis
            .findings
            .extend(counting::untied(self.part, tied.as_ref()));
        if tied.is_none() {
            return Ok(());
        }
        let reborrowed: Option<Progress<'_>> = match progress {
            Some(progress) => Some(&mut **progress),
            None => None,
        };
        let found = match witness(&self.problem, reborrowed) {
            Ok(found) => found,
            Err(error @ Error::Interrupted) => return Err(error),
            Err(_) => None,
        };
        let Some(found) = found else {
            self.not_examined("no map could be made from the bearings");
            return Ok(());
        };
        let noise = stated.unwrap_or_else(|| self.spread(&found.map).1);
        if stated.is_none()
            && let Some(figure) = apparent(&self.problem, f64::min(noise, APPARENT_NOISE))
        {
            self.of_figure(&figure, f64::min(noise, APPARENT_NOISE), false);
            return Ok(());
        }
        let mut rivals = mirror_images(&self.problem, &found.map);
        rivals.push(found.rival);
        self.margin_of(found.variance, &rivals);
        self.of_witness(&found, noise);
        Ok(())
    }

    /// Looks at the map that the bearings led to. Where something is free in it that has no name, the
    /// bearings allow other maps: at the one among them whose shape is known.
    fn of_witness(&mut self, found: &Witness<T>, noise: f64) {
        let own = self.examined(&found.map, noise);
        let doubt = own.is_none_or(|own| own.directions.iter().any(|d| d.largest > 1.0));
        let mut others = found.others.clone();
        if doubt || !found.undetermined.is_empty() {
            others.extend(explaining(&self.problem).into_iter().map(|other| other.map));
        }
        let none = Vec::new();
        let first = core::iter::once((&found.map, &found.undetermined));
        let maps: Vec<_> = first.chain(others.iter().map(|map| (map, &none))).collect();
        let members = || {
            maps.iter()
                .filter_map(|(map, lost)| Family::of(&self.problem, map, lost))
        };
        let aligned = members().find_map(|family| {
            let map = self.settled(family.aligned()?, &found.map, noise)?;
            self.shows(&map, Kind::LinesOfViewsAndOfLandmarks, noise)
                .then_some(map)
        });
        let compact = || {
            members().find_map(|family| {
                let map = self.settled(family.compact()?, &found.map, noise)?;
                self.shows(&map, Kind::CollinearLandmarks, noise)
                    .then_some(map)
            })
        };
        let four = || {
            let few = self.problem.landmarks() == 4;
            let shown = |map: &&Map<T>| self.shows(map, Kind::FourLandmarksOnACircle, noise);
            others.iter().filter(|_| few).find(shown).cloned()
        };
        match aligned.or_else(compact).or_else(four) {
            Some(map) => self.of_map(&map, Some(noise), &none, false, false),
            None => self.of_map(&found.map, Some(noise), &found.undetermined, false, false),
        }
    }

    /// A member of a family after a few steps of refinement, strongly damped so that it stays where it is
    /// in the family; `None` when it does not explain the bearings as a known map does.
    fn settled(&self, member: Map<T>, known: &Map<T>, noise: f64) -> Option<Map<T>> {
        let options = RefineOptions {
            max_iterations: SETTLING,
            damping: T::lit(SETTLING_DAMPING),
            ..RefineOptions::default()
        };
        let mut map = member;
        refine_map(&self.problem, &mut map, &options, None).ok()?;
        let bound = AS_GOOD * f64::max(self.spread(known).0, noise);
        (self.spread(&map).0 <= bound + T::eps().sqrt().as_f64()).then_some(map)
    }

    /// What a map tells.
    fn examined(&self, map: &Map<T>, noise: f64) -> Option<Examination> {
        Figure::of_map(&self.problem, map)
            .filter(|figure| figure.parameters() <= MAX_PARAMETERS)
            .and_then(|figure| examine(&figure, noise))
    }

    /// Whether a map has a shape that leaves directions free.
    fn shows(&self, map: &Map<T>, kind: Kind, noise: f64) -> bool {
        let found = self.examined(map, noise);
        found.is_some_and(|found| found.causes.iter().any(|cause| cause.kind == kind))
    }

    /// The landmarks that a given map has no place for though its views see them, in directions that are
    /// parallel within the noise.
    fn infinite(&self, map: &Map<T>, noise: f64) -> Vec<Undetermined> {
        let bound = 6.0 * noise + T::eps().sqrt().as_f64();
        let parallel = |landmark: usize| {
            let rays: Vec<_> = self
                .problem
                .of_landmark(landmark)
                .iter()
                .filter_map(|&k| {
                    let s = &self.problem.sightings()[k];
                    map.poses[s.view].map(|pose| pose.rotation * s.bearing)
                })
                .collect();
            let off = |ray| rays[0].angle_to(ray).as_f64().abs();
            rays.len() > 1 && rays.iter().all(|ray| off(ray) < bound)
        };
        (0..map.landmarks.len())
            .filter(|&landmark| map.landmarks[landmark].is_none() && parallel(landmark))
            .map(|landmark| Undetermined {
                subject: Subject::Landmark(landmark),
                why: Why::AtInfinity,
            })
            .collect()
    }

    /// Looks at a given map; if it shows nothing, at what its bearings show.
    fn of_given(&mut self, map: &Map<T>, stated: Option<f64>, hopeless: bool) {
        let noise = stated.unwrap_or_else(|| self.spread(map).1);
        let lost = self.infinite(map, noise);
        let own = self.examined(map, noise);
        if own.is_some_and(|own| own.causes.is_empty()) && !hopeless {
            let apparent_noise = f64::min(noise, APPARENT_NOISE);
            if let Some(figure) = apparent(&self.problem, apparent_noise) {
                self.of_figure(&figure, apparent_noise, false);
                return;
            }
            let family = Family::of(&self.problem, map, &lost);
            let compact = family
                .and_then(|family| family.compact())
                .and_then(|member| self.settled(member, map, noise));
            if let Some(member) = compact
                && self.shows(&member, Kind::CollinearLandmarks, noise)
            {
                self.of_map(&member, Some(noise), &[], false, true);
                return;
            }
        }
        self.of_map(map, Some(noise), &lost, hopeless, true);
    }

    /// Root mean square of the residuals of a map, and the standard deviation of the bearings that they
    /// tell \[rad\]; without freedom to tell it, that they are at least as large as what is left.
    fn spread(&self, map: &Map<T>) -> (f64, f64) {
        let weight = self.mean_weight();
        let (mut squares, mut count) = (0.0, 0.0);
        let seen = self.problem.sightings().iter();
        for (s, residual) in seen.zip(map.residuals(&self.problem)) {
            if let Some(r) = residual {
                let r = r.as_f64() * s.weight.as_f64() / weight;
                squares += r * r;
                count += 1.0;
            }
        }
        let views = map.poses.iter().flatten().count();
        let landmarks = map.landmarks.iter().flatten().count();
        let freedom = count + 4.0 - (3 * views + 2 * landmarks) as f64;
        let rms = ComplexField::sqrt(squares / f64::max(count, 1.0));
        let noise = if freedom > 0.0 {
            ComplexField::sqrt(squares / freedom)
        } else {
            rms
        };
        (rms, noise)
    }

    /// The noise that the problem states: standard deviations below 1 rad.
    fn stated_noise(&self) -> Option<f64> {
        let mut weights = self.problem.sightings().iter().map(|s| s.weight.as_f64());
        weights
            .all(|weight| weight > 1.0)
            .then(|| 1.0 / self.mean_weight())
    }

    /// Root mean square of one over sigma.
    fn mean_weight(&self) -> f64 {
        let seen = self.problem.sightings();
        let squares = seen.iter().map(|s| s.weight.as_f64() * s.weight.as_f64());
        ComplexField::sqrt(squares.sum::<f64>() / seen.len().max(1) as f64)
    }

    /// Looks at a map.
    fn of_map(
        &mut self,
        map: &Map<T>,
        stated: Option<f64>,
        lost: &[Undetermined],
        hopeless: bool,
        given: bool,
    ) {
        self.absent(map, lost);
        let (rms, estimated) = self.spread(map);
        let noise = stated.unwrap_or(estimated);
        if rms > PLAUSIBLE_RMS {
            self.push(finding(
                Kind::PoorFit,
                Severity::Warning,
                self.part.views.clone(),
                self.part.landmarks.clone(),
                0,
                &format!(
                    "the {} leaves residuals of {:.1} degrees, so its shape is no evidence",
                    if given {
                        "given map"
                    } else {
                        "best map that was found"
                    },
                    rms.to_degrees()
                ),
                "Look for wrong correspondences.",
            ));
        }
        if given && self.problem.views() == 3 && !hopeless {
            let rivals = mirror_images(&self.problem, map);
            let weight = self.mean_weight();
            let best = estimated * weight;
            self.margin_of(best * best, &rivals);
        }
        match Figure::of_map(&self.problem, map) {
            Some(figure) => self.of_figure(&figure, noise, hopeless),
            None => self.not_examined("the map has no size"),
        }
    }

    /// How far the next best map is from the best, by their costs per degree of freedom.
    fn margin_of(&mut self, best: f64, rivals: &[f64]) {
        let next = rivals.iter().copied().fold(f64::INFINITY, f64::min);
        let weight = self.mean_weight();
        let rounding = 16.0 * T::eps().as_f64() * weight;
        let floor = rounding * rounding;
        let margin = ComplexField::sqrt(f64::max(next, floor) / f64::max(best, floor));
        self.diagnosis.mirror_margin = f64::min(self.diagnosis.mirror_margin, margin);
    }

    /// What the map has no value for.
    fn absent(&mut self, map: &Map<T>, lost: &[Undetermined]) {
        let views = map.poses.iter().enumerate();
        let views = views
            .filter(|(_, pose)| pose.is_none())
            .map(|(k, _)| Subject::View(k));
        let landmarks = map.landmarks.iter().enumerate();
        let landmarks = landmarks
            .filter(|(_, p)| p.is_none())
            .map(|(k, _)| Subject::Landmark(k));
        let far = |subject: &Subject| {
            lost.iter()
                .any(|u| u.subject == *subject && u.why == Why::AtInfinity)
        };
        let (infinite, absent): (Vec<Subject>, Vec<Subject>) =
            views.chain(landmarks).partition(|subject| far(subject));
        let outer = |list: Vec<Subject>| {
            apart(list.into_iter().map(|subject| match subject {
                Subject::View(k) => Subject::View(self.part.views[k]),
                Subject::Landmark(k) => Subject::Landmark(self.part.landmarks[k]),
            }))
        };
        let ((no_views, infinite), (views, landmarks)) = (outer(infinite), outer(absent));
        if !infinite.is_empty() {
            self.push(configuration(
                Kind::LandmarksAtInfinity,
                Severity::Error,
                no_views,
                infinite,
                0,
            ));
        }
        if views.len() + landmarks.len() > 0 {
            self.push(finding(
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

    fn of_figure(&mut self, figure: &Figure, noise: f64, hopeless: bool) {
        self.diagnosis.noise = f64::max(self.diagnosis.noise, noise);
        let parameters = figure.parameters();
        if parameters > MAX_PARAMETERS {
            self.not_examined(&format!(
                "the singular values of {parameters} parameters take too long, {MAX_PARAMETERS} are the most"
            ));
            return;
        }
        let Some(found) = examine(figure, noise) else {
            self.not_examined("the singular values of the map could not be computed");
            return;
        };
        if self.diagnosis.singular_values.is_empty() {
            let spectrum = &found.spectrum;
            let values = spectrum.values.iter().map(|value| value / spectrum.scale);
            self.diagnosis.singular_values = values.take(8).collect();
            let held = spectrum.values.get(spectrum.free());
            let largest = spectrum.values.last();
            if let (Some(held), Some(largest)) = (held, largest) {
                self.diagnosis.condition = largest / held;
            }
        }
        self.report(figure, &found, hopeless);
    }

    /// Turns an examination into findings.
    fn report(&mut self, figure: &Figure, found: &Examination, hopeless: bool) {
        let outer = |point: usize| match figure.subject(point) {
            Subject::View(k) => Subject::View(self.part.views[k]),
            Subject::Landmark(k) => Subject::Landmark(self.part.landmarks[k]),
        };
        let free = found.spectrum.free();
        self.diagnosis.extra += free;
        let mut findings: Vec<Finding> = Vec::new();
        for (k, cause) in found.causes.iter().enumerate() {
            let explained = found.directions.iter().filter(|d| d.cause == Some(k));
            let deviation = explained.map(|d| d.deviation).fold(0.0, f64::max);
            // Two solutions that merge are still solutions; a family is none.
            let folded = cause.kind == Kind::ThreeCollinearViews;
            let bounded = folded
                || matches!(
                    cause.kind,
                    Kind::ViewOnCircleOfLandmarks | Kind::LandmarkOnLineOfViews
                );
            let severity = if deviation > 1.0 || !bounded {
                Severity::Error
            } else {
                Severity::Warning
            };
            let (views, landmarks) = apart(cause.points.iter().map(|&point| outer(point)));
            findings.push(configuration(
                cause.kind,
                severity,
                views,
                landmarks,
                cause.directions,
            ));
            self.diagnosis.near_collinear |= folded;
        }
        // Of the free directions that are left so many are those of the counting.
        let counted = if hopeless {
            counting::missing(self.part)
        } else {
            0
        };
        let open = found
            .directions
            .iter()
            .filter(|d| d.free && d.cause.is_none());
        let rest: Vec<_> = open.skip(counted).collect();
        if !rest.is_empty() {
            let points = rest.iter().flat_map(|d| d.movers.iter());
            let mut concerned = apart(points.map(|&(point, _)| outer(point)));
            let kind = if found.structural > counted {
                Kind::LoosePart
            } else if figure.views.len() == 3 {
                concerned = apart((0..figure.points.len()).map(outer));
                Kind::LandmarksOnACubic
            } else {
                Kind::UnnamedDirection
            };
            let (views, landmarks) = concerned;
            findings.push(configuration(
                kind,
                Severity::Error,
                views,
                landmarks,
                rest.len(),
            ));
        }
        let weak = found
            .directions
            .iter()
            .filter(|d| !d.free && d.cause.is_none());
        let weak: Vec<_> = weak.collect();
        if !weak.is_empty() && !hopeless {
            let points = weak
                .iter()
                .flat_map(|d| d.movers.iter().map(|&(point, _)| outer(point)));
            let (views, landmarks) = apart(points);
            let worst = weak.iter().map(|d| d.largest).fold(0.0, f64::max);
            findings.push(finding(
                Kind::WeaklyDetermined,
                Severity::Warning,
                views.clone(),
                landmarks.clone(),
                weak.len(),
                &format!(
                    "noise of {:.3} degrees leaves {} uncertain by up to {:.0} % of the size of the map along {}",
                    self.diagnosis.noise.to_degrees(),
                    both(&views, &landmarks),
                    100.0 * worst,
                    if weak.len() == 1 { "one direction" } else { "some directions" }
                ),
                "Add sightings of them, from other places or of other landmarks.",
            ));
        }
        let margin = self.diagnosis.mirror_margin;
        if margin < CLEAR_MARGIN && found.causes.is_empty() {
            findings.push(finding(
                Kind::SecondSolution,
                Severity::Warning,
                self.part.views.clone(),
                self.part.landmarks.clone(),
                0,
                &format!(
                    "another map explains the bearings nearly as well, with residuals {margin:.1} times as large"
                ),
                "Add a view of five of the landmarks: it tells the two apart.",
            ));
        }
        self.diagnosis.findings.extend(findings);
        let scale = found.spectrum.scale;
        for direction in &found.directions {
            self.diagnosis.directions.push(NullDirection {
                free: direction.free,
                singular_value: found.spectrum.values[direction.index] / scale,
                deviation: direction.deviation,
                movers: direction
                    .movers
                    .iter()
                    .map(|&(point, share)| (outer(point), share))
                    .collect(),
                cause: direction.cause.map(|k| found.causes[k].kind),
            });
        }
    }

    fn push(&mut self, finding: Finding) {
        self.diagnosis.findings.push(finding);
    }

    fn not_examined(&mut self, why: &str) {
        self.push(finding(
            Kind::NotExamined,
            Severity::Note,
            self.part.views.clone(),
            self.part.landmarks.clone(),
            0,
            &format!("only the sightings have been counted: {why}"),
            "",
        ));
    }
}
