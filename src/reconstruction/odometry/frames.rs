// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pieces brought into one frame: that of the priors where these fix it, otherwise by the landmarks that they share.

use crate::adjustment::aligned_to_priors;
use crate::adjustment::gauge::{FixedByPriors, gauge_and_prior_numbers};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::align;
use crate::geometry::points::{centroid, spread};
use crate::problem::{LandmarkPrior, Map, Noise, Problem};
use alloc::vec::Vec;
use nalgebra::{Point2, Similarity2, Translation2, UnitComplex};

/// The standard deviation of a shared landmark beside priors, as a part of the size of the map that it is taken from:
/// it only has to weigh less than a survey and more than nothing.
const SHARED: f64 = 0.01;

/// The position of a landmark in the second of two pieces, and in the first.
pub type Shared = (Point2<f64>, Point2<f64>);

/// A piece in the frame of the priors; `None` where odometry and priors leave some of its frame free.
pub fn in_frame_of_priors(problem: &Problem, piece: &Map) -> Option<Map> {
    let (free, numbers) = gauge_and_prior_numbers(problem, piece);
    (free == 0 && numbers > 0).then(|| aligned_to_priors(problem, piece))
}

/// A piece in the frame of the priors, with the landmarks that it shares with a map in that frame as further ones;
/// `None` where all this leaves some of its frame free.
pub fn in_frame_of(problem: &Problem, map: &Map, piece: &Map) -> Option<Map> {
    let places: Vec<_> = map
        .landmarks
        .iter()
        .flatten()
        .map(|point| point.coords)
        .collect();
    let (count, middle) = (places.len() as f64, centroid(&places));
    let size = (spread(&places) / count)
        .sqrt()
        .max(middle.norm() * f64::EPSILON);
    let pairs = map.landmarks.iter().zip(&piece.landmarks).enumerate();
    let shared: Vec<LandmarkPrior> = pairs
        .filter_map(|(landmark, (place, own))| {
            own.as_ref()?;
            Some(LandmarkPrior {
                landmark,
                position: (*place)?,
                noise: Noise::Sigmas([size * SHARED; 2]),
            })
        })
        .collect();
    let problem = problem.clone().with_landmark_priors(&shared).ok()?;
    in_frame_of_priors(&problem, piece)
}

/// Two pieces of which odometry and priors fix all but the translation as one, the second shifted to where the landmarks that
/// they share are in the first; `None` where they leave more free.
pub fn shifted_onto(problem: &Problem, maps: [&Map; 2], shared: &[Shared]) -> Option<Map> {
    let turned = maps.map(|map| {
        let fixed = FixedByPriors::of(&map.restrict(problem));
        fixed
            .leaves_translation_only()
            .then(|| aligned_to_priors(problem, map))
    });
    let [first, second] = [turned[0].as_ref()?, turned[1].as_ref()?];
    if shared.is_empty() {
        return None;
    }
    let both = first.landmarks.iter().zip(&second.landmarks);
    let offsets: Vec<_> = both.filter_map(|(a, b)| Some((*a)? - (*b)?)).collect();
    let shift = Translation2::from(centroid(&offsets));
    let shift = Similarity2::from_parts(shift, UnitComplex::identity(), 1.0);
    Some(first.united(&second.transformed(&shift)))
}

/// The first map with what the second has beyond it, moved by the similarity that fits some shared landmarks;
/// `None` when they do not fix one.
pub fn laid_over([first, second]: [&Map; 2], shared: &[Shared]) -> Option<Map> {
    let (source, target): (Vec<_>, Vec<_>) = shared.iter().copied().unzip();
    let moved = second.transformed(&align(&source, &target).ok()?);
    Some(first.united(&moved))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Odometry, PosePrior};
    use crate::simulate::{Arena, Layout, simulate};

    /// Compasses and odometry leave two pieces of a drive a shift, which what they share tells.
    #[test]
    fn pieces_of_known_heading_and_scale_are_shifted() {
        let scene = simulate(Layout::Enclosed, 4, 9, 0.0, 2, Arena::default()).unwrap();
        let truth = scene.map();
        let problem = Problem::dense(4, 9, &scene.bearings, 0.01).unwrap();
        let free = f64::INFINITY;
        let compass = |view: usize| PosePrior {
            view,
            pose: scene.poses[view],
            noise: Noise::Sigmas([free, free, 0.1]),
        };
        let motion = |start: usize| Odometry {
            start,
            end: start + 1,
            delta: scene.poses[start].inv_mul(&scene.poses[start + 1]),
            noise: Noise::Sigmas([0.1; 3]),
        };
        let problem = problem.with_odometry(&[motion(0), motion(2)]).unwrap();
        let part = |views: [usize; 2], by: Similarity2<f64>| {
            let mut part = Map::empty(4, 9);
            for view in views {
                part.poses[view] = truth.poses[view];
            }
            part.landmarks.clone_from(&truth.landmarks);
            part.transformed(&by)
        };
        let first = part(
            [0, 1],
            Similarity2::new(nalgebra::Vector2::new(3.0, 1.0), 0.5, 1.1),
        );
        let second = part(
            [2, 3],
            Similarity2::new(nalgebra::Vector2::new(-8.0, 2.0), -0.7, 0.9),
        );
        let pairs = second.landmarks.iter().zip(&first.landmarks);
        let shared: Vec<Shared> = pairs.filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
        // Without a compass on each they may turn.
        let turning = problem.clone().with_pose_priors(&[compass(0)]).unwrap();
        assert!(shifted_onto(&turning, [&first, &second], &shared).is_none());
        let problem = problem.with_pose_priors(&[compass(0), compass(3)]).unwrap();
        assert!(shifted_onto(&problem, [&first, &second], &[]).is_none());
        let found = shifted_onto(&problem, [&first, &second], &shared).unwrap();
        let shift = found.poses[0].unwrap().translation.vector - scene.poses[0].translation.vector;
        for (pose, truth) in found.poses.iter().zip(&scene.poses) {
            let pose = pose.unwrap();
            assert!(pose.rotation.angle_to(&truth.rotation).abs() < 1e-6);
            assert!((pose.translation.vector - truth.translation.vector - shift).norm() < 1e-6);
        }
        // In the frame of the priors only if these fix all of it, or what a map in it shares does.
        assert!(in_frame_of_priors(&problem, &first).is_none());
        let found = in_frame_of(&problem, &truth, &first).unwrap();
        for (pose, truth) in found.poses.iter().zip(&truth.poses).take(2) {
            let error = truth.unwrap().inv_mul(&pose.unwrap());
            assert!(error.translation.vector.norm() + error.rotation.angle().abs() < 1e-6);
        }
        assert!(in_frame_of(&problem, &Map::empty(4, 9), &first).is_none());
    }
}
