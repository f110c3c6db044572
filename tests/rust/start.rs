// SPDX-License-Identifier: MIT OR Apache-2.0
//! First maps from whatever is known besides bearings, and how maps are compared.

use bearslam::{
    Error, LandmarkPrior, Map, Noise, Odometry, Pose, PosePrior, Problem, Reconstruction,
    RefineOptions, Sighting, SolveOptions, Subject, Why, bearing_to, pose, refine, solve,
};
use nalgebra::{Point2, Translation2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};

const SIGMA: f64 = 0.005;
const UNKNOWN: f64 = f64::INFINITY;

/// Poses and landmarks that are measured with uniform errors of about the standard deviation.
struct World {
    random: ChaCha8Rng,
    poses: Vec<Pose<f64>>,
    landmarks: Vec<Point2<f64>>,
}

impl World {
    fn new(seed: u64) -> Self {
        Self {
            random: ChaCha8Rng::seed_from_u64(seed),
            poses: Vec::new(),
            landmarks: Vec::new(),
        }
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.random.random::<f64>()
    }

    /// A robot that drives most of a circle about a center.
    fn drive(&mut self, center: Point2<f64>, views: usize) {
        let turn = self.between(-PI, PI);
        for view in 0..views {
            let along = turn + 4.5 * view as f64 / views as f64;
            let (sin, cos) = along.sin_cos();
            self.poses.push(pose(
                center.x + 5.0 * cos,
                center.y + 5.0 * sin,
                along + PI / 2.0,
            ));
        }
    }

    fn scatter(&mut self, center: Point2<f64>, count: usize) {
        for _ in 0..count {
            let (x, y) = (self.between(-9.0, 9.0), self.between(-9.0, 9.0));
            self.landmarks.push(Point2::new(center.x + x, center.y + y));
        }
    }

    fn problem(&mut self, sees: impl Fn(usize, usize) -> bool) -> Problem {
        let mut sightings = Vec::new();
        for view in 0..self.poses.len() {
            for landmark in (0..self.landmarks.len()).filter(|&landmark| sees(view, landmark)) {
                let error = self.between(-1.5, 1.5) * SIGMA;
                let toward = bearing_to(&self.poses[view], &self.landmarks[landmark]).unwrap();
                let bearing = (toward.angle() + error + PI).rem_euclid(TAU) - PI;
                sightings.push(Sighting {
                    view,
                    landmark,
                    bearing,
                    sigma: SIGMA,
                });
            }
        }
        Problem::new(self.poses.len(), self.landmarks.len(), &sightings).unwrap()
    }

    /// Motions within robots of so many views.
    fn odometry(&mut self, views: usize) -> Vec<Odometry> {
        (1..self.poses.len())
            .filter(|end| end % views != 0)
            .map(|end| {
                let error: Pose<f64> = pose(
                    self.between(-0.03, 0.03),
                    self.between(-0.03, 0.03),
                    self.between(-0.01, 0.01),
                );
                Odometry {
                    start: end - 1,
                    end,
                    delta: self.poses[end - 1].inv_mul(&self.poses[end]) * error,
                    noise: Noise::Sigmas([0.02, 0.02, 0.01]),
                }
            })
            .collect()
    }

    fn known_landmarks(&self, which: &[usize]) -> Vec<LandmarkPrior> {
        let known = which.iter().map(|&landmark| LandmarkPrior {
            landmark,
            position: self.landmarks[landmark],
            noise: Noise::Sigmas([0.01; 2]),
        });
        known.collect()
    }

    /// What is known of each view, of the truth; what has an infinite standard deviation is not.
    fn known_poses(&self, sigmas: [f64; 3]) -> Vec<PosePrior> {
        let known = self.poses.iter().enumerate().map(|(view, truth)| {
            let of = |value: f64, sigma: f64| if sigma.is_finite() { value } else { 0.0 };
            let (at, heading) = (truth.translation.vector, truth.rotation.angle());
            PosePrior {
                view,
                pose: pose(
                    of(at.x, sigmas[0]),
                    of(at.y, sigmas[1]),
                    of(heading, sigmas[2]),
                ),
                noise: Noise::Sigmas(sigmas),
            }
        });
        known.collect()
    }

    fn truth(&self) -> Map {
        Map {
            poses: self.poses.iter().copied().map(Some).collect(),
            landmarks: self.landmarks.iter().copied().map(Some).collect(),
        }
    }

    /// Solves and compares with the refinement from the truth.
    fn reaches_the_truth(&self, problem: &Problem, robust: bool) {
        self.comes_within(1e-5, problem, robust);
    }

    /// The same, up to a part of the cost.
    fn comes_within(&self, part: f64, problem: &Problem, robust: bool) {
        let options = SolveOptions {
            robust,
            ..SolveOptions::default()
        };
        let best = refine(problem, &self.truth(), &RefineOptions::default(), None).unwrap();
        let found = solve(problem, &options, None).unwrap();
        assert!(found.map.is_complete(), "{:?}", found.undetermined);
        let slack = part * best.cost.max(1.0);
        assert!(
            found.cost < best.cost + slack,
            "{} {}",
            found.cost,
            best.cost
        );
    }
}

/// Two robots that see nothing in common are in one frame by two surveyed beacons each.
#[test]
fn beacons_bring_robots_into_one_frame() {
    for seed in 0..4 {
        let mut world = World::new(seed);
        for robot in [0.0, 30.0] {
            let center = Point2::new(robot, 5.0);
            world.drive(center, 12);
            world.scatter(center, 4);
        }
        let problem = world.problem(|view, landmark| view / 12 == landmark / 4);
        let problem = problem.with_odometry(&world.odometry(12)).unwrap();
        let beacons = world.known_landmarks(&[0, 1, 4, 5]);
        let problem = problem.with_landmark_priors(&beacons).unwrap();
        world.reaches_the_truth(&problem, false);
        world.reaches_the_truth(&problem, true);
    }
}

/// A compass on each of two robots turns them alike, and one shared landmark places them.
#[test]
fn a_compass_and_one_shared_landmark_bring_robots_into_one_frame() {
    for seed in 0..4 {
        let mut world = World::new(seed);
        for robot in [0.0, 12.0] {
            let center = Point2::new(robot, 5.0);
            world.drive(center, 12);
            world.scatter(center, 4);
        }
        // The last of the first robot is seen by both.
        let sees = |view: usize, landmark: usize| view / 12 == landmark / 4 || landmark == 3;
        let problem = world.problem(sees);
        let problem = problem.with_odometry(&world.odometry(12)).unwrap();
        let compass = world.known_poses([UNKNOWN, UNKNOWN, 0.01]);
        let problem = problem.with_pose_priors(&compass).unwrap();
        world.reaches_the_truth(&problem, false);
    }
}

/// Anchors at known places, mounted at unknown headings.
#[test]
fn headings_of_known_positions_are_searched() {
    for seed in 0..8 {
        let mut world = World::new(seed);
        for (x, y) in [(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)] {
            let heading = world.between(-PI, PI);
            world.poses.push(pose(x, y, heading));
        }
        for _ in 0..3 {
            let place = Point2::new(world.between(1.0, 9.0), world.between(1.0, 7.0));
            world.landmarks.push(place);
        }
        let problem = world.problem(|_, _| true);
        let known = world.known_poses([0.01, 0.01, UNKNOWN]);
        let problem = problem.with_pose_priors(&known).unwrap();
        world.reaches_the_truth(&problem, false);
    }
}

/// Groups of views that share no landmark are in one frame, as the positions of all of them are known.
#[test]
fn headings_are_searched_for_each_group_of_known_positions() {
    for (seed, robust) in [(0, false), (1, false), (2, false), (0, true)] {
        let mut world = World::new(seed);
        for group in [0.0, 20.0, 45.0] {
            let center = Point2::new(group, 3.0);
            world.drive(center, 5);
            world.scatter(center, 7);
        }
        let problem = world.problem(|view, landmark| view / 5 == landmark / 7);
        let known = world.known_poses([0.01, 0.01, UNKNOWN]);
        let problem = problem.with_pose_priors(&known).unwrap();
        world.reaches_the_truth(&problem, robust);
    }
}

/// Known headings make positions linear, where views see too little for bearings alone.
#[test]
fn a_compass_places_views_that_see_four_landmarks() {
    for seed in 0..8 {
        let mut world = World::new(seed);
        for _ in 0..10 {
            let (x, y) = (world.between(0.0, 20.0), world.between(0.0, 15.0));
            let heading = world.between(-PI, PI);
            world.poses.push(pose(x, y, heading));
        }
        for _ in 0..8 {
            let place = Point2::new(world.between(0.0, 20.0), world.between(0.0, 15.0));
            world.landmarks.push(place);
        }
        let problem = world.problem(|view, landmark| (3 * view + 5 * landmark) % 7 < 4);
        let known = world.known_poses([UNKNOWN, UNKNOWN, 0.01]);
        let problem = problem.with_pose_priors(&known).unwrap();
        // Minima that differ in one landmark are that near to each other.
        world.comes_within(1e-2, &problem, false);
    }
}

/// A room of 20 m by 15 m in which views see landmarks up to a distance.
fn room(seed: u64, views: usize, landmarks: usize, sight: f64) -> (World, Problem) {
    let mut world = World::new(seed);
    for _ in 0..views {
        let (x, y) = (world.between(0.0, 20.0), world.between(0.0, 15.0));
        let heading = world.between(-PI, PI);
        world.poses.push(pose(x, y, heading));
    }
    for _ in 0..landmarks {
        let place = Point2::new(world.between(0.0, 20.0), world.between(0.0, 15.0));
        world.landmarks.push(place);
    }
    let (poses, points) = (world.poses.clone(), world.landmarks.clone());
    let near = |view: usize, landmark: usize| {
        (points[landmark].coords - poses[view].translation.vector).norm() < sight
    };
    let problem = world.problem(near);
    (world, problem)
}

/// Whether a solve ends as low as the refinement from the truth and reaches all that it reaches; `None` when the problem
/// does not determine its map to a tenth of its size.
fn is_right(world: &World, problem: &Problem) -> Option<bool> {
    let options = RefineOptions::default();
    let best = refine(problem, &world.truth(), &options, None).ok()?;
    if !(best.freedom > 3 && best.uncertainty < 0.1) {
        return None;
    }
    let reaches = |found: &Reconstruction| {
        let mut poses = best.map.poses.iter().zip(&found.map.poses);
        poses.all(|(best, found)| best.is_none() || found.is_some())
    };
    Some(
        solve(problem, &SolveOptions::default(), None).is_ok_and(|found| {
            found.cost < best.cost + 1e-2 * best.cost.max(1.0) && reaches(&found)
        }),
    )
}

/// One known pose says nothing of the scale: where the map lies in the frame of the priors must not change it.
#[test]
fn one_known_pose_leads_to_the_same_map_wherever_it_is() {
    for seed in 0..6 {
        for (x, y) in [(0.0, 0.0), (1e3, -2e3), (5e5, 4.2e6)] {
            let (mut world, problem) = room(seed, 8, 10, 14.0);
            let shift = Translation2::new(x, y);
            world
                .poses
                .iter_mut()
                .for_each(|pose| *pose = shift * *pose);
            world
                .landmarks
                .iter_mut()
                .for_each(|point| *point = shift * *point);
            let known = &world.known_poses([0.005, 0.005, 0.02])[..1];
            let problem = problem.with_pose_priors(known).unwrap();
            let found = solve(&problem, &SolveOptions::default(), None).unwrap();
            let best = refine(&problem, &world.truth(), &RefineOptions::default(), None).unwrap();
            let which = format!("{seed} {x}: {} {}", found.cost, best.cost);
            assert!(
                found.cost < best.cost + 1e-4 * best.cost.max(1.0),
                "{which}"
            );
            // As large as where nothing is known of the scale: the other views are at a distance of one.
            let [first, others @ ..] = &found.map.poses[..] else {
                unreachable!()
            };
            let first = first.unwrap().translation.vector;
            let squares = others
                .iter()
                .flatten()
                .map(|pose| (pose.translation.vector - first).norm_squared());
            let mean = squares.clone().sum::<f64>() / squares.count() as f64;
            assert!((mean - 1.0).abs() < 1e-6, "{which}: {mean}");
        }
    }
}

/// Of how many rooms with these priors the map is wrong, and of how many it is determined.
fn wrong_rooms(sigmas: [f64; 3]) -> (usize, usize) {
    let right = (0..60).filter_map(|seed| {
        let (world, problem) = room(seed, 10, 10, 9.0);
        let known = world.known_poses(sigmas);
        is_right(&world, &problem.with_pose_priors(&known).unwrap())
    });
    right.fold((0, 0), |(wrong, all), right| {
        (wrong + usize::from(!right), all + 1)
    })
}

/// A view that shares little with the others does not draw them into one place.
#[test]
fn a_compass_places_views_of_limited_sight() {
    let (wrong, all) = wrong_rooms([UNKNOWN, UNKNOWN, 0.02]);
    assert!(wrong == 0 && all > 35, "{wrong} of {all}");
}

/// On a rail or in a lane one coordinate of every position is known. Where no view sees three placed landmarks, the
/// map may still be missed.
#[test]
fn one_coordinate_of_each_position_is_used() {
    let (wrong, all) = wrong_rooms([UNKNOWN, 0.02, UNKNOWN]);
    assert!(7 * wrong <= all && all > 35, "{wrong} of {all}");
}

/// Where the map from bearings alone is the best, odometry still places the views that it lacks.
#[test]
fn odometry_places_what_bearings_do_not() {
    for seed in 0..8 {
        let mut world = World::new(seed);
        world.drive(Point2::new(0.0, 0.0), 14);
        world.scatter(Point2::new(0.0, 0.0), 9);
        // The last two see two landmarks each.
        let problem = world.problem(|view, landmark| view < 12 || landmark / 2 == view - 12);
        let odometry = world.odometry(14);
        // Odometry of the others is worse than it says by far, so that their map comes from bearings.
        let spoiled: Vec<Odometry> = odometry
            .into_iter()
            .map(|mut motion| {
                if motion.end < 12 {
                    motion.delta *= pose(0.0, 0.0, 1.0);
                    motion.noise = Noise::Sigmas([1e3, 1e3, 1e3]);
                }
                motion
            })
            .collect();
        let problem = problem.with_odometry(&spoiled).unwrap();
        world.reaches_the_truth(&problem, false);
    }
}

/// Robots that see little each, and some landmarks together: how many maps of theirs lack a view, or are not the right
/// minimum.
fn wrong_teams(compass: f64) -> (usize, usize) {
    let (mut wrong, mut all) = (0, 0);
    for seed in 0..60 {
        let mut world = World::new(seed);
        for robot in 0..3 {
            let center = Point2::new(3.0 * f64::from(robot), world.between(-3.0, 3.0));
            world.drive(center, 8);
        }
        world.scatter(Point2::new(3.0, 0.0), 12);
        let (poses, landmarks) = (world.poses.clone(), world.landmarks.clone());
        let range = |view: usize, landmark: usize| {
            (poses[view].translation.vector - landmarks[landmark].coords).norm()
        };
        let problem = world.problem(|view, landmark| range(view, landmark) < 4.0);
        let problem = problem.with_odometry(&world.odometry(8)).unwrap();
        let problem = if compass.is_finite() {
            let known = world.known_poses([UNKNOWN, UNKNOWN, compass]);
            problem.with_pose_priors(&known).unwrap()
        } else {
            problem
        };
        // Where the truth leads to all views, and these determine it.
        let Ok(best) = refine(&problem, &world.truth(), &RefineOptions::default(), None) else {
            continue;
        };
        if best
            .undetermined
            .iter()
            .any(|one| matches!(one.subject, Subject::View(_)))
            || !(best.uncertainty < 0.05)
        {
            continue;
        }
        all += 1;
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        let is_whole = found.map.poses.iter().all(Option::is_some);
        wrong += usize::from(!(is_whole && found.cost < best.cost * (1.0 + 1e-5)));
    }
    (wrong, all)
}

/// Odometry gives robots their scale, and what two of them see, placed or not, how they lie.
#[test]
fn robots_with_odometry_that_see_the_same_are_one_map() {
    let found = [UNKNOWN, 0.01].map(wrong_teams);
    let [(turning, some), (shifted, others)] = found;
    assert!(turning <= 5 && some > 50, "{found:?}");
    assert!(shifted == 0 && others > 50, "{found:?}");
}

/// A landmark of known position is where it is known to be, however seldom it is seen.
#[test]
fn a_known_landmark_is_determined() {
    let mut world = World::new(3);
    world.drive(Point2::new(0.0, 0.0), 6);
    world.scatter(Point2::new(0.0, 0.0), 8);
    let problem = world.problem(|view, landmark| landmark > 1 || (landmark == 0 && view == 0));
    let known = world.known_landmarks(&[0, 1, 2, 3]);
    let problem = problem.with_landmark_priors(&known).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    assert!(found.undetermined.is_empty(), "{:?}", found.undetermined);
    for landmark in 0..2 {
        let error = found.map.landmarks[landmark].unwrap() - world.landmarks[landmark];
        assert!(error.norm() < 0.05, "{error}");
    }
}

/// A single view of known heading is placed by two known landmarks, one of known position turned by one.
#[test]
fn half_a_pose_and_few_landmarks_locate_a_view() {
    for (landmarks, sigmas) in [(2, [UNKNOWN, UNKNOWN, 0.01]), (1, [0.01, 0.01, UNKNOWN])] {
        let mut world = World::new(7);
        world.poses.push(pose(3.0, -2.0, 2.2));
        world.scatter(Point2::new(0.0, 0.0), landmarks);
        let problem = world.problem(|_, _| true);
        let problem = problem
            .with_pose_priors(&world.known_poses(sigmas))
            .unwrap();
        let all: Vec<usize> = (0..landmarks).collect();
        let known = world.known_landmarks(&all);
        let problem = problem.with_landmark_priors(&known).unwrap();
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        let error = found.map.poses[0].unwrap().inv_mul(&world.poses[0]);
        assert!(error.translation.vector.norm() < 0.3, "{error}");
        assert!(error.rotation.angle().abs() < 0.05, "{error}");
    }
}

/// Coordinates of a survey, thousands of kilometres, change nothing but the place of the map, where single coordinates and
/// headings of some views are known, and some landmarks.
#[test]
fn the_origin_may_be_anywhere() {
    let offset = Point2::new(4e5, 5.5e6).coords;
    for seed in [83_usize, 288, 420, 744, 802] {
        let found = [offset * 0.0, offset].map(|origin| {
            let mut world = World::new(seed as u64);
            for _ in 0..9 {
                let (x, y) = (world.between(0.0, 10.0), world.between(0.0, 10.0));
                world.poses.push(pose(x, y, 3.0 * x));
            }
            world.scatter(Point2::new(0.0, 0.0), 7);
            for pose in &mut world.poses {
                pose.translation.vector += origin;
            }
            for point in &mut world.landmarks {
                point.coords += origin;
            }
            let every = 2 + seed % 3;
            let problem = world.problem(|view, landmark| (view + landmark) % every != 0);
            let mut known = world.known_poses([0.05; 3]);
            known.truncate(6);
            for (k, known) in known.iter_mut().enumerate() {
                known.noise = Noise::Sigmas(match (k + seed) % 4 {
                    0 => [0.05, UNKNOWN, UNKNOWN],
                    1 => [UNKNOWN, 0.05, UNKNOWN],
                    2 => [0.05, 0.05, UNKNOWN],
                    _ => [UNKNOWN, UNKNOWN, 0.01],
                });
            }
            let problem = problem.with_pose_priors(&known).unwrap();
            solve(&problem, &SolveOptions::default(), None).unwrap()
        });
        let [near, far] = &found;
        let costs = [near.cost, far.cost];
        assert!(
            (costs[1] / costs[0] - 1.0).abs() < 1e-4,
            "{seed}: {costs:?}"
        );
        assert_eq!(near.undetermined, far.undetermined, "{seed}");
    }
}

/// Rays of two known stations that meet behind them leave their landmark without a place.
#[test]
fn rays_that_diverge_place_no_landmark() {
    let mut world = World::new(0);
    world.poses = vec![pose(0.0, 0.0, 0.0), pose(10.0, 0.0, 0.0)];
    let sighting = |view: usize, bearing: f64| Sighting {
        view,
        landmark: 0,
        bearing,
        sigma: SIGMA,
    };
    let problem = Problem::new(2, 1, &[sighting(0, 0.5), sighting(1, 0.2)]).unwrap();
    let known = world.known_poses([0.01; 3]);
    let problem = problem.with_pose_priors(&known).unwrap();
    let found = solve(&problem, &SolveOptions::default(), None).unwrap();
    assert!(found.map.landmarks[0].is_none());
    assert_eq!(found.undetermined.len(), 1);
    assert_eq!(found.undetermined[0].subject, Subject::Landmark(0));
    assert!(matches!(
        found.undetermined[0].why,
        Why::AtInfinity | Why::Degenerate
    ));
}

/// A robot that stands still, makes one short hop and stands still, while its odometry creeps.
fn creeping(seed: u64, drift: f64) -> (Problem, Reconstruction) {
    let mut world = World::new(seed);
    world.poses = (0..48)
        .map(|view| pose(if view < 16 { 0.0 } else { -0.1 }, 0.0, -2.9))
        .collect();
    world.scatter(Point2::new(0.5, 0.5), 7);
    let problem = world.problem(|_, _| true);
    let still: Vec<Odometry> = (1..48)
        .map(|end| Odometry {
            start: end - 1,
            end,
            delta: world.poses[end - 1].inv_mul(&world.poses[end]) * pose(drift, 0.0, 0.0),
            noise: Noise::Sigmas([0.02, 0.02, 0.03]),
        })
        .collect();
    let problem = problem.with_odometry(&still).unwrap();
    let options = RefineOptions {
        max_iterations: 3000,
        ..RefineOptions::default()
    };
    let best = refine(&problem, &world.truth(), &options, None).unwrap();
    (problem, best)
}

/// No start wins because its cost is far below what the standard deviation of the bearings predicts.
#[test]
fn a_low_cost_is_no_reason_to_stop() {
    for (seed, drift) in [(1, 0.022), (2, -0.022), (3, 0.022)] {
        let (problem, best) = creeping(seed, drift);
        let found = solve(&problem, &SolveOptions::default(), None).unwrap();
        assert!(
            found.cost < best.cost * 1.01,
            "{} {}",
            found.cost,
            best.cost
        );
    }
}

/// Where rays hardly spread, minima differ in the range of a landmark, or in which of two is next to the views: both are
/// changed in maps of many views, too.
#[test]
fn landmarks_at_infinity_and_on_views_are_exchanged() {
    let mut stuck = [0; 3];
    for (seed, drift) in [(9, -0.022), (27, -0.022), (35, -0.022), (55, -0.022)] {
        let (problem, best) = creeping(seed, drift);
        let is_missed = |options: &SolveOptions| {
            let found = solve(&problem, options, None).unwrap();
            found.cost > best.cost * (1.0 + 1e-5)
        };
        let mut options = SolveOptions::default();
        assert!(!is_missed(&options), "{seed}");
        options.stages.moves.beside = 0.0;
        stuck[0] += usize::from(is_missed(&options));
        options.stages.incremental.moved_views = 0;
        stuck[1] += usize::from(is_missed(&options));
        // Of more views fewer landmarks return, and none is moved otherwise.
        options.stages.incremental.moved_views = 40;
        stuck[2] += usize::from(is_missed(&options));
    }
    assert!(stuck[0] >= 1 && stuck[1] > stuck[2], "{stuck:?}");
}

/// Where the stated standard deviation says that a minimum is too high, the search finds a lower one: landmarks on
/// the walls of a corridor.
#[test]
fn a_misfit_makes_the_search_go_on() {
    let (mut misses, mut hasty) = (0, 0);
    for seed in 0..60 {
        let (problem, truth) = corridor(seed);
        let Ok(best) = refine(&problem, &truth, &RefineOptions::default(), None) else {
            continue;
        };
        let missed = |found: Result<Reconstruction, Error>| {
            found.map_or(true, |found| {
                found.undetermined.len() > best.undetermined.len()
                    || found.cost > best.cost * (1.0 + 1e-5)
            })
        };
        misses += usize::from(missed(solve(&problem, &SolveOptions::default(), None)));
        let mut options = SolveOptions::default();
        options.stages.judge.persistent_views = 0;
        hasty += usize::from(missed(solve(&problem, &options, None)));
    }
    // As measured by benches/start: one in four hundred ends in another minimum.
    assert!(misses <= 1, "{misses} of 60");
    // Those that leave something out but fit what they have.
    assert!(hasty > misses, "{hasty}");
}

/// Where partial sight hardly determines a map, others may be as low: more places are tried.
#[test]
fn a_doubtful_map_makes_the_search_go_on() {
    let (problem, truth) = corridor(4691);
    let best = refine(&problem, &truth, &RefineOptions::default(), None).unwrap();
    let solved = |doubtful: f64| {
        let mut options = SolveOptions::default();
        options.stages.judge.doubtful = doubtful;
        solve(&problem, &options, None).unwrap()
    };
    let trusted = solved(f64::INFINITY);
    assert!(trusted.cost > best.cost * 1.1 && trusted.uncertainty > 0.1);
    let found = solved(0.1);
    assert!(found.cost < best.cost * (1.0 + 1e-5) && found.uncertainty < 0.1);
}

fn corridor(seed: u64) -> (Problem, Map) {
    let mut world = World::new(seed);
    for view in 0..8 {
        let (side, heading) = (world.between(-0.4, 0.4), world.between(-0.3, 0.3));
        let along = 2.5 * f64::from(view) + 1.0;
        world.poses.push(pose(along, side, heading));
    }
    for landmark in 0..20 {
        let wall = if landmark % 2 == 0 { 1.5 } else { -1.5 };
        let along = world.between(0.0, 20.0);
        let off = world.between(-0.1, 0.1);
        world.landmarks.push(Point2::new(along, wall + off));
    }
    let (poses, landmarks) = (world.poses.clone(), world.landmarks.clone());
    let near = |view: usize, landmark: usize| {
        (landmarks[landmark].coords - poses[view].translation.vector).norm() < 7.0
    };
    (world.problem(near), world.truth())
}
