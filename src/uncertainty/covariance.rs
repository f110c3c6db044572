// SPDX-License-Identifier: MIT OR Apache-2.0
//! Covariances of poses and landmarks, in a stated datum.

use super::frame::{Frame, LIFT, in_frame, inner_constraints, inverse};
use super::inverse_blocks::{diagonal_blocks, observe};
use super::weak_directions::{SINGULAR_EQUATIONS, free_directions};
use crate::adjustment::bundle::{Bundle, Rows};
use crate::adjustment::decompose::symmetric_eigen;
use crate::adjustment::gauge::{FixedByPriors, gauge_directions};
use crate::adjustment::normal_equations::Normal;
use crate::error::{Degeneracy, Error};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::{Loss, Observer};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use nalgebra::{DMatrix, Matrix2, Matrix3};

/// Covariances of the determined poses and landmarks of a map.
///
/// They are those of the estimate for the standard deviations stated by the problem, to first order. A variance
/// is infinite (and its covariances are NaN) when the parameter moves in a free direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariance {
    /// The frame that they refer to.
    pub frame: Frame,
    /// Of each pose (x, y, heading \[rad\]), in the axes of the map.
    pub poses: Vec<Option<Matrix3<f64>>>,
    /// Of each landmark (x, y).
    pub landmarks: Vec<Option<Matrix2<f64>>>,
    /// Number of free directions beyond the gauge.
    pub free: usize,
}

/// Maximum number of free directions beyond the gauge that are sought. A map with more is almost undetermined, and
/// some variances come out finite that should be infinite.
const LOOKED_FOR: usize = 12;

/// Fraction of the largest entry of a free direction below which a parameter does not move in it: above the error of
/// the iteration that finds the direction, below any real move.
const STANDS_STILL: f64 = 1e-6;

/// Negative variances of a block in units of its own standard deviations that rounding cannot explain unless the block is
/// all rounding, as where a direction is all but free: its variances are then infinite.
const ALL_ROUNDING: f64 = 1e-3;

/// Covariances of poses and landmarks of a refined map, (T27).
///
/// The sparse normal equations are factorised with anchors that fix the gauge; an S-transformation brings their
/// inverse, column by column, into the frame. A rank-deficient problem is not an error: parameters that a free
/// direction moves have infinite variance, the others their own.
///
/// # Errors
/// [`Error::BadOption`] for a width of the loss out of its range; [`Error::LengthMismatch`] when the map is not of the problem's size; [`Error::TooFew`] when no view of it is
/// determined; [`Error::Degenerate`] for [`Frame::Priors`] when odometry and priors leave part of the gauge free, or
/// when the normal equations cannot be factorised; [`Error::OutOfMemory`] when they do not fit into memory;
/// [`Error::Interrupted`] when `observer`, called with the number of subjects done and in all, says so.
///
/// # Example
/// ```
/// use bearslam::{
///     Arena, Frame, Layout, Loss, Problem, SolveOptions, covariance, simulate, solve,
/// };
/// let noise = 0.01;
/// let scene = simulate(Layout::Enclosed, 8, 11, noise, 5, Arena::default())?;
/// let problem = Problem::dense(8, 11, &scene.bearings, noise)?;
/// let found = solve(&problem, &SolveOptions::default(), None)?;
/// let covariance = covariance(&problem, &found.map, Loss::Squared, Frame::FirstView, None)?;
/// // The first view is the datum.
/// assert!(covariance.poses[0].unwrap().norm() < 1e-12);
/// assert!(covariance.landmarks[3].unwrap().trace() > 0.0);
/// # Ok::<(), bearslam::Error>(())
/// ```
///
/// # Reference
/// W. Baarda, "S-transformations and criterion matrices", 1973; Triggs et al. 2000, section 9.
pub fn covariance(
    problem: &Problem,
    map: &Map,
    loss: Loss,
    frame: Frame,
    mut observer: Option<Observer<'_>>,
) -> Result<Covariance, Error> {
    loss.check()?;
    map.check(problem)?;
    let active = map.restrict(problem);
    let bundle = Bundle::from_map(map);
    if bundle.poses.is_empty() {
        return Err(Error::TooFew {
            what: "views of the map",
            needed: 1,
            got: 0,
        });
    }
    let subjects = active.views() + active.landmarks();
    let watch = &mut || observe(&mut observer, 0, subjects);
    watch()?;
    let mut rows = Rows::of(&active);
    bundle.linearize(&active, loss, &mut rows);
    let mut normal = Normal::new(&active).ok_or(Error::OutOfMemory)?;
    let gauge = gauge_directions(&active, &bundle);
    if frame == Frame::Priors && !gauge.is_empty() {
        return Err(Error::Degenerate {
            kind: Degeneracy::FreeFrame,
            value: gauge.len() as f64,
            bound: 0.0,
        });
    }
    watch()?;
    let free = free_directions(&mut normal, &rows, &gauge, LOOKED_FOR, watch)?;
    normal.assemble(&rows, &gauge);
    watch()?;
    if !normal.factorize(0.0) && !normal.factorize(LIFT) {
        return Err(SINGULAR_EQUATIONS);
    }
    let transformation = Transformation::new(&normal, &active, &bundle, &gauge, free, frame)
        .ok_or(SINGULAR_EQUATIONS)?;
    let blocks = diagonal_blocks(&normal, &active, &mut observer)?;
    let mut parameter = 0;
    let mut found = blocks.iter().map(|block| {
        parameter += block.nrows();
        transformation.apply(parameter - block.nrows(), block)
    });
    Ok(Covariance {
        frame,
        poses: map
            .poses
            .iter()
            .map(|pose| pose.and_then(|_| found.next()))
            .map(|block| block.map(|b| Matrix3::from_fn(|i, j| b[(i, j)])))
            .collect(),
        landmarks: map
            .landmarks
            .iter()
            .map(|point| point.and_then(|_| found.next()))
            .map(|block| block.map(|b| Matrix2::from_fn(|i, j| b[(i, j)])))
            .collect(),
        free: transformation.free.len()
            + transformation
                .unheld
                .iter()
                .filter(|unheld| **unheld)
                .count(),
    })
}

/// `S = 1 - E (C^T E)^-1 C^T`: moves any solution along the free directions E to the one that satisfies the
/// constraints C.
struct Transformation {
    /// E times `(C^T E)^-1`.
    lift: DMatrix<f64>,
    /// The inverse times C.
    spread: DMatrix<f64>,
    /// `C^T` times that.
    core: DMatrix<f64>,
    /// Directions that are free, and the largest entry of each.
    free: Vec<Vec<f64>>,
    reach: Vec<f64>,
    /// Parameters on which no residual depends: free as well, each alone.
    unheld: Vec<bool>,
}

impl Transformation {
    fn new(
        normal: &Normal<'_>,
        problem: &Problem,
        bundle: &Bundle,
        gauge: &[Vec<f64>],
        free: Vec<Vec<f64>>,
        frame: Frame,
    ) -> Option<Self> {
        let size = normal.size();
        let views = problem.views();
        let mut constraints = match frame {
            Frame::FirstView => FixedByPriors::of(problem).constraints(bundle),
            Frame::FreeNetwork | Frame::Priors => Vec::new(),
        };
        // Where priors tie the heading to the scale, the frame of the first view does not exist.
        if constraints.len() != gauge.len() {
            constraints = inner_constraints(gauge, views);
        }
        let free = in_frame(gauge, &constraints, &free)?;
        // Constraints along the other free directions, in units of standard deviations.
        let weighted = free.iter().map(|direction| {
            let entries = direction.iter().enumerate();
            entries
                .map(|(parameter, entry)| entry * normal.diagonal(parameter))
                .collect()
        });
        constraints.extend(weighted);
        let directions: Vec<&Vec<f64>> = gauge.iter().chain(&free).collect();
        let count = directions.len();
        let e = DMatrix::from_fn(size, count, |i, j| directions[j][i]);
        let c = DMatrix::from_fn(size, count, |i, j| constraints[j][i]);
        let mut spread = c.clone();
        if count > 0 {
            normal.solve(spread.as_mut_slice());
        }
        Some(Self {
            lift: &e * inverse(&(c.transpose() * &e))?,
            core: c.transpose() * &spread,
            spread,
            reach: free.iter().map(|direction| largest(direction)).collect(),
            free,
            unheld: (0..size).map(|k| !(normal.diagonal(k) > 0.0)).collect(),
        })
    }

    /// The block of one subject in the frame, from that of the inverse.
    fn apply(&self, parameter: usize, raw: &DMatrix<f64>) -> DMatrix<f64> {
        let width = raw.nrows();
        let lift = self.lift.rows(parameter, width);
        let cross = lift * self.spread.rows(parameter, width).transpose();
        let full = raw - &cross - cross.transpose() + lift * &self.core * lift.transpose();
        let mut block = (&full + full.transpose()) * 0.5;
        for k in 0..width {
            // What the frame fixes has no variance except rounding, which may be negative.
            if block[(k, k)] <= 0.0 {
                block.row_mut(k).fill(0.0);
                block.column_mut(k).fill(0.0);
            }
        }
        let lost = !make_positive(&mut block);
        for k in 0..width {
            let moves = self.free.iter().zip(&self.reach);
            let mut moves = moves.map(|(d, reach)| d[parameter + k].abs() > STANDS_STILL * reach);
            if lost || self.unheld[parameter + k] || moves.any(|moves| moves) {
                block.row_mut(k).fill(f64::NAN);
                block.column_mut(k).fill(f64::NAN);
                block[(k, k)] = f64::INFINITY;
            }
        }
        block
    }
}

/// Removes negative variances, which are rounding, from a symmetric block whose diagonal is not negative; `false` when
/// they are so large that rounding is all there is.
fn make_positive(block: &mut DMatrix<f64>) -> bool {
    let width = block.nrows();
    let deviations: Vec<f64> = (0..width).map(|k| block[(k, k)].sqrt()).collect();
    let unit = |k: usize| {
        if deviations[k] > 0.0 {
            deviations[k]
        } else {
            1.0
        }
    };
    let correlation = DMatrix::from_fn(width, width, |i, j| block[(i, j)] / (unit(i) * unit(j)));
    let Some(eigen) = symmetric_eigen(correlation) else {
        return true;
    };
    let least = eigen.eigenvalues.min();
    if least < -ALL_ROUNDING {
        return false;
    }
    if least < 0.0 {
        let kept = eigen.eigenvalues.map(|value| value.max(0.0));
        let vectors = &eigen.eigenvectors;
        let positive = vectors * DMatrix::from_diagonal(&kept) * vectors.transpose();
        *block = DMatrix::from_fn(width, width, |i, j| {
            0.5 * (positive[(i, j)] + positive[(j, i)]) * unit(i) * unit(j)
        });
    }
    true
}

/// The largest entry of a vector.
fn largest(vector: &[f64]) -> f64 {
    vector
        .iter()
        .fold(0.0, |most, entry| f64::max(most, entry.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    #[test]
    fn negative_variances_of_rounding_are_removed() {
        // A correlation just above 1, between standard deviations of 1e-3 and 10.
        let cross = 1e-2 * (1.0 + 1e-6);
        let mut block = DMatrix::from_row_slice(2, 2, &[1e-6, cross, cross, 100.0]);
        assert!(make_positive(&mut block));
        let left = block[(0, 0)] * block[(1, 1)] - block[(0, 1)] * block[(1, 0)];
        assert!(left.abs() < 1e-18 && (block[(0, 0)] - 1e-6).abs() < 1e-11);
        // One far above 1 is rounding alone, and one below stays as it is.
        assert!(!make_positive(&mut DMatrix::from_row_slice(
            2,
            2,
            &[1.0, 1.5, 1.5, 1.0]
        )));
        let good = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        let mut block = good.clone();
        assert!(make_positive(&mut block) && block == good);
    }

    /// Poses and landmarks are counted together as they are done; the frame of priors that are none lacks all of the gauge.
    #[test]
    fn all_subjects_are_counted_and_a_frame_that_is_free_is_refused() {
        let scene = simulate(Layout::Enclosed, 5, 7, 0.01, 2, Arena::default()).unwrap();
        let problem = Problem::dense(5, 7, &scene.bearings, 0.01).unwrap();
        let mut counts = Vec::new();
        let mut observer = |done: usize, total: f64| {
            counts.push((done, total));
            true
        };
        let mut within = |frame| {
            let observer = Some(&mut observer as Observer<'_>);
            covariance(&problem, &scene.map(), Loss::Squared, frame, observer)
        };
        assert!(within(Frame::FirstView).is_ok());
        let error = within(Frame::Priors).unwrap_err();
        let expected = Error::Degenerate {
            kind: Degeneracy::FreeFrame,
            value: 4.0,
            bound: 0.0,
        };
        assert_eq!(error, expected);
        assert_eq!(counts[0], (0, 12.0));
        assert!(
            counts
                .iter()
                .all(|&(done, total)| done <= 12 && total == 12.0)
        );
    }
}
