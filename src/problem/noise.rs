// SPDX-License-Identifier: MIT OR Apache-2.0
//! The uncertainty of odometry and priors, and the weight that follows from it.

use super::magnitudes::check_sigma;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;

/// The uncertainty of several numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise<const N: usize> {
    /// Independent standard deviations, above zero.
    Sigmas([f64; N]),
    /// A covariance, symmetric and positive definite.
    Covariance([[f64; N]; N]),
}

/// Largest difference between two entries of a covariance that should be equal, relative to the largest entry:
/// files have six digits or more.
const ASYMMETRY: f64 = 1e-5;

impl<const N: usize> Noise<N> {
    /// The square root of the information: a lower triangle `W` with `W^T W` the inverse of the covariance.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for a standard deviation or a pivot of the covariance that is not positive,
    /// [`Error::Magnitude`] for a standard deviation out of range; [`Error::NotFinite`] for a covariance that is not;
    /// [`Error::NotSymmetric`].
    pub(crate) fn root(&self, what: &'static str, index: usize) -> Result<[[f64; N]; N], Error> {
        let mut root = [[0.0; N]; N];
        match self {
            Self::Sigmas(sigmas) => {
                for (k, &sigma) in sigmas.iter().enumerate() {
                    let unknown = sigma == 1.0 / 0.0;
                    if !unknown {
                        check_sigma(what, index, sigma)?;
                    }
                    root[k][k] = 1.0 / sigma;
                }
            }
            Self::Covariance(covariance) => {
                let entries = covariance.as_flattened();
                if entries.iter().any(|entry| !entry.is_finite()) {
                    return Err(Error::NotFinite { what, index });
                }
                for k in 0..N {
                    let variance = covariance[k][k];
                    check_sigma(what, index, variance.abs().sqrt().copysign(variance))?;
                }
                let size = entries.iter().fold(0.0_f64, |size, e| size.max(e.abs()));
                // The Cholesky factor L, and its inverse row by row.
                let mut factor = [[0.0; N]; N];
                for i in 0..N {
                    for j in 0..=i {
                        if (covariance[i][j] - covariance[j][i]).abs() > size * ASYMMETRY {
                            return Err(Error::NotSymmetric { what, index });
                        }
                        let mut sum = covariance[i][j];
                        for k in 0..j {
                            sum -= factor[i][k] * factor[j][k];
                        }
                        if i > j {
                            factor[i][j] = sum / factor[j][j];
                        } else if sum > 0.0 {
                            factor[i][i] = sum.sqrt();
                        } else {
                            return Err(Error::NotPositive {
                                what,
                                index,
                                value: sum,
                            });
                        }
                    }
                    for j in 0..=i {
                        let mut sum = if i == j { 1.0 } else { 0.0 };
                        for k in j..i {
                            sum -= factor[i][k] * root[k][j];
                        }
                        root[i][j] = sum / factor[i][i];
                    }
                }
            }
        }
        Ok(root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    fn covariance() -> [[f64; 3]; 3] {
        [[0.04, 0.01, 0.0], [0.01, 0.09, 0.002], [0.0, 0.002, 0.01]]
    }

    #[test]
    fn root_of_information_inverts_the_covariance() {
        let root = Noise::Covariance(covariance()).root("odometry", 0).unwrap();
        let root = Matrix3::from_fn(|i, j| root[i][j]);
        let product = root.transpose() * root * Matrix3::from_fn(|i, j| covariance()[i][j]);
        assert!((product - Matrix3::identity()).norm() < 1e-13);
        let sigmas = Noise::Sigmas([2.0, f64::INFINITY, 0.5]).root("pose", 0);
        assert_eq!(
            sigmas.unwrap(),
            [[0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]
        );
        for bad in [
            Noise::Sigmas([1.0, 0.0]),
            Noise::Sigmas([1.0, f64::NAN]),
            Noise::Sigmas([-1.0, 1.0]),
            Noise::Covariance([[1.0, 2.0], [2.0, 1.0]]),
            Noise::Covariance([[1.0, 0.5], [0.1, 1.0]]),
            Noise::Covariance([[1.0, f64::NAN], [f64::NAN, 1.0]]),
            Noise::Covariance([[-1.0, 0.0], [0.0, 1.0]]),
        ] {
            assert!(bad.root("landmark", 3).is_err(), "{bad:?}");
        }
    }
}
