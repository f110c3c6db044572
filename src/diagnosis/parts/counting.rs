// SPDX-License-Identifier: MIT OR Apache-2.0
//! Findings that need no map: too few views, landmarks or sightings.

use super::super::finding::{Finding, Kind, Severity};
use super::super::sentences::{Case, both, count, finding_in};
use super::components::{Core, Part};
use crate::problem::{Problem, Subject};
use alloc::format;
use alloc::string::ToString;
use alloc::vec::Vec;

/// Directions that are free because there are fewer sightings than unknowns.
pub fn missing(part: &Part) -> usize {
    usize::try_from(-part.freedom()).unwrap_or(0)
}

/// The finding about a part with at most two views, at most three landmarks, or fewer sightings than unknowns.
pub fn too_little(part: &Part) -> Option<Finding> {
    let (m, n) = (part.views.len(), part.landmarks.len());
    let lack = missing(part);
    let (kind, facts) = if m <= 2 {
        let few = match part.views[..] {
            [] => "no views".into(),
            [only] => format!("one view ({only})"),
            [first, second, ..] => format!("two views ({first} and {second})"),
        };
        let missing = count(3 - m, "view");
        (
            Kind::TwoViews,
            Vec::from([("few views", few), ("missing", missing)]),
        )
    } else if n <= 3 {
        let missing = if m == 3 {
            count(5 - n, "landmark") + " that all three views see"
        } else {
            count(4 - n, "landmark")
                + ", not all on one circle with the others, that four views see"
        };
        let few = count(n, "landmark");
        (
            Kind::TooFewLandmarks,
            Vec::from([("few landmarks", few), ("missing", missing)]),
        )
    } else if lack > 0 {
        let unknowns = 3 * m + 2 * n - 4;
        (
            Kind::Counting,
            Vec::from([
                ("seen", count(part.sightings, "sighting")),
                ("unknowns", unknowns.to_string()),
                ("count views", m.to_string()),
                ("count landmarks", n.to_string()),
            ]),
        )
    } else {
        return None;
    };
    let subjects = (part.views.clone(), part.landmarks.clone());
    let severity = Severity::Error;
    Some(finding_in(
        Case::Usual,
        kind,
        severity,
        subjects,
        lack,
        &facts,
    ))
}

/// Views and landmarks with too few sightings of each other to be determined.
pub fn outside(problem: &Problem, core: &Core) -> Option<Finding> {
    let outside = |inside: &[bool], seen: &dyn Fn(usize) -> usize| -> Vec<usize> {
        let all = 0..inside.len();
        all.filter(|&k| !inside[k] && seen(k) > 0).collect()
    };
    let subjects = (
        outside(&core.views, &|k| problem.of_view(k).len()),
        outside(&core.landmarks, &|k| problem.of_landmark(k).len()),
    );
    concerning(
        Case::Usual,
        Kind::TooFewSightings,
        Severity::Error,
        subjects,
    )
}

/// Views and landmarks without any sighting, except those `placed` by other data.
pub fn unseen(problem: &Problem, placed: &dyn Fn(Subject) -> bool) -> Option<Finding> {
    let views = (0..problem.views())
        .filter(|&k| problem.of_view(k).is_empty() && !placed(Subject::View(k)));
    let landmarks = (0..problem.landmarks())
        .filter(|&k| problem.of_landmark(k).is_empty() && !placed(Subject::Landmark(k)));
    let subjects = (views.collect(), landmarks.collect());
    concerning(
        Case::Unseen,
        Kind::TooFewSightings,
        Severity::Error,
        subjects,
    )
}

/// Parts that no sighting connects.
pub fn apart(parts: &[Part]) -> Option<Finding> {
    let [first, others @ ..] = parts else {
        return None;
    };
    if others.is_empty() {
        return None;
    }
    let mut views: Vec<usize> = others.iter().flat_map(|part| part.views.clone()).collect();
    let mut landmarks: Vec<usize> = others
        .iter()
        .flat_map(|part| part.landmarks.clone())
        .collect();
    views.sort_unstable();
    landmarks.sort_unstable();
    Some(finding_in(
        Case::Usual,
        Kind::Disconnected,
        Severity::Error,
        (views, landmarks),
        // Each part has a gauge of its own.
        4 * others.len(),
        &[
            ("parts", parts.len().to_string()),
            ("first", both(&first.views, &first.landmarks)),
        ],
    ))
}

/// Views and landmarks of a part that triangulation and resection cannot reach from the best triple of views;
/// all of them when there is no such triple.
pub fn out_of_reach(part: &Part, reached: Option<&Core>) -> Option<Finding> {
    let Some(reached) = reached else {
        let subjects = (part.views.clone(), part.landmarks.clone());
        return concerning(Case::NoStart, Kind::Unreached, Severity::Error, subjects);
    };
    let rest = |inside: &[bool], numbers: &[usize]| -> Vec<usize> {
        let all = inside.iter().zip(numbers);
        all.filter(|(inside, _)| !**inside)
            .map(|(_, &k)| k)
            .collect()
    };
    let subjects = (
        rest(&reached.views, &part.views),
        rest(&reached.landmarks, &part.landmarks),
    );
    concerning(
        Case::OutOfReach,
        Kind::Unreached,
        Severity::Warning,
        subjects,
    )
}

/// A finding about some views and landmarks; `None` when there are none.
pub fn concerning(
    case: Case,
    kind: Kind,
    severity: Severity,
    subjects: (Vec<usize>, Vec<usize>),
) -> Option<Finding> {
    let some = subjects.0.len() + subjects.1.len() > 0;
    some.then(|| finding_in(case, kind, severity, subjects, 0, &[]))
}
