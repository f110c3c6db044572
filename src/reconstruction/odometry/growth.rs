// SPDX-License-Identifier: MIT OR Apache-2.0
//! First maps from all that is known: pieces that grow view by view, and are brought into one frame.
//!
//! What priors know is a piece in the map frame; views that odometry ties together make a piece in a frame of its own.
//! A piece grows along its odometry, its landmarks are placed by what has been reached so far, and it is refined now
//! and then, so that it never drifts far. Pieces whose frame priors fix are moved into the map frame, the others laid
//! over each other by the landmarks that they share or see. How a view, a landmark and the joint are estimated is up to a
//! [`Placement`]: by least squares, or robustly where bearings may be wrong.

use super::super::attempt::attempt;
use super::super::grow::score;
use super::super::options::{Progress, report_progress};
use super::super::robust::motions::{Motions, OdometryLink};
use super::super::stages::StageOptions;
use super::choices::Choices;
use super::compass::map_from_headings;
use super::frames::{
    Shared, crossed_with, crossings, in_frame_of, in_frame_of_priors, seen_by_both,
};
use super::headings::maps_from_positions;
use super::known::Known;
use crate::error::Error;
use crate::geometry::Pose;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem};
use alloc::collections::VecDeque;
use alloc::vec::Vec;

/// By how much the score of a joint may exceed the best before it is no other choice: two sightings that it explains badly.
const AS_GOOD: f64 = 2.0;

/// Pieces of which any may be the next to be joined.
const NEAR_PIECES: usize = 3;

/// A piece: a map, and whether it is in the frame of the priors.
pub struct Piece {
    pub map: Map,
    pub framed: bool,
}

/// How the parts of a growing piece are estimated.
pub trait Placement {
    /// Options of the refinements on the way.
    fn refine_options(&self) -> RefineOptions;

    /// At how many views a piece of `count` views is refined the next time.
    fn next_refinement(&self, count: usize) -> usize;

    /// The pose at the end of a motion, given that at its start.
    fn place_view(&mut self, map: &Map, from: &Pose<f64>, motion: &OdometryLink) -> Pose<f64>;

    /// Places new landmarks that a view sees, unless they wait for the next refinement.
    fn place_landmarks_of(&mut self, _map: &mut Map, _view: usize) {}

    /// Places all landmarks anew but those that stay; one whose rays do not determine it has to wait.
    fn place_landmarks(&mut self, map: &mut Map, stays: &dyn Fn(usize) -> bool);

    /// Whether a view that no odometry reaches is placed by the landmarks of the piece before all pieces are joined.
    fn resects(&self) -> bool {
        false
    }

    /// Places the landmarks of a piece after its last refinement.
    fn finish_piece(&mut self, _map: &mut Map, _stays: &dyn Fn(usize) -> bool) {}

    /// Two pieces as one, given the landmarks that they share, in the second and in the first; `None` when
    /// these do not fix how they lie.
    fn join(&mut self, maps: [&Map; 2], shared: &[Shared]) -> Option<Map>;

    /// Whether the whole is refined each time a piece has been joined.
    fn refines_joined(&self) -> bool {
        false
    }

    /// Adds to a map of joined pieces what its landmarks place.
    ///
    /// # Errors
    /// [`Error::Interrupted`] and [`Error::OutOfMemory`] of the refinement.
    fn complete(&mut self, map: &mut Map) -> Result<(), Error>;
}

/// Maps from all that is known, and from seeds in the frame of the priors, with some choices where several places are
/// about as good; that in the frame of the priors first, then the one with most views; those after the first share too
/// little with it. None where nothing is known besides bearings.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so, [`Error::OutOfMemory`] of the refinement.
pub fn grow_from_priors(
    problem: &Problem,
    placement: &mut impl Placement,
    seeds: &[Map],
    stages: &StageOptions,
    choices: &mut Choices,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    let mut growth = Growth {
        problem,
        odometry_only: problem.clone().with_odometry_only(),
        motions: Motions::new(problem),
        known: Known::of(problem),
        placement,
        stages,
        choices,
        progress,
    };
    let mut world = Piece {
        map: growth.known.map(),
        framed: true,
    };
    growth.extend(&mut world)?;
    growth.add_seeds(&mut world, seeds)?;
    let mut pieces = growth.pieces(&mut world)?;
    // What is in the frame of the priors stays first, so that the others are moved into it.
    pieces.sort_by_key(|piece| core::cmp::Reverse(size(&piece.map)));
    if world.map.determined().next().is_some() {
        pieces.insert(0, world);
    }
    growth.join_all(pieces)
}

/// A growth under way.
struct Growth<'a, 'p, P> {
    problem: &'a Problem,
    /// The same without priors, for pieces in frames of their own.
    odometry_only: Problem,
    motions: Motions,
    known: Known,
    placement: &'a mut P,
    stages: &'a StageOptions,
    choices: &'a mut Choices,
    progress: &'a mut Option<Progress<'p>>,
}

impl<P: Placement> Growth<'_, '_, P> {
    /// The pieces that are not in the frame of the priors; what is goes into the first one.
    fn pieces(&mut self, world: &mut Piece) -> Result<Vec<Piece>, Error> {
        let mut pieces: Vec<Piece> = Vec::new();
        // From the view that sees most; of equals the first.
        let mut order: Vec<usize> = (0..self.problem.views()).collect();
        order.sort_by_key(|&view| core::cmp::Reverse(self.problem.of_view(view).len()));
        for root in order {
            let reached = |map: &Map| map.poses[root].is_some();
            if self.motions.of(root).is_empty()
                || reached(&world.map)
                || pieces.iter().any(|piece| reached(&piece.map))
            {
                continue;
            }
            let mut map = Map::empty(self.problem.views(), self.problem.landmarks());
            map.poses[root] = Some(Pose::identity());
            let mut piece = Piece { map, framed: false };
            self.extend(&mut piece)?;
            if !self.bring_in(world, &piece)? {
                pieces.push(piece);
            }
        }
        let missing = |view: &usize| {
            world.map.poses[*view].is_none()
                && pieces.iter().all(|piece| piece.map.poses[*view].is_none())
        };
        let views: Vec<usize> = (0..self.problem.views()).filter(missing).collect();
        let mut headings = self.known.headings.clone();
        for (view, heading) in headings.iter_mut().enumerate() {
            *heading = heading.filter(|_| views.contains(&view));
        }
        if headings.iter().flatten().nth(1).is_some()
            && let Some(map) = map_from_headings(self.problem, headings, &self.stages.positions)
        {
            let piece = Piece { map, framed: false };
            if !self.bring_in(world, &piece)? {
                pieces.push(piece);
            }
        }
        Ok(pieces)
    }

    /// Adds a piece to the one in the frame of the priors where these fix its frame, and goes on from there; whether they do.
    fn bring_in(&mut self, world: &mut Piece, piece: &Piece) -> Result<bool, Error> {
        let Some(framed) = in_frame_of_priors(self.problem, &piece.map) else {
            return Ok(false);
        };
        world.map = world.map.united(&framed);
        self.extend(world)?;
        Ok(true)
    }

    /// Adds views of known position by the best of some seeds, and by the best of new ones as long as these reach more:
    /// a group of views that shares nothing with those of a seed needs a seed of its own.
    fn add_seeds(&mut self, world: &mut Piece, seeds: &[Map]) -> Result<(), Error> {
        let mut added = self.add_best_seed(world, seeds)?;
        while added {
            let options = &self.stages.headings;
            let (known, motions) = (&self.known, &self.motions);
            let seeds = maps_from_positions(self.problem, known, motions, &world.map, options);
            added = self.add_best_seed(world, &seeds)?;
        }
        Ok(())
    }

    /// Adds views of known position whose headings were searched, unless something else has placed them; whether it has
    /// added any.
    fn add_best_seed(&mut self, world: &mut Piece, seeds: &[Map]) -> Result<bool, Error> {
        let mut best: Option<(f64, Piece)> = None;
        for map in seeds {
            let reached =
                |(seed, known): (&Option<_>, &Option<_>)| seed.is_none() || known.is_some();
            if map.poses.iter().zip(&world.map.poses).all(reached) {
                continue;
            }
            let mut piece = Piece {
                map: world.map.united(map),
                framed: true,
            };
            self.extend(&mut piece)?;
            let score = score(self.problem, &piece.map);
            if best.as_ref().is_none_or(|(least, _)| score < *least) {
                best = Some((score, piece));
            }
        }
        let added = best.is_some();
        if let Some((_, piece)) = best {
            *world = piece;
        }
        Ok(added)
    }

    /// Grows a piece from the views that it has, along its odometry, and by its landmarks where odometry ends.
    fn extend(&mut self, piece: &mut Piece) -> Result<(), Error> {
        let mut waiting: VecDeque<usize> = (0..piece.map.poses.len())
            .filter(|&view| piece.map.poses[view].is_some())
            .collect();
        let mut count = waiting.len();
        let mut next = self.stages.odometry_growth.first_views.max(count);
        if count > 0 {
            self.place_landmarks(piece);
        }
        loop {
            while let Some(view) = waiting.pop_front() {
                let map = &mut piece.map;
                let Some(from) = map.poses[view] else {
                    continue;
                };
                for motion in self.motions.of(view) {
                    if map.poses[motion.end].is_none() {
                        map.poses[motion.end] = Some(self.placement.place_view(map, &from, motion));
                        self.placement.place_landmarks_of(map, motion.end);
                        waiting.push_back(motion.end);
                        count += 1;
                    }
                }
                if count >= next {
                    next = self.placement.next_refinement(count);
                    self.refine_partial(piece)?;
                }
            }
            let Some((view, pose)) = self.next_apart(piece) else {
                break;
            };
            piece.map.poses[view] = Some(pose);
            waiting.push_back(view);
            count += 1;
            if piece.framed {
                self.place_landmarks(piece);
            }
        }
        if count > 0 {
            self.refine_partial(piece)?;
            let (known, framed) = (&self.known.landmarks, piece.framed);
            let stays = |landmark: usize| framed && known[landmark].is_some();
            self.placement.finish_piece(&mut piece.map, &stays);
        }
        Ok(())
    }

    fn place_landmarks(&mut self, piece: &mut Piece) {
        let (known, framed) = (&self.known.landmarks, piece.framed);
        let stays = |landmark: usize| framed && known[landmark].is_some();
        self.placement.place_landmarks(&mut piece.map, &stays);
    }

    /// The view without a pose that most is known of, with its pose by that and by the landmarks of the piece.
    fn next_apart(&mut self, piece: &Piece) -> Option<(usize, Pose<f64>)> {
        if !piece.framed && !self.placement.resects() {
            return None;
        }
        let (known, motions) = (&self.known, &self.motions);
        known.locate_next(
            self.problem,
            &piece.map,
            motions,
            piece.framed,
            self.choices,
        )
    }

    /// Places all landmarks anew and refines a little. What cannot be refined yet stays where it is.
    fn refine_partial(&mut self, piece: &mut Piece) -> Result<(), Error> {
        self.place_landmarks(piece);
        let options = self.placement.refine_options();
        let options = RefineOptions {
            max_iterations: options
                .max_iterations
                .min(self.stages.odometry_growth.iterations),
            ..options
        };
        let problem = if piece.framed {
            self.problem
        } else {
            &self.odometry_only
        };
        let map = &mut piece.map;
        let (done, all) = (size(map), problem.views());
        let mut trial = map.clone();
        let mut observer = |_, _| report_progress(self.progress, "odometry", done, all);
        if attempt(problem, &mut trial, &options, Some(&mut observer))?.is_some() {
            // What was pruned may be reached later.
            for (place, refined) in map.poses.iter_mut().zip(trial.poses) {
                *place = refined.or(*place);
            }
            for (place, refined) in map.landmarks.iter_mut().zip(trial.landmarks) {
                *place = refined.or(*place);
            }
        }
        Ok(())
    }

    /// Joins pieces to the first, the one with most shared landmarks next; what cannot be joined makes maps of
    /// its own.
    fn join_all(&mut self, mut pieces: Vec<Piece>) -> Result<Vec<Map>, Error> {
        let mut done: Vec<Piece> = Vec::new();
        while !pieces.is_empty() {
            // What is in the frame of the priors is first in any case.
            let any = if pieces[0].framed { 1 } else { pieces.len() };
            let mut main = pieces.remove(self.choices.among(any));
            let mut refused = Vec::new();
            loop {
                let mut near = closest(self.problem, &main.map, &pieces);
                if near.is_empty() {
                    break;
                }
                let (k, shared) =
                    near.swap_remove(self.choices.among_first(near.len(), NEAR_PIECES));
                let other = pieces.remove(k);
                if let Some(joined) = self.joined(&main, &other, &shared) {
                    main.map = joined;
                    if self.placement.refines_joined() {
                        self.refine_partial(&mut main)?;
                    }
                    // They may fit what has become of it.
                    pieces.append(&mut refused);
                } else {
                    refused.push(other);
                }
            }
            pieces.append(&mut refused);
            pieces.sort_by_key(|piece| core::cmp::Reverse(size(&piece.map)));
            if !main.framed
                && let Some(framed) = in_frame_of_priors(self.problem, &main.map)
            {
                main = Piece {
                    map: framed,
                    framed: true,
                };
            }
            done.push(main);
        }
        // Some are in the frame of the priors only since they were joined.
        let (framed, apart): (Vec<_>, Vec<_>) = done.into_iter().partition(|piece| piece.framed);
        let world = framed.into_iter().reduce(|world, piece| Piece {
            map: world.map.united(&piece.map),
            framed: true,
        });
        let mut maps = Vec::new();
        for mut piece in world.into_iter().chain(apart) {
            if piece.framed {
                self.extend(&mut piece)?;
            }
            self.placement.complete(&mut piece.map)?;
            maps.push(piece.map);
        }
        maps.retain(|map| map.poses.iter().any(Option::is_some));
        maps.sort_by_key(|map| core::cmp::Reverse(size(map)));
        Ok(maps)
    }

    /// Two pieces as one: by priors and shared landmarks together where these bring the second into the frame of the
    /// priors, by the rays of both where their scale is known, or by shared landmarks alone, whichever explains more;
    /// `None` when none of this fixes how they lie.
    fn joined(&mut self, first: &Piece, second: &Piece, shared: &[Shared]) -> Option<Map> {
        let framed = first
            .framed
            .then(|| in_frame_of(self.problem, &first.map, &second.map))
            .flatten()
            .map(|framed| first.map.united(&framed));
        let laid = (shared.len() >= self.stages.odometry_growth.min_shared)
            .then(|| self.placement.join([&first.map, &second.map], shared))
            .flatten();
        let maps = [&first.map, &second.map];
        let options = &self.stages.headings;
        let crossed = if framed.is_some() {
            Vec::new()
        } else if self.choices.vary() {
            crossings(self.problem, maps, options)
        } else {
            Vec::from_iter(crossed_with(self.problem, maps, options))
        };
        let all = framed.into_iter().chain(crossed).chain(laid);
        let mut all: Vec<(f64, Map)> = all.map(|map| (score(self.problem, &map), map)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let least = all.first()?.0;
        all.retain(|(score, _)| *score <= least + AS_GOOD);
        let chosen = self.choices.among(all.len());
        Some(all.swap_remove(chosen).1)
    }
}

/// Number of views in a map.
fn size(map: &Map) -> usize {
    map.poses.iter().flatten().count()
}

/// The pieces that see what a map sees as well, and the landmarks that are placed in both: the one that shares most of
/// these first, then the one that sees most.
fn closest(problem: &Problem, map: &Map, pieces: &[Piece]) -> Vec<(usize, Vec<Shared>)> {
    let all = pieces.iter().enumerate().map(|(k, piece)| {
        let pairs = piece.map.landmarks.iter().zip(&map.landmarks);
        let shared: Vec<Shared> = pairs.filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
        let seen = seen_by_both(problem, [map, &piece.map]).count();
        (k, seen, shared)
    });
    let mut all: Vec<_> = all
        .filter(|(_, seen, shared)| *seen + shared.len() > 0)
        .collect();
    all.sort_by_key(|(k, seen, shared)| (core::cmp::Reverse((shared.len(), *seen)), *k));
    all.into_iter().map(|(k, _, shared)| (k, shared)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::frames::laid_over;
    use super::*;
    use crate::kernels::triangulate;
    use crate::problem::{Noise, Odometry, PosePrior};
    use crate::simulate::{Arena, Layout, Scene, simulate};
    use nalgebra::Point2;

    /// Dead reckoning that asks for a refinement every four views, and places landmarks by triangulation.
    struct Every4<'a> {
        problem: &'a Problem,
        finished: Vec<usize>,
    }

    impl Placement for Every4<'_> {
        fn refine_options(&self) -> RefineOptions {
            RefineOptions::default()
        }

        fn next_refinement(&self, count: usize) -> usize {
            count + 4
        }

        fn place_view(&mut self, _: &Map, from: &Pose<f64>, motion: &OdometryLink) -> Pose<f64> {
            from * motion.delta
        }

        fn place_landmarks(&mut self, map: &mut Map, stays: &dyn Fn(usize) -> bool) {
            for landmark in (0..map.landmarks.len()).filter(|&landmark| !stays(landmark)) {
                let rays = map.rays(self.problem, landmark);
                let found = triangulate(rays.map(|(pose, s)| (pose, s.bearing)));
                map.landmarks[landmark] = found.ok().map(|found| found.point);
            }
        }

        fn resects(&self) -> bool {
            true
        }

        fn finish_piece(&mut self, map: &mut Map, _stays: &dyn Fn(usize) -> bool) {
            self.finished.push(size(map));
        }

        fn join(&mut self, maps: [&Map; 2], shared: &[Shared]) -> Option<Map> {
            laid_over(maps, shared)
        }

        fn complete(&mut self, _: &mut Map) -> Result<(), Error> {
            Ok(())
        }
    }

    /// Grows all maps; returns them, the numbers of views at which a piece was refined, and those at which one was finished.
    fn grown(problem: &Problem) -> (Vec<Map>, Vec<usize>, Vec<usize>) {
        let mut placement = Every4 {
            problem,
            finished: Vec::new(),
        };
        let mut refined = Vec::new();
        let mut progress = |stage: &'static str, done: usize, all: usize| {
            assert!(stage == "odometry" && done <= all);
            if refined.last() != Some(&done) {
                refined.push(done);
            }
            true
        };
        let stages = StageOptions::default();
        let maps = grow_from_priors(
            problem,
            &mut placement,
            &[],
            &stages,
            &mut Choices::best(),
            &mut Some(&mut progress),
        );
        (maps.unwrap(), refined, placement.finished)
    }

    fn setting(views: usize) -> (Scene, Problem, Vec<Odometry>) {
        let scene = simulate(Layout::Trajectory, views, 30, 1e-4, 3, Arena::default()).unwrap();
        let problem = Problem::dense(views, 30, &scene.bearings, 0.01).unwrap();
        let odometry = (1..views).map(|end| Odometry {
            start: end - 1,
            end,
            delta: scene.poses[end - 1].inv_mul(&scene.poses[end]),
            noise: Noise::Sigmas([0.1, 0.1, 0.05]),
        });
        let odometry = odometry.collect();
        (scene, problem, odometry)
    }

    fn assert_like_truth(scene: &Scene, map: &Map) {
        assert!(map.poses.iter().all(Option::is_some));
        let home = map.poses[0].unwrap() * scene.poses[0].inverse();
        for (pose, truth) in map.poses.iter().zip(&scene.poses) {
            let error = (home * truth).inv_mul(&pose.unwrap());
            let error = error.translation.vector.norm() + error.rotation.angle().abs();
            // As far as the little noise goes.
            assert!(error < 1e-2, "{error:e}");
        }
    }

    /// A piece is refined with six views, then whenever its placement asks for it, and at its end.
    #[test]
    fn a_piece_is_refined_as_it_grows() {
        let (scene, problem, odometry) = setting(16);
        let problem = problem.with_odometry(&odometry).unwrap();
        let (maps, refined, finished) = grown(&problem);
        assert_eq!(maps.len(), 1);
        assert_like_truth(&scene, &maps[0]);
        assert_eq!(refined, [6, 10, 14, 16]);
        assert_eq!(finished, [16]);
    }

    /// Views that no motion reaches are placed by the landmarks of the piece, and count as others do.
    #[test]
    fn views_apart_are_placed_by_landmarks() {
        let (scene, problem, odometry) = setting(16);
        let first = problem.with_odometry(&odometry[..7]).unwrap();
        let (maps, refined, finished) = grown(&first);
        assert_eq!(maps.len(), 1);
        assert_like_truth(&scene, &maps[0]);
        assert_eq!(refined, [6, 10, 14, 16]);
        assert_eq!(finished, [16]);
    }

    /// With a known start the piece is in the frame of the priors, and so is what is joined to it.
    #[test]
    fn pieces_are_brought_into_the_frame_of_the_priors() {
        let (scene, problem, odometry) = setting(16);
        let start = PosePrior {
            view: 0,
            pose: scene.poses[0],
            noise: Noise::Sigmas([0.1, 0.1, 0.1]),
        };
        let problem = problem.with_pose_priors(&[start]).unwrap();
        let apart: Vec<Odometry> = odometry
            .into_iter()
            .filter(|motion| motion.end != 9)
            .collect();
        let problem = problem.with_odometry(&apart).unwrap();
        let (maps, ..) = grown(&problem);
        assert_eq!(maps.len(), 1);
        for (pose, truth) in maps[0].poses.iter().zip(&scene.poses) {
            let error = truth.inv_mul(&pose.unwrap());
            assert!(error.translation.vector.norm() + error.rotation.angle().abs() < 1e-2);
        }
    }

    #[test]
    fn the_closest_piece_shares_most_landmarks() {
        let piece = |landmarks: &[usize]| {
            let mut map = Map::empty(1, 6);
            for &landmark in landmarks {
                map.landmarks[landmark] = Some(Point2::new(landmark as f64, 1.0));
            }
            Piece { map, framed: false }
        };
        let main = piece(&[0, 1, 2, 3]).map;
        let [one, two, none] = [&[1][..], &[2, 3, 5], &[4, 5]].map(piece);
        let also = piece(&[0, 1]);
        let problem = Problem::dense(1, 6, &[0.1; 6], 0.1).unwrap();
        let near = closest(&problem, &main, &[one, two, also, none]);
        let (place, shared) = &near[0];
        // Of equals the first.
        assert_eq!((*place, shared.len()), (1, 2));
        assert_eq!(shared[0].0, Point2::new(2.0, 1.0));
        let none = || [piece(&[4, 5])];
        assert!(closest(&problem, &main, &none()).is_empty());
        assert!(closest(&problem, &main, &[]).is_empty());
        // What both see counts where no landmark is placed in both.
        let [mut main, mut other] = [main, none()[0].map.clone()];
        main.poses[0] = Some(Pose::identity());
        other.poses[0] = Some(Pose::identity());
        let other = Piece {
            map: other,
            framed: false,
        };
        let found = closest(&problem, &main, &[other]);
        assert_eq!(found, [(0, Vec::new())]);
    }
}
