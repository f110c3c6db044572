// SPDX-License-Identifier: MIT OR Apache-2.0
//! Contamination of the bearings with outliers.

use super::{Scene, wrap};
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Draws of a partner for a swap before it is given up, because the view probably has none left.
const PARTNERS: usize = 64;

/// How bearings are made outliers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outliers {
    /// A third of the outliers (rounded down to an even number) are swapped in pairs within a view, a third are turned
    /// by pi, and the rest are random.
    Mixture,
    /// Random bearings, uniform over the circle.
    Uniform,
    /// Exchanged identities: within each view the bearings of some landmarks are permuted so that none keeps its own
    /// (a derangement).
    Exchanged,
    /// Two landmarks under one identity: the sightings of pairs of landmarks are merged, one of the two at random
    /// where a view sees both. The identity is that of the landmark with more sightings among them, the outliers are
    /// those of the other, which is left without a sighting.
    Merged,
}

impl Outliers {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Mixture, Self::Uniform, Self::Exchanged, Self::Merged];

    /// The name of the variant in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mixture => "mixture",
            Self::Uniform => "uniform",
            Self::Exchanged => "exchanged",
            Self::Merged => "merged",
        }
    }
}

impl Scene {
    /// The scene with a share of its bearings made outliers, and which these are, in the order of
    /// [`Scene::bearings`].
    ///
    /// By chance a random or an exchanged bearing may still be right. `share` is clamped to 0 to 1, and the number of
    /// outliers is rounded. [`Outliers::Exchanged`] makes one fewer where a single one is left that no view can take.
    /// [`Outliers::Merged`] merges pairs until there are as many or no pair is left: the last pair may exceed the
    /// share, and at most half of the bearings that are left are outliers. The same arguments give the same scene.
    ///
    /// # Example
    /// ```
    /// use bearslam::{Arena, Layout, Outliers, simulate};
    /// let scene = simulate(Layout::Mixed, 8, 15, 0.01, 1, Arena::default())?;
    /// let (dirty, wrong) = scene.contaminate(Outliers::Exchanged, 0.3, 1);
    /// assert_eq!(wrong.iter().filter(|wrong| **wrong).count(), 36);
    /// let changed = scene.bearings.iter().zip(&dirty.bearings).map(|(a, b)| a != b);
    /// assert!(changed.eq(wrong));
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn contaminate(&self, kind: Outliers, share: f64, seed: u64) -> (Self, Vec<bool>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // A stream of its own for each kind.
        random.set_stream(kind as u64);
        let mut scene = self.clone();
        let mut order: Vec<usize> = (0..scene.bearings.len())
            .filter(|&k| !scene.bearings[k].is_nan())
            .collect();
        let count = share_of(share, order.len());
        let mut wrong = vec![false; scene.bearings.len()];
        if kind == Outliers::Merged {
            scene.merge(count, &mut wrong, &mut random);
            return (scene, wrong);
        }
        shuffle(&mut order, &mut random);
        match kind {
            Outliers::Exchanged => scene.exchange(&order, count, &mut wrong, &mut random),
            Outliers::Uniform => {
                for &k in &order[..count] {
                    scene.bearings[k] = anywhere(&mut random);
                    wrong[k] = true;
                }
            }
            _ => scene.mix(order, count, &mut wrong, &mut random),
        }
        (scene, wrong)
    }

    /// A third of the bearings swapped, a third turned, and the rest random.
    fn mix(
        &mut self,
        order: Vec<usize>,
        count: usize,
        wrong: &mut [bool],
        random: &mut ChaCha8Rng,
    ) {
        let mut order = order.into_iter();
        let (swaps, turns) = (count / 3 / 2, count / 3);
        let columns = self.landmarks.len();
        let mut done = 0;
        for _ in 0..swaps {
            let Some(k) = order.find(|&k| !wrong[k]) else {
                break;
            };
            let row = k / columns * columns;
            let partner = (0..PARTNERS)
                .map(|_| row + random.random_range(0..columns))
                .find(|&other| other != k && !wrong[other] && !self.bearings[other].is_nan());
            if let Some(other) = partner {
                self.bearings.swap(k, other);
                (wrong[k], wrong[other]) = (true, true);
                done += 2;
            }
        }
        for k in order {
            if wrong[k] {
                continue;
            }
            if done == count {
                break;
            }
            self.bearings[k] = if done < 2 * swaps + turns {
                wrap(self.bearings[k] + PI)
            } else {
                anywhere(random)
            };
            wrong[k] = true;
            done += 1;
        }
    }

    /// Permutes bearings within their views: `count` of them, the first in this order that leave none alone in its view.
    fn exchange(
        &mut self,
        order: &[usize],
        count: usize,
        wrong: &mut [bool],
        random: &mut ChaCha8Rng,
    ) {
        let columns = self.landmarks.len();
        let mut rows: Vec<Vec<usize>> = vec![Vec::new(); self.poses.len()];
        let mut done = 0;
        // The first of a view waits for a second.
        let mut waiting: Vec<Option<usize>> = vec![None; self.poses.len()];
        // What no longer fits as a pair may still join a view that has one.
        for only_join in [false, true] {
            for &k in order {
                let row = k / columns;
                if done == count || wrong[k] {
                    continue;
                }
                let first = if rows[row].is_empty() {
                    match waiting[row].take() {
                        _ if only_join => continue,
                        None => {
                            waiting[row] = Some(k);
                            continue;
                        }
                        Some(_) if done + 2 > count => continue,
                        first => first,
                    }
                } else {
                    None
                };
                for k in first.into_iter().chain([k]) {
                    rows[row].push(k);
                    wrong[k] = true;
                    done += 1;
                }
            }
        }
        for mut row in rows {
            // One cycle through all of them, in random order.
            shuffle(&mut row, random);
            for last in (1..row.len()).rev() {
                self.bearings.swap(row[0], row[last]);
            }
        }
    }

    /// Merges the sightings of random pairs of landmarks until `count` are wrong.
    fn merge(&mut self, count: usize, wrong: &mut [bool], random: &mut ChaCha8Rng) {
        let columns = self.landmarks.len();
        let mut landmarks: Vec<usize> = (0..columns)
            .filter(|&j| (0..self.poses.len()).any(|i| !self.bearings[i * columns + j].is_nan()))
            .collect();
        shuffle(&mut landmarks, random);
        let mut done = 0;
        for pair in landmarks.chunks_exact(2) {
            if done >= count {
                break;
            }
            // Of each view that sees one of them: which.
            let seen: Vec<(usize, usize)> = (0..self.poses.len())
                .filter_map(|view| {
                    let sees = |which: usize| !self.bearings[view * columns + pair[which]].is_nan();
                    match (sees(0), sees(1)) {
                        (true, true) => Some((view, random.random_range(0..2))),
                        (true, false) => Some((view, 0)),
                        (false, true) => Some((view, 1)),
                        (false, false) => None,
                    }
                })
                .collect();
            let of_second = seen.iter().filter(|(_, which)| *which == 1).count();
            let named = usize::from(2 * of_second > seen.len());
            for (view, which) in seen {
                let row = view * columns;
                let bearing = self.bearings[row + pair[which]];
                self.bearings[row + pair[1 - named]] = f64::NAN;
                self.bearings[row + pair[named]] = bearing;
                wrong[row + pair[named]] = which != named;
                done += usize::from(which != named);
            }
        }
    }
}

/// A random bearing.
fn anywhere(random: &mut ChaCha8Rng) -> f64 {
    PI - TAU * random.random::<f64>()
}

/// Puts the items into a random order.
fn shuffle(items: &mut [usize], random: &mut ChaCha8Rng) {
    let all = items.len();
    for place in 0..all {
        items.swap(place, random.random_range(place..all));
    }
}

/// A share of a number, rounded.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 0 and all"
)]
fn share_of(share: f64, all: usize) -> usize {
    (share.clamp(0.0, 1.0) * all as f64 + 0.5) as usize
}
