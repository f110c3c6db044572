// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pieces brought into one frame: that of the priors where these fix it, otherwise by the landmarks that they share.

use super::options::HeadingOptions;
use crate::adjustment::aligned_to_priors;
use crate::adjustment::gauge::{FixedByPriors, gauge_and_prior_numbers};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::align;
use crate::geometry::points::{centroid, spread};
use crate::problem::{LandmarkPrior, Map, Noise, Problem};
use alloc::vec::Vec;
use core::f64::consts::TAU;
use nalgebra::{Matrix2, Point2, Similarity2, Translation2, UnitComplex, Vector2};

/// The standard deviation of a shared landmark beside priors, as a part of the size of the map that it is taken from:
/// it only has to weigh less than a survey and more than nothing.
const SHARED: f64 = 0.01;

/// Halvings of the step of the grid of turns: to a tenth of a degree, and from there a refinement goes on.
const BISECTIONS: usize = 6;

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

/// The landmarks that views of both maps see.
pub fn seen_by_both<'a>(
    problem: &'a Problem,
    maps: [&'a Map; 2],
) -> impl Iterator<Item = usize> + 'a {
    (0..problem.landmarks()).filter(move |&landmark| {
        let mut maps = maps.iter();
        maps.all(|map| map.rays(problem, landmark).next().is_some())
    })
}

/// Two pieces of known scale as one, the second turned and shifted so that the rays of both cross at the landmarks that
/// both see; `None` where these are too few to tell how it lies, or priors leave the scale of one free.
///
/// Given the turn, shift and landmarks are linear. Where priors do not tell the headings of both pieces, the turn is
/// searched over a grid, and refined by bisection at the lowest place; one more ray than needed has to confirm it.
pub fn crossed_with(problem: &Problem, maps: [&Map; 2], options: &HeadingOptions) -> Option<Map> {
    let pair = Pair::new(problem, maps)?;
    if pair.ties < if pair.is_turned { 2 } else { 4 } {
        return None;
    }
    let best = if pair.is_turned {
        pair.cross(0.0, options)?
    } else {
        let all = pair.over_grid(options).into_iter().flatten();
        let lowest = all.min_by(|a, b| a.disagreement.total_cmp(&b.disagreement))?;
        pair.bisected(lowest, options)
    };
    Some(pair.joined(best))
}

/// All the ways in which the rays of two pieces of known scale cross, the best first: with as many as needed there may be
/// several, and what the headings of the pieces are known by may leave half a turn open.
pub fn crossings(problem: &Problem, maps: [&Map; 2], options: &HeadingOptions) -> Vec<Map> {
    let Some(pair) = Pair::new(problem, maps) else {
        return Vec::new();
    };
    let grid = if pair.ties < 3 {
        Vec::new()
    } else {
        pair.over_grid(options)
    };
    let value = |k: usize| {
        let one = &grid[k % grid.len()];
        one.as_ref().map_or(f64::INFINITY, |one| one.disagreement)
    };
    let is_lowest = |&k: &usize| {
        let (before, after) = (value(k + grid.len() - 1), value(k + 1));
        value(k) <= before && value(k) < after
    };
    let mut found: Vec<Crossing> = (0..grid.len())
        .filter(is_lowest)
        .filter_map(|k| Some(pair.bisected(grid[k].clone()?, options)))
        .collect();
    if pair.is_turned && pair.ties == 2 {
        found.extend(pair.cross(0.0, options));
    }
    found.sort_by(|a, b| a.disagreement.total_cmp(&b.disagreement));
    found.truncate(options.maps);
    found.into_iter().map(|one| pair.joined(one)).collect()
}

/// Two pieces of known scale, as far as their headings are known turned into the map frame, and the rays of both.
struct Pair {
    pieces: [Map; 2],
    /// Whether both headings are known.
    is_turned: bool,
    is_line: bool,
    /// The landmarks that both see.
    shared: Vec<usize>,
    rays: Vec<[Vec<Ray>; 2]>,
    /// Rays beyond those that place these landmarks.
    ties: usize,
}

impl Pair {
    /// `None` where priors leave the scale of one free.
    fn new(problem: &Problem, maps: [&Map; 2]) -> Option<Self> {
        let fixed = maps.map(|map| FixedByPriors::of(&map.restrict(problem)));
        if !fixed.iter().all(|fixed| fixed.scale) {
            return None;
        }
        let pieces = [0, 1].map(|k| {
            if fixed[k].heading {
                aligned_to_priors(problem, maps[k])
            } else {
                maps[k].clone()
            }
        });
        let shared: Vec<usize> = seen_by_both(problem, maps).collect();
        let rays: Vec<[Vec<Ray>; 2]> = shared
            .iter()
            .map(|&landmark| pieces.each_ref().map(|map| rays_to(problem, map, landmark)))
            .collect();
        let ties = rays
            .iter()
            .map(|[first, second]| first.len().min(2) + second.len().min(2) - 2);
        Some(Self {
            is_turned: fixed.iter().all(|fixed| fixed.heading),
            is_line: !problem.is_oriented(),
            ties: ties.sum(),
            pieces,
            shared,
            rays,
        })
    }

    fn cross(&self, turn: f64, options: &HeadingOptions) -> Option<Crossing> {
        cross(&self.rays, turn, self.is_line, options.half_agreed)
    }

    fn over_grid(&self, options: &HeadingOptions) -> Vec<Option<Crossing>> {
        let step = TAU / options.headings as f64;
        let turns = 0..options.headings;
        turns
            .map(|k| self.cross(step * k as f64, options))
            .collect()
    }

    /// A crossing at a place of the grid, refined by bisection.
    fn bisected(&self, mut best: Crossing, options: &HeadingOptions) -> Crossing {
        let mut step = TAU / options.headings as f64;
        for _ in 0..BISECTIONS {
            step *= 0.5;
            for near in [best.turn - step, best.turn + step] {
                let found = self.cross(near, options);
                let found = found.filter(|found| found.disagreement < best.disagreement);
                best = found.unwrap_or(best);
            }
        }
        best
    }

    fn joined(&self, crossing: Crossing) -> Map {
        let shift = Translation2::from(crossing.shift);
        let by = Similarity2::from_parts(shift, UnitComplex::new(crossing.turn), 1.0);
        let [first, second] = &self.pieces;
        let mut map = first.united(&second.transformed(&by));
        for (&landmark, point) in self.shared.iter().zip(crossing.points) {
            map.landmarks[landmark] = Some(point);
        }
        map
    }
}

/// A ray from a place in a direction.
type Ray = [Vector2<f64>; 2];

fn rays_to(problem: &Problem, map: &Map, landmark: usize) -> Vec<Ray> {
    let rays = map.rays(problem, landmark).map(|(pose, s)| {
        let ray = pose.rotation * s.bearing;
        [pose.translation.vector, Vector2::new(ray.re, ray.im)]
    });
    rays.collect()
}

/// How a piece lies to another, where the rays of both cross, and how much these disagree, each between 0 and 1.
#[derive(Clone)]
struct Crossing {
    turn: f64,
    shift: Vector2<f64>,
    points: Vec<Point2<f64>>,
    disagreement: f64,
}

/// The shift of the second of two pieces, turned first, with which the rays of both to each landmark meet best.
fn cross(rays: &[[Vec<Ray>; 2]], turn: f64, is_line: bool, half_agreed: f64) -> Option<Crossing> {
    let rotation = UnitComplex::new(turn);
    let turned = |ray: &Ray| ray.map(|part| rotation * part);
    // The distance of a landmark x from the line of a ray from p with the normal n is n . (x - p).
    let lines = |(normal, right): (Matrix2<f64>, Vector2<f64>), [place, ray]: Ray| {
        let across = Vector2::new(-ray.y, ray.x);
        (
            normal + across * across.transpose(),
            right + across * across.dot(&place),
        )
    };
    let none = (Matrix2::zeros(), Vector2::zeros());
    // Each landmark, a function of the shift, is eliminated.
    let (mut normal, mut right) = none;
    let mut reduced = Vec::with_capacity(rays.len());
    for [first, second] in rays {
        let (a, p) = first.iter().copied().fold(none, lines);
        let (b, q) = second.iter().map(turned).fold(none, lines);
        let inverse = (a + b).try_inverse()?;
        normal += b - b * inverse * b;
        right += b * inverse * (p + q) - q;
        reduced.push((inverse * (p + q), inverse * b));
    }
    let shift = normal.try_inverse()? * right;
    let place = |(place, per_shift): (Vector2<f64>, Matrix2<f64>)| place + per_shift * shift;
    let points: Vec<_> = reduced.into_iter().map(place).map(Point2::from).collect();
    let mut disagreement = 0.0;
    for ([first, second], point) in rays.iter().zip(&points) {
        let shifted = |ray: &Ray| {
            let [place, ray] = turned(ray);
            [place + shift, ray]
        };
        for [place, ray] in first.iter().copied().chain(second.iter().map(shifted)) {
            let offset = point.coords - place;
            let across = ray.perp(&offset);
            let is_ahead = is_line || ray.dot(&offset) > 0.0;
            let half = half_agreed * half_agreed * offset.norm_squared();
            disagreement += if is_ahead {
                across * across / (across * across + half)
            } else {
                1.0
            };
        }
    }
    disagreement.is_finite().then_some(Crossing {
        turn,
        shift,
        points,
        disagreement,
    })
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
        let options = HeadingOptions::default();
        let problem = problem.with_pose_priors(&[compass(0), compass(3)]).unwrap();
        let found = crossed_with(&problem, [&first, &second], &options).unwrap();
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

    /// Odometry gives two pieces their scale; how one lies to the other, landmarks tell that need not be placed in either.
    #[test]
    fn pieces_of_known_scale_are_turned_until_their_rays_cross() {
        let options = HeadingOptions::default();
        for (seed, seen, is_enough) in [(2, 4, true), (3, 4, true), (3, 2, true), (3, 1, false)] {
            let scene = simulate(Layout::Enclosed, 6, 4, 0.0, seed, Arena::default()).unwrap();
            let problem = Problem::dense(6, 4, &scene.bearings, 0.01).unwrap();
            let motion = |start: usize| Odometry {
                start,
                end: start + 1,
                delta: scene.poses[start].inv_mul(&scene.poses[start + 1]),
                noise: Noise::Sigmas([0.1; 3]),
            };
            let odometry = [0, 1, 3, 4].map(motion);
            let seen: Vec<bool> = (0..4).map(|landmark| landmark < seen).collect();
            let problem = problem.restrict(&[true; 6], &seen);
            let problem = problem.with_odometry(&odometry).unwrap();
            let part = |views: core::ops::Range<usize>, turn: f64| {
                let mut part = Map::empty(6, problem.landmarks());
                for view in views {
                    part.poses[view] = Some(scene.poses[view]);
                }
                part.transformed(&Similarity2::new(Vector2::new(3.0, 1.0), turn, 1.0))
            };
            let found = crossed_with(&problem, [&part(0..3, 0.3), &part(3..6, -1.1)], &options);
            assert_eq!(found.is_some(), is_enough, "{seed}");
            // All ways to cross the rays contain the right one.
            let all = crossings(&problem, [&part(0..3, 0.3), &part(3..6, -1.1)], &options);
            assert_eq!(all.is_empty(), !is_enough, "{seed}");
            let is_right = |map: &Map| {
                let home = map.poses[0].unwrap() * scene.poses[0].inverse();
                let error = (home * scene.poses[5]).inv_mul(&map.poses[5].unwrap());
                error.translation.vector.norm() + error.rotation.angle().abs() < 0.1
            };
            assert!(!is_enough || all.iter().any(is_right), "{seed}");
            let Some(found) = found else { continue };
            let home = found.poses[0].unwrap() * scene.poses[0].inverse();
            for (pose, truth) in found.poses.iter().zip(&scene.poses) {
                let error = (home * truth).inv_mul(&pose.unwrap());
                // As far as the bisection goes.
                assert!(error.rotation.angle().abs() < 2e-3, "{seed}");
                assert!(error.translation.vector.norm() < 0.1, "{seed}");
            }
        }
    }
}
