// SPDX-License-Identifier: MIT OR Apache-2.0
//! Statistics of outcomes that can be merged in any order.

use super::trial::TrialOutcome;
use crate::simulate::Bound;
use alloc::collections::BTreeMap;

/// Statistics of many outcomes: counts, integer sums, and histograms.
///
/// Everything is an integer, so that merging in any order gives the same bits.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Trials.
    pub trials: u64,
    /// Trials whose cost is not the least known one, see [`TrialOutcome::failed`].
    pub failures: u64,
    /// Of these, those without any map.
    pub without_map: u64,
    /// Trials whose map leaves a view or a landmark undetermined.
    pub incomplete: u64,
    /// Linear systems solved.
    pub iterations: u64,
    /// Total time \[ns\].
    pub nanoseconds: u64,
    /// Histograms, one for each of [`Quantity::ALL`].
    pub histograms: [Histogram; 4],
}

/// The quantities with a histogram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Root mean square error of the positions of views and landmarks.
    Position,
    /// Root mean square error of the headings \[rad\].
    Heading,
    /// [`Quantity::Position`] over its bound.
    PositionOverBound,
    /// [`Quantity::Heading`] over its bound.
    HeadingOverBound,
}

impl Quantity {
    /// In the order of [`Tally::histograms`].
    pub const ALL: [Self; 4] = [
        Self::Position,
        Self::Heading,
        Self::PositionOverBound,
        Self::HeadingOverBound,
    ];
}

impl Tally {
    /// Adds the outcome of a trial.
    pub fn add(&mut self, outcome: &TrialOutcome, bound: Option<&Bound>) {
        self.trials += 1;
        self.failures += u64::from(outcome.failed);
        self.without_map += u64::from(outcome.errors.is_none());
        self.incomplete += u64::from(outcome.incomplete);
        self.iterations += outcome.iterations as u64;
        self.nanoseconds += outcome.nanoseconds;
        if let Some(errors) = &outcome.errors {
            let [position, heading, over_position, over_heading] = &mut self.histograms;
            position.add(errors.position_rms);
            heading.add(errors.heading_rms);
            if let Some(bound) = bound {
                over_position.add(errors.position_rms / bound.position_rms);
                over_heading.add(errors.heading_rms / bound.heading_rms);
            }
        }
    }

    /// Adds another tally.
    pub fn merge(&mut self, other: &Self) {
        self.trials += other.trials;
        self.failures += other.failures;
        self.without_map += other.without_map;
        self.incomplete += other.incomplete;
        self.iterations += other.iterations;
        self.nanoseconds += other.nanoseconds;
        for (histogram, other) in self.histograms.iter_mut().zip(&other.histograms) {
            histogram.merge(other);
        }
    }
}

/// Counts over logarithmic bins: gives any quantile to half a percent, and does not depend on the order of values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Histogram {
    counts: BTreeMap<i16, u64>,
}

/// Bins for every factor of two: each is 1.1 % wide.
pub const BINS_PER_OCTAVE: i16 = 64;

/// Values below 2 to the power of minus this, and above 2 to the power of this, share the outermost bins.
const OCTAVES: i16 = 64;

impl Histogram {
    /// Adds a non-negative value. Zero counts in the lowest bin, NaN in none.
    pub fn add(&mut self, value: f64) {
        if let Some(bin) = Self::bin(value) {
            *self.counts.entry(bin).or_default() += 1;
        }
    }

    /// Adds another histogram.
    pub fn merge(&mut self, other: &Self) {
        for (&bin, &count) in &other.counts {
            *self.counts.entry(bin).or_default() += count;
        }
    }

    /// Bins and their counts, in ascending order. Bin k holds the values from `2^(k/64)` to `2^((k+1)/64)`.
    pub fn counts(&self) -> impl Iterator<Item = (i16, u64)> {
        self.counts.iter().map(|(&bin, &count)| (bin, count))
    }

    /// The `q` quantile of the values, `q` from 0 to 1, to half a percent; NaN when there are none.
    pub fn quantile(&self, q: f64) -> f64 {
        let total: u64 = self.counts.values().sum();
        // The rank is exact as long as there are fewer than 2^53 values.
        let rank = q.clamp(0.0, 1.0) * total.saturating_sub(1) as f64;
        let mut below = 0;
        for (bin, count) in self.counts() {
            below += count;
            if below as f64 > rank {
                return Self::middle(bin);
            }
        }
        f64::NAN
    }

    /// The root mean square of the values, to half a percent at worst; NaN when there are none.
    pub fn root_mean_square(&self) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for (bin, count) in self.counts() {
            sum += Self::middle(bin).powi(2) * count as f64;
            total += count as f64;
        }
        (sum / total).sqrt()
    }

    fn bin(value: f64) -> Option<i16> {
        let limit = f64::from(OCTAVES * BINS_PER_OCTAVE);
        let bin = (value.log2() * f64::from(BINS_PER_OCTAVE)).floor();
        #[expect(clippy::cast_possible_truncation, reason = "clamped")]
        (!bin.is_nan()).then(|| bin.clamp(-limit, limit - 1.0) as i16)
    }

    /// The geometric middle of a bin.
    fn middle(bin: i16) -> f64 {
        ((f64::from(bin) + 0.5) / f64::from(BINS_PER_OCTAVE)).exp2()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_values_to_half_a_percent() {
        let mut histogram = Histogram::default();
        let values: alloc::vec::Vec<f64> = (1..=1001).map(|k| 1e-3 * f64::from(k)).collect();
        values.iter().rev().for_each(|&value| histogram.add(value));
        for (q, rank) in [(0.0, 0), (0.1, 100), (0.5, 500), (0.9, 900), (1.0, 1000)] {
            let expected = values[rank];
            let found = histogram.quantile(q);
            assert!(
                (found / expected - 1.0).abs() < 0.0055,
                "{q}: {found} {expected}"
            );
        }
        let mean = values.iter().map(|v| v * v).sum::<f64>() / 1001.0;
        assert!((histogram.root_mean_square() / mean.sqrt() - 1.0).abs() < 0.001);
    }

    #[test]
    fn odd_values_have_a_place() {
        let mut histogram = Histogram::default();
        assert!(histogram.quantile(0.5).is_nan());
        for value in [0.0, f64::INFINITY, f64::NAN, 1e300] {
            histogram.add(value);
        }
        assert_eq!(histogram.counts().count(), 2);
        assert_eq!(histogram.counts().map(|(_, count)| count).sum::<u64>(), 3);
    }
}
