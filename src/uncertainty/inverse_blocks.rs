// SPDX-License-Identifier: MIT OR Apache-2.0
//! The blocks on the diagonal of the inverse of the normal equations: one for each view and landmark.

use crate::adjustment::normal_equations::Normal;
use crate::error::Error;
use crate::lm::Observer;
use crate::problem::{Prior, Problem, Subject};
use alloc::vec::Vec;
use nalgebra::{DMatrix, SMatrix};

/// Most columns of the inverse that are solved for at a time: several are faster than one, and memory stays small. It
/// decides about time only.
const BATCH: usize = 64;

/// Most numbers of a batch of columns, so that a look at the observer comes several times a second. It decides about
/// time only.
const BATCH_NUMBERS: usize = 1 << 20;

/// Most parameters that stay when the others are eliminated: their inverse is dense and takes 130 megabytes.
const MAX_KEPT: usize = 4096;

/// Share of its entry on the diagonal below which a pivot of an eliminated block is near rounding. The block is then
/// taken from whole columns.
const WEAK_PIVOT: f64 = 1e-8;

/// The blocks of all views, then of all landmarks; needs [`Normal::factorize`].
///
/// # Errors
/// [`Error::Interrupted`] when `observer`, called with the blocks done and their number, says so.
pub fn diagonal_blocks(
    normal: &Normal<'_>,
    problem: &Problem,
    observer: &mut Option<Observer<'_>>,
) -> Result<Vec<DMatrix<f64>>, Error> {
    let (poses, points) = (3 * problem.views(), 2 * problem.landmarks());
    let is_motion = |prior: &Prior| matches!(prior, Prior::Motion { .. });
    if poses <= points && poses <= MAX_KEPT {
        by_views(normal, problem, observer)
    } else if points <= MAX_KEPT && !problem.priors().iter().any(is_motion) {
        by_landmarks(normal, problem, observer)
    } else {
        by_columns(normal, problem, observer)
    }
}

/// A look at the observer, with the blocks done.
pub fn observe(
    observer: &mut Option<Observer<'_>>,
    done: usize,
    total: usize,
) -> Result<(), Error> {
    let goes_on = observer
        .as_mut()
        .is_none_or(|observer| observer(done, total as f64));
    goes_on.then_some(()).ok_or(Error::Interrupted)
}

/// The subjects of a problem, each with its first parameter and the number of its parameters.
fn subjects(problem: &Problem) -> Vec<(Subject, usize, usize)> {
    let views = problem.views();
    let poses = (0..views).map(|view| (Subject::View(view), 3 * view, 3));
    let points = (0..problem.landmarks())
        .map(|landmark| (Subject::Landmark(landmark), 3 * views + 2 * landmark, 2));
    poses.chain(points).collect()
}

/// The blocks from whole columns of the inverse: the plain version, for problems of any kind.
fn by_columns(
    normal: &Normal<'_>,
    problem: &Problem,
    observer: &mut Option<Observer<'_>>,
) -> Result<Vec<DMatrix<f64>>, Error> {
    let subjects = subjects(problem);
    let total = subjects.len();
    let mut found = Vec::with_capacity(total);
    let mut columns = Columns::new(normal.size());
    for batch in subjects.chunks(columns.most / 3) {
        observe(observer, found.len(), total)?;
        let count = batch.iter().map(|(_, _, width)| width).sum();
        let first = batch[0].1;
        columns.solve(normal, first, count);
        for &(_, parameter, width) in batch {
            found.push(columns.block(parameter, parameter - first, width));
        }
    }
    Ok(found)
}

/// Elimination of the landmarks, which no row of the Jacobian ties to each other: linear in their number.
fn by_views(
    normal: &Normal<'_>,
    problem: &Problem,
    observer: &mut Option<Observer<'_>>,
) -> Result<Vec<DMatrix<f64>>, Error> {
    let (views, landmarks) = (problem.views(), problem.landmarks());
    let total = views + landmarks;
    let inverse = inverse_of_kept(normal, 0, 3 * views, (total, 3), observer)?;
    let mut found = blocks_of_kept(&inverse, 3);
    for landmark in 0..landmarks {
        observe(observer, found.len(), total)?;
        let couplings = problem.of_landmark(landmark).iter().map(|&k| {
            let view = problem.sightings()[k].view;
            (3 * view, normal.coupling(k).transpose())
        });
        let own = normal.landmark_block(landmark);
        let parameter = 3 * views + 2 * landmark;
        let block = eliminated_block::<2, 3>(own, couplings, &inverse);
        found.push(block.unwrap_or_else(|| from_columns(normal, parameter, 2)));
    }
    Ok(found)
}

/// Elimination of the views, which without odometry no row of the Jacobian ties to each other.
fn by_landmarks(
    normal: &Normal<'_>,
    problem: &Problem,
    observer: &mut Option<Observer<'_>>,
) -> Result<Vec<DMatrix<f64>>, Error> {
    let (views, landmarks) = (problem.views(), problem.landmarks());
    let total = views + landmarks;
    let inverse = inverse_of_kept(normal, 3 * views, 2 * landmarks, (total, 2), observer)?;
    let mut found = Vec::with_capacity(total);
    for view in 0..views {
        observe(observer, landmarks + found.len(), total)?;
        let range = problem.range_of_view(view);
        let couplings = range.map(|k| {
            let landmark = problem.sightings()[k].landmark;
            (2 * landmark, normal.coupling(k))
        });
        let own = normal.pose_block(view);
        let block = eliminated_block::<3, 2>(own, couplings, &inverse);
        found.push(block.unwrap_or_else(|| from_columns(normal, 3 * view, 3)));
    }
    found.extend(blocks_of_kept(&inverse, 2));
    Ok(found)
}

/// The part of the inverse between the parameters that stay: `count` from `first` on, in blocks of `width`.
fn inverse_of_kept(
    normal: &Normal<'_>,
    first: usize,
    count: usize,
    (total, width): (usize, usize),
    observer: &mut Option<Observer<'_>>,
) -> Result<DMatrix<f64>, Error> {
    let mut inverse = DMatrix::zeros(count, count);
    let mut columns = Columns::new(normal.size());
    for start in (0..count).step_by(columns.most) {
        observe(observer, start / width, total)?;
        let batch = columns.most.min(count - start);
        columns.solve(normal, first + start, batch);
        for column in 0..batch {
            let part = &columns.column(column)[first..first + count];
            inverse.column_mut(start + column).copy_from_slice(part);
        }
    }
    Ok(inverse)
}

fn blocks_of_kept(inverse: &DMatrix<f64>, width: usize) -> Vec<DMatrix<f64>> {
    let starts = (0..inverse.nrows()).step_by(width);
    starts
        .map(|k| inverse.view((k, k), (width, width)).into_owned())
        .collect()
}

/// The block of a subject that has been eliminated: `A^-1 + A^-1 B S B^T A^-1`, (T27a), with its own normal matrix A,
/// its couplings B with subjects that stay (each with their first parameter), and the inverse S of those.
///
/// Both terms are positive, so nothing cancels. `None` when A is all but singular.
fn eliminated_block<const E: usize, const K: usize>(
    own: SMatrix<f64, E, E>,
    couplings: impl Iterator<Item = (usize, SMatrix<f64, E, K>)>,
    inverse: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let factor = own.cholesky()?;
    let pivots = factor.l_dirty().diagonal();
    if (0..E).any(|k| !(pivots[k] * pivots[k] > WEAK_PIVOT * own[(k, k)])) {
        return None;
    }
    let couplings: Vec<_> = couplings
        .map(|(parameter, block)| (parameter, factor.solve(&block)))
        .collect();
    let mut spread = SMatrix::<f64, E, E>::zeros();
    for (place, (a, left)) in couplings.iter().enumerate() {
        // Half of the double sum, without the diagonal: the other half is its transpose.
        let mut sum = SMatrix::<f64, K, E>::zeros();
        for (b, right) in &couplings[..place] {
            sum += inverse.fixed_view::<K, K>(*a, *b) * right.transpose();
        }
        let half = left * sum;
        spread += half + half.transpose();
        spread += left * inverse.fixed_view::<K, K>(*a, *a) * left.transpose();
    }
    let full = factor.inverse() + spread;
    Some(DMatrix::from_fn(E, E, |i, j| full[(i, j)]))
}

/// The block of one subject from whole columns.
fn from_columns(normal: &Normal<'_>, parameter: usize, width: usize) -> DMatrix<f64> {
    let mut columns = Columns::new(normal.size());
    columns.solve(normal, parameter, width);
    columns.block(parameter, 0, width)
}

/// Some consecutive columns of the inverse.
struct Columns {
    size: usize,
    /// Most columns at a time, three at least.
    most: usize,
    entries: Vec<f64>,
}

impl Columns {
    fn new(size: usize) -> Self {
        Self {
            size,
            most: (BATCH_NUMBERS / size.max(1)).clamp(3, BATCH),
            entries: Vec::new(),
        }
    }

    /// Solves for `count` columns from `first` on.
    fn solve(&mut self, normal: &Normal<'_>, first: usize, count: usize) {
        self.entries.clear();
        self.entries.resize(count * self.size, 0.0);
        for column in 0..count {
            self.entries[column * self.size + first + column] = 1.0;
        }
        normal.solve(&mut self.entries);
    }

    fn column(&self, column: usize) -> &[f64] {
        &self.entries[column * self.size..][..self.size]
    }

    /// The rows from `parameter` on of the columns from `column` on.
    fn block(&self, parameter: usize, column: usize, width: usize) -> DMatrix<f64> {
        DMatrix::from_fn(width, width, |i, j| self.column(column + j)[parameter + i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::bundle::{Bundle, Rows};
    use crate::adjustment::gauge::gauge_directions;
    use crate::geometry::pose;
    use crate::lm::Loss;
    use crate::problem::{LandmarkPrior, Map, Noise, Odometry, PosePrior, Sighting};
    use nalgebra::Point2;

    /// Views on a circle around landmarks on a spiral, each of which most views see, at bearings a little off.
    fn scene(views: usize, landmarks: usize) -> (Problem, Map) {
        let map = Map {
            poses: (0..views)
                .map(|k| {
                    let (sin, cos) = (0.7 * k as f64).sin_cos();
                    Some(pose(4.0 * cos, 4.0 * sin, k as f64))
                })
                .collect(),
            landmarks: (0..landmarks)
                .map(|k| {
                    let (sin, cos) = (2.4 * k as f64).sin_cos();
                    let far = 0.3 + 2.0 * k as f64 / landmarks as f64;
                    Some(Point2::new(far * cos, far * sin))
                })
                .collect(),
        };
        let mut sightings = Vec::new();
        for (view, from) in map.poses.iter().flatten().enumerate() {
            for (landmark, to) in map.landmarks.iter().flatten().enumerate() {
                if (view + 3 * landmark) % 7 > 0 {
                    let seen = from.inverse_transform_point(to);
                    sightings.push(Sighting {
                        view,
                        landmark,
                        bearing: seen.y.atan2(seen.x) + 0.01 * (landmark as f64).sin(),
                        sigma: 0.01 + 0.001 * view as f64,
                    });
                }
            }
        }
        let problem = Problem::new(views, landmarks, &sightings).unwrap();
        (problem, map)
    }

    fn check_against_columns(problem: &Problem, map: &Map, fast: bool) {
        let bundle = Bundle::from_map(map);
        let mut rows = Rows::of(problem);
        bundle.linearize(problem, Loss::Squared, &mut rows);
        let mut normal = Normal::new(problem).unwrap();
        normal.assemble(&rows, &gauge_directions(problem, &bundle));
        assert!(normal.factorize(0.0));
        let mut looks = Vec::new();
        let mut look = |done, total: f64| {
            looks.push((done, total));
            true
        };
        let found = diagonal_blocks(&normal, problem, &mut Some(&mut look)).unwrap();
        let expected = by_columns(&normal, problem, &mut None).unwrap();
        assert_eq!(found.len(), problem.views() + problem.landmarks());
        for (k, (a, b)) in found.iter().zip(&expected).enumerate() {
            // Two orders of the same sums, with a condition of about 1e5.
            assert!((a - b).norm() < 1e-9 * b.norm(), "{k}: {a} {b}");
        }
        assert_eq!(found != expected, fast, "the other way than meant");
        let all = found.len();
        assert!(
            looks
                .iter()
                .all(|&look| look.0 <= all && look.1 == all as f64)
        );
        let stopped = diagonal_blocks(&normal, problem, &mut Some(&mut |_, _| false));
        assert_eq!(stopped, Err(Error::Interrupted));
    }

    #[test]
    fn elimination_agrees_with_whole_columns() {
        for (views, landmarks) in [(4, 30), (9, 9), (30, 8)] {
            let (problem, map) = scene(views, landmarks);
            check_against_columns(&problem, &map, true);
            let known = LandmarkPrior {
                landmark: 2,
                position: map.landmarks[2].unwrap(),
                noise: Noise::Covariance([[0.02, 0.01], [0.01, 0.03]]),
            };
            let started = PosePrior {
                view: 1,
                pose: map.poses[1].unwrap(),
                noise: Noise::Sigmas([0.1, f64::INFINITY, 0.02]),
            };
            let problem = problem.with_landmark_priors(&[known]).unwrap();
            let problem = problem.with_pose_priors(&[started]).unwrap();
            check_against_columns(&problem, &map, true);
            let odometry: Vec<Odometry> = (1..views)
                .map(|end| Odometry {
                    start: end - 1,
                    end,
                    delta: map.poses[end - 1]
                        .unwrap()
                        .inv_mul(&map.poses[end].unwrap()),
                    noise: Noise::Sigmas([0.1, 0.1, 0.05]),
                })
                .collect();
            let problem = problem.with_odometry(&odometry).unwrap();
            check_against_columns(&problem, &map, 3 * views <= 2 * landmarks);
        }
    }

    /// The range of a landmark with parallel rays is not determined by them: its own block is singular.
    #[test]
    fn blocks_of_weak_landmarks_are_taken_from_columns() {
        let (problem, mut map) = scene(4, 30);
        map.landmarks[5] = Some(Point2::new(3e5, 1e5));
        check_against_columns(&problem, &map, true);
    }
}
