// SPDX-License-Identifier: MIT OR Apache-2.0
//! Redundancy of each observation: how far the others check it, and its residual in units of what they let it be.

use super::distributions::normal_exceeded_as_rarely;
use crate::adjustment::bundle::{Bundle, Rows};
use crate::adjustment::decompose::symmetric_eigen;
use crate::adjustment::gauge::gauge_directions;
use crate::adjustment::normal_equations::Normal;
use crate::adjustment::prior_rows::PriorRow;
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::{Loss, Observer};
use crate::problem::{Map, Prior, Problem, Subject};
use crate::uncertainty::{LIFT, SINGULAR_EQUATIONS, observe};
use alloc::vec;
use alloc::vec::Vec;
use nalgebra::{DMatrix, DVector};

/// An observation as the others see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checked {
    /// The share of an error of the observation that its residual shows: 0 where nothing checks it, 1 where the map does
    /// not depend on it. Of odometry and priors the mean over their numbers, NaN where they have none.
    pub redundancy: f64,
    /// Residual over its own standard deviation, `r / (sigma sqrt(redundancy))`: standard normal where the
    /// standard deviations are right. Of odometry and priors the value without sign that a normal variable exceeds as
    /// rarely as they their square. NaN where nothing checks the observation.
    pub standardized: f64,
}

/// Redundancies of all observations.
#[derive(Clone, Debug, PartialEq)]
pub struct Redundancy {
    /// Of the sightings, in the order of the input; `None` of outliers, and where view or landmark is undetermined.
    pub sightings: Vec<Option<Checked>>,
    /// Of odometry, in the order in which it was given.
    pub odometry: Vec<Option<Checked>>,
    /// Of priors on poses.
    pub pose_priors: Vec<Option<Checked>>,
    /// Of priors on landmarks.
    pub landmark_priors: Vec<Option<Checked>>,
}

/// Redundancy below which an observation is not controlled: an error of it would hardly show.
pub const CONTROLLED: f64 = 1e-3;

/// Most right-hand sides that are solved for at a time. It decides about time only.
const BATCH: usize = 64;

/// Most numbers of a batch of right-hand sides, so that a look at the observer comes several times a second. It decides
/// about time only.
const BATCH_NUMBERS: usize = 1 << 20;

/// Redundancies and standardized residuals of the observations of a refined map, (T29).
///
/// `inliers` says which sightings the map is estimated from, in the order of the input. Each observation takes a solution
/// with the sparse factor of the normal equations.
///
/// # Errors
/// [`Error::LengthMismatch`] when map or inliers are not of the problem's size; [`Error::Degenerate`] when the normal
/// equations cannot be factorised; [`Error::OutOfMemory`] when they do not fit into memory; [`Error::Interrupted`] when
/// `observer`, called with the number of observations done and in all, says so.
///
/// # Example
/// ```
/// use bearslam::{Arena, Layout, Problem, SolveOptions, redundancy, simulate, solve};
/// let scene = simulate(Layout::Mixed, 6, 12, 0.01, 7, Arena::default())?;
/// let problem = Problem::dense(6, 12, &scene.bearings, 0.01)?;
/// let found = solve(&problem, &SolveOptions::default(), None)?;
/// let checked = redundancy(&problem, &found.map, &found.inliers, None)?;
/// let sum: f64 = checked.sightings.iter().flatten().map(|one| one.redundancy).sum();
/// assert!((sum - found.freedom as f64).abs() < 1e-6);
/// # Ok::<(), bearslam::Error>(())
/// ```
///
/// # Reference
/// W. Baarda, "A testing procedure for use in geodetic networks", 1968.
pub fn redundancy(
    problem: &Problem,
    map: &Map,
    inliers: &[bool],
    mut observer: Option<Observer<'_>>,
) -> Result<Redundancy, Error> {
    map.check(problem)?;
    let inner = problem.of_inliers(inliers)?;
    let active = map.restrict(&inner);
    let bundle = Bundle::from_map(map);
    let mut rows = Rows::of(&active);
    bundle.linearize(&active, Loss::Squared, &mut rows);
    observe(&mut observer, 0, inliers.len())?;
    let mut normal = Normal::new(&active).ok_or(Error::OutOfMemory)?;
    let gauge = gauge_directions(&active, &bundle);
    normal.assemble(&rows, &gauge);
    // A landmark that has moved onto a view makes them singular beyond the arithmetic.
    if !normal.factorize(0.0) && !normal.factorize(LIFT) {
        return Err(SINGULAR_EQUATIONS);
    }
    let views = active.views();
    let mut all: Vec<Observed> = Vec::with_capacity(rows.sightings.len() + rows.priors.len());
    for (s, row) in active.sightings().iter().zip(&rows.sightings) {
        let ([x, y, turn], [gx, gy]) = (row.pose(), row.landmark());
        all.push(Observed {
            rows: vec![entries(
                views,
                (Subject::View(s.view), [x, y, turn]),
                Some((Subject::Landmark(s.landmark), [gx, gy, 0.0])),
            )],
            residuals: vec![row.residual],
        });
    }
    all.extend(rows.priors.iter().map(|row| Observed::of_prior(views, row)));
    let mut checked = checked(&normal, &all, &mut observer)?.into_iter();
    let mut found = Redundancy::empty(problem);
    for (s, &place) in problem.sightings().iter().zip(problem.input_order()) {
        if inliers[place] && map.poses[s.view].is_some() && map.landmarks[s.landmark].is_some() {
            found.sightings[place] = checked.next();
        }
    }
    for prior in problem.priors() {
        let mut subjects = prior.subjects().into_iter().flatten();
        let determined = subjects.all(|subject| match subject {
            Subject::View(view) => map.poses[view].is_some(),
            Subject::Landmark(landmark) => map.landmarks[landmark].is_some(),
        });
        let entry = if determined { checked.next() } else { None };
        found.of_kind(prior).push(entry);
    }
    Ok(found)
}

impl Redundancy {
    fn empty(problem: &Problem) -> Self {
        Self {
            sightings: vec![None; problem.sightings().len()],
            odometry: Vec::new(),
            pose_priors: Vec::new(),
            landmark_priors: Vec::new(),
        }
    }

    fn of_kind(&mut self, prior: &Prior) -> &mut Vec<Option<Checked>> {
        match prior {
            Prior::Motion { .. } => &mut self.odometry,
            Prior::Pose { .. } => &mut self.pose_priors,
            Prior::Landmark { .. } => &mut self.landmark_priors,
        }
    }
}

/// Derivatives, each with its parameter.
type Entries = [(usize, f64); 6];

/// The derivatives of a residual with respect to the parameters of one or two subjects.
fn entries(
    views: usize,
    first: (Subject, [f64; 3]),
    second: Option<(Subject, [f64; 3])>,
) -> Entries {
    let mut entries = [(0, 0.0); 6];
    let subjects = core::iter::once(first).chain(second);
    for (half, (subject, derivatives)) in entries.chunks_exact_mut(3).zip(subjects) {
        let (begin, count) = match subject {
            Subject::View(view) => (3 * view, 3),
            Subject::Landmark(landmark) => (3 * views + 2 * landmark, 2),
        };
        for (k, derivative) in derivatives.into_iter().take(count).enumerate() {
            half[k] = (begin + k, derivative);
        }
    }
    entries
}

/// An observation of one to three numbers, weighted.
struct Observed {
    rows: Vec<Entries>,
    residuals: Vec<f64>,
}

impl Observed {
    /// Odometry or a prior: of its numbers those that have weight.
    fn of_prior(views: usize, row: &PriorRow) -> Self {
        let weighs = |k: &usize| row.first.1[*k].iter().any(|entry| *entry != 0.0);
        let numbers: Vec<usize> = (0..3).filter(weighs).collect();
        let of = |k: usize| {
            let second = row.second.map(|(subject, all)| (subject, all[k]));
            entries(views, (row.first.0, row.first.1[k]), second)
        };
        Self {
            rows: numbers.iter().map(|&k| of(k)).collect(),
            residuals: numbers.iter().map(|&k| row.residual[k]).collect(),
        }
    }

    /// How far the others check it, given what they and it together let its numbers be.
    fn checked(&self, leverage: &DMatrix<f64>) -> Checked {
        let count = self.rows.len();
        // A prior that knows nothing.
        if count == 0 {
            return Checked {
                redundancy: f64::NAN,
                standardized: f64::NAN,
            };
        }
        let spare = DMatrix::identity(count, count) - leverage;
        let redundancy = (spare.trace() / count as f64).clamp(0.0, 1.0);
        if let [residual] = self.residuals[..] {
            let standardized = if redundancy < CONTROLLED {
                f64::NAN
            } else {
                residual / redundancy.sqrt()
            };
            return Checked {
                redundancy,
                standardized,
            };
        }
        // Rows that are not finite are not checked.
        let Some(parts) = symmetric_eigen(spare) else {
            return Checked {
                redundancy: f64::NAN,
                standardized: f64::NAN,
            };
        };
        let residuals = DVector::from_column_slice(&self.residuals);
        let (mut square, mut freedom) = (0.0, 0.0);
        for (value, direction) in parts
            .eigenvalues
            .iter()
            .zip(parts.eigenvectors.column_iter())
        {
            if *value >= CONTROLLED {
                let part = direction.dot(&residuals);
                square += part * part / value;
                freedom += 1.0;
            }
        }
        Checked {
            redundancy,
            standardized: normal_exceeded_as_rarely(square, freedom),
        }
    }
}

/// All observations, checked by the others.
fn checked(
    normal: &Normal<'_>,
    all: &[Observed],
    observer: &mut Option<Observer<'_>>,
) -> Result<Vec<Checked>, Error> {
    let size = normal.size();
    let most = (BATCH_NUMBERS / size.max(1)).clamp(3, BATCH);
    let mut found = Vec::with_capacity(all.len());
    let mut sides = Vec::new();
    for batch in all.chunks(most / 3) {
        observe(observer, found.len(), all.len())?;
        sides.clear();
        for row in batch.iter().flat_map(|one| &one.rows) {
            let begin = sides.len();
            sides.resize(begin + size, 0.0);
            for (parameter, derivative) in row {
                sides[begin + parameter] += derivative;
            }
        }
        normal.solve(&mut sides);
        let mut solved = sides.chunks_exact(size);
        for one in batch {
            let count = one.rows.len();
            let columns: Vec<&[f64]> = solved.by_ref().take(count).collect();
            let leverage = DMatrix::from_fn(count, count, |k, l| {
                let products = one.rows[k]
                    .iter()
                    .map(|&(parameter, d)| d * columns[l][parameter]);
                products.sum()
            });
            found.push(one.checked(&leverage));
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::refine_map;
    use crate::lm::RefineOptions;
    use crate::problem::{LandmarkPrior, Noise, PosePrior, Sighting};
    use crate::simulate::{Arena, Layout, Scene, simulate};

    fn scene() -> Scene {
        simulate(Layout::Enclosed, 5, 8, 0.01, 3, Arena::default()).unwrap()
    }

    /// A problem with odometry and priors, of which the last view and the second landmark are not in the map.
    fn setting() -> (Problem, Map, Vec<bool>) {
        let scene = scene();
        let mut problem = Problem::dense(5, 8, &scene.bearings, 0.01).unwrap();
        let odometry = scene.odometry([0.1, 0.1, 0.05], 1).unwrap();
        problem = problem.with_odometry(&odometry).unwrap();
        let pose = |view: usize, sigmas| PosePrior {
            view,
            pose: scene.poses[view],
            noise: Noise::Sigmas(sigmas),
        };
        let unknown = f64::INFINITY;
        let poses = [
            pose(4, [0.1; 3]),
            pose(0, [0.1, unknown, unknown]),
            pose(2, [0.1, 0.2, 0.05]),
            pose(1, [unknown; 3]),
        ];
        problem = problem.with_pose_priors(&poses).unwrap();
        let landmark = |landmark: usize| LandmarkPrior {
            landmark,
            position: scene.landmarks[landmark],
            noise: Noise::Sigmas([0.1; 2]),
        };
        problem = problem
            .with_landmark_priors(&[landmark(1), landmark(3)])
            .unwrap();
        let mut map = scene.map();
        map.poses[4] = None;
        map.landmarks[1] = None;
        let mut inliers = vec![true; 40];
        inliers[10] = false;
        let kept: Vec<bool> = problem.input_order().iter().map(|&k| inliers[k]).collect();
        refine_map(
            &problem.subset(&kept),
            &mut map,
            &RefineOptions::default(),
            None,
        )
        .unwrap();
        (problem, map, inliers)
    }

    /// The redundancies of all numbers add up to the degrees of freedom. What is not in the map, and outliers, have none.
    #[test]
    fn redundancies_add_up_to_the_freedom() {
        let (problem, map, inliers) = setting();
        let found = redundancy(&problem, &map, &inliers, None).unwrap();
        for (k, one) in found.sightings.iter().enumerate() {
            let inside = k / 8 != 4 && k % 8 != 1 && k != 10;
            assert_eq!(one.is_some(), inside, "{k}");
        }
        let have =
            |kind: &[Option<Checked>]| -> Vec<bool> { kind.iter().map(Option::is_some).collect() };
        assert_eq!(have(&found.odometry), [true, true, true, false]);
        assert_eq!(have(&found.pose_priors), [false, true, true, true]);
        assert!(found.pose_priors[3].unwrap().redundancy.is_nan());
        assert_eq!(have(&found.landmark_priors), [false, true]);
        let sum = |kind: &[Option<Checked>], numbers: &[usize]| -> f64 {
            let all = kind.iter().zip(numbers).filter(|(_, n)| **n > 0);
            all.filter_map(|(one, &n)| Some((*one)?.redundancy * n as f64))
                .sum()
        };
        let sum = sum(&found.sightings, &[1; 40])
            + sum(&found.odometry, &[3; 4])
            + sum(&found.pose_priors, &[3, 1, 3, 0])
            + sum(&found.landmark_priors, &[2; 2]);
        // 27 bearings, three motions, four numbers of poses and two of a landmark; all of the gauge is known.
        let freedom = (27 + 9 + 4 + 2 - 3 * 4 - 2 * 7) as f64;
        assert!((sum - freedom).abs() < 1e-6, "{sum} {freedom}");
    }

    /// What an observation adds to twice the cost is the square of its standardized residual, to first order: without
    /// noise to speak of, exactly.
    #[test]
    fn standardized_residuals_are_what_an_observation_adds_to_the_cost() {
        let scene = simulate(Layout::Enclosed, 5, 8, 1e-6, 3, Arena::default()).unwrap();
        let problem = Problem::dense(5, 8, &scene.bearings, 0.01).unwrap();
        let refined = |kept: &[bool]| {
            let mut map = scene.map();
            let options = RefineOptions::default();
            let inner = problem.subset(kept);
            let cost = refine_map(&inner, &mut map, &options, None).unwrap().cost;
            (map, cost)
        };
        let (map, cost) = refined(&[true; 40]);
        let found = redundancy(&problem, &map, &[true; 40], None).unwrap();
        for removed in [0, 13, 39] {
            let mut kept = vec![true; 40];
            kept[removed] = false;
            let place = problem.input_order()[removed];
            let less = 2.0 * (cost - refined(&kept).1);
            let standardized = found.sightings[place].unwrap().standardized;
            assert!((standardized.powi(2) / less - 1.0).abs() < 1e-3);
        }
    }

    /// An observation without which the map would not be determined is not controlled: two rays to a landmark, and
    /// a prior that alone ties the map.
    #[test]
    fn what_nothing_checks_has_no_standardized_residual() {
        let scene = scene();
        let mut sightings = Vec::new();
        for view in 0..5 {
            for landmark in (0..8).filter(|&landmark| landmark > 0 || view < 2) {
                sightings.push(Sighting {
                    view,
                    landmark,
                    bearing: scene.bearings[view * 8 + landmark],
                    sigma: 0.01,
                });
            }
        }
        let prior = PosePrior {
            view: 0,
            pose: scene.poses[0],
            noise: Noise::Sigmas([0.1; 3]),
        };
        let problem = Problem::new(5, 8, &sightings).unwrap();
        let problem = problem.with_pose_priors(&[prior]).unwrap();
        let mut map = scene.map();
        refine_map(&problem, &mut map, &RefineOptions::default(), None).unwrap();
        let inliers = vec![true; sightings.len()];
        let found = redundancy(&problem, &map, &inliers, None).unwrap();
        for (s, one) in sightings.iter().zip(&found.sightings) {
            let one = one.unwrap();
            assert_eq!(one.redundancy < CONTROLLED, s.landmark == 0);
            assert_eq!(one.standardized.is_nan(), s.landmark == 0);
        }
        let prior = found.pose_priors[0].unwrap();
        assert!(prior.redundancy < CONTROLLED && prior.standardized.is_nan());
    }

    #[test]
    fn inliers_of_another_problem_are_refused() {
        let (problem, map, _) = setting();
        let refused = redundancy(&problem, &map, &[true; 39], None);
        let expected = Error::LengthMismatch {
            what: "inliers",
            expected: 40,
            got: 39,
        };
        assert_eq!(refused, Err(expected));
        let stop = &mut |_, _| false;
        let stopped = redundancy(&problem, &map, &[true; 40], Some(stop));
        assert_eq!(stopped, Err(Error::Interrupted));
    }
}
