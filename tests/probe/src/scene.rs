// SPDX-License-Identifier: MIT OR Apache-2.0
//! Noisy scenes without an external random generator and without trigonometry.

use bearslam::{Bearing, Pose, Real, Triple, bearing_to};
use nalgebra::{Complex, Isometry2, Point2, Translation2, UnitComplex};

pub const VIEWS: usize = 10;
pub const LANDMARKS: usize = 15;

/// Ten views of fifteen landmarks, all seen.
pub struct Scene<T: Real> {
    pub poses: [Pose<T>; VIEWS],
    pub landmarks: [Point2<T>; LANDMARKS],
    pub bearings: [[Bearing<T>; LANDMARKS]; VIEWS],
    pub triples: [Triple<T>; LANDMARKS],
    /// The landmarks rotated, scaled and shifted, each with an error.
    pub moved: [Point2<T>; LANDMARKS],
}

/// The same scene in both scalar types.
pub struct Scenes {
    pub single: Scene<f32>,
    pub double: Scene<f64>,
}

impl Scenes {
    pub fn new(seed: u64) -> Self {
        Self {
            single: Scene::new(seed),
            double: Scene::new(seed),
        }
    }
}

/// A linear congruential generator.
struct Random(u64);

impl Random {
    /// Uniform in (-1, 1).
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn point<T: Real>(&mut self, size: f64) -> Point2<T> {
        Point2::new(T::lit(size * self.next()), T::lit(size * self.next()))
    }

    /// Turned by up to twice the arctangent of `most`.
    fn turn<T: Real>(&mut self, most: f64) -> UnitComplex<T> {
        let half = Complex::new(T::one(), T::lit(most * self.next()));
        UnitComplex::new_unchecked(half * half * (T::one() / half.norm_sqr()))
    }
}

/// Half a degree of noise: the tangent of half the largest error.
const NOISE: f64 = 0.0076;

impl<T: Real> Scene<T> {
    /// Views in a square of side 6, within the square of the landmarks of side 10.
    fn new(seed: u64) -> Self {
        let mut random = Random(seed);
        for _ in 0..8 {
            random.next();
        }
        let poses: [Pose<T>; VIEWS] = core::array::from_fn(|_| {
            let place = random.point::<T>(3.0);
            Isometry2::from_parts(Translation2::from(place.coords), random.turn(3.0))
        });
        let landmarks: [Point2<T>; LANDMARKS] = core::array::from_fn(|_| random.point(5.0));
        let bearings = poses.map(|pose| {
            landmarks.map(|landmark| {
                let noise = random.turn(NOISE);
                bearing_to(&pose, &landmark).map_or(noise, |bearing| bearing * noise)
            })
        });
        let [first, second, third, ..] = &bearings;
        let mut triples = [[UnitComplex::identity(); 3]; LANDMARKS];
        for (((triple, u), v), w) in triples.iter_mut().zip(first).zip(second).zip(third) {
            *triple = [*u, *v, *w];
        }
        let turn = random.turn::<T>(3.0);
        let moved =
            landmarks.map(|landmark| turn * landmark * T::lit(2.0) + random.point(0.1).coords);
        Self {
            poses,
            landmarks,
            bearings,
            triples,
            moved,
        }
    }
}
