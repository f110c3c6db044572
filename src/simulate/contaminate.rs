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

impl Scene {
    /// The scene with a fraction of its bearings made outliers, and which these are, in the order of
    /// [`Scene::bearings`].
    ///
    /// A third of them (rounded down to an even number) are swapped in pairs within a view: wrong
    /// correspondences. A third are turned by pi, and the rest replaced by random bearings. By chance a random
    /// or a swapped bearing may still be right.
    ///
    /// `share` is clamped to 0 to 1. The same arguments give the same scene.
    ///
    /// # Example
    /// ```
    /// use bearslam::{Arena, Layout, simulate};
    /// let scene = simulate(Layout::Mixed, 8, 15, 0.01, 1, Arena::default())?;
    /// let (dirty, wrong) = scene.contaminate(0.3, 1);
    /// assert_eq!(wrong.iter().filter(|wrong| **wrong).count(), 36);
    /// let changed = scene.bearings.iter().zip(&dirty.bearings).map(|(a, b)| a != b);
    /// assert!(changed.eq(wrong));
    /// # Ok::<(), bearslam::Error>(())
    /// ```
    pub fn contaminate(&self, share: f64, seed: u64) -> (Self, Vec<bool>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut scene = self.clone();
        let mut wrong = vec![false; scene.bearings.len()];
        let mut left: Vec<usize> = (0..scene.bearings.len())
            .filter(|&k| !scene.bearings[k].is_nan())
            .collect();
        let count = share_of(share, left.len());
        // Shuffle: bearings are made outliers in this order.
        let all = left.len();
        for place in 0..all {
            left.swap(place, random.random_range(place..all));
        }
        let mut order = left.into_iter();
        let (swaps, turns) = (count / 3 / 2, count / 3);
        let columns = scene.landmarks.len();
        let mut done = 0;
        for _ in 0..swaps {
            let Some(k) = order.find(|&k| !wrong[k]) else {
                break;
            };
            let row = k / columns * columns;
            let partner = (0..PARTNERS)
                .map(|_| row + random.random_range(0..columns))
                .find(|&other| other != k && !wrong[other] && !scene.bearings[other].is_nan());
            if let Some(other) = partner {
                scene.bearings.swap(k, other);
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
            scene.bearings[k] = if done < 2 * swaps + turns {
                wrap(scene.bearings[k] + PI)
            } else {
                PI - TAU * random.random::<f64>()
            };
            wrong[k] = true;
            done += 1;
        }
        (scene, wrong)
    }
}

/// A fraction of a number, rounded.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 0 and all"
)]
fn share_of(share: f64, all: usize) -> usize {
    (share.clamp(0.0, 1.0) * all as f64 + 0.5) as usize
}
