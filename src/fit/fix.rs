// SPDX-License-Identifier: MIT OR Apache-2.0
//! How well a landmark is known from given poses, or a pose from given landmarks.

use super::alarm::{TestOptions, is_poor};
use super::distributions::upper_tail;
use crate::error::{Degeneracy, Error};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::{Bearing, Pose};
use crate::lm::{BearingRow, Ray};
use crate::problem::check_sigma;
use nalgebra::{Point2, SMatrix, SVector};

/// The uncertainty of a position fix: a landmark from rays of known poses (`N = 2`), or a pose from bearings of
/// known landmarks (`N = 3`).
///
/// With the residuals `r` (predicted minus measured bearing) and their derivatives `J` by the `N` unknowns, the
/// covariance is `sigma^2 (J^T J)^-1`: that of least squares to first order in the noise, for independent bearings
/// with the standard deviation `sigma` and exact given poses or landmarks. The linear estimates
/// [`triangulate`](crate::triangulate) and [`resect`](crate::resect) have the same covariance, because they divide
/// each row by its range. It holds for the stated `sigma`; multiply it by the square of `sigma0` to scale it to the
/// observed residuals.
///
/// # Example
/// ```
/// use bearslam::{Bearing, Fix, pose, triangulate};
/// let rays = [
///     (pose(0.0, 0.0, 0.0), Bearing::new(45_f64.to_radians())),
///     (pose(2.0, 0.0, 0.0), Bearing::new(135_f64.to_radians())),
/// ];
/// let landmark = triangulate(rays)?.point;
/// let fix = Fix::of_landmark(&landmark, rays, 0.01)?;
/// // Rays at right angles: the range of sqrt(2) times sigma in every direction.
/// assert!((fix.covariance[(0, 0)].sqrt() - 2_f64.sqrt() * 0.01).abs() < 1e-12);
/// assert!(fix.covariance[(0, 1)].abs() < 1e-12);
/// // Two rays always meet: there is no redundancy to check sigma.
/// assert!(fix.sigma0.is_nan());
/// # Ok::<(), bearslam::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix<const N: usize> {
    /// Covariance of `(x, y)` or `(x, y, heading)` in the map frame \[length, rad\].
    pub covariance: SMatrix<f64, N, N>,
    /// Root mean square of the residuals \[rad\].
    pub rms: f64,
    /// Standard deviation of unit weight: root of the sum of `(r / sigma)^2` over the redundancy, the number of
    /// sightings minus `N`. About 1 if `sigma` is right; NaN without redundancy.
    pub sigma0: f64,
    /// Redundancy.
    pub freedom: usize,
    /// The probability that errors of the standard deviation `sigma` leave residuals as large as these (chi-square
    /// test); NaN without redundancy.
    pub p_value: f64,
    /// Standard deviation of the position in its least determined direction as a share of the root-mean-square range,
    /// for residuals of one `sigma`, or as large as they are if that is more. Above about 0.2 the linearisation is
    /// unreliable: rays are nearly parallel, or a view is nearly on one circle with its landmarks, the danger circle,
    /// which noise may hide.
    pub uncertainty: f64,
}

/// Residuals \[rad\], root mean square, above which bearings contradict each other rather than being noisy: twenty degrees,
/// as for [`Error::SigmaTooLarge`].
const CONTRADICTION: f64 = 0.35;

impl Fix<2> {
    /// The fix of a landmark at `point` from rays: known poses, and the bearing measured at each.
    ///
    /// A ray from the position of the landmark itself does not determine anything and is ignored.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for a bad `sigma` \[rad\]; [`Error::NotFinite`] for a landmark, pose or bearing that is
    /// not finite; [`Error::TooFew`] for fewer than two rays; [`Error::Degenerate`] when all are along one line.
    pub fn of_landmark<I>(point: &Point2<f64>, rays: I, sigma: f64) -> Result<Self, Error>
    where
        I: IntoIterator<Item = (Pose<f64>, Bearing<f64>)>,
    {
        let weight = weight(sigma)?;
        let rays = rays.into_iter();
        let rows = rays.filter(|(pose, _)| pose.translation.vector != point.coords);
        let rows = rows.map(|(pose, bearing)| {
            let row = BearingRow::new(&pose, point, &Ray { bearing, weight }, true);
            (row.landmark(), row.residual)
        });
        Self::of_rows(rows, weight, "rays of a landmark", Degeneracy::ParallelRays)
    }
}

impl Fix<3> {
    /// The fix of a view at `pose` from sightings: known landmarks, and the bearing of each.
    ///
    /// A landmark at the position of the view does not determine anything and is ignored.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for a bad `sigma` \[rad\]; [`Error::NotFinite`] for a pose, landmark or bearing that is
    /// not finite; [`Error::TooFew`] for fewer than three landmarks; [`Error::Degenerate`] when they are on one circle
    /// with the view.
    pub fn of_pose<I>(pose: &Pose<f64>, sightings: I, sigma: f64) -> Result<Self, Error>
    where
        I: IntoIterator<Item = (Point2<f64>, Bearing<f64>)>,
    {
        let weight = weight(sigma)?;
        let sightings = sightings.into_iter();
        let rows = sightings.filter(|(point, _)| pose.translation.vector != point.coords);
        let rows = rows.map(|(point, bearing)| {
            let row = BearingRow::new(pose, &point, &Ray { bearing, weight }, true);
            (row.pose(), row.residual)
        });
        let kind = Degeneracy::AmbiguousResection;
        Self::of_rows(rows, weight, "landmarks of a view", kind)
    }
}

/// One over a standard deviation. Its square must be finite and positive as well.
fn weight(sigma: f64) -> Result<f64, Error> {
    check_sigma("sigma", 0, sigma)?;
    Ok(1.0 / sigma)
}

/// The normal equations, scaled to a unit diagonal, are singular when a pivot is not above this: the rounding of
/// their entries.
const SINGULAR: f64 = 64.0 * f64::EPSILON;

impl<const N: usize> Fix<N> {
    /// Whether the residuals are larger than errors of the tolerated multiple of `sigma` would be, as
    /// [`Alarm::PoorFit`](crate::Alarm::PoorFit). Never where no `sigma` is stated, or nothing is redundant.
    pub fn is_poor(&self, options: &TestOptions) -> bool {
        let square = self.sigma0 * self.sigma0 * self.freedom as f64;
        !self.p_value.is_nan() && is_poor(square, self.freedom, options)
    }

    /// Refuses a position that the bearings contradict.
    ///
    /// # Errors
    /// [`Error::Degenerate`] for residuals of more than twenty degrees, root mean square.
    pub fn refuse_contradiction(self) -> Result<Self, Error> {
        if self.rms > CONTRADICTION {
            return Err(Error::Degenerate {
                kind: Degeneracy::ContradictoryBearings,
                value: self.rms,
                bound: CONTRADICTION,
            });
        }
        Ok(self)
    }

    /// From derivatives and residuals, both over sigma.
    fn of_rows(
        rows: impl Iterator<Item = ([f64; N], f64)>,
        weight: f64,
        what: &'static str,
        kind: Degeneracy,
    ) -> Result<Self, Error> {
        let mut information = SMatrix::<f64, N, N>::zeros();
        let (mut squares, mut ranges, mut count) = (0.0, 0.0, 0_usize);
        for (derivative, residual) in rows {
            let row = SVector::from(derivative);
            if !(row.norm_squared() + residual).is_finite() {
                return Err(Error::NotFinite { what, index: count });
            }
            information += row * row.transpose();
            squares += residual * residual;
            // The bearing changes by one over the range with a step across the ray.
            ranges += weight * weight / (row[0] * row[0] + row[1] * row[1]);
            count += 1;
        }
        if count < N {
            return Err(Error::TooFew {
                what,
                needed: N,
                got: count,
            });
        }
        // Lengths and radians have different units: scale each unknown by its own information.
        let unit = information.diagonal().map(|entry| 1.0 / entry.sqrt());
        let scale = SMatrix::from_diagonal(&unit);
        let singular = |value: f64| Error::Degenerate {
            kind,
            value,
            bound: SINGULAR,
        };
        let factor = (scale * information * scale)
            .cholesky()
            .ok_or(singular(0.0))?;
        let root = factor.l_dirty().diagonal().min();
        let pivot = root * root;
        if !(pivot > SINGULAR) {
            return Err(singular(pivot));
        }
        let covariance = scale * factor.inverse() * scale;
        let freedom = count - N;
        let is_stated = weight > 1.0;
        let sigma0 = if freedom > 0 {
            (squares / freedom as f64).sqrt()
        } else {
            f64::NAN
        };
        // The larger eigenvalue of the covariance of the position.
        let (xx, xy, yy) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let largest = mean + (half * half + xy * xy).sqrt();
        Ok(Self {
            covariance,
            rms: (squares / count as f64).sqrt() / weight,
            sigma0,
            freedom,
            p_value: if is_stated && freedom > 0 {
                upper_tail(squares, freedom as f64)
            } else {
                f64::NAN
            },
            uncertainty: (largest * count as f64 / ranges).sqrt()
                * if is_stated { sigma0.max(1.0) } else { sigma0 },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{bearing_to, pose};
    use crate::kernels::{resect, triangulate};
    use alloc::vec::Vec;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const SIGMA: f64 = 0.003;

    /// Bearings, each with its known pose or landmark.
    type Bearings<T> = Vec<(T, Bearing<f64>)>;

    fn rays() -> (Point2<f64>, Bearings<Pose<f64>>) {
        let point = Point2::new(103.0, -48.5);
        let poses = [
            pose(101.0, -50.0, 0.4),
            pose(104.5, -52.0, 2.0),
            pose(99.0, -47.0, -3.0),
            pose(103.5, -46.0, 1.0),
        ];
        let seen = poses.map(|pose| (pose, bearing_to(&pose, &point).unwrap()));
        (point, seen.to_vec())
    }

    fn sightings() -> (Pose<f64>, Bearings<Point2<f64>>) {
        let truth = pose(31.0, 12.0, 2.5);
        let points = [
            Point2::new(33.0, 15.0),
            Point2::new(27.0, 10.0),
            Point2::new(30.0, 18.0),
            Point2::new(35.0, 11.0),
            Point2::new(32.0, 6.0),
        ];
        let seen = points.map(|point| (point, bearing_to(&truth, &point).unwrap()));
        (truth, seen.to_vec())
    }

    fn turned<T: Clone>(seen: &[(T, Bearing<f64>)], k: usize, by: f64) -> Bearings<T> {
        let mut seen = seen.to_vec();
        seen[k].1 *= Bearing::new(by);
        seen
    }

    /// Covariance of an estimate by propagation of the bearing noise, with numerical derivatives of the estimate.
    fn by_differences<T: Clone, const N: usize>(
        seen: &[(T, Bearing<f64>)],
        estimate: impl Fn(&[(T, Bearing<f64>)]) -> SVector<f64, N>,
    ) -> SMatrix<f64, N, N> {
        let step = 1e-5;
        let mut covariance = SMatrix::zeros();
        for k in 0..seen.len() {
            let (up, down) = (turned(seen, k, step), turned(seen, k, -step));
            let slope = (estimate(&up) - estimate(&down)) / (2.0 * step);
            covariance += slope * slope.transpose() * (SIGMA * SIGMA);
        }
        covariance
    }

    fn landmark(seen: &[(Pose<f64>, Bearing<f64>)]) -> SVector<f64, 2> {
        triangulate(seen.iter().copied()).unwrap().point.coords
    }

    fn view(seen: &[(Point2<f64>, Bearing<f64>)]) -> SVector<f64, 3> {
        let found = resect(seen.iter().copied()).unwrap().pose;
        SVector::from([
            found.translation.x,
            found.translation.y,
            found.rotation.angle(),
        ])
    }

    // 1e-6: the error of central differences with a step of 1e-5 rad is its square times the curvature.
    #[test]
    fn covariances_are_those_of_the_linear_estimates() {
        let (point, seen) = rays();
        let fix = Fix::of_landmark(&point, seen.iter().copied(), SIGMA).unwrap();
        let expected = by_differences(&seen, landmark);
        assert!((fix.covariance - expected).norm() < 1e-6 * expected.norm());
        assert!(fix.rms < 1e-12 && fix.sigma0 < 1e-9);

        let (pose, seen) = sightings();
        let fix = Fix::of_pose(&pose, seen.iter().copied(), SIGMA).unwrap();
        let expected = by_differences(&seen, view);
        assert!((fix.covariance - expected).norm() < 1e-6 * expected.norm());
        assert!(fix.rms < 1e-12 && fix.sigma0 < 1e-9);
    }

    /// Over noisy trials the errors have the covariance of the fix, and `sigma0` is 1.
    #[test]
    fn errors_of_noisy_bearings_are_as_predicted() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let (truth, seen) = sightings();
        let exact = view(&seen);
        let predicted = Fix::of_pose(&truth, seen.iter().copied(), SIGMA).unwrap();
        let information = predicted.covariance.try_inverse().unwrap();
        let (trials, mut squares, mut units) = (4000, 0.0, 0.0);
        for _ in 0..trials {
            let mut noisy = seen.clone();
            for (_, bearing) in &mut noisy {
                let error: f64 = StandardNormal.sample(&mut random);
                *bearing *= Bearing::new(error * SIGMA);
            }
            let found = resect(noisy.iter().copied()).unwrap().pose;
            let error = view(&noisy) - exact;
            squares += (error.transpose() * information * error).x / f64::from(trials);
            let fix = Fix::of_pose(&found, noisy, SIGMA).unwrap();
            units += fix.sigma0 * fix.sigma0 / f64::from(trials);
        }
        // Chi-squared of 3 and of 2 degrees of freedom: four standard deviations of the mean of 4000.
        assert!(
            (squares - 3.0).abs() < 4.0 * (6.0_f64 / 4000.0).sqrt(),
            "{squares}"
        );
        assert!(
            (units - 1.0).abs() < 4.0 * (1.0_f64 / 4000.0).sqrt(),
            "{units}"
        );
    }

    #[test]
    fn what_fixes_nothing_is_an_error() {
        let (point, seen) = rays();
        let too_few = Fix::of_landmark(&point, seen[..1].iter().copied(), SIGMA);
        assert!(matches!(
            too_few,
            Err(Error::TooFew {
                needed: 2,
                got: 1,
                ..
            })
        ));
        let at = |x: f64| (pose(x, 0.0, 0.0), Bearing::new(0.0));
        let in_line = Fix::of_landmark(&Point2::new(5.0, 0.0), [at(0.0), at(1.0)], SIGMA);
        assert!(matches!(
            in_line,
            Err(Error::Degenerate {
                kind: Degeneracy::ParallelRays,
                ..
            })
        ));
        // The ray from the landmark itself is ignored.
        let one_left = Fix::of_landmark(&Point2::new(1.0, 0.0), [at(0.0), at(1.0)], SIGMA);
        assert!(matches!(one_left, Err(Error::TooFew { got: 1, .. })));

        let view = pose(-1.0, 0.0, 0.3);
        let on_circle = [0.3_f64, 1.1, 2.6].map(|angle| {
            let point = Point2::new(angle.cos(), angle.sin());
            (point, bearing_to(&view, &point).unwrap())
        });
        assert!(matches!(
            Fix::of_pose(&view, on_circle, SIGMA),
            Err(Error::Degenerate {
                kind: Degeneracy::AmbiguousResection,
                ..
            })
        ));
        for sigma in [0.0, -1.0, f64::NAN] {
            let refused = Fix::of_landmark(&point, seen.iter().copied(), sigma);
            assert!(matches!(refused, Err(Error::NotPositive { .. })), "{sigma}");
        }
        let refused = Fix::of_landmark(&point, seen.iter().copied(), f64::INFINITY);
        assert!(matches!(refused, Err(Error::Magnitude { .. })));
        let lost = Point2::new(f64::NAN, 0.0);
        let refused = Fix::of_landmark(&lost, seen, SIGMA);
        assert!(matches!(refused, Err(Error::NotFinite { .. })));
    }

    /// The test of residuals, and the uncertainty as a share of the range, are those of the covariance and of chi-square.
    #[test]
    fn a_fix_is_tested_and_says_how_uncertain_it_is() {
        let (truth, seen) = sightings();
        let fix = |sigma: f64, seen: &Bearings<Point2<f64>>| {
            let pose = resect(seen.iter().copied()).unwrap().pose;
            Fix::of_pose(&pose, seen.iter().copied(), sigma).unwrap()
        };
        let exact = fix(SIGMA, &seen);
        assert!(exact.p_value > 0.999);
        let position = exact.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let largest = position.symmetric_eigenvalues().max().sqrt();
        let squares = seen
            .iter()
            .map(|(point, _)| (point - truth.translation.vector).coords.norm_squared());
        let range = (squares.sum::<f64>() / 5.0).sqrt();
        assert!((exact.uncertainty * range / largest - 1.0).abs() < 1e-9);
        // Two degrees of freedom: the upper tail is exp(-x / 2).
        let off = fix(SIGMA, &turned(&seen, 2, 4.0 * SIGMA));
        let expected = (-off.sigma0 * off.sigma0).exp();
        assert!((off.p_value / expected - 1.0).abs() < 1e-9);
        assert!((off.uncertainty / exact.uncertainty / off.sigma0 - 1.0).abs() < 0.05);
        assert!(off.refuse_contradiction().is_ok());
        // A probability of one in a thousand, and of one in fifty for errors of 1.5 sigma.
        let options = TestOptions::default();
        assert!(!exact.is_poor(&options) && !off.is_poor(&options));
        assert!(fix(SIGMA, &turned(&seen, 2, 20.0 * SIGMA)).is_poor(&options));
        assert!(!fix(1.0, &turned(&seen, 2, 20.0 * SIGMA)).is_poor(&options));
        // A standard deviation that is not stated is that of the residuals.
        let unstated = fix(1.0, &turned(&seen, 2, 4.0 * SIGMA));
        assert!(unstated.p_value.is_nan());
        assert!((unstated.uncertainty / off.uncertainty - 1.0).abs() < 1e-9);
        // Clockwise bearings fit nowhere.
        let clockwise: Bearings<_> = seen
            .iter()
            .map(|(point, bearing)| (*point, bearing.inverse()))
            .collect();
        let found = fix(SIGMA, &clockwise).refuse_contradiction();
        assert!(
            matches!(
                found,
                Err(Error::Degenerate {
                    kind: Degeneracy::ContradictoryBearings,
                    ..
                })
            ),
            "{found:?}"
        );
    }
}
