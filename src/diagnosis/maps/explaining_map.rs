// SPDX-License-Identifier: MIT OR Apache-2.0
//! A map that explains the bearings, whether they determine it or not, for a diagnosis to examine.

use super::super::options::MapOptions;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::kernels::{Method, three_view};
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem, Undetermined};
use crate::reconstruction::choice::same;
use crate::reconstruction::grow::grow;
use crate::reconstruction::judge::{JudgeOptions, variance};
use crate::reconstruction::search::options::DrawOptions;
use crate::reconstruction::search::tensor_circle::{Circle, along_circle};
use crate::reconstruction::search::triples::{common_bearings, draw};
use crate::reconstruction::strategy::lowest;
use crate::reconstruction::{
    Progress, Reconstruction, SolveOptions, goes_on, refine, report_progress,
};
use alloc::vec::Vec;

/// A map and how well it explains the bearings.
pub struct ExplainingMap {
    pub map: Map,
    /// Sum of squared residuals over sigma, per degree of freedom.
    pub variance: f64,
    pub undetermined: Vec<Undetermined>,
    /// Other maps that explain the bearings about as well.
    pub others: Vec<Map>,
    /// The least variance of the rivals that the search has found.
    pub rival: f64,
}

/// Minimum number of landmarks that three views must share, by counting: the null space of their tensor is then a
/// circle.
const MIN_SHARED: usize = 4;

/// The map of least cost that the search finds, whether it is determined or not; when the search fails, a map from
/// the null space of the tensor of three views.
///
/// `None` when no three views share four landmarks.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so, [`Error::TooLarge`] as the refinement.
pub fn explaining_map(
    problem: &Problem,
    options: &MapOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<ExplainingMap>, Error> {
    let found = match lowest(problem, &SolveOptions::default(), progress) {
        Ok(found) => found,
        Err(error @ (Error::Interrupted | Error::TooLarge { .. })) => return Err(error),
        Err(_) => {
            let mut found = explaining_maps(problem, options, progress)?.into_iter();
            return Ok(found.next().map(|first| ExplainingMap {
                variance: variance(&first),
                undetermined: first.undetermined,
                map: first.map,
                others: found.map(|other| other.map).collect(),
                rival: f64::INFINITY,
            }));
        }
    };
    let rivals = found.alternatives.iter();
    let rival = rivals.map(variance).fold(f64::INFINITY, f64::min);
    let fit = variance(&found);
    let mut others: Vec<Map> = found.alternatives.into_iter().map(|r| r.map).collect();
    // Four landmarks may have several exact maps, of which the search keeps the best determined.
    if problem.landmarks() == MIN_SHARED {
        others.extend(
            explaining_maps(problem, options, progress)?
                .into_iter()
                .map(|other| other.map),
        );
    }
    Ok(Some(ExplainingMap {
        variance: fit,
        undetermined: found.undetermined,
        map: found.map,
        others,
        rival,
    }))
}

/// Refined maps along the tensor circles of some views: of those that leave least undetermined, the ones that
/// explain the bearings about as well as the best. The most compact comes first, because landmarks diverge at the
/// edge of a family.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so.
pub fn explaining_maps(
    problem: &Problem,
    options: &MapOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Reconstruction>, Error> {
    let circle = if problem.landmarks() == MIN_SHARED {
        Circle::WHOLE
    } else {
        Circle {
            places: options.places,
            ..Circle::WHOLE
        }
    };
    let draws = DrawOptions::default();
    let mut scored = Vec::new();
    let drawn = draw(problem, MIN_SHARED, options.triples, 0, &draws);
    for (done, &views) in drawn.iter().enumerate() {
        let watch = &mut || goes_on(progress, "search", done, drawn.len());
        scored.extend(along_circle(problem, views, circle, watch)?);
    }
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut found = Vec::new();
    for (_, map) in scored.iter().take(options.refined) {
        found.extend(refined(problem, map, progress)?);
    }
    let fewest = found.iter().map(|r| r.undetermined.len()).min();
    found.retain(|r| Some(r.undetermined.len()) == fewest);
    let rms = found.iter().map(|r| r.rms);
    let bound = options.as_good * rms.fold(f64::INFINITY, f64::min) + f64::EPSILON.sqrt();
    found.retain(|r| r.rms <= bound);
    found.sort_by(|a, b| sprawl(&a.map).total_cmp(&sprawl(&b.map)));
    Ok(found)
}

/// A map refined with the usual options; `None` when it cannot be.
fn refined(
    problem: &Problem,
    start: &Map,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let mut report = |stage, done, all| report_progress(progress, stage, done, all);
    match refine(problem, start, &RefineOptions::default(), Some(&mut report)) {
        Err(error @ Error::Interrupted) => Err(error),
        found => Ok(found.ok()),
    }
}

/// Distance of the farthest point of a normalised map from the origin: the views are about 1 away.
fn sprawl(map: &Map) -> f64 {
    let views = map.poses.iter().flatten().map(|p| p.translation.vector);
    let landmarks = map.landmarks.iter().flatten().map(|p| p.coords);
    let distances = views.chain(landmarks).map(|p| p.norm());
    distances.fold(0.0, f64::max)
}

/// Costs per degree of freedom of the refined mirror images of a map of three views: the branches of the
/// three-view solver that do not lead to the map itself.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so.
pub fn mirror_images(
    problem: &Problem,
    map: &Map,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<f64>, Error> {
    if problem.views() != 3 {
        return Ok(Vec::new());
    }
    let (triples, _) = common_bearings(problem, [0, 1, 2]);
    let Ok(found) = three_view(&triples, Method::Calibrated { reweights: 1 }) else {
        return Ok(Vec::new());
    };
    let known = map.normalized();
    let judge = JudgeOptions::default();
    let mut costs = Vec::new();
    for motion in &found.motions {
        let mut start = Map::empty(3, problem.landmarks());
        for (view, pose) in motion.poses.into_iter().enumerate() {
            start.poses[view] = Some(pose);
        }
        grow(problem, &mut start);
        if let Some(found) = refined(problem, &start, progress)?
            && !same(&found.map, &known, &judge)
        {
            costs.push(variance(&found));
        }
    }
    Ok(costs)
}

/// Three views to start a map from: of some triples that share five landmarks, or else four, the one that shares
/// most.
pub fn best_triple(problem: &Problem, options: &MapOptions) -> Option<[usize; 3]> {
    let draws = DrawOptions::default();
    [5, 4].into_iter().find_map(|needed| {
        let drawn = draw(problem, needed, options.start_triples, 0, &draws);
        drawn
            .into_iter()
            .max_by_key(|&views| common_bearings(problem, views).1.len())
    })
}
