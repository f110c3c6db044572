// SPDX-License-Identifier: MIT OR Apache-2.0
//! Comparison of maps: whether two are the same minimum, what each leaves unexplained, and which is the best.

use super::judge::{JudgeOptions, is_as_good, is_too_costly, mean_weight, rounding, variance};
use super::result::Reconstruction;
use crate::adjustment::gauge::gauge_and_prior_numbers;
use crate::error::{Degeneracy, Error};
use crate::lm::Loss;
use crate::problem::{Map, Problem, Undetermined, Why};
use alloc::vec::Vec;

/// Costs whose ratio is closer to 1 than this belong to the same minimum. Not an option: refinements to the same
/// minimum differ by up to this.
pub const SAME_COST: f64 = 1.0 - 1e-6;

/// Whether two maps in one frame are the same minimum.
pub fn same(a: &Map, b: &Map, options: &JudgeOptions) -> bool {
    near(a, b, options.same)
}

/// Whether all poses of two maps in one frame differ by less than a bound, positions as a part of the size of the map.
pub fn near(a: &Map, b: &Map, near: f64) -> bool {
    let far = near * a.size();
    a.poses.iter().zip(&b.poses).all(|(a, b)| match (a, b) {
        (Some(a), Some(b)) => {
            (a.translation.vector - b.translation.vector).norm() < far
                && a.rotation.angle_to(&b.rotation).abs() < near
        }
        (None, None) => true,
        _ => false,
    })
}

/// What makes maps comparable that do not explain the same sightings: the cost of each with its components, and a price
/// for every number that these do not explain.
///
/// The price is the cost of a residual three times as large as that of an outlier in units of the noise, so that a
/// complete map wins over one that leaves something out unless it explains that very badly. The noise is that of the best fit of those maps that have
/// at least half of the degrees of freedom: a map of little explains it too well.
pub fn prices(problem: &Problem, found: &[Reconstruction], options: &JudgeOptions) -> Vec<f64> {
    let most = found.iter().map(|found| found.freedom).max().unwrap_or(0);
    let telling = found.iter().filter(|found| 2 * found.freedom >= most);
    let expected = options.expected_noise * options.expected_noise;
    // Where no map fits the stated standard deviations, what a map leaves out must not cost more than what it explains badly.
    let (floor, ceiling) = if problem.states_sigma() {
        (1.0, options.rival_ratio.max(1.0))
    } else {
        (expected, f64::INFINITY)
    };
    let noise = telling.map(variance).fold(f64::INFINITY, f64::min);
    let noise = noise.max(floor).min(ceiling);
    let outlier = 0.5 * Loss::<f64>::TRUNCATED * Loss::<f64>::TRUNCATED;
    let each = outlier * options.rival_ratio * noise;
    let prior_numbers = |found: &Reconstruction| gauge_and_prior_numbers(problem, &found.map).1;
    let numbers: Vec<usize> = found.iter().map(prior_numbers).collect();
    let all = numbers.iter().copied().max().unwrap_or(0);
    found
        .iter()
        .zip(numbers)
        .map(|(found, numbers)| {
            let parts = || core::iter::once(found).chain(&found.components);
            let unexplained = (0..found.residuals.len())
                .filter(|&k| parts().all(|part| part.residuals[k].is_none()));
            // Of each component, a similarity is not.
            let ties = 4 * found.components.len();
            let cost: f64 = parts().map(|part| part.cost).sum();
            cost + each * (unexplained.count() + ties + all - numbers) as f64
        })
        .collect()
}

/// The second of two maps where its price is lower and it is not too costly, unless the first is too; otherwise the first.
/// Nothing that does not fit is taken into a map that does.
pub fn better(
    problem: &Problem,
    both: [Reconstruction; 2],
    options: &JudgeOptions,
) -> Reconstruction {
    let prices = prices(problem, &both, options);
    let costly = both
        .each_ref()
        .map(|map| is_too_costly(problem, map, options.plausible_deviations));
    let [before, after] = both;
    if prices[1] < prices[0] * SAME_COST && (costly[0] || !costly[1]) {
        after
    } else {
        before
    }
}

/// The best of some reconstructions, with the rivals that explain the data nearly as well.
pub fn choose(
    problem: &Problem,
    found: Vec<Reconstruction>,
    options: &JudgeOptions,
) -> Result<Reconstruction, Error> {
    let prices = prices(problem, &found, options);
    let mut ranked: Vec<(f64, Reconstruction)> = prices.into_iter().zip(found).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut found = ranked.into_iter().map(|(_, found)| found);
    let mut best = found.next().ok_or(Error::Degenerate {
        kind: Degeneracy::NoHypothesis,
        value: 0.0,
        bound: 1.0,
    })?;
    add_rivals(problem, &mut best, found, options);
    Ok(best)
}

/// Adds to the alternatives of a map those of some others that explain as much nearly as well, each minimum once.
pub fn add_rivals(
    problem: &Problem,
    best: &mut Reconstruction,
    found: impl Iterator<Item = Reconstruction>,
    options: &JudgeOptions,
) {
    let ratio = options.rival_ratio;
    let rounding = rounding(mean_weight(problem));
    let least = variance(best);
    for rival in found {
        let mut known = core::iter::once(&*best).chain(&best.alternatives);
        if is_as_good(variance(&rival), least, ratio, rounding)
            && missing(&rival) == missing(best)
            && known.all(|other| !same(&rival.map, &other.map, options))
        {
            best.alternatives.push(rival);
        }
    }
    best.alternatives.sort_by(|a, b| a.cost.total_cmp(&b.cost));
}

/// Views and landmarks that a map does not reach; the bearings of those at infinity count.
fn missing(found: &Reconstruction) -> usize {
    let unreached = |one: &&Undetermined| one.why != Why::AtInfinity;
    found.undetermined.iter().filter(unreached).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::geometry::pose;
    use crate::lm::RefineOptions;
    use crate::simulate::{Arena, Layout, simulate};

    /// A problem with stated standard deviations and its map.
    fn setting() -> (Problem, Reconstruction) {
        let scene = simulate(Layout::Enclosed, 5, 9, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(5, 9, &scene.bearings, 0.01).unwrap();
        let mut map = scene.map();
        let report = refine_map(&problem, &mut map, &RefineOptions::default(), None).unwrap();
        let found = Reconstruction::new(&problem, &map, report);
        (problem, found)
    }

    /// Another minimum is a rival up to residuals three times as large, and best comes first.
    #[test]
    fn rivals_have_at_most_three_times_the_residuals() {
        let (problem, best) = setting();
        let mut rival = best.clone();
        rival.map.poses[3] = Some(pose(0.1, 0.2, 0.3));
        for (times, rivals) in [(1.1_f64, 1), (2.98, 1), (3.02, 0)] {
            rival.cost = best.cost * times * times;
            let found = Vec::from([rival.clone(), best.clone()]);
            let chosen = choose(&problem, found, &JudgeOptions::default()).unwrap();
            assert_eq!(chosen.map, best.map);
            assert_eq!(chosen.alternatives.len(), rivals, "{times}");
        }
        // The same minimum is no rival, however close.
        let found = Vec::from([best.clone(), best.clone()]);
        let chosen = choose(&problem, found, &JudgeOptions::default()).unwrap();
        assert!(chosen.alternatives.is_empty());
    }

    /// What a map does not explain costs as much as a residual three times that of an outlier, in units of the noise.
    #[test]
    fn an_unexplained_sighting_costs_nine_deviations() {
        let (problem, whole) = setting();
        let mut part = whole.clone();
        part.residuals[7] = None;
        for variance in [1.0, 2.0, 5.0] {
            part.cost = 0.5 * variance * part.freedom as f64;
            let price = 0.5 * 9.0 * 9.0 * variance;
            for (more, is_whole) in [(0.99 * price, true), (1.01 * price, false)] {
                let mut whole = whole.clone();
                whole.cost = part.cost + more;
                let found = Vec::from([part.clone(), whole]);
                let chosen = choose(&problem, found, &JudgeOptions::default()).unwrap();
                assert_eq!(chosen.residuals[7].is_some(), is_whole, "{variance} {more}");
            }
        }
    }

    /// Sightings that a component explains are as good as those of the map, but for what ties the two.
    #[test]
    fn components_count_as_explained() {
        let (problem, whole) = setting();
        let mut part = whole.clone();
        let far = 40;
        part.residuals[far..].fill(None);
        let mut component = whole.clone();
        component.residuals[..far].fill(None);
        component.cost = 0.0;
        let mut apart = part.clone();
        apart.components.push(component);
        let prices = prices(&problem, &[whole, part, apart], &JudgeOptions::default());
        assert!(prices[0] < prices[2] && prices[2] < prices[1], "{prices:?}");
    }

    #[test]
    fn maps_are_near_when_all_poses_are() {
        let map = |x: f64, heading: f64, last: bool| Map {
            poses: Vec::from([
                Some(pose(0.0, 0.0, 0.0)),
                Some(pose(3.0, 4.0, 0.5)),
                Some(pose(x, 5.0, heading)),
                last.then(|| pose(5.0, 0.0, 1.0)),
            ]),
            landmarks: Vec::new(),
        };
        // All are five away from the first view.
        let base = map(0.0, -0.2, true);
        assert!((base.size() - 5.0).abs() < 1e-12);
        for (x, heading, last, expected) in [
            (0.0499, -0.2, true, true),
            (0.0501, -0.2, true, false),
            (0.0, -0.2099, true, true),
            (0.0, -0.2101, true, false),
            (0.0, -0.2, false, false),
        ] {
            let other = map(x, heading, last);
            assert_eq!(near(&base, &other, 0.01), expected, "{x} {heading} {last}");
        }
        assert!(near(&map(0.0, 0.0, false), &map(0.0, 0.0, false), 0.01));
        // A map of one view, or of one place, has no size of its own.
        let mut one = Map::empty(3, 0);
        assert_eq!(one.size(), 1.0);
        one.poses[1] = Some(pose(7.0, 0.0, 0.0));
        assert_eq!(one.size(), 1.0);
        one.poses[2] = one.poses[1];
        assert_eq!(one.size(), 1.0);
    }

    /// The second map is better where it costs less, unless only it is too costly for what is stated.
    #[test]
    fn nothing_that_does_not_fit_is_better_than_what_does() {
        let (problem, whole) = setting();
        let options = JudgeOptions::default();
        let fits = 0.5 * whole.freedom as f64;
        let with = |cost: f64| {
            let mut found = whole.clone();
            found.cost = cost;
            found
        };
        let mut part = with(fits);
        part.residuals[20..].fill(None);
        for (before, after, expected) in [
            (with(fits), with(0.9 * fits), 0.9 * fits),
            (with(fits), with(1.1 * fits), fits),
            (with(fits), with(fits * (1.0 - 1e-9)), fits),
            (part.clone(), with(1.1 * fits), 1.1 * fits),
            (part.clone(), with(9.0 * fits), fits),
            (with(12.0 * fits), with(9.0 * fits), 9.0 * fits),
        ] {
            let found = better(&problem, [before, after], &options);
            assert_eq!(found.cost, expected);
        }
        let nothing = choose(&problem, Vec::new(), &options);
        assert!(matches!(
            nothing,
            Err(Error::Degenerate {
                kind: Degeneracy::NoHypothesis,
                ..
            })
        ));
    }

    /// The price of what a map leaves out follows the noise of the best map that has at least half of the degrees of
    /// freedom; where deviations are stated, up to three times them, otherwise from a good degree on.
    #[test]
    fn the_price_follows_the_noise() {
        let (problem, whole) = setting();
        let unstated = Problem::dense(5, 9, &[0.1; 45], 1.0).unwrap();
        let options = JudgeOptions::default();
        let freedom = whole.freedom as f64;
        let (outlier, expected) = (0.5 * 9.0 * 9.0, 0.02 * 0.02);
        for (problem, variance, noise) in [
            (&problem, 0.5, 1.0),
            (&problem, 4.0, 4.0),
            (&problem, 20.0, 9.0),
            (&unstated, 0.1 * expected, expected),
            (&unstated, 20.0, 20.0),
        ] {
            let mut part = whole.clone();
            part.cost = 0.5 * variance * freedom;
            part.residuals[7..9].fill(None);
            // Of less than half of the degrees of freedom.
            let mut little = part.clone();
            little.freedom = whole.freedom / 2 - 1;
            little.cost = 0.0;
            little.residuals[7..].fill(None);
            let found = prices(problem, &[part.clone(), little], &options);
            let price = (found[0] - part.cost) / 2.0;
            assert!(
                (price / (outlier * noise) - 1.0).abs() < 1e-9,
                "{variance}: {price}"
            );
            assert!((found[1] / (38.0 * price) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn alternatives_are_distinct_and_as_complete_as_the_best() {
        let (problem, best) = setting();
        let rival = |times: f64, x: f64| {
            let mut rival = best.clone();
            rival.cost *= times;
            rival.map.poses[3] = Some(pose(x, 0.2, 0.3));
            rival
        };
        let mut part = rival(1.2, 0.7);
        part.undetermined.push(Undetermined {
            subject: crate::problem::Subject::Landmark(3),
            why: Why::Degenerate,
        });
        // Its bearings count.
        let mut at_infinity = rival(2.5, 0.9);
        at_infinity.undetermined.push(Undetermined {
            subject: crate::problem::Subject::Landmark(3),
            why: Why::AtInfinity,
        });
        let found = Vec::from([
            rival(3.0, 0.1),
            at_infinity,
            rival(2.0, 0.5),
            part,
            best.clone(),
            rival(4.0, 0.5),
        ]);
        let chosen = choose(&problem, found, &JudgeOptions::default()).unwrap();
        let costs: Vec<f64> = chosen
            .alternatives
            .iter()
            .map(|a| a.cost / best.cost)
            .collect();
        assert_eq!(costs.len(), 3);
        for (cost, expected) in costs.iter().zip([2.0, 2.5, 3.0]) {
            assert!((cost - expected).abs() < 1e-9, "{costs:?}");
        }
    }
}
