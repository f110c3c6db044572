// SPDX-License-Identifier: MIT OR Apache-2.0
//! Triples of views that share landmarks.

use super::options::DrawOptions;
use crate::kernels::{Motion, Triple};
use crate::problem::Problem;
use alloc::collections::BTreeSet;
use alloc::vec;
use alloc::vec::Vec;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Bit sets of the landmarks that each view sees, for views and landmarks that can be in a triple.
struct Sight {
    /// The views that see at least as many landmarks as are needed.
    views: Vec<usize>,
    words: usize,
    bits: Vec<u64>,
}

impl Sight {
    fn new(problem: &Problem, needed: usize) -> Self {
        let views: Vec<usize> = (0..problem.views())
            .filter(|&view| problem.of_view(view).len() >= needed)
            .collect();
        // Renumber the landmarks: indices may have gaps.
        let mut number = vec![0; problem.landmarks()];
        let mut count = 0;
        for (landmark, number) in number.iter_mut().enumerate() {
            *number = count;
            count += usize::from(problem.of_landmark(landmark).len() >= 3);
        }
        let words = count.div_ceil(64).max(1);
        let mut bits = vec![0_u64; words * views.len()];
        for (slot, &view) in views.iter().enumerate() {
            for s in problem.of_view(view) {
                if problem.of_landmark(s.landmark).len() >= 3 {
                    let bit = number[s.landmark];
                    bits[slot * words + bit / 64] |= 1 << (bit % 64);
                }
            }
        }
        Self { views, words, bits }
    }

    /// How many landmarks three views share; views by their place in the list.
    fn common(&self, slots: [usize; 3]) -> usize {
        let [a, b, c] = slots.map(|v| &self.bits[v * self.words..(v + 1) * self.words]);
        a.iter()
            .zip(b)
            .zip(c)
            .map(|((a, b), c)| (a & b & c).count_ones() as usize)
            .sum()
    }

    /// All triples of the first `views` in the list.
    fn triples(&self, views: usize) -> impl Iterator<Item = [usize; 3]> {
        let views = views.min(self.views.len());
        (0..views).flat_map(move |i| {
            (i + 1..views).flat_map(move |j| (j + 1..views).map(move |k| [i, j, k]))
        })
    }
}

/// The most landmarks that any three views share, among the first few dozen views.
pub fn most_shared(problem: &Problem, options: &DrawOptions) -> usize {
    let sight = Sight::new(problem, 1);
    let all = sight
        .triples(options.listed_views)
        .map(|slots| sight.common(slots));
    all.max().unwrap_or(0)
}

/// Up to `count` different triples of views that share at least `needed` landmarks, in random order.
pub fn draw(
    problem: &Problem,
    needed: usize,
    count: usize,
    seed: u64,
    options: &DrawOptions,
) -> Vec<[usize; 3]> {
    let sight = Sight::new(problem, needed);
    let views = sight.views.len();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut triples: Vec<[usize; 3]> = Vec::new();
    if views <= options.listed_views {
        let all = sight.triples(views);
        triples.extend(all.filter(|&slots| sight.common(slots) >= needed));
        // The first `count` places of a random permutation.
        for place in 0..count.min(triples.len()) {
            let other = random.random_range(place..triples.len());
            triples.swap(place, other);
        }
        triples.truncate(count);
    } else {
        // A view, a landmark that it sees, two other views that see it too.
        let mut slot = vec![usize::MAX; problem.views()];
        for (place, &view) in sight.views.iter().enumerate() {
            slot[view] = place;
        }
        let mut known = BTreeSet::new();
        for _ in 0..options.draws.saturating_mul(count) {
            let seen = problem.of_view(sight.views[random.random_range(0..views)]);
            let first = seen[random.random_range(0..seen.len())];
            let others = problem.of_landmark(first.landmark);
            let mut other = || {
                let k = others[random.random_range(0..others.len())];
                slot[problem.sightings()[k].view]
            };
            let mut triple = [slot[first.view], other(), other()];
            triple.sort_unstable();
            let [i, j, k] = triple;
            if i < j
                && j < k
                && k < usize::MAX
                && sight.common(triple) >= needed
                && known.insert(triple)
            {
                triples.push(triple);
                if triples.len() == count {
                    break;
                }
            }
        }
    }
    triples
        .into_iter()
        .map(|slots| slots.map(|slot| sight.views[slot]))
        .collect()
}

/// The bearings of the landmarks that three views share, and the indices of these landmarks.
pub fn common_bearings(problem: &Problem, views: [usize; 3]) -> (Vec<Triple<f64>>, Vec<usize>) {
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

/// Whether the second of two motions may be the right one: it violates cheirality hardly more often than the first,
/// or bearings are modulo pi.
pub fn are_rivals(problem: &Problem, motions: &[Motion<f64>; 2], shared: usize) -> bool {
    let [first, second] = motions;
    let margin = 1 + shared / 8;
    !problem.is_oriented() || second.inconsistent <= first.inconsistent + margin
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::Sighting;
    use nalgebra::UnitComplex;

    /// Views of a table with gaps, by what they see.
    fn seen(views: &[&[usize]], landmarks: usize) -> Problem {
        let sightings = views.iter().enumerate().flat_map(|(view, seen)| {
            seen.iter().map(move |&landmark| Sighting {
                view,
                landmark,
                bearing: 0.01 * (100 * view + landmark) as f64,
                sigma: 0.1,
            })
        });
        Problem::new(views.len(), landmarks, &sightings.collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn common_bearings_are_of_what_all_three_see() {
        let problem = seen(
            &[&[0, 2, 3, 7, 9], &[1, 2, 7, 8, 9], &[0, 2, 4, 7], &[9]],
            10,
        );
        let (triples, landmarks) = common_bearings(&problem, [2, 0, 1]);
        assert_eq!(landmarks, [2, 7]);
        for (triple, landmark) in triples.iter().zip(landmarks) {
            for (bearing, view) in triple.iter().zip([2, 0, 1]) {
                let expected = UnitComplex::new(0.01 * (100 * view + landmark) as f64);
                assert!(bearing.angle_to(&expected).abs() < 1e-12);
            }
        }
        assert!(common_bearings(&problem, [0, 2, 3]).1.is_empty());
        assert_eq!(most_shared(&problem, &DrawOptions::default()), 2);
    }

    /// Listed or drawn, triples are distinct, ordered and share enough, and no more come than are wanted.
    #[test]
    fn triples_share_what_is_needed() {
        // Windows of a hundred landmarks in a row, of which every third is seen by fewer than three views.
        let windows: Vec<Vec<usize>> = (0..30)
            .map(|view| (5 * view..5 * view + 20).collect())
            .collect();
        let windows: Vec<&[usize]> = windows.iter().map(Vec::as_slice).collect();
        let problem = seen(&windows, 180);
        let listed = DrawOptions::default();
        let drawn = DrawOptions {
            listed_views: 10,
            ..listed
        };
        for (options, needed, count, all) in [
            // Two views next to each other and one up to three places on.
            (listed, 5, usize::MAX / 100, 28 + 2 * 27),
            (listed, 10, 1000, 28),
            (listed, 10, 7, 7),
            (drawn, 5, 40, 40),
            (drawn, 11, 10, 0),
            (listed, 11, 10, 0),
        ] {
            let found = draw(&problem, needed, count.min(10_000), 3, &options);
            assert_eq!(found.len(), all, "{needed} {count}");
            let mut distinct = found.clone();
            distinct.sort_unstable();
            distinct.dedup();
            assert_eq!(distinct.len(), all);
            for views in found {
                assert!(views.is_sorted_by(|a, b| a < b));
                assert!(common_bearings(&problem, views).1.len() >= needed);
            }
        }
        assert_eq!(most_shared(&problem, &listed), 10);
        // Every triple has the same chance.
        let mut times = [0; 30];
        for seed in 0..50 {
            for views in draw(&problem, 10, 3, seed, &listed) {
                times[views[0]] += 1;
            }
        }
        assert!(
            times[..28].iter().filter(|&&times| times > 0).count() > 20,
            "{times:?}"
        );
    }

    #[test]
    fn a_motion_is_a_rival_up_to_a_few_wrong_signs() {
        let problem = seen(&[&[0], &[0], &[0]], 1);
        let motion = |inconsistent: usize| Motion {
            poses: [crate::geometry::pose(0.0, 0.0, 0.0); 3],
            inconsistent,
            cost: 0.0,
        };
        for (shared, second, rivals) in [(7, 3, true), (7, 4, false), (16, 5, true), (16, 6, false)]
        {
            let motions = [motion(2), motion(second)];
            assert_eq!(
                are_rivals(&problem, &motions, shared),
                rivals,
                "{shared} {second}"
            );
            assert!(are_rivals(&problem.clone().unoriented(), &motions, shared));
        }
    }

    /// Each landmark that three views share counts once, however many there are.
    #[test]
    fn all_of_many_shared_landmarks_count() {
        let all: Vec<usize> = (0..130).collect();
        for landmarks in [63, 64, 65, 129, 130] {
            let problem = seen(&[&all[..landmarks]; 3], landmarks);
            assert_eq!(Sight::new(&problem, 5).common([0, 1, 2]), landmarks);
        }
    }
}
