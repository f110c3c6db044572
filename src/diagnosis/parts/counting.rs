// SPDX-License-Identifier: MIT OR Apache-2.0
//! Findings that need no map: too little of something.

use super::super::describe::finding;
use super::super::finding::{Finding, Kind, Severity};
use super::super::words::{both, count, list};
use super::components::{Core, Part};
use crate::problem::{Problem, Subject};
use alloc::format;
use alloc::vec::Vec;

/// Directions that are free because there are fewer sightings than unknowns.
pub fn missing(part: &Part) -> usize {
    usize::try_from(-part.freedom()).unwrap_or(0)
}

/// What counting says about a part: two views, three landmarks, or fewer sightings than unknowns.
pub fn too_little(part: &Part) -> Option<Finding> {
    let (m, n) = (part.views.len(), part.landmarks.len());
    let lack = missing(part);
    let (kind, message, advice) = if m <= 2 {
        (
            Kind::TwoViews,
            format!(
                "{} never determine a map, however many landmarks they see",
                match m {
                    0 => "no views".into(),
                    1 => format!("one view ({})", part.views[0]),
                    _ => format!("two views ({} and {})", part.views[0], part.views[1]),
                }
            ),
            format!(
                "Add {} from another place, so that three views see the same five landmarks.",
                count(3 - m, "view")
            ),
        )
    } else if n <= 3 {
        (
            Kind::TooFewLandmarks,
            format!(
                "{} never determine a map, however many views see them",
                count(n, "landmark")
            ),
            if m == 3 {
                format!("Add {} that all three views see.", count(5 - n, "landmark"))
            } else {
                format!(
                    "Add {}, not all on one circle with the others, that four views see.",
                    count(4 - n, "landmark")
                )
            },
        )
    } else if lack > 0 {
        let unknowns = 3 * m + 2 * n - 4;
        (
            Kind::Counting,
            format!(
                "{} are fewer than the {unknowns} unknowns of {m} views and {n} landmarks (three a view, two a \
                 landmark, less four)",
                count(part.sightings, "sighting"),
            ),
            format!(
                "Add at least {} between them; a further landmark counts for the sightings beyond two, \
                 a further view for those beyond three.",
                count(lack, "sighting")
            ),
        )
    } else {
        return None;
    };
    Some(finding(
        kind,
        Severity::Error,
        part.views.clone(),
        part.landmarks.clone(),
        lack,
        &message,
        &advice,
    ))
}

/// Views and landmarks with too few sightings of each other to take part.
pub fn outside(problem: &Problem, core: &Core) -> Option<Finding> {
    let pick = |inside: &[bool], seen: &dyn Fn(usize) -> usize| -> Vec<usize> {
        (0..inside.len())
            .filter(|&k| !inside[k] && seen(k) > 0)
            .collect()
    };
    let views = pick(&core.views, &|view| problem.of_view(view).len());
    let landmarks = pick(&core.landmarks, &|landmark| {
        problem.of_landmark(landmark).len()
    });
    (views.len() + landmarks.len() > 0).then(|| {
        finding(
            Kind::TooFewSightings,
            Severity::Error,
            views.clone(),
            landmarks.clone(),
            0,
            &format!(
                "{} have too few sightings to be placed",
                both(&views, &landmarks)
            ),
            "A view needs three landmarks that are placed, a landmark two views.",
        )
    })
}

/// Views and landmarks without any sighting, but those that something else has `placed`.
pub fn unseen(problem: &Problem, placed: &dyn Fn(Subject) -> bool) -> Option<Finding> {
    let views: Vec<usize> = (0..problem.views())
        .filter(|&view| problem.of_view(view).is_empty() && !placed(Subject::View(view)))
        .collect();
    let landmarks: Vec<usize> = (0..problem.landmarks())
        .filter(|&landmark| {
            problem.of_landmark(landmark).is_empty() && !placed(Subject::Landmark(landmark))
        })
        .collect();
    (views.len() + landmarks.len() > 0).then(|| {
        finding(
            Kind::TooFewSightings,
            Severity::Error,
            views.clone(),
            landmarks.clone(),
            0,
            &format!("{} have no sightings at all", both(&views, &landmarks)),
            "A view needs three landmarks that are placed, a landmark two views.",
        )
    })
}

/// Parts that share nothing.
pub fn apart(parts: &[Part]) -> Option<Finding> {
    let [first, others @ ..] = parts else {
        return None;
    };
    let views: Vec<usize> = others.iter().flat_map(|part| part.views.clone()).collect();
    let landmarks: Vec<usize> = others
        .iter()
        .flat_map(|part| part.landmarks.clone())
        .collect();
    (!others.is_empty()).then(|| {
        let mut sorted = (views, landmarks);
        sorted.0.sort_unstable();
        sorted.1.sort_unstable();
        finding(
            Kind::Disconnected,
            Severity::Error,
            sorted.0.clone(),
            sorted.1.clone(),
            4 * others.len(),
            &format!(
                "the sightings fall into {} parts that nothing ties together: {}, and apart from them {}",
                parts.len(),
                both(&first.views, &first.landmarks),
                both(&sorted.0, &sorted.1)
            ),
            "Each further part needs four sightings between it and the others, or three landmarks of \
             the others that one of its views sees.",
        )
    })
}

/// Views and landmarks of a part that linear steps do not tie to the rest.
pub fn untied(part: &Part, tied: Option<&Core>) -> Option<Finding> {
    let Some(tied) = tied else {
        return Some(finding(
            Kind::Unreached,
            Severity::Error,
            part.views.clone(),
            part.landmarks.clone(),
            0,
            &format!(
                "no three of {} see the same four landmarks, so there is nothing to start a map from",
                list("view", &part.views)
            ),
            "Let three views see the same five landmarks.",
        ));
    };
    let views: Vec<usize> = (0..part.views.len())
        .filter(|&k| !tied.views[k])
        .map(|k| part.views[k])
        .collect();
    let landmarks: Vec<usize> = (0..part.landmarks.len())
        .filter(|&k| !tied.landmarks[k])
        .map(|k| part.landmarks[k])
        .collect();
    (views.len() + landmarks.len() > 0).then(|| {
        finding(
            Kind::Unreached,
            Severity::Warning,
            views.clone(),
            landmarks.clone(),
            0,
            &format!(
                "{} cannot be tied to the largest part step by step: no view of them sees three of its \
                 landmarks",
                both(&views, &landmarks)
            ),
            "Let one of these views see three landmarks that two views of the largest part see.",
        )
    })
}
