// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maps of many views: from nothing, from a start, without the refinement.

use super::convert::{self, Floats};
use super::problem::RawProblem;
use super::result;
use super::watch::Watcher;
use crate::{
    Covariance, Error, Frame, Loss, Map, Method, Problem, RefineOptions, SearchOptions,
    SolveOptions, Strategy,
};
use alloc::string::String;
use alloc::vec::Vec;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::format;

/// How a first map is found, as the package hands it over: in a dictionary.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct RawSearch {
    method: String,
    triples: usize,
    grown: usize,
    candidates: usize,
    swept: usize,
    seed: u64,
    robust: bool,
}

/// How it is refined.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct RawRefine {
    max_iterations: usize,
    damping: f64,
    tolerance: f64,
    loss: String,
    /// In standard deviations; the constant of the loss if there is none.
    loss_scale: Option<f64>,
}

#[pyfunction]
pub fn initialize<'py>(
    py: Python<'py>,
    problem: RawProblem<'py>,
    search: RawSearch,
    refine: RawRefine,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let problem = problem.read(py)?;
    let options = options(py, &search, &refine)?;
    let found = Watcher::run(py, progress, |watch| {
        crate::initialize(&problem, &options, Some(watch))
    })?;
    result::ranked(py, &found, None)
}

#[pyfunction]
pub fn solve<'py>(
    py: Python<'py>,
    problem: RawProblem<'py>,
    search: RawSearch,
    refine: RawRefine,
    covariance: Option<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let problem = problem.read(py)?;
    let options = options(py, &search, &refine)?;
    let wanted = covariance.map(|name| Wanted::of(py, &name)).transpose()?;
    // The covariance of a robust map is that of its inliers.
    let loss = if options.robust {
        Loss::Truncated(Loss::<f64>::TRUNCATED)
    } else {
        options.refine.loss
    };
    let (found, covariance) = Watcher::run(py, progress, |watch| {
        let found = crate::solve(&problem, &options, Some(&mut *watch))?;
        let covariance = wanted.map(|wanted| wanted.compute(&problem, &found.map, loss, watch));
        Ok((found, covariance.transpose()?))
    })?;
    result::ranked(py, &found, covariance.as_ref())
}

#[pyfunction]
pub fn refine<'py>(
    py: Python<'py>,
    problem: RawProblem<'py>,
    poses: Floats<'py>,
    landmarks: Floats<'py>,
    refine: RawRefine,
    covariance: Option<String>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let problem = problem.read(py)?;
    let start = convert::map(py, &poses, &landmarks)?;
    let options = refine.read(py)?;
    let wanted = covariance.map(|name| Wanted::of(py, &name)).transpose()?;
    let (found, covariance) = Watcher::run(py, progress, |watch| {
        let found = crate::refine(&problem, &start, &options, Some(&mut *watch))?;
        let covariance =
            wanted.map(|wanted| wanted.compute(&problem, &found.map, options.loss, watch));
        Ok((found, covariance.transpose()?))
    })?;
    result::reconstruction(py, &found, covariance.as_ref())
}

fn options(py: Python<'_>, search: &RawSearch, refine: &RawRefine) -> PyResult<SolveOptions> {
    Ok(SolveOptions {
        strategy: search.strategy(py)?,
        search: SearchOptions {
            triples: search.triples,
            grown: search.grown,
            candidates: search.candidates,
            swept: search.swept,
        },
        refine: refine.read(py)?,
        seed: search.seed,
        robust: search.robust,
    })
}

impl RawSearch {
    fn strategy(&self, py: Python<'_>) -> PyResult<Strategy> {
        match self.method.as_str() {
            "search" => Ok(Strategy::Search),
            "calibrated" => Ok(Strategy::FirstViews(Method::Calibrated { reweights: 1 })),
            "projective" => Ok(Strategy::FirstViews(Method::Projective)),
            "incremental" => Ok(Strategy::Incremental),
            "global" => Ok(Strategy::Global),
            name => Err(convert::invalid(
                py,
                &format!(
                    "method: expected \"search\", \"calibrated\", \"projective\", \"incremental\" or \
                     \"global\", got {name:?}"
                ),
            )),
        }
    }
}

impl RawRefine {
    fn read(&self, py: Python<'_>) -> PyResult<RefineOptions> {
        let scale = |usual| self.loss_scale.unwrap_or(usual);
        let loss = match self.loss.as_str() {
            "squared" => Loss::Squared,
            "huber" => Loss::Huber(scale(Loss::<f64>::HUBER)),
            "cauchy" => Loss::Cauchy(scale(Loss::<f64>::CAUCHY)),
            "truncated" => Loss::Truncated(scale(Loss::<f64>::TRUNCATED)),
            name => {
                return Err(convert::invalid(
                    py,
                    &format!(
                        "loss: expected \"squared\", \"huber\", \"cauchy\" or \"truncated\", got {name:?}"
                    ),
                ));
            }
        };
        Ok(RefineOptions {
            max_iterations: self.max_iterations,
            damping: self.damping,
            tolerance: self.tolerance,
            loss,
        })
    }
}

/// The frame of the covariances that are asked for.
enum Wanted {
    /// "priors" where they leave nothing free, "first_view" otherwise.
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
            convert::invalid(
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
            Self::Fitting if map.ties(problem).0 == 0 => Frame::Priors,
            Self::Fitting => Frame::FirstView,
        };
        let all = map.poses.iter().flatten().count() + map.landmarks.iter().flatten().count();
        let mut look = |done, _| watch("covariance", done, all);
        crate::covariance(problem, map, loss, frame, Some(&mut look))
    }
}
