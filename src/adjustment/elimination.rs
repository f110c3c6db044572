// SPDX-License-Identifier: MIT OR Apache-2.0
//! The choice of the blocks to eliminate, poses or landmarks: the sightings grouped by them, and the gauge of the
//! blocks that are kept.

use super::bundle::Bundle;
use super::schur::{Grouped, Slot};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::points::{centroid, spread};
use crate::lm::BearingRow;
use crate::problem::Problem;
use alloc::vec::Vec;
use nalgebra::{DMatrix, Vector2};

/// Whether poses are eliminated and landmarks kept, because that leaves the smaller system.
pub fn keeps_landmarks(problem: &Problem) -> bool {
    2 * problem.landmarks() <= 3 * problem.views()
}

/// All sightings linearised, grouped by view or by landmark.
pub struct GroupedSightings<'a> {
    pub problem: &'a Problem,
    pub rows: &'a [BearingRow],
}

/// Grouped by view: poses are eliminated, landmarks kept.
impl Grouped<3, 2> for GroupedSightings<'_> {
    fn groups(&self) -> usize {
        self.problem.views()
    }

    fn sightings(&self) -> usize {
        self.rows.len()
    }

    fn kept(&self) -> usize {
        self.problem.landmarks()
    }

    #[inline]
    fn group(&self, view: usize) -> impl Iterator<Item = Slot<3, 2>> {
        let range = self.problem.range_of_view(view);
        self.problem.sightings()[range.clone()]
            .iter()
            .zip(&self.rows[range])
            .map(|(s, row)| Slot {
                kept: s.landmark,
                gone: row.pose(),
                stay: row.landmark(),
                residual: row.residual,
            })
    }
}

/// Grouped by landmark: landmarks are eliminated, poses kept.
impl Grouped<2, 3> for GroupedSightings<'_> {
    fn groups(&self) -> usize {
        self.problem.landmarks()
    }

    fn sightings(&self) -> usize {
        self.rows.len()
    }

    fn kept(&self) -> usize {
        self.problem.views()
    }

    #[inline]
    fn group(&self, landmark: usize) -> impl Iterator<Item = Slot<2, 3>> {
        self.problem.of_landmark(landmark).iter().map(|&k| Slot {
            kept: self.problem.sightings()[k].view,
            gone: self.rows[k].landmark(),
            stay: self.rows[k].pose(),
            residual: self.rows[k].residual,
        })
    }
}

/// The directions of translation, rotation and scale of the kept blocks, (T14): orthonormal rows.
pub fn gauge<const K: usize>(bundle: &Bundle) -> DMatrix<f64> {
    let points = kept_positions::<K>(bundle);
    let count = points.len() as f64;
    let centre = centroid(&points);
    let spread = spread(&points);
    // Norms of the four directions; a rotation changes headings as well.
    let turned = if K == 2 { spread } else { spread + count };
    let [shift, turn, grow] = [count, turned, spread].map(|square| {
        if square > 0.0 {
            1.0 / square.sqrt()
        } else {
            0.0
        }
    });
    let mut directions = DMatrix::zeros(4, points.len() * K);
    for (k, point) in points.iter().enumerate() {
        let p = point - centre;
        directions[(0, K * k)] = shift;
        directions[(1, K * k + 1)] = shift;
        directions[(2, K * k)] = -p.y * turn;
        directions[(2, K * k + 1)] = p.x * turn;
        if K == 3 {
            directions[(2, K * k + 2)] = turn;
        }
        directions[(3, K * k)] = p.x * grow;
        directions[(3, K * k + 1)] = p.y * grow;
    }
    directions
}

/// The positions of the kept blocks: landmarks for `K` = 2, views for `K` = 3.
pub fn kept_positions<const K: usize>(bundle: &Bundle) -> Vec<Vector2<f64>> {
    if K == 2 {
        bundle.landmarks.iter().map(|p| p.coords).collect()
    } else {
        bundle.poses.iter().map(|p| p.translation.vector).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::bundle::Rows;
    use super::super::schur::Schur;
    use super::*;
    use crate::lm::Loss;
    use crate::problem::Sighting;
    use crate::simulate::{Arena, Layout, simulate};
    use nalgebra::DVector;

    /// A part of the sightings of a simulated scene, and a bundle near the truth.
    fn setting(
        (views, landmarks): (usize, usize),
        sees: impl Fn(usize, usize) -> bool,
    ) -> (Problem, Bundle) {
        let arena = Arena::default();
        let scene = simulate(Layout::Enclosed, views, landmarks, 0.02, 5, arena).unwrap();
        let all = (0..views * landmarks).map(|k| (k / landmarks, k % landmarks));
        let seen = all.filter(|&(view, landmark)| sees(view, landmark));
        let seen: Vec<Sighting> = seen
            .map(|(view, landmark)| Sighting {
                view,
                landmark,
                bearing: scene.bearings[view * landmarks + landmark],
                sigma: 0.02,
            })
            .collect();
        let problem = Problem::new(views, landmarks, &seen).unwrap();
        (problem, Bundle::from_map(&scene.map()))
    }

    /// Half the least sum of squares of the linear model, from its Jacobian as a whole.
    fn least(problem: &Problem, rows: &[BearingRow]) -> f64 {
        let (views, count) = (problem.views(), rows.len());
        let mut jacobian = DMatrix::zeros(count, 3 * views + 2 * problem.landmarks());
        for (k, (s, row)) in problem.sightings().iter().zip(rows).enumerate() {
            for (i, entry) in row.pose().into_iter().enumerate() {
                jacobian[(k, 3 * s.view + i)] = entry;
            }
            for (i, entry) in row.landmark().into_iter().enumerate() {
                jacobian[(k, 3 * views + 2 * s.landmark + i)] = entry;
            }
        }
        let residuals = DVector::from_iterator(count, rows.iter().map(|row| row.residual));
        let svd = jacobian.clone().svd(true, true);
        // The gauge is free: the largest singular value is about 1e3, the least beyond the gauge about 0.1.
        let step = svd.solve(&-&residuals, 1e-6).unwrap();
        (residuals + jacobian * step).norm_squared() * 0.5
    }

    fn check<const E: usize, const K: usize>(problem: &Problem, bundle: &Bundle)
    where
        for<'x> GroupedSightings<'x>: Grouped<E, K>,
    {
        let mut rows = Rows::of(problem);
        bundle.linearize(problem, Loss::Squared, &mut rows);
        let expected = least(problem, &rows.sightings);
        let rows = &rows.sightings;
        let grouped = GroupedSightings { problem, rows };
        let (mut kept, mut gone) = (Vec::new(), Vec::new());
        let mut schur = Schur::<E, K>::new();
        // The second time the matrices hold what the first has left in them.
        for _ in 0..2 {
            assert!(schur.factorize(&grouped, 0.0, &gauge::<K>(bundle)));
            let gain = schur.solve(&grouped, &mut kept, &mut gone).gain;
            let found = rows
                .iter()
                .fold(0.0, |sum, row| sum + row.residual * row.residual)
                * 0.5
                - gain;
            assert!((found / expected - 1.0).abs() < 1e-8, "{found} {expected}");
            assert_eq!([kept.len(), gone.len()], [grouped.kept(), grouped.groups()]);
        }
    }

    /// The step of the reduced system is that of linear least squares: with all sightings, with gaps that differ from
    /// group to group in one batch or several, and with sightings so few that groups are eliminated block by block.
    #[test]
    fn reduced_systems_solve_linear_least_squares() {
        let gaps = |view: usize, landmark: usize| (view + 3 * landmark) % 7 > 2;
        let band = |view: usize, landmark: usize| (view + 60 - landmark) % 60 < 7;
        for (problem, bundle) in [
            setting((5, 8), |_, _| true),
            setting((12, 9), gaps),
            setting((8, 90), gaps),
            setting((90, 8), gaps),
            setting((60, 60), band),
        ] {
            check::<3, 2>(&problem, &bundle);
            check::<2, 3>(&problem, &bundle);
        }
    }

    /// A damped step minimises the linear cost with so much more on the diagonal, and with the stiffness of the gauge on the
    /// kept blocks; what is predicted of it is its decrease.
    fn check_damped<const E: usize, const K: usize>(problem: &Problem, bundle: &Bundle)
    where
        for<'x> GroupedSightings<'x>: Grouped<E, K>,
    {
        let mut rows = Rows::of(problem);
        bundle.linearize(problem, Loss::Squared, &mut rows);
        let rows = &rows.sightings;
        let grouped = GroupedSightings { problem, rows };
        let (mut kept, mut gone) = (Vec::new(), Vec::new());
        let mut schur = Schur::<E, K>::new();
        let gauge = gauge::<K>(bundle);
        let damping = 0.7;
        assert!(schur.factorize(&grouped, damping, &gauge));
        let gain = schur.solve(&grouped, &mut kept, &mut gone).gain;
        let (mut before, mut after) = (0.0, 0.0);
        let size = schur.size();
        let mut left = DVector::zeros(size);
        for group in 0..grouped.groups() {
            let mut of_group = [0.0; E];
            for slot in grouped.group(group) {
                let mut residual = slot.residual;
                residual += (0..E).map(|i| slot.gone[i] * gone[group][i]).sum::<f64>();
                residual += (0..K)
                    .map(|i| slot.stay[i] * kept[slot.kept][i])
                    .sum::<f64>();
                before += slot.residual * slot.residual;
                after += residual * residual;
                for i in 0..E {
                    let damped = damping * slot.gone[i] * slot.gone[i] * gone[group][i];
                    of_group[i] += slot.gone[i] * residual + damped;
                }
                for i in 0..K {
                    let damped = damping * slot.stay[i] * slot.stay[i] * kept[slot.kept][i];
                    left[slot.kept * K + i] += slot.stay[i] * residual + damped;
                }
            }
            assert!(
                of_group.iter().all(|left| left.abs() < 1e-6),
                "{of_group:?}"
            );
        }
        let step = DVector::from_iterator(size, kept.iter().flatten().copied());
        let stiffness = (0..size).map(|k| schur.information(k)).sum::<f64>() / size as f64;
        left += gauge.tr_mul(&(&gauge * &step)) * stiffness;
        assert!(left.amax() < 1e-6, "{left}");
        let expected = 0.5 * (before - after);
        assert!((gain / expected - 1.0).abs() < 1e-8, "{gain} {expected}");
    }

    #[test]
    fn damped_steps_solve_damped_least_squares() {
        let gaps = |view: usize, landmark: usize| (view + 3 * landmark) % 7 > 2;
        let band = |view: usize, landmark: usize| (view + 60 - landmark) % 60 < 7;
        for (problem, bundle) in [
            setting((5, 8), |_, _| true),
            setting((12, 9), gaps),
            setting((60, 60), band),
        ] {
            check_damped::<3, 2>(&problem, &bundle);
            check_damped::<2, 3>(&problem, &bundle);
        }
    }

    /// The four directions are orthogonal, each of length one, and no residual changes along them with the eliminated blocks
    /// following.
    #[test]
    fn the_gauge_is_an_orthonormal_basis() {
        let (_, bundle) = setting((5, 8), |_, _| true);
        for gauge in [gauge::<2>(&bundle), gauge::<3>(&bundle)] {
            let product = &gauge * gauge.transpose();
            assert!((product - DMatrix::identity(4, 4)).norm() < 1e-12);
        }
    }

    /// A landmark or view that nobody sees gets no step, and the others theirs.
    #[test]
    fn what_nobody_sees_stays() {
        fn check<const E: usize, const K: usize>(
            unseen: impl Fn(usize, usize) -> bool,
            block: usize,
        ) where
            for<'x> GroupedSightings<'x>: Grouped<E, K>,
        {
            let (problem, bundle) = setting((5, 8), |view, landmark| !unseen(view, landmark));
            let mut rows = Rows::of(&problem);
            bundle.linearize(&problem, Loss::Squared, &mut rows);
            let grouped = GroupedSightings {
                problem: &problem,
                rows: &rows.sightings,
            };
            let (mut kept, mut gone) = (Vec::new(), Vec::new());
            let mut schur = Schur::<E, K>::new();
            assert!(schur.factorize(&grouped, 0.1, &DMatrix::zeros(4, grouped.kept() * K)));
            schur.solve(&grouped, &mut kept, &mut gone);
            for (k, step) in kept.iter().enumerate() {
                assert_eq!(step.norm() == 0.0, k == block, "{k}: {step}");
            }
        }
        check::<3, 2>(|_, landmark| landmark == 3, 3);
        check::<2, 3>(|view, _| view == 2, 2);
    }
}
