// SPDX-License-Identifier: MIT OR Apache-2.0
//! Initial maps along the odometry: pieces that grow view by view and are then joined.
//!
//! Views connected by odometry form a piece. It grows along its odometry, its landmarks are placed by the views
//! reached so far, and it is refined at intervals, so that it never drifts far. Pieces that share landmarks are then
//! joined by a similarity. A [`Placement`] decides how views and landmarks are placed and pieces joined: by least
//! squares, or robustly where bearings may be outliers.

use super::super::attempt::attempt;
use super::super::options::{Progress, report_progress};
use super::super::robust::motions::{Motions, OdometryLink};
use super::options::OdometryGrowthOptions;
use crate::error::Error;
use crate::geometry::{Pose, align};
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem};
use alloc::collections::VecDeque;
use alloc::vec::Vec;
use nalgebra::Point2;

/// How the parts of a growing piece are estimated.
pub trait Placement {
    /// What the priors determine, in their frame; `None` when that is nothing.
    fn known(&self) -> Option<Map> {
        None
    }

    /// Options of the refinements during growth.
    fn refine_options(&self) -> RefineOptions;

    /// Number of views at which a piece that now has `count` is refined next.
    fn next_refinement(&self, count: usize) -> usize;

    /// The pose at the end of a motion, given the pose at its start.
    fn place_view(&mut self, map: &Map, from: &Pose<f64>, motion: &OdometryLink) -> Pose<f64>;

    /// Places the new landmarks of a view. By default they wait for the next refinement.
    fn place_landmarks_of(&mut self, _map: &mut Map, _view: usize) {}

    /// Places all landmarks again, leaving out those that their rays do not determine.
    fn place_landmarks(&mut self, map: &mut Map);

    /// A view that odometry does not reach, with its pose by resection; `None` when there is none, or when such views
    /// are placed only once all pieces are joined.
    fn next_apart(&self, _map: &Map) -> Option<(usize, Pose<f64>)> {
        None
    }

    /// Places the landmarks of a piece after its last refinement.
    fn finish_piece(&mut self, _map: &mut Map) {}

    /// Joins two pieces by their shared landmarks; `None` when these do not determine the similarity between
    /// them.
    fn join(&mut self, maps: [&Map; 2], shared: &[Shared]) -> Option<Map>;

    /// Whether the whole is refined after each join.
    fn refines_joined(&self) -> bool {
        false
    }

    /// Adds to a map of joined pieces the views and landmarks that it determines.
    ///
    /// # Errors
    /// [`Error::Interrupted`] and [`Error::OutOfMemory`] of the refinement.
    fn complete(&mut self, map: &mut Map) -> Result<(), Error>;
}

/// The position of a landmark in the second of two pieces, and in the first.
pub type Shared = (Point2<f64>, Point2<f64>);

/// Maps along the odometry and from priors, the one with most views first; the others share too few landmarks
/// with it to be joined. Empty when there is no odometry and priors determine nothing.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so, [`Error::OutOfMemory`] of the refinement.
pub fn grow_along_odometry(
    problem: &Problem,
    placement: &mut impl Placement,
    options: &OdometryGrowthOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Map>, Error> {
    let mut growth = OdometryGrowth {
        problem,
        motions: Motions::new(problem),
        placement,
        options,
        progress,
    };
    let mut pieces = Vec::new();
    let known = growth.placement.known();
    let fixed = known.is_some();
    if let Some(mut known) = known {
        growth.extend(&mut known)?;
        pieces.push(known);
    }
    // Start from the view that sees most landmarks, the first of equals.
    let mut order: Vec<usize> = (0..problem.views()).collect();
    order.sort_by_key(|&view| core::cmp::Reverse(problem.of_view(view).len()));
    for root in order {
        let reached = |map: &Map| map.poses[root].is_some();
        if !growth.motions.of(root).is_empty() && !pieces.iter().any(reached) {
            let mut piece = Map::empty(problem.views(), problem.landmarks());
            piece.poses[root] = Some(Pose::identity());
            growth.extend(&mut piece)?;
            pieces.push(piece);
        }
    }
    // The piece in the frame of the priors stays first, so that the others are moved into that frame.
    pieces[usize::from(fixed)..].sort_by_key(|map| core::cmp::Reverse(size(map)));
    growth.join_all(pieces)
}

/// The state of the growth.
struct OdometryGrowth<'a, 'p, P> {
    problem: &'a Problem,
    motions: Motions,
    placement: &'a mut P,
    options: &'a OdometryGrowthOptions,
    progress: &'a mut Option<Progress<'p>>,
}

impl<P: Placement> OdometryGrowth<'_, '_, P> {
    /// Grows a piece from the views that it has, along its odometry, and by resection where odometry ends.
    fn extend(&mut self, map: &mut Map) -> Result<(), Error> {
        let mut waiting: VecDeque<usize> = (0..map.poses.len())
            .filter(|&view| map.poses[view].is_some())
            .collect();
        let mut count = waiting.len();
        let mut next = self.options.first_views.max(count);
        loop {
            while let Some(view) = waiting.pop_front() {
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
                    self.refine_partial(map)?;
                }
            }
            let Some((view, pose)) = self.placement.next_apart(map) else {
                break;
            };
            map.poses[view] = Some(pose);
            waiting.push_back(view);
            count += 1;
        }
        self.refine_partial(map)?;
        self.placement.finish_piece(map);
        Ok(())
    }

    /// Places all landmarks again and refines for a few iterations. What cannot be refined yet stays unchanged.
    fn refine_partial(&mut self, map: &mut Map) -> Result<(), Error> {
        self.placement.place_landmarks(map);
        let options = self.placement.refine_options();
        let options = RefineOptions {
            max_iterations: options.max_iterations.min(self.options.iterations),
            ..options
        };
        let (done, all) = (size(map), self.problem.views());
        let mut trial = map.clone();
        let mut observer = |_, _| report_progress(self.progress, "odometry", done, all);
        if attempt(self.problem, &mut trial, &options, Some(&mut observer))?.is_some() {
            // Keep what was pruned: it may be determined later.
            for (place, refined) in map.poses.iter_mut().zip(trial.poses) {
                *place = refined.or(*place);
            }
            for (place, refined) in map.landmarks.iter_mut().zip(trial.landmarks) {
                *place = refined.or(*place);
            }
        }
        Ok(())
    }

    /// Joins pieces to the first, at each step the one that shares most landmarks; those that share too few become
    /// maps of their own.
    fn join_all(&mut self, mut pieces: Vec<Map>) -> Result<Vec<Map>, Error> {
        let mut done = Vec::new();
        while !pieces.is_empty() {
            let mut main = pieces.remove(0);
            while let Some((k, shared)) = closest(&main, &pieces, self.options.min_shared) {
                let other = pieces.remove(k);
                if let Some(joined) = self.placement.join([&main, &other], &shared) {
                    main = joined;
                }
                if self.placement.refines_joined() {
                    self.refine_partial(&mut main)?;
                }
            }
            self.placement.complete(&mut main)?;
            done.push(main);
        }
        done.sort_by_key(|map| core::cmp::Reverse(size(map)));
        Ok(done)
    }
}

/// Number of views in a map.
fn size(map: &Map) -> usize {
    map.poses.iter().flatten().count()
}

/// The piece that shares most landmarks with a map, and these landmarks; `None` when fewer than `enough`.
fn closest(map: &Map, pieces: &[Map], enough: usize) -> Option<(usize, Vec<Shared>)> {
    let shared = |piece: &Map| -> Vec<Shared> {
        let pairs = piece.landmarks.iter().zip(&map.landmarks);
        pairs.filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect()
    };
    let all = pieces.iter().map(shared).enumerate();
    let best = all.max_by_key(|(k, shared)| (shared.len(), core::cmp::Reverse(*k)));
    best.filter(|(_, shared)| shared.len() >= enough)
}

/// The first map extended by what only the second has, moved by the similarity that fits the given shared
/// landmarks; `None` when they do not determine one.
pub fn laid_over([first, second]: [&Map; 2], shared: &[Shared]) -> Option<Map> {
    let (source, target): (Vec<_>, Vec<_>) = shared.iter().copied().unzip();
    let moved = second.transformed(&align(&source, &target).ok()?);
    let mut map = first.clone();
    for (place, pose) in map.poses.iter_mut().zip(moved.poses) {
        *place = place.or(pose);
    }
    for (place, point) in map.landmarks.iter_mut().zip(moved.landmarks) {
        *place = place.or(point);
    }
    Some(map)
}
