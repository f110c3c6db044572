// SPDX-License-Identifier: MIT OR Apache-2.0
//! What the linear model predicts of a damped step.

use crate::scalar::Real;

/// Multiples of a damped step by which the model is trusted to lengthen it: the damping falls to a tenth after a good
/// step, so that some four steps on it will be as long.
const FARTHEST: f64 = 1e4;

/// The decrease of the cost that the model predicts for a step, and for going on in its direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction<T: Real> {
    /// The decrease by the step.
    pub gain: T,
    /// What a longer step in the same direction would gain on top. Without damping there is nothing; where the
    /// residuals hardly determine a direction it may be a thousand times the gain.
    pub held_back: T,
}

impl<T: Real> Prediction<T> {
    /// From the model along a step `d`: the decrease per step length that is left at its end, `-d^T (g + H d)`, and its
    /// curvature `d^T H d`.
    #[inline]
    pub fn new(left: T, curvature: T) -> Self {
        let half = T::lit(0.5);
        let farther = if left < curvature * T::lit(FARTHEST) {
            left / curvature
        } else {
            T::lit(FARTHEST)
        };
        Self {
            gain: left + curvature * half,
            held_back: left * farther * half,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cost `g z + h z^2 / 2` of one parameter: the damped step and the rest of the way gain `g^2 / 2h` together.
    #[test]
    fn what_is_held_back_and_the_gain_are_what_is_left_without_damping() {
        let (g, h) = (-3.0_f64, 0.02);
        for damping in [0.0, 1e-3, 0.5, 20.0] {
            let step = -g / (h + damping);
            let found = Prediction::new(-step * (g + h * step), step * h * step);
            let gain = -g * step - h * step * step / 2.0;
            assert!((found.gain / gain - 1.0).abs() < 1e-12, "{damping}");
            let all = (found.gain + found.held_back) * 2.0 * h / (g * g);
            assert!((all - 1.0).abs() < 1e-9, "{damping}: {all}");
        }
    }

    #[test]
    fn a_direction_without_curvature_is_followed_only_so_far() {
        for curvature in [0.0, -1.0, 1e-20] {
            assert_eq!(
                Prediction::new(1e-3, curvature).held_back,
                1e-3 * FARTHEST / 2.0
            );
        }
        assert_eq!(Prediction::new(0.0, 0.0).held_back, 0.0);
    }
}
