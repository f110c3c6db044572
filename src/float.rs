// SPDX-License-Identifier: MIT OR Apache-2.0
//! The elementary functions of `f64` where there is no standard library.
//!
//! With `std` they are methods of `f64` itself; without it a file that needs them has
//! `#[cfg(not(feature = "std"))] use crate::float::Float;`, and its code is the same either way.

use nalgebra::{ComplexField, RealField};

macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident($($argument:ident: $type:ty),*) -> $result:ty = $trait:ident;)*) => {
        /// Elementary functions, by the names they have in the standard library.
        pub trait Float: Copy {
            $(fn $name(self, $($argument: $type),*) -> $result;)*
        }

        impl Float for f64 {
            $(
                #[inline]
                fn $name(self, $($argument: $type),*) -> $result {
                    $trait::$name(self, $($argument),*)
                }
            )*
        }
    };
}

functions! {
    sqrt() -> Self = ComplexField;
    exp() -> Self = ComplexField;
    sin() -> Self = ComplexField;
    cos() -> Self = ComplexField;
    sin_cos() -> (Self, Self) = ComplexField;
    atan2(other: Self) -> Self = RealField;
    floor() -> Self = ComplexField;
    ceil() -> Self = ComplexField;
    round() -> Self = ComplexField;
}
