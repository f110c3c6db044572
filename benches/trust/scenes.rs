// SPDX-License-Identifier: MIT OR Apache-2.0
//! The classes of scenes. Lengths are metres.

use super::starts::{Instance, MOTION, World, corridor, drive, limited_sight, of};
use bearslam::{Arena, Layout, Map, Odometry, Outliers, Problem, Scene, Sighting, pose, simulate};
use nalgebra::Point2;
use rand::RngExt;
use std::f64::consts::{PI, TAU};

/// A kind of scene.
pub struct Class {
    pub name: &'static str,
    /// Whether the solve knows that there are outliers.
    pub robust: bool,
    /// Whether an alarm would be a false one.
    pub is_clean: bool,
    /// Scenes by default.
    pub scenes: u64,
    pub build: fn(u64) -> Instance,
}

const SQUARES: Class = Class {
    name: "",
    robust: false,
    is_clean: false,
    scenes: 2000,
    build: |_| unreachable!("every class has its own"),
};

pub const CLASSES: [Class; 19] = [
    Class {
        name: "clean",
        is_clean: true,
        scenes: 4000,
        build: |seed| tables(seed, 1.0),
        ..SQUARES
    },
    Class {
        name: "noise-1.5",
        is_clean: true,
        build: |seed| tables(seed, 1.0 / 1.5),
        ..SQUARES
    },
    Class {
        name: "sigma/3",
        build: |seed| tables(seed, 1.0 / 3.0),
        ..SQUARES
    },
    Class {
        name: "sigma/10",
        build: |seed| tables(seed, 0.1),
        ..SQUARES
    },
    Class {
        name: "sigma*3",
        build: |seed| tables(seed, 3.0),
        ..SQUARES
    },
    Class {
        name: "sigma*10",
        build: |seed| tables(seed, 10.0),
        ..SQUARES
    },
    Class {
        name: "sight",
        is_clean: true,
        build: |seed| limited_sight(seed, [20, 40, 60, 100, 200][of(seed, 5)], 0.0),
        ..SQUARES
    },
    Class {
        name: "few-landmarks",
        is_clean: true,
        scenes: 3000,
        build: few_landmarks,
        ..SQUARES
    },
    Class {
        name: "corridor",
        is_clean: true,
        build: corridor,
        ..SQUARES
    },
    Class {
        name: "far",
        is_clean: true,
        build: far_landmarks,
        ..SQUARES
    },
    Class {
        name: "odometry",
        is_clean: true,
        scenes: 1000,
        build: |seed| driven(seed, |bearing| bearing, |_, _| {}),
        ..SQUARES
    },
    Class {
        name: "one-wrong",
        scenes: 3000,
        build: one_wrong_bearing,
        ..SQUARES
    },
    Class {
        name: "wrong-5-20",
        robust: true,
        build: |seed| contaminated(seed, Outliers::Uniform, 0.05 + 0.05 * of(seed, 4) as f64),
        ..SQUARES
    },
    Class {
        name: "exchanged",
        robust: true,
        build: |seed| contaminated(seed, Outliers::Exchanged, 0.1 + 0.1 * of(seed, 4) as f64),
        ..SQUARES
    },
    Class {
        name: "two-under-one",
        robust: true,
        build: two_under_one,
        ..SQUARES
    },
    Class {
        name: "turned",
        scenes: 300,
        build: turned,
        ..SQUARES
    },
    Class {
        name: "mirrored",
        scenes: 300,
        build: |seed| driven(seed, |bearing| -bearing, |_, _| {}),
        ..SQUARES
    },
    Class {
        name: "one-wrong-motion",
        scenes: 1000,
        build: one_wrong_motion,
        ..SQUARES
    },
    Class {
        name: "two-under-one-squares",
        build: two_under_one,
        ..SQUARES
    },
];

/// A full table of 4 to 12 views and 7 to 18 landmarks, with noise of 0.1 to 2 degrees.
fn table(seed: u64) -> (Scene, f64) {
    let views = 4 + of(seed, 9);
    let landmarks = 7 + of(seed / 9, 12);
    let noise = [0.1, 0.3, 0.5, 1.0, 2.0][of(seed / 7, 5)] * PI / 180.0;
    let layout = [Layout::Mixed, Layout::Enclosed][of(seed / 5, 2)];
    let scene = simulate(layout, views, landmarks, noise, seed, Arena::default());
    (scene.expect("a scene"), noise)
}

/// A scene whose bearings are stated to have this standard deviation.
fn stated(scene: &Scene, truth: Map, sigma: f64, wrong: Vec<bool>) -> Instance {
    let columns = truth.landmarks.len();
    let places = (0..scene.bearings.len()).filter(|&k| !scene.bearings[k].is_nan());
    let sightings: Vec<Sighting> = places
        .clone()
        .map(|k| Sighting {
            view: k / columns,
            landmark: k % columns,
            bearing: scene.bearings[k],
            sigma,
        })
        .collect();
    let problem = Problem::new(truth.poses.len(), columns, &sightings).expect("a problem");
    Instance {
        problem,
        wrong: places.map(|k| wrong[k]).collect(),
        sightings,
        truth,
    }
}

/// A full table, with a stated standard deviation so many times the right one.
fn tables(seed: u64, factor: f64) -> Instance {
    let (scene, noise) = table(seed);
    let right = vec![false; scene.bearings.len()];
    stated(&scene, scene.map(), noise * factor, right)
}

/// Four to twelve views of five or six landmarks.
fn few_landmarks(seed: u64) -> Instance {
    let (views, landmarks) = (4 + of(seed, 9), 5 + of(seed / 9, 2));
    let noise = [0.1, 0.3, 0.5, 1.0, 2.0][of(seed / 7, 5)] * PI / 180.0;
    let scene = simulate(
        Layout::Mixed,
        views,
        landmarks,
        noise,
        seed,
        Arena::default(),
    );
    let scene = scene.expect("a scene");
    let right = vec![false; scene.bearings.len()];
    stated(&scene, scene.map(), noise, right)
}

/// A full table of which some landmarks are 3 to 100 times as far away as the others.
fn far_landmarks(seed: u64) -> Instance {
    let mut world = World::new(seed, [0.1, 0.5, 1.0][of(seed, 3)]);
    for _ in 0..5 + of(seed, 6) {
        let (at, heading) = (world.point(7.0, 5.0), world.heading());
        world.poses.push(pose(at.x, at.y, heading));
    }
    for landmark in 0..10 {
        let at = world.point(7.0, 5.0);
        let times = if landmark % 3 == 0 {
            10.0_f64.powf(world.between(0.5, 2.0))
        } else {
            1.0
        };
        let center = Point2::new(3.5, 2.5);
        world.landmarks.push(center + (at - center) * times);
    }
    let sigma = world.noise;
    let sightings = world.sightings(|_, _| true, sigma);
    let problem = world.problem(&sightings);
    world.instance(problem, sightings)
}

/// A table with one bearing that is anything.
fn one_wrong_bearing(seed: u64) -> Instance {
    let (mut scene, noise) = table(seed);
    let mut world = World::of(&scene, seed, noise);
    let place = world.random.random_range(0..scene.bearings.len());
    scene.bearings[place] = world.heading();
    let mut wrong = vec![false; scene.bearings.len()];
    wrong[place] = true;
    stated(&scene, scene.map(), noise, wrong)
}

/// A table of 8 to 12 views and 12 to 18 landmarks with a share of outliers.
fn contaminated(seed: u64, kind: Outliers, share: f64) -> Instance {
    let (scene, noise) = rich_table(seed);
    let (scene, wrong) = scene.contaminate(kind, share, seed);
    stated(&scene, scene.map(), noise, wrong)
}

fn rich_table(seed: u64) -> (Scene, f64) {
    let (views, landmarks) = (8 + of(seed, 5), 12 + of(seed / 5, 7));
    let noise = [0.1, 0.3, 0.5, 1.0][of(seed / 7, 4)] * PI / 180.0;
    let layout = [Layout::Mixed, Layout::Enclosed][of(seed / 11, 2)];
    let scene = simulate(layout, views, landmarks, noise, seed, Arena::default());
    (scene.expect("a scene"), noise)
}

/// A table of which half of the sightings of one landmark are of another, which bears no identity of its own.
fn two_under_one(seed: u64) -> Instance {
    let (scene, noise) = rich_table(seed);
    // Any share that one pair of landmarks reaches.
    let (scene, wrong) = scene.contaminate(Outliers::Merged, 0.01, seed);
    stated(&scene, scene.map(), noise, wrong)
}

/// A drive with odometry.
fn driven(
    seed: u64,
    change_bearing: impl Fn(f64) -> f64,
    change_motion: impl Fn(usize, &mut Odometry),
) -> Instance {
    let (mut world, mut sightings) = drive(seed);
    let mut odometry = world.odometry(40, MOTION, 1.0, 0.0);
    for sighting in &mut sightings {
        sighting.bearing = (change_bearing(sighting.bearing) + PI).rem_euclid(TAU) - PI;
    }
    for (place, motion) in odometry.iter_mut().enumerate() {
        change_motion(place, motion);
    }
    let problem = world.problem(&sightings).with_odometry(&odometry);
    world.instance(problem.expect("odometry"), sightings)
}

/// A drive whose sensor is turned by 2 to 180 degrees.
fn turned(seed: u64) -> Instance {
    let turn = [2.0, 6.0, -20.0, 90.0, 180.0, -45.0][of(seed, 6)] * PI / 180.0;
    driven(seed, |bearing| bearing + turn, |_, _| {})
}

/// A drive of which one motion is off by 0.5 m or 30 degrees.
fn one_wrong_motion(seed: u64) -> Instance {
    let place = of(seed / 2, 39);
    let error = if seed.is_multiple_of(2) {
        pose(0.5, 0.0, 0.0)
    } else {
        pose(0.0, 0.0, PI / 6.0)
    };
    driven(
        seed,
        |bearing| bearing,
        |k, motion| {
            if k == place {
                motion.delta *= error;
            }
        },
    )
}
