// SPDX-License-Identifier: MIT OR Apache-2.0
//! One random scene, solved from several starts and compared.

use super::Cell;
use crate::error::Error;
use crate::kernels::Method;
use crate::lm::RefineOptions;
use crate::problem::{Problem, Why};
use crate::reconstruction::{
    Progress, Reconstruction, SolveOptions, Strategy, initialize, refine, solve,
};
use crate::simulate::{Arena, Bound, Errors, Scene, simulate};
use alloc::vec::Vec;
use std::time::Instant;

/// Where a refinement starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Another random scene of the same kind.
    Random,
    /// The method of Dellaert and Stroupe (2002) from the first three views.
    Projective,
    /// The same method with the calibrated tensor, which needs five landmarks.
    Calibrated,
    /// The full search of [`solve`](crate::solve).
    Solve,
}

impl Start {
    /// All starts.
    pub const ALL: [Self; 4] = [
        Self::Random,
        Self::Projective,
        Self::Calibrated,
        Self::Solve,
    ];

    /// The name of the variant in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Projective => "projective",
            Self::Calibrated => "calibrated",
            Self::Solve => "solve",
        }
    }
}

/// The outcome of one start.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialOutcome {
    /// Half the sum of squared residuals over sigma; infinite when there is no map, or when it leaves out
    /// a bearing.
    pub cost: f64,
    /// Whether the cost exceeds the least known one of the scene, over all starts and the refinement from the
    /// truth, by more than 1e-5 of it plus 1e-12.
    pub failed: bool,
    /// Errors against the truth; `None` when there is no map.
    pub errors: Option<Errors>,
    /// Whether the map leaves a view or a landmark undetermined, even if only the range of a landmark.
    pub incomplete: bool,
    /// Linear systems solved in the refinement that won.
    pub iterations: usize,
    /// Time of the start and the refinement \[ns\].
    pub nanoseconds: u64,
}

/// One scene and the outcome of each start.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepTrial {
    /// One for every start, in their order.
    pub outcomes: Vec<TrialOutcome>,
    /// The cost of the refinement that starts at the truth.
    pub from_truth: f64,
    /// The least errors possible; `None` without noise, or when the bearings do not determine the map.
    pub bound: Option<Bound>,
}

impl Cell {
    /// The seed of [`simulate`](crate::simulate) for a trial, so that scenes of different cells, seeds and
    /// trials are independent.
    pub fn scene_seed(&self, seed: u64, trial: u64) -> u64 {
        let words = [
            self.layout as u64,
            self.views as u64,
            self.landmarks as u64,
            self.noise.to_bits(),
            trial,
        ];
        words
            .into_iter()
            .fold(mix(seed), |state, word| mix(state ^ mix(word)))
    }

    fn scene(&self, seed: u64) -> Result<Scene, Error> {
        let (views, landmarks) = (self.views, self.landmarks);
        simulate(
            self.layout,
            views,
            landmarks,
            self.noise,
            seed,
            Arena::default(),
        )
    }
}

/// The output function of SplitMix64 (Steele, Lea and Flood 2014).
fn mix(word: u64) -> u64 {
    let mut z = word.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl SweepTrial {
    /// Draws the scene of a trial, solves it from each start, and compares the costs.
    ///
    /// # Errors
    /// Those of [`simulate`](crate::simulate), and [`Error::Interrupted`] when `progress` says so. A start that
    /// finds no map is an outcome, not an error.
    pub fn run(
        cell: &Cell,
        starts: &[Start],
        seed: u64,
        trial: u64,
        progress: Progress<'_>,
    ) -> Result<Self, Error> {
        let scene_seed = cell.scene_seed(seed, trial);
        let scene = cell.scene(scene_seed)?;
        // Bearings without noise are weighted as if they had some.
        let sigma = if cell.noise > 0.0 { cell.noise } else { 1.0 };
        let problem = Problem::dense(cell.views, cell.landmarks, &scene.bearings, sigma)?;
        // Of random starts most fail: what has not converged by then is lost.
        let options = RefineOptions {
            max_iterations: 100,
            ..RefineOptions::default()
        };
        let from_truth = match refine(&problem, &scene.map(), &options, Some(&mut *progress)) {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(_) => f64::INFINITY,
            Ok(found) => full_cost(&found),
        };
        let mut outcomes = Vec::with_capacity(starts.len());
        for &start in starts {
            // The seed of another scene of the cell.
            let other = mix(scene_seed);
            let begin = Instant::now();
            let found = match start {
                Start::Random => cell.scene(other).and_then(|other| {
                    refine(&problem, &other.map(), &options, Some(&mut *progress))
                }),
                Start::Projective => follow(&problem, Method::Projective, progress),
                Start::Calibrated => {
                    follow(&problem, Method::Calibrated { reweights: 1 }, progress)
                }
                Start::Solve => solve(&problem, &SolveOptions::default(), Some(&mut *progress)),
            };
            let nanoseconds = u64::try_from(begin.elapsed().as_nanos()).unwrap_or(u64::MAX);
            outcomes.push(match found {
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                Err(_) => TrialOutcome {
                    cost: f64::INFINITY,
                    failed: true,
                    errors: None,
                    incomplete: true,
                    iterations: 0,
                    nanoseconds,
                },
                Ok(found) => TrialOutcome {
                    cost: full_cost(&found),
                    failed: false,
                    errors: scene.errors(&found.map).ok(),
                    incomplete: !found.undetermined.is_empty(),
                    iterations: found.iterations,
                    nanoseconds,
                },
            });
        }
        let least = outcomes
            .iter()
            .fold(from_truth, |least, outcome| least.min(outcome.cost));
        for outcome in &mut outcomes {
            outcome.failed =
                outcome.errors.is_none() || !(outcome.cost <= least * (1.0 + 1e-5) + 1e-12);
        }
        Ok(Self {
            outcomes,
            from_truth,
            // Exact bearings have no bound to compare with.
            bound: scene.bound(cell.noise).filter(|_| cell.noise > 0.0),
        })
    }
}

/// The method of Dellaert and Stroupe, refined.
fn follow(
    problem: &Problem,
    method: Method,
    progress: Progress<'_>,
) -> Result<Reconstruction, Error> {
    let options = SolveOptions {
        strategy: Strategy::FirstViews(method),
        ..SolveOptions::default()
    };
    let start = initialize(problem, &options, Some(&mut *progress))?;
    refine(problem, &start.map, &options.refine, Some(progress))
}

/// The cost of a map that explains every bearing; infinite for any other.
fn full_cost(found: &Reconstruction) -> f64 {
    if found
        .undetermined
        .iter()
        .all(|undetermined| undetermined.why == Why::AtInfinity)
    {
        found.cost
    } else {
        f64::INFINITY
    }
}
