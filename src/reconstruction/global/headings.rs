// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rotation averaging on the circle.

use super::options::AveragingOptions;
use super::relative::Relative;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{DMatrix, DVector, UnitComplex};

/// The headings of a connected set of views that agree best with the relative headings of triples.
///
/// The initial headings come from a spanning tree of the best-conditioned triples, each attached by
/// the branch that fits best. Least squares over all triples on the circle, (T31), then refines them:
/// each triple by its nearer branch, reweighted against outliers.
pub fn average(
    views: usize,
    relatives: &[Relative],
    group: &[usize],
    options: &AveragingOptions,
) -> Vec<Option<UnitComplex<f64>>> {
    let mut member = vec![usize::MAX; views];
    for (slot, &view) in group.iter().enumerate() {
        member[view] = slot;
    }
    let relatives: Vec<&Relative> = relatives
        .iter()
        .filter(|relative| relative.views.iter().all(|&view| member[view] < usize::MAX))
        .collect();
    let mut headings = spanning_tree(views, &relatives);
    for _ in 0..options.rounds {
        // For each pair of views in each triple: the two views, the error of their relative heading,
        // the quality.
        let mut pairs = Vec::with_capacity(3 * relatives.len());
        for relative in &relatives {
            let Some((_, errors)) = nearest(relative, &headings) else {
                continue;
            };
            for (k, error) in errors.into_iter().enumerate() {
                let (a, b) = (relative.views[k], relative.views[(k + 1) % 3]);
                pairs.push((member[a], member[b], error, relative.quality));
            }
        }
        let mut sizes: Vec<f64> = pairs.iter().map(|&(_, _, e, q)| e.abs() * q).collect();
        sizes.sort_by(|a, b| a.total_cmp(b));
        let Some(&median) = sizes.get(sizes.len() / 2) else {
            break;
        };
        let scale = median * options.cauchy_medians + f64::EPSILON;
        let mut matrix = DMatrix::zeros(group.len(), group.len());
        let mut right = DVector::zeros(group.len());
        for (a, b, error, quality) in pairs {
            let far = error * quality / scale;
            let weight = quality * quality / (1.0 + far * far);
            matrix[(a, a)] += weight;
            matrix[(b, b)] += weight;
            matrix[(a, b)] -= weight;
            matrix[(b, a)] -= weight;
            right[a] -= weight * error;
            right[b] += weight * error;
        }
        // Gauge: hold the first heading.
        let stiffness = matrix.diagonal().sum();
        matrix[(0, 0)] += stiffness;
        let Some(factor) = matrix.cholesky() else {
            break;
        };
        factor.solve_mut(&mut right);
        for (&view, turn) in group.iter().zip(right.iter()) {
            if let Some(heading) = &mut headings[view] {
                *heading *= UnitComplex::new(*turn);
                heading.renormalize();
            }
        }
        if right.amax() < options.tolerance {
            break;
        }
    }
    headings
}

/// The branch of a triple nearest to the current headings: its squared error, and the angle \[rad\] by
/// which the second heading of each pair (0, 1), (1, 2), (2, 0) would have to turn to satisfy it.
fn nearest(relative: &Relative, headings: &[Option<UnitComplex<f64>>]) -> Option<(f64, [f64; 3])> {
    let mut best: Option<(f64, [f64; 3])> = None;
    let [a, b, c] = relative.views.map(|view| headings[view]);
    let now = [a?, b?, c?];
    for branch in &relative.branches {
        let errors: [f64; 3] = core::array::from_fn(|k| {
            let next = (k + 1) % 3;
            let wanted = branch[k].inverse() * branch[next];
            ((now[k].inverse() * now[next]).inverse() * wanted).angle()
        });
        let size = errors.iter().fold(0.0, |sum, e| sum + *e * *e);
        if best.is_none_or(|(least, _)| size < least) {
            best = Some((size, errors));
        }
    }
    best
}

/// Initial headings, spread outwards from the best triple that has only one branch.
fn spanning_tree(views: usize, relatives: &[&Relative]) -> Vec<Option<UnitComplex<f64>>> {
    let mut headings = vec![None; views];
    let clear = relatives
        .iter()
        .find(|relative| relative.branches.len() == 1);
    let Some(first) = clear.or(relatives.first()) else {
        return headings;
    };
    headings[first.views[0]] = Some(UnitComplex::identity());
    // Two known views decide between the branches of a triple; a triple with two branches and one known
    // view waits.
    loop {
        let attaches = |relative: &&&Relative, fewest: usize| {
            let known = relative
                .views
                .iter()
                .filter(|&&view| headings[view].is_some());
            let known = known.count();
            known < 3
                && known
                    >= if relative.branches.len() == 1 {
                        1
                    } else {
                        fewest
                    }
        };
        let mut candidates = relatives.iter();
        let next = candidates
            .find(|relative| attaches(relative, 2))
            .or_else(|| relatives.iter().find(|relative| attaches(relative, 1)));
        let Some(next) = next else { return headings };
        attach(next, &mut headings);
    }
}

/// Sets the missing headings of a triple, by the branch that agrees best with the known ones.
fn attach(relative: &Relative, headings: &mut [Option<UnitComplex<f64>>]) {
    let mut best: Option<(f64, [UnitComplex<f64>; 3])> = None;
    for branch in &relative.branches {
        let turns = (0..3).filter_map(|k| Some(headings[relative.views[k]]? * branch[k].inverse()));
        let Some(turn) = turns.clone().next() else {
            return;
        };
        let apart = turns.fold(0.0, |sum, other| sum + turn.angle_to(&other).abs());
        if best.is_none_or(|(least, _)| apart < least) {
            best = Some((apart, branch.map(|heading| turn * heading)));
        }
    }
    if let Some((_, branch)) = best {
        for (view, heading) in relative.views.into_iter().zip(branch) {
            headings[view].get_or_insert(heading);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(view: usize) -> UnitComplex<f64> {
        UnitComplex::new(0.7 * view as f64 - 1.9)
    }

    /// A triple with its exact headings in a frame of its own, as the second branch after a wrong one if `doubtful`.
    fn triple(views: [usize; 3], doubtful: bool) -> Relative {
        let own = UnitComplex::new(1.3 * views[0] as f64 + 0.4);
        let right = views.map(|view| own * truth(view));
        let wrong = views.map(|view| own * truth(view).inverse());
        let branches = if doubtful {
            vec![wrong, right]
        } else {
            vec![right]
        };
        Relative {
            views,
            branches,
            quality: 1.0,
        }
    }

    /// The initial headings are exact where the triples are, and a triple with two branches is attached by the right one,
    /// whatever order they come in.
    #[test]
    fn the_spanning_tree_joins_exact_triples() {
        let mut relatives = vec![
            triple([3, 4, 5], true),
            triple([2, 3, 4], false),
            triple([0, 1, 2], false),
            triple([5, 6, 4], true),
            triple([6, 5, 1], true),
        ];
        let group: Vec<usize> = (0..7).collect();
        let initial = AveragingOptions {
            rounds: 0,
            ..AveragingOptions::default()
        };
        for _ in 0..relatives.len() {
            for options in [initial, AveragingOptions::default()] {
                let found = average(7, &relatives, &group, &options);
                let turn = found[0].unwrap() / truth(0);
                for (view, heading) in found.iter().enumerate() {
                    let error = heading.unwrap().angle_to(&(turn * truth(view)));
                    assert!(error.abs() < 1e-12, "{view}: {error}");
                }
            }
            relatives.rotate_left(1);
        }
    }

    /// Among exact triples a wrong one moves no heading, the less so the worse it is determined.
    #[test]
    fn a_wrong_triple_is_outvoted() {
        let views: Vec<[usize; 3]> = (0..5).map(|k| [k, k + 1, k + 2]).collect();
        let group: Vec<usize> = (0..7).collect();
        for off in [0.05, -0.3] {
            let mut relatives: Vec<Relative> =
                views.iter().map(|&views| triple(views, false)).collect();
            relatives.extend((0..4).map(|k| triple([k, k + 1, k + 3], false)));
            relatives[3].branches[0][1] *= UnitComplex::new(off);
            let found = average(7, &relatives, &group, &AveragingOptions::default());
            let turn = found[0].unwrap() / truth(0);
            for (view, heading) in found.iter().enumerate() {
                let error = heading.unwrap().angle_to(&(turn * truth(view)));
                assert!(error.abs() < 1e-6, "{off} {view}: {error}");
            }
        }
    }

    /// Where two triples contradict each other, headings are averaged by the squares of their qualities.
    #[test]
    fn headings_are_averaged_by_quality() {
        let off = 0.01;
        let mut relatives = vec![triple([0, 1, 2], false), triple([0, 1, 2], false)];
        relatives[1].quality = 3.0;
        for view in [1, 2] {
            relatives[1].branches[0][view] *= UnitComplex::new(off * view as f64);
        }
        // So that all count fully.
        let options = AveragingOptions {
            cauchy_medians: 1e6,
            ..AveragingOptions::default()
        };
        let found = average(3, &relatives, &[0, 1, 2], &options);
        let turn = found[0].unwrap() / truth(0);
        for view in [1, 2] {
            let error = (turn * truth(view)).angle_to(&found[view].unwrap());
            let share = error / (off * view as f64);
            assert!((share - 0.9).abs() < 1e-3, "{view}: {share}");
        }
    }
}
