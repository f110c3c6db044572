// SPDX-License-Identifier: MIT OR Apache-2.0
//! Two numbers that go through the same operations, like the lanes of a vector register.

use crate::scalar::Real;
use core::ops::{Add, Mul, Neg, Sub};
use nalgebra::Complex;

/// Two numbers, each in its lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lanes<T>(pub [T; 2]);

impl<T: Copy> Lanes<T> {
    #[inline(always)]
    pub fn map<U>(self, function: impl Fn(T) -> U) -> Lanes<U> {
        let [a, b] = self.0;
        Lanes([function(a), function(b)])
    }

    #[inline(always)]
    pub fn zip<U, V>(self, other: Lanes<U>, function: impl Fn(T, U) -> V) -> Lanes<V> {
        let ([a, b], [c, d]) = (self.0, other.0);
        Lanes([function(a, c), function(b, d)])
    }
}

impl<T: Real> Lanes<T> {
    #[inline(always)]
    pub fn sum(self) -> T {
        let [a, b] = self.0;
        a + b
    }
}

impl<T: Real> Add for Lanes<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl<T: Real> Sub for Lanes<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl<T: Real> Mul for Lanes<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl<T: Real> Mul<T> for Lanes<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: T) -> Self {
        self.map(|a| a * factor)
    }
}

impl<T: Real> Neg for Lanes<T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

/// Two complex numbers, each in its lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComplexLanes<T> {
    pub re: Lanes<T>,
    pub im: Lanes<T>,
}

impl<T: Real> ComplexLanes<T> {
    #[inline(always)]
    pub fn new([a, b]: [Complex<T>; 2]) -> Self {
        Self {
            re: Lanes([a.re, b.re]),
            im: Lanes([a.im, b.im]),
        }
    }

    #[inline(always)]
    pub fn parts(self) -> [Complex<T>; 2] {
        let (Lanes([a, b]), Lanes([c, d])) = (self.re, self.im);
        [Complex::new(a, c), Complex::new(b, d)]
    }

    /// Both multiplied by one number.
    #[inline(always)]
    pub fn turned(self, by: Complex<T>) -> Self {
        Self {
            re: self.re * by.re - self.im * by.im,
            im: self.re * by.im + self.im * by.re,
        }
    }

    #[inline(always)]
    pub fn scaled(self, by: Lanes<T>) -> Self {
        Self {
            re: self.re * by,
            im: self.im * by,
        }
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Lanes<T> {
        self.re * other.im - self.im * other.re
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> Lanes<T> {
        self.re * other.re + self.im * other.im
    }
}

impl<T: Real> Add for ComplexLanes<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl<T: Real> Sub for ComplexLanes<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            re: self.re - other.re,
            im: self.im - other.im,
        }
    }
}
