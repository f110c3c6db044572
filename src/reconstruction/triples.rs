// SPDX-License-Identifier: MIT OR Apache-2.0
//! Triples of views that share landmarks.

use crate::estimation::Problem;
use crate::kernels::Triple;
use crate::scalar::Real;
use alloc::vec::Vec;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Views up to which all triples are listed; beyond, they are drawn.
const LISTED_VIEWS: usize = 40;

/// Draws per triple wanted when they are not listed.
const DRAWS: usize = 50;

/// Bit sets of the landmarks that each view sees.
pub struct Sight {
    words: usize,
    bits: Vec<u64>,
}

impl Sight {
    pub fn new<T: Real>(problem: &Problem<T>) -> Self {
        let words = problem.landmarks().div_ceil(64);
        let mut bits = alloc::vec![0_u64; words * problem.views()];
        for s in problem.sightings() {
            bits[s.view * words + s.landmark / 64] |= 1 << (s.landmark % 64);
        }
        Self { words, bits }
    }

    /// How many landmarks all three views see.
    pub fn common(&self, views: [usize; 3]) -> usize {
        let [a, b, c] = views.map(|v| &self.bits[v * self.words..(v + 1) * self.words]);
        a.iter()
            .zip(b)
            .zip(c)
            .map(|((a, b), c)| (a & b & c).count_ones() as usize)
            .sum()
    }
}

/// Up to `count` different triples of views that share at least `needed` landmarks, in random order.
pub fn draw<T: Real>(
    problem: &Problem<T>,
    needed: usize,
    count: usize,
    seed: u64,
) -> Vec<[usize; 3]> {
    let sight = Sight::new(problem);
    let views = problem.views();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut triples = Vec::new();
    if views <= LISTED_VIEWS {
        for i in 0..views {
            for j in i + 1..views {
                for k in j + 1..views {
                    if sight.common([i, j, k]) >= needed {
                        triples.push([i, j, k]);
                    }
                }
            }
        }
        // The first `count` places of a random permutation.
        for place in 0..count.min(triples.len()) {
            let other = random.random_range(place..triples.len());
            triples.swap(place, other);
        }
        triples.truncate(count);
    } else {
        for _ in 0..DRAWS * count {
            let mut triple = [0; 3].map(|_: usize| random.random_range(0..views));
            triple.sort_unstable();
            let [i, j, k] = triple;
            if i < j && j < k && sight.common(triple) >= needed && !triples.contains(&triple) {
                triples.push(triple);
                if triples.len() == count {
                    break;
                }
            }
        }
    }
    triples
}

/// The bearings of the landmarks that three views share, and which these are.
pub fn common_bearings<T: Real>(
    problem: &Problem<T>,
    views: [usize; 3],
) -> (Vec<Triple<T>>, Vec<usize>) {
    let [first, second, third] = views.map(|view| problem.of_view(view));
    let (mut j, mut k) = (0, 0);
    let mut triples = Vec::with_capacity(first.len());
    let mut landmarks = Vec::with_capacity(first.len());
    for s in first {
        while j < second.len() && second[j].landmark < s.landmark {
            j += 1;
        }
        while k < third.len() && third[k].landmark < s.landmark {
            k += 1;
        }
        if let (Some(t), Some(u)) = (second.get(j), third.get(k))
            && t.landmark == s.landmark
            && u.landmark == s.landmark
        {
            triples.push([s.bearing, t.bearing, u.bearing]);
            landmarks.push(s.landmark);
        }
    }
    (triples, landmarks)
}
