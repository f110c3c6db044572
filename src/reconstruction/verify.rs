// SPDX-License-Identifier: MIT OR Apache-2.0
//! Verification of a map: a cone that holds the tensors of all maps of lower cost, and a search of the whole cone.

mod cells;
mod cone;
pub(crate) mod options;
mod search;

use super::alternatives::with_settled_alternatives;
use super::certificate::{Certificate, Verdict};
use super::choice::add_rivals;
use super::judge::is_incomplete;
use super::options::{Progress, SolveOptions};
use super::result::Reconstruction;
use crate::error::Error;
use crate::lm::{Loss, Termination};
use crate::problem::Problem;
use cells::cover;
use cone::{Localisation, localise};
use search::ConeSearch;

/// Refuses options with which there is no bound: it holds for squared residuals of all bearings.
///
/// # Errors
/// [`Error::NeedsSquares`].
pub fn check(options: &SolveOptions) -> Result<(), Error> {
    if options.verify && (options.robust || options.refine.loss != Loss::Squared) {
        return Err(Error::NeedsSquares { what: "verify" });
    }
    Ok(())
}

/// A map with its certificate, or a lower one, found on the way, with its own.
///
/// # Errors
/// Those that stop everything.
pub fn verified(
    problem: &Problem,
    mut best: Reconstruction,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Reconstruction, Error> {
    let mut search = ConeSearch::new(problem, options);
    loop {
        let mut certificate = Certificate {
            views: None,
            cone: f64::NAN,
            cells: 0,
            verdict: Verdict::NotConverged,
        };
        let lower = certify(&mut search, &best, &mut certificate, progress)?;
        // Each round takes some of the cells that are left.
        let Some(mut lower) = lower else {
            best.certificate = Some(certificate);
            return Ok(best);
        };
        let rivals = core::mem::take(&mut best.alternatives);
        let rivals = core::iter::once(best).chain(rivals);
        add_rivals(problem, &mut lower, rivals, &options.stages.judge);
        best = with_settled_alternatives(problem, lower, options, progress)?;
    }
}

/// Fills in the certificate of a map, or returns a lower one.
fn certify(
    search: &mut ConeSearch<'_>,
    best: &Reconstruction,
    certificate: &mut Certificate,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Reconstruction>, Error> {
    let (problem, options) = (search.problem, search.options);
    if best.termination == Termination::ZeroResidual {
        certificate.cone = 0.0;
        certificate.verdict = Verdict::NoLowerMap;
        return Ok(None);
    }
    if !best.termination.was_successful() {
        return Ok(None);
    }
    if is_incomplete(best) {
        certificate.verdict = Verdict::Incomplete;
        return Ok(None);
    }
    let cone = match localise(problem, best, options, progress)? {
        Localisation::TooFewShared => {
            certificate.verdict = Verdict::TooFewShared;
            return Ok(None);
        }
        Localisation::Anywhere => {
            certificate.verdict = Verdict::NoCone;
            return Ok(None);
        }
        Localisation::Nowhere(views) => {
            certificate.views = Some(views);
            certificate.cone = 0.0;
            certificate.verdict = Verdict::NoLowerMap;
            return Ok(None);
        }
        Localisation::Cone(cone) => cone,
    };
    certificate.views = Some(cone.views);
    certificate.cone = cone.angle();
    let Some(cells) = cover(&cone.sines, options.stages.verify.width, search.left) else {
        certificate.verdict = Verdict::TooManyCells;
        return Ok(None);
    };
    certificate.cells = cells.len();
    certificate.verdict = Verdict::Searched;
    search.lower(best, &cone, &cells, progress)
}
