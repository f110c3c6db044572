// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of the input and of the geometry.

mod degeneracy;

pub use degeneracy::Degeneracy;

use core::fmt;
use core::ops::RangeInclusive;

/// Invalid input, or a geometry that does not determine the answer.
///
/// A refinement that does not converge is not an error: it ends with a
/// `Termination` in its report.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// Fewer items than the method needs.
    TooFew {
        /// What there are too few of.
        what: &'static str,
        /// How many the method needs.
        needed: usize,
        /// How many were given.
        got: usize,
    },
    /// Two arguments that belong together have different lengths.
    LengthMismatch {
        /// The argument.
        what: &'static str,
        /// The length required by the other arguments.
        expected: usize,
        /// The length that was given.
        got: usize,
    },
    /// A number that must be finite is not.
    NotFinite {
        /// The argument.
        what: &'static str,
        /// Where in it.
        index: usize,
    },
    /// A number that must be positive is not, or its inverse square over- or underflows.
    NotPositive {
        /// The argument.
        what: &'static str,
        /// Where in it.
        index: usize,
        /// The value that came.
        value: f64,
    },
    /// A number so large or so small that its powers leave the arithmetic.
    Magnitude {
        /// The argument.
        what: &'static str,
        /// Where in it.
        index: usize,
        /// The value that came.
        value: f64,
        /// The least magnitude of a number that is not zero.
        least: f64,
        /// The largest magnitude.
        most: f64,
    },
    /// A covariance that is not symmetric.
    NotSymmetric {
        /// The argument.
        what: &'static str,
        /// Where in it.
        index: usize,
    },
    /// A standard deviation so large that outliers cannot be identified.
    SigmaTooLarge {
        /// The argument.
        what: &'static str,
        /// Where in it.
        index: usize,
        /// The value that came \[rad\].
        value: f64,
        /// The largest usable value \[rad\].
        bound: f64,
    },
    /// An option out of its range.
    BadOption {
        /// The option.
        what: &'static str,
        /// The value that came.
        value: f64,
        /// The least usable value.
        least: f64,
        /// The largest usable value.
        most: f64,
    },
    /// An index is out of range.
    OutOfRange {
        /// The argument.
        what: &'static str,
        /// Where in it.
        index: usize,
        /// The value that came.
        value: usize,
        /// Values must be below this.
        bound: usize,
    },
    /// The same view sees the same landmark twice.
    Duplicate {
        /// The view.
        view: usize,
        /// The landmark.
        landmark: usize,
        /// Position of the first sighting.
        first: usize,
        /// Position of the second sighting.
        second: usize,
    },
    /// A motion from a view to itself.
    SameView {
        /// Where in the odometry.
        index: usize,
        /// The view.
        view: usize,
    },
    /// A problem too large for a method that uses dense matrices.
    TooLarge {
        /// What is too large.
        what: &'static str,
        /// The largest value that can be handled.
        bound: usize,
        /// The value that came.
        got: usize,
    },
    /// The data do not determine the answer.
    Degenerate {
        /// The test that failed.
        kind: Degeneracy,
        /// The value of the tested quantity.
        value: f64,
        /// The bound that it violates.
        bound: f64,
    },
    /// Bearings known only modulo pi, where a method needs oriented ones.
    NeedsOriented {
        /// The method.
        what: &'static str,
    },
    /// A loss other than the squared one, or outliers, where a method needs the squared residuals of all bearings.
    NeedsSquares {
        /// The method.
        what: &'static str,
    },
    /// So many outliers that the inliers may agree by chance. With a share w of m n bearings right the map has
    /// w m n - (3 m + 2 n - 4) degrees of freedom, and needs (1 - w) m n / 4.
    NoConsensus {
        /// Number of inliers.
        inliers: usize,
        /// Number of outliers.
        outliers: usize,
        /// Redundancy: inliers beyond the unknowns of the map.
        freedom: usize,
    },
    /// The normal equations do not fit into memory.
    OutOfMemory,
    /// The caller asked to stop.
    Interrupted,
    /// Threads cannot be created.
    NoThreads,
}

impl Error {
    /// Whether this error ends the whole call rather than one of several attempts: [`Error::Interrupted`] and
    /// [`Error::OutOfMemory`].
    pub const fn stops_all(&self) -> bool {
        matches!(self, Self::Interrupted | Self::OutOfMemory)
    }
}

/// Refuses an option that is not within its range, or NaN.
pub(crate) fn check_option(
    what: &'static str,
    value: f64,
    range: &RangeInclusive<f64>,
) -> Result<(), Error> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Error::BadOption {
        what,
        value,
        least: *range.start(),
        most: *range.end(),
    })
}

/// Below this whole numbers are written as such.
const COUNTS: f64 = 1e6;

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooFew { what, needed, got } => {
                write!(f, "{what}: expected at least {needed}, got {got}")
            }
            Self::LengthMismatch {
                what,
                expected,
                got,
            } => write!(f, "{what}: expected {expected} values, got {got}"),
            Self::NotFinite { what, index } => {
                write!(
                    f,
                    "{what}: expected finite numbers, got NaN or infinity at index {index}"
                )
            }
            Self::NotPositive { what, index, value } => {
                write!(
                    f,
                    "{what}: expected positive numbers, got {value} at index {index}"
                )
            }
            Self::Magnitude {
                what,
                index,
                value,
                least,
                most,
            } => write!(
                f,
                "{what}: expected magnitudes from {least:e} to {most:e}, got {value:e} at index {index}; \
                 choose other units"
            ),
            Self::NotSymmetric { what, index } => {
                write!(
                    f,
                    "{what}: expected symmetric covariances, got an asymmetric one at index {index}"
                )
            }
            Self::SigmaTooLarge {
                what,
                index,
                value,
                bound,
            } => write!(
                f,
                "{what}: outliers can be identified only below {bound} rad, got {value} at index {index}; \
                 give the standard deviation of a bearing in radians"
            ),
            Self::BadOption {
                what,
                value,
                least,
                most,
            } => write!(
                f,
                "{what}: expected a number from {least:e} to {most:e}, got {value:e}"
            ),
            Self::OutOfRange {
                what,
                index,
                value,
                bound,
            } => write!(
                f,
                "{what}: expected indices below {bound}, got {value} at index {index}"
            ),
            Self::Duplicate {
                view,
                landmark,
                first,
                second,
            } => write!(
                f,
                "sightings: expected each view to see a landmark once, got view {view} seeing \
                 landmark {landmark} at index {first} and again at index {second}"
            ),
            Self::SameView { index, view } => write!(
                f,
                "odometry: expected motions between two views, got one from view {view} to itself at \
                 index {index}"
            ),
            Self::TooLarge { what, bound, got } => {
                write!(f, "{what}: expected at most {bound}, got {got}")
            }
            Self::Degenerate { kind, value, bound } => {
                let (quantity, advice) = (kind.quantity(), kind.advice());
                write!(f, "degenerate geometry: {quantity} is ")?;
                let is_count = |value: f64| value % 1.0 == 0.0 && value.abs() < COUNTS;
                if is_count(value) && is_count(bound) {
                    write!(f, "{value}, bound {bound}; {advice}")
                } else {
                    write!(f, "{value:.3e}, bound {bound:.3e}; {advice}")
                }
            }
            Self::NeedsOriented { what } => {
                write!(
                    f,
                    "{what}: expected oriented bearings, got bearings known modulo pi"
                )
            }
            Self::NeedsSquares { what } => write!(
                f,
                "{what}: expected the squared loss without robust, since its bound is one of squared residuals"
            ),
            Self::NoConsensus {
                inliers,
                outliers,
                freedom,
            } if 4 * freedom >= outliers => write!(
                f,
                "no consensus: the best map has {inliers} inliers and {outliers} outliers; check sigma, and add \
                 sightings"
            ),
            Self::NoConsensus {
                inliers,
                outliers,
                freedom,
            } => write!(
                f,
                "no consensus: the best map has {inliers} inliers, {outliers} outliers and only {freedom} degrees of \
                 freedom, which may be chance: it needs one for every four outliers, so at most {} of these {} \
                 bearings may be wrong; check sigma, and add sightings",
                // An outlier less is a degree of freedom more.
                4 * (outliers + freedom) / 5,
                inliers + outliers,
            ),
            Self::OutOfMemory => write!(f, "not enough memory for the normal equations"),
            Self::Interrupted => write!(f, "interrupted by the caller"),
            Self::NoThreads => write!(f, "the system cannot create more threads"),
        }
    }
}

impl core::error::Error for Error {}
