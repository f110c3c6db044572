// SPDX-License-Identifier: MIT OR Apache-2.0
//! The magnitudes that numbers may have, so that their powers and quotients stay within the arithmetic.

use crate::error::Error;
use core::ops::RangeInclusive;

/// Magnitudes of what is measured, zero apart. The square of a residual over the least standard deviation is then
/// below 1e180, and its product with the square of a length over another below 1e300.
pub const DATA_MAGNITUDES: RangeInclusive<f64> = 1e-60..=1e60;

/// Magnitudes of standard deviations; those of a covariance are the roots of its diagonal.
pub const SIGMA_MAGNITUDES: RangeInclusive<f64> = 1e-30..=1e30;

/// Refuses a measured number that is not finite, or neither zero nor within [`DATA_MAGNITUDES`].
pub(crate) fn check_data(what: &'static str, index: usize, value: f64) -> Result<(), Error> {
    if !value.is_finite() {
        return Err(Error::NotFinite { what, index });
    }
    if value == 0.0 {
        return Ok(());
    }
    check(what, index, value, &DATA_MAGNITUDES)
}

/// Refuses a coordinate of a map that is not finite or beyond [`DATA_MAGNITUDES`].
///
/// It may be as near to zero as it likes: a refinement whose error is squared in every step ends there.
pub(super) fn check_estimate(what: &'static str, index: usize, value: f64) -> Result<(), Error> {
    let least = *DATA_MAGNITUDES.start();
    let rounded = if value.abs() < least { 0.0 } else { value };
    check_data(what, index, rounded)
}

/// Refuses a standard deviation that is not above zero, or not within [`SIGMA_MAGNITUDES`].
pub(crate) fn check_sigma(what: &'static str, index: usize, value: f64) -> Result<(), Error> {
    if !(value > 0.0) {
        return Err(Error::NotPositive { what, index, value });
    }
    check(what, index, value, &SIGMA_MAGNITUDES)
}

fn check(
    what: &'static str,
    index: usize,
    value: f64,
    magnitudes: &RangeInclusive<f64>,
) -> Result<(), Error> {
    if magnitudes.contains(&value.abs()) {
        return Ok(());
    }
    Err(Error::Magnitude {
        what,
        index,
        value,
        least: *magnitudes.start(),
        most: *magnitudes.end(),
    })
}
