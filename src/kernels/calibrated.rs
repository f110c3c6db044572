// SPDX-License-Identifier: MIT OR Apache-2.0
//! The trifocal tensor of calibrated bearings, from five landmarks.
//!
//! Symbols as in `docs/theory.md`, section 2: bearings a, b, c as unit complex numbers
//! u, v, w in views 0, 1, 2; coefficients A, B, C.

use super::lanes::{ComplexLanes, Lanes};
use super::null_vector_5x6::null_vector_5x6;
use super::triangular::TriangularFactor;
use super::{TrifocalTensor, Triple, gram};
use crate::error::{Degeneracy, Error};
use crate::scalar::Real;
use nalgebra::{Complex, Vector6};

/// The three complex coefficients of `Re(A u v w* + B u v* w + C u* v w) = 0`, equation (T1).
///
/// Every trilinear relation between three *calibrated* planar views has this form: the frequency
/// `u v w` is absent, which removes two of the eight unknowns of the projective tensor and with them
/// two of its seven landmarks. `|A|`, `|B|`, `|C|` are the distances between views 0 and 1, 2 and 0,
/// 1 and 2, up to one scale.
///
/// # Reference
/// K. Åström and M. Oskarsson, "Solutions and ambiguities of the structure and motion problem for 1D
/// retinal vision", JMIV 12(2), 2000.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibratedTensor<T: Real> {
    /// A, B, C, with `|A|^2 + |B|^2 + |C|^2 = 1`.
    pub coefficients: [Complex<T>; 3],
    /// The two smallest singular values of the (weighted) linear system, the smallest first. If the
    /// second is no larger than noise explains, the landmarks do not determine the motion. After
    /// reweighting the second is an estimate: up to three times too large, and at most a hundredth too
    /// small where the noise moves the tensor by a tenth.
    pub singular_values: [T; 2],
}

/// Minimum number of landmarks that determine the calibrated tensor linearly.
pub(super) const MIN_LANDMARKS: usize = 5;

impl<T: Real> CalibratedTensor<T> {
    /// Estimates the tensor from the bearings of `n >= 5` landmarks.
    ///
    /// It is the null vector of a matrix with one row per landmark. With `reweights > 0` the rows are
    /// divided by their standard deviations for equal noise in all bearings at the current estimate
    /// (Sampson weights, (T4)) and the vector is recomputed, that many times. One or two reach the accuracy
    /// of maximum likelihood.
    ///
    /// # Errors
    /// [`Error::TooFew`] for fewer than five landmarks, [`Error::NotFinite`] for a bearing that is not
    /// finite, [`Error::Degenerate`] when the second smallest singular value is only rounding: all landmarks
    /// lie on one cubic curve through the views (a straight wall, a circle through them), or views
    /// coincide.
    pub fn estimate(triples: &[Triple<T>], reweights: usize) -> Result<Self, Error> {
        Self::estimate_while(triples, reweights, || true)
    }

    /// As [`CalibratedTensor::estimate`], with a look before each reweight at whether the caller goes on.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when not, in addition to those.
    pub(crate) fn estimate_while(
        triples: &[Triple<T>],
        reweights: usize,
        mut goes_on: impl FnMut() -> bool,
    ) -> Result<Self, Error> {
        let mut stopped = false;
        let mut goes_on = || {
            stopped = stopped || !goes_on();
            !stopped
        };
        if triples.len() < MIN_LANDMARKS {
            return Err(Error::TooFew {
                what: "landmarks seen by three views",
                needed: MIN_LANDMARKS,
                got: triples.len(),
            });
        }
        let bound = T::eps() * T::lit(64.0) * T::lit(triples.len() as f64).sqrt();
        let tensor = if let [a, b, c, d, e] = triples {
            // Five landmarks are explained exactly whatever their weights.
            let rows = [a, b, c, d, e].map(|triple| real(products(complex(triple))));
            let (vector, second) = null_vector_5x6(&rows);
            Self::from_vector(&vector, [T::zero(), second])
        } else {
            // The Gram matrices are for reweighting only.
            let by_gram = if reweights > 0 {
                Self::by_gram(triples, reweights, &mut goes_on)
            } else {
                None
            };
            match by_gram {
                Some(tensor) => tensor,
                None => Self::by_qr(triples, reweights, bound, &mut goes_on),
            }
        };
        if stopped {
            return Err(Error::Interrupted);
        }
        // A bearing that is not finite makes every coefficient so: only then look for it.
        let [a, b, c] = tensor.coefficients;
        let finite = (a + b + c).norm_sqr().is_finite();
        if tensor.singular_values[1] > bound && finite {
            Ok(tensor)
        } else {
            super::check_finite(triples)?;
            Err(Error::Degenerate {
                kind: Degeneracy::ThreeViewSystem,
                value: tensor.singular_values[1].as_f64(),
                bound: bound.as_f64(),
            })
        }
    }

    /// Two orthonormal tensors that span all tensors of four landmarks, or for more landmarks the two that
    /// fit best.
    pub fn null_pair(triples: &[Triple<T>]) -> [Self; 2] {
        let null = factor(triples, |_| T::one()).null_space();
        let [first, second] = null.vectors;
        [
            Self::from_vector(&first, null.singular_values),
            Self::from_vector(&second, null.singular_values),
        ]
    }

    /// The linear combination of two tensors.
    pub fn combine(pair: &[Self; 2], first: T, second: T) -> Self {
        let [a, b] = pair;
        Self {
            coefficients: core::array::from_fn(|k| {
                a.coefficients[k] * first + b.coefficients[k] * second
            }),
            singular_values: a.singular_values,
        }
    }

    /// The reweighted tensor by triangular factors, for rows of any condition.
    #[inline(never)]
    fn by_qr(
        triples: &[Triple<T>],
        reweights: usize,
        bound: T,
        goes_on: &mut impl FnMut() -> bool,
    ) -> Self {
        let least = |mut factor: TriangularFactor<T, 6>| {
            let null = factor.null_space();
            Self::from_vector(&null.vectors[0], null.singular_values)
        };
        let mut tensor = least(factor(triples, |_| T::one()));
        for _ in 0..reweights {
            if !(tensor.singular_values[1] > bound && goes_on()) {
                break;
            }
            tensor = least(factor(triples, |row| tensor.weight(row)));
        }
        tensor
    }

    /// The same by Gram matrices, with at least one round of reweighting. `None` when the rows are not
    /// well-conditioned.
    #[inline(never)]
    fn by_gram(
        triples: &[Triple<T>],
        reweights: usize,
        goes_on: &mut impl FnMut() -> bool,
    ) -> Option<Self> {
        let mut vector = gram::approximate(&gram::products(triples, |two| row_in_lanes(two)))?;
        let mut singular_values = [T::zero(); 2];
        for _ in 0..reweights {
            if !goes_on() {
                return None;
            }
            let [a, b, c, d, e, f] = vector;
            // The weighted row, and its residual.
            let products = gram::products(triples, |two| {
                let [p, p_im, q, q_im, r, r_im] = row_in_lanes(two);
                let [x, y, z] = [p_im * a - p * b, q_im * c - q * d, r_im * e - r * f];
                let [fa, fb, fc] = [x + y - z, x - y + z, y + z - x];
                let weight = (fa * fa + fb * fb + fc * fc)
                    .map(|variance| T::one() / (variance + T::eps()).sqrt());
                let residual = (p * a + p_im * b) + (q * c + q_im * d) + (r * e + r_im * f);
                [p, p_im, q, q_im, r, r_im, residual].map(|column| column * weight)
            });
            let found = gram::correct(&products, &vector)?;
            (vector, singular_values) = (found.vector, found.singular_values);
        }
        Some(Self::from_vector(&Vector6::from(vector), singular_values))
    }

    /// The row of a landmark in the linear system: its product with the vector of [`CalibratedTensor::of_vector`] is the
    /// left side of (T1).
    #[cfg(feature = "alloc")]
    pub(crate) fn row(triple: &Triple<T>) -> [T; 6] {
        real(products(complex(triple)))
    }

    /// The tensor of a vector of unit norm, without singular values.
    #[cfg(feature = "alloc")]
    pub(crate) fn of_vector(vector: &Vector6<T>) -> Self {
        Self::from_vector(vector, [T::zero(); 2])
    }

    fn from_vector(v: &Vector6<T>, singular_values: [T; 2]) -> Self {
        Self {
            coefficients: [
                Complex::new(v[0], -v[1]),
                Complex::new(v[2], -v[3]),
                Complex::new(v[4], -v[5]),
            ],
            singular_values,
        }
    }

    /// One over the standard deviation of a row's residual for unit noise in the three angles, (T4).
    ///
    /// For a landmark on top of a view the gradient vanishes; its row keeps a bounded weight.
    #[inline]
    fn weight(&self, [p, q, r]: &[Complex<T>; 3]) -> T {
        let [a, b, c] = self.coefficients;
        let (a, b, c) = (imaginary(a, *p), imaginary(b, *q), imaginary(c, *r));
        let (fa, fb, fc) = (a + b - c, a - b + c, b + c - a);
        T::one() / (fa * fa + fb * fb + fc * fc + T::eps()).sqrt()
    }

    /// The square of the residual of one landmark over its standard deviation, to first order (T4), for
    /// the given variances of the three angles \[rad^2\].
    ///
    /// Turning a bearing by pi does not change it.
    pub fn sampson_square(&self, triple: &Triple<T>, variances: &[T; 3]) -> T {
        let row = products(complex(triple));
        let mut value = T::zero();
        let [a, b, c] = core::array::from_fn(|k| {
            let product = self.coefficients[k] * row[k];
            value += product.re;
            product.im
        });
        let [va, vb, vc] = *variances;
        let (fa, fb, fc) = (a + b - c, a - b + c, b + c - a);
        let variance = fa * fa * va + fb * fb * vb + fc * fc * vc;
        // On top of a view both vanish, and the landmark is not an outlier.
        value * value / (variance + T::eps() * T::eps())
    }

    /// The same relation as a 2x2x2 tensor of unit Frobenius norm, (T3).
    pub fn tensor(&self) -> TrifocalTensor<T> {
        let unit = [
            Complex::new(T::one(), T::zero()),
            Complex::new(T::zero(), T::one()),
        ];
        let entries = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                core::array::from_fn(|k| {
                    let (u, v, w) = (unit[i], unit[j], unit[k]);
                    let [p, q, r] = products([u, v, w]);
                    let [a, b, c] = self.coefficients;
                    // The three frequencies are orthogonal: without the factor one half the norm would be 2.
                    (a * p + b * q + c * r).re * T::lit(0.5)
                })
            })
        });
        TrifocalTensor { entries }
    }
}

/// The triangular factor of the rows, each times its weight.
fn factor<T: Real>(
    triples: &[Triple<T>],
    weight: impl Fn(&[Complex<T>; 3]) -> T,
) -> TriangularFactor<T, 6> {
    let mut factor = TriangularFactor::<T, 6>::new();
    for triple in triples {
        let row = products(complex(triple));
        let weight = weight(&row);
        factor.push(real(row.map(|z| z * weight)));
    }
    factor
}

/// [`real`] of [`products`] for two landmarks, one in each lane.
#[inline(always)]
fn row_in_lanes<T: Real>([u, v, w]: [ComplexLanes<T>; 3]) -> [Lanes<T>; 6] {
    let [a, b, c, d] = [u.re * v.re, u.im * v.im, u.re * v.im, u.im * v.re];
    let (sum_re, sum_im, re, im) = (a - b, c + d, a + b, d - c);
    let [a, b, c, d] = [re * w.re, im * w.im, re * w.im, im * w.re];
    [
        sum_re * w.re + sum_im * w.im,
        sum_im * w.re - sum_re * w.im,
        a - b,
        c + d,
        a + b,
        c - d,
    ]
}

/// The row `[Re p, Im p, Re q, Im q, Re r, Im r]`.
#[inline]
fn real<T: Real>([p, q, r]: [Complex<T>; 3]) -> [T; 6] {
    [p.re, p.im, q.re, q.im, r.re, r.im]
}

#[inline]
fn complex<T: Real>(triple: &Triple<T>) -> [Complex<T>; 3] {
    triple.map(|bearing| bearing.into_inner())
}

/// `e^{i(a+b-c)}`, `e^{i(a-b+c)}`, `e^{i(-a+b+c)}`.
#[inline]
fn products<T: Real>([u, v, w]: [Complex<T>; 3]) -> [Complex<T>; 3] {
    let sum = u * v;
    let difference = u * v.conj();
    [sum * w.conj(), difference * w, difference.conj() * w]
}

/// The imaginary part of a product.
#[inline]
fn imaginary<T: Real>(a: Complex<T>, b: Complex<T>) -> T {
    a.re * b.im + a.im * b.re
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{bearing_to, pose};
    use nalgebra::{OMatrix, Point2, U6, UnitComplex, dimension::Dyn};

    extern crate alloc;
    use alloc::vec::Vec;

    /// Pseudo-random numbers in (-1, 1).
    fn number(seed: usize) -> f64 {
        ((seed as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(2.0) - 1.0
    }

    /// Bearings of landmarks on both sides of three views, with errors up to `noise`; a small `flat` moves the
    /// landmarks close to a line.
    fn scene(seed: usize, count: usize, noise: f64, flat: f64) -> Vec<Triple<f64>> {
        let seed = 1000 * seed;
        let views: [_; 3] = core::array::from_fn(|k| {
            let [x, y, heading] = [0, 1, 2].map(|i| number(seed + 3 * k + i));
            pose(x, y, 3.0 * heading)
        });
        let landmark = |j: usize| {
            let at = seed + 9 + 5 * j;
            let point = Point2::new(3.0 * number(at), 2.0 + flat * 4.0 * number(at + 1));
            core::array::from_fn(|k| {
                let error = UnitComplex::new(noise * number(at + 2 + k));
                error * bearing_to(&views[k], &point).unwrap()
            })
        };
        (0..count).map(landmark).collect()
    }

    /// The reweighted tensor and both singular values, by a QR decomposition of all rows and
    /// converged inverse iteration.
    fn plain(triples: &[Triple<f64>], reweights: usize) -> CalibratedTensor<f64> {
        let mut tensor = None::<CalibratedTensor<f64>>;
        for _ in 0..=reweights {
            let rows: Vec<_> = triples
                .iter()
                .map(|triple| {
                    let row = products(complex(triple));
                    let weight = tensor.map_or(1.0, |tensor| tensor.weight(&row));
                    nalgebra::RowVector6::from(real(row)) * weight
                })
                .collect();
            let factor = OMatrix::<f64, Dyn, U6>::from_rows(&rows).qr().r();
            let mut factor = factor.fixed_rows::<6>(0).into_owned();
            // Any small number will do for a vanishing pivot.
            if factor[(5, 5)].abs() < 1e-30 {
                factor[(5, 5)] = 1e-30;
            }
            let values = factor.singular_values();
            let mut order = [0, 1, 2, 3, 4, 5];
            order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
            let mut vector = Vector6::from_element(1.0);
            // For a singular factor there is no next vector, or it is not finite.
            for _ in 0..60 {
                let half = factor.tr_solve_upper_triangular(&vector);
                let next = half.and_then(|half| factor.solve_upper_triangular(&half.normalize()));
                let next = next.map(|next| next.normalize());
                vector = next.filter(|next| next.sum().is_finite()).unwrap_or(vector);
            }
            tensor = Some(CalibratedTensor::from_vector(
                &vector,
                [values[order[0]], values[order[1]]],
            ));
        }
        tensor.unwrap()
    }

    /// The distance between two tensors of unit norm, up to sign.
    fn apart(a: &CalibratedTensor<f64>, b: &CalibratedTensor<f64>) -> f64 {
        let [less, more] = [1.0, -1.0].map(|sign| {
            let both = a.coefficients.iter().zip(&b.coefficients);
            both.map(|(a, b)| (a - b * sign).norm_sqr()).sum::<f64>()
        });
        less.min(more).sqrt()
    }

    #[test]
    fn gram_matrices_give_the_tensor_of_full_decompositions() {
        let mut answered = 0;
        for seed in 0..400 {
            let noise = [0.0, 1e-6, 2e-3, 2e-2][seed % 4];
            let (count, reweights) = ([6, 7, 15, 16, 40][seed % 5], 1 + seed / 20 % 2);
            let triples = scene(seed, count, noise, 1.0);
            let Some(by_gram) = CalibratedTensor::by_gram(&triples, reweights, &mut || true) else {
                continue;
            };
            answered += 1;
            let expected = plain(&triples, reweights);
            // The error of the tensor due to noise.
            let exact = plain(&scene(seed, count, 0.0, 1.0), reweights);
            let error = apart(&expected, &exact);
            // Rounding times the condition, and 1e-10 of the error due to noise.
            let [smallest, next] = expected.singular_values;
            let bound = 1e-14 / next.min(1.0) + 1e-10 * error;
            let distance = apart(&by_gram, &expected);
            assert!(distance < bound, "{seed}: {distance:e} {bound:e}");
            let [first, second] = by_gram.singular_values;
            assert!((first - smallest).abs() < 1e-8 * smallest + 1e-13, "{seed}");
            assert!(second > next * 0.98, "{seed}: {second} {next}");
            assert!(second < next * 3.0, "{seed}: {second} {next}");
        }
        assert!(answered > 350, "{answered}");
    }

    #[test]
    fn gram_matrices_give_no_answer_that_lacks_digits() {
        for seed in 0..100 {
            // Landmarks on a wall, or almost: 1e-4 off it costs f64 eight digits of sixteen.
            for flat in [0.0, 1e-7, 1e-4] {
                let triples = scene(seed, 15, 0.0, flat);
                assert!(
                    CalibratedTensor::by_gram(&triples, 1, &mut || true).is_none(),
                    "{seed} {flat}"
                );
            }
            let mut triples = scene(seed, 15, 1e-3, 1.0);
            triples[seed % 15][seed % 3] = UnitComplex::new_unchecked(Complex::new(f64::NAN, 0.0));
            assert!(
                CalibratedTensor::by_gram(&triples, 1, &mut || true).is_none(),
                "{seed}"
            );
        }
    }
}
