// SPDX-License-Identifier: MIT OR Apache-2.0
//! The three-view method of Dellaert and Stroupe: projective tensor, homographies, epipoles, motion.
//!
//! Symbols as in their paper, ICRA 2002, section 3: T, K, L, M, e_ij (the bearing at which view i sees
//! view j). The scanned paper has lost minus signs in K and L; they are restored here.

use super::signs::LineMotion;
use super::triangular::TriangularFactor;
use super::{TrifocalTensor, Triple};
use crate::error::{Degeneracy, Error};
use crate::scalar::Real;
use nalgebra::{Complex, Matrix2, Vector2};

/// Minimum number of landmarks that determine the projective tensor linearly.
pub(super) const MIN_LANDMARKS: usize = 7;

/// Estimates the 2x2x2 tensor from the bearings of `n >= 7` landmarks, as in the paper.
///
/// The smallest right singular vector of the `n x 8` matrix with one row `u (x) v (x) w` per
/// landmark (section 3.1).
///
/// # Errors
/// [`Error::TooFew`] for fewer than seven landmarks, [`Error::NotFinite`] for a bearing that is not
/// finite, [`Error::Degenerate`] when the second smallest singular value is only rounding.
pub fn projective_tensor<T: Real>(triples: &[Triple<T>]) -> Result<TrifocalTensor<T>, Error> {
    if triples.len() < MIN_LANDMARKS {
        return Err(Error::TooFew {
            what: "landmarks seen by three views (method projective)",
            needed: MIN_LANDMARKS,
            got: triples.len(),
        });
    }
    super::check_finite(triples)?;
    let mut factor = TriangularFactor::<T, 8>::new();
    for triple in triples {
        let [u, v, w] = triple.map(|b| [b.re, b.im]);
        factor.push(core::array::from_fn(|r| {
            u[r >> 2] * v[(r >> 1) & 1] * w[r & 1]
        }));
    }
    let null = factor.null_space();
    let bound = T::eps() * T::lit(64.0) * T::lit(triples.len() as f64).sqrt();
    if !(null.singular_values[1] > bound) {
        return Err(Error::Degenerate {
            kind: Degeneracy::ProjectiveSystem,
            value: null.singular_values[1].as_f64(),
            bound: bound.as_f64(),
        });
    }
    let v = &null.vectors[0];
    Ok(TrifocalTensor {
        entries: core::array::from_fn(|i| {
            core::array::from_fn(|j| core::array::from_fn(|k| v[4 * i + 2 * j + k]))
        }),
    })
}

/// The two intrinsic homographies from view `from` to view `to`, for any ordered pair of views.
///
/// A bearing of the third view is a line of the plane; a line relates the bearings of its points in
/// the two other views by a homography of the projective line. The pair belongs to the lines
/// `(1, 0)` and `(0, 1)` of the third view: the paper's K and L.
///
/// # Panics
/// When `from` and `to` are equal or beyond 2: an error in the program, not in the data.
pub fn intrinsic_homographies<T: Real>(
    tensor: &TrifocalTensor<T>,
    from: usize,
    to: usize,
) -> [Matrix2<T>; 2] {
    let t = &tensor.entries;
    match (from, to) {
        (0, 1) => homographies(|from, to, line| t[from][to][line]),
        (1, 0) => homographies(|from, to, line| t[to][from][line]),
        (0, 2) => homographies(|from, to, line| t[from][line][to]),
        (2, 0) => homographies(|from, to, line| t[to][line][from]),
        (1, 2) => homographies(|from, to, line| t[line][from][to]),
        (2, 1) => homographies(|from, to, line| t[line][to][from]),
        _ => panic!("two different views of three"),
    }
}

/// From `relation(f, t, line)`, whose sum over the coordinates f and t of two bearings is zero for a point on
/// the line.
#[inline(always)]
fn homographies<T: Real>(relation: impl Fn(usize, usize, usize) -> T) -> [Matrix2<T>; 2] {
    // The bearing t with `f^T relation t = 0` is `relation^T f` turned by a right angle.
    let of = |line| {
        Matrix2::new(
            -relation(0, 1, line),
            -relation(1, 1, line),
            relation(0, 0, line),
            relation(1, 0, line),
        )
    };
    [of(0), of(1)]
}

/// All six epipoles under both assignments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Epipoles<T: Real> {
    /// `directions[k][i][j]` is the unit vector at which view i sees view j under assignment k, up to
    /// sign; NaN for `i == j`.
    pub directions: [[[Vector2<T>; 3]; 3]; 2],
    /// Discriminant of the eigenvalue problem of M for a tensor of unit norm (its hyperdeterminant). If it
    /// is negative, the eigenvalues are complex and no three real views have this tensor; the directions
    /// are then those of the nearest double eigenvalue, which means three collinear views.
    pub discriminant: T,
}

/// The epipoles of three views from their tensor.
///
/// A bearing of view 1 that both homographies K and L to view 2 map to the same bearing points along a
/// baseline. These are the eigenvectors of `M = L^-1 K`, computed here from the pencil `s K - t L`, which
/// needs no inverse. Which of the two points to view 0 is ambiguous: hence two assignments. The other
/// four epipoles are their images under the homographies (section 3.2).
///
/// # Errors
/// [`Error::Degenerate`] when the tensor is zero or not finite, or the pencil vanishes, so that every
/// bearing is an eigenvector, as when views coincide.
pub fn epipoles<T: Real>(tensor: &TrifocalTensor<T>) -> Result<Epipoles<T>, Error> {
    let tensor = tensor.normalized().ok_or(Error::Degenerate {
        kind: Degeneracy::VanishingTensor,
        value: tensor.norm().as_f64(),
        bound: 0.0,
    })?;
    let t = &tensor.entries;
    let [k, l] = homographies(|from, to, line| t[line][from][to]);
    // det(s K - t L) = a s^2 + b s t + c t^2
    let (a, c) = (k.determinant(), l.determinant());
    let b = k.m12 * l.m21 + k.m21 * l.m12 - k.m11 * l.m22 - k.m22 * l.m11;
    let discriminant = b * b - T::lit(4.0) * a * c;
    let size = a.abs().max(b.abs()).max(c.abs());
    let bound = T::eps() * T::lit(64.0);
    if !(size > bound) {
        return Err(Error::Degenerate {
            kind: Degeneracy::VanishingPencil,
            value: size.as_f64(),
            bound: bound.as_f64(),
        });
    }
    let root = discriminant.max(T::zero()).sqrt();
    let half = -(b + if b < T::zero() { -root } else { root }) * T::lit(0.5);
    // Roots (s : t) without cancellation; at a double root at zero or infinity both forms vanish.
    let tiny = size * T::eps();
    let roots = if half.abs() > tiny {
        [(half, a), (c, half)]
    } else if a.abs() > c.abs() {
        [(T::zero(), T::one()); 2]
    } else {
        [(T::one(), T::zero()); 2]
    };
    let [one, other] = roots.map(|(s, t)| null_vector(&(k * s - l * t)));
    let to_last = [k, l];
    let to_first = homographies(|from, to, line| t[to][from][line]);
    let nan = Vector2::repeat(T::zero() / T::zero());
    let directions = [[one, other], [other, one]].map(|[e10, e12]| {
        [
            [nan, image(&to_first, &e10), image(&to_first, &e12)],
            [e10, nan, e12],
            [image(&to_last, &e10), image(&to_last, &e12), nan],
        ]
    });
    Ok(Epipoles {
        directions,
        discriminant,
    })
}

/// The epipoles of three real views.
///
/// # Errors
/// As [`epipoles`], and [`Error::Degenerate`] when the discriminant is negative: noise has destroyed the
/// geometry.
pub fn real_epipoles<T: Real>(tensor: &TrifocalTensor<T>) -> Result<Epipoles<T>, Error> {
    let found = epipoles(tensor)?;
    if found.discriminant < T::zero() {
        return Err(Error::Degenerate {
            kind: Degeneracy::ComplexEpipoles,
            value: found.discriminant.as_f64(),
            bound: 0.0,
        });
    }
    Ok(found)
}

/// Both motions from the epipoles, each modulo pi in every heading (section 3.3).
///
/// # Errors
/// [`Error::Degenerate`] when the third view cannot be placed: the three are collinear, and the two
/// epipoles that should cross are parallel.
pub(super) fn line_motions<T: Real>(epipoles: &Epipoles<T>) -> Result<[LineMotion<T>; 2], Error> {
    let mut result = [LineMotion {
        headings: [Complex::new(T::one(), T::zero()); 2],
        positions: [Complex::new(T::zero(), T::zero()); 2],
    }; 2];
    for (motion, e) in result.iter_mut().zip(&epipoles.directions) {
        let e = e.map(|row| row.map(|v| Complex::new(v.x, v.y)));
        // View i sees j along the same line as j sees i, from the opposite end.
        motion.headings[0] = e[0][1] * e[1][0].conj();
        motion.headings[1] = e[0][2] * e[2][0].conj();
        motion.positions[0] = e[0][1];
        // Third view: where the epipole of view 0 crosses that of view 1.
        let (from0, from1) = (e[0][2], motion.headings[0] * e[1][2]);
        let sine = from0.re * from1.im - from0.im * from1.re;
        let bound = T::eps() * T::lit(64.0);
        if !(sine.abs() > bound) {
            return Err(Error::Degenerate {
                kind: Degeneracy::CollinearViews,
                value: sine.abs().as_f64(),
                bound: bound.as_f64(),
            });
        }
        let start = motion.positions[0];
        let along = (start.re * from1.im - start.im * from1.re) / sine;
        motion.positions[1] = from0 * along;
    }
    Ok(result)
}

/// The unit vector that a (nearly) singular matrix maps (nearly) to zero.
fn null_vector<T: Real>(matrix: &Matrix2<T>) -> Vector2<T> {
    let rows = [matrix.row(0).transpose(), matrix.row(1).transpose()];
    let longer = if rows[0].norm_squared() >= rows[1].norm_squared() {
        rows[0]
    } else {
        rows[1]
    };
    unit(Vector2::new(-longer.y, longer.x))
}

/// The common image of an epipole under both homographies, computed from the longer one.
fn image<T: Real>(homographies: &[Matrix2<T>; 2], epipole: &Vector2<T>) -> Vector2<T> {
    let images = [homographies[0] * epipole, homographies[1] * epipole];
    unit(if images[0].norm_squared() >= images[1].norm_squared() {
        images[0]
    } else {
        images[1]
    })
}

fn unit<T: Real>(vector: Vector2<T>) -> Vector2<T> {
    let norm = vector.norm();
    if norm > T::zero() {
        vector / norm
    } else {
        Vector2::new(T::one(), T::zero())
    }
}
