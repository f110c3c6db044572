// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a reconstruction returns.

use crate::adjustment::Report;
use crate::adjustment::gauge::{gauge_and_prior_numbers, in_reported_frame};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::{Loss, Termination};
use crate::problem::{Map, Problem, Undetermined};
use alloc::vec::Vec;

/// A map, how well it explains the bearings, and its rivals.
///
/// Gauge: the first determined view is at the origin with heading 0, and the root-mean-square
/// distance of the other views from it is 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// Poses and landmarks; `None` where undetermined.
    pub map: Map,
    /// Half the sum of squared residuals over sigma. With [`SolveOptions::robust`] each square counts
    /// for at most 9, so that a sighting that the map does not explain costs 4.5.
    ///
    /// [`SolveOptions::robust`]: crate::SolveOptions::robust
    pub cost: f64,
    /// Root mean square of the residuals of the inliers \[rad\].
    pub rms: f64,
    /// Predicted minus measured bearing \[rad\] in (-pi, pi], in the order of the problem's input;
    /// `None` where an end is undetermined, unless it is a landmark at infinity.
    pub residuals: Vec<Option<f64>>,
    /// Which sightings made the map, in the order of the problem's input. With
    /// [`SolveOptions::robust`](crate::SolveOptions::robust) those whose residual is at most three
    /// sigma, with a truncated loss those within its width; otherwise all that have a residual.
    pub inliers: Vec<bool>,
    /// Degrees of freedom: inliers between determined views and landmarks, less their parameters
    /// except for the four of the gauge.
    pub freedom: usize,
    /// How the refinement ended.
    pub termination: Termination,
    /// Linear systems that the refinement solved.
    pub iterations: usize,
    /// Views and landmarks without an estimate, and why.
    pub undetermined: Vec<Undetermined>,
    /// Predicted standard deviation of the map over its size, in the direction that the bearings
    /// determine least, for residuals of one sigma; NaN when it was not computed.
    pub sensitivity: f64,
    /// The same for residuals as large as they are: [`Reconstruction::sensitivity`] times the root of
    /// twice the cost per degree of freedom. Above 0.2 be careful; near and above 1 the bearings do not
    /// determine the map. It is computed at the map: where noise has been taken for parallax, as with
    /// landmarks along a wall, it is too small. NaN when there are no degrees of freedom to judge the
    /// noise by.
    pub uncertainty: f64,
    /// Other minima that explain the bearings nearly as well, such as the mirror branch of three
    /// views; best first.
    pub alternatives: Vec<Self>,
    /// Maps of other views, which share too few landmarks with this one to be joined: the largest first,
    /// each in a gauge of its own. A landmark may have a place in several maps. What is `undetermined` in
    /// this map is in none of them.
    pub components: Vec<Self>,
}

impl Reconstruction {
    /// Normalises a map and judges it.
    pub(super) fn new(problem: &Problem, map: &Map, report: Report) -> Self {
        let map = in_reported_frame(problem, map);
        let mut residuals = alloc::vec![None; problem.sightings().len()];
        let mut inliers = alloc::vec![false; residuals.len()];
        let (mut squares, mut count) = (0.0, 0.0_f64);
        let all = problem.input_order().iter().zip(map.residuals(problem));
        for (k, (&place, residual)) in all.enumerate() {
            residuals[place] = residual;
            if let Some(r) = residual {
                let weight = problem.sightings()[k].weight;
                inliers[place] = match report.loss {
                    Loss::Truncated(width) => r.abs() * weight <= width,
                    _ => true,
                };
                squares += r * r;
                count += 1.0;
            }
        }
        Self {
            cost: report.cost,
            rms: (squares / count.max(1.0)).sqrt(),
            freedom: freedom(problem, &map, &residuals),
            inliers,
            residuals,
            map,
            termination: report.termination,
            iterations: report.iterations,
            undetermined: report.undetermined,
            sensitivity: f64::NAN,
            uncertainty: f64::NAN,
            alternatives: Vec::new(),
            components: Vec::new(),
        }
    }
}

/// Measured numbers less parameters, except for those of the gauge.
fn freedom(problem: &Problem, map: &Map, residuals: &[Option<f64>]) -> usize {
    let views = map.poses.iter().flatten().count();
    let landmarks = map.landmarks.iter().flatten().count();
    let (free, numbers) = gauge_and_prior_numbers(problem, map);
    let measured = residuals.iter().flatten().count() + numbers;
    (measured + free).saturating_sub(3 * views + 2 * landmarks)
}
