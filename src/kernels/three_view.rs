// SPDX-License-Identifier: MIT OR Apache-2.0
//! Three views without an initial guess: tensor, motion, signs.

use super::signs::resolve_signs;
use super::{
    CalibratedTensor, Motion, TrifocalTensor, Triple, epipoles, projective, projective_tensor,
};
use crate::error::Error;
use crate::scalar::Real;
use nalgebra::{Complex, Point2};

/// How the trifocal tensor is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Method {
    /// The calibrated tensor: five landmarks, closed form; `reweights` rounds of Sampson weights.
    Calibrated {
        /// Rounds of reweighting; 2 reaches the accuracy of maximum likelihood.
        reweights: usize,
    },
    /// The method of Dellaert and Stroupe (2002): projective tensor from seven landmarks, epipoles.
    Projective,
}

impl Method {
    /// Minimum number of landmarks that the method needs.
    pub fn min_landmarks(self) -> usize {
        match self {
            Self::Calibrated { .. } => super::calibrated::MIN_LANDMARKS,
            Self::Projective => super::projective::MIN_LANDMARKS,
        }
    }
}

/// The two motions that explain the bearings of three views equally well modulo pi.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreeView<T: Real> {
    /// Both motions, the one with fewer inconsistent sightings (then the lower cost) first. They are equal
    /// where noise has merged them.
    pub motions: [Motion<T>; 2],
    /// Whether the height over the longest side of the triangle of views is below 0.02, or noise has left no
    /// triangle at all. The two motions have then nearly merged, and their error grows with the square root
    /// of the noise: refine before use.
    pub near_collinear: bool,
    /// Whether no triangle of views satisfies the data (complex eigenvalues in terms of the paper), so that
    /// the nearest, a flat one, was taken.
    pub flattened: bool,
}

/// Height of the triangle of views over its longest side below which it counts as flat: at one
/// degree of noise the two solutions differ by less than their errors there.
const COLLINEAR_HEIGHT: f64 = 0.02;

/// Poses of three views from the bearings of landmarks that all three see.
///
/// Estimates the trifocal tensor, derives both motions from it and resolves the headings modulo pi by the
/// majority of the signs. Both motions fit the bearings modulo pi. The signs distinguish them nearly
/// always, but not always: check `inconsistent` of both before you discard the second.
///
/// # Errors
/// [`Error::TooFew`] below five ([`Method::Calibrated`]) or seven ([`Method::Projective`]) landmarks;
/// [`Error::NotFinite`] for a bearing that is not finite; [`Error::Degenerate`] when the landmarks do not
/// determine the motion (one wall, one circle through the views) or views coincide.
///
/// # Example
/// ```
/// use bearslam::{Bearing, Method, three_view};
///
/// let views = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.4), (0.3, 0.8, -0.7)];
/// let points = [(2.0, 1.0), (-1.0, 2.0), (0.5, 3.0), (1.5, -2.0), (-2.0, -1.0), (3.0, 0.5)];
/// let triples: Vec<[Bearing<f64>; 3]> = points
///     .iter()
///     .map(|&(x, y)| views.map(|(a, b, t)| Bearing::new(f64::atan2(y - b, x - a) - t)))
///     .collect();
/// let solution = three_view(&triples, Method::Calibrated { reweights: 1 })?;
/// let [_, _, last] = solution.motions[0].poses;
/// assert!((last.translation.y - 0.8).abs() < 1e-12);
/// assert!((last.rotation.angle() + 0.7).abs() < 1e-12);
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn three_view<T: Real>(triples: &[Triple<T>], method: Method) -> Result<ThreeView<T>, Error> {
    three_view_while(triples, method, || true)
}

/// As [`three_view`], with a look before each reweight at whether the caller goes on.
///
/// # Errors
/// [`Error::Interrupted`](crate::Error::Interrupted) when not, in addition to those.
pub(crate) fn three_view_while<T: Real>(
    triples: &[Triple<T>],
    method: Method,
    goes_on: impl FnMut() -> bool,
) -> Result<ThreeView<T>, Error> {
    Ok(estimate(triples, method, |_, _| (), goes_on)?.0)
}

/// As [`three_view`], and the landmarks under both motions, in the order of [`ThreeView::motions`].
///
/// Cheaper than calling [`Motion::landmark`] for each, because resolving the signs computes the same
/// points. `landmarks` is memory of the caller, one entry for each triple; a landmark is `None` where its
/// three rays are parallel. After an error its contents are unspecified.
///
/// # Errors
/// As [`three_view`], and [`Error::LengthMismatch`] for `landmarks` of another length.
///
/// # Example
/// ```
/// use bearslam::{Bearing, Method, three_view_with_landmarks};
///
/// let views = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.4), (0.3, 0.8, -0.7)];
/// let points = [(2.0, 1.0), (-1.0, 2.0), (0.5, 3.0), (1.5, -2.0), (-2.0, -1.0)];
/// let triples = points
///     .map(|(x, y)| views.map(|(a, b, t)| Bearing::new(f64::atan2(y - b, x - a) - t)));
/// let mut landmarks = [[None; 2]; 5];
/// let method = Method::Calibrated { reweights: 0 };
/// let solution = three_view_with_landmarks(&triples, method, &mut landmarks)?;
/// let first = landmarks[0][0].expect("rays that are not parallel");
/// assert!((first.x - 2.0).abs() < 1e-12 && (first.y - 1.0).abs() < 1e-12);
/// assert_eq!(solution.motions[0].inconsistent, 0);
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn three_view_with_landmarks<T: Real>(
    triples: &[Triple<T>],
    method: Method,
    landmarks: &mut [[Option<Point2<T>>; 2]],
) -> Result<ThreeView<T>, Error> {
    if landmarks.len() != triples.len() {
        return Err(Error::LengthMismatch {
            what: "landmarks",
            expected: triples.len(),
            got: landmarks.len(),
        });
    }
    let place = |index: usize, both: [Option<Complex<T>>; 2]| {
        if let Some(place) = landmarks.get_mut(index) {
            *place = both.map(|point| point.map(|point| Point2::new(point.re, point.im)));
        }
    };
    let (found, order, scales) = estimate(triples, method, place, || true)?;
    for both in landmarks {
        for (point, scale) in both.iter_mut().zip(scales) {
            if let Some(point) = point {
                *point *= scale;
            }
        }
        if !order {
            both.reverse();
        }
    }
    Ok(found)
}

/// The solution; whether its motions are in the order in which their landmarks were placed; and the factors
/// for these landmarks, in that order.
#[inline]
fn estimate<T: Real>(
    triples: &[Triple<T>],
    method: Method,
    place: impl FnMut(usize, [Option<Complex<T>>; 2]),
    goes_on: impl FnMut() -> bool,
) -> Result<(ThreeView<T>, bool, [T; 2]), Error> {
    let (lines, flattened) = match method {
        Method::Calibrated { reweights } => {
            let tensor = CalibratedTensor::estimate_while(triples, reweights, goes_on)?;
            (tensor.line_motions()?, tensor.kappa().abs() > T::one())
        }
        Method::Projective => {
            let epipoles = epipoles(&projective_tensor(triples)?)?;
            (
                projective::line_motions(&epipoles)?,
                epipoles.discriminant < T::zero(),
            )
        }
    };
    let oriented = resolve_signs(&lines, triples, place);
    let scales = oriented.map(|oriented| oriented.scale);
    let [first, second] = oriented.map(|oriented| oriented.motion);
    let order = rank(&first) <= rank(&second);
    let motions = if order {
        [first, second]
    } else {
        [second, first]
    };
    let found = ThreeView {
        near_collinear: flattened || height_over_side(&motions[0]) < T::lit(COLLINEAR_HEIGHT),
        motions,
        flattened,
    };
    Ok((found, order, scales))
}

/// The unit-norm trifocal tensor of three views.
///
/// # Errors
/// As [`three_view`].
pub fn trifocal_tensor<T: Real>(
    triples: &[Triple<T>],
    method: Method,
) -> Result<TrifocalTensor<T>, Error> {
    trifocal_tensor_while(triples, method, || true)
}

/// As [`trifocal_tensor`], with a look before each reweight at whether the caller goes on.
///
/// # Errors
/// [`Error::Interrupted`](crate::Error::Interrupted) when not, in addition to those.
pub(crate) fn trifocal_tensor_while<T: Real>(
    triples: &[Triple<T>],
    method: Method,
    goes_on: impl FnMut() -> bool,
) -> Result<TrifocalTensor<T>, Error> {
    match method {
        Method::Calibrated { reweights } => {
            Ok(CalibratedTensor::estimate_while(triples, reweights, goes_on)?.tensor())
        }
        Method::Projective => projective_tensor(triples),
    }
}

fn rank<T: Real>(motion: &Motion<T>) -> (usize, f64) {
    (motion.inconsistent, motion.cost.as_f64())
}

fn height_over_side<T: Real>(motion: &Motion<T>) -> T {
    let [a, b, c] = motion.poses.map(|pose| pose.translation.vector);
    let longest = (b - a)
        .norm_squared()
        .max((c - b).norm_squared())
        .max((a - c).norm_squared());
    (b - a).perp(&(c - a)).abs() / longest
}
