// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps of many views: without an initial guess, from a start, and without refinement.

use super::convert::{self, Floats};
use super::errors;
use super::observer::InterpreterObserver;
use super::reconstruction::{RawReconstruction, Tested};
use super::request::Request;
use crate::{
    Covariance, Error, Frame, Loss, Map, Method, Problem, RefineOptions, SearchOptions,
    SolveOptions, StageOptions, Strategy,
};
use alloc::string::String;
use alloc::vec::Vec;
use pyo3::prelude::*;
use std::format;

/// The package's `Settings`: how a map is found and refined.
#[derive(FromPyObject)]
pub struct Settings {
    method: String,
    search: RawSearch,
    loss: String,
    refinement: RawRefinement,
    robust: bool,
    verify: bool,
    seed: u64,
}

/// The package's `SearchOptions`; also used to return the defaults of the core.
#[derive(Clone, Copy, FromPyObject, IntoPyObject)]
struct RawSearch {
    triples: usize,
    grown: usize,
    candidates: usize,
    swept: usize,
}

/// The package's `RefineOptions`.
#[derive(Clone, Copy, FromPyObject, IntoPyObject)]
struct RawRefinement {
    max_iterations: usize,
    damping: f64,
    tolerance: f64,
    /// In standard deviations; the usual constant of the loss if `None`.
    loss_scale: Option<f64>,
}

/// The defaults of the core. The package repeats them, and a test compares the two.
#[derive(IntoPyObject)]
pub struct Defaults {
    search: RawSearch,
    refinement: RawRefinement,
}

#[pyfunction]
pub fn defaults() -> Defaults {
    let (search, refine) = (SearchOptions::default(), RefineOptions::default());
    Defaults {
        search: RawSearch {
            triples: search.triples,
            grown: search.grown,
            candidates: search.candidates,
            swept: search.swept,
        },
        refinement: RawRefinement {
            max_iterations: refine.max_iterations,
            damping: refine.damping,
            tolerance: refine.tolerance,
            loss_scale: None,
        },
    }
}

#[pyfunction]
pub fn initialize<'py>(
    py: Python<'py>,
    request: Request<'py>,
    settings: Settings,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<RawReconstruction<'py>>> {
    let problem = request.read(py)?;
    let options = settings.read(py)?;
    let found = InterpreterObserver::run(py, progress, |watch| {
        let found = crate::initialize(&problem, &options, Some(&mut *watch))?;
        Tested::new(&problem, found, None, watch)
    })?;
    found.with_alternatives(py, &problem)
}

#[pyfunction]
pub fn solve<'py>(
    py: Python<'py>,
    request: Request<'py>,
    settings: Settings,
    covariance: Option<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<RawReconstruction<'py>>> {
    let problem = request.read(py)?;
    let options = settings.read(py)?;
    let wanted = covariance.map(|name| Wanted::of(py, &name)).transpose()?;
    // The covariance of a robust map is that of its inliers.
    let loss = if options.robust {
        Loss::Truncated(Loss::<f64>::TRUNCATED)
    } else {
        options.refine.loss
    };
    let found = InterpreterObserver::run(py, progress, |watch| {
        let found = crate::solve(&problem, &options, Some(&mut *watch))?;
        let covariance =
            wanted.map(|wanted| wanted.compute(&problem, &found.map, loss, &mut *watch));
        Tested::new(&problem, found, covariance.transpose()?, watch)
    })?;
    found.with_alternatives(py, &problem)
}

#[pyfunction]
pub fn refine<'py>(
    py: Python<'py>,
    request: Request<'py>,
    settings: Settings,
    poses: Floats<'py>,
    landmarks: Floats<'py>,
    covariance: Option<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<RawReconstruction<'py>> {
    let problem = request.read(py)?;
    let start = convert::map(py, &poses, &landmarks)?;
    let options = settings.refine_options(py)?;
    let wanted = covariance.map(|name| Wanted::of(py, &name)).transpose()?;
    let found = InterpreterObserver::run(py, progress, |watch| {
        let found = crate::refine(&problem, &start, &options, Some(&mut *watch))?;
        let covariance =
            wanted.map(|wanted| wanted.compute(&problem, &found.map, options.loss, &mut *watch));
        Tested::new(&problem, found, covariance.transpose()?, watch)
    })?;
    found.map(py, &problem)
}

impl Settings {
    fn read(&self, py: Python<'_>) -> PyResult<SolveOptions> {
        Ok(SolveOptions {
            strategy: self.strategy(py)?,
            search: SearchOptions {
                triples: self.search.triples,
                grown: self.search.grown,
                candidates: self.search.candidates,
                swept: self.search.swept,
            },
            refine: self.refine_options(py)?,
            seed: self.seed,
            robust: self.robust,
            verify: self.verify,
            stages: StageOptions::default(),
        })
    }

    fn strategy(&self, py: Python<'_>) -> PyResult<Strategy> {
        match self.method.as_str() {
            "search" => Ok(Strategy::Search),
            "calibrated" => Ok(Strategy::FirstViews(Method::Calibrated { reweights: 1 })),
            "projective" => Ok(Strategy::FirstViews(Method::Projective)),
            "incremental" => Ok(Strategy::Incremental),
            "global" => Ok(Strategy::Global),
            name => Err(errors::invalid(
                py,
                &format!(
                    "method: expected \"search\", \"calibrated\", \"projective\", \"incremental\" or \
                     \"global\", got {name:?}"
                ),
            )),
        }
    }

    fn refine_options(&self, py: Python<'_>) -> PyResult<RefineOptions> {
        let RawRefinement {
            max_iterations,
            damping,
            tolerance,
            loss_scale,
        } = self.refinement;
        let scale = |usual| loss_scale.unwrap_or(usual);
        let loss = match self.loss.as_str() {
            "squared" => Loss::Squared,
            "huber" => Loss::Huber(scale(Loss::<f64>::HUBER)),
            "cauchy" => Loss::Cauchy(scale(Loss::<f64>::CAUCHY)),
            "truncated" => Loss::Truncated(scale(Loss::<f64>::TRUNCATED)),
            name => {
                return Err(errors::invalid(
                    py,
                    &format!(
                        "loss: expected \"squared\", \"huber\", \"cauchy\" or \"truncated\", got {name:?}"
                    ),
                ));
            }
        };
        Ok(RefineOptions {
            max_iterations,
            damping,
            tolerance,
            loss,
        })
    }
}

/// The frame of the requested covariances.
enum Wanted {
    /// "priors" if odometry and priors fix the whole gauge, "first_view" otherwise.
    Fitting,
    In(Frame),
}

impl Wanted {
    fn of(py: Python<'_>, name: &str) -> PyResult<Self> {
        if name == "fitting" {
            return Ok(Self::Fitting);
        }
        let frame = Frame::ALL.into_iter().find(|frame| frame.name() == name);
        frame.map(Self::In).ok_or_else(|| {
            let known = Frame::ALL.map(Frame::name).join("\", \"");
            errors::invalid(
                py,
                &format!("covariance: expected any of \"{known}\", got {name:?}"),
            )
        })
    }

    fn compute(
        self,
        problem: &Problem,
        map: &Map,
        loss: Loss,
        watch: &mut dyn FnMut(&'static str, usize, usize) -> bool,
    ) -> Result<Covariance, Error> {
        let frame = match self {
            Self::In(frame) => frame,
            Self::Fitting
                if crate::adjustment::gauge::gauge_and_prior_numbers(problem, map).0 == 0 =>
            {
                Frame::Priors
            }
            Self::Fitting => Frame::FirstView,
        };
        let all = map.poses.iter().flatten().count() + map.landmarks.iter().flatten().count();
        let mut look = |done, _| watch("covariance", done, all);
        crate::covariance(problem, map, loss, frame, Some(&mut look))
    }
}
