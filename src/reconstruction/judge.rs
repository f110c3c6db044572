// SPDX-License-Identifier: MIT OR Apache-2.0
//! Judgement of one map: its variance, and whether it is plausible or must be rejected.

use super::result::Reconstruction;
use crate::error::{Degeneracy, Error};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::Termination;
use crate::problem::{Problem, Undetermined, Why};
use crate::uncertainty::sensitivity;

/// Thresholds for judging a map.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct JudgeOptions {
    /// Minimum degrees of freedom with which the cost alone identifies the right minimum. Not sensitive.
    pub telling_freedom: usize,
    /// How far the cost of the right minimum may be from its expectation, in standard deviations of the cost. Not
    /// sensitive, but half takes twice the time, as fewer maps end the search.
    pub plausible_deviations: f64,
    /// By how many standard deviations the cost may exceed its expectation before more places of landmarks are tried:
    /// one right map in a hundred exceeds it by 2. Whole searches follow only beyond `plausible_deviations`, as they take
    /// a hundred times as long.
    pub costly_deviations: f64,
    /// A map is a rival of another when its variance is at most this many times the other's: three times the residuals.
    /// Not sensitive.
    pub rival_ratio: f64,
    /// Noise \[rad\] that is expected where no standard deviations are stated: a good degree. Maps that explain their
    /// sightings better are not told apart by how well they do.
    pub expected_noise: f64,
    /// Two maps are the same minimum when positions over the size of the map, and headings \[rad\], differ by less. Not
    /// sensitive.
    pub same: f64,
    /// A plausible robust map has at least this many sightings for each outlier: `robust` is for up to a third. Not
    /// sensitive.
    pub sightings_per_outlier: usize,
    /// Degrees of freedom for each outlier below which there is no consensus. Random bearings have a tenth, scenes with
    /// three outliers in ten have one or more. Not sensitive.
    pub spare_per_outlier: f64,
    /// Root mean square of the residuals \[rad\] above which a map explains nothing. Not sensitive.
    pub explaining_rms: f64,
    /// A map that explains nothing has collapsed when the median distance of its views from their middle is below this
    /// share of the largest: far above rounding, far below any path. Not sensitive.
    pub collapsed: f64,
    /// With at most this many outliers a map is never taken for a chance agreement. Not sensitive.
    pub few_outliers: usize,
    /// Maximum number of views with which the search goes on because a map leaves something out.
    pub persistent_views: usize,
    /// Uncertainty above which a map from partial sight is doubted: another may be as low. 0.05 takes a fifth less time and
    /// leaves one silent failure in 3959 corridors.
    pub doubtful: f64,
    /// Alternative positions of landmarks and of views that are then tried.
    pub doubtful_tried: usize,
    /// By how much they may be worse with all else held fixed, as `partial_worth` of `MoveOptions`.
    pub doubtful_worth: f64,
    /// Sensitivity below which parts that odometry and priors give are one map: above it nothing ties them.
    pub tied: f64,
}

impl Default for JudgeOptions {
    fn default() -> Self {
        Self {
            telling_freedom: 20,
            plausible_deviations: 3.0,
            costly_deviations: 2.0,
            rival_ratio: 9.0,
            expected_noise: 0.02,
            same: 1e-4,
            sightings_per_outlier: 3,
            spare_per_outlier: 0.25,
            few_outliers: 2,
            explaining_rms: 0.1,
            collapsed: 1e-8,
            persistent_views: 100,
            doubtful: 0.03,
            tied: 1.0,
            doubtful_tried: 50,
            doubtful_worth: 1e5,
        }
    }
}

/// The estimated variance of unit weight: twice the cost per degree of freedom, 1 when the standard deviations are
/// right. Unlike the cost, it can be compared between maps that explain different sightings.
pub fn variance(found: &Reconstruction) -> f64 {
    2.0 * found.cost / found.freedom.max(1) as f64
}

/// The variance of residuals due to rounding of the bearings, for this weight (one over sigma): exact maps
/// differ by less.
pub fn rounding(weight: f64) -> f64 {
    2.0 * f64::EPSILON * (weight * weight)
}

/// Whether a variance is at most `ratio` times the least, up to rounding.
pub fn is_as_good(variance: f64, least: f64, ratio: f64, rounding: f64) -> bool {
    variance <= ratio * least + rounding
}

/// Counts the degrees of freedom of a final map, and fills in sensitivity and uncertainty.
pub fn assess(problem: &Problem, found: &mut Reconstruction) {
    found.count_directions(problem);
    let weakest = sensitivity(problem, &found.map);
    (found.sensitivity, found.worst) = (weakest.deviation, weakest.worst);
    if found.freedom > 0 {
        found.uncertainty = found.sensitivity * variance(found).sqrt();
    }
}

/// Fills in sensitivity and uncertainty of the best map, and rejects it if the bearings leave a direction free.
pub fn judged(problem: &Problem, mut best: Reconstruction) -> Result<Reconstruction, Error> {
    assess(problem, &mut best);
    refuse_free(problem, &best)?;
    Ok(best)
}

/// Rejects a map with a direction that exact bearings leave free.
///
/// Odometry and priors may determine what bearings do not, however weakly. With these nothing is rejected here:
/// `diagnose` and the covariance show such directions.
pub fn refuse_free(problem: &Problem, best: &Reconstruction) -> Result<(), Error> {
    if !problem.priors().is_empty() {
        return Ok(());
    }
    // When the bearings are explained to rounding, the geometry must be at fault; with noise the
    // uncertainty shows it.
    if best.rms >= f64::EPSILON.sqrt() {
        return Ok(());
    }
    // Above this the value is mostly rounding.
    let bound = 1.0 / (8.0 * f64::EPSILON.sqrt());
    let per_radian = best.sensitivity * mean_weight(problem);
    let is_free = !(per_radian < bound);
    // One of them may be at infinity in the member of the family that was found.
    let width = best.map.width_over_length();
    let is_wall = width < FLAT && (is_free || best.map.landmarks.iter().all(Option::is_some));
    let (kind, value, bound) = match (is_wall, is_free) {
        (true, _) => (Degeneracy::CollinearLandmarks, width, FLAT),
        (false, true) => (Degeneracy::FreeMap, per_radian, bound),
        (false, false) => return Ok(()),
    };
    Err(Error::Degenerate { kind, value, bound })
}

/// Width over length of the landmarks below which they are on one wall: far above rounding. Not an option: it is for
/// exact bearings.
const FLAT: f64 = 1e-6;

/// Root mean square of one over sigma.
pub fn mean_weight(problem: &Problem) -> f64 {
    let sightings = problem.sightings();
    let sum = sightings
        .iter()
        .fold(0.0, |sum, s| sum + s.weight * s.weight);
    (sum / (sightings.len() as f64)).sqrt()
}

/// Whether the cost of a map from bearings alone is what the standard deviations of the sightings predict for
/// the right minimum, neither above nor below it. No wrong minimum comes so close.
pub fn is_plausible(found: &Reconstruction, options: &JudgeOptions) -> bool {
    let bound = options.plausible_deviations;
    let freedom = found.freedom as f64;
    let deviation = (2.0 * found.cost - freedom).abs();
    found.termination == Termination::ZeroResidual
        || (found.freedom >= options.telling_freedom
            && found.undetermined.is_empty()
            && deviation * deviation <= bound * bound * 2.0 * freedom)
}

/// Whether the cost of a map exceeds what the stated standard deviations predict by more than this many standard
/// deviations of it.
pub fn is_too_costly(problem: &Problem, found: &Reconstruction, bound: f64) -> bool {
    let freedom = found.freedom as f64;
    problem.states_sigma()
        && 2.0 * found.cost - freedom > bound * (2.0 * freedom).sqrt() + bound * bound
}

/// Whether so many further degrees of freedom may raise the sum of the squares by this much, up to so many standard
/// deviations: by the variance of the rest, and at least by that which the stated standard deviations predict.
pub fn is_excess_plausible(
    problem: &Problem,
    excess: f64,
    added: usize,
    variance: f64,
    deviations: f64,
) -> bool {
    let added = added as f64;
    let allowed = added + deviations * (2.0 * added).sqrt() + deviations * deviations;
    let floor = if problem.states_sigma() { 1.0 } else { 0.0 };
    excess <= allowed * (variance.max(floor) + rounding(mean_weight(problem)))
}

/// Whether a map leaves out what has sightings enough, for itself or in another component.
pub fn is_incomplete(found: &Reconstruction) -> bool {
    let hopeless =
        |one: &Undetermined| matches!(one.why, Why::TooFewSightings { .. } | Why::AtInfinity);
    !(found.components.is_empty() && found.undetermined.iter().all(hopeless))
}

/// Whether the cost of a map with odometry and priors is what the standard deviations predict, and it reaches all that
/// any start would.
///
/// With few degrees of freedom a low cost is no objection; with many it says that the standard deviations are too
/// large to tell the right minimum by.
pub fn is_plausible_posterior(found: &Reconstruction, options: &JudgeOptions) -> bool {
    let bound = options.plausible_deviations;
    let freedom = found.freedom as f64;
    let excess = 2.0 * found.cost - freedom;
    let tells = found.freedom >= options.telling_freedom;
    let deviation = if tells { excess.abs() } else { excess };
    let hopeless = |one: &Undetermined| matches!(one.why, Why::TooFewSightings { .. });
    found.termination.was_successful()
        && found.undetermined.iter().all(hopeless)
        && deviation <= bound * (2.0 * freedom).sqrt()
}

/// Whether a robust map with odometry and priors contains everything that any start could determine, with no
/// more outliers than the robust search can handle.
///
/// The cost is ignored: real standard deviations are never exact, whereas a wrong map has many outliers
/// whatever they are.
pub fn is_plausible_consensus(found: &Reconstruction, options: &JudgeOptions) -> bool {
    // No start would reach these, or their sightings are among the outliers that are counted.
    let hopeless = |one: &Undetermined| {
        matches!(
            one.why,
            Why::TooFewSightings { .. } | Why::TooFewInliers { .. }
        )
    };
    let (_, outliers) = inliers_and_outliers(found);
    found.termination.was_successful()
        && found.undetermined.iter().all(hopeless)
        && options.sightings_per_outlier.saturating_mul(outliers) <= found.inliers.len()
}

/// Rejects a map that may be a chance agreement: for any bearings, even random ones, some map agrees with as many
/// of them as it has unknowns, and a few more.
///
/// # Errors
/// [`Error::NoConsensus`].
pub fn refuse_chance(found: &Reconstruction, options: &JudgeOptions) -> Result<(), Error> {
    let (inliers, outliers) = inliers_and_outliers(found);
    let share = found.freedom as f64 / outliers as f64;
    refuse_if(
        outliers > options.few_outliers && share < options.spare_per_outlier,
        found,
        inliers,
    )
}

/// Rejects a map along odometry with which most bearings disagree: odometry alone gives a map, whatever the
/// bearings.
///
/// # Errors
/// [`Error::NoConsensus`].
pub fn refuse_minority(found: &Reconstruction, options: &JudgeOptions) -> Result<(), Error> {
    let (inliers, outliers) = inliers_and_outliers(found);
    refuse_if(
        outliers > inliers && outliers > options.few_outliers,
        found,
        inliers,
    )
}

fn refuse_if(refused: bool, found: &Reconstruction, inliers: usize) -> Result<(), Error> {
    if refused {
        return Err(Error::NoConsensus {
            inliers,
            outliers: found.inliers.len() - inliers,
            freedom: found.freedom,
        });
    }
    Ok(())
}

fn inliers_and_outliers(found: &Reconstruction) -> (usize, usize) {
    let inliers = found.inliers.iter().filter(|inlier| **inlier).count();
    (inliers, found.inliers.len() - inliers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::lm::RefineOptions;
    use crate::problem::{LandmarkPrior, Noise, Subject};
    use crate::simulate::{Arena, Layout, simulate};
    use alloc::vec::Vec;
    use nalgebra::Point2;

    /// A map of five views and nine landmarks with stated standard deviations.
    fn setting(noise: f64) -> (Problem, Reconstruction) {
        let scene = simulate(Layout::Enclosed, 5, 9, noise, 3, Arena::default()).unwrap();
        let problem = Problem::dense(5, 9, &scene.bearings, 0.01).unwrap();
        let mut map = scene.map();
        let report = refine_map(&problem, &mut map, &RefineOptions::default(), None).unwrap();
        let found = Reconstruction::new(&problem, &map, report);
        (problem, found)
    }

    fn undetermined(why: Why) -> Undetermined {
        Undetermined {
            subject: Subject::Landmark(2),
            why,
        }
    }

    const FEW: Why = Why::TooFewSightings { got: 1, needed: 2 };

    #[test]
    fn the_uncertainty_is_the_sensitivity_at_the_noise() {
        let (problem, mut found) = setting(0.02);
        // Twice what is stated, and 16 degrees of freedom.
        assert_eq!(found.freedom, 16);
        found.cost = 32.0;
        assert_eq!(variance(&found), 4.0);
        assess(&problem, &mut found);
        assert!(found.sensitivity > 0.0);
        assert_eq!(found.uncertainty, 2.0 * found.sensitivity);
        found.freedom = 0;
        assert_eq!(variance(&found), 64.0);
        found.uncertainty = f64::NAN;
        found.inliers.fill(false);
        assess(&problem, &mut found);
        assert!(found.uncertainty.is_nan());
    }

    /// A map of exact bearings is refused when it is a wall, or hardly changes a bearing along some direction; with noise,
    /// or with priors, never.
    #[test]
    fn exact_maps_with_a_free_direction_are_refused() {
        let (problem, found) = setting(0.0);
        let kind = |problem: &Problem, found: &Reconstruction| match refuse_free(problem, found) {
            Err(Error::Degenerate { kind, value, bound }) => {
                assert!(value < bound || kind == Degeneracy::FreeMap);
                Some(kind)
            }
            other => {
                assert_eq!(other, Ok(()));
                None
            }
        };
        // Per radian, with sigmas of a hundredth: the root mean square of one over sigma is 100.
        assert!((mean_weight(&problem) - 100.0).abs() < 1e-9);
        let bound = 0.01 / (8.0 * f64::EPSILON.sqrt());
        let with = |sensitivity: f64, rms: f64| {
            let mut found = found.clone();
            (found.sensitivity, found.rms) = (sensitivity, rms);
            found
        };
        assert_eq!(kind(&problem, &with(0.99 * bound, 0.0)), None);
        for sensitivity in [1.01 * bound, f64::INFINITY, f64::NAN] {
            let free = with(sensitivity, 0.0);
            assert_eq!(kind(&problem, &free), Some(Degeneracy::FreeMap));
        }
        assert_eq!(kind(&problem, &with(f64::INFINITY, 2e-8)), None);
        let mut wall = with(1.0, 0.0);
        for (k, point) in wall.map.landmarks.iter_mut().flatten().enumerate() {
            *point = Point2::new(k as f64, 2.0 + 1e-8 * (k % 2) as f64);
        }
        assert_eq!(kind(&problem, &wall), Some(Degeneracy::CollinearLandmarks));
        // One of them may be at infinity: then it is a wall only where a direction is free.
        wall.map.landmarks[3] = None;
        assert_eq!(kind(&problem, &wall), None);
        wall.sensitivity = f64::INFINITY;
        assert_eq!(kind(&problem, &wall), Some(Degeneracy::CollinearLandmarks));
        let known = LandmarkPrior {
            landmark: 0,
            position: Point2::new(0.0, 2.0),
            noise: Noise::Sigmas([1.0, 1.0]),
        };
        let tied = problem.clone().with_landmark_priors(&[known]).unwrap();
        assert_eq!(kind(&tied, &wall), None);
    }

    /// With 50 degrees of freedom twice the cost is 50 within ten for each standard deviation.
    #[test]
    fn costs_are_judged_by_their_standard_deviation() {
        let (problem, mut found) = setting(0.01);
        let options = JudgeOptions::default();
        let unstated = Problem::dense(1, 2, &[0.1, 0.2], 1.0).unwrap();
        assert!(problem.states_sigma() && !unstated.states_sigma());
        found.freedom = 50;
        found.termination = Termination::Converged;
        // (deviations, plausible, plausible with priors, too costly by two, by three)
        for (deviations, plausible, costly) in [
            (-3.1, false, [false, false]),
            (-2.9, true, [false, false]),
            (2.3, true, [false, false]),
            (2.5, true, [true, false]),
            (3.1, false, [true, false]),
            (4.0, false, [true, true]),
        ] {
            found.cost = 0.5 * (50.0 + 10.0 * deviations);
            assert_eq!(is_plausible(&found, &options), plausible, "{deviations}");
            assert_eq!(
                is_plausible_posterior(&found, &options),
                plausible,
                "{deviations}"
            );
            for (bound, costly) in [2.0, 3.0].into_iter().zip(costly) {
                assert_eq!(
                    is_too_costly(&problem, &found, bound),
                    costly,
                    "{deviations}"
                );
                assert!(!is_too_costly(&unstated, &found, bound));
            }
        }
        // Few degrees of freedom tell nothing, and with priors only too high a cost does.
        found.freedom = 19;
        for (cost, posterior) in [(0.0, true), (0.5 * 19.0, true), (0.5 * 38.0, false)] {
            found.cost = cost;
            assert!(!is_plausible(&found, &options));
            assert_eq!(
                is_plausible_posterior(&found, &options),
                posterior,
                "{cost}"
            );
        }
        // An exact map is plausible in any case, one that leaves something out is not.
        found.termination = Termination::ZeroResidual;
        assert!(is_plausible(&found, &options));
        found.termination = Termination::Converged;
        (found.freedom, found.cost) = (50, 25.0);
        assert!(is_plausible(&found, &options) && is_plausible_posterior(&found, &options));
        found.undetermined = Vec::from([undetermined(FEW)]);
        assert!(!is_plausible(&found, &options) && is_plausible_posterior(&found, &options));
        found.undetermined.push(undetermined(Why::Degenerate));
        assert!(!is_plausible_posterior(&found, &options));
        found.undetermined.clear();
        found.termination = Termination::MaxIterations;
        assert!(!is_plausible_posterior(&found, &options));
    }

    /// Two further degrees of freedom add two to the sum of the squares, with a standard deviation of two.
    #[test]
    fn an_excess_is_judged_by_the_noise() {
        let (problem, _) = setting(0.01);
        let unstated = Problem::dense(1, 2, &[0.1, 0.2], 1.0).unwrap();
        // Up to three standard deviations, and the square of three because few squares have a long tail.
        let most = 2.0 + 3.0 * 2.0 + 9.0;
        for (problem, variance, noise) in [
            (&problem, 4.0, 4.0),
            (&problem, 0.1, 1.0),
            (&unstated, 0.1, 0.1),
        ] {
            let plausible = |excess| is_excess_plausible(problem, excess, 2, variance, 3.0);
            assert!(plausible(0.999 * most * noise) && !plausible(1.001 * most * noise));
        }
        // Exact bearings leave rounding.
        assert!(is_excess_plausible(&unstated, 1e-16, 2, 0.0, 3.0));
    }

    #[test]
    fn what_has_too_few_sightings_or_is_at_infinity_leaves_nothing_out() {
        let (_, mut found) = setting(0.01);
        found.undetermined = Vec::from([undetermined(FEW), undetermined(Why::AtInfinity)]);
        assert!(!is_incomplete(&found));
        found.components = Vec::from([found.clone()]);
        assert!(is_incomplete(&found));
        found.components.clear();
        found.undetermined.push(undetermined(Why::Degenerate));
        assert!(is_incomplete(&found));
    }

    /// A robust map may have a third of outliers with priors, and four for each spare inlier without; half of all along
    /// odometry. A few outliers are never held against it.
    #[test]
    fn maps_of_too_many_outliers_are_refused() {
        let (_, mut found) = setting(0.01);
        found.termination = Termination::Converged;
        let options = JudgeOptions::default();
        let mut with = |outliers: usize, freedom: usize| {
            found.inliers = (0..45).map(|k| k >= outliers).collect();
            found.freedom = freedom;
            found.clone()
        };
        for (outliers, plausible) in [(15, true), (16, false)] {
            let found = with(outliers, 9);
            assert_eq!(is_plausible_consensus(&found, &options), plausible);
        }
        let mut incomplete = with(3, 9);
        let why = Why::TooFewInliers { got: 1, needed: 2 };
        incomplete.undetermined = Vec::from([undetermined(why), undetermined(FEW)]);
        assert!(is_plausible_consensus(&incomplete, &options));
        incomplete.undetermined.push(undetermined(Why::AtInfinity));
        assert!(!is_plausible_consensus(&incomplete, &options));
        incomplete.undetermined.clear();
        incomplete.termination = Termination::MaxIterations;
        assert!(!is_plausible_consensus(&incomplete, &options));
        for (outliers, freedom, refused) in
            [(12, 3, false), (13, 3, true), (2, 0, false), (3, 0, true)]
        {
            let error = Error::NoConsensus {
                inliers: 45 - outliers,
                outliers,
                freedom,
            };
            let expected = if refused { Err(error) } else { Ok(()) };
            assert_eq!(refuse_chance(&with(outliers, freedom), &options), expected);
        }
        for (outliers, refused) in [(22, false), (23, true)] {
            assert_eq!(
                refuse_minority(&with(outliers, 9), &options).is_err(),
                refused
            );
        }
        let mut few = with(0, 9);
        few.inliers = Vec::from([false, false, true]);
        assert_eq!(refuse_minority(&few, &options), Ok(()));
    }
}
