// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tails of the distributions of the tests.

#[cfg(not(feature = "std"))]
use crate::float::Float;
use statrs::function::erf::{erfc, erfc_inv};
use statrs::function::gamma::{checked_gamma_lr, checked_gamma_ur};

/// The probability that a chi-square of so many degrees of freedom exceeds a value; NaN without a degree of freedom.
pub fn upper_tail(square: f64, freedom: f64) -> f64 {
    if square <= 0.0 && freedom > 0.0 {
        return 1.0;
    }
    checked_gamma_ur(0.5 * freedom, 0.5 * square).unwrap_or(f64::NAN)
}

/// The probability that it is below a value.
pub fn lower_tail(square: f64, freedom: f64) -> f64 {
    if square <= 0.0 && freedom > 0.0 {
        return 0.0;
    }
    checked_gamma_lr(0.5 * freedom, 0.5 * square).unwrap_or(f64::NAN)
}

/// The value that a standard normal variable exceeds with a probability.
pub fn normal_exceeded(probability: f64) -> f64 {
    core::f64::consts::SQRT_2 * erfc_inv(2.0 * probability)
}

/// The value that a standard normal variable exceeds, to either side, as rarely as a chi-square its own.
pub fn normal_exceeded_as_rarely(square: f64, freedom: f64) -> f64 {
    let tail = upper_tail(square, freedom);
    // Beyond the numbers that there are, the two differ by less than a hundredth.
    if tail < f64::MIN_POSITIVE {
        square.sqrt()
    } else {
        normal_exceeded(0.5 * tail)
    }
}

/// The mean square of a standard normal variable that is within a bound: 0.9733 for 3.
pub fn truncated_variance(bound: f64) -> f64 {
    let density = (-0.5 * bound * bound).exp() * (2.0 / core::f64::consts::PI).sqrt();
    1.0 - bound * density / (1.0 - erfc(bound * core::f64::consts::FRAC_1_SQRT_2))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of scipy.stats: chi2.sf, chi2.cdf, norm.isf, and the variance of truncnorm.
    #[test]
    fn tails_are_those_of_tables() {
        let close = |found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 1e-10, "{found} {expected}");
        };
        for (square, freedom, upper) in [
            (3.841_458_820_694_128_5, 1.0, 0.05),
            (100.0, 50.0, 3.454_931_382_984_871e-5),
            (1500.0, 1000.0, 1.045_464_038_598_082_5e-22),
            (0.5, 3.0, 0.918_891_411_654_675_8),
        ] {
            close(upper_tail(square, freedom), upper);
        }
        close(lower_tail(20.0, 50.0), 4.694_938_142_679_987e-5);
        close(normal_exceeded(0.0005), 3.290_526_731_491_894_5);
        close(normal_exceeded(1e-9), 5.997_807_015_007_686_5);
        close(normal_exceeded_as_rarely(9.0, 1.0), 3.0);
        close(
            normal_exceeded_as_rarely(16.0, 3.0),
            3.254_984_814_594_930_5,
        );
        for (square, freedom) in [(1400.0, 1.0), (1400.0, 3.0), (1500.0, 3.0), (1e9, 3.0)] {
            let exceeded = normal_exceeded_as_rarely(square, freedom);
            assert!((exceeded / f64::sqrt(square) - 1.0).abs() < 0.01);
        }
        close(truncated_variance(3.0), 0.973_336_924_662_541_5);
        assert_eq!((upper_tail(0.0, 4.0), lower_tail(0.0, 4.0)), (1.0, 0.0));
        assert!(upper_tail(1.0, 0.0).is_nan());
    }
}
