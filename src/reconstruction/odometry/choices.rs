// SPDX-License-Identifier: MIT OR Apache-2.0
//! Choices of a growth between places that are about as good: the best, or any of them when it is repeated.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What a growth chooses where several places explain what is known about as well.
pub struct Choices {
    /// None for the best each time.
    random: Option<ChaCha8Rng>,
}

impl Choices {
    /// The best each time.
    pub fn best() -> Self {
        Self { random: None }
    }

    /// Any of the places that are about as good, the same for the same seed.
    pub fn of_seed(seed: u64) -> Self {
        Self {
            random: Some(ChaCha8Rng::seed_from_u64(seed)),
        }
    }

    /// Whether the best is not always taken.
    pub fn vary(&self) -> bool {
        self.random.is_some()
    }

    /// One of so many places, of which the first is the best.
    pub fn among(&mut self, count: usize) -> usize {
        match &mut self.random {
            Some(random) if count > 1 => random.random_range(0..count),
            _ => 0,
        }
    }

    /// One of the best few, whose number is `most`, of so many.
    pub fn among_first(&mut self, count: usize, most: usize) -> usize {
        self.among(count.min(most))
    }
}
