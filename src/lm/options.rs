// SPDX-License-Identifier: MIT OR Apache-2.0
//! The options of a refinement, and the fixed thresholds of Levenberg-Marquardt.

use super::loss::Loss;
use crate::error::{Error, check_option};
use crate::scalar::Real;

/// Options of a refinement, on the heap or in fixed storage.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RefineOptions<T: Real = f64> {
    /// Maximum number of linear systems to solve, which bounds the time. Good starts converge within ten;
    /// the default of 1000 allows for long valleys, as of joint maps of several robots.
    pub max_iterations: usize,
    /// Initial damping, relative to the diagonal of the normal equations. Zero is Gauss-Newton: full
    /// steps, ending when one does not lower the cost. Not sensitive: the damping adapts to the steps.
    pub damping: T,
    /// The refinement ends when a step, or the next one as predicted from the last two, lowers the cost by
    /// less than this fraction of it. The cost is quadratic around its minimum: 1e-10 of it is 1e-5 of a
    /// standard deviation of the map.
    pub tolerance: T,
    /// Loss of the residuals.
    pub loss: Loss<T>,
}

impl<T: Real> Default for RefineOptions<T> {
    fn default() -> Self {
        Self {
            max_iterations: 1000,
            damping: T::lit(1e-4),
            tolerance: T::lit(1e-10).max(T::eps()),
            loss: Loss::Squared,
        }
    }
}

impl<T: Real> RefineOptions<T> {
    /// Refuses options that are out of range: a damping that is neither zero nor positive and at most 1e8,
    /// a tolerance that is negative or not finite, a width of the loss beyond [`LOSS_WIDTHS`](super::LOSS_WIDTHS).
    ///
    /// # Errors
    /// [`Error::BadOption`].
    pub fn check(&self) -> Result<(), Error> {
        check_option("damping", self.damping.as_f64(), &(0.0..=MAX_DAMPING))?;
        check_option("tolerance", self.tolerance.as_f64(), &(0.0..=f64::MAX))?;
        self.loss.check()
    }
}

/// A step is good when its gain ratio is above this: the model is trusted further. With [`POOR_STEP`] the
/// values of Madsen et al., section 2.4 (Marquardt's ratio).
pub const GOOD_STEP: f64 = 0.75;

/// A step is poor when its gain ratio is below this: it is accepted, and the model is trusted less.
pub const POOR_STEP: f64 = 0.25;

/// Factor of the damping after a good step.
pub const AFTER_GOOD_STEP: f64 = 0.1;

/// Factor of the damping after a poor step; less than [`AFTER_REFUSED_STEP`], because the step has
/// lowered the cost.
pub const AFTER_POOR_STEP: f64 = 4.0;

/// Factor of the damping after a rejected step, which undoes [`AFTER_GOOD_STEP`].
pub const AFTER_REFUSED_STEP: f64 = 10.0;

/// Minimum damping after a rejected step: from a smaller one many steps would be rejected before one is shorter.
pub const MIN_RAISED_DAMPING: f64 = 1e-5;

/// Damping above which a step is negligible: 1e-8 of what a parameter would move on its own. It bounds the option, too:
/// a descent that began above it could not move.
pub const MAX_DAMPING: f64 = 1e8;

/// Damping to which it falls back after it has exceeded [`MAX_DAMPING`]: the default of the option.
pub const RENEWED_DAMPING: f64 = 1e-4;

/// Ratio of successive gains below which the descent converges so fast that the next gain can be predicted,
/// as for a nearly quadratic cost under a good model.
pub const CONVERGING: f64 = 0.05;

/// Damping above which every step is so much shorter than an undamped one that its gain is no sign of a minimum.
pub const LIMITING_DAMPING: f64 = 1e-2;

/// A descent is near its minimum when its last gain was at most this many costs: only then does the ratio of its gains
/// tell how it goes on. From a start that costs a million times as much, gains shrink whatever is left.
pub const NEAR_MINIMUM: f64 = 10.0;

/// A tolerance above this many units of rounding is resolved by the sum of the cost; that of single precision is not.
pub const RESOLVED_EPS: f64 = 16.0;

/// Factor of the remembered rejected damping after a value above it has been chosen: the next steps may need
/// less.
pub const FORGET_REFUSED: f64 = 0.3;

/// Residuals of this many units of rounding \[rad\] count as zero: the few operations of a residual leave as much
/// for an exact map.
pub const ZERO_RESIDUAL_EPS: f64 = 8.0;

/// A pivot of a landmark's or a pose's own block is zero below this many units of rounding of its diagonal: the one
/// or two subtractions that lead to it leave no more. The direction of the pivot then gets no step.
pub const ZERO_PIVOT_EPS: f64 = 4.0;

/// Called once per iteration with the number of iterations and the cost; returning `false` stops the work.
pub type Observer<'a> = &'a mut dyn FnMut(usize, f64) -> bool;
