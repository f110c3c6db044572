// SPDX-License-Identifier: MIT OR Apache-2.0
//! The diagnosis: first by counting sightings, then by examining a map.

use super::finding::{Kind, Severity, apart};
use super::maps::explaining_map::best_triple;
use super::options::DiagnosisOptions;
use super::parts::components::{Core, Part, reached};
use super::parts::counting;
use super::parts::subproblem::SubProblem;
use super::report::Diagnosis;
use super::sentences::Case;
use crate::adjustment::gauge::gauge_and_prior_numbers;
use crate::error::Error;
use crate::problem::{Map, Problem, Subject};
use crate::reconstruction::{Progress, SolveOptions, report_progress, solve};
use alloc::string::ToString;
use alloc::vec::Vec;

/// What the bearings determine and what they do not, with names for the reasons.
///
/// Counts sightings, finds parts, and looks at the singular values of the Jacobian at a map: the given
/// one, or one that explains the bearings, whether they determine it or not. Free and weak directions
/// are explained by shapes of the map: landmarks along a wall, views in one place, everything on one
/// circle and so on. The noise is that of the problem if all its standard deviations are below 1 rad,
/// otherwise it is estimated from the residuals.
///
/// With odometry or priors, and for maps of many unknowns, the weakest directions are those of the sparse
/// normal equations, and shapes are not named.
///
/// Never fails on degenerate, empty or disconnected problems: these are what it is for.
///
/// # Errors
/// [`Error::LengthMismatch`] when the map is not of the problem's size, [`Error::NotFinite`] and
/// [`Error::Magnitude`] for a bad number in it, [`Error::Interrupted`] when `progress` says so.
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
pub fn diagnose(
    problem: &Problem,
    map: Option<&Map>,
    progress: Option<Progress<'_>>,
) -> Result<Diagnosis, Error> {
    diagnose_with(problem, map, &DiagnosisOptions::default(), progress)
}

/// The diagnosis with thresholds of the caller.
///
/// # Errors
/// As [`diagnose`].
///
/// # Example
/// ```
/// use bearslam::{Arena, DiagnosisOptions, Layout, Problem, diagnose_with, simulate};
/// let scene = simulate(Layout::Mixed, 6, 9, 0.01, 7, Arena::default())?;
/// let problem = Problem::dense(6, 9, &scene.bearings, 0.01)?;
/// let mut options = DiagnosisOptions::default();
/// assert!(diagnose_with(&problem, None, &options, None)?.directions.is_empty());
/// // What is not known to a part in a million is called weak.
/// options.shapes.weak = 1e-6;
/// assert!(!diagnose_with(&problem, None, &options, None)?.directions.is_empty());
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn diagnose_with(
    problem: &Problem,
    map: Option<&Map>,
    options: &DiagnosisOptions,
    progress: Option<Progress<'_>>,
) -> Result<Diagnosis, Error> {
    if let Some(map) = map {
        map.check(problem)?;
    }
    let mut diagnosis = Diagnosis {
        views: problem.views(),
        landmarks: problem.landmarks(),
        sightings: problem.sightings().len(),
        components: Vec::new(),
        extra: 0,
        singular_values: Vec::new(),
        condition: f64::NAN,
        noise: 0.0,
        near_collinear: false,
        mirror_margin: f64::NAN,
        directions: Vec::new(),
        findings: Vec::new(),
    };
    if problem.priors().is_empty() {
        by_bearings(problem, map, options, &mut diagnosis, progress)?;
    } else {
        with_priors(problem, map, options, &mut diagnosis, progress)?;
    }
    diagnosis
        .findings
        .sort_by_key(|finding| (finding.severity, finding.kind));
    Ok(diagnosis)
}

/// Diagnoses a problem of bearings alone: by counting, then part by part.
fn by_bearings(
    problem: &Problem,
    map: Option<&Map>,
    options: &DiagnosisOptions,
    diagnosis: &mut Diagnosis,
    mut progress: Option<Progress<'_>>,
) -> Result<(), Error> {
    let core = Core::of(problem);
    let parts = core.parts(problem);
    let findings = &mut diagnosis.findings;
    findings.extend(counting::unseen(problem, &|_| false));
    findings.extend(counting::outside(problem, &core));
    findings.extend(counting::apart(&parts));
    if parts.is_empty() {
        let whole = Part::whole(problem);
        diagnosis.extra = counting::missing(&whole);
        findings.extend(counting::too_little(&whole));
    }
    for part in &parts {
        let subproblem = SubProblem::new(problem, part, options);
        look_at(&subproblem, map, diagnosis, &mut progress)?;
    }
    diagnosis.components = parts;
    Ok(())
}

/// Diagnoses one part.
fn look_at(
    subproblem: &SubProblem,
    map: Option<&Map>,
    diagnosis: &mut Diagnosis,
    progress: &mut Option<Progress<'_>>,
) -> Result<(), Error> {
    let too_little = counting::too_little(&subproblem.part);
    let hopeless = too_little.is_some();
    diagnosis.findings.extend(too_little);
    if let Some(map) = map {
        let chosen = subproblem.choose_given(subproblem.map(map), hopeless, progress)?;
        return subproblem.judge(&chosen, hopeless, diagnosis, progress);
    }
    if hopeless {
        diagnosis.extra += counting::missing(&subproblem.part);
        return Ok(());
    }
    let reached = best_triple(&subproblem.problem, &subproblem.options.maps)
        .map(|triple| reached(&subproblem.problem, triple));
    let out_of_reach = counting::out_of_reach(&subproblem.part, reached.as_ref());
    diagnosis.findings.extend(out_of_reach);
    match subproblem.choose(progress)? {
        Some(chosen) => subproblem.judge(&chosen, false, diagnosis, progress)?,
        None => diagnosis
            .findings
            .push(subproblem.not_examined("no map could be made from the bearings")),
    }
    Ok(())
}

/// Diagnoses a problem with odometry or priors by the sparse normal equations.
fn with_priors(
    problem: &Problem,
    map: Option<&Map>,
    options: &DiagnosisOptions,
    diagnosis: &mut Diagnosis,
    mut progress: Option<Progress<'_>>,
) -> Result<(), Error> {
    let whole = SubProblem::whole(problem, options);
    let report = &mut |stage, done, all| report_progress(&mut progress, stage, done, all);
    let mut map = match map {
        Some(map) => map.clone(),
        None => match solve(problem, &SolveOptions::default(), Some(report)) {
            Ok(solved) => solved.map,
            Err(error @ Error::Interrupted) => return Err(error),
            Err(error) => {
                let (kind, severity) = (Kind::Unreached, Severity::Error);
                let why = ("why", error.to_string());
                let all = whole.about_all(Case::NoMap, kind, severity, &[why]);
                diagnosis.findings.push(all);
                return Ok(());
            }
        },
    };
    // A given map may place what nothing holds; odometry and priors hold what nothing sees.
    map.prune(problem);
    let placed = |subject: Subject| match subject {
        Subject::View(view) => map.poses[view].is_some(),
        Subject::Landmark(landmark) => map.landmarks[landmark].is_some(),
    };
    let unseen = counting::unseen(problem, &placed);
    diagnosis.findings.extend(unseen);
    whole.report_absent(&map, &[], Case::WithPriors, diagnosis);
    let (views, landmarks) = apart(map.determined());
    diagnosis.components = Vec::from([Part {
        views,
        landmarks,
        sightings: map.residuals(problem).flatten().count(),
        priors: gauge_and_prior_numbers(problem, &map),
    }]);
    diagnosis.findings.extend(whole.fit(&map, &mut progress)?);
    whole.report_sparse(&map, None, false, diagnosis, &mut progress)
}
