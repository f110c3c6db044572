// SPDX-License-Identifier: MIT OR Apache-2.0
//! Hypotheses: whole maps grown from triples of views.

use super::super::choice::near;
use super::super::grow::{grow, score};
use super::super::options::{Progress, SearchOptions, SolveOptions, goes_on};
use super::four_landmarks::FourLandmarks;
use super::options::{DrawOptions, HypothesisOptions};
use super::tensor_circle::{Circle, ScoredMap, along_circle};
use super::triples::{self, are_rivals, common_bearings};
use crate::error::Error;
use crate::kernels::{CalibratedTensor, Method, three_view};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;

/// Minimum number of landmarks that three views must share to start a map, alone and with the help of a fourth view.
/// Not options: with fewer the geometry has infinitely many solutions.
pub const MIN_SHARED: usize = 5;
const MIN_SHARED_WITH_FOURTH: usize = 4;

/// An initial map.
pub struct Hypothesis {
    pub map: Map,
    /// Index of the triple that it was grown from.
    pub triple: usize,
}

/// Initial maps.
pub struct Hypotheses {
    /// Best first.
    pub maps: Vec<Hypothesis>,
    /// Whether the problem has a unique solution in general: more than three views, more than four
    /// landmarks. Then two hypotheses that end in the same minimum confirm each other.
    pub unique: bool,
    /// Whether they come from four shared landmarks, so that every minimum must be refined.
    pub four: bool,
    /// Triples of views, the best conditioned first, for a wider search.
    triples: Vec<[usize; 3]>,
    /// The same for four landmarks: those that four views see.
    quadrangles: Vec<FourLandmarks>,
}

/// Maps with their scores.
type ScoredHypotheses = Vec<(f64, Hypothesis)>;

/// Maps grown from many triples of views, the best score first.
pub fn search(
    problem: &Problem,
    options: &SolveOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Hypotheses, Error> {
    let SolveOptions { search, seed, .. } = options;
    let stages = &options.stages;
    check_size(problem, search)?;
    let drawn = triples::draw(problem, MIN_SHARED, search.triples, *seed, &stages.draw);
    let mut failure = None;
    let mut seeds = Vec::with_capacity(drawn.len());
    for (done, &views) in drawn.iter().enumerate() {
        goes_on(progress, "search", done, drawn.len())?;
        let (triples, _) = common_bearings(problem, views);
        match CalibratedTensor::estimate(&triples, 0) {
            Ok(tensor) => seeds.push((tensor.quality(), triples, views)),
            Err(error) => failure = Some(error),
        }
    }
    seeds.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut scored: ScoredHypotheses = Vec::new();
    let total = seeds.len().min(search.grown);
    for (triple, (_, triples, views)) in seeds.iter().take(total).enumerate() {
        goes_on(progress, "grow", triple, total)?;
        match three_view(triples, Method::Calibrated { reweights: 1 }) {
            Err(error) => failure = Some(error),
            Ok(solution) => {
                let rivals = are_rivals(problem, &solution.motions, triples.len());
                for motion in solution.motions.iter().take(1 + usize::from(rivals)) {
                    let mut map = Map::empty(problem.views(), problem.landmarks());
                    for (&view, pose) in views.iter().zip(motion.poses) {
                        map.poses[view] = Some(pose);
                    }
                    grow(problem, &mut map);
                    let score = score(problem, &map);
                    scored.push((score, Hypothesis { map, triple }));
                }
            }
        }
    }
    let four = drawn.is_empty() && problem.views() > 3;
    let mut quadrangles = Vec::new();
    if four {
        let needed = MIN_SHARED_WITH_FOURTH;
        let count = search.triples.min(stages.hypotheses.max_sweeps);
        let drawn = triples::draw(problem, needed, count, *seed, &stages.draw);
        quadrangles = FourLandmarks::shared(problem, &drawn);
        for (done, four) in quadrangles.iter().enumerate() {
            goes_on(progress, "search", done, quadrangles.len())?;
            scored.extend(hypotheses(four.solutions(problem), four.triple));
        }
        // Where no fourth view sees the same four, or other landmarks tell maps apart.
        if scored.is_empty() || problem.landmarks() > needed {
            let swept = sweep(problem, &drawn, Circle::WHOLE, progress)?;
            scored.extend(distinct(swept, &stages.hypotheses));
        }
    }
    if scored.is_empty() {
        return Err(failure.unwrap_or_else(|| too_few_shared(problem, &stages.draw)));
    }
    Ok(Hypotheses {
        maps: ranked(scored),
        unique: !four && problem.views() > 3,
        four,
        triples: seeds.into_iter().map(|(_, _, views)| views).collect(),
        quadrangles,
    })
}

/// Rejects a problem that is too small, and an empty search.
fn check_size(problem: &Problem, search: &SearchOptions) -> Result<(), Error> {
    if problem.views() < 3 {
        return Err(Error::TooFew {
            what: "views",
            needed: 3,
            got: problem.views(),
        });
    }
    for (what, got) in [
        ("triples of the search", search.triples),
        ("grown triples of the search", search.grown),
        ("candidates of the search", search.candidates),
    ] {
        if got == 0 {
            return Err(Error::TooFew {
                what,
                needed: 1,
                got,
            });
        }
    }
    Ok(())
}

impl Hypotheses {
    /// More maps, from tensors that noise may have turned into the estimated ones.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when `progress` says so.
    pub fn widened(
        &self,
        problem: &Problem,
        options: &SolveOptions,
        progress: &mut Option<Progress<'_>>,
    ) -> Result<Vec<Hypothesis>, Error> {
        let swept = options.search.swept;
        if self.four {
            let mut scored = Vec::new();
            for (done, four) in self.quadrangles.iter().take(swept).enumerate() {
                let watch = &mut || goes_on(progress, "search", done, swept);
                let found = four.along_circles(problem, Circle::WHOLE, watch)?;
                scored.extend(hypotheses(found, four.triple));
            }
            return Ok(ranked(scored));
        }
        let triples = &self.triples[..swept.min(self.triples.len())];
        let scored = sweep(problem, triples, Circle::AROUND_BEST, progress)?;
        Ok(ranked(distinct(scored, &options.stages.hypotheses)))
    }
}

/// Maps along the tensor circles of some triples.
fn sweep(
    problem: &Problem,
    triples: &[[usize; 3]],
    circle: Circle,
    progress: &mut Option<Progress<'_>>,
) -> Result<ScoredHypotheses, Error> {
    let mut scored = Vec::new();
    for (triple, &views) in triples.iter().enumerate() {
        let watch = &mut || goes_on(progress, "search", triple, triples.len());
        let found = along_circle(problem, views, circle, watch)?;
        scored.extend(hypotheses(found, triple));
    }
    Ok(scored)
}

/// Hypotheses from the maps of one triple.
fn hypotheses(maps: Vec<ScoredMap>, triple: usize) -> impl Iterator<Item = (f64, Hypothesis)> {
    maps.into_iter()
        .map(move |(score, map)| (score, Hypothesis { map, triple }))
}

/// Hypotheses by their scores, the best first.
fn ranked(mut scored: ScoredHypotheses) -> Vec<Hypothesis> {
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    scored.into_iter().map(|(_, found)| found).collect()
}

/// The error when no three views share enough landmarks.
fn too_few_shared(problem: &Problem, draw: &DrawOptions) -> Error {
    let needed = if problem.views() > 3 {
        MIN_SHARED_WITH_FOURTH
    } else {
        MIN_SHARED
    };
    too_few(problem, needed, draw)
}

/// The error of a method that needs this many shared landmarks.
pub fn too_few(problem: &Problem, needed: usize, draw: &DrawOptions) -> Error {
    Error::TooFew {
        what: "landmarks seen by the same three views",
        needed,
        got: triples::most_shared(problem, draw),
    }
}

/// The best of each cluster of maps, up to a maximum number of clusters, the best first.
fn distinct(mut scored: ScoredHypotheses, options: &HypothesisOptions) -> ScoredHypotheses {
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<((f64, Hypothesis), Map)> = Vec::new();
    for found in scored {
        let normalized = found.1.map.normalized();
        if kept
            .iter()
            .all(|(_, other)| !near(&normalized, other, options.cluster))
        {
            kept.push((found, normalized));
            if kept.len() == options.max_distinct {
                break;
            }
        }
    }
    kept.into_iter().map(|(found, _)| found).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of maps that end in the same minimum the best is kept, and so many in all.
    #[test]
    fn the_best_of_each_cluster_is_kept() {
        let map = |x: f64| {
            let mut map = Map::empty(3, 0);
            for (place, (x, y)) in map.poses.iter_mut().zip([(0.0, 0.0), (1.0, 0.0), (x, 1.0)]) {
                *place = Some(crate::geometry::pose(x, y, 0.1));
            }
            map
        };
        let options = HypothesisOptions::default();
        let scored = |places: &[(f64, f64)]| -> ScoredHypotheses {
            let one = |&(score, x): &(f64, f64)| {
                (
                    score,
                    Hypothesis {
                        map: map(x),
                        triple: 0,
                    },
                )
            };
            places.iter().map(one).collect()
        };
        let step = 0.1 * options.cluster;
        let places = [
            (3.0, 0.0),
            (1.0, step),
            (2.0, 1.0),
            (4.0, 1.0 + step),
            (0.5, 2.0),
        ];
        let found = distinct(scored(&places), &options);
        let scores: Vec<f64> = found.iter().map(|(score, _)| *score).collect();
        assert_eq!(scores, [0.5, 1.0, 2.0]);
        let two = HypothesisOptions {
            max_distinct: 2,
            ..options
        };
        assert_eq!(distinct(scored(&places), &two).len(), 2);
        assert!(ranked(scored(&places)).iter().map(|one| &one.map).eq([
            &map(2.0),
            &map(step),
            &map(1.0),
            &map(0.0),
            &map(1.0 + step)
        ]));
    }
}
