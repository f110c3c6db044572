// SPDX-License-Identifier: MIT OR Apache-2.0
//! Problems with odometry or priors, and maps that are too large for all their singular values: the weakest
//! directions by the sparse normal equations, without names for shapes.

use super::describe::{configuration, finding};
use super::finding::{Finding, Kind, Severity, apart};
use super::parts::components::Part;
use super::report::{Diagnosis, NullDirection};
use super::shapes::examine::{LOOSE, WEAK};
use super::words::both;
use crate::adjustment::gauge::gauge_and_prior_numbers;
use crate::diagnosis::parts::counting;
use crate::error::Error;
use crate::problem::{Map, Problem, Subject};
use crate::reconstruction::{Progress, SolveOptions, solve};
use crate::uncertainty::{Loose, loose_directions};
use alloc::format;
use alloc::string::ToString;
use alloc::vec::Vec;

/// Directions that are looked at; a map with more free ones is all but undetermined.
const LOOKED_AT: usize = 12;

/// Adds what there is to say of a problem with odometry or priors.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so.
pub fn look_beyond(
    problem: &Problem,
    map: Option<&Map>,
    diagnosis: &mut Diagnosis,
    progress: Option<Progress<'_>>,
) -> Result<(), Error> {
    let found;
    let map = match map {
        Some(map) => map,
        None => match solve(problem, &SolveOptions::default(), progress) {
            Ok(solved) => {
                found = solved.map;
                &found
            }
            Err(error @ Error::Interrupted) => return Err(error),
            Err(error) => {
                let views = (0..problem.views()).collect();
                let landmarks = (0..problem.landmarks()).collect();
                let (why, advice) = (error.to_string(), "Add sightings, odometry or priors.");
                let kind = Kind::Unreached;
                let message = format!("no map could be made: {why}");
                let all = finding(kind, Severity::Error, views, landmarks, 0, &message, advice);
                diagnosis.findings.push(all);
                return Ok(());
            }
        },
    };
    // Odometry and priors place what nobody sees.
    let placed = |subject: Subject| match subject {
        Subject::View(view) => map.poses[view].is_some(),
        Subject::Landmark(landmark) => map.landmarks[landmark].is_some(),
    };
    diagnosis
        .findings
        .extend(counting::unseen(problem, &placed));
    let absent = |subject: &Subject| match *subject {
        Subject::View(view) => map.poses[view].is_none() && !problem.of_view(view).is_empty(),
        Subject::Landmark(landmark) => {
            map.landmarks[landmark].is_none() && !problem.of_landmark(landmark).is_empty()
        }
    };
    let views = (0..problem.views()).map(Subject::View);
    let landmarks = (0..problem.landmarks()).map(Subject::Landmark);
    let (views, landmarks) = apart(views.chain(landmarks).filter(absent));
    if views.len() + landmarks.len() > 0 {
        let message = format!("{} are not in the map", both(&views, &landmarks));
        let advice = "A view needs three landmarks of the map or odometry from one of its views, a landmark two \
                      views of the map that are not in line with it.";
        let kind = Kind::Unreached;
        let all = finding(kind, Severity::Error, views, landmarks, 0, &message, advice);
        diagnosis.findings.push(all);
    }
    let (views, landmarks) = apart(map.determined());
    let residuals = map.residuals(problem);
    let part = Part {
        sightings: residuals.flatten().count(),
        views,
        landmarks,
        ties: gauge_and_prior_numbers(problem, map),
    };
    diagnosis.components = Vec::from([part]);
    weakest(problem, map, 1.0, &|subject| subject, diagnosis);
    Ok(())
}

/// Adds the free and weak directions of a map, for residuals of so many sigma.
///
/// `outer` says who a subject is in the whole problem.
pub fn weakest(
    problem: &Problem,
    map: &Map,
    sigmas: f64,
    outer: &dyn Fn(Subject) -> Subject,
    diagnosis: &mut Diagnosis,
) {
    let Some(found) = loose_directions(problem, map, LOOKED_AT) else {
        let (views, landmarks) = apart(map.determined().map(outer));
        let message =
            "only the sightings have been counted: the normal equations cannot be factorised";
        let kind = Kind::NotExamined;
        let all = finding(kind, Severity::Note, views, landmarks, 0, message, "");
        diagnosis.findings.push(all);
        return;
    };
    if diagnosis.singular_values.is_empty() {
        diagnosis.singular_values = found.iter().map(|loose| loose.held).collect();
        let held = found.iter().find(|loose| !loose.free);
        diagnosis.condition = held.map_or(f64::NAN, |loose| 1.0 / loose.held);
    }
    let open = |loose: &&Loose| {
        loose.free || sigmas * loose.deviation > WEAK || sigmas * loose.largest > LOOSE
    };
    let (free, weak): (Vec<&Loose>, Vec<&Loose>) =
        found.iter().filter(open).partition(|loose| loose.free);
    diagnosis.extra += free.len();
    let who = |directions: &[&Loose]| {
        let movers = directions.iter().flat_map(|loose| loose.movers.iter());
        apart(movers.map(|&(subject, _)| outer(subject)))
    };
    if !free.is_empty() {
        let (views, landmarks) = who(&free);
        let kind = Kind::UnnamedDirection;
        let all = configuration(kind, Severity::Error, views, landmarks, free.len());
        diagnosis.findings.push(all);
    }
    if !weak.is_empty() {
        let (views, landmarks) = who(&weak);
        let worst = weak.iter().map(|loose| loose.largest).fold(0.0, f64::max);
        diagnosis
            .findings
            .push(weakly(&views, &landmarks, weak.len(), sigmas * worst));
    }
    for loose in free.into_iter().chain(weak) {
        let movers = loose.movers.iter();
        diagnosis.directions.push(NullDirection {
            free: loose.free,
            singular_value: loose.held,
            deviation: sigmas * loose.deviation,
            movers: movers
                .map(|&(subject, share)| (outer(subject), share))
                .collect(),
            cause: loose.free.then_some(Kind::UnnamedDirection),
        });
    }
}

fn weakly(views: &[usize], landmarks: &[usize], directions: usize, share: f64) -> Finding {
    finding(
        Kind::WeaklyDetermined,
        Severity::Warning,
        views.to_vec(),
        landmarks.to_vec(),
        directions,
        &format!(
            "{} are uncertain by up to {:.0} % of the size of the map",
            both(views, landmarks),
            100.0 * share,
        ),
        "Add sightings of them, from other places or of other landmarks.",
    )
}
