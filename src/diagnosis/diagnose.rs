// SPDX-License-Identifier: MIT OR Apache-2.0
//! The diagnosis: first what the sightings tell, then what a map tells.

use super::beyond::look_beyond;
use super::maps::explaining_map::seed;
use super::parts::components::{Core, Part, tied};
use super::parts::subproblem::Own;
use super::report::Diagnosis;
use crate::diagnosis::parts::counting;
use crate::error::Error;
use crate::problem::{Map, Problem};
use crate::reconstruction::Progress;
use alloc::vec::Vec;

/// What the bearings determine and what they do not, with names for the reasons.
///
/// Counts sightings, finds parts, and looks at the singular values of the Jacobian at a map: the given
/// one, or one that explains the bearings, whether they determine it or not. Free and weak directions
/// are explained by shapes of the map: landmarks along a wall, views in one place, everything on one
/// circle and so on. The noise is that of the problem where its standard deviations are below 1,
/// else that of the residuals.
///
/// With odometry or priors, and for maps of many unknowns, the weakest directions are those of the sparse
/// normal equations, and shapes have no names.
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
pub fn diagnose(
    problem: &Problem,
    map: Option<&Map>,
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
    let alone = problem.ties().is_empty();
    let parts = if alone {
        core.parts(problem)
    } else {
        Vec::new()
    };
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
    if !alone {
        look_beyond(problem, map, &mut diagnosis, progress)?;
        return Ok(sorted(diagnosis));
    }
    let findings = &mut diagnosis.findings;
    findings.extend(counting::unseen(problem, &|_| false));
    findings.extend(counting::outside(problem, &core));
    findings.extend(counting::apart(&parts));
    if parts.is_empty() {
        let whole = Part {
            views: (0..problem.views()).collect(),
            landmarks: (0..problem.landmarks()).collect(),
            sightings: problem.sightings().len(),
            ties: (4, 0),
        };
        diagnosis.extra = counting::missing(&whole);
        findings.extend(counting::too_little(&whole));
    }
    let mut progress = progress;
    for part in &parts {
        let own = Own::new(problem, part);
        look_at(&own, map, &mut diagnosis, &mut progress)?;
    }
    Ok(sorted(diagnosis))
}

/// The worst first.
fn sorted(mut diagnosis: Diagnosis) -> Diagnosis {
    diagnosis
        .findings
        .sort_by_key(|finding| (finding.severity, finding.kind));
    diagnosis
}

/// Adds what there is to say about a part.
fn look_at(
    own: &Own,
    map: Option<&Map>,
    diagnosis: &mut Diagnosis,
    progress: &mut Option<Progress<'_>>,
) -> Result<(), Error> {
    let too_little = counting::too_little(&own.part);
    let hopeless = too_little.is_some();
    diagnosis.findings.extend(too_little);
    if let Some(map) = map {
        let judged = own.given(own.map(map), hopeless);
        own.judge(&judged, hopeless, diagnosis);
        return Ok(());
    }
    if hopeless {
        diagnosis.extra += counting::missing(&own.part);
        return Ok(());
    }
    let tied = seed(&own.problem).map(|seed| tied(&own.problem, seed));
    let untied = counting::untied(&own.part, tied.as_ref());
    diagnosis.findings.extend(untied);
    match own.found(progress)? {
        Some(judged) => own.judge(&judged, false, diagnosis),
        None => diagnosis
            .findings
            .push(own.not_examined("no map could be made from the bearings")),
    }
    Ok(())
}
