// SPDX-License-Identifier: MIT OR Apache-2.0
//! Planar structure and motion from **bearings alone**.
//!
//! Robots, theodolites, direction finders or 1D cameras measure only the angles at which they see
//! landmarks. This crate estimates all poses and landmarks, up to a similarity of the plane, without
//! odometry and without an initial guess. Odometry and priors can be added.
//!
//! ```
//! use bearslam::{Arena, Layout, Problem, SolveOptions, simulate, solve};
//!
//! let scene = simulate(Layout::Mixed, 4, 9, 0.5_f64.to_radians(), 7, Arena::default())?;
//! let problem = Problem::dense(4, 9, &scene.bearings, 1.0)?;
//! let found = solve(&problem, &SolveOptions::default(), None)?;
//! assert!(found.rms < 1.0_f64.to_radians());
//! # Ok::<(), bearslam::Error>(())
//! ```
//!
//! # Layers
//! Each layer uses only those above it.
//!
//! | module | what | needs |
//! |---|---|---|
//! | `geometry` | bearings, poses, similarities | `core` |
//! | `kernels` | closed forms of fixed size: tensors, motion, triangulation, resection | `core` |
//! | `lm` | non-linear least squares: one loop, one linearised bearing | `core` |
//! | `fixed` | maps in memory of the caller: growth and refinement | `core` |
//! | `problem` | sightings, odometry and priors; poses and landmarks | `alloc` |
//! | `adjustment` | residuals, normal equations, refinement | `alloc` |
//! | `uncertainty` | covariances, sensitivity, weak directions | `alloc` |
//! | `simulate` | random scenes | `alloc` |
//! | `reconstruction` | maps of many views without an initial guess | `alloc` |
//! | `diagnosis` | what is determined, what is not, and why | `alloc` |
//! | `batch` | many problems on all cores | `rayon` |
//! | `sweep` | Monte-Carlo sweeps over random scenes | `rayon` |
//! | `capi` | the C interface | `core`, `capi` |
//! | `python` | the extension module of the Python package | `python` |
//!
//! # Conventions
//! Angles are in radians, counter-clockwise. A pose maps the frame of the view to the map frame; a
//! bearing is measured in the frame of the view from its heading. Code that needs no heap (closed forms
//! and maps of fixed size) is generic over `f32` and `f64`; the rest uses `f64`.
#![no_std]
#![warn(
    clippy::std_instead_of_core,
    clippy::std_instead_of_alloc,
    clippy::alloc_instead_of_core
)]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

#[cfg(feature = "alloc")]
mod adjustment;
#[cfg(feature = "rayon")]
mod batch;
#[cfg(feature = "capi")]
pub mod capi;
#[cfg(feature = "alloc")]
mod diagnosis;
mod error;
#[cfg(feature = "alloc")]
mod fit;
mod fixed;
#[cfg(all(feature = "alloc", not(feature = "std")))]
mod float;
mod geometry;
mod kernels;
mod lm;
#[cfg(feature = "alloc")]
mod problem;
#[cfg(feature = "python")]
mod python;
#[cfg(feature = "alloc")]
mod reconstruction;
mod scalar;
#[cfg(feature = "alloc")]
mod simulate;
#[cfg(feature = "rayon")]
mod sweep;
#[cfg(feature = "alloc")]
mod uncertainty;

#[cfg(feature = "alloc")]
pub use adjustment::{Report, refine_map};
#[cfg(feature = "rayon")]
pub use batch::{solve_batch, three_view_batch};
#[cfg(feature = "alloc")]
pub use diagnosis::{
    Diagnosis, DiagnosisOptions, Finding, Kind, MapOptions, NullDirection, Part, Severity,
    ShapeOptions, VerdictOptions, diagnose, diagnose_with, fit_findings,
};
pub use error::{Degeneracy, Error};
#[cfg(feature = "alloc")]
pub use fit::{
    Alarm, Checked, FitTest, Fix, GlobalTest, Observation, Redundancy, TestOptions, expected_error,
    redundancy, test_fit,
};
pub use fixed::{Branch, FixedMap, Workspace};
pub use geometry::{
    Bearing, Pose, align, bearing_to, is_ahead, pose, signed_angle, transform_pose, xytheta,
};
pub use kernels::{
    CalibratedTensor, Epipoles, Method, Motion, Resection, ThreeView, Triangulation,
    TrifocalTensor, Triple, epipoles, intrinsic_homographies, projective_tensor, real_epipoles,
    resect, three_view, three_view_with_landmarks, triangulate, trifocal_tensor,
};
pub use lm::{LOSS_WIDTHS, Loss, Observer, Outcome, RefineOptions, Termination};
#[cfg(feature = "alloc")]
pub use problem::{
    DATA_MAGNITUDES, IndexedSighting, LandmarkPrior, Map, Noise, Odometry, PosePrior, Problem,
    SIGMA_MAGNITUDES, Sighting, Subject, Undetermined, Why,
};
#[cfg(feature = "alloc")]
pub use reconstruction::{
    AveragingOptions, DrawOptions, HeadingOptions, HypothesisOptions, IdentityOptions,
    IncrementalOptions, InfinityOptions, JudgeOptions, MinimaOptions, MoveOptions,
    OdometryGrowthOptions, OdometrySweepOptions, PositionOptions, PosteriorOptions,
    RegrowthOptions, RelativeHeadingOptions, RobustGrowthOptions, RobustOptions, SightOptions,
    StageOptions, StrideOptions, VerifyOptions,
};
#[cfg(feature = "alloc")]
pub use reconstruction::{
    Certificate, LabelChange, Progress, Reconstruction, SearchOptions, SolveOptions, Strategy,
    Verdict, initialize, refine, relabel, solve,
};
pub use scalar::Real;
#[cfg(feature = "alloc")]
pub use simulate::{Arena, Bound, Errors, Layout, Outliers, Scene, simulate};
#[cfg(feature = "rayon")]
pub use sweep::{
    BINS_PER_OCTAVE, Cell, Chunk, Histogram, Quantity, Start, SweepTrial, Tally, TrialOutcome,
    sweep,
};
#[cfg(feature = "alloc")]
pub use uncertainty::{Covariance, Frame, covariance};

/// Runs the examples of the README as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
