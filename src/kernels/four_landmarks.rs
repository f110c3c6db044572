// SPDX-License-Identifier: MIT OR Apache-2.0
//! Four landmarks from the bearings of four or more views: the dual of the calibrated tensor.
//!
//! Symbols as in `docs/theory.md`, section 7: landmarks `x_j` as complex numbers, differences `d_jk = x_j - x_k`,
//! coefficients P, Q, R of the pairs of opposite sides 12|34, 13|42 and 14|23.

use super::triangular::TriangularFactor;
use super::view_triangle::{angle_of_sides, square_root};
use crate::geometry::Bearing;
use crate::scalar::Real;
use nalgebra::{Complex, Point2, SVector};

/// The bearings of four landmarks in the frame of one view.
pub(crate) type Quadruple<T> = [Bearing<T>; 4];

/// The pairs of opposite sides, in the order of P, Q, R. With these signs the products of opposite sides sum to zero.
const OPPOSITE: [[(usize, usize); 2]; 3] = [[(0, 1), (2, 3)], [(0, 2), (3, 1)], [(0, 3), (1, 2)]];

/// Rounds of reweighting. One reaches the accuracy of maximum likelihood, the second is for landmarks near a wall.
const REWEIGHTS: usize = 2;

/// Weight of a direction that is held: rows have at most one over rounding, most of them about one.
const HELD: f64 = 1e6;

/// The three products `P = d_12 conj(d_34)`, `Q = d_13 conj(d_42)`, `R = d_14 conj(d_23)` of the opposite sides of four
/// landmarks, up to a real factor.
///
/// A view of unknown pose leaves one equation in its bearings, (T17a), which is linear in them and the same as that of
/// one landmark in three views; so four views determine them, as five landmarks determine the tensor of three views.
/// (The fifth equation is `Re(P + Q + R) = 0`.)
///
/// # Reference
/// K. Åström and M. Oskarsson, "Solutions and ambiguities of the structure and motion problem for 1D retinal vision",
/// JMIV 12(2), 2000: the minimal case of four views and its duality with that of three.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DualTensor<T: Real> {
    coefficients: [Complex<T>; 3],
}

impl<T: Real> DualTensor<T> {
    /// That of known landmarks.
    pub fn of_landmarks(points: &[Point2<T>; 4]) -> Self {
        let side = |(j, k): (usize, usize)| {
            let side = points[j] - points[k];
            Complex::new(side.x, side.y)
        };
        Self {
            coefficients: OPPOSITE.map(|[one, other]| side(one) * side(other).conj()),
        }
    }

    /// The singular vectors of the smallest singular values, the smallest first: the tensor that fits the bearings
    /// best, and the directions in which noise moves it most. Each row is over its standard deviation for equal noise in
    /// all bearings. Four views fit the first exactly; fewer, many.
    ///
    /// `views` is iterated several times.
    pub fn weakest(views: impl Iterator<Item = Quadruple<T>> + Clone) -> [Self; 3] {
        let mut factor = factor(views.clone(), |_| T::one());
        for _ in 0..REWEIGHTS {
            let best = Self::from_vector(&factor.null_space().vectors[0]);
            factor = self::factor(views.clone(), |row| best.weight(row));
        }
        let [first, second] = factor.null_space().vectors;
        // With rows that hold these two, the next is the least.
        for held in [first, second] {
            factor.push(core::array::from_fn(|k| held[k] * T::lit(HELD)));
        }
        let [third, _] = factor.null_space().vectors;
        [first, second, third].each_ref().map(Self::from_vector)
    }

    /// From P, Q and the imaginary part of R: the real parts sum to zero.
    fn from_vector(v: &SVector<T, 5>) -> Self {
        Self {
            coefficients: [
                Complex::new(v[0], v[1]),
                Complex::new(v[2], v[3]),
                Complex::new(-v[0] - v[2], v[4]),
            ],
        }
    }

    /// The linear combination of three tensors.
    pub fn combine(tensors: &[Self; 3], factors: [T; 3]) -> Self {
        let [a, b, c] = tensors;
        let [first, second, third] = factors;
        Self {
            coefficients: core::array::from_fn(|k| {
                a.coefficients[k] * first + b.coefficients[k] * second + c.coefficients[k] * third
            }),
        }
    }

    /// Whether any four landmarks have these products: their moduli are the sides of a triangle.
    pub fn is_real(&self) -> bool {
        let [p, q, r] = self.coefficients.map(|z| z.norm_sqr().sqrt());
        p <= q + r && q <= r + p && r <= p + q
    }

    /// Both quadrangles of landmarks that have these products, each up to a similarity.
    ///
    /// The products `d_12 d_34` and so on have the same moduli and sum to zero (Ptolemy): they form a triangle, which
    /// exists in two mirror images, (T17b); each gives the directions of all six sides. Both are the same when the
    /// landmarks are on a circle. If noise violates the triangle inequality, the nearest, a flat triangle, is taken.
    ///
    /// `None` for products that vanish or are not finite.
    pub fn quadrangles(&self) -> Option<[[Point2<T>; 4]; 2]> {
        let [p, q, r] = self.coefficients.map(|z| z.norm_sqr().sqrt());
        if !(p * q > T::zero() && (p + q + r).is_finite()) {
            return None;
        }
        let turn = angle_of_sides(p, q, r);
        let both = [turn, turn.conj()].map(|turn| {
            let (first, second) = (Complex::new(p, T::zero()), turn * q);
            self.quadrangle(&[first, second, -(first + second)])
        });
        let finite = |point: &Point2<T>| (point.x + point.y).is_finite();
        both.iter().flatten().all(finite).then_some(both)
    }

    /// The landmarks whose products of opposite sides are these corners, with the first at the origin.
    fn quadrangle(&self, corners: &[Complex<T>; 3]) -> [Point2<T>; 4] {
        let mut factor = TriangularFactor::<T, 6>::new();
        for ((pair, product), corner) in OPPOSITE.iter().zip(self.coefficients).zip(corners) {
            // d d' times d conj(d') has twice the angle of d, and times its conjugate twice that of d'.
            let doubles = [*corner * product, *corner * product.conj()];
            for (&(j, k), double) in pair.iter().zip(doubles) {
                let length = double.norm_sqr().sqrt();
                if length > T::zero() {
                    let direction = square_root(double * (T::one() / length));
                    factor.push(side_row(j, k, direction));
                }
            }
        }
        let [null, _] = factor.null_space().vectors;
        let [second, third, fourth] = [0, 2, 4].map(|k| Point2::new(null[k], null[k + 1]));
        [Point2::origin(), second, third, fourth]
    }

    /// One over the standard deviation of the residual of a row for unit noise in the four angles, up to a factor: its
    /// derivatives are the sums of the three imaginary parts with one sign changed or none.
    fn weight(&self, row: &[Complex<T>; 3]) -> T {
        let squares = self.coefficients.iter().zip(row).map(|(z, e)| {
            let im = (*z * *e).im;
            im * im
        });
        let sum = squares.fold(T::zero(), |sum, square| sum + square);
        T::one() / (sum + T::eps()).sqrt()
    }
}

/// The triangular factor of the weighted rows, (T17a), with `Re(P + Q + R) = 0` substituted.
fn factor<T: Real>(
    views: impl Iterator<Item = Quadruple<T>>,
    weight: impl Fn(&[Complex<T>; 3]) -> T,
) -> TriangularFactor<T, 5> {
    let mut factor = TriangularFactor::<T, 5>::new();
    for view in views {
        let row = frequencies(&view);
        let weight = weight(&row);
        let [e1, e2, e3] = row.map(|z| z * weight);
        factor.push([e1.re - e3.re, -e1.im, e2.re - e3.re, -e2.im, -e3.im]);
    }
    factor
}

/// `e^{i(a_3+a_4-a_1-a_2)}`, `e^{i(a_2+a_4-a_1-a_3)}`, `e^{i(a_2+a_3-a_1-a_4)}`.
fn frequencies<T: Real>(view: &Quadruple<T>) -> [Complex<T>; 3] {
    let [a, b, c, d] = view.map(|bearing| bearing.into_inner());
    let (ad, bc) = (a.conj() * d, b.conj() * c);
    [bc * ad, bc.conj() * ad, a.conj() * b * c * d.conj()]
}

/// The equation that landmarks j and k lie in this direction from each other, the first at the origin.
fn side_row<T: Real>(j: usize, k: usize, direction: Complex<T>) -> [T; 6] {
    let mut row = [T::zero(); 6];
    for (landmark, sign) in [(j, T::one()), (k, -T::one())] {
        if landmark > 0 {
            row[2 * landmark - 2] = -direction.im * sign;
            row[2 * landmark - 1] = direction.re * sign;
        }
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{align, bearing_to, pose};

    extern crate alloc;
    use alloc::vec::Vec;

    /// Pseudo-random numbers in (-1, 1).
    fn number(seed: usize) -> f64 {
        ((seed as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(2.0) - 1.0
    }

    /// The largest distance of corresponding points of two quadrangles that are laid on each other.
    fn apart(one: &[Point2<f64>; 4], other: &[Point2<f64>; 4]) -> f64 {
        let laid = align(one, other).unwrap();
        let pairs = one.iter().zip(other);
        pairs
            .map(|(a, b)| (laid * a - b).norm())
            .fold(0.0, f64::max)
    }

    fn scene(seed: usize, views: usize) -> ([Point2<f64>; 4], Vec<Quadruple<f64>>) {
        let at = 100 * seed;
        let points = [0, 1, 2, 3].map(|k| Point2::new(number(at + k), number(at + k + 4)));
        let quadruple = |view: usize| {
            let [x, y, heading] = [0, 1, 2].map(|k| number(at + 10 + 3 * view + k));
            let place = pose(2.0 * x, 2.0 * y, 3.0 * heading);
            points.map(|point| bearing_to(&place, &point).unwrap())
        };
        (points, (0..views).map(quadruple).collect())
    }

    fn four_landmarks(
        views: impl Iterator<Item = Quadruple<f64>> + Clone,
    ) -> Option<[[Point2<f64>; 4]; 2]> {
        DualTensor::weakest(views)[0].quadrangles()
    }

    #[test]
    fn one_solution_is_the_truth_and_the_other_explains_the_bearings() {
        let mut twins = 0;
        for seed in 0..500 {
            let (truth, views) = scene(seed, 4 + seed % 5);
            let both = four_landmarks(views.iter().copied()).unwrap();
            let errors = both.each_ref().map(|found| apart(found, &truth));
            let [near, far] = [errors[0].min(errors[1]), errors[0].max(errors[1])];
            // Rounding times the condition of four views, which is a million for a few of the scenes.
            assert!(near < 1e-7, "{seed}: {errors:?}");
            let twin = &both[usize::from(errors[0] < errors[1])];
            for view in &views {
                let sightings = twin.iter().copied().zip(view.iter().copied());
                if let Ok(found) = super::super::resect(sightings) {
                    assert!(found.misfit < 1e-7, "{seed}: {}", found.misfit);
                }
            }
            twins += usize::from(far > 0.01);
        }
        assert!(twins > 450, "{twins}");
    }

    #[test]
    fn the_solutions_coincide_on_a_circle() {
        for seed in 0..50 {
            let angle = |k: usize| 3.0 * number(40 * seed + k);
            let points = [0, 1, 2, 3].map(|k| Point2::new(angle(k).cos(), angle(k).sin()));
            let views = (0..6).map(|view| {
                let [x, y, heading] = [10, 11, 12].map(|k| number(40 * seed + 3 * view + k));
                let place = pose(3.0 * x, 3.0 * y, heading);
                points.map(|point| bearing_to(&place, &point).unwrap())
            });
            let [one, other] = four_landmarks(views).unwrap();
            // The distance of the two is the root of rounding times the condition.
            assert!(apart(&one, &other) < 1e-3, "{seed}");
        }
    }

    #[test]
    fn a_bearing_that_is_not_finite_gives_nothing() {
        let (_, mut views) = scene(1, 5);
        views[3][2] = Bearing::new_unchecked(Complex::new(f64::NAN, 0.0));
        assert!(four_landmarks(views.into_iter()).is_none());
    }
}
