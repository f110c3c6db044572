// SPDX-License-Identifier: MIT OR Apache-2.0
//! Problems, maps and options written and read with `serde`.

use bearslam::{
    Arena, LandmarkPrior, Layout, Loss, Map, Method, Noise, Odometry, OdometrySweepOptions,
    PosePrior, Problem, RefineOptions, SearchOptions, Sighting, SolveOptions, StageOptions,
    Strategy, pose, simulate, xytheta,
};
use nalgebra::Point2;
use serde_json::{Value, from_str, from_value, json, to_string, to_value};

/// A problem with every kind of observation, and sightings out of order.
fn problem() -> Problem {
    let scene = simulate(Layout::Mixed, 4, 9, 0.01, 1, Arena::default()).unwrap();
    let sighting = |k: usize| Sighting {
        view: k / 9,
        landmark: k % 9,
        bearing: scene.bearings[k],
        sigma: 0.01 + 0.001 * k as f64,
    };
    let sightings: Vec<_> = (0..36).rev().filter(|k| k % 7 != 0).map(sighting).collect();
    let covariance = [
        [0.04, 0.01, 0.0],
        [0.01, 0.03, -0.001],
        [0.0, -0.001, 0.002],
    ];
    let motion = |start, noise| Odometry {
        start,
        end: start + 1,
        delta: pose(1.0, -0.5, 2.5),
        noise,
    };
    let odometry = [
        motion(0, Noise::Sigmas([0.1, 0.2, 0.05])),
        motion(1, Noise::Covariance(covariance)),
    ];
    let compass = PosePrior {
        view: 2,
        pose: pose(0.0, 0.0, -1.0),
        noise: Noise::Sigmas([f64::INFINITY, f64::INFINITY, 0.02]),
    };
    let beacon = LandmarkPrior {
        landmark: 3,
        position: Point2::new(2.0, -7.0),
        noise: Noise::Covariance([[0.2, 0.1], [0.1, 0.3]]),
    };
    Problem::new(4, 9, &sightings)
        .and_then(|problem| problem.with_odometry(&odometry))
        .and_then(|problem| problem.with_pose_priors(&[compass]))
        .and_then(|problem| problem.with_landmark_priors(&[beacon]))
        .unwrap()
}

/// Equal up to rounding: 1e-14 of a number is a few of its last bits.
fn assert_close(a: &Value, b: &Value) {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            assert!((a - b).abs() <= 1e-14 * (1.0 + a.abs()), "{a} {b}");
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len());
            a.iter().zip(b).for_each(|(a, b)| assert_close(a, b));
        }
        (Value::Object(a), Value::Object(b)) => {
            assert!(a.keys().eq(b.keys()));
            a.values()
                .zip(b.values())
                .for_each(|(a, b)| assert_close(a, b));
        }
        _ => assert_eq!(a, b),
    }
}

#[test]
fn a_problem_comes_back_as_it_was_given() {
    let problem = problem();
    for problem in [problem.clone(), problem.unoriented()] {
        let written = to_value(&problem).unwrap();
        let read: Problem = from_str(&to_string(&problem).unwrap()).unwrap();
        assert_eq!(read.input_order(), problem.input_order());
        assert_eq!(read.is_oriented(), problem.is_oriented());
        assert_close(&written, &to_value(&read).unwrap());
        for (a, b) in problem.sightings().iter().zip(read.sightings()) {
            assert_eq!((a.view, a.landmark), (b.view, b.landmark));
            assert!(a.bearing.angle_to(&b.bearing).abs() < 1e-14);
            assert!((a.weight / b.weight - 1.0).abs() < 1e-15);
        }
    }
    let written = to_value(self::problem()).unwrap();
    // In the order given, the last sighting first; infinite numbers are null.
    let first = &written["sightings"][0];
    assert_eq!((&first["view"], &first["landmark"]), (&json!(3), &json!(7)));
    let sigmas = &written["pose_priors"][0]["noise"]["sigmas"];
    assert!(sigmas[0].is_null() && sigmas[1].is_null());
    let covariance = &written["odometry"][1]["noise"]["covariance"];
    assert_close(&covariance[0], &json!([0.04, 0.01, 0.0]));
}

#[test]
fn an_invalid_problem_is_not_read() {
    let good = json!({
        "views": 2,
        "landmarks": 1,
        "sightings": [
            {"view": 0, "landmark": 0, "bearing": 0.3, "sigma": 0.01},
            {"view": 1, "landmark": 0, "bearing": 0.5, "sigma": 0.01},
        ],
    });
    let read: Problem = from_value(good.clone()).unwrap();
    assert!(read.is_oriented());
    let noise = |noise: Value| json!([{"start": 0, "end": 1, "delta": [1, 0, 0], "noise": noise}]);
    for (place, wrong, message) in [
        ("/views", json!(1), "below 1"),
        ("/sightings/1/view", json!(0), "once"),
        ("/sightings/0/sigma", json!(0.0), "positive"),
        (
            "/sightings/0",
            json!({"view": 0, "landmark": 0, "bearing": 1, "sigma_deg": 1}),
            "unknown",
        ),
        ("/odometry", noise(json!({"sigmas": [1, 1]})), "length 2"),
        (
            "/odometry",
            noise(json!({"sigmas": [1, 1, null]})),
            "finite",
        ),
        (
            "/odometry",
            noise(json!({"covariance": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]})),
            "positive",
        ),
        (
            "/odometry",
            noise(json!({"covariance": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]})),
            "symmetric",
        ),
    ] {
        let mut bad = good.clone();
        bad["odometry"] = json!([]);
        *bad.pointer_mut(place).unwrap() = wrong;
        let error = from_value::<Problem>(bad).unwrap_err().to_string();
        assert!(error.contains(message), "{place}: {error}");
    }
    // A NaN standard deviation would be read back as an infinite one.
    assert!(to_string(&Noise::Sigmas([f64::NAN, 1.0])).is_err());
}

#[test]
fn a_map_comes_back_with_its_gaps() {
    let map = Map {
        poses: vec![Some(pose(1.0, 2.0, 3.0)), None],
        landmarks: vec![None, Some(Point2::new(-1.0, 0.1))],
    };
    let written = to_value(&map).unwrap();
    assert_close(
        &written,
        &json!({"poses": [[1.0, 2.0, 3.0], null], "landmarks": [null, [-1.0, 0.1]]}),
    );
    let read: Map = from_value(written).unwrap();
    assert_eq!(read.landmarks, map.landmarks);
    assert!(read.poses[1].is_none());
    assert!((xytheta(&read.poses[0].unwrap())[2] - 3.0).abs() < 1e-15);
}

#[test]
fn options_are_read_over_their_defaults() {
    let options = SolveOptions {
        strategy: Strategy::FirstViews(Method::Calibrated { reweights: 1 }),
        search: SearchOptions {
            triples: 50,
            ..SearchOptions::default()
        },
        refine: RefineOptions {
            loss: Loss::Huber(1.5),
            ..RefineOptions::default()
        },
        seed: u64::MAX,
        robust: true,
        verify: true,
        stages: StageOptions {
            odometry_sweeps: OdometrySweepOptions {
                bounds: [1.0, 2.0, 3.0, 4.0],
                ..OdometrySweepOptions::default()
            },
            ..StageOptions::default()
        },
    };
    assert_eq!(
        from_str::<SolveOptions>(&to_string(&options).unwrap()).unwrap(),
        options
    );
    let read: SolveOptions = from_value(json!({
        "strategy": "incremental",
        "search": {"triples": 50},
        "refine": {"loss": {"cauchy": 2.0}},
        "stages": {"odometry_sweeps": {"bounds": [1, 2, 3, 4]}},
    }))
    .unwrap();
    let expected = SolveOptions {
        strategy: Strategy::Incremental,
        refine: RefineOptions {
            loss: Loss::Cauchy(2.0),
            ..RefineOptions::default()
        },
        robust: false,
        verify: false,
        seed: 0,
        ..options
    };
    assert_eq!(read, expected);
    for wrong in [
        json!({"sead": 1}),
        json!({"stages": {"jugde": {}}}),
        json!({"stages": {"judge": {"saem": 1}}}),
    ] {
        let error = from_value::<SolveOptions>(wrong).unwrap_err();
        assert!(error.to_string().contains("unknown field"));
    }
    assert!(from_value::<SearchOptions>(json!({"triples": -1})).is_err());
}
