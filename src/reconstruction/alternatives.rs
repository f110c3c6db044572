// SPDX-License-Identifier: MIT OR Apache-2.0
//! Alternatives of a map, each at its own minimum.

use super::attempt::{converged, further, recoverable};
use super::behind::without_landmarks_behind;
use super::choice::{SAME_COST, add_rivals, near, prices};
use super::collapsed::refuse_collapsed;
use super::far_views::without_far_views;
use super::infinity::{drop_landmarks_at_infinity, with_landmarks_at_infinity};
use super::judge::assess;
use super::options::{Progress, SolveOptions};
use super::result::Reconstruction;
use super::search::moves::off_views;
use super::stages::StageOptions;
use crate::error::Error;
use crate::lm::Termination;
use crate::problem::Problem;
use alloc::vec::Vec;

/// Positions over the size of the map, and headings \[rad\], that differ by less are those of one map to whoever uses it: the
/// floor of a long valley, and landmarks that stand on either side of a view.
const NEARLY: f64 = 1e-2;

/// A map with its alternatives refined to their minima, as the map is. Those stay that have converged, are minima of their
/// own and still explain as much nearly as well; one that has become lower changes places with the map.
///
/// # Errors
/// Those that stop everything.
pub fn with_settled_alternatives(
    problem: &Problem,
    mut best: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    if best.alternatives.is_empty() {
        return Ok(best);
    }
    let judge = &options.stages.judge;
    let mut maps = Vec::new();
    for rival in core::mem::take(&mut best.alternatives) {
        let rival = recoverable(at_its_minimum(problem, rival, options, progress))?.ok();
        maps.extend(rival.filter(|rival| {
            rival.termination.was_successful() && refuse_collapsed(problem, rival, judge).is_ok()
        }));
    }
    // Of exact maps none is lower. The components are those of whichever is the lowest.
    let exact = best.termination == Termination::ZeroResidual;
    let components = core::mem::take(&mut best.components);
    maps.insert(0, best);
    let prices = prices(problem, &maps, judge);
    let lower = (1..maps.len()).filter(|&k| !exact && prices[k] < prices[0] * SAME_COST);
    let lowest = lower.min_by(|&a, &b| prices[a].total_cmp(&prices[b]));
    let mut best = maps.remove(lowest.unwrap_or(0));
    if lowest.is_some() {
        assess(problem, &mut best);
    }
    maps.retain(|rival| !near(&rival.map, &best.map, NEARLY));
    add_rivals(problem, &mut best, maps.into_iter(), judge);
    for rival in &mut best.alternatives {
        rival.count_directions(problem);
    }
    best.attach(components);
    Ok(best)
}

/// A map refined to the end, without what has gone to infinity or behind its views by then.
fn at_its_minimum(
    problem: &Problem,
    found: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut found = settled(problem, found, options, progress)?;
    drop_landmarks_at_infinity(problem, &mut found, &options.stages.infinity);
    let found = without_far_views(problem, found, options, progress)?;
    without_landmarks_behind(problem, found, options, progress)
}

/// A map refined anew with what is left of its iterations, as long as that lowers it, however it has ended before: the
/// frame of the report, and landmarks put back far out or off their views, are another start.
fn settled(
    problem: &Problem,
    found: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let StageOptions {
        incremental, moves, ..
    } = &options.stages;
    let mut found = converged(problem, found, options, progress)?;
    while found.termination != Termination::ZeroResidual {
        let back = with_landmarks_at_infinity(problem, &found, incremental.far_sizes);
        let off = off_views(problem, &back, moves);
        let mut lower = None;
        for start in core::iter::once(back).chain(off) {
            let refined = further(problem, &found, start, options, progress)?;
            lower = refined.filter(|refined| refined.cost < found.cost * SAME_COST);
            if lower.is_some() {
                break;
            }
        }
        let Some(refined) = lower else { break };
        found = refined;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::geometry::Pose;
    use crate::lm::RefineOptions;
    use crate::problem::Map;
    use crate::reconstruction::solve;
    use crate::simulate::{Arena, Layout, simulate};
    use nalgebra::{Translation2, UnitComplex};

    /// What is left of a refinement of so many iterations from a map with its second view moved.
    fn cut_short(problem: &Problem, map: &Map, off: f64, max_iterations: usize) -> Reconstruction {
        let mut map = map.clone();
        let by = Pose::from_parts(Translation2::new(off, 0.0), UnitComplex::identity());
        map.poses[1] = map.poses[1].map(|pose| by * pose);
        let options = RefineOptions {
            max_iterations,
            ..RefineOptions::default()
        };
        let report = refine_map(problem, &mut map, &options, None).unwrap();
        Reconstruction::new(problem, &map, report)
    }

    /// Alternatives that were given few iterations go on to their minima. What then is the map itself, or one of the others,
    /// is none, nor what cannot go on; and one that is lower is the map.
    #[test]
    fn alternatives_are_minima_of_their_own() {
        let options = SolveOptions::default();
        let mut told = 0;
        for seed in 0..400 {
            let scene = simulate(Layout::Enclosed, 3, 6, 0.01, seed, Arena::default()).unwrap();
            let problem = Problem::dense(3, 6, &scene.bearings, 0.01).unwrap();
            let Ok(found) = solve(&problem, &options, None) else {
                continue;
            };
            let [other] = &found.alternatives[..] else {
                continue;
            };
            let settle = |best: &Reconstruction, rivals: &[&Reconstruction], most: usize| {
                let mut best = best.clone();
                best.alternatives = rivals.iter().map(|&rival| rival.clone()).collect();
                best.components = Vec::from([found.clone()]);
                let mut options = options;
                options.refine.max_iterations = most;
                with_settled_alternatives(&problem, best, &options, &mut None).unwrap()
            };
            let near = |one: &Reconstruction, other: &Reconstruction| {
                (one.cost / other.cost - 1.0).abs() < 1e-6
            };
            let near_other = cut_short(&problem, &other.map, 0.03, 1);
            let near_best = cut_short(&problem, &found.map, 0.03, 1);
            let leads_to = |short: &Reconstruction, whole: &Reconstruction| {
                short.termination == Termination::MaxIterations
                    && short.cost > whole.cost * 1.0001
                    && near(&cut_short(&problem, &short.map, 0.0, 1000), whole)
            };
            let lead = leads_to(&near_other, other) && leads_to(&near_best, &found);
            if !lead || near(other, &found) {
                continue;
            }
            told += 1;
            let rivals = [&near_other, &near_best, &near_other];
            let settled = settle(&found, &rivals, 1000);
            let costs: Vec<f64> = settled.alternatives.iter().map(|a| a.cost).collect();
            assert!(
                near(&settled, &found),
                "{seed} {} {}",
                settled.cost,
                found.cost
            );
            assert!(
                costs.len() == 1,
                "{seed} {costs:?} {} {}",
                other.cost,
                found.cost
            );
            assert!(near(&settled.alternatives[0], other), "{seed}");
            assert!(settled.alternatives[0].termination.was_successful());
            // The lower one changes places with the map, whose components stay.
            let settled = settle(other, &[&near_best], 1000);
            assert!(
                near(&settled, &found) && settled.alternatives.len() == 1,
                "{seed}"
            );
            assert!(near(&settled.alternatives[0], other) && settled.components.len() == 1);
            assert!(settled.uncertainty > 0.0);
            // Nor is one that is nearly the map: it has the same cost, a hundredth of its size away.
            let mut beside = found.clone();
            beside.termination = Termination::ZeroResidual;
            for (off, rivals) in [(0.9 * NEARLY, 0), (1.1 * NEARLY, 1)] {
                let by = Pose::from_parts(Translation2::new(off, 0.0), UnitComplex::identity());
                beside.map.poses[1] = found.map.poses[1].map(|pose| by * pose);
                let settled = settle(&found, &[&beside], 1000);
                assert_eq!(settled.alternatives.len(), rivals, "{seed}");
            }
            // One that has used up its iterations is no minimum.
            assert!(settle(&found, &[&near_other], 1).alternatives.is_empty());
        }
        assert!(told > 3, "{told}");
    }
}
