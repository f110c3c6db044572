// SPDX-License-Identifier: MIT OR Apache-2.0
//! Two numbers that go through the same operations: what fits a vector register.

use crate::scalar::Real;
use core::ops::{Add, Mul, Neg, Sub};
use nalgebra::Complex;

/// Two numbers in step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair<T>(pub [T; 2]);

impl<T: Copy> Pair<T> {
    #[inline(always)]
    pub fn map<U>(self, function: impl Fn(T) -> U) -> Pair<U> {
        let [a, b] = self.0;
        Pair([function(a), function(b)])
    }

    #[inline(always)]
    pub fn zip<U, V>(self, other: Pair<U>, function: impl Fn(T, U) -> V) -> Pair<V> {
        let ([a, b], [c, d]) = (self.0, other.0);
        Pair([function(a, c), function(b, d)])
    }
}

impl<T: Real> Pair<T> {
    #[inline(always)]
    pub fn sum(self) -> T {
        let [a, b] = self.0;
        a + b
    }
}

impl<T: Real> Add for Pair<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl<T: Real> Sub for Pair<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl<T: Real> Mul for Pair<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl<T: Real> Mul<T> for Pair<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: T) -> Self {
        self.map(|a| a * factor)
    }
}

impl<T: Real> Neg for Pair<T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

/// Two complex numbers in step.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComplexPair<T> {
    pub re: Pair<T>,
    pub im: Pair<T>,
}

impl<T: Real> ComplexPair<T> {
    #[inline(always)]
    pub fn new([a, b]: [Complex<T>; 2]) -> Self {
        Self {
            re: Pair([a.re, b.re]),
            im: Pair([a.im, b.im]),
        }
    }

    #[inline(always)]
    pub fn parts(self) -> [Complex<T>; 2] {
        let (Pair([a, b]), Pair([c, d])) = (self.re, self.im);
        [Complex::new(a, c), Complex::new(b, d)]
    }

    /// Both times one number.
    #[inline(always)]
    pub fn turned(self, by: Complex<T>) -> Self {
        Self {
            re: self.re * by.re - self.im * by.im,
            im: self.re * by.im + self.im * by.re,
        }
    }

    #[inline(always)]
    pub fn scaled(self, by: Pair<T>) -> Self {
        Self {
            re: self.re * by,
            im: self.im * by,
        }
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Pair<T> {
        self.re * other.im - self.im * other.re
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> Pair<T> {
        self.re * other.re + self.im * other.im
    }
}

impl<T: Real> Add for ComplexPair<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl<T: Real> Sub for ComplexPair<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            re: self.re - other.re,
            im: self.im - other.im,
        }
    }
}
