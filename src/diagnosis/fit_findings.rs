// SPDX-License-Identifier: MIT OR Apache-2.0
//! The test of a fit as findings.

use super::finding::{Finding, Kind, Severity, apart};
use super::sentences::{Case, finding_in};
use crate::adjustment::refine_map;
use crate::error::Error;
use crate::fit::{Alarm, FitTest, Observation, TestOptions, test_fit};
use crate::lm::RefineOptions;
use crate::problem::{Map, Prior, Problem, Subject};
use crate::reconstruction::{Progress, Reconstruction, report_progress};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// What the test of a fit says, in sentences: too large residuals, and observations that contradict the others, are
/// warnings; standard deviations that are a little off, notes.
///
/// # Example
/// ```
/// use bearslam::{
///     Arena, Kind, Layout, Problem, SolveOptions, TestOptions, fit_findings, simulate, solve, test_fit,
/// };
/// let scene = simulate(Layout::Mixed, 6, 12, 0.01, 7, Arena::default())?;
/// let mut bearings = scene.bearings.clone();
/// bearings[30] += 0.5;
/// let problem = Problem::dense(6, 12, &bearings, 0.01)?;
/// let found = solve(&problem, &SolveOptions::default(), None)?;
/// let test = test_fit(&problem, &found, &TestOptions::default(), None)?;
/// let findings = fit_findings(&problem, &test);
/// let blunder = findings.iter().find(|one| one.kind == Kind::Blunder).unwrap();
/// assert!(blunder.message.starts_with("the bearing of landmark 6 from view 2 contradicts the others"));
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn fit_findings(problem: &Problem, test: &FitTest) -> Vec<Finding> {
    findings(problem, test, &|subject| subject)
}

/// The same with other indices of views and landmarks.
fn findings(problem: &Problem, test: &FitTest, outer: &dyn Fn(Subject) -> Subject) -> Vec<Finding> {
    let ratio = ("ratio", format!("{:.2}", test.global.sigma0));
    let all = || {
        let views = (0..problem.views()).map(Subject::View);
        let landmarks = (0..problem.landmarks()).map(Subject::Landmark);
        apart(views.chain(landmarks).map(outer))
    };
    let whole = |kind, severity| {
        finding_in(
            Case::Usual,
            kind,
            severity,
            all(),
            0,
            core::slice::from_ref(&ratio),
        )
    };
    let findings = test.alarms.iter().map(|alarm| match alarm {
        Alarm::LeftOut { subjects } => {
            let subjects = apart(subjects.iter().map(|&subject| outer(subject)));
            let (kind, severity) = (Kind::PoorFit, Severity::Warning);
            finding_in(Case::LeftOut, kind, severity, subjects, 0, &[])
        }
        Alarm::TurnedBearings { views, angle } => {
            let views = apart(views.iter().map(|&view| outer(Subject::View(view))));
            let given = [("angle", format!("{:.1}", angle.to_degrees()))];
            let (kind, severity) = (Kind::TurnedBearings, Severity::Warning);
            finding_in(Case::Usual, kind, severity, views, 0, &given)
        }
        Alarm::MirroredBearings => whole(Kind::MirroredBearings, Severity::Warning),
        Alarm::WeakConsensus {
            outliers,
            explained,
        } => {
            let given = [
                ("outliers", format!("{outliers}")),
                ("explained", format!("{:.0}", 100.0 * *explained)),
            ];
            let (kind, severity) = (Kind::WeakConsensus, Severity::Warning);
            finding_in(Case::Usual, kind, severity, all(), 0, &given)
        }
        Alarm::PoorFit => whole(Kind::PoorFit, Severity::Warning),
        Alarm::UnderstatedSigma => whole(Kind::UnderstatedSigma, Severity::Note),
        Alarm::OverstatedSigma => whole(Kind::OverstatedSigma, Severity::Note),
        Alarm::Blunder {
            observation,
            standardized,
        } => {
            let (subjects, name) = named(problem, *observation, outer);
            let given = [
                ("observation", name),
                ("standardized", format!("{:.1}", standardized.abs())),
            ];
            let (kind, severity) = (Kind::Blunder, Severity::Warning);
            finding_in(Case::Usual, kind, severity, apart(subjects), 0, &given)
        }
    });
    findings.collect()
}

/// The test of the fit of a map as findings; of the minimum next to it, as a map that somebody gives may not be one. They
/// speak of views and landmarks by other indices.
///
/// # Errors
/// As [`test_fit`].
pub fn findings_at(
    problem: &Problem,
    map: &Map,
    outer: &dyn Fn(Subject) -> Subject,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Finding>, Error> {
    if !problem.states_sigma() {
        return Ok(Vec::new());
    }
    let mut map = map.clone();
    let options = RefineOptions::default();
    let mut look = |done, _| report_progress(progress, "test", done, options.max_iterations);
    let report = match refine_map(problem, &mut map, &options, Some(&mut look)) {
        Ok(report) => report,
        Err(error) if error.stops_all() => return Err(error),
        Err(_) => return Ok(Vec::new()),
    };
    let found = Reconstruction::tested(problem, &map, report);
    let mut look = |stage: &'static str, done, all| report_progress(progress, stage, done, all);
    let test = test_fit(problem, &found, &TestOptions::default(), Some(&mut look))?;
    Ok(findings(problem, &test, outer))
}

/// Whom an observation concerns, and what it is called.
fn named(
    problem: &Problem,
    observation: Observation,
    outer: &dyn Fn(Subject) -> Subject,
) -> (Vec<Subject>, String) {
    let of_kind = |is_kind: fn(&Prior) -> bool, place: usize| {
        let mut priors = problem.priors().iter().filter(|prior| is_kind(prior));
        priors.nth(place).map_or([None; 2], Prior::subjects)
    };
    let subjects = match observation {
        Observation::Sighting(place) => {
            let mut seen = problem.sightings().iter().zip(problem.input_order());
            let seen = seen.find(|(_, other)| **other == place);
            seen.map_or([None; 2], |(s, _)| {
                [
                    Some(Subject::View(s.view)),
                    Some(Subject::Landmark(s.landmark)),
                ]
            })
        }
        Observation::Odometry(k) => of_kind(|prior| matches!(prior, Prior::Motion { .. }), k),
        Observation::PosePrior(k) => of_kind(|prior| matches!(prior, Prior::Pose { .. }), k),
        Observation::LandmarkPrior(k) => {
            of_kind(|prior| matches!(prior, Prior::Landmark { .. }), k)
        }
    };
    let subjects: Vec<Subject> = subjects.into_iter().flatten().map(outer).collect();
    let name = match subjects[..] {
        [Subject::View(view), Subject::Landmark(landmark)] => {
            format!("bearing of landmark {landmark} from view {view}")
        }
        [Subject::View(start), Subject::View(end)] => {
            format!("motion from view {start} to view {end}")
        }
        [Subject::View(view)] => format!("prior on view {view}"),
        [Subject::Landmark(landmark)] => format!("prior on landmark {landmark}"),
        _ => String::new(),
    };
    (subjects, name)
}
