// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random minimal samples, five landmarks of three views, and the landmarks that agree with them.
//!
//! The trilinear relation (T1) depends on bearings modulo pi only, so a bearing that is off by pi is no
//! outlier here; signs are checked later.

use super::super::search::triples::{are_rivals, common_bearings};
use super::options::RobustOptions;
use crate::kernels::{CalibratedTensor, Motion, Triple};
use crate::problem::{Map, Problem};
use alloc::vec::Vec;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Landmarks of a sample. Not an option: the minimum that determines the tensor.
pub const SAMPLE: usize = 5;

/// Three views and the landmarks that they share.
pub struct Common {
    pub views: [usize; 3],
    landmarks: Vec<usize>,
    triples: Vec<Triple<f64>>,
    /// Variances of the three bearings of each landmark.
    variances: Vec<[f64; 3]>,
}

/// Three views with the motion that a consensus of landmarks supports.
pub struct Seed {
    pub views: [usize; 3],
    /// The landmarks that agree, modulo pi.
    pub landmarks: Vec<usize>,
    /// Both motions, the likelier first.
    pub motions: [Motion<f64>; 2],
    /// Number of landmarks that agree, each weighted by how well it fits.
    pub support: f64,
}

impl Seed {
    /// The motions that are worth growing: both, unless the signs of the bearings decide.
    pub fn branches(&self, problem: &Problem) -> impl Iterator<Item = &Motion<f64>> {
        let rivals = are_rivals(problem, &self.motions, 2 * self.landmarks.len());
        self.motions.iter().take(1 + usize::from(rivals))
    }

    /// Its poses: one map, or two where the signs of the bearings do not decide between the motions.
    pub fn starts(&self, problem: &Problem) -> Vec<Map> {
        let motions = self.branches(problem);
        motions
            .map(|motion| {
                let mut map = Map::empty(problem.views(), problem.landmarks());
                for (&view, pose) in self.views.iter().zip(motion.poses) {
                    map.poses[view] = Some(pose);
                }
                map
            })
            .collect()
    }
}

impl Common {
    pub fn new(problem: &Problem, views: [usize; 3]) -> Self {
        let (triples, landmarks) = common_bearings(problem, views);
        let variance = |view: usize, landmark: usize| {
            let seen = problem.of_view(view);
            let place = seen.binary_search_by_key(&landmark, |s| s.landmark);
            place.map_or(1.0, |k| {
                let sigma = 1.0 / seen[k].weight;
                sigma * sigma
            })
        };
        let variances = landmarks
            .iter()
            .map(|&landmark| views.map(|view| variance(view, landmark)))
            .collect();
        Self {
            views,
            landmarks,
            triples,
            variances,
        }
    }

    /// How well all landmarks agree with a tensor: each counts between 0 and 1.
    fn support(&self, tensor: &CalibratedTensor<f64>, bound: f64) -> f64 {
        let most = bound * bound;
        let lost = self
            .triples
            .iter()
            .zip(&self.variances)
            .map(|(triple, variances)| tensor.sampson_square(triple, variances).min(most))
            .fold(0.0, |sum, square| sum + square);
        self.triples.len() as f64 - (lost / most)
    }

    /// The landmarks that agree with a tensor.
    fn agreeing(&self, tensor: &CalibratedTensor<f64>, bound: f64) -> impl Iterator<Item = usize> {
        let most = bound * bound;
        (0..self.triples.len())
            .filter(move |&k| tensor.sampson_square(&self.triples[k], &self.variances[k]) <= most)
    }

    /// The best of some random samples, re-estimated from all landmarks that agree.
    ///
    /// `None` when no sample has a motion.
    pub fn best_seed(&self, options: &RobustOptions, random: &mut ChaCha8Rng) -> Option<Seed> {
        let count = self.triples.len();
        if count < SAMPLE {
            return None;
        }
        let mut order: Vec<usize> = (0..count).collect();
        let mut kept: Vec<(f64, CalibratedTensor<f64>)> = Vec::new();
        for _ in 0..options.samples {
            for place in 0..SAMPLE {
                order.swap(place, random.random_range(place..count));
            }
            let sample: [Triple<f64>; SAMPLE] = core::array::from_fn(|k| self.triples[order[k]]);
            let Ok(tensor) = CalibratedTensor::estimate(&sample, 0) else {
                continue;
            };
            let support = self.support(&tensor, options.sample_bound);
            let place = kept.partition_point(|(other, _)| *other >= support);
            if place < options.kept_samples {
                kept.insert(place, (support, tensor));
                kept.truncate(options.kept_samples);
            }
        }
        kept.into_iter()
            .map(|(_, tensor)| self.improve(tensor, options))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .and_then(|(support, tensor)| self.seed(&tensor, support, options.sample_bound))
    }

    /// Re-estimates a tensor from the landmarks that agree with it, within ever narrower bounds.
    fn improve(
        &self,
        mut tensor: CalibratedTensor<f64>,
        options: &RobustOptions,
    ) -> (f64, CalibratedTensor<f64>) {
        let mut agreeing: Vec<Triple<f64>> = Vec::with_capacity(self.triples.len());
        for bound in options.narrower_bounds {
            agreeing.clear();
            agreeing.extend(self.agreeing(&tensor, bound).map(|k| self.triples[k]));
            if agreeing.len() <= SAMPLE {
                break;
            }
            match CalibratedTensor::estimate(&agreeing, 1) {
                Ok(better) => tensor = better,
                Err(_) => break,
            }
        }
        (self.support(&tensor, options.sample_bound), tensor)
    }

    fn seed(&self, tensor: &CalibratedTensor<f64>, support: f64, bound: f64) -> Option<Seed> {
        let agreeing: Vec<usize> = self.agreeing(tensor, bound).collect();
        let triples: Vec<Triple<f64>> = agreeing.iter().map(|&k| self.triples[k]).collect();
        let [first, second] = tensor.motions(&triples).ok()?;
        Some(Seed {
            views: self.views,
            landmarks: agreeing.into_iter().map(|k| self.landmarks[k]).collect(),
            motions: if first.inconsistent <= second.inconsistent {
                [first, second]
            } else {
                [second, first]
            },
            support,
        })
    }
}
