// SPDX-License-Identifier: MIT OR Apache-2.0
//! The public functions: `initialize` for a first map, `refine` for a given start, `solve` for the best map.

use super::alternatives::with_settled_alternatives;
use super::choice::choose;
use super::collapsed::{drop_collapsed_alternatives, refuse_collapsed};
use super::home::{brought_back, home};
use super::infinity::{InfinityOptions, drop_landmarks_at_infinity};
use super::judge::{assess, judged};
use super::odometry::posterior::solve_posterior;
use super::options::{Progress, SolveOptions, report_progress};
use super::result::Reconstruction;
use super::robust::solve::solve_robust;
use super::verify::{self, verified};
use super::{persist, strategy};
use crate::adjustment::{Report, refine_map};
use crate::error::Error;
use crate::lm::{RefineOptions, Termination};
use crate::problem::{Map, Problem, Subject, Why};

/// A linear map without refinement, as a start for another solver.
///
/// The best hypothesis of the search, or with [`Strategy::FirstViews`](super::Strategy::FirstViews) the map of
/// that method, whatever its cost. Same gauge as [`solve`]; [`Termination::NotRefined`].
///
/// # Errors
/// As [`solve`], except that the result is not tested for free directions.
///
/// # Example
/// ```
/// use bearslam::{
///     Arena, Layout, Method, Problem, SolveOptions, Strategy, initialize, refine, simulate,
/// };
/// let scene = simulate(Layout::Enclosed, 6, 9, 0.01, 5, Arena::default())?;
/// let problem = Problem::dense(6, 9, &scene.bearings, 1.0)?;
/// let options = SolveOptions {
///     strategy: Strategy::FirstViews(Method::Projective),
///     ..SolveOptions::default()
/// };
/// let start = initialize(&problem, &options, None)?;
/// let found = refine(&problem, &start.map, &options.refine, None)?;
/// assert!(found.cost < start.cost);
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn initialize(
    problem: &Problem,
    options: &SolveOptions,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    options.refine.check()?;
    let mut progress = progress;
    let maps = strategy::first_maps(problem, options, &mut progress)?;
    let judged = maps.into_iter().filter_map(|mut map| {
        let undetermined = map.prune(problem);
        map.poses.iter().flatten().next()?;
        let report = Report {
            // That of the residuals.
            cost: f64::NAN,
            termination: Termination::NotRefined,
            iterations: 0,
            undetermined,
            loss: options.refine.loss,
        };
        Some(Reconstruction::new(problem, &map, report))
    });
    choose(problem, judged.collect(), &options.stages.judge)
}

/// Refines a start: one map, no search.
///
/// Views and landmarks that are `None` in the start, or that the others do not determine, stay
/// undetermined. The result is in the gauge of [`solve`], with sensitivity and uncertainty; however large
/// these are, they are no error. [`refine_map`](crate::refine_map) only minimises.
///
/// # Errors
/// As [`refine_map`](crate::refine_map).
pub fn refine(
    problem: &Problem,
    start: &Map,
    options: &RefineOptions,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut progress = progress;
    let mut map = start.clone();
    let total = options.max_iterations;
    let mut observer = |done, _| report_progress(&mut progress, "refine", done, total);
    let mut report = refine_map(problem, &mut map, options, Some(&mut observer))?;
    for undetermined in &mut report.undetermined {
        let without = match undetermined.subject {
            Subject::View(view) => start.poses[view].is_none(),
            Subject::Landmark(landmark) => start.landmarks[landmark].is_none(),
        };
        if without && undetermined.why == Why::Degenerate {
            undetermined.why = Why::NoStart;
        }
    }
    let mut found = Reconstruction::new(problem, &map, report);
    drop_landmarks_at_infinity(problem, &mut found, &InfinityOptions::default());
    assess(problem, &mut found);
    Ok(found)
}

/// Poses and landmarks from bearings, without an initial guess.
///
/// Triples of views give hypotheses in closed form, both branches of each; the best conditioned are
/// grown to whole maps by resection and triangulation and scored by a robust cost over all bearings;
/// the best are refined until one is as low as the noise predicts or two end in the same minimum.
/// Otherwise more hypotheses are made by varying the tensors along the direction that the bearings
/// determine least. Then single landmarks are tried in other places. The lowest minimum is returned, with
/// the rivals that explain the bearings nearly as well (the mirror branch of three views, the twin
/// of four landmarks). Odometry and priors, where the problem has any, give further starts.
///
/// From bearings alone, the first determined view is at the origin with heading 0 and the
/// root-mean-square distance of the other views from it is 1. Views and landmarks that the bearings do not
/// determine are `None` and listed with the reason.
///
/// With [`SolveOptions::verify`] the tensor of three views is confined to a cone in every map of lower cost, a rigorous
/// bound, and the whole cone is searched at a stated resolution: [`Reconstruction::certificate`].
///
/// # Errors
/// [`Error::BadOption`] for an option of the refinement out of its range; [`Error::TooFew`] for an empty search, below three views or when no three views share five landmarks
/// (four, where there is a fourth view); [`Error::Degenerate`] when no triple has a solution (all landmarks
/// along one wall, views in one place) or exact bearings leave a direction of the map free (four landmarks along one
/// wall or circle);
/// [`Error::OutOfMemory`] as [`refine_map`](crate::refine_map); [`Error::Interrupted`] when `progress` says
/// so; with [`SolveOptions::robust`], [`Error::SigmaTooLarge`] for a sigma above 0.35 rad and
/// [`Error::NoConsensus`]; [`Error::NeedsSquares`] for [`SolveOptions::verify`] with that or with another loss. With
/// noise, a degenerate geometry shows in [`Reconstruction::uncertainty`]: look at it before you trust a map.
///
/// # Example
/// ```
/// use bearslam::{Arena, Layout, Problem, SolveOptions, simulate, solve};
/// let scene = simulate(Layout::Enclosed, 8, 11, 0.01, 5, Arena::default())?;
/// let problem = Problem::dense(8, 11, &scene.bearings, 0.01)?;
/// let found = solve(&problem, &SolveOptions::default(), None)?;
/// assert!(found.termination.was_successful());
/// assert!(found.uncertainty < 0.1);
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn solve(
    problem: &Problem,
    options: &SolveOptions,
    progress: Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    options.refine.check()?;
    verify::check(options)?;
    let mut progress = progress;
    let judge = &options.stages.judge;
    let mut best = if !problem.priors().is_empty() {
        let home = home(problem);
        let near = problem.shifted(-home);
        let best = solve_posterior(&near, options, &mut progress)?;
        let best = brought_back(problem, best, home, options, &mut progress)?;
        refuse_collapsed(problem, &best, judge)?;
        judged(problem, best)?
    } else if options.robust {
        let best = solve_robust(problem, options, &mut progress)?;
        refuse_collapsed(problem, &best, judge)?;
        best
    } else {
        persist::solve(problem, options, &mut progress)?
    };
    if !options.robust {
        best = with_settled_alternatives(problem, best, options, &mut progress)?;
    }
    if options.verify {
        best = verified(problem, best, options, &mut progress)?;
    }
    drop_collapsed_alternatives(problem, &mut best, judge);
    Ok(best)
}
