// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps that have collapsed into a point.

use super::judge::JudgeOptions;
use super::result::Reconstruction;
use crate::error::{Degeneracy, Error};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::{median, middle};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::Vector2;

/// Views below which a map in few places is no collapse: of three, one is the middle.
const FEW_VIEWS: usize = 4;

/// Rejects a map that explains nothing and has most views in one place, or that has most landmarks on views: the least
/// squares of a few bearings that are exact there, whatever the others.
///
/// # Errors
/// [`Error::Degenerate`].
pub fn refuse_collapsed(
    problem: &Problem,
    found: &Reconstruction,
    options: &JudgeOptions,
) -> Result<(), Error> {
    let views = found.map.view_positions().count();
    let explains = views < FEW_VIEWS || found.rms <= options.explaining_rms;
    let of_views = (!explains).then(|| share(&found.map));
    // On its view a landmark has any bearing, so that the residuals say nothing.
    for value in [of_views, ranges(problem, &found.map)]
        .into_iter()
        .flatten()
    {
        if value < options.collapsed {
            return Err(Error::Degenerate {
                kind: Degeneracy::CollapsedMap,
                value,
                bound: options.collapsed,
            });
        }
    }
    Ok(())
}

/// Leaves out alternatives that have collapsed, and where the best has not, those with all views in one place.
pub fn drop_collapsed_alternatives(
    problem: &Problem,
    best: &mut Reconstruction,
    options: &JudgeOptions,
) {
    let in_one_place = |map: &Map| {
        let mut views = map.view_positions();
        let first = views.next();
        views.all(|view| Some(view) == first)
    };
    let stands = in_one_place(&best.map);
    best.alternatives.retain(|rival| {
        refuse_collapsed(problem, rival, options).is_ok() && (stands || !in_one_place(&rival.map))
    });
}

/// The median range of the landmarks from the nearest view that sees them, as a share of the extent of the map; `None` for
/// a single landmark, which may end on a view where that makes its residual zero.
fn ranges(problem: &Problem, map: &Map) -> Option<f64> {
    let landmarks: Vec<Vector2<f64>> = map.landmarks.iter().flatten().map(|p| p.coords).collect();
    let views: Vec<Vector2<f64>> = map.view_positions().collect();
    let first = views.first().filter(|_| landmarks.len() > 1)?;
    let places = views.iter().chain(&landmarks);
    let extent = places.fold(0.0, |most: f64, place| {
        most.max((place - first).norm_squared())
    });
    let placed = map.landmarks.iter().enumerate();
    let placed = placed.filter_map(|(landmark, point)| Some((landmark, (*point)?)));
    let nearest = placed.map(|(landmark, point)| {
        let rays = map.rays(problem, landmark);
        let squares = rays.map(|(pose, _)| (pose.translation.vector - point.coords).norm_squared());
        squares.fold(f64::INFINITY, f64::min).sqrt()
    });
    Some(median(nearest.collect()) / extent.sqrt())
}

/// The median distance of the views from their middle, as a share of the largest.
pub fn share(map: &Map) -> f64 {
    let views: Vec<Vector2<f64>> = map.view_positions().collect();
    let middle = middle(&views);
    let distances = views.iter().map(|place| (place - middle).norm());
    let farthest = distances.clone().fold(0.0, f64::max);
    median(distances.collect()) / farthest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use alloc::vec;
    use nalgebra::Point2;

    #[test]
    fn most_landmarks_on_views_are_no_map() {
        let of = |landmarks: &[(f64, f64)]| {
            let map = Map {
                poses: [(0.0, 0.0), (1.0, 0.0), (0.0, 2.0)]
                    .map(|(x, y)| Some(pose(x, y, 0.3)))
                    .to_vec(),
                landmarks: landmarks
                    .iter()
                    .map(|&(x, y)| Some(Point2::new(x, y)))
                    .collect(),
            };
            let bearings = vec![0.1; 3 * landmarks.len()];
            let problem = Problem::dense(3, landmarks.len(), &bearings, 1.0).unwrap();
            ranges(&problem, &map)
        };
        let (first, second) = ((1e-9, 0.0), (1.0, -1e-9));
        let (near, far) = ((0.0, 1e-6), (3.0, 1.0));
        for (landmarks, on) in [
            (&[first, second][..], true),
            (&[first, second, far], true),
            (&[first, second, far, near], false),
            (&[first, near, near], false),
        ] {
            assert_eq!(of(landmarks).unwrap() < 1e-8, on, "{landmarks:?}");
        }
        assert_eq!(of(&[first]), None);
    }

    /// A map of many views that explains nothing has collapsed when most of them are in one place.
    #[test]
    fn most_views_in_one_place_are_no_map() {
        let scene = crate::simulate::simulate(
            crate::simulate::Layout::Enclosed,
            6,
            9,
            0.01,
            3,
            crate::simulate::Arena::default(),
        );
        let scene = scene.unwrap();
        let problem = Problem::dense(6, 9, &scene.bearings, 0.01).unwrap();
        let mut map = scene.map();
        let refine = crate::lm::RefineOptions::default();
        let report = crate::adjustment::refine_map(&problem, &mut map, &refine, None).unwrap();
        let whole = Reconstruction::new(&problem, &map, report);
        let options = JudgeOptions::default();
        let collapsed = |rms: f64, together: usize, views: usize| {
            let mut found = whole.clone();
            found.rms = rms;
            for pose in found.map.poses.iter_mut().flatten().take(together) {
                pose.translation.vector.fill(1e-10);
            }
            found.map.poses[views..].fill(None);
            match refuse_collapsed(&problem, &found, &options) {
                Ok(()) => false,
                Err(Error::Degenerate { kind, value, bound }) => {
                    assert!(kind == Degeneracy::CollapsedMap && value < bound);
                    true
                }
                Err(error) => panic!("{error}"),
            }
        };
        assert!(collapsed(0.11, 5, 6) && collapsed(0.11, 4, 6) && collapsed(0.11, 3, 4));
        assert!(!collapsed(0.11, 2, 6) && !collapsed(0.09, 5, 6) && !collapsed(0.11, 2, 3));
        // Alternatives go where they have collapsed, or stand still while the best does not.
        let mut still = whole.clone();
        for pose in still.map.poses.iter_mut().flatten() {
            pose.translation.vector.fill(0.5);
        }
        let mut bad = whole.clone();
        bad.rms = 0.2;
        for pose in bad.map.poses.iter_mut().flatten().take(5) {
            pose.translation.vector.fill(0.5);
        }
        let left = |best: &Reconstruction| {
            let mut best = best.clone();
            best.alternatives = vec![whole.clone(), still.clone(), bad.clone()];
            drop_collapsed_alternatives(&problem, &mut best, &options);
            best.alternatives.len()
        };
        assert_eq!((left(&whole), left(&still)), (1, 2));
    }
}
