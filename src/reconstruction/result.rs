// SPDX-License-Identifier: MIT OR Apache-2.0
//! The result of a reconstruction.

use super::certificate::Certificate;
use crate::adjustment::gauge::{gauge_and_prior_numbers, in_reported_frame};
use crate::adjustment::{Report, cost_of_priors};
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::lm::{Loss, Termination};
use crate::problem::{
    Count, IndexedSighting, Map, Missing, ON_VIEW, Problem, Subject, Undetermined, Why,
};
use alloc::vec::Vec;
use core::fmt;

/// A map, how well it explains the bearings, and its rivals.
///
/// Gauge: the first determined view is at the origin with heading 0, and the root-mean-square
/// distance of the other views from it is 1, except for what odometry and priors determine. Where they know
/// positions along one direction only, as on a lane, the first determined view is at 0 along the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// Poses and landmarks; `None` where undetermined.
    pub map: Map,
    /// Half the sum of squared residuals over sigma. With [`SolveOptions::robust`] each square counts
    /// for at most 9, so that a sighting that the map does not explain costs 4.5.
    ///
    /// [`SolveOptions::robust`]: crate::SolveOptions::robust
    pub cost: f64,
    /// Root mean square of the residuals of the inliers \[rad\].
    pub rms: f64,
    /// Predicted minus measured bearing \[rad\] in (-pi, pi], in the order of the problem's input;
    /// `None` where the view or the landmark is undetermined, except for landmarks at infinity.
    pub residuals: Vec<Option<f64>>,
    /// Which sightings the map is estimated from, in the order of the problem's input. With
    /// [`SolveOptions::robust`](crate::SolveOptions::robust) those whose residual is at most three
    /// sigma, with a truncated loss those within its width; otherwise all that have a residual.
    pub inliers: Vec<bool>,
    /// Degrees of freedom (redundancy): inliers between determined views and landmarks, plus the numbers
    /// that odometry and priors measure, minus the parameters without those of the gauge (four for bearings
    /// alone). A landmark at infinity, or on a view that sees it, is one parameter.
    pub freedom: usize,
    /// With [`SolveOptions::robust`](crate::SolveOptions::robust), the number of bearings within three sigma once their
    /// identities are assigned anew. Wrong maps explain few; `None` where it was not counted.
    pub explained: Option<usize>,
    /// The loss of the refinement; with [`SolveOptions::robust`](crate::SolveOptions::robust) that of a truncation at
    /// three sigma.
    pub loss: Loss,
    /// How the refinement ended.
    pub termination: Termination,
    /// Linear systems that the refinement solved.
    pub iterations: usize,
    /// Views and landmarks without an estimate, and why.
    pub undetermined: Vec<Undetermined>,
    /// Predicted standard deviation of the map over its size, in the direction that the bearings
    /// determine least, for residuals of one sigma; NaN when it was not computed.
    pub sensitivity: f64,
    /// The same for the residuals observed: [`Reconstruction::sensitivity`] times the root of twice the cost
    /// per degree of freedom. Be careful above 0.2; near and above 1 the bearings do not determine the map.
    /// It is linearised at the estimate, so it is too small where the estimate mistakes noise for parallax,
    /// as with landmarks along a wall. NaN when there are no degrees of freedom to estimate the noise from.
    pub uncertainty: f64,
    /// The view or landmark that moves most in that direction: where it alone is loose, the others may be well known.
    /// `None` where the sensitivity was not computed.
    pub worst: Option<Subject>,
    /// Other minima that explain the bearings nearly as well, such as the mirror branch of three
    /// views; best first.
    pub alternatives: Vec<Self>,
    /// Maps of other views, which share too few landmarks with this one to be joined: the largest first,
    /// each in a gauge of its own. A landmark may be in several maps. What is `undetermined` in this map
    /// is in none of them.
    pub components: Vec<Self>,
    /// What the verification has shown; `None` without [`SolveOptions::verify`](crate::SolveOptions::verify), and for
    /// alternatives and components.
    pub certificate: Option<Certificate>,
}

/// Relative difference between the cost of a refinement and that of the map it reports above which the frame has rounded.
pub(super) const ROUNDED: f64 = 1e-9;

impl Reconstruction {
    /// Normalises a map and computes its residuals.
    pub(super) fn new(problem: &Problem, map: &Map, report: Report) -> Self {
        let map = in_reported_frame(problem, map);
        let mut residuals = alloc::vec![None; problem.sightings().len()];
        let mut inliers = alloc::vec![false; residuals.len()];
        let (mut squares, mut losses, mut count) = (0.0, 0.0, 0.0_f64);
        let all = problem.input_order().iter().zip(map.residuals(problem));
        for (k, (&place, residual)) in all.enumerate() {
            residuals[place] = residual;
            if let Some(r) = residual {
                let over_sigma = r * problem.sightings()[k].weight;
                inliers[place] = match report.loss {
                    Loss::Truncated(width) => over_sigma.abs() <= width,
                    _ => true,
                };
                squares += r * r;
                losses += report.loss.evaluate(over_sigma * over_sigma).0;
                count += 1.0;
            }
        }
        // A map that has shrunk until its coordinates round has the cost of the coordinates that are reported, as has one
        // that was not refined.
        let cost = 0.5 * losses + cost_of_priors(problem, &map);
        let same = (cost - report.cost).abs() <= ROUNDED * report.cost;
        Self {
            cost: if same { report.cost } else { cost },
            rms: (squares / count.max(1.0)).sqrt(),
            freedom: freedom(problem, &map, &inliers),
            inliers,
            explained: None,
            residuals,
            map,
            loss: report.loss,
            termination: report.termination,
            iterations: report.iterations,
            undetermined: report.undetermined,
            sensitivity: f64::NAN,
            uncertainty: f64::NAN,
            worst: None,
            alternatives: Vec::new(),
            components: Vec::new(),
            certificate: None,
        }
    }
}

impl Reconstruction {
    /// A refined map with the degrees of freedom that a test of its fit needs.
    pub(crate) fn tested(problem: &Problem, map: &Map, report: Report) -> Self {
        let mut found = Self::new(problem, map, report);
        found.count_directions(problem);
        found
    }

    /// Takes maps of other views as components: what is in one of them is not undetermined.
    pub(super) fn attach(&mut self, components: Vec<Self>) {
        self.undetermined.retain(|one| {
            components.iter().all(|other| match one.subject {
                Subject::View(view) => other.map.poses[view].is_none(),
                Subject::Landmark(landmark) => other.map.landmarks[landmark].is_none(),
            })
        });
        self.components = components;
    }

    /// Counts a landmark at infinity, or on a view that sees it, as the one parameter that it is: its direction. Those at
    /// infinity have been removed from the map.
    pub(super) fn count_directions(&mut self, problem: &Problem) {
        let lost = self.undetermined.iter();
        let at_infinity = lost.filter(|one| {
            matches!(one.subject, Subject::Landmark(_)) && one.why == Why::AtInfinity
        });
        let range = ON_VIEW * self.map.size();
        let is_near = |s: &IndexedSighting| {
            let (pose, point) = (&self.map.poses[s.view], &self.map.landmarks[s.landmark]);
            pose.zip(*point).is_some_and(|(pose, point)| {
                (pose.translation.vector - point.coords).norm_squared() < range * range
            })
        };
        // Most maps have none.
        if self.undetermined.is_empty() && !problem.sightings().iter().any(is_near) {
            return;
        }
        let on_views = self.map.landmarks_on_views(problem, range);
        let (measured, unknown) = measured_and_unknown(problem, &self.map, &self.inliers);
        let unknown = unknown + at_infinity.count();
        self.freedom = (measured + on_views.len()).saturating_sub(unknown);
    }
}

/// One line: `12 views, 15 landmarks, rms 0.49 deg, cost 71.2, converged after 6 iterations; 1 landmark undetermined`.
/// Other components are counted at the end.
impl fmt::Display for Reconstruction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let views = Count(self.map.poses.len(), "view");
        let landmarks = Count(self.map.landmarks.len(), "landmark");
        let (rms, cost) = (Short(self.rms.to_degrees()), Short(self.cost));
        let termination = self.termination;
        write!(
            f,
            "{views}, {landmarks}, rms {rms} deg, cost {cost}, {termination}"
        )?;
        if termination != Termination::NotRefined {
            write!(f, " after {}", Count(self.iterations, "iteration"))?;
        }
        let all = self.undetermined.len();
        let subjects = self.undetermined.iter().map(|one| one.subject);
        let views = subjects.filter(|subject| matches!(subject, Subject::View(_)));
        let views = views.count();
        let landmarks = all - views;
        write!(f, "{}", Missing { views, landmarks })?;
        match self.components.len() {
            0 => Ok(()),
            others => write!(f, "; {}", Count(others, "other component")),
        }
    }
}

/// A number with three significant digits; from 1000 to a million as an integer, beyond that and below 0.001 with
/// an exponent.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value) = *self;
        match value.abs() {
            0.0 => write!(f, "0"),
            size if !(1e-3..1e6).contains(&size) => write!(f, "{value:.2e}"),
            size => {
                let below = [100.0, 10.0, 1.0, 0.1, 0.01].iter();
                let digits = below.filter(|bound| size < **bound).count();
                write!(f, "{value:.digits$}")
            }
        }
    }
}

/// Measured numbers minus parameters, without those of the gauge.
fn freedom(problem: &Problem, map: &Map, inliers: &[bool]) -> usize {
    let (measured, unknown) = measured_and_unknown(problem, map, inliers);
    measured.saturating_sub(unknown)
}

/// Measured numbers with the directions of the gauge, and parameters.
fn measured_and_unknown(problem: &Problem, map: &Map, inliers: &[bool]) -> (usize, usize) {
    let views = map.poses.iter().flatten().count();
    let landmarks = map.landmarks.iter().flatten().count();
    let (free, numbers) = gauge_and_prior_numbers(problem, map);
    let measured = inliers.iter().filter(|inlier| **inlier).count() + numbers;
    (measured + free, 3 * views + 2 * landmarks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;
    use crate::problem::Sighting;
    use crate::simulate::{Arena, Layout, simulate};
    use alloc::string::ToString;
    use nalgebra::Point2;

    #[test]
    fn a_reconstruction_prints_as_one_line() {
        let mut found = Reconstruction {
            map: Map::empty(12, 15),
            cost: 71.23,
            rms: 0.4912_f64.to_radians(),
            residuals: Vec::new(),
            inliers: Vec::new(),
            freedom: 0,
            explained: None,
            loss: Loss::Squared,
            termination: Termination::Converged,
            iterations: 6,
            undetermined: alloc::vec![Undetermined {
                subject: Subject::Landmark(3),
                why: Why::Degenerate,
            }],
            sensitivity: f64::NAN,
            uncertainty: f64::NAN,
            worst: None,
            alternatives: Vec::new(),
            components: Vec::new(),
            certificate: None,
        };
        assert_eq!(
            found.to_string(),
            "12 views, 15 landmarks, rms 0.491 deg, cost 71.2, converged after 6 iterations; 1 landmark undetermined"
        );
        found.termination = Termination::NotRefined;
        found.components = alloc::vec![found.clone()];
        found.undetermined.clear();
        assert_eq!(
            found.to_string(),
            "12 views, 15 landmarks, rms 0.491 deg, cost 71.2, not refined; 1 other component"
        );
        found.undetermined = [Subject::View(1), Subject::Landmark(3), Subject::Landmark(4)]
            .map(|subject| Undetermined {
                subject,
                why: Why::Degenerate,
            })
            .to_vec();
        assert_eq!(
            found.to_string(),
            "12 views, 15 landmarks, rms 0.491 deg, cost 71.2, not refined; 1 view and 2 landmarks undetermined; 1 other component"
        );
        let all = "12 views, 15 landmarks; 12 views and 15 landmarks undetermined";
        assert_eq!(found.map.to_string(), all);
    }

    #[test]
    fn numbers_have_three_digits() {
        let cases = [
            (0.0, "0"),
            (1.234e-7, "1.23e-7"),
            (0.0012345, "0.00123"),
            (0.12345, "0.123"),
            (1.2345, "1.23"),
            (12.345, "12.3"),
            (123.45, "123"),
            (12345.6, "12346"),
            (0.000999, "9.99e-4"),
            (999_999.0, "999999"),
            (1.2345e6, "1.23e6"),
            (1.2345e8, "1.23e8"),
            (f64::NAN, "NaN"),
        ];
        for (value, expected) in cases {
            assert_eq!(Short(value).to_string(), expected);
        }
    }

    /// A map of one view and four landmarks ahead, off their bearings by these standard deviations, in another order than
    /// that of the landmarks.
    fn off(deviations: [f64; 4], loss: Loss) -> Reconstruction {
        let angles = [0.1, 0.4, 0.9, 1.5_f64];
        let map = Map {
            poses: Vec::from([Some(pose(0.0, 0.0, 0.0)), None]),
            landmarks: angles
                .map(|angle| Some(Point2::new(3.0 * angle.cos(), 3.0 * angle.sin())))
                .to_vec(),
        };
        let sightings = [2, 0, 3, 1].map(|landmark: usize| Sighting {
            view: 0,
            landmark,
            bearing: angles[landmark] - 0.01 * deviations[landmark],
            sigma: 0.01,
        });
        let other = Sighting {
            view: 1,
            ..sightings[0]
        };
        let problem = Problem::new(2, 4, &[&[other], &sightings[..]].concat()).unwrap();
        let report = Report {
            cost: f64::NAN,
            termination: Termination::NotRefined,
            iterations: 0,
            undetermined: Vec::new(),
            loss,
        };
        Reconstruction::new(&problem, &map, report)
    }

    /// Residuals and inliers come in the order of the input; what the map does not reach has none.
    #[test]
    fn residuals_come_in_the_order_of_the_input() {
        let found = off([1.0, -2.0, 2.9, 3.1], Loss::Squared);
        assert_eq!(found.residuals[0], None);
        for (residual, expected) in found.residuals[1..].iter().zip([2.9, 1.0, 3.1, -2.0]) {
            assert!((residual.unwrap() - 0.01 * expected).abs() < 1e-12);
        }
        assert_eq!(found.inliers, [false, true, true, true, true]);
        let squares = 1.0 + 4.0 + 2.9 * 2.9 + 3.1 * 3.1;
        assert!((found.rms - 0.01 * (squares / 4.0_f64).sqrt()).abs() < 1e-12);
        assert!((found.cost / (0.5 * squares) - 1.0).abs() < 1e-9);
        let truncated = off([1.0, -2.0, 2.9, 3.1], Loss::Truncated(3.0));
        assert_eq!(truncated.inliers, [false, true, true, false, true]);
        assert!((truncated.cost / (0.5 * (squares - 3.1 * 3.1 + 9.0)) - 1.0).abs() < 1e-9);
    }

    /// What a component has is not undetermined, and comes with it.
    #[test]
    fn components_determine_what_they_contain() {
        let mut found = off([0.0; 4], Loss::Squared);
        let one = |subject| Undetermined {
            subject,
            why: Why::Degenerate,
        };
        let (view, landmark) = (Subject::View(1), Subject::Landmark(2));
        found.undetermined = Vec::from([one(Subject::View(0)), one(view), one(landmark)]);
        let mut other = found.clone();
        other.map = Map::empty(2, 4);
        other.map.poses[1] = Some(pose(0.0, 0.0, 0.0));
        found.attach(Vec::from([other.clone()]));
        assert_eq!(found.undetermined, [one(Subject::View(0)), one(landmark)]);
        assert_eq!(found.components.len(), 1);
        other.map.landmarks[2] = Some(Point2::origin());
        found.attach(Vec::from([other]));
        assert_eq!(found.undetermined, [one(Subject::View(0))]);
    }

    /// Measured numbers and the gauge over unknowns, never below zero.
    #[test]
    fn the_freedom_is_what_is_measured_beyond_the_unknowns() {
        let scene = simulate(Layout::Enclosed, 5, 9, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(5, 9, &scene.bearings, 0.01).unwrap();
        let mut map = scene.map();
        assert_eq!(freedom(&problem, &map, &[true; 45]), 45 + 4 - 15 - 18);
        assert_eq!(freedom(&problem, &map, &[false; 45]), 0);
        map.landmarks[3] = None;
        let seen: Vec<bool> = (0..45).map(|k| k % 9 != 3).collect();
        assert_eq!(freedom(&problem, &map, &seen), 40 + 4 - 15 - 16);
        let odometry = scene.odometry([0.1, 0.1, 0.1], 1).unwrap();
        let problem = problem.with_odometry(&odometry).unwrap();
        // It has three numbers for each motion, and fixes the scale.
        assert_eq!(freedom(&problem, &map, &seen), 40 + 12 + 3 - 15 - 16);
    }

    /// A landmark at infinity, or on a view, is one parameter.
    #[test]
    fn directions_are_one_parameter() {
        let scene = simulate(Layout::Enclosed, 5, 9, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(5, 9, &scene.bearings, 0.01).unwrap();
        let report = Report {
            cost: f64::NAN,
            termination: Termination::NotRefined,
            iterations: 0,
            undetermined: Vec::new(),
            loss: Loss::Squared,
        };
        let mut found = Reconstruction::new(&problem, &scene.map(), report);
        let all = found.freedom;
        found.count_directions(&problem);
        assert_eq!(found.freedom, all);
        let on_view = found.map.poses[1].unwrap().translation.vector;
        found.map.landmarks[2] = Some(on_view.into());
        found.map.landmarks[4] = None;
        found.undetermined.push(Undetermined {
            subject: Subject::Landmark(4),
            why: Why::AtInfinity,
        });
        for _ in 0..2 {
            found.count_directions(&problem);
            assert_eq!(found.freedom, all + 2);
        }
        // What is missing to determine the map is counted, too.
        found.undetermined.clear();
        found.inliers[..all + 4].fill(false);
        found.count_directions(&problem);
        assert_eq!(found.freedom, 0);
    }

    /// The cost that the refinement reports stands unless that of the map in its frame differs by more than rounding.
    #[test]
    fn the_reported_cost_stands_up_to_rounding() {
        let scene = simulate(Layout::Enclosed, 5, 9, 0.01, 3, Arena::default()).unwrap();
        let problem = Problem::dense(5, 9, &scene.bearings, 0.01).unwrap();
        let map = scene.map();
        let reported = |cost: f64| {
            let report = Report {
                cost,
                termination: Termination::Converged,
                iterations: 3,
                undetermined: Vec::new(),
                loss: Loss::Squared,
            };
            Reconstruction::new(&problem, &map, report).cost
        };
        let pairs = problem.sightings().iter().zip(map.residuals(&problem));
        let exact: f64 = pairs
            .map(|(s, r)| 0.5 * (r.unwrap() * s.weight).powi(2))
            .sum();
        for (times, stands) in [
            (1.0 + 1e-10, true),
            (1.0 - 1e-10, true),
            (1.0 + 1e-8, false),
            (1.0 - 1e-8, false),
            // Not refined.
            (f64::NAN, false),
        ] {
            let cost = reported(exact * times);
            assert_eq!(cost == exact * times, stands, "{times}");
            assert!((cost / exact - 1.0).abs() < 2e-10);
        }
    }
}
