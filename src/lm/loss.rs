// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robust losses on residuals.

use crate::error::{Error, check_option};
use crate::scalar::Real;
use core::ops::RangeInclusive;

/// Widths of a loss \[standard deviations\]. A narrower one takes every residual for an outlier, and its square is lost
/// in rounding; a wider one is the square.
pub const LOSS_WIDTHS: RangeInclusive<f64> = 1e-6..=1e6;

/// What a squared residual over sigma, `s = (r / sigma)^2`, adds to twice the cost.
///
/// It applies to bearings only: odometry and priors always have squared loss.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Loss<T: Real = f64> {
    /// `s`: maximum likelihood under Gaussian noise.
    #[default]
    Squared,
    /// `s` up to `c^2`, `2 c sqrt(s) - c^2` beyond: the influence of outliers is bounded.
    Huber(T),
    /// `c^2 ln(1 + s / c^2)`: the influence of an outlier decreases with its residual.
    Cauchy(T),
    /// `min(s, c^2)`: outliers have no influence.
    Truncated(T),
}

impl<T: Real> Loss<T> {
    /// Standard deviations at which [`Loss::Huber`] keeps 95 % of the efficiency of least squares under
    /// Gaussian noise (Huber 1981).
    pub const HUBER: f64 = 1.345;
    /// The same for [`Loss::Cauchy`] (Holland and Welsch 1977).
    pub const CAUCHY: f64 = 2.385;
    /// Standard deviations beyond which a bearing is an outlier under [`Loss::Truncated`]: this rejects one
    /// good bearing in 370.
    pub const TRUNCATED: f64 = 3.0;

    /// Refuses a width that is not within [`LOSS_WIDTHS`].
    ///
    /// # Errors
    /// [`Error::BadOption`].
    pub fn check(self) -> Result<(), Error> {
        match self {
            Self::Squared => Ok(()),
            Self::Huber(c) | Self::Cauchy(c) | Self::Truncated(c) => {
                check_option("width of the loss", c.as_f64(), &LOSS_WIDTHS)
            }
        }
    }

    /// The loss `rho(s)` and its slope, the weight that the residual has in least squares.
    ///
    /// # Example
    /// ```
    /// use bearslam::Loss;
    /// assert_eq!(Loss::Squared.evaluate(4.0), (4.0, 1.0));
    /// assert_eq!(Loss::Huber(1.0).evaluate(4.0), (3.0, 0.5));
    /// assert_eq!(Loss::Truncated(3.0).evaluate(16.0), (9.0, 0.0));
    /// ```
    #[inline]
    pub fn evaluate(self, square: T) -> (T, T) {
        match self {
            Self::Squared => (square, T::one()),
            Self::Huber(c) => {
                if square <= c * c {
                    (square, T::one())
                } else {
                    let root = square.sqrt();
                    ((root + root - c) * c, c / root)
                }
            }
            Self::Cauchy(c) => {
                let part = square / (c * c);
                (c * c * part.ln_1p(), T::one() / (T::one() + part))
            }
            Self::Truncated(c) => {
                if square <= c * c {
                    (square, T::one())
                } else {
                    (c * c, T::zero())
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_differences() {
        for loss in [
            Loss::<f64>::Squared,
            Loss::Huber(1.345),
            Loss::Cauchy(2.385),
            Loss::Truncated(3.0),
        ] {
            for s in [0.1_f64, 1.0, 1.9, 5.0, 20.0, 400.0] {
                let step = 1e-6 * s;
                let difference =
                    (loss.evaluate(s + step).0 - loss.evaluate(s - step).0) / (2.0 * step);
                let (value, slope) = loss.evaluate(s);
                assert!((difference - slope).abs() < 1e-7, "{loss:?} {s}");
                // No loss exceeds the square, and all agree with it near zero.
                assert!(value <= s && loss.evaluate(1e-9).0 > 0.99e-9);
            }
        }
    }
}
