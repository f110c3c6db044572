// SPDX-License-Identifier: MIT OR Apache-2.0
//! Growth along odometry by least squares: views by dead reckoning, landmarks by priors or triangulation.

use super::super::grow::{grow, resect_view};
use super::super::robust::motions::OdometryLink;
use super::super::stages::StageOptions;
use super::growth::{Placement, Shared, laid_over};
use super::options::StrideOptions;
use crate::error::Error;
use crate::geometry::Pose;
use crate::kernels::triangulate;
use crate::lm::RefineOptions;
use crate::problem::{Map, Prior, Problem};
use alloc::vec;
use alloc::vec::Vec;

/// The placement by least squares.
pub struct LeastSquaresPlacement<'a> {
    problem: &'a Problem,
    refine: RefineOptions,
    min_parallax: f64,
    stride: StrideOptions,
    /// Which landmarks have a prior: their positions are not triangulated.
    known: Vec<bool>,
}

impl<'a> LeastSquaresPlacement<'a> {
    /// `refine` are the options of the caller's refinement, whose loss counts on the way as well.
    pub fn new(problem: &'a Problem, refine: &RefineOptions, stages: &StageOptions) -> Self {
        let stride = stages.stride;
        let mut known = vec![false; problem.landmarks()];
        for prior in problem.priors() {
            if let Prior::Landmark { landmark, .. } = prior {
                known[*landmark] = true;
            }
        }
        Self {
            problem,
            refine: RefineOptions {
                tolerance: stride.tolerance.max(refine.tolerance),
                ..*refine
            },
            min_parallax: stages.odometry_growth.min_parallax,
            stride,
            known,
        }
    }

    /// Triangulates again every landmark without a prior whose rays have more than this parallax.
    ///
    /// A landmark that was first seen over a short baseline may have been placed anywhere; its views are
    /// better known after a refinement.
    fn triangulate(&self, map: &mut Map, parallax: f64) {
        for landmark in (0..self.known.len()).filter(|&landmark| !self.known[landmark]) {
            let rays = map.rays(self.problem, landmark);
            let found = triangulate(rays.map(|(pose, s)| (pose, s.bearing))).ok();
            let ahead = |behind: usize| behind == 0 || !self.problem.is_oriented();
            let found = found.filter(|found| found.parallax > parallax && ahead(found.behind));
            map.landmarks[landmark] = found.map(|found| found.point);
        }
    }
}

impl Placement for LeastSquaresPlacement<'_> {
    fn known(&self) -> Option<Map> {
        let mut known = Map::empty(self.problem.views(), self.problem.landmarks());
        for prior in self.problem.priors() {
            match prior {
                Prior::Landmark {
                    landmark, position, ..
                } => known.landmarks[*landmark] = Some(*position),
                Prior::Pose { view, pose, root } if (0..3).all(|k| root[k][k] > 0.0) => {
                    known.poses[*view] = Some(*pose);
                }
                _ => {}
            }
        }
        let fixed = known.determined().next().is_some();
        fixed.then_some(known)
    }

    fn refine_options(&self) -> RefineOptions {
        self.refine
    }

    fn next_refinement(&self, count: usize) -> usize {
        let StrideOptions {
            part,
            shortest,
            longest,
            ..
        } = self.stride;
        count.saturating_add((count / part.max(1)).max(shortest).min(longest))
    }

    fn place_view(&mut self, _: &Map, from: &Pose<f64>, motion: &OdometryLink) -> Pose<f64> {
        from * motion.delta
    }

    fn place_landmarks(&mut self, map: &mut Map) {
        self.triangulate(map, self.min_parallax);
    }

    /// The view not yet placed that sees most landmarks of the map.
    fn next_apart(&self, map: &Map) -> Option<(usize, Pose<f64>)> {
        let unseen = (0..map.poses.len()).filter(|&view| map.poses[view].is_none());
        let (_, view) = unseen
            .map(|view| (map.connections_of_view(self.problem, view), view))
            .max_by_key(|&(seen, view)| (seen, core::cmp::Reverse(view)))?;
        let (pose, _) = resect_view(self.problem, map, view)?;
        Some((view, pose))
    }

    fn finish_piece(&mut self, map: &mut Map) {
        self.triangulate(map, 0.0);
    }

    fn join(&mut self, maps: [&Map; 2], shared: &[Shared]) -> Option<Map> {
        laid_over(maps, shared)
    }

    fn complete(&mut self, map: &mut Map) -> Result<(), Error> {
        let before = map.landmarks.clone();
        grow(self.problem, map);
        // What was known or refined is better than a triangulation.
        for (place, known) in map.landmarks.iter_mut().zip(before) {
            *place = known.or(*place);
        }
        Ok(())
    }
}
