// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parts of a map, such as those of several robots, that what is known or what they share ties together.

use super::super::choice::near;
use super::super::judge::{assess, is_excess_plausible};
use super::super::result::Reconstruction;
use super::super::stages::StageOptions;
use super::frames::{crossings, in_frame_of, in_frame_of_priors, laid_over};
use crate::error::Error;
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// The views and landmarks of a map, as far as its views are in none of some others.
pub fn beyond<'a>(start: &Map, others: impl Iterator<Item = &'a Map>) -> Map {
    let mut rest = start.clone();
    for other in others {
        for (place, pose) in rest.poses.iter_mut().zip(&other.poses) {
            *place = place.filter(|_| pose.is_none());
        }
    }
    rest
}

/// Parts as one map wherever priors or shared landmarks tie them in all directions, without any redundancy if need be, and
/// the whole costs no more than the parts and the noise of the ties; `refine` gives the minimum next to a start.
///
/// # Errors
/// Those of `refine`.
pub fn tied(
    problem: &Problem,
    mut parts: Vec<Reconstruction>,
    stages: &StageOptions,
    refine: &mut impl FnMut(&Map) -> Result<Option<Reconstruction>, Error>,
) -> Result<Vec<Reconstruction>, Error> {
    let (mut a, mut b) = (0, 1);
    while b < parts.len() {
        if let Some(whole) = joined(problem, [&parts[a], &parts[b]], stages, refine)? {
            parts[a] = whole;
            parts.remove(b);
            (a, b) = (0, 1);
        } else if b + 1 < parts.len() {
            b += 1;
        } else {
            (a, b) = (a + 1, a + 2);
        }
    }
    Ok(parts)
}

/// Two parts as one; `None` where nothing ties them, they do not fit, or they fit in several ways.
fn joined(
    problem: &Problem,
    parts: [&Reconstruction; 2],
    stages: &StageOptions,
    refine: &mut impl FnMut(&Map) -> Result<Option<Reconstruction>, Error>,
) -> Result<Option<Reconstruction>, Error> {
    let mut found: Vec<Reconstruction> = Vec::new();
    for start in starts(problem, parts.map(|part| &part.map), stages) {
        let Some(whole) = refine(&start)? else {
            continue;
        };
        if parts.iter().all(|part| whole.map.has_views_of(&part.map))
            && are_tied(problem, parts, &whole, stages)
        {
            found.push(whole);
        }
    }
    let best = found.iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    let is_only = |best: &&Reconstruction| {
        let mut others = found.iter();
        others.all(|other| near(&other.map, &best.map, SAME_WAY))
    };
    Ok(best.filter(is_only).cloned())
}

/// Positions over the size of the map, and headings \[rad\], that differ by less are those of one way to join two parts.
const SAME_WAY: f64 = 1e-2;

/// Two parts in one frame, in each way that what is known or shared puts them.
fn starts(problem: &Problem, maps: [&Map; 2], stages: &StageOptions) -> Vec<Map> {
    let [first, second] = maps;
    let framed = maps.map(|map| in_frame_of_priors(problem, map));
    let mut found = Vec::new();
    match &framed {
        [Some(first), Some(second)] => found.push(first.united(second)),
        [Some(first), None] => {
            found.extend(in_frame_of(problem, first, second).map(|other| first.united(&other)));
        }
        [None, Some(second)] => {
            found.extend(in_frame_of(problem, second, first).map(|other| second.united(&other)));
        }
        [None, None] => {}
    }
    let shared = second.landmarks.iter().zip(&first.landmarks);
    let shared: Vec<_> = shared.filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
    if shared.len() >= stages.odometry_growth.min_shared {
        found.extend(laid_over(maps, &shared));
    }
    if !framed.iter().all(Option::is_some) {
        found.extend(crossings(problem, maps, &stages.headings));
    }
    found
}

/// Whether as much ties two parts as they are free to move against each other, the whole is determined, and it costs no
/// more than they do but for the noise of what ties them.
fn are_tied(
    problem: &Problem,
    parts: [&Reconstruction; 2],
    whole: &Reconstruction,
    stages: &StageOptions,
) -> bool {
    let own = parts[0].freedom + parts[1].freedom;
    let cost = parts[0].cost + parts[1].cost;
    let Some(added) = whole.freedom.checked_sub(own) else {
        return false;
    };
    let (excess, noise) = (2.0 * (whole.cost - cost), 2.0 * cost / own.max(1) as f64);
    let deviations = stages.judge.plausible_deviations;
    let mut assessed = whole.clone();
    assess(problem, &mut assessed);
    is_excess_plausible(problem, excess, added, noise, deviations)
        && assessed.sensitivity < stages.judge.tied
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::{aligned_to_priors, refine_map};
    use crate::lm::RefineOptions;
    use crate::problem::{LandmarkPrior, Noise, Odometry};
    use crate::simulate::{Arena, Layout, simulate};

    /// Two robots of three views each see two landmarks each for themselves and two together. One landmark that both place
    /// and a ray to the other tie them in two ways, of which a survey leaves one.
    #[test]
    fn robots_are_one_map_as_soon_as_they_are_tied() {
        let scene = simulate(Layout::Enclosed, 6, 6, 0.0, 3, Arena::default()).unwrap();
        let motion = |start: usize| Odometry {
            start,
            end: start + 1,
            delta: scene.poses[start].inv_mul(&scene.poses[start + 1]),
            noise: Noise::Sigmas([0.01; 3]),
        };
        let odometry = [0, 1, 3, 4].map(motion);
        let stages = StageOptions::default();
        // (rays of the second robot to the shared landmarks, whether these are surveyed, whether that ties it)
        for (rays, known, is_tied) in [
            (6, false, true),
            (4, false, false),
            (3, false, false),
            (4, true, true),
        ] {
            let mut bearings = scene.bearings.clone();
            let mut hide = |view: usize, landmark: usize| bearings[6 * view + landmark] = f64::NAN;
            for view in 0..3 {
                hide(view, 4);
                hide(view, 5);
                hide(view + 3, 2);
                hide(view + 3, 3);
            }
            for k in rays..6 {
                hide(3 + k % 3, k / 3);
            }
            let problem = Problem::dense(6, 6, &bearings, 1e-4).unwrap();
            let mut problem = problem.with_odometry(&odometry).unwrap();
            if known {
                let survey = [0, 1].map(|landmark| LandmarkPrior {
                    landmark,
                    position: scene.landmarks[landmark],
                    noise: Noise::Sigmas([0.01; 2]),
                });
                problem = problem.with_landmark_priors(&survey).unwrap();
            }
            let mut refine = |start: &Map| {
                let mut map = aligned_to_priors(&problem, start);
                let report = refine_map(&problem, &mut map, &RefineOptions::default(), None);
                Ok(report
                    .ok()
                    .map(|report| Reconstruction::new(&problem, &map, report)))
            };
            let truth = scene.map();
            let mut first = truth.clone();
            first.poses[3..].fill(None);
            let second = beyond(&truth, core::iter::once(&first));
            let posed = second.poses.iter().map(Option::is_some);
            assert!(posed.eq([false, false, false, true, true, true]));
            let parts = [first, second].map(|map| refine(&map).unwrap().unwrap());
            let all = tied(&problem, parts.to_vec(), &stages, &mut refine).unwrap();
            assert_eq!(all.len(), if is_tied { 1 } else { 2 }, "{rays} {known}");
            assert!(!is_tied || all[0].map.poses.iter().all(Option::is_some));
        }
    }
}
