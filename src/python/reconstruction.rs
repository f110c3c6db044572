// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reconstructions as arrays and numbers.

use super::convert;
use super::finding::RawFinding;
use crate::{
    Certificate, Covariance, Error, FitTest, GlobalTest, Problem, Progress, Reconstruction,
    Subject, TestOptions,
};
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;

/// The contents of the package's `Reconstruction`.
#[derive(IntoPyObject)]
pub struct RawReconstruction<'py> {
    poses: Bound<'py, PyArray2<f64>>,
    landmarks: Bound<'py, PyArray2<f64>>,
    residuals: Bound<'py, PyArray1<f64>>,
    inliers: Bound<'py, PyArray1<bool>>,
    cost: f64,
    rms: f64,
    freedom: usize,
    explained: Option<usize>,
    sensitivity: f64,
    uncertainty: f64,
    /// Kind and index.
    worst: Option<(&'static str, usize)>,
    sigma0: f64,
    p_value: f64,
    findings: Vec<RawFinding>,
    converged: bool,
    termination: &'static str,
    iterations: usize,
    /// Kind, index, reason.
    undetermined: Vec<(&'static str, usize, String)>,
    components: Vec<Bound<'py, PyAny>>,
    pose_covariance: Option<Bound<'py, PyArray3<f64>>>,
    landmark_covariance: Option<Bound<'py, PyArray3<f64>>>,
    covariance_frame: Option<&'static str>,
    certificate: Option<RawCertificate>,
}

/// The contents of the package's `Certificate`.
#[derive(IntoPyObject)]
struct RawCertificate {
    views: Option<[usize; 3]>,
    cone: f64,
    cells: usize,
    verified: bool,
    message: String,
}

impl From<Certificate> for RawCertificate {
    fn from(certificate: Certificate) -> Self {
        Self {
            views: certificate.views,
            cone: certificate.cone,
            cells: certificate.cells,
            verified: certificate.verified(),
            message: certificate.to_string(),
        }
    }
}

/// A reconstruction with its covariances and the tests of its fit and of those of its components.
pub struct Tested {
    found: Reconstruction,
    covariance: Option<Covariance>,
    tests: Vec<FitTest>,
}

impl Tested {
    /// Tests a reconstruction.
    ///
    /// # Errors
    /// Those of [`test_fit`](crate::test_fit).
    pub fn new(
        problem: &Problem,
        found: Reconstruction,
        covariance: Option<Covariance>,
        watch: Progress<'_>,
    ) -> Result<Self, Error> {
        let all = core::iter::once(&found).chain(&found.components);
        let options = TestOptions::default();
        let tests = all.map(|one| crate::test_fit(problem, one, &options, Some(&mut *watch)));
        Ok(Self {
            tests: tests.collect::<Result<_, _>>()?,
            found,
            covariance,
        })
    }

    /// The map, followed by its alternatives.
    pub fn with_alternatives<'py>(
        &self,
        py: Python<'py>,
        problem: &Problem,
    ) -> PyResult<Vec<RawReconstruction<'py>>> {
        let rivals = self.found.alternatives.iter();
        let rivals = rivals.map(|rival| RawReconstruction::of(py, problem, rival));
        core::iter::once(self.map(py, problem))
            .chain(rivals)
            .collect()
    }

    /// The map.
    pub fn map<'py>(&self, py: Python<'py>, problem: &Problem) -> PyResult<RawReconstruction<'py>> {
        let raw = |found, test| {
            let mut raw = RawReconstruction::of(py, problem, found)?;
            raw.findings = raw_findings(problem, test);
            Ok::<_, PyErr>(raw)
        };
        let components = self.found.components.iter().zip(&self.tests[1..]);
        let components = components.map(|(found, test)| {
            let component = raw(found, test)?.into_pyobject(py)?;
            Ok(component.into_any())
        });
        let blocks = self
            .covariance
            .as_ref()
            .map(|found| blocks(py, found))
            .transpose()?;
        let (pose_covariance, landmark_covariance) = blocks.unzip();
        Ok(RawReconstruction {
            components: components.collect::<PyResult<_>>()?,
            pose_covariance,
            landmark_covariance,
            covariance_frame: self.covariance.as_ref().map(|found| found.frame.name()),
            ..raw(&self.found, &self.tests[0])?
        })
    }
}

fn raw_findings(problem: &Problem, test: &FitTest) -> Vec<RawFinding> {
    let findings = crate::fit_findings(problem, test);
    findings.iter().map(RawFinding::from).collect()
}

impl<'py> RawReconstruction<'py> {
    /// Without components, covariances and findings.
    fn of(py: Python<'py>, problem: &Problem, found: &Reconstruction) -> PyResult<Self> {
        let residuals = found.residuals.iter().map(|r| r.unwrap_or(f64::NAN));
        let undetermined = found.undetermined.iter().map(|one| {
            let (kind, index) = subject(one.subject);
            (kind, index, one.why.to_string())
        });
        let test = GlobalTest::of(problem, found);
        Ok(Self {
            poses: convert::poses(py, found.map.poses.iter().map(Option::as_ref)),
            landmarks: convert::points(py, &found.map.landmarks),
            residuals: PyArray1::from_iter(py, residuals),
            inliers: PyArray1::from_slice(py, &found.inliers),
            cost: found.cost,
            rms: found.rms,
            freedom: found.freedom,
            explained: found.explained,
            sensitivity: found.sensitivity,
            uncertainty: found.uncertainty,
            worst: found.worst.map(subject),
            sigma0: test.sigma0,
            p_value: test.p_value,
            findings: Vec::new(),
            converged: found.termination.was_successful(),
            termination: found.termination.name(),
            iterations: found.iterations,
            undetermined: undetermined.collect(),
            components: Vec::new(),
            pose_covariance: None,
            landmark_covariance: None,
            covariance_frame: None,
            certificate: found.certificate.map(RawCertificate::from),
        })
    }
}

/// "view" or "landmark", and its index.
pub fn subject(subject: Subject) -> (&'static str, usize) {
    match subject {
        Subject::View(index) => ("view", index),
        Subject::Landmark(index) => ("landmark", index),
    }
}

type Blocks<'py> = Bound<'py, PyArray3<f64>>;

/// The covariances of poses and landmarks; being symmetric, they are the same by rows and by columns.
fn blocks<'py>(py: Python<'py>, found: &Covariance) -> PyResult<(Blocks<'py>, Blocks<'py>)> {
    let poses = found.poses.iter();
    let poses = poses.map(|block| block.map_or([[f64::NAN; 3]; 3], |b| b.data.0));
    let landmarks = found.landmarks.iter();
    let landmarks = landmarks.map(|block| block.map_or([[f64::NAN; 2]; 2], |b| b.data.0));
    let poses: Vec<f64> = poses.flatten().flatten().collect();
    let landmarks: Vec<f64> = landmarks.flatten().flatten().collect();
    Ok((
        convert::array3(py, &poses, [found.poses.len(), 3, 3])?,
        convert::array3(py, &landmarks, [found.landmarks.len(), 2, 2])?,
    ))
}
