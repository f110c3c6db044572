// SPDX-License-Identifier: MIT OR Apache-2.0
//! Growth along odometry by least squares: views by dead reckoning, landmarks by priors or triangulation.

use super::super::incremental::complete::place_all;
use super::super::incremental::options::IncrementalOptions;
use super::super::robust::motions::OdometryLink;
use super::super::stages::StageOptions;
use super::frames::{Shared, laid_over};
use super::growth::Placement;
use super::options::StrideOptions;
use crate::error::Error;
use crate::geometry::Pose;
use crate::kernels::triangulate;
use crate::lm::RefineOptions;
use crate::problem::{Map, Problem};

/// The placement by least squares.
pub struct LeastSquaresPlacement<'a> {
    problem: &'a Problem,
    refine: RefineOptions,
    min_parallax: f64,
    stride: StrideOptions,
    incremental: IncrementalOptions,
}

impl<'a> LeastSquaresPlacement<'a> {
    /// `refine` are the options of the caller's refinement, whose loss counts on the way as well.
    pub fn new(problem: &'a Problem, refine: &RefineOptions, stages: &StageOptions) -> Self {
        let stride = stages.stride;
        Self {
            problem,
            refine: RefineOptions {
                tolerance: stride.tolerance.max(refine.tolerance),
                ..*refine
            },
            min_parallax: stages.odometry_growth.min_parallax,
            stride,
            incremental: stages.incremental,
        }
    }

    /// Triangulates anew every landmark whose rays have more than this parallax, except those that stay.
    ///
    /// A landmark that was first seen over a short distance may have come out anywhere; once its views are
    /// refined it need not stay there.
    fn triangulate(&self, map: &mut Map, parallax: f64, stays: &dyn Fn(usize) -> bool) {
        for landmark in (0..self.problem.landmarks()).filter(|&landmark| !stays(landmark)) {
            let rays = map.rays(self.problem, landmark);
            let found = triangulate(rays.map(|(pose, s)| (pose, s.bearing))).ok();
            let ahead = |behind: usize| behind == 0 || !self.problem.is_oriented();
            let found = found.filter(|found| found.parallax > parallax && ahead(found.behind));
            map.landmarks[landmark] = found.map(|found| found.point);
        }
    }
}

impl Placement for LeastSquaresPlacement<'_> {
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

    fn place_landmarks(&mut self, map: &mut Map, stays: &dyn Fn(usize) -> bool) {
        self.triangulate(map, self.min_parallax, stays);
    }

    fn resects(&self) -> bool {
        true
    }

    fn finish_piece(&mut self, map: &mut Map, stays: &dyn Fn(usize) -> bool) {
        self.triangulate(map, 0.0, stays);
    }

    fn join(&mut self, maps: [&Map; 2], shared: &[Shared]) -> Option<Map> {
        laid_over(maps, shared)
    }

    fn complete(&mut self, map: &mut Map) -> Result<(), Error> {
        place_all(self.problem, &self.incremental, map);
        Ok(())
    }
}
