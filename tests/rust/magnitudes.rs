// SPDX-License-Identifier: MIT OR Apache-2.0
//! Numbers have a range at the door: beyond it a typed error, within it an answer or one, in bounded time.

use super::common;
use bearslam::{
    Arena, DATA_MAGNITUDES, Error, Fix, Frame, LOSS_WIDTHS, LandmarkPrior, Layout, Loss, Map,
    Noise, Odometry, PosePrior, Problem, RefineOptions, SIGMA_MAGNITUDES, Sighting, SolveOptions,
    covariance, diagnose, initialize, pose, refine_map, simulate, solve,
};
use nalgebra::Point2;

fn sighting(bearing: f64, sigma: f64) -> Sighting {
    Sighting {
        view: 0,
        landmark: 0,
        bearing,
        sigma,
    }
}

fn motion(x: f64, noise: Noise<3>) -> Odometry {
    Odometry {
        start: 0,
        end: 1,
        delta: pose(x, 0.0, 0.1),
        noise,
    }
}

const USUAL: Noise<3> = Noise::Sigmas([0.1; 3]);

/// A covariance with one standard deviation in its middle.
fn spread(sigma: f64) -> Noise<3> {
    Noise::Covariance([[1.0, 0.0, 0.0], [0.0, sigma * sigma, 0.0], [0.0, 0.0, 1.0]])
}

fn base() -> Problem {
    Problem::new(2, 2, &[sighting(0.1, 0.1)]).unwrap()
}

/// Every way in for a measured number, with what its error names.
type Door = (&'static str, fn(f64) -> Result<Problem, Error>);

const DATA: [Door; 5] = [
    ("bearing", |x| {
        Problem::new(
            2,
            2,
            &[
                sighting(0.1, 0.1),
                Sighting {
                    view: 1,
                    ..sighting(x, 0.1)
                },
            ],
        )
    }),
    ("bearing", |x| Problem::dense(1, 2, &[0.1, x], 0.1)),
    ("odometry: delta", |x| {
        base().with_odometry(&[motion(1.0, USUAL), motion(x, USUAL)])
    }),
    ("pose priors: pose", |x| {
        let prior = |x| PosePrior {
            view: 1,
            pose: pose(0.0, x, 0.0),
            noise: USUAL,
        };
        base().with_pose_priors(&[prior(1.0), prior(x)])
    }),
    ("landmark priors: position", |x| {
        let noise = Noise::Sigmas([0.1; 2]);
        let prior = |x| LandmarkPrior {
            landmark: 1,
            position: Point2::new(0.0, x),
            noise,
        };
        base().with_landmark_priors(&[prior(1.0), prior(x)])
    }),
];

const SIGMAS: [Door; 5] = [
    ("sigma", |s| {
        Problem::new(
            2,
            2,
            &[
                sighting(0.1, 0.1),
                Sighting {
                    view: 1,
                    ..sighting(0.1, s)
                },
            ],
        )
    }),
    ("odometry: sigma", |s| {
        base().with_odometry(&[
            motion(1.0, USUAL),
            motion(1.0, Noise::Sigmas([0.1, s, 0.1])),
        ])
    }),
    ("odometry: sigma", |s| {
        base().with_odometry(&[motion(1.0, USUAL), motion(1.0, spread(s))])
    }),
    ("pose priors: sigma", |s| {
        let prior = |noise| PosePrior {
            view: 1,
            pose: pose(0.0, 1.0, 0.0),
            noise,
        };
        base().with_pose_priors(&[prior(USUAL), prior(spread(s))])
    }),
    ("landmark priors: sigma", |s| {
        let prior = |s| LandmarkPrior {
            landmark: 1,
            position: Point2::origin(),
            noise: Noise::Sigmas([0.1, s]),
        };
        base().with_landmark_priors(&[prior(1.0), prior(s)])
    }),
];

#[test]
fn numbers_beyond_the_range_are_refused_by_name() {
    let ranges = [(&DATA, DATA_MAGNITUDES), (&SIGMAS, SIGMA_MAGNITUDES)];
    for (doors, range) in ranges {
        let (least, most) = (*range.start(), *range.end());
        for (name, door) in doors {
            for inside in [least, most] {
                assert!(door(inside).is_ok(), "{name} {inside:e}");
            }
            for value in [0.5 * least, 2.0 * most] {
                let error = door(value).unwrap_err();
                let Error::Magnitude {
                    what,
                    index: 1,
                    value: got,
                    ..
                } = error
                else {
                    panic!("{name} {value:e}: {error}");
                };
                assert_eq!(what, *name);
                // A covariance gives the root of its square.
                assert!((got / value - 1.0).abs() < 1e-15, "{got:e}");
                let told = format!(
                    "{name}: expected magnitudes from {least:e} to {most:e}, got {got:e} at index 1"
                );
                assert!(error.to_string().starts_with(&told), "{error}");
            }
        }
    }
    for (name, door) in DATA {
        assert!(door(0.0).is_ok(), "{name}");
        assert!(door(-DATA_MAGNITUDES.end() * 2.0).is_err(), "{name}");
    }
    for (name, door) in SIGMAS {
        assert!(
            matches!(door(0.0), Err(Error::NotPositive { .. })),
            "{name}"
        );
    }
}

/// Infinite standard deviations are for what is not known, not out of range.
#[test]
fn what_is_not_known_stays_so() {
    let compass = PosePrior {
        view: 0,
        pose: pose(0.0, 0.0, 0.3),
        noise: Noise::Sigmas([f64::INFINITY, f64::INFINITY, 0.02]),
    };
    assert!(base().with_pose_priors(&[compass]).is_ok());
}

/// A given map may be as near to zero as it likes, but not beyond the range.
#[test]
fn given_maps_have_the_same_range() {
    let scene = common::scene(Layout::Enclosed, 5, 9, 0.5, 2);
    let problem = common::problem(&scene);
    let truth = common::truth(&scene);
    let mut far = [truth.clone(), truth.clone()];
    far[0].poses[2] = Some(pose(0.0, -2e60, 0.0));
    far[1].landmarks[2] = Some(Point2::new(2e60, 1.0));
    for (map, name) in far.iter().zip(["poses", "landmarks"]) {
        let options = RefineOptions::default();
        for error in [
            refine_map(&problem, &mut map.clone(), &options, None).unwrap_err(),
            diagnose(&problem, Some(map), None).unwrap_err(),
            covariance(&problem, map, Loss::Squared, Frame::FirstView, None).unwrap_err(),
        ] {
            assert!(
                matches!(error, Error::Magnitude { what, index: 2, .. } if what == name),
                "{error}"
            );
        }
    }
    let mut near = truth;
    near.poses[0] = Some(pose(1e-200, 0.0, 0.0));
    assert!(diagnose(&problem, Some(&near), None).is_ok());
    for sigma in [1e-31, 1e31] {
        let rays = [(pose(0.0, 0.0, 0.0), bearslam::Bearing::new(0.5)); 2];
        let refused = Fix::of_landmark(&Point2::new(1.0, 1.0), rays, sigma);
        assert!(matches!(
            refused,
            Err(Error::Magnitude { what: "sigma", .. })
        ));
    }
}

/// A scene and its odometry have the range as well.
#[test]
fn simulated_numbers_have_the_same_range() {
    let usual = Arena::default();
    for outside in [0.5 * DATA_MAGNITUDES.start(), 2.0 * DATA_MAGNITUDES.end()] {
        for (name, arena) in [
            (
                "width",
                Arena {
                    width: outside,
                    ..usual
                },
            ),
            (
                "height",
                Arena {
                    height: outside,
                    ..usual
                },
            ),
        ] {
            let error = simulate(Layout::Mixed, 3, 5, 0.1, 1, arena).unwrap_err();
            assert!(
                matches!(error, Error::Magnitude { what, .. } if what == name),
                "{error}"
            );
        }
    }
    let scene = common::scene(Layout::Mixed, 3, 5, 0.1, 1);
    for outside in [0.5 * SIGMA_MAGNITUDES.start(), 2.0 * SIGMA_MAGNITUDES.end()] {
        let error = scene.odometry([0.1, outside, 0.1], 1).unwrap_err();
        let is_named = matches!(
            error,
            Error::Magnitude {
                what: "sigma",
                index: 1,
                ..
            }
        );
        assert!(is_named, "{error}");
    }
}

/// At the ends of the range, in all combinations: an answer or a typed error, and an end.
#[test]
fn extreme_numbers_end_in_an_answer_or_an_error() {
    let scene = common::scene(Layout::Enclosed, 4, 8, 0.5, 1);
    let started = std::time::Instant::now();
    for length in [1e-60, 1e-20, 1.0, 1e20, 1e60] {
        for [across, turn] in [[1e-30, 1e30], [1e30, 1e-30], [1.0, 1e-30], [1e-30, 1e-30]] {
            let motion = |k: usize| Odometry {
                start: k,
                end: k + 1,
                delta: pose(0.0, if k < 2 { 1e12 } else { length }, 1.0),
                noise: Noise::Sigmas([across, 0.01, turn]),
            };
            let known = LandmarkPrior {
                landmark: 0,
                position: Point2::new(length, -length),
                noise: Noise::Sigmas([across, turn]),
            };
            let problem = Problem::dense(4, 8, &scene.bearings, 0.01)
                .and_then(|p| p.with_odometry(&[motion(0), motion(1), motion(2)]))
                .and_then(|p| p.with_landmark_priors(&[known]))
                .unwrap();
            let found = solve(&problem, &SolveOptions::default(), None);
            let maps: [Option<Map>; 2] = [Some(common::truth(&scene)), found.ok().map(|f| f.map)];
            for map in maps.iter().flatten() {
                for frame in Frame::ALL {
                    let _ = covariance(&problem, map, Loss::Squared, frame, None);
                }
                let _ = diagnose(&problem, Some(map), None);
            }
            let _ = diagnose(&problem, None, None);
        }
    }
    // A second here; a hang is one of minutes.
    let taken = started.elapsed().as_secs_f64();
    assert!(taken < 120.0, "{taken}");
}

/// A damping beyond the range can not move a map, a loss without a width has no cost.
#[test]
fn options_beyond_their_range_are_refused_by_name() {
    let scene = common::scene(Layout::Mixed, 5, 8, 0.3, 1);
    let problem = common::problem(&scene);
    let usual = RefineOptions::default();
    let of_loss = |loss| RefineOptions { loss, ..usual };
    let (least, most) = (*LOSS_WIDTHS.start(), *LOSS_WIDTHS.end());
    let mut bad = Vec::new();
    for damping in [-1.0, 1e9, 1e300, f64::NAN, f64::INFINITY] {
        bad.push(("damping", RefineOptions { damping, ..usual }));
    }
    for tolerance in [-1e-9, f64::NAN, f64::INFINITY] {
        bad.push(("tolerance", RefineOptions { tolerance, ..usual }));
    }
    for width in [0.5 * least, 1e-160, 0.0, -1.0, 2.0 * most, f64::NAN] {
        for loss in [
            Loss::Huber(width),
            Loss::Cauchy(width),
            Loss::Truncated(width),
        ] {
            bad.push(("width of the loss", of_loss(loss)));
        }
    }
    for (name, refine) in bad {
        let options = SolveOptions {
            refine,
            ..SolveOptions::default()
        };
        let found = [
            solve(&problem, &options, None).err(),
            initialize(&problem, &options, None).err(),
            refine_map(&problem, &mut common::truth(&scene), &refine, None).err(),
        ];
        for error in found {
            let Some(Error::BadOption { what, .. }) = error else {
                panic!("{name} {refine:?}: {error:?}");
            };
            assert_eq!(what, name);
        }
    }
    for width in [least, most] {
        let options = SolveOptions {
            refine: of_loss(Loss::Cauchy(width)),
            ..SolveOptions::default()
        };
        let found = initialize(&problem, &options, None).unwrap();
        assert!(found.cost.is_finite() && found.cost > 0.0);
    }
}
