// SPDX-License-Identifier: MIT OR Apache-2.0
//! The scalar type that kernels and fixed maps are generic over.

use nalgebra::RealField;

/// A real number: `f32` or `f64`.
pub trait Real: RealField + Copy {
    /// The nearest value of this type to a constant.
    #[inline]
    fn lit(value: f64) -> Self {
        nalgebra::convert(value)
    }

    /// This value as `f64`, for messages and reports.
    #[inline]
    fn as_f64(self) -> f64 {
        nalgebra::try_convert(self).unwrap_or(f64::NAN)
    }

    /// The distance from 1 to the next larger number.
    #[inline]
    fn eps() -> Self {
        Self::default_epsilon()
    }
}

impl<T: RealField + Copy> Real for T {}
