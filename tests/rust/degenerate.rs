// SPDX-License-Identifier: MIT OR Apache-2.0
//! Geometry that does not determine the answer: a named error or a flagged result, never an arbitrary map.

use bearslam::{
    Bearing, Degeneracy, Error, Method, Pose, Problem, Sighting, SolveOptions, Strategy,
    bearing_to, pose, resect, solve, three_view, triangulate,
};
use nalgebra::Point2;

fn bearings(poses: &[Pose<f64>], points: &[Point2<f64>], noise: f64) -> Vec<f64> {
    let mut phase = 0.3_f64;
    poses
        .iter()
        .flat_map(|pose| points.iter().map(move |point| (pose, point)))
        .map(|(pose, point)| {
            phase += 2.399;
            bearing_to(pose, point).unwrap().angle() + noise * 1.4 * (phase * phase).sin()
        })
        .collect()
}

fn wall() -> Vec<Point2<f64>> {
    [0.0, 0.7, 1.9, 3.0, 3.3, 4.4, 5.0, 6.1]
        .map(|x| Point2::new(x, 4.0 + 0.1 * x))
        .into()
}

fn room() -> Vec<Point2<f64>> {
    [
        (0.5, 4.0),
        (6.0, 3.5),
        (3.0, 5.0),
        (1.0, -1.0),
        (5.0, -0.5),
        (-1.0, 2.0),
        (7.0, 1.0),
        (3.5, 4.2),
    ]
    .map(|(x, y)| Point2::new(x, y))
    .into()
}

fn three() -> [Pose<f64>; 3] {
    [
        pose(0.3, 0.2, 0.1),
        pose(2.9, 0.9, 1.2),
        pose(4.7, -0.3, -0.7),
    ]
}

fn solve_exact(poses: &[Pose<f64>], points: &[Point2<f64>], noise: f64) -> Result<f64, Error> {
    let table = bearings(poses, points, noise);
    let problem = Problem::dense(poses.len(), points.len(), &table, 1.0).unwrap();
    solve(&problem, &SolveOptions::default(), None).map(|found| found.uncertainty)
}

#[test]
fn landmarks_along_one_wall() {
    assert!(matches!(
        solve_exact(&three(), &wall(), 0.0),
        Err(Error::Degenerate { .. })
    ));
    // More views of the wall do not help.
    let many: Vec<Pose<f64>> = (0..6)
        .map(|k| pose(f64::from(k), (1.3 * f64::from(k)).sin(), 0.4))
        .collect();
    assert!(matches!(
        solve_exact(&many, &wall(), 0.0),
        Err(Error::Degenerate { .. })
    ));
    // With noise the map is flagged by its uncertainty, or rejected.
    let uncertainty = solve_exact(&three(), &wall(), 0.01).unwrap_or(f64::INFINITY);
    assert!(uncertainty > 0.3, "{uncertainty}");
    // The same views in a room: well determined.
    let uncertainty = solve_exact(&three(), &room(), 0.01).unwrap();
    assert!(uncertainty < 0.3, "{uncertainty}");
}

/// Four landmarks are sought in another way, and each of their maps has the bearings of a family.
#[test]
fn a_wall_of_four_is_named() {
    for seed in 0..20 {
        let along = |k: f64| (0.7 + 1.3 * k + 0.9 * f64::from(seed)).sin();
        let four = [0.0, 1.0, 2.0, 3.0].map(|k| {
            let x = 1.5 * k + along(k);
            Point2::new(x, 4.0 + 0.3 * x)
        });
        for views in [4, 5, 9] {
            let poses: Vec<Pose<f64>> = (0..views)
                .map(|k| f64::from(k) + f64::from(seed))
                .map(|k| pose(3.0 + 3.0 * (1.1 * k).cos(), (2.3 * k).sin(), 0.4 * k))
                .collect();
            let Err(Error::Degenerate { kind, value, bound }) = solve_exact(&poses, &four, 0.0)
            else {
                panic!("a wall determines no map: {seed} {views}");
            };
            assert_eq!(kind, Degeneracy::CollinearLandmarks, "{seed} {views}");
            assert!(value < bound, "{value} {bound}");
        }
    }
}

#[test]
fn views_in_one_place() {
    let turning = [
        pose(1.0, 1.0, 0.0),
        pose(1.0, 1.0, 0.9),
        pose(1.0, 1.0, 2.0),
    ];
    assert!(matches!(
        solve_exact(&turning, &room(), 0.0),
        Err(Error::Degenerate { .. })
    ));
    let [a, b, _] = three();
    let twice = [a, b, pose(b.translation.x, b.translation.y, 0.3)];
    assert!(matches!(
        solve_exact(&twice, &room(), 0.0),
        Err(Error::Degenerate { .. })
    ));
}

#[test]
fn everything_on_one_circle() {
    let at = |angle: f64| Point2::new(3.0 * angle.cos(), 3.0 * angle.sin());
    let points: Vec<_> = (0..8).map(|k| at(0.7 * f64::from(k))).collect();
    let poses: Vec<_> = (0..5)
        .map(|k| {
            let p = at(0.35 + 1.1 * f64::from(k));
            pose(p.x, p.y, 0.4 * f64::from(k))
        })
        .collect();
    assert!(matches!(
        solve_exact(&poses, &points, 0.0),
        Err(Error::Degenerate { .. })
    ));
}

#[test]
fn all_bearings_alike() {
    for value in [0.0, 1.0, -3.0] {
        let problem = Problem::dense(5, 8, &[value; 40], 1.0).unwrap();
        let error = solve(&problem, &SolveOptions::default(), None).unwrap_err();
        assert!(matches!(error, Error::Degenerate { .. }), "{error}");
    }
}

#[test]
fn kernels_name_the_number() {
    let parallel = [pose(0.0, 0.0, 0.5), pose(1.0, 0.0, 0.5)].map(|p| (p, Bearing::new(0.2)));
    let Err(Error::Degenerate { kind, value, bound }) = triangulate(parallel) else {
        panic!("parallel rays meet nowhere");
    };
    assert_eq!(kind, Degeneracy::ParallelRays);
    assert_eq!(kind.name(), "parallel_rays");
    assert!(value <= bound);

    // A view on one circle with its landmarks is free to move along it.
    let on_circle = |angle: f64| Point2::new(angle.cos(), angle.sin());
    let view = pose(1.0, 0.0, 0.7);
    let seen = [1.0, 2.0, 3.0, 4.5].map(|angle| {
        let point = on_circle(angle);
        (point, bearing_to(&view, &point).unwrap())
    });
    assert!(matches!(resect(seen), Err(Error::Degenerate { .. })));
    // Landmarks in one place, and landmarks in one line of sight.
    let one = [Point2::new(1.0, 2.0); 3].map(|p| (p, Bearing::new(0.1)));
    assert!(matches!(resect(one), Err(Error::Degenerate { .. })));
    let line = [1.0, 2.0, 3.0].map(|x| (Point2::new(x, x), Bearing::new(0.1)));
    assert!(matches!(resect(line), Err(Error::Degenerate { .. })));

    let table = bearings(&three(), &wall(), 0.0);
    let triples: Vec<_> = (0..8)
        .map(|j| [0, 1, 2].map(|i| Bearing::new(table[8 * i + j])))
        .collect();
    for method in [Method::Calibrated { reweights: 2 }, Method::Projective] {
        let error = three_view(&triples, method).unwrap_err();
        assert!(matches!(error, Error::Degenerate { .. }), "{error}");
        assert!(error.to_string().starts_with("degenerate geometry: "));
    }
}

#[test]
fn wrong_input_names_argument_place_and_value() {
    let good = Sighting {
        view: 0,
        landmark: 0,
        bearing: 0.1,
        sigma: 1.0,
    };
    let cases = [
        (
            Sighting { view: 3, ..good },
            "view: expected indices below 3, got 3 at index 1",
        ),
        (
            Sighting {
                landmark: 9,
                ..good
            },
            "landmark: expected indices below 5, got 9 at index 1",
        ),
        (
            Sighting {
                bearing: f64::INFINITY,
                ..good
            },
            "bearing: expected finite numbers, got NaN or infinity at index 1",
        ),
        (
            Sighting { sigma: 0.0, ..good },
            "sigma: expected positive numbers, got 0 at index 1",
        ),
        (
            good,
            "sightings: expected each view to see a landmark once, got view 0 seeing landmark 0 at index 0 and again at index 1",
        ),
    ];
    for (bad, message) in cases {
        let error = Problem::new(3, 5, &[good, bad]).unwrap_err();
        assert_eq!(error.to_string(), message);
    }
    assert!(Problem::dense(3, 5, &[0.0; 14], 1.0).is_err());
    assert!(Problem::dense(3, 5, &[f64::INFINITY; 15], 1.0).is_err());
    assert!(Problem::dense(3, 5, &[0.0; 15], -1.0).is_err());
}

#[test]
fn a_view_on_the_circle_of_its_landmarks_shows_in_the_uncertainty() {
    // Poses are eliminated here, but their weak directions must be found as well.
    let points: Vec<Point2<f64>> = room().into_iter().take(6).collect();
    let mut poses: Vec<Pose<f64>> = (0..8)
        .map(|k| pose(0.6 * f64::from(k), (1.7 * f64::from(k)).sin(), f64::from(k)))
        .collect();
    let circle = |points: &[Point2<f64>]| {
        let (a, b, c) = (points[0], points[1], points[2]);
        let m = nalgebra::Matrix2::new(b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y) * 2.0;
        let square = |p: Point2<f64>| p.coords.norm_squared();
        let right = nalgebra::Vector2::new(square(b) - square(a), square(c) - square(a));
        let centre = m.try_inverse().unwrap() * right;
        (centre, (a.coords - centre).norm())
    };
    let (centre, radius) = circle(&points);
    for on_circle in [true, false] {
        let place = centre
            + nalgebra::Vector2::new(0.6, -0.8) * (radius * if on_circle { 1.0 } else { 0.5 });
        poses.truncate(8);
        poses.push(pose(place.x, place.y, 0.4));
        let mut table = bearings(&poses, &points, 0.005);
        for j in 3..6 {
            table[8 * 6 + j] = f64::NAN;
        }
        let problem = Problem::dense(9, 6, &table, 1.0).unwrap();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        assert_eq!(found.uncertainty > 0.2, on_circle, "{}", found.uncertainty);
    }
}

/// Landmarks seen in so nearly one direction that the view is anywhere along it.
#[test]
fn a_view_beyond_the_horizon_of_its_landmarks_is_not_resected() {
    let points = room();
    let truth = pose(1.0, 2.0, 0.3);
    for scale in [1e-9, 1e-11, 1e-13] {
        let sightings = points.iter().map(|point| {
            let seen = bearing_to(&truth, point).unwrap().angle();
            (*point, Bearing::new(seen * scale))
        });
        let error = resect(sightings).unwrap_err();
        assert!(
            matches!(
                error,
                Error::Degenerate {
                    kind: Degeneracy::CommonDirection,
                    ..
                }
            ),
            "{scale:e}: {error}"
        );
    }
}

/// Bearings of no scene at all: the global method puts most views into one place, which is no map.
#[test]
fn a_collapsed_map_is_an_error() {
    let options = SolveOptions {
        strategy: Strategy::Global,
        ..SolveOptions::default()
    };
    let mut collapsed = 0;
    for seed in 0..60_u64 {
        let mut state = seed;
        let bearings: Vec<f64> = (0..9 * 8)
            .map(|_| {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                (state >> 32) as f64 * 1e-9
            })
            .collect();
        let problem = Problem::dense(9, 8, &bearings, 0.01).unwrap();
        match solve(&problem, &options, None) {
            Ok(found) => {
                let places = found.map.poses.iter().flatten();
                let mut places: Vec<f64> = places.map(|p| p.translation.vector.norm()).collect();
                places.sort_by(f64::total_cmp);
                assert!(places[places.len() / 2] > 1e-12, "{seed} {places:?}");
            }
            Err(Error::Degenerate { kind, .. }) => {
                collapsed += usize::from(kind == Degeneracy::CollapsedMap);
            }
            Err(error) => panic!("{seed}: {error}"),
        }
    }
    assert!(collapsed > 0);
}
