// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every degenerate configuration gets its name, and regular ones cause no false alarm.

use super::common;
use super::shapes::{DEGENERATE, Draw, Drawn, HARMLESS};
use bearslam::{
    Diagnosis, Error, Kind, Map, Pose, Problem, Severity, Sighting, SolveOptions, bearing_to,
    diagnose, pose, solve,
};
use nalgebra::Point2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const SEEDS: u64 = 4;

fn named(found: &Diagnosis, name: &str) -> bool {
    let mut findings = found.findings.iter();
    findings.any(|f| f.kind.name() == name && f.severity < Severity::Note)
}

/// At the true map each row has the name and the number of directions given in the table.
#[test]
fn rows_of_the_table_at_the_truth() {
    for (name, views, landmarks, sizes, extra) in DEGENERATE {
        for &size in sizes {
            for seed in 0..SEEDS {
                let scene = Drawn::new(views, landmarks, size, 0.0, seed);
                let found = diagnose(&scene.problem(1.0), Some(&scene.truth()), None).unwrap();
                assert!(named(&found, name), "{name} {size:?} {seed}: {found}");
                assert!(!found.determined(), "{name} {size:?} {seed}: {found}");
                assert_eq!(found.extra, extra, "{name} {size:?} {seed}: {found}");
                let finding = found.findings.iter().find(|f| f.kind.name() == name);
                assert_eq!(finding.unwrap().directions, extra, "{name} {size:?} {seed}");
                assert_eq!(found.directions.iter().filter(|d| d.free).count(), extra);
            }
        }
    }
}

/// From exact bearings alone.
#[test]
fn rows_of_the_table_from_bearings_alone() {
    for (name, views, landmarks, sizes, _) in DEGENERATE {
        for &size in sizes {
            for seed in 0..SEEDS {
                let scene = Drawn::new(views, landmarks, size, 0.0, seed);
                let found = diagnose(&scene.problem(1.0), None, None).unwrap();
                assert!(named(&found, name), "{name} {size:?} {seed}: {found}");
            }
        }
    }
}

/// From noisy bearings alone, with their standard deviation stated or estimated from the residuals. Two rows
/// have no redundancy to estimate the noise from, so it must be stated. With three views on a line or four
/// landmarks on a circle two maps merge, which noise may separate; with everything on one line it may bend the map, which
/// then has other errors.
#[test]
fn rows_of_the_table_with_noise() {
    let mut missed = Vec::new();
    let mut all = 0;
    for (name, views, landmarks, sizes, _) in DEGENERATE {
        for &size in sizes {
            for noise in [0.01_f64, 0.03, 0.1].map(f64::to_radians) {
                for sigma in [noise, 1.0] {
                    let (m, n) = size;
                    if sigma == 1.0 && m * n + 4 == 3 * m + 2 * n {
                        continue;
                    }
                    for seed in 0..SEEDS {
                        let scene = Drawn::new(views, landmarks, size, noise, seed);
                        let found = diagnose(&scene.problem(sigma), None, None).unwrap();
                        all += 1;
                        if !named(&found, name) {
                            missed.push((name, size, noise, sigma, seed));
                        }
                    }
                }
            }
        }
    }
    // As measured by benches/diagnosis.rs: a few of 100, all of them in the rows named here.
    for (name, ..) in &missed {
        assert!(
            matches!(
                *name,
                "three_collinear_views"
                    | "four_landmarks_on_a_circle"
                    | "everything_on_one_line"
                    | "lines_of_views_and_of_landmarks"
            ),
            "{missed:?}"
        );
    }
    assert!(
        20 * missed.len() < all,
        "{} of {all}: {missed:?}",
        missed.len()
    );
}

/// Similar configurations that leave nothing free cause no alarm.
#[test]
fn harmless_relatives() {
    for (name, views, landmarks, sizes, _) in HARMLESS {
        for &size in sizes {
            for seed in 0..SEEDS {
                let scene = Drawn::new(views, landmarks, size, 0.0, seed);
                for map in [Some(scene.truth()), None] {
                    let found = diagnose(&scene.problem(1.0), map.as_ref(), None).unwrap();
                    assert!(found.determined(), "{name} {size:?} {seed}: {found}");
                    assert_eq!(found.extra, 0, "{name} {size:?} {seed}: {found}");
                    // Four views of four landmarks may have several exact maps.
                    let several = found
                        .findings
                        .iter()
                        .all(|f| f.kind == Kind::SecondSolution);
                    assert!(several, "{name} {size:?} {seed}: {found}");
                }
            }
        }
    }
}

/// No error on generic scenes, and warnings only where they are true.
#[test]
fn no_false_alarm() {
    let mut warnings = 0;
    for seed in 0..60 {
        for (views, landmarks) in [(4, 7), (5, 9), (8, 11), (12, 15)] {
            for noise_deg in [0.0, 0.1, 0.5] {
                let layout = common::LAYOUTS[(seed % 2) as usize];
                let scene = common::scene(layout, views, landmarks, noise_deg, seed);
                let problem = common::problem(&scene);
                let found = diagnose(&problem, None, None).unwrap();
                assert!(
                    found.determined(),
                    "{layout:?} {views}x{landmarks} {seed}: {found}"
                );
                if found.worst() == Some(Severity::Warning) {
                    warnings += 1;
                    // Weak, or ambiguous.
                    let solved = solve(&problem, &SolveOptions::default(), None).unwrap();
                    let weak = found.directions.iter().any(|d| d.deviation > 0.1);
                    assert!(weak || !solved.alternatives.is_empty(), "{found}");
                }
            }
        }
    }
    assert!(warnings <= 10, "{warnings} of 720");
}

/// Following the advice is enough.
#[test]
fn advice_is_enough() {
    let off = [(0.4, 2.2), (-1.1, -2.0), (2.4, 1.9)].map(|(x, y)| Point2::new(x, y));
    let elsewhere = [pose(-0.7, 1.9, 0.4), pose(1.9, -0.6, 2.0)];
    type Added<'a> = (&'a str, &'a [Pose<f64>], &'a [Point2<f64>]);
    let cases: [Added<'_>; 9] = [
        ("counting", &[], &off[..1]),
        ("too_few_landmarks", &[], &off[..1]),
        ("three_collinear_views", &elsewhere[..1], &[]),
        ("coincident_views", &elsewhere[..1], &[]),
        ("collinear_landmarks", &[], &off[..1]),
        ("lines_of_views_and_of_landmarks", &[], &off[..1]),
        ("everything_on_one_line", &elsewhere, &off[..2]),
        ("views_and_landmarks_on_one_circle", &[], &off),
        ("three_views_and_landmarks_on_one_circle", &[], &off),
    ];
    for (name, views, landmarks) in cases {
        let row = DEGENERATE.iter().find(|row| row.0 == name).unwrap();
        for &size in row.3 {
            let scene = Drawn::new(row.1, row.2, size, 0.0, 1).with(views, landmarks);
            let found = diagnose(&scene.problem(1.0), Some(&scene.truth()), None).unwrap();
            assert_eq!(found.extra, 0, "{name} {size:?}: {found}");
            assert!(found.determined(), "{name} {size:?}: {found}");
        }
    }
}

/// One sighting fewer than advised is not enough: three of a landmark off the wall, four of one off two
/// lines.
#[test]
fn less_than_the_advice_is_not_enough() {
    for (name, needed) in [
        ("collinear_landmarks", 3),
        ("lines_of_views_and_of_landmarks", 4),
    ] {
        let row = DEGENERATE.iter().find(|row| row.0 == name).unwrap();
        let scene = Drawn::new(row.1, row.2, (5, 8), 0.0, 2).with(&[], &[Point2::new(0.4, 2.2)]);
        for seen in [needed - 1, needed] {
            let mut table = scene.table.clone();
            for view in seen..5 {
                table[view * 9 + 8] = f64::NAN;
            }
            let problem = Problem::dense(5, 9, &table, 1.0).unwrap();
            let found = diagnose(&problem, Some(&scene.truth()), None).unwrap();
            assert_eq!(found.determined(), seen == needed, "{name} {seen}: {found}");
        }
    }
}

/// The map that `solve` finds for a wall is as good evidence as the truth.
#[test]
fn the_solution_of_a_noisy_wall() {
    let mut named_walls = 0;
    for seed in 0..8 {
        let scene = Drawn::new(Draw::Anywhere, Draw::Line, (6, 9), 0.001, seed);
        let problem = scene.problem(1.0);
        if let Ok(solved) = solve(&problem, &SolveOptions::default(), None) {
            let found = diagnose(&problem, Some(&solved.map), None).unwrap();
            named_walls += usize::from(named(&found, "collinear_landmarks"));
        } else {
            named_walls += 1;
        }
    }
    assert!(named_walls >= 7, "{named_walls} of 8");
}

/// Four beacons on a square, seen from within with errors of two degrees: the map and its twin are far off
/// the circle on either side, and the map halfway between reveals it.
#[test]
fn beacons_on_a_square_with_much_noise() {
    let noise = 2_f64.to_radians();
    let beacons = [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0)].map(|(x, y)| Point2::new(x, y));
    let error = Normal::new(0.0, noise).unwrap();
    let (mut alone, mut of_map) = (0, 0);
    for seed in 0..20 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let places = (0..9).map(|k| (1.5 + f64::from(k % 3) * 1.5, 1.5 + f64::from(k / 3) * 1.5));
        let table: Vec<f64> = places
            .map(|(x, y)| pose(x, y, 1.6))
            .flat_map(|pose| beacons.map(|beacon| bearing_to(&pose, &beacon).unwrap().angle()))
            .map(|bearing| bearing + error.sample(&mut random))
            .collect();
        let problem = Problem::dense(9, 4, &table, noise).unwrap();
        let found = diagnose(&problem, None, None).unwrap();
        alone += usize::from(named(&found, "four_landmarks_on_a_circle"));
        if let Ok(solved) = solve(&problem, &SolveOptions::default(), None) {
            let found = diagnose(&problem, Some(&solved.map), None).unwrap();
            of_map += usize::from(named(&found, "four_landmarks_on_a_circle"));
        }
    }
    assert!(alone >= 18 && of_map >= 18, "{alone} and {of_map} of 20");
}

fn room() -> Vec<Point2<f64>> {
    let places = [
        (0.5, 4.0),
        (6.0, 3.5),
        (3.0, 5.0),
        (1.0, -1.0),
        (5.0, -0.5),
        (-1.0, 2.0),
        (7.0, 1.0),
        (3.5, 3.2),
    ];
    places.map(|(x, y)| Point2::new(x, y)).into()
}

fn walk(views: usize) -> Vec<Pose<f64>> {
    let at = |k: f64| pose(0.6 * k, (1.7 * k).sin(), k);
    (0..views).map(|k| at(k as f64)).collect()
}

fn sight(poses: &[Pose<f64>], points: &[Point2<f64>], pairs: &[(usize, usize)]) -> Problem {
    let sightings: Vec<_> = pairs
        .iter()
        .map(|&(view, landmark)| Sighting {
            view,
            landmark,
            bearing: bearing_to(&poses[view], &points[landmark]).unwrap().angle(),
            sigma: 1.0,
        })
        .collect();
    Problem::new(poses.len(), points.len(), &sightings).unwrap()
}

fn everything(
    views: core::ops::Range<usize>,
    landmarks: core::ops::Range<usize>,
) -> Vec<(usize, usize)> {
    views
        .flat_map(|view| landmarks.clone().map(move |landmark| (view, landmark)))
        .collect()
}

/// A view on one circle with the landmarks that it sees can slide along it, and nothing else is free.
#[test]
fn a_view_on_the_circle_of_its_landmarks() {
    let points = room();
    let mut poses = walk(5);
    // The circle through landmarks 0, 3 and 6.
    let circle = |a: Point2<f64>, b: Point2<f64>, c: Point2<f64>| {
        let m = nalgebra::Matrix2::new(b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y) * 2.0;
        let square = |p: Point2<f64>| p.coords.norm_squared();
        let right = nalgebra::Vector2::new(square(b) - square(a), square(c) - square(a));
        let centre = m.try_inverse().unwrap() * right;
        (centre, (a.coords - centre).norm())
    };
    let (centre, radius) = circle(points[0], points[3], points[6]);
    let place = centre + nalgebra::Vector2::new(0.8, -0.6) * radius;
    poses.push(pose(place.x, place.y, 0.3));
    let mut pairs = everything(0..5, 0..8);
    pairs.extend([(5, 0), (5, 3), (5, 6)]);
    let problem = sight(&poses, &points, &pairs);
    let found = diagnose(&problem, Some(&common::map(&poses, &points)), None).unwrap();
    assert_eq!(found.extra, 1, "{found}");
    let finding = found
        .find(Kind::ViewOnCircleOfLandmarks)
        .unwrap_or_else(|| panic!("{found}"));
    assert_eq!(
        (finding.views.as_slice(), finding.landmarks.as_slice()),
        (&[5][..], &[0, 3, 6][..])
    );
    assert_eq!(found.directions[0].movers[0].0, bearslam::Subject::View(5));
    assert!(found.directions[0].movers[0].1 > 0.99);
    // From bearings alone the view cannot be placed at all.
    let found = diagnose(&problem, None, None).unwrap();
    assert!(!found.determined(), "{found}");
    // One landmark off the circle determines it.
    pairs.push((5, 2));
    let problem = sight(&poses, &points, &pairs);
    assert!(diagnose(&problem, None, None).unwrap().findings.is_empty());
}

/// A landmark in line with the two views that see it.
#[test]
fn a_landmark_on_the_line_of_its_views() {
    let mut points = room();
    let poses = walk(6);
    let (a, b) = (poses[1].translation.vector, poses[4].translation.vector);
    points.push(Point2::from(b + (b - a) * 0.7));
    let mut pairs = everything(0..6, 0..8);
    pairs.extend([(1, 8), (4, 8)]);
    let problem = sight(&poses, &points, &pairs);
    let found = diagnose(&problem, Some(&common::map(&poses, &points)), None).unwrap();
    assert_eq!(found.extra, 1, "{found}");
    let finding = found
        .find(Kind::LandmarkOnLineOfViews)
        .unwrap_or_else(|| panic!("{found}"));
    assert_eq!(
        (finding.views.as_slice(), finding.landmarks.as_slice()),
        (&[1, 4][..], &[8][..])
    );
    let alone = diagnose(&problem, None, None).unwrap();
    assert!(
        !alone.determined() && alone.findings[0].landmarks == [8],
        "{alone}"
    );
}

/// Two halves that share one landmark: four directions minus the two that it fixes.
#[test]
fn loosely_tied_parts() {
    let points: Vec<_> = (0..13)
        .map(|k| {
            let k = f64::from(k);
            Point2::new(0.9 * k - 2.0, 1.5 + 4.0 * (2.3 * k).sin())
        })
        .collect();
    let poses = walk(8);
    let mut pairs = everything(0..4, 0..7);
    pairs.extend(everything(4..8, 6..13));
    let problem = sight(&poses, &points, &pairs);
    let found = diagnose(&problem, Some(&common::map(&poses, &points)), None).unwrap();
    assert_eq!(found.components.len(), 1);
    assert_eq!(found.extra, 2, "{found}");
    assert!(named(&found, "loose_part"), "{found}");
    let free: Vec<_> = found.directions.iter().filter(|d| d.free).collect();
    assert!(free.iter().all(|d| d.cause == Some(Kind::LoosePart)));
    // Without a map the second half is out of reach of the first.
    let found = diagnose(&problem, None, None).unwrap();
    let finding = found
        .find(Kind::Unreached)
        .unwrap_or_else(|| panic!("{found}"));
    assert!(
        finding.views == [4, 5, 6, 7] || finding.views == [0, 1, 2, 3],
        "{found}"
    );
    // Without a shared landmark there are two parts.
    let pairs = [everything(0..4, 0..6), everything(4..8, 7..13)].concat();
    let found = diagnose(&sight(&poses, &points, &pairs), None, None).unwrap();
    assert_eq!(found.components.len(), 2);
    assert!(named(&found, "disconnected"), "{found}");
    assert!(
        named(&found, "too_few_sightings"),
        "landmark 6 is not seen: {found}"
    );
}

/// Landmarks on a wall and on the circle through three views: a cubic through them.
#[test]
fn three_views_and_a_cubic() {
    let poses = [
        pose(0.0, 0.0, 0.1),
        pose(2.0, 0.0, 1.0),
        pose(0.5, 1.2, 2.0),
    ];
    // x^2 + y^2 - 2 x + e y = 0 goes through the first two, e through the third.
    let e = (2.0 * 0.5 - 0.25 - 1.44) / 1.2;
    let radius = (1.0_f64 + 0.25 * e * e).sqrt();
    let on = |t: f64| Point2::new(1.0 + radius * t.cos(), -0.5 * e + radius * t.sin());
    let mut points: Vec<_> = [-2.0, -0.8, 0.3, 1.6, 2.9, 4.0]
        .map(|x| Point2::new(x, 2.5 + 0.1 * x))
        .into();
    points.extend([0.4, 1.3, 3.7].map(on));
    let problem = sight(&poses, &points, &everything(0..3, 0..9));
    let truth = common::map(&poses, &points);
    for map in [Some(&truth), None] {
        let found = diagnose(&problem, map, None).unwrap();
        assert_eq!(found.extra, 1, "{found}");
        assert!(named(&found, "landmarks_on_a_cubic"), "{found}");
    }
}

/// Every input gets an answer.
#[test]
fn anything_is_diagnosed() {
    let empty = Problem::new(0, 0, &[]).unwrap();
    assert!(!diagnose(&empty, None, None).unwrap().determined());
    let unseen = Problem::new(4, 5, &[]).unwrap();
    assert!(named(
        &diagnose(&unseen, None, None).unwrap(),
        "too_few_sightings"
    ));
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for trial in 0..150 {
        let views = random.random_range(1..9);
        let landmarks = random.random_range(1..9);
        let share = random.random::<f64>();
        let coarse = trial % 3 == 0;
        let table: Vec<f64> = (0..views * landmarks)
            .map(|_| {
                let angle = 6.0 * random.random::<f64>() - 3.0;
                match random.random::<f64>() < share {
                    true if coarse => angle.round(),
                    true => angle,
                    false => f64::NAN,
                }
            })
            .collect();
        let problem = Problem::dense(views, landmarks, &table, 1.0).unwrap();
        let found = diagnose(&problem, None, None).unwrap();
        assert!(!found.to_string().is_empty());
        let same = Map {
            poses: vec![Some(pose(1.0, 1.0, 0.0)); views],
            landmarks: vec![(trial % 2 == 0).then(|| Point2::new(1.0, 1.0)); landmarks],
        };
        diagnose(&problem, Some(&same), None).unwrap();
        let broken = Map {
            poses: vec![Some(pose(f64::NAN, 1e300, 0.0)); views],
            landmarks: vec![Some(Point2::new(f64::INFINITY, -1e300)); landmarks],
        };
        let refused = diagnose(&problem, Some(&broken), None);
        assert!(matches!(
            refused,
            Err(Error::NotFinite { what: "poses", .. })
        ));
    }
    let problem = Problem::dense(2, 3, &[0.0; 6], 1.0).unwrap();
    assert!(matches!(
        diagnose(&problem, Some(&Map::empty(2, 4)), None),
        Err(Error::LengthMismatch { .. })
    ));
}

/// The caller can interrupt it.
#[test]
fn stops_when_told() {
    let scene = Drawn::new(Draw::Anywhere, Draw::Anywhere, (6, 9), 0.01, 1);
    let mut stop = |_, _, _| false;
    let found = diagnose(&scene.problem(1.0), None, Some(&mut stop));
    assert_eq!(found, Err(Error::Interrupted));
}

/// A landmark at rounding distance from a view: its row must not drown the others.
#[test]
fn a_landmark_on_a_view() {
    let mut points = room();
    let poses = walk(5);
    let at = poses[2].translation.vector;
    points.push(Point2::new(at.x + 1e-9, at.y));
    let problem = sight(&poses, &points, &everything(0..5, 0..9));
    let found = diagnose(&problem, Some(&common::map(&poses, &points)), None).unwrap();
    assert!(found.findings.is_empty(), "{found}");
    assert!(found.condition < 1e4, "{}", found.condition);
}

#[test]
fn names_are_distinct() {
    let mut names: Vec<_> = Kind::ALL.map(Kind::name).into();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), Kind::ALL.len());
}

#[test]
fn reads_well() {
    let scene = Drawn::new(Draw::Anywhere, Draw::Line, (5, 8), 0.0, 0);
    let found = diagnose(&scene.problem(1.0), Some(&scene.truth()), None).unwrap();
    let text = found.to_string();
    assert!(
        text.starts_with("40 sightings of 8 landmarks from 5 views: not determined"),
        "{text}"
    );
    assert!(
        text.contains("error (collinear_landmarks): landmarks 0..7 lie on one line"),
        "{text}"
    );
    assert!(
        text.contains("Add three sightings of a landmark off the line."),
        "{text}"
    );
}
