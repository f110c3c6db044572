// SPDX-License-Identifier: MIT OR Apache-2.0
//! Does a map say when it is wrong? `cargo bench --bench trust --features rayon [-- [SCENES [SEED]] [CLASS ...] [verbose]]`.
//!
//! A map is wrong when a view or a landmark is off by more than a fifth of the size of the scene and by more than three
//! times what is predicted, or when, with at least ten degrees of freedom, its cost is more than half above that which
//! the truth leads to. It is alarmed when it has not converged, when the test of the fit warns, or when there is an
//! alternative; a wrong map that is not is silently wrong. `told` counts those of them that chi-square could tell: the
//! refinement from the truth has p below 1e-6; `another minimum`, those that are not the minimum next to the truth, by
//! their costs: the others are as far off as the bearings leave them, and no test of the fit can tell. A class is named by
//! the beginning of its name.
//!
//! `detected` counts the alarms among the scenes of which one wrong bearing has a standardized residual above 6.

mod scenes;
#[allow(dead_code, reason = "shared with the bench of starts")]
#[path = "../start/scenes.rs"]
mod starts;
#[allow(dead_code, reason = "shared with the bench of starts")]
#[path = "../start/truth.rs"]
mod truth;

use bearslam::{
    Covariance, Error, Frame, GlobalTest, Loss, Map, Problem, Reconstruction, RefineOptions,
    Severity, SolveOptions, TestOptions, covariance, fit_findings, redundancy, refine, solve,
    test_fit,
};
use nalgebra::{Complex, Point2};
use rayon::prelude::*;
use scenes::{CLASSES, Class};
use starts::Instance;
use truth::truncated_from_truth;

/// Share of the size of a scene above which an error is large.
const LARGE: f64 = 0.2;
/// Standard deviations above which an error is more than was predicted.
const UNPREDICTED: f64 = 3.0;
/// Times the cost from the truth above which a map is another one.
const OTHER: f64 = 1.5;

/// What came of one scene.
struct Run {
    seed: u64,
    refused: bool,
    /// Why the map is wrong, if it is.
    wrong: Option<String>,
    alarms: Vec<String>,
    /// Whether the refinement from the truth does not fit.
    told: bool,
    /// Whether the map is another minimum than that next to the truth.
    is_other: bool,
    /// Whether the one wrong bearing could be found.
    detectable: Option<bool>,
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let mut numbers = words.iter().filter_map(|word| word.parse().ok());
    let scenes: Option<u64> = numbers.next();
    let seed: u64 = numbers.next().unwrap_or(0);
    let verbose = words.iter().any(|word| word == "verbose");
    let is_named = |class: &Class| {
        words
            .iter()
            .any(|word| class.name.starts_with(word.as_str()))
    };
    let all = !CLASSES.iter().any(is_named);
    println!(
        "| class | scenes | refused | wrong | silently | of these told | another minimum | alarms | detected |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for class in CLASSES.iter().filter(|class| all || is_named(class)) {
        let scenes = scenes.unwrap_or(class.scenes);
        let runs = (seed..seed + scenes).into_par_iter();
        let runs: Vec<Run> = runs.map(|seed| run(class, seed)).collect();
        report(class, &runs, verbose);
    }
}

fn report(class: &Class, runs: &[Run], verbose: bool) {
    let count = |is: &dyn Fn(&Run) -> bool| runs.iter().filter(|run| is(run)).count();
    let share = |part: usize, all: usize| {
        format!("{part} ({:.2} %)", 100.0 * part as f64 / all.max(1) as f64)
    };
    let is_silent = |run: &Run| run.wrong.is_some() && run.alarms.is_empty();
    let detectable = count(&|run| run.detectable == Some(true));
    let detected = count(&|run| run.detectable == Some(true) && !run.alarms.is_empty());
    println!(
        "| {} | {} | {} | {} | {} | {} | {} | {} | {} |",
        class.name,
        runs.len(),
        share(count(&|run| run.refused), runs.len()),
        share(count(&|run| run.wrong.is_some()), runs.len()),
        share(count(&is_silent), runs.len()),
        count(&|run| is_silent(run) && run.told),
        count(&|run| is_silent(run) && run.is_other),
        share(count(&|run| !run.alarms.is_empty()), runs.len()),
        if detectable > 0 {
            format!("{} of {detectable}", share(detected, detectable))
        } else {
            String::new()
        },
    );
    for run in runs.iter().filter(|_| verbose) {
        let missed = run.detectable == Some(true) && run.alarms.is_empty();
        let is_false = class.is_clean && !run.alarms.is_empty();
        if let Some(wrong) = run.wrong.as_ref().filter(|_| is_silent(run)) {
            let told = if run.told { ", told" } else { "" };
            println!("    seed {}: silent{told}: {wrong}", run.seed);
        } else if is_false {
            println!("    seed {}: alarms {}", run.seed, run.alarms.join(", "));
        } else if missed {
            println!("    seed {}: not detected", run.seed);
        }
    }
}

fn run(class: &Class, seed: u64) -> Run {
    let instance = (class.build)(seed);
    let options = SolveOptions {
        robust: class.robust,
        ..SolveOptions::default()
    };
    let found = solve(&instance.problem, &options, None);
    let truth = from_truth(class, &instance);
    let told = matches!(&truth, Truth::Map(truth)
        if GlobalTest::of(&instance.problem, truth).p_value < 1e-6);
    Run {
        seed,
        refused: found.is_err(),
        wrong: found
            .as_ref()
            .ok()
            .and_then(|found| wrong(&instance, found, &truth)),
        alarms: found.as_ref().map_or_else(
            |error| vec![refusal(error)],
            |found| alarms(&instance, found),
        ),
        told,
        is_other: found.as_ref().is_ok_and(|found| is_other(found, &truth)),
        detectable: detectable(&instance, &truth),
    }
}

/// Whether a map has another cost than that which the truth leads to.
fn is_other(found: &Reconstruction, truth: &Truth) -> bool {
    let least = truth.cost();
    least.is_some_and(|least| (found.cost - least).abs() > 1e-5 * least.max(1.0))
}

fn refusal(error: &Error) -> String {
    format!("refused: {error}")
}

/// What the truth leads to.
enum Truth {
    Map(Box<Reconstruction>),
    /// Its truncated cost.
    Cost(f64),
    Unknown,
}

impl Truth {
    fn cost(&self) -> Option<f64> {
        match self {
            Self::Map(truth) => Some(truth.cost),
            Self::Cost(cost) => Some(*cost),
            Self::Unknown => None,
        }
    }
}

fn from_truth(class: &Class, instance: &Instance) -> Truth {
    if class.robust {
        return truncated_from_truth(instance).map_or(Truth::Unknown, Truth::Cost);
    }
    let options = RefineOptions {
        max_iterations: 1000,
        ..RefineOptions::default()
    };
    let truth = refine(&instance.problem, &instance.truth, &options, None);
    truth.map_or(Truth::Unknown, |truth| Truth::Map(Box::new(truth)))
}

/// Why a user would not trust a map: what the Python package warns of.
fn alarms(instance: &Instance, found: &Reconstruction) -> Vec<String> {
    let mut alarms = Vec::new();
    for one in std::iter::once(found).chain(&found.components) {
        if !one.termination.was_successful() {
            alarms.push(format!("{}", one.termination));
        }
    }
    if !found.alternatives.is_empty() {
        alarms.push(format!("{} alternatives", found.alternatives.len()));
    }
    let test = test_fit(&instance.problem, found, &TestOptions::default(), None).expect("a test");
    let findings = fit_findings(&instance.problem, &test);
    let serious = findings.iter().filter(|one| one.severity < Severity::Note);
    alarms.extend(serious.map(|one| format!("{:?}", one.kind)));
    alarms
}

/// Whether the standardized residual of the one wrong bearing would exceed 6 in the minimum next to the truth; `None`
/// when not exactly one is wrong.
fn detectable(instance: &Instance, truth: &Truth) -> Option<bool> {
    let mut wrong = (0..instance.wrong.len()).filter(|&k| instance.wrong[k]);
    let place = wrong.next()?;
    let Truth::Map(truth) = truth else {
        return None;
    };
    if wrong.next().is_some() {
        return None;
    }
    let checked = redundancy(&instance.problem, &truth.map, &truth.inliers, None).ok()?;
    Some(checked.sightings[place].is_some_and(|one| one.standardized.abs() > 6.0))
}

/// Why a map is wrong, if it is.
fn wrong(instance: &Instance, found: &Reconstruction, truth: &Truth) -> Option<String> {
    let least = truth.cost().unwrap_or(f64::INFINITY);
    if found.freedom >= 10 && found.cost > OTHER * least {
        return Some(format!("cost {:.3}, from the truth {least:.3}", found.cost));
    }
    let inner = of_inliers(instance, found);
    let predicted = covariance(&inner, &found.map, Loss::Squared, Frame::FreeNetwork, None);
    let sigma0 = GlobalTest::of(&instance.problem, found).sigma0.max(1.0);
    let size = size(&instance.truth);
    let places = places(&instance.truth, &found.map, &predicted.ok()?);
    let aligned = Similarity::of(&places)?;
    // Where two landmarks bear one identity, either is right.
    let nameless: Vec<Complex<f64>> = (0..instance.problem.landmarks())
        .filter(|&landmark| instance.problem.of_landmark(landmark).is_empty())
        .filter_map(|landmark| instance.truth.landmarks[landmark])
        .map(|point| Complex::new(point.x, point.y))
        .collect();
    let error = |place: &Place| {
        let found = aligned.apply(place.found);
        let others = nameless.iter().filter(|_| place.is_landmark);
        let errors = others.map(|other| (found - other).norm());
        errors.fold((found - place.truth).norm(), f64::min)
    };
    let worst = places.iter().filter_map(|place| {
        let error = error(place);
        let predicted = sigma0 * place.deviation * aligned.turn.norm();
        (error > LARGE * size && error > UNPREDICTED * predicted).then_some((
            error / size,
            predicted / size,
            &place.name,
        ))
    });
    let (error, predicted, name) = worst.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(format!(
        "{name} is off by {error:.2} sizes, predicted {predicted:.3}; cost {:.3}, from the truth {least:.3}, freedom {}",
        found.cost, found.freedom
    ))
}

/// The sightings that a map is estimated from, with all that is known besides.
fn of_inliers(instance: &Instance, found: &Reconstruction) -> Problem {
    if found.inliers.iter().all(|inlier| *inlier) {
        return instance.problem.clone();
    }
    let pairs = instance.sightings.iter().zip(&found.inliers);
    let kept: Vec<_> = pairs.filter(|(_, kept)| **kept).map(|(s, _)| *s).collect();
    let problem = &instance.problem;
    Problem::new(problem.views(), problem.landmarks(), &kept).expect("a problem")
}

/// Root-mean-square distance of the true landmarks from their centroid.
fn size(truth: &Map) -> f64 {
    let points: Vec<Point2<f64>> = truth.landmarks.iter().flatten().copied().collect();
    let count = points.len() as f64;
    let sum = points
        .iter()
        .fold(nalgebra::Vector2::zeros(), |sum, p| sum + p.coords);
    let squares = points
        .iter()
        .map(|p| (p.coords - sum / count).norm_squared());
    (squares.sum::<f64>() / count).sqrt()
}

/// A view or a landmark: where it is, where the map has it, and its predicted standard deviation in the map.
struct Place {
    name: String,
    is_landmark: bool,
    truth: Complex<f64>,
    found: Complex<f64>,
    deviation: f64,
}

fn places(truth: &Map, found: &Map, predicted: &Covariance) -> Vec<Place> {
    let at = |x: f64, y: f64| Complex::new(x, y);
    let mut places = Vec::new();
    let poses = truth.poses.iter().zip(&found.poses).zip(&predicted.poses);
    for (view, pair) in poses.enumerate() {
        if let ((Some(truth), Some(found)), Some(predicted)) = pair {
            let (truth, found) = (truth.translation.vector, found.translation.vector);
            places.push(Place {
                name: format!("view {view}"),
                is_landmark: false,
                truth: at(truth.x, truth.y),
                found: at(found.x, found.y),
                deviation: (predicted[(0, 0)] + predicted[(1, 1)]).sqrt(),
            });
        }
    }
    let landmarks = truth.landmarks.iter().zip(&found.landmarks);
    for (landmark, pair) in landmarks.zip(&predicted.landmarks).enumerate() {
        if let ((Some(truth), Some(found)), Some(predicted)) = pair {
            places.push(Place {
                name: format!("landmark {landmark}"),
                is_landmark: true,
                truth: at(truth.x, truth.y),
                found: at(found.x, found.y),
                deviation: predicted.trace().sqrt(),
            });
        }
    }
    places
}

/// z -> turn * z + shift, from a map to the truth.
struct Similarity {
    turn: Complex<f64>,
    shift: Complex<f64>,
}

impl Similarity {
    /// The one that brings places closest, weighted by their predicted standard deviations; `None` where nothing is held.
    fn of(places: &[Place]) -> Option<Self> {
        let least = places
            .iter()
            .map(|place| place.deviation)
            .fold(f64::INFINITY, f64::min);
        let weights: Vec<f64> = places
            .iter()
            .map(|place| (least.max(1e-12) / place.deviation.max(1e-12)).powi(2))
            .map(|weight| if weight.is_finite() { weight } else { 0.0 })
            .collect();
        let sum: f64 = weights.iter().sum();
        let mean = |of: fn(&Place) -> Complex<f64>| {
            let pairs = places.iter().zip(&weights);
            pairs.fold(Complex::new(0.0, 0.0), |s, (place, w)| s + of(place) * *w) / sum
        };
        let (truth, found) = (mean(|place| place.truth), mean(|place| place.found));
        let (mut cross, mut square) = (Complex::new(0.0, 0.0), 0.0);
        for (place, weight) in places.iter().zip(&weights) {
            let from = place.found - found;
            cross += from.conj() * (place.truth - truth) * *weight;
            square += from.norm_sqr() * weight;
        }
        let turn = cross / square;
        (turn.norm() > 0.0 && turn.norm().is_finite()).then(|| Self {
            turn,
            shift: truth - turn * found,
        })
    }

    fn apply(&self, z: Complex<f64>) -> Complex<f64> {
        self.turn * z + self.shift
    }
}
