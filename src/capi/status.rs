// SPDX-License-Identifier: MIT OR Apache-2.0
//! The status codes that calls from C return, and a text for each.

use crate::error::Error;
use core::ffi::{CStr, c_int};

/// Result of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BearslamStatus {
    /// Success: all results are written.
    Ok = 0,
    /// A pointer is null.
    NullPointer,
    /// A pointer is not aligned for its type.
    Misaligned,
    /// Fewer views or landmarks than the call needs.
    TooFew,
    /// More views, landmarks or rounds than the call can take.
    TooLarge,
    /// A number is infinite, or NaN where NaN is not allowed.
    NotFinite,
    /// The standard deviation is not positive, or the tolerance is negative.
    NotPositive,
    /// Unknown method.
    UnknownMethod,
    /// The memory is smaller than `bearslam_refine_size` requires.
    MemoryTooSmall,
    /// The data do not determine the answer.
    Degenerate,
    /// The lines of sight intersect behind a view: the rays do not.
    Behind,
    /// The maximum number of iterations was reached before a minimum; all results are written.
    NotConverged,
    /// An error of the library that calls from C should never cause.
    Unexpected,
}

impl BearslamStatus {
    const ALL: [(Self, &CStr); 13] = [
        (Self::Ok, c"success"),
        (Self::NullPointer, c"a pointer is null"),
        (
            Self::Misaligned,
            c"a pointer is not aligned for its type",
        ),
        (
            Self::TooFew,
            c"fewer views or landmarks than the call needs",
        ),
        (
            Self::TooLarge,
            c"more views, landmarks or rounds than the call can take",
        ),
        (
            Self::NotFinite,
            c"a number is infinite, or NaN where NaN is not allowed",
        ),
        (
            Self::NotPositive,
            c"the standard deviation is not positive, or the tolerance is negative",
        ),
        (Self::UnknownMethod, c"unknown method"),
        (
            Self::MemoryTooSmall,
            c"the memory is smaller than bearslam_refine_size requires",
        ),
        (Self::Degenerate, c"the data do not determine the answer"),
        (
            Self::Behind,
            c"the lines of sight intersect behind a view: the rays do not",
        ),
        (
            Self::NotConverged,
            c"the maximum number of iterations was reached before a minimum; all results are written",
        ),
        (
            Self::Unexpected,
            c"an error of the library that calls from C should never cause",
        ),
    ];
}

impl From<Error> for BearslamStatus {
    fn from(error: Error) -> Self {
        match error {
            Error::TooFew { .. } => Self::TooFew,
            Error::TooLarge { .. } | Error::OutOfRange { .. } => Self::TooLarge,
            Error::NotFinite { .. } => Self::NotFinite,
            Error::NotPositive { .. } => Self::NotPositive,
            Error::Degenerate { .. } => Self::Degenerate,
            _ => Self::Unexpected,
        }
    }
}

pub(super) type Found<T> = Result<T, BearslamStatus>;

/// The status of a result.
pub(super) fn status(tried: Found<()>) -> BearslamStatus {
    tried.err().unwrap_or(BearslamStatus::Ok)
}

/// The text of a status by its number.
pub(super) fn text(status: c_int) -> &'static CStr {
    let mut all = BearslamStatus::ALL.iter();
    let known = all.find(|(known, _)| *known as c_int == status);
    known.map_or(c"no such status", |(_, text)| text)
}
