// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sensors whose bearings are all turned by one angle, or counted clockwise.
//!
//! From bearings alone neither shows: headings take up the angle, and the mirror image of the map explains the others.
//! Odometry and priors contradict them, and the fit is poor. One unknown more, or the mirror image, explains it.

use super::alarm::{Alarm, TestOptions, is_poor};
use super::distributions::normal_exceeded;
use crate::adjustment::{aligned_to_priors, refine_map};
use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::Bearing;
use crate::lm::{Observer, RefineOptions};
use crate::problem::{Map, Prior, Problem};
use crate::reconstruction::{Progress, Reconstruction, SolveOptions, report_progress, solve};
use alloc::vec::Vec;
use core::f64::consts::PI;
use nalgebra::{Complex, Vector2};

/// What a sensor that is a little turned explains of a fit, sought from the map: that of all views, or of one robot of
/// several; `None` when it does not.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so.
pub fn turned_a_little(
    problem: &Problem,
    found: &Reconstruction,
    options: &TestOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Alarm>, Error> {
    let whole = Fit::of(found);
    let look = &mut looks(progress);
    let mut groups = Vec::from([all_views(problem)]);
    groups.extend(most_turned_robot(problem, &found.map));
    for views in groups {
        let least = Turned::new(problem, &views).least(&found.map, 0.0, look)?;
        let is_whole = |fit: &Fit| fit.freedom >= whole.freedom;
        let is_it = |fit: &Fit| is_whole(fit) && whole.is_explained_by(fit, options);
        if let Some((angle, _)) = least.filter(|(_, fit)| is_it(fit)) {
            return Ok(Some(Alarm::TurnedBearings { views, angle }));
        }
    }
    Ok(None)
}

/// What a sensor that is turned by any angle, or mirrored, explains of a poor fit; `None` when it does not.
///
/// The map of the bearings alone does not depend on either. Its motions, as the sensor sees them, are turned against
/// odometry, and its headings against those that are known.
///
/// # Errors
/// [`Error::Interrupted`] when `progress` says so.
pub fn turned_or_mirrored(
    problem: &Problem,
    found: &Reconstruction,
    options: &TestOptions,
    progress: &mut Option<Progress<'_>>,
) -> Result<Option<Alarm>, Error> {
    let whole = Fit::of(found);
    let look = &mut looks(progress);
    let Some(shape) = map_of(&problem.clone().bearings_only(), look)? else {
        return Ok(None);
    };
    let mirrored = problem.with_bearings(|s| s.bearing.inverse());
    let views = all_views(problem);
    for (problem, shape, is_mirrored) in [
        (problem, &shape, false),
        (&mirrored, &mirror_image(&shape), true),
    ] {
        let turned = Turned::new(problem, &views);
        let start = angle_of_sensor(problem, shape);
        let mut map = shape.clone();
        for pose in map.poses.iter_mut().flatten() {
            pose.rotation *= Bearing::new(start);
        }
        let map = aligned_to_priors(&turned.by(start), &map);
        // Bearings alone may determine a part only: where that fits, the rest is placed as well.
        let part = turned.least(&map, start, look)?;
        let Some((angle, _)) = part.filter(|(_, fit)| fit.is_better_than(&whole, options)) else {
            continue;
        };
        let Some(map) = map_of(&turned.by(angle), look)? else {
            continue;
        };
        let least = turned.least(&map, angle, look)?;
        // A small angle is no reason to leave anything out.
        let is_large = |angle: f64| is_mirrored || angle.abs() > options.far_off;
        let is_whole = |fit: &Fit| fit.freedom >= whole.freedom;
        let least = least.filter(|(angle, fit)| is_large(*angle) || is_whole(fit));
        if let Some((angle, _)) = least.filter(|(_, fit)| whole.is_explained_by(fit, options)) {
            return Ok(Some(if is_mirrored {
                Alarm::MirroredBearings
            } else {
                Alarm::TurnedBearings { views, angle }
            }));
        }
    }
    Ok(None)
}

/// An observer of steps that tells whoever waits.
fn looks<'a, 'b>(
    progress: &'a mut Option<Progress<'b>>,
) -> impl FnMut(usize, f64) -> bool + use<'a, 'b> {
    let mut steps = 0;
    move |_, _| {
        steps += 1;
        report_progress(progress, "test", steps, 0)
    }
}

fn all_views(problem: &Problem) -> Vec<usize> {
    (0..problem.views()).collect()
}

/// The map on the other side of the x axis.
fn mirror_image(map: &Map) -> Map {
    let mut image = map.clone();
    for pose in image.poses.iter_mut().flatten() {
        pose.translation.vector.y *= -1.0;
        pose.rotation = pose.rotation.inverse();
    }
    for point in image.landmarks.iter_mut().flatten() {
        point.y *= -1.0;
    }
    image
}

/// The angle by which a sensor turns its bearings, by a map of them: the mean angle from each motion of odometry to what
/// the sensor sees of it, (T35), and from headings in the map to those that are known, once positions are aligned.
fn angle_of_sensor(problem: &Problem, map: &Map) -> f64 {
    let complex = |vector: &Vector2<f64>| Complex::new(vector.x, vector.y);
    let mut sum = Complex::new(0.0, 0.0);
    let (mut known, mut turns) = (Vec::new(), Vec::new());
    for prior in problem.priors() {
        match prior {
            Prior::Motion {
                start, end, delta, ..
            } => {
                if let (Some(from), Some(to)) = (map.poses[*start], map.poses[*end]) {
                    let seen = from.inv_mul(&to).translation.vector;
                    sum += complex(&seen) * complex(&delta.translation.vector).conj();
                }
            }
            Prior::Pose { view, pose, root } => {
                let Some(found) = map.poses[*view] else {
                    continue;
                };
                let knows = |column: usize| root.iter().any(|row| row[column] != 0.0);
                if knows(0) && knows(1) {
                    let place = complex(&pose.translation.vector);
                    known.push((complex(&found.translation.vector), place));
                }
                if knows(2) {
                    let turn = pose.rotation.into_inner() * found.rotation.into_inner().conj();
                    turns.push(turn);
                }
            }
            Prior::Landmark {
                landmark, position, ..
            } => {
                if let Some(found) = map.landmarks[*landmark] {
                    known.push((complex(&found.coords), complex(&position.coords)));
                }
            }
        }
    }
    if known.len() > 1 {
        let count = known.len() as f64;
        let zero = Complex::new(0.0, 0.0);
        let (from, to) = known
            .iter()
            .fold((zero, zero), |(a, b), (from, to)| (a + from, b + to));
        let (from, to) = (from / count, to / count);
        let turn: Complex<f64> = known
            .iter()
            .map(|(a, b)| (a - from).conj() * (b - to))
            .sum();
        // A length, as that of the motions.
        sum += turns
            .iter()
            .map(|known| known * turn.conj())
            .sum::<Complex<f64>>()
            / count;
    }
    sum.im.atan2(sum.re)
}

/// The sum of squares of a map and its degrees of freedom.
#[derive(Clone, Copy)]
struct Fit {
    square: f64,
    freedom: usize,
}

impl Fit {
    fn of(found: &Reconstruction) -> Self {
        Self {
            square: 2.0 * found.cost,
            freedom: found.freedom,
        }
    }

    /// Whether a fit with one unknown more, of about as many observations, is good, or a tenth as bad, and not so by
    /// chance. It may explain what the other leaves out.
    fn is_explained_by(&self, other: &Self, options: &TestOptions) -> bool {
        let Some(freedom) = other.freedom.checked_sub(1).filter(|f| *f > 0) else {
            return false;
        };
        if (other.freedom as f64) < (1.0 - options.lost) * self.freedom as f64 {
            return false;
        }
        if other.freedom > self.freedom + 1 && !is_poor(other.square, freedom, options) {
            return true;
        }
        let variance = (other.square / freedom as f64).max(1.0);
        let significant = normal_exceeded(options.blunder_significance);
        let is_gain = self.square - other.square > significant * significant * variance;
        is_gain && other.is_better_than(self, options)
    }

    /// Whether the fit is good, or its squares are a tenth as large as those of another, of which it may be a part.
    fn is_better_than(&self, other: &Self, options: &TestOptions) -> bool {
        let per_freedom = |fit: &Self| fit.square / fit.freedom.max(1) as f64;
        !is_poor(self.square, self.freedom, options)
            || per_freedom(self) < options.explained * per_freedom(other)
    }
}

/// A problem whose bearings from some views are turned by an angle.
struct Turned<'a> {
    problem: &'a Problem,
    is_turned: Vec<bool>,
    /// Sum of the squared weights of the turned bearings.
    information: f64,
}

/// Steps in search of an angle; they converge in some five.
const STEPS: usize = 20;

/// Longest step \[rad\].
const LONGEST: f64 = 0.5;

/// Part of the standard deviation of the angle to which it is found.
const ACCURACY: f64 = 1e-2;

impl<'a> Turned<'a> {
    fn new(problem: &'a Problem, views: &[usize]) -> Self {
        let mut is_turned = alloc::vec![false; problem.views()];
        for &view in views {
            is_turned[view] = true;
        }
        let sightings = problem.sightings().iter();
        let turned = sightings.filter(|s| is_turned[s.view]);
        let information = turned.map(|s| s.weight * s.weight).sum();
        Self {
            problem,
            is_turned,
            information,
        }
    }

    /// The bearings without the angle by which the sensor turns them.
    fn by(&self, angle: f64) -> Problem {
        let back = Bearing::new(-angle);
        self.problem.with_bearings(|s| {
            if self.is_turned[s.view] {
                back * s.bearing
            } else {
                s.bearing
            }
        })
    }

    /// The derivative of the cost of the minimum by the angle: at a minimum the map does not contribute.
    fn slope(&self, problem: &Problem, map: &Map) -> f64 {
        let pairs = problem.sightings().iter().zip(map.residuals(problem));
        let turned = pairs.filter(|(s, _)| self.is_turned[s.view]);
        let slopes = turned.filter_map(|(s, residual)| Some(s.weight * s.weight * residual?));
        slopes.sum()
    }

    /// The angle of least cost next to a start, and the fit there; `None` where none is found.
    ///
    /// The secant method on the derivative of the cost.
    fn least(
        &self,
        start: &Map,
        angle: f64,
        look: Observer<'_>,
    ) -> Result<Option<(f64, Fit)>, Error> {
        let (mut map, mut angle) = (start.clone(), angle);
        let mut curvature = self.information;
        let mut last: Option<(f64, f64)> = None;
        for _ in 0..STEPS {
            let problem = self.by(angle);
            let Some(fit) = refined(&problem, &mut map, look)? else {
                return Ok(None);
            };
            let slope = self.slope(&problem, &map);
            if let Some((other, slope_there)) = last {
                let secant = (slope - slope_there) / (angle - other);
                // Where the cost bends down, the step stays the last one downhill.
                if secant > 0.0 {
                    curvature = secant.min(self.information);
                }
            }
            let step = (-slope / curvature).clamp(-LONGEST, LONGEST);
            if step.abs() * curvature.sqrt() < ACCURACY {
                let wrapped = Bearing::new(angle).angle();
                return Ok(Some((wrapped, fit)));
            }
            last = Some((angle, slope));
            angle += step;
            if (angle - last.map_or(angle, |(before, _)| before)).abs() > PI {
                return Ok(None);
            }
        }
        Ok(None)
    }
}

/// Refines a map; `None` where that leads nowhere.
fn refined(problem: &Problem, map: &mut Map, look: Observer<'_>) -> Result<Option<Fit>, Error> {
    match refine_map(problem, map, &RefineOptions::default(), Some(look)) {
        Ok(report) => Ok(Some(Fit::of(&Reconstruction::tested(problem, map, report)))),
        Err(error) if error.stops_all() => Err(error),
        Err(_) => Ok(None),
    }
}

/// A map without an initial guess; `None` where there is none.
fn map_of(problem: &Problem, look: Observer<'_>) -> Result<Option<Map>, Error> {
    let mut go_on = |_: &'static str, done, _| look(done, 0.0);
    match solve(problem, &SolveOptions::default(), Some(&mut go_on)) {
        Ok(found) => Ok(Some(found.map)),
        Err(error) if error.stops_all() => Err(error),
        Err(_) => Ok(None),
    }
}

/// Of several robots, the one whose bearings most agree that they are turned: the largest mean residual over its standard
/// deviation. `None` of one robot.
fn most_turned_robot(problem: &Problem, map: &Map) -> Option<Vec<usize>> {
    let mut robot: Vec<usize> = (0..problem.views()).collect();
    for prior in problem.priors() {
        if let Prior::Motion { start, end, .. } = prior {
            let (kept, lost) = (robot[*start], robot[*end]);
            for one in &mut robot {
                if *one == lost {
                    *one = kept;
                }
            }
        }
    }
    let score = |views: &Vec<usize>| {
        let turned = Turned::new(problem, views);
        turned.slope(problem, map).abs() / turned.information.sqrt()
    };
    let robots = (0..problem.views()).map(|name| -> Vec<usize> {
        (0..problem.views())
            .filter(|&view| robot[view] == name)
            .collect()
    });
    let robots: Vec<_> = robots.filter(|views| views.len() > 1).collect();
    let is_one = robots.len() < 2;
    let most = robots
        .into_iter()
        .max_by(|a, b| score(a).total_cmp(&score(b)));
    most.filter(|_| !is_one)
}
