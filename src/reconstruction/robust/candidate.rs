// SPDX-License-Identifier: MIT OR Apache-2.0
//! What the search for a consensus keeps of each seed.

use super::consensus::Consensus;
use super::options::RobustOptions;

/// A rough minimum, and the three views whose seed has led to it.
pub struct Candidate {
    pub consensus: Consensus,
    pub views: [usize; 3],
    /// Number of bearings that it explains after assignment.
    pub explained: usize,
}

impl Candidate {
    /// Whether it is as low as any, and another triple of views has led to nearly the same.
    pub fn is_confirmed_by(&self, found: &[Self], options: &RobustOptions) -> bool {
        let agrees = |other: &Self| {
            let percent = options.confirming_percent;
            other.consensus.agrees(&self.consensus, percent)
        };
        let is_lowest = |other: &Self| other.consensus.cost >= self.consensus.cost;
        found.iter().all(|other| is_lowest(other) || agrees(other))
            && found
                .iter()
                .any(|other| other.views != self.views && agrees(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    fn candidate(inliers: &[bool], cost: f64, views: [usize; 3]) -> Candidate {
        Candidate {
            consensus: Consensus::with_inliers(inliers, cost),
            views,
            explained: 0,
        }
    }

    /// A fixed point is confirmed by another triple of views with the same inliers, if none is lower with others.
    #[test]
    fn another_triple_confirms_the_lowest_fixed_point() {
        let options = RobustOptions::default();
        let (a, b) = ([true, true, false], [true, false, true]);
        let (one, two) = ([0, 1, 2], [0, 1, 3]);
        let now = candidate(&a, 1.0, one);
        for (found, confirmed) in [
            (vec![], false),
            (vec![candidate(&a, 1.0, one)], false),
            (vec![candidate(&a, 1.0, two)], true),
            (vec![candidate(&b, 1.1, two)], false),
            (vec![candidate(&a, 1.0, two), candidate(&b, 1.1, one)], true),
            (
                vec![candidate(&a, 1.0, two), candidate(&b, 0.9, one)],
                false,
            ),
            (vec![candidate(&a, 0.9, two)], true),
        ] {
            assert_eq!(now.is_confirmed_by(&found, &options), confirmed);
        }
    }
}
