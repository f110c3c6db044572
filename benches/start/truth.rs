// SPDX-License-Identifier: MIT OR Apache-2.0
//! What the truth of a scene leads to where there are outliers.

use super::Instance;
use bearslam::{Map, Problem, RefineOptions, Sighting, refine, refine_map};

/// Standard deviations beyond which a bearing is an outlier.
pub const OUTLIER: f64 = 3.0;

/// The truncated cost that the truth leads to; `None` when its inliers leave a part of the map free, which can then be
/// placed to explain sightings that nothing checks.
pub fn truncated_from_truth(instance: &Instance) -> Option<f64> {
    let Instance {
        problem,
        sightings,
        wrong,
        ..
    } = instance;
    let mut map: Map = instance.truth.clone();
    let mut kept: Vec<bool> = wrong.iter().map(|wrong| !wrong).collect();
    let of_kept = |kept: &[bool]| {
        let pairs = sightings.iter().zip(kept).filter(|(_, kept)| **kept);
        let chosen: Vec<Sighting> = pairs.map(|(sighting, _)| *sighting).collect();
        Problem::new(problem.views(), problem.landmarks(), &chosen).expect("a problem")
    };
    // Each change lowers the cost.
    for _ in 0..100 {
        let inliers = of_kept(&kept);
        if refine_map(&inliers, &mut map, &RefineOptions::default(), None).is_err() {
            break;
        }
        let next = in_order(
            problem,
            squares(problem, &map).map(|s| s <= OUTLIER * OUTLIER),
        );
        if next == kept {
            break;
        }
        kept = next;
    }
    let last = refine(&of_kept(&kept), &map, &RefineOptions::default(), None).ok()?;
    let squares = squares(problem, &map).map(|square| 0.5 * square.min(OUTLIER * OUTLIER));
    (last.uncertainty < 1.0).then(|| squares.sum())
}

/// Values in the order of the problem's sightings, put in that of its input.
fn in_order(problem: &Problem, values: impl Iterator<Item = bool>) -> Vec<bool> {
    let mut ordered = vec![false; problem.sightings().len()];
    for (&place, value) in problem.input_order().iter().zip(values) {
        ordered[place] = value;
    }
    ordered
}

/// The squares of residual over sigma; infinite where the map does not reach.
pub fn squares<'a>(problem: &'a Problem, map: &'a Map) -> impl Iterator<Item = f64> + 'a {
    let residuals = map.residuals(problem);
    let pairs = problem.sightings().iter().zip(residuals);
    pairs.map(|(s, residual)| residual.map_or(f64::INFINITY, |r| (r * s.weight).powi(2)))
}
