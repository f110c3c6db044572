// SPDX-License-Identifier: MIT OR Apache-2.0
//! The classes of scenes. All lengths are metres; sigmas are as stated unless the class says otherwise.

use bearslam::{
    Arena, LandmarkPrior, Layout, Map, Noise, Odometry, Outliers, Pose, PosePrior, Problem, Scene,
    Sighting, bearing_to, pose, simulate,
};
use nalgebra::Point2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::{PI, TAU};

/// A kind of scene.
#[derive(Clone, Copy)]
pub struct Class {
    pub name: &'static str,
    /// Whether there are outliers, and the solve knows it.
    pub robust: bool,
    /// Whether scenes count that leave a part of their map free, as ranges from a place where the robot stands.
    pub free: bool,
    /// Scenes by default.
    pub scenes: u64,
    pub build: fn(u64) -> Instance,
}

/// A problem and its truth.
pub struct Instance {
    pub problem: Problem,
    /// As the problem was made from.
    pub sightings: Vec<Sighting>,
    /// Which of them are outliers.
    pub wrong: Vec<bool>,
    pub truth: Map,
}

const SQUARES: Class = Class {
    name: "",
    robust: false,
    free: false,
    scenes: 2000,
    build: |_| unreachable!("every class has its own"),
};

pub const CLASSES: [Class; 21] = [
    Class {
        name: "odometry-1",
        build: |seed| poor_odometry(seed, 1.0),
        ..SQUARES
    },
    Class {
        name: "odometry-3",
        build: |seed| poor_odometry(seed, 3.0),
        ..SQUARES
    },
    Class {
        name: "odometry-10",
        build: |seed| poor_odometry(seed, 10.0),
        ..SQUARES
    },
    Class {
        name: "standing",
        free: true,
        build: |seed| standing(seed, 0.0),
        ..SQUARES
    },
    Class {
        name: "creeping",
        free: true,
        build: |seed| standing(seed, 0.022),
        ..SQUARES
    },
    Class {
        name: "loop-2",
        build: |seed| closed_loop(seed, 2),
        ..SQUARES
    },
    Class {
        name: "loop-3",
        build: |seed| closed_loop(seed, 3),
        ..SQUARES
    },
    Class {
        name: "loop-4",
        build: |seed| closed_loop(seed, 4),
        ..SQUARES
    },
    Class {
        name: "beacons-2",
        build: |seed| beacons(seed, 2),
        ..SQUARES
    },
    Class {
        name: "beacons-3",
        build: |seed| beacons(seed, 3),
        ..SQUARES
    },
    Class {
        name: "gnss",
        build: gnss,
        ..SQUARES
    },
    Class {
        name: "compass",
        build: compass,
        ..SQUARES
    },
    Class {
        name: "anchors",
        build: anchors,
        ..SQUARES
    },
    Class {
        name: "corridor",
        build: corridor,
        ..SQUARES
    },
    Class {
        name: "sight-20",
        build: |seed| limited_sight(seed, 20, 0.0),
        ..SQUARES
    },
    Class {
        name: "sight-60",
        build: |seed| limited_sight(seed, 60, 0.0),
        ..SQUARES
    },
    Class {
        name: "sight-200",
        build: |seed| limited_sight(seed, 200, 0.0),
        ..SQUARES
    },
    Class {
        name: "chain",
        build: chain,
        ..SQUARES
    },
    Class {
        name: "robust-20",
        robust: true,
        build: |seed| limited_sight(seed, 20, 0.1),
        ..SQUARES
    },
    Class {
        name: "robust-60",
        robust: true,
        build: |seed| limited_sight(seed, 60, 0.1),
        ..SQUARES
    },
    Class {
        name: "robust-200",
        robust: true,
        scenes: 200,
        build: |seed| limited_sight(seed, 200, 0.1),
        ..SQUARES
    },
];

/// What is there, and the noise by which it is measured.
pub struct World {
    pub random: ChaCha8Rng,
    pub poses: Vec<Pose<f64>>,
    pub landmarks: Vec<Point2<f64>>,
    /// Noise of bearings \[rad\].
    pub noise: f64,
}

impl World {
    pub fn new(seed: u64, noise_deg: f64) -> Self {
        Self {
            random: ChaCha8Rng::seed_from_u64(seed),
            poses: Vec::new(),
            landmarks: Vec::new(),
            noise: noise_deg.to_radians(),
        }
    }

    pub fn of(scene: &Scene, seed: u64, noise: f64) -> Self {
        Self {
            random: ChaCha8Rng::seed_from_u64(seed ^ 0x5eed),
            poses: scene.poses.clone(),
            landmarks: scene.landmarks.clone(),
            noise,
        }
    }

    /// Uniform between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.random.random::<f64>()
    }

    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.random)
    }

    pub fn heading(&mut self) -> f64 {
        self.between(-PI, PI)
    }

    pub fn point(&mut self, width: f64, height: f64) -> Point2<f64> {
        Point2::new(self.between(0.0, width), self.between(0.0, height))
    }

    /// What the views see of the landmarks, by a rule for each pair.
    pub fn sightings(&mut self, sees: impl Fn(usize, usize) -> bool, sigma: f64) -> Vec<Sighting> {
        let mut sightings = Vec::new();
        for view in 0..self.poses.len() {
            for landmark in (0..self.landmarks.len()).filter(|&landmark| sees(view, landmark)) {
                let toward = bearing_to(&self.poses[view], &self.landmarks[landmark]);
                let toward = toward.expect("no landmark is on a view");
                let bearing = toward.angle() + self.noise * self.normal();
                sightings.push(Sighting {
                    view,
                    landmark,
                    bearing: (bearing + PI).rem_euclid(TAU) - PI,
                    sigma,
                });
            }
        }
        sightings
    }

    /// Each view sees so many landmarks, chosen at random.
    pub fn some(&mut self, least: usize, most: usize) -> Vec<Vec<bool>> {
        let count = self.landmarks.len();
        (0..self.poses.len())
            .map(|_| {
                let seen = self.random.random_range(least..=most).min(count);
                let mut order: Vec<usize> = (0..count).collect();
                for place in 0..seen {
                    order.swap(place, self.random.random_range(place..count));
                }
                (0..count)
                    .map(|landmark| order[..seen].contains(&landmark))
                    .collect()
            })
            .collect()
    }

    /// Motions from each view to the next within each robot of so many views; the errors are so many times as large
    /// as stated, plus a drift ahead in each.
    pub fn odometry(
        &mut self,
        views: usize,
        sigmas: [f64; 3],
        worse: f64,
        drift: f64,
    ) -> Vec<Odometry> {
        (1..self.poses.len())
            .filter(|end| end % views != 0)
            .map(|end| {
                let [x, y, heading] = sigmas.map(|sigma| worse * sigma * self.normal());
                let error: Pose<f64> = pose(x + drift, y, heading);
                Odometry {
                    start: end - 1,
                    end,
                    delta: self.poses[end - 1].inv_mul(&self.poses[end]) * error,
                    noise: Noise::Sigmas(sigmas),
                }
            })
            .collect()
    }

    /// Priors of some coordinates of all poses; those of infinite sigma say nothing.
    pub fn pose_priors(&mut self, sigmas: [f64; 3]) -> Vec<PosePrior> {
        (0..self.poses.len())
            .map(|view| {
                let error = |world: &mut Self, sigma: f64| {
                    if sigma.is_finite() {
                        sigma * world.normal()
                    } else {
                        0.0
                    }
                };
                let [x, y, heading] = sigmas.map(|sigma| error(self, sigma));
                let at = self.poses[view].translation.vector;
                let known = |value: f64, sigma: f64| if sigma.is_finite() { value } else { 0.0 };
                let turned = self.poses[view].rotation.angle() + heading;
                PosePrior {
                    view,
                    pose: pose(
                        known(at.x + x, sigmas[0]),
                        known(at.y + y, sigmas[1]),
                        known(turned, sigmas[2]),
                    ),
                    noise: Noise::Sigmas(sigmas),
                }
            })
            .collect()
    }

    pub fn problem(&self, sightings: &[Sighting]) -> Problem {
        Problem::new(self.poses.len(), self.landmarks.len(), sightings).expect("a problem")
    }

    pub fn instance(&self, problem: Problem, sightings: Vec<Sighting>) -> Instance {
        Instance {
            problem,
            wrong: vec![false; sightings.len()],
            sightings,
            truth: Map {
                poses: self.poses.iter().copied().map(Some).collect(),
                landmarks: self.landmarks.iter().copied().map(Some).collect(),
            },
        }
    }
}

/// A drive of 40 views among 30 landmarks seen up to 2 m, with odometry that is worse than it says.
fn poor_odometry(seed: u64, worse: f64) -> Instance {
    let (mut world, sightings) = drive(seed);
    let odometry = world.odometry(40, MOTION, worse, 0.0);
    let problem = world
        .problem(&sightings)
        .with_odometry(&odometry)
        .expect("odometry");
    world.instance(problem, sightings)
}

/// Standard deviations of the motions of a drive.
pub const MOTION: [f64; 3] = [0.02, 0.02, 0.01];

/// A drive and what is seen on it.
pub fn drive(seed: u64) -> (World, Vec<Sighting>) {
    let noise = 0.5_f64.to_radians();
    let arena = Arena {
        sight: 2.0,
        ..Arena::default()
    };
    let scene = simulate(Layout::Trajectory, 40, 30, noise, seed, arena).expect("a scene");
    let mut world = World::of(&scene, seed, noise);
    let seen = scene.bearings.clone();
    let sightings = world.sightings(|view, landmark| !seen[view * 30 + landmark].is_nan(), noise);
    (world, sightings)
}

/// A robot that stands among seven landmarks, half of the time with one hop of 0.1 m, while its odometry drifts by
/// so much a view in either direction. Its bearings are better than they say.
fn standing(seed: u64, drift: f64) -> Instance {
    let mut world = World::new(seed, 0.1);
    let views = [10, 20, 60][of(seed, 3)];
    let hop = if seed.is_multiple_of(2) { 0.1 } else { 0.0 };
    let drift = if seed % 4 < 2 { drift } else { -drift };
    let heading = world.heading();
    world.poses = (0..views)
        .map(|view| pose(if view < views / 3 { 0.0 } else { -hop }, 0.0, heading))
        .collect();
    for _ in 0..7 {
        let (range, around) = (world.between(1.0, 4.5), world.heading());
        let (sin, cos) = around.sin_cos();
        world.landmarks.push(Point2::new(range * cos, range * sin));
    }
    let sightings = world.sightings(|_, _| true, 1.0_f64.to_radians());
    let odometry = world.odometry(views, [0.02, 0.02, 0.03], 0.0, drift);
    let problem = world
        .problem(&sightings)
        .with_odometry(&odometry)
        .expect("odometry");
    world.instance(problem, sightings)
}

/// A loop of 40 views with odometry and 15 landmarks, each seen from so many places of it.
fn closed_loop(seed: u64, times: usize) -> Instance {
    let mut world = World::new(seed, 0.5);
    let (views, step) = (40, TAU / 39.0);
    let mut at: Pose<f64> = pose(0.0, 0.0, 0.0);
    for view in 0..views {
        world.poses.push(at);
        let length = 2.0 + 0.4 * (3.0 * step * view as f64).cos() + 0.1 * world.normal();
        at *= pose(length, 0.15 * length, step + 0.03 * world.normal());
    }
    let center = world
        .poses
        .iter()
        .map(|pose| pose.translation.vector)
        .sum::<nalgebra::Vector2<f64>>()
        / views as f64;
    let mut seen = vec![Vec::new(); 15];
    for seen in &mut seen {
        let (x, y) = (15.0 * world.normal(), 15.0 * world.normal());
        world
            .landmarks
            .push(Point2::new(center.x + x, center.y + y));
        while seen.len() < times {
            let view = world.random.random_range(0..views);
            if !seen.contains(&view) {
                seen.push(view);
            }
        }
    }
    let sigma = world.noise;
    let sightings = world.sightings(|view, landmark| seen[landmark].contains(&view), sigma);
    let odometry = world.odometry(views, [0.05, 0.05, 0.03], 1.0, 0.0);
    let problem = world
        .problem(&sightings)
        .with_odometry(&odometry)
        .expect("odometry");
    world.instance(problem, sightings)
}

/// Robots with odometry, each of which sees two surveyed beacons and two unknown landmarks of its own.
fn beacons(seed: u64, robots: usize) -> Instance {
    let mut world = World::new(seed, 0.5);
    let mut beacons = Vec::new();
    for robot in 0..robots {
        let (x, y, turn) = (
            24.0 * robot as f64,
            world.between(0.0, 8.0),
            world.heading(),
        );
        let radius = world.between(4.0, 6.0);
        for view in 0..12 {
            let along = turn + 0.37 * f64::from(view);
            world.poses.push(pose(
                x + radius * along.cos(),
                y + radius * along.sin(),
                along + PI / 2.0,
            ));
        }
        for known in [true, true, false, false] {
            let at = Point2::new(
                x + world.between(-10.0, 10.0),
                y + world.between(-10.0, 10.0),
            );
            if known {
                beacons.push(LandmarkPrior {
                    landmark: world.landmarks.len(),
                    position: at,
                    noise: Noise::Sigmas([0.01; 2]),
                });
            }
            world.landmarks.push(at);
        }
    }
    let sigma = world.noise;
    let sightings = world.sightings(|view, landmark| view / 12 == landmark / 4, sigma);
    let odometry = world.odometry(12, [0.02, 0.02, 0.01], 1.0, 0.0);
    let problem = world
        .problem(&sightings)
        .with_odometry(&odometry)
        .expect("odometry");
    let problem = problem.with_landmark_priors(&beacons).expect("priors");
    world.instance(problem, sightings)
}

/// Twelve views of known position and unknown heading, each of which sees three to five of eight landmarks.
fn gnss(seed: u64) -> Instance {
    let mut world = World::new(seed, 0.5);
    let (views, landmarks) = (12, 8);
    for _ in 0..views {
        let (at, heading) = (world.point(20.0, 15.0), world.heading());
        world.poses.push(pose(at.x, at.y, heading));
    }
    world.landmarks = (0..landmarks).map(|_| world.point(20.0, 15.0)).collect();
    let (seen, sigma) = (world.some(3, 5), world.noise);
    let sightings = world.sightings(|view, landmark| seen[view][landmark], sigma);
    let priors = world.pose_priors([0.1, 0.1, f64::INFINITY]);
    let problem = world
        .problem(&sightings)
        .with_pose_priors(&priors)
        .expect("priors");
    world.instance(problem, sightings)
}

/// Twelve views with a compass, each of which sees four to six of ten landmarks.
fn compass(seed: u64) -> Instance {
    let mut world = World::new(seed, 0.5);
    for _ in 0..12 {
        let (at, heading) = (world.point(20.0, 15.0), world.heading());
        world.poses.push(pose(at.x, at.y, heading));
    }
    world.landmarks = (0..10).map(|_| world.point(20.0, 15.0)).collect();
    let (seen, sigma) = (world.some(4, 6), world.noise);
    let sightings = world.sightings(|view, landmark| seen[view][landmark], sigma);
    let priors = world.pose_priors([f64::INFINITY, f64::INFINITY, 1.0_f64.to_radians()]);
    let problem = world
        .problem(&sightings)
        .with_pose_priors(&priors)
        .expect("priors");
    world.instance(problem, sightings)
}

/// Four anchors in the corners of a room, mounted at unknown headings, that all see three to six tags.
fn anchors(seed: u64) -> Instance {
    let mut world = World::new(seed, 0.5);
    for (x, y) in [(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)] {
        let heading = world.heading();
        world.poses.push(pose(x, y, heading));
    }
    let tags = 3 + of(seed, 4);
    world.landmarks = (0..tags).map(|_| world.point(10.0, 8.0)).collect();
    let sigma = world.noise;
    let sightings = world.sightings(|_, _| true, sigma);
    let priors = world.pose_priors([0.01, 0.01, f64::INFINITY]);
    let problem = world
        .problem(&sightings)
        .with_pose_priors(&priors)
        .expect("priors");
    world.instance(problem, sightings)
}

/// A corridor of 20 m with 20 landmarks on its walls; a view sees those up to 7 m away.
pub fn corridor(seed: u64) -> Instance {
    let mut world = World::new(seed, 0.8);
    let views = 7 + of(seed, 5);
    for view in 0..views {
        let (side, heading) = (0.3 * world.normal(), 0.2 * world.normal());
        let along = 20.0 * (view as f64 + 0.5) / views as f64;
        world.poses.push(pose(along, side, heading));
    }
    for landmark in 0..20 {
        let wall = if landmark % 2 == 0 { 1.5 } else { -1.5 };
        let at = Point2::new(world.between(0.0, 20.0), wall + 0.1 * world.normal());
        world.landmarks.push(at);
    }
    let (places, landmarks, sigma) = (world.poses.clone(), world.landmarks.clone(), world.noise);
    let near = |view: usize, landmark: usize| {
        (landmarks[landmark].coords - places[view].translation.vector).norm() < 7.0
    };
    let sightings = world.sightings(near, sigma);
    let problem = world.problem(&sightings);
    world.instance(problem, sightings)
}

/// A drive with bearings alone: so many views, two thirds as many landmarks, seen up to 2 m (from 200 views on
/// 1.5 m); a share of the bearings is wrong.
pub fn limited_sight(seed: u64, views: usize, outliers: f64) -> Instance {
    let noise = 0.5_f64.to_radians();
    let landmarks = (2 * views / 3).max(30);
    let arena = Arena {
        sight: if views < 200 { 2.0 } else { 1.5 },
        ..Arena::default()
    };
    let clean =
        simulate(Layout::Trajectory, views, landmarks, noise, seed, arena).expect("a scene");
    let (scene, all_wrong) = clean.contaminate(Outliers::Mixture, outliers, seed);
    let world = World::of(&scene, seed, noise);
    let (mut sightings, mut wrong) = (Vec::new(), Vec::new());
    for (place, &bearing) in scene.bearings.iter().enumerate() {
        if !bearing.is_nan() {
            let (view, landmark, sigma) = (place / landmarks, place % landmarks, noise);
            sightings.push(Sighting {
                view,
                landmark,
                bearing,
                sigma,
            });
            wrong.push(all_wrong[place]);
        }
    }
    let problem = world.problem(&sightings);
    Instance {
        wrong,
        ..world.instance(problem, sightings)
    }
}

/// A chain of 30 views past 40 landmarks, with bearings alone: a view sees those of a window with a probability of
/// 78 %.
fn chain(seed: u64) -> Instance {
    let mut world = World::new(seed, 0.5);
    for view in 0..30 {
        let (side, heading) = (0.5 * world.normal(), 0.3 * world.normal());
        world.poses.push(pose(f64::from(view), side, heading));
    }
    for _ in 0..40 {
        let at = world.point(34.0, 8.0);
        world.landmarks.push(Point2::new(at.x - 2.0, at.y - 4.0));
    }
    let mut seen = Vec::new();
    for view in 0..30 {
        for landmark in 0..40 {
            let ahead = world.landmarks[landmark].x - f64::from(view);
            seen.push(ahead.abs() < 6.0 && world.between(0.0, 1.0) < 0.78);
        }
    }
    let sigma = world.noise;
    let sightings = world.sightings(|view, landmark| seen[view * 40 + landmark], sigma);
    let problem = world.problem(&sightings);
    world.instance(problem, sightings)
}

/// A number below `count` that goes round with the seed.
pub fn of(seed: u64, count: u64) -> usize {
    usize::try_from(seed % count).expect("a small number")
}
