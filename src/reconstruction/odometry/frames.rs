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
