// SPDX-License-Identifier: MIT OR Apache-2.0
//! The method of Dellaert and Stroupe: the first three views, the fourth to choose the branch, the rest one by one.

use super::super::grow::{grow, resect_view};
use super::triples::common_bearings;
use crate::error::Error;
use crate::kernels::{Method, Motion, three_view};
use crate::problem::{Map, Problem};

/// A map from the first three views, the others added in their order.
///
/// The two solutions of three views are distinguished by the singular value of the resection of the
/// fourth view; with three views only, or when they are equal, by the signs of the bearings.
///
/// # Errors
/// Those of [`three_view`] for the first three views.
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, sections 3.4 and 3.5.
pub fn initialize_from_first_three(problem: &Problem, method: Method) -> Result<Map, Error> {
    if problem.views() < 3 {
        return Err(Error::TooFew {
            what: "views",
            needed: 3,
            got: problem.views(),
        });
    }
    let (triples, landmarks) = common_bearings(problem, [0, 1, 2]);
    let solution = three_view(&triples, method)?;
    let start = |motion: &Motion<f64>| {
        let mut map = Map::empty(problem.views(), problem.landmarks());
        for (place, pose) in map.poses.iter_mut().zip(motion.poses) {
            *place = Some(pose);
        }
        for (triple, &landmark) in triples.iter().zip(&landmarks) {
            map.landmarks[landmark] = motion.landmark(triple);
        }
        map
    };
    let mut maps = solution.motions.each_ref().map(start);
    if problem.views() > 3 {
        let misfit = maps
            .each_ref()
            .map(|map| resect_view(problem, map, 3).map_or(f64::INFINITY, |found| found.1));
        if misfit[1] < misfit[0] {
            maps.swap(0, 1);
        }
    }
    let [mut map, _] = maps;
    for view in 3..problem.views() {
        map.poses[view] = resect_view(problem, &map, view).map(|found| found.0);
    }
    // Add what could not be placed in the order of the views.
    grow(problem, &mut map);
    Ok(map)
}
