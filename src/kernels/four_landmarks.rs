// SPDX-License-Identifier: MIT OR Apache-2.0
//! Four landmarks from the bearings of four or more views: both solutions in closed form.
//!
//! Symbols as in `docs/theory.md`, section 7: landmarks `x_j` as complex numbers, differences `d_jk = x_j - x_k`,
//! coefficients P, Q, R of the pairs of opposite sides 12|34, 13|42 and 14|23.

use super::triangular::TriangularFactor;
use super::view_triangle::{angle_of_sides, square_root};
use crate::geometry::Bearing;
use crate::scalar::Real;
use nalgebra::{Complex, Point2};

/// The bearings of four landmarks in the frame of one view.
pub(crate) type Quadruple<T> = [Bearing<T>; 4];

/// The pairs of opposite sides, in the order of P, Q, R. With these signs `d d'` sums to zero (Ptolemy).
const OPPOSITE: [[(usize, usize); 2]; 3] =
    [[(0, 1), (2, 3)], [(0, 2), (3, 1)], [(0, 3), (1, 2)]];

/// Rounds of reweighting. One reaches the accuracy of maximum likelihood, the second is for landmarks near a wall.
const REWEIGHTS: usize = 2;

/// Both quadrangles of landmarks that explain the bearings of four or more views modulo pi, each up to a similarity.
///
/// A view of unknown pose leaves one equation, (T17a), linear in the three products of opposite sides
/// `P = d_12 conj(d_34)` and so on: four views determine them up to a real factor. The products `d_12 d_34`, of the
/// same moduli, form a triangle (Ptolemy), which exists in two mirror images, (T17b); each gives the directions of all
/// six sides. The two solutions coincide when the landmarks are on a circle. If noise violates the triangle inequality,
/// both are the nearest such quadrangle.
///
/// `views` is iterated several times; with fewer than four the answer is one of infinitely many. `None` for a bearing
/// that is not finite.
///
/// # Reference
/// K. Åström and M. Oskarsson, "Solutions and ambiguities of the structure and motion problem for 1D retinal vision",
/// JMIV 12(2), 2000: the minimal case of four views, dual to that of three.
pub(crate) fn four_landmarks<T: Real>(
    views: impl Iterator<Item = Quadruple<T>> + Clone,
) -> Option<[[Point2<T>; 4]; 2]> {
    let mut products = opposite_products(views.clone(), |_| T::one());
    for _ in 0..REWEIGHTS {
        products = opposite_products(views.clone(), |row| weight(&products, row));
    }
    let [p, q, r] = products;
    let sides = products.map(|z| z.norm_sqr().sqrt());
    let [lp, lq, lr] = sides;
    if !(lp * lq > T::zero() && (lp + lq + lr).is_finite()) {
        return None;
    }
    let turn = angle_of_sides(lp, lq, lr);
    let both = [turn, turn.conj()].map(|turn| {
        let first = Complex::new(lp, T::zero());
        let second = turn * lq;
        let mut factor = TriangularFactor::<T, 6>::new();
        let corners = [first, second, -(first + second)];
        for ((pair, product), corner) in OPPOSITE.iter().zip([p, q, r]).zip(corners) {
            // d d' times d conj(d') has twice the angle of d, and conj(d) d' in its place twice that of d'.
            let doubles = [corner * product, corner * product.conj()];
            for (&(j, k), double) in pair.iter().zip(doubles) {
                let length = double.norm_sqr().sqrt();
                if length > T::zero() {
                    let direction = square_root(double * (T::one() / length));
                    factor.push(side_row(j, k, direction));
                }
            }
        }
        let null = factor.null_space();
        let [second, third, fourth] =
            [0, 2, 4].map(|k| Point2::new(null.vectors[0][k], null.vectors[0][k + 1]));
        [Point2::origin(), second, third, fourth]
    });
    let finite = |point: &Point2<T>| (point.x + point.y).is_finite();
    both.iter().flatten().all(finite).then_some(both)
}

/// P, Q and R, the null vector of the weighted rows, (T17a), with `Re(P + Q + R) = 0` substituted.
fn opposite_products<T: Real>(
    views: impl Iterator<Item = Quadruple<T>>,
    weight: impl Fn(&[Complex<T>; 3]) -> T,
) -> [Complex<T>; 3] {
    let mut factor = TriangularFactor::<T, 5>::new();
    for view in views {
        let row = frequencies(&view);
        let weight = weight(&row);
        let [e1, e2, e3] = row.map(|z| z * weight);
        factor.push([e1.re - e3.re, -e1.im, e2.re - e3.re, -e2.im, -e3.im]);
    }
    let v = factor.null_space().vectors[0];
    [
        Complex::new(v[0], v[1]),
        Complex::new(v[2], v[3]),
        Complex::new(-v[0] - v[2], v[4]),
    ]
}

/// `e^{i(a_3+a_4-a_1-a_2)}`, `e^{i(a_2+a_4-a_1-a_3)}`, `e^{i(a_2+a_3-a_1-a_4)}`.
fn frequencies<T: Real>(view: &Quadruple<T>) -> [Complex<T>; 3] {
    let [a, b, c, d] = view.map(|bearing| bearing.into_inner());
    let (ad, bc) = (a.conj() * d, b.conj() * c);
    [bc * ad, bc.conj() * ad, a.conj() * b * c * d.conj()]
}

/// One over the standard deviation of the residual of a row for unit noise in the four angles: its derivatives are
/// the four sums of imaginary parts with one sign changed or none.
fn weight<T: Real>(products: &[Complex<T>; 3], row: &[Complex<T>; 3]) -> T {
    let squares = products.iter().zip(row).map(|(z, e)| {
        let im = (*z * *e).im;
        im * im
    });
    let sum = squares.fold(T::zero(), |sum, square| sum + square);
    T::one() / (sum + T::eps()).sqrt()
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
        pairs.map(|(a, b)| (laid * a - b).norm()).fold(0.0, f64::max)
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
