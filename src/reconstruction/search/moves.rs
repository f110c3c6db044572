// SPDX-License-Identifier: MIT OR Apache-2.0
//! Changes of a minimum that may lead to a lower one: one landmark in another place, or one view on a landmark.
//!
//! With the views held fixed, the cost of one landmark may have several minima: at a view, at infinity, and in between;
//! with the landmarks held fixed, that of a view at each landmark that it sees. Two minima of the whole often differ in
//! one such position and little else, and no hypothesis that is linear in the landmarks distinguishes them.

use super::super::sight::filled;
use super::options::MoveOptions;
use crate::geometry::Pose;
use crate::kernels::triangulate;
use crate::problem::{IndexedSighting, Map, ON_VIEW, Problem};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{Complex, Point2, UnitComplex, Vector2};

/// A change, and by how much it raises the cost of what it moves, all else held fixed and without the sighting that
/// something moves onto.
struct Move {
    excess: f64,
    to: Place,
}

/// Where a landmark or a view starts.
enum Place {
    Landmark(usize, Point2<f64>),
    View(usize, Pose<f64>),
}

/// Maps that differ from a minimum in one landmark or, where views see only a part of the landmarks, in one view, in
/// turns: at most so many of landmarks and of views, the most promising first.
///
/// `variance` is that of the residuals over sigma.
pub fn moved_maps(
    problem: &Problem,
    map: &Map,
    variance: f64,
    [landmarks, views]: [usize; 2],
    options: &MoveOptions,
) -> Vec<Map> {
    let partial = filled(problem) < options.partial;
    let mut kinds = if partial {
        let slack = options.partial_worth * variance;
        let mut kinds = vec![moves_of_landmarks(problem, map, slack, true, options)];
        if views > 0 {
            kinds.push(moves_of_views(problem, map, slack, options));
        }
        kinds
    } else {
        let slack = options.worth * variance;
        vec![moves_of_landmarks(problem, map, slack, false, options)]
    };
    for (moves, tried) in kinds.iter_mut().zip([landmarks, views]) {
        moves.sort_by(|a, b| a.excess.total_cmp(&b.excess));
        moves.truncate(tried);
    }
    let in_turns =
        (0..landmarks.max(views)).flat_map(|k| kinds.iter().filter_map(move |moves| moves.get(k)));
    let changed = in_turns.map(|one| {
        let mut map = map.clone();
        match one.to {
            Place::Landmark(landmark, point) => map.landmarks[landmark] = Some(point),
            Place::View(view, pose) => map.poses[view] = Some(pose),
        }
        map
    });
    changed.collect()
}

/// The map with the landmarks that are on a view put off it along their rays; `None` where there are none.
///
/// On its view a landmark may be at a saddle: no short step lowers the cost, and a longer one does.
pub fn off_views(problem: &Problem, map: &Map, options: &MoveOptions) -> Option<Map> {
    let size = map.size();
    let mut off = None;
    for s in problem.sightings() {
        let (Some(pose), Some(point)) = (map.poses[s.view], map.landmarks[s.landmark]) else {
            continue;
        };
        let view = pose.translation.vector;
        if (point.coords - view).norm() < ON_VIEW * size {
            let place = view + ray(&pose.rotation, s) * (options.off * size);
            off.get_or_insert_with(|| map.clone()).landmarks[s.landmark] = Some(place.into());
        }
    }
    off
}

/// Landmarks on the views that see them, far out, and where their rays meet best, if `released` also without that of the
/// nearest view.
fn moves_of_landmarks(
    problem: &Problem,
    map: &Map,
    slack: f64,
    released: bool,
    options: &MoveOptions,
) -> Vec<Move> {
    let MoveOptions { off, away, .. } = *options;
    let mut moves = Vec::new();
    let mut gathered = Vec::new();
    for (landmark, point) in map.landmarks.iter().enumerate() {
        let Some(point) = point else { continue };
        gathered.clear();
        gathered.extend(map.rays(problem, landmark));
        let rays = gathered.iter().copied();
        let cost = |place: &Point2<f64>, but: Option<usize>, bound: f64| {
            let rays = rays.clone().filter(|(_, s)| Some(s.view) != but);
            let residuals = rays.map(|(pose, s)| problem.residual(&pose, place, s) * s.weight);
            half_squares(residuals, bound)
        };
        let Some(now) = cost(point, None, f64::INFINITY) else {
            continue;
        };
        let mut add = |place: Point2<f64>, but: Option<usize>, begin: Point2<f64>| {
            if let Some(there) = cost(&place, but, now + slack)
                && (begin - point).norm() > off
            {
                moves.push(Move {
                    excess: there - now,
                    to: Place::Landmark(landmark, begin),
                });
            }
        };
        let mut direction = Vector2::zeros();
        let mut nearest = (f64::INFINITY, None);
        for (pose, s) in rays.clone() {
            let ray = ray(&pose.rotation, s);
            let view = Point2::from(pose.translation.vector);
            direction += ray;
            add(view, Some(s.view), view + ray * off);
            let range = (point - view).norm_squared();
            if range < nearest.0 {
                nearest = (range, Some(s.view));
            }
        }
        let far = Point2::from(direction * (away / direction.norm()));
        add(Point2::from(far.coords * away), None, far);
        let released = released.then_some(nearest.1);
        for but in core::iter::once(None).chain(released) {
            let rays = rays.clone().filter(|(_, s)| Some(s.view) != but);
            if let Ok(found) = triangulate(rays.map(|(pose, s)| (pose, s.bearing))) {
                add(found.point, but, found.point);
            }
        }
    }
    moves
}

/// Views on the landmarks that they see, with the heading that the others give them on average.
fn moves_of_views(problem: &Problem, map: &Map, slack: f64, options: &MoveOptions) -> Vec<Move> {
    let oriented = problem.is_oriented();
    let mut moves = Vec::new();
    for (view, pose) in map.poses.iter().enumerate() {
        let Some(pose) = pose else { continue };
        let seen = map.seen(problem, view);
        let cost = |pose: &Pose<f64>, but: Option<usize>, bound: f64| {
            let seen = seen.clone().filter(|(_, s)| Some(s.landmark) != but);
            let residuals = seen.map(|(point, s)| problem.residual(pose, &point, s) * s.weight);
            half_squares(residuals, bound)
        };
        let Some(now) = cost(pose, None, f64::INFINITY) else {
            continue;
        };
        for (place, on) in seen.clone() {
            let mut heading = Complex::new(0.0, 0.0);
            for (point, s) in seen.clone().filter(|(_, s)| s.landmark != on.landmark) {
                let toward = (point - place).normalize();
                let turn = Complex::new(toward.x, toward.y) * s.bearing.into_inner().conj();
                // Modulo pi the mean is that of the doubled angles.
                heading += if oriented { turn } else { turn * turn };
            }
            let mean = UnitComplex::new_normalize(heading);
            // None where its landmarks are in one place.
            if !mean.re.is_finite() {
                continue;
            }
            let rotation = if oriented {
                mean
            } else {
                UnitComplex::new(mean.angle() * 0.5)
            };
            let begin = place - ray(&rotation, on) * options.off;
            let there = Pose::from_parts(begin.into(), rotation);
            if (begin.coords - pose.translation.vector).norm() > options.off
                && let Some(cost) = cost(&there, Some(on.landmark), now + slack)
            {
                moves.push(Move {
                    excess: cost - now,
                    to: Place::View(view, there),
                });
            }
        }
    }
    moves
}

/// Direction of a measured bearing in the map.
pub fn ray(rotation: &UnitComplex<f64>, sighting: &IndexedSighting) -> Vector2<f64> {
    let ray = rotation.into_inner() * sighting.bearing.into_inner();
    Vector2::new(ray.re, ray.im)
}

/// Half the sum of the squares; `None` as soon as it exceeds the bound.
fn half_squares(residuals: impl Iterator<Item = f64>, bound: f64) -> Option<f64> {
    let mut sum = 0.0;
    for residual in residuals {
        sum += residual * residual * 0.5;
        if sum > bound {
            return None;
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// A view that stands on a landmark is put back there from another place, with its heading, also modulo pi.
    #[test]
    fn a_view_is_put_on_its_landmark() {
        let arena = Arena::default();
        let scene = simulate(Layout::Mixed, 5, 9, 0.0, 2, arena).unwrap();
        let mut truth = scene.map();
        let pose = scene.poses[3];
        let step = Vector2::new(1e-9, 2e-9);
        truth.landmarks[4] = Some(Point2::from(pose.translation.vector + step));
        let mut bearings = scene.bearings;
        for (view, pose) in scene.poses.iter().enumerate() {
            let bearing = crate::geometry::bearing_to(pose, &truth.landmarks[4].unwrap());
            bearings[view * 9 + 4] = bearing.unwrap().angle();
        }
        let problem = Problem::dense(5, 9, &bearings, 0.01).unwrap();
        for problem in [problem.clone(), problem.unoriented()] {
            let mut map = truth.clone();
            let moved = pose * crate::geometry::pose(0.4, -0.3, 0.2);
            map.poses[3] = Some(moved);
            // As if the table had gaps.
            let options = MoveOptions {
                partial: 2.0,
                ..MoveOptions::default()
            };
            let maps = moved_maps(&problem, &map, 1.0, [1, 1], &options);
            let views = maps.iter().filter_map(|map| map.poses[3]);
            let found: Vec<Pose<f64>> = views.filter(|pose| *pose != moved).collect();
            assert_eq!(found.len(), 1);
            let turn = (found[0].rotation * pose.rotation.inverse()).angle();
            let turn = if problem.is_oriented() {
                turn
            } else {
                (2.0 * turn).sin()
            };
            let away = found[0].translation.vector - pose.translation.vector;
            assert!(turn.abs() < 1e-6, "{turn:e}");
            assert!((away.norm() - options.off).abs() < 1e-6, "{away}");
        }
    }

    /// Six views and nine landmarks with exact bearings; the fourth landmark is at `place`, if anywhere else than in the
    /// scene.
    fn exact(place: Option<Point2<f64>>) -> (Problem, Map) {
        let scene = simulate(Layout::Enclosed, 6, 9, 0.0, 2, Arena::default()).unwrap();
        let mut truth = scene.map();
        let place = place.unwrap_or(scene.landmarks[3]);
        truth.landmarks[3] = Some(place);
        let mut bearings = scene.bearings;
        for (view, pose) in scene.poses.iter().enumerate() {
            bearings[view * 9 + 3] = crate::geometry::bearing_to(pose, &place).unwrap().angle();
        }
        let problem = Problem::dense(6, 9, &bearings, 0.01).unwrap();
        (problem, truth)
    }

    /// The landmark that stands in the wrong place goes first to where its rays meet, onto a view that it is on, or out.
    #[test]
    fn a_landmark_is_put_where_its_bearings_are_from() {
        let (_, scene) = exact(None);
        let pose = scene.poses[2].unwrap();
        let on_view = Point2::from(pose.translation.vector + Vector2::new(1e-9, 2e-9));
        let far = Point2::new(1e7, 2e7);
        for (place, name) in [
            (None, "meeting"),
            (Some(on_view), "view"),
            (Some(far), "far"),
        ] {
            let (problem, mut map) = exact(place);
            let truth = map.landmarks[3].unwrap();
            map.landmarks[3] = Some(Point2::new(3.0, 2.5));
            let moved = moved_maps(&problem, &map, 1.0, [4, 4], &MoveOptions::default());
            let view = Point2::from(pose.translation.vector);
            let begin = match name {
                "meeting" => truth,
                // Along the bearing that is measured there.
                "view" => view + (truth - view).normalize() * MoveOptions::default().off,
                _ => Point2::from(truth.coords.normalize() * MoveOptions::default().away),
            };
            let places = moved.iter().map(|map| map.landmarks[3].unwrap());
            let off: Vec<f64> = places.map(|place| (place - begin).norm()).collect();
            assert!(off.iter().any(|off| *off < 0.02), "{name}: {off:?}");
            // Far out it is also where its rays meet.
            assert!(name == "far" || off[0] < 1e-6, "{name}: {off:?}");
            for map in &moved {
                let others = map.landmarks.iter().zip(&scene.landmarks).enumerate();
                assert!(others.into_iter().all(|(k, (a, b))| k == 3 || a == b));
                assert_eq!(map.poses, scene.poses);
            }
        }
    }

    /// At a minimum that all bearings fit nothing is worth a try, nor is a place closer than where it would begin.
    #[test]
    fn nothing_is_moved_that_costs_more_than_it_is_worth() {
        let (problem, truth) = exact(None);
        assert!(moved_maps(&problem, &truth, 1e-9, [20, 20], &MoveOptions::default()).is_empty());
        // In units of what the standard deviations predict, some places are.
        let slack = |worth: f64| {
            let options = MoveOptions {
                worth,
                ..MoveOptions::default()
            };
            moved_maps(&problem, &truth, 1.0, [100, 0], &options).len()
        };
        let counts = [1.0, 1e3, 1e6].map(slack);
        assert!(counts.is_sorted() && counts[0] < counts[2], "{counts:?}");
        let mut near = truth.clone();
        near.landmarks[3].as_mut().unwrap().x += 0.019;
        let tried = |off: f64| {
            let options = MoveOptions {
                off,
                ..MoveOptions::default()
            };
            moved_maps(&problem, &near, 1e-9, [20, 20], &options).len()
        };
        assert_eq!([tried(0.018), tried(0.02)], [1, 0]);
    }

    /// What is on a view is put off it along its ray, at a distance in sizes of the map; what is near one stays.
    #[test]
    fn landmarks_are_put_off_their_views() {
        let options = MoveOptions::default();
        let place = |x: f64, y: f64| Some(Point2::new(x, y));
        let map = |on: f64, near: f64| Map {
            poses: [(0.0, 0.0, 0.5), (4.0, 0.0, 1.0), (0.0, 4.0, 2.0)]
                .map(|(x, y, heading)| Some(crate::geometry::pose(x, y, heading)))
                .to_vec(),
            landmarks: vec![place(4.0, on), place(near, 4.0), None, place(2.0, 3.0)],
        };
        let problem = Problem::dense(3, 4, &[0.2; 12], 0.1).unwrap();
        assert_eq!(off_views(&problem, &map(1e-5, 1e-5), &options), None);
        let on = map(1e-8, 1e-5);
        let off = off_views(&problem, &on, &options).unwrap();
        assert_eq!(
            (&off.poses, &off.landmarks[1..]),
            (&on.poses, &on.landmarks[1..])
        );
        let ray = off.landmarks[0].unwrap().coords - Vector2::new(4.0, 0.0);
        assert!((ray.norm() - 4.0 * options.off).abs() < 1e-12);
        assert!((ray.y.atan2(ray.x) - 1.2).abs() < 1e-9);
    }

    /// Where tables have gaps a landmark may leave its nearest view, and landmarks and views are tried in turns.
    #[test]
    fn gaps_release_landmarks_and_move_views() {
        let (problem, mut map) = exact(None);
        let truth = map.landmarks[3].unwrap();
        // Right next to the first view, whose bearing is wrong.
        let beside = map.poses[0].unwrap().translation.vector + Vector2::new(0.05, 0.0);
        map.landmarks[3] = Some(Point2::from(beside));
        let mut bearings: Vec<f64> = alloc::vec![f64::NAN; 54];
        for (s, &place) in problem.sightings().iter().zip(problem.input_order()) {
            bearings[place] = s.bearing.angle() + if place == 3 { 0.5 } else { 0.0 };
        }
        let problem = Problem::dense(6, 9, &bearings, 0.01).unwrap();
        let released = |partial: f64| {
            let options = MoveOptions {
                partial,
                ..MoveOptions::default()
            };
            let maps = moved_maps(&problem, &map, 100.0, [9, 9], &options);
            let places = maps.iter().filter_map(|map| map.landmarks[3]);
            let back = places.filter(|place| (place - truth).norm() < 1e-6);
            (
                back.count(),
                maps.iter().filter(|other| other.poses != map.poses).count(),
            )
        };
        assert_eq!(released(0.75), (0, 0));
        let (back, views) = released(1.1);
        assert!(back == 1 && views > 0, "{back} {views}");
        let options = MoveOptions {
            partial: 1.1,
            ..MoveOptions::default()
        };
        let kinds = |tried: [usize; 2]| -> Vec<bool> {
            let maps = moved_maps(&problem, &map, 1e4, tried, &options);
            maps.iter().map(|other| other.poses != map.poses).collect()
        };
        assert_eq!(kinds([3, 1]), [false, true, false, false]);
        assert_eq!(kinds([1, 3]), [false, true, true, true]);
        assert_eq!(kinds([2, 0]), [false, false]);
    }

    #[test]
    fn half_squares_end_at_their_bound() {
        let squares = |bound| half_squares([1.0, -2.0].into_iter(), bound);
        assert_eq!(squares(f64::INFINITY), Some(2.5));
        assert_eq!(squares(2.5), Some(2.5));
        assert_eq!(squares(2.4), None);
    }
}
