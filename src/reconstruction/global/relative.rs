// SPDX-License-Identifier: MIT OR Apache-2.0
//! Relative headings of many triples of views, and which views they connect.

use super::super::options::{Progress, SolveOptions, report_progress};
use super::super::search::triples::{self, are_rivals, common_bearings};
use crate::error::Error;
use crate::kernels::CalibratedTensor;
use crate::problem::Problem;
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::UnitComplex;

/// The headings of three views, up to a common rotation.
pub struct Relative {
    pub views: [usize; 3],
    /// One branch, or both where the signs of the bearings do not decide between them.
    pub branches: Vec<[UnitComplex<f64>; 3]>,
    /// Inversely proportional to the standard deviation of the headings, for equal noise.
    pub quality: f64,
}

/// Triples of views for the averaging, the best conditioned first.
///
/// # Errors
/// [`Error::Interrupted`]; when no triple can be estimated, the error of the last one.
pub fn relatives(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Vec<Relative>, Error> {
    let SolveOptions { seed, stages, .. } = options;
    let options = &stages.relative_headings;
    let drawn = options.per_view.saturating_mul(problem.views());
    let count = drawn.max(options.fewest);
    let mut failure = None;
    let mut found = Vec::new();
    for needed in options.shared {
        let drawn = triples::draw(problem, needed, count, *seed, &stages.draw);
        for (done, &views) in drawn.iter().enumerate() {
            if !report_progress(progress, "search", done, drawn.len()) {
                return Err(Error::Interrupted);
            }
            match relative(problem, views, needed, options.shared[1]) {
                Ok(relative) => found.extend(relative),
                Err(error) => failure = Some(error),
            }
        }
    }
    found.sort_by(|a: &Relative, b| b.quality.total_cmp(&a.quality));
    match failure {
        Some(error) if found.is_empty() => Err(error),
        _ => {
            let mut taken = vec![0; problem.views()];
            found.retain(|relative| {
                let wanted = relative
                    .views
                    .iter()
                    .any(|&view| taken[view] < options.kept);
                if wanted {
                    for view in relative.views {
                        taken[view] += 1;
                    }
                }
                wanted
            });
            Ok(found)
        }
    }
}

/// Estimates one triple. `None` in the draw with `needed` equal to `fewest` when it shares more landmarks: an
/// earlier draw has had it.
fn relative(
    problem: &Problem,
    views: [usize; 3],
    needed: usize,
    fewest: usize,
) -> Result<Option<Relative>, Error> {
    let (triples, _) = common_bearings(problem, views);
    if needed == fewest && triples.len() > needed {
        return Ok(None);
    }
    let tensor = CalibratedTensor::estimate(&triples, 1)?;
    let mut motions = tensor.motions(&triples)?;
    motions.sort_by_key(|motion| motion.inconsistent);
    let rivals = are_rivals(problem, &motions, triples.len());
    let branches = motions[..1 + usize::from(rivals)]
        .iter()
        .map(|motion| motion.poses.map(|pose| pose.rotation));
    Ok(Some(Relative {
        views,
        branches: branches.collect(),
        quality: tensor.quality(),
    }))
}

/// The sets of views connected by triples, the largest first; a view in no triple is in none of them.
pub fn groups(views: usize, relatives: &[Relative]) -> Vec<Vec<usize>> {
    let mut parent: Vec<usize> = (0..views).collect();
    fn root(parent: &mut [usize], mut view: usize) -> usize {
        while parent[view] != view {
            parent[view] = parent[parent[view]];
            view = parent[view];
        }
        view
    }
    for relative in relatives {
        let [a, b, c] = relative.views.map(|view| root(&mut parent, view));
        parent[b] = a;
        let c = root(&mut parent, c);
        parent[c] = a;
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); views];
    for view in 0..views {
        groups[root(&mut parent, view)].push(view);
    }
    groups.retain(|group| group.len() >= 3);
    groups.sort_by_key(|group| core::cmp::Reverse(group.len()));
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Arena, Layout, simulate};

    /// The signs of exact bearings almost always leave one branch, and the true one comes first.
    #[test]
    fn signs_leave_the_true_branch() {
        let mut alone = 0;
        for seed in 0..20 {
            let scene = simulate(Layout::Enclosed, 3, 24, 0.0, seed, Arena::default()).unwrap();
            let problem = Problem::dense(3, 24, &scene.bearings, 1.0).unwrap();
            let found = relative(&problem, [0, 1, 2], 6, 5).unwrap().unwrap();
            alone += usize::from(found.branches.len() == 1);
            let branch = found.branches[0];
            let turn = scene.poses[0].rotation * branch[0].inverse();
            for (heading, pose) in branch.iter().zip(&scene.poses) {
                let error = (turn * heading).angle_to(&pose.rotation);
                assert!(error.abs() < 1e-6, "{seed}: {error}");
            }
        }
        assert!(alone > 15, "{alone}");
    }

    /// Triples that share a view are in one group; the largest comes first, and views in none are left out.
    #[test]
    fn triples_connect_views() {
        let relative = |views: [usize; 3]| Relative {
            views,
            branches: Vec::new(),
            quality: 1.0,
        };
        let triples = [[7, 8, 9], [0, 1, 2], [5, 4, 3], [2, 5, 10]].map(relative);
        let found = groups(12, &triples);
        assert_eq!(found, [vec![0, 1, 2, 3, 4, 5, 10], vec![7, 8, 9]]);
        assert!(groups(4, &[]).is_empty());
    }

    /// A triple that shares more than the second draw needs has been in the first.
    #[test]
    fn a_triple_comes_once() {
        let scene = simulate(Layout::Enclosed, 3, 6, 0.0, 1, Arena::default()).unwrap();
        let problem = Problem::dense(3, 6, &scene.bearings, 1.0).unwrap();
        assert!(relative(&problem, [0, 1, 2], 6, 5).unwrap().is_some());
        assert!(relative(&problem, [0, 1, 2], 5, 5).unwrap().is_none());
        let options = SolveOptions::default();
        let found = relatives(&problem, &options, &mut None).unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].views, [0, 1, 2]);
    }

    /// A triple is kept as long as one of its views is in few of them.
    #[test]
    fn each_view_is_in_a_few_triples() {
        let scene = simulate(Layout::Enclosed, 8, 12, 0.0, 1, Arena::default()).unwrap();
        let problem = Problem::dense(8, 12, &scene.bearings, 1.0).unwrap();
        let mut options = SolveOptions::default();
        options.stages.relative_headings.kept = 2;
        let found = relatives(&problem, &options, &mut None).unwrap();
        let times = |view: usize| found.iter().filter(|one| one.views.contains(&view)).count();
        assert!((0..8).all(|view| times(view) >= 2));
        // Every one but the last brings a view that was in fewer than two.
        assert!(found.len() <= 16, "{}", found.len());
        assert!(found.is_sorted_by(|a, b| a.quality >= b.quality));
    }
}
