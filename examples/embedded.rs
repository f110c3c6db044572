// SPDX-License-Identifier: MIT OR Apache-2.0
//! A robot that maps as it drives, in fixed memory: bearing scans come one by one.
//!
//! The first three scans that determine one give a map, in both of its branches; the next scan decides between
//! them. Then every scan is resected, new landmarks are triangulated, and the map is refined. When the memory is
//! full, the oldest scan is dropped. `robot` is what would run on the target: single precision, `core` and this
//! crate without features, no heap. The rest simulates the world on the host.
//!
//! `cargo run --release --no-default-features --example embedded` prints a line per scan.

#[warn(clippy::std_instead_of_core)]
mod robot {
    use bearslam::{Bearing, Branch, Error, FixedMap, RefineOptions, Workspace};

    pub const VIEWS: usize = 8;
    pub const LANDMARKS: usize = 12;

    /// Largest number of iterations of a refinement, which bounds the time of a scan.
    const STEPS: usize = 10;

    /// Standard deviation of a bearing \[rad\].
    pub const SIGMA: f32 = 0.002;

    pub type RobotMap = FixedMap<f32, VIEWS, LANDMARKS>;
    type RobotWorkspace = Workspace<f32, VIEWS, LANDMARKS>;

    /// The result of a scan.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub enum Outcome {
        /// There is no map yet; from three scans on with the reason.
        Waiting(Option<Error>),
        /// There is a map of the last three scans, and its rival.
        Started(bearslam::Outcome<f32>),
        /// The scan is in the map, as this view.
        Placed(usize, bearslam::Outcome<f32>),
        /// The scan has been dropped.
        Lost(Why),
    }

    /// Why a scan is not in the map.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub enum Why {
        /// The map does not determine its pose.
        Undetermined(Error),
        /// At the best pose, this many landmarks are behind the view (cheirality).
        Contradiction(usize),
    }

    impl From<Error> for Why {
        fn from(error: Error) -> Self {
            Self::Undetermined(error)
        }
    }

    pub struct Robot {
        pub map: RobotMap,
        /// The other branch of the start, until a scan has decided.
        rival: RobotMap,
        undecided: bool,
        started: bool,
        workspace: RobotWorkspace,
        /// View of the next scan: the oldest one once all are in use.
        next: usize,
        scans: usize,
    }

    impl Robot {
        /// `const`, so that it can initialise a static.
        pub const fn new() -> Self {
            Self {
                map: RobotMap::new(),
                rival: RobotMap::new(),
                undecided: false,
                started: false,
                workspace: RobotWorkspace::new(),
                next: 0,
                scans: 0,
            }
        }

        /// Adds a scan: landmarks and the bearings at which they are seen.
        ///
        /// # Errors
        /// An invalid landmark or bearing; the scan is dropped.
        pub fn scan(&mut self, scan: &[(usize, Bearing<f32>)]) -> Result<Outcome, Error> {
            let view = self.next;
            self.map.forget_view(view)?;
            let outcome = self.take(view, scan);
            if matches!(outcome, Err(_) | Ok(Outcome::Lost(_))) {
                self.map.forget_view(view)?;
            } else {
                self.next = (view + 1) % VIEWS;
            }
            outcome
        }

        fn take(&mut self, view: usize, scan: &[(usize, Bearing<f32>)]) -> Result<Outcome, Error> {
            for &(landmark, bearing) in scan {
                self.map.see(view, landmark, bearing, SIGMA)?;
            }
            self.scans += 1;
            Ok(if !self.started {
                self.start(view)
            } else if self.undecided {
                self.decide(view)
            } else {
                self.place(view)
            })
        }

        fn start(&mut self, view: usize) -> Outcome {
            if self.scans < 3 {
                return Outcome::Waiting(None);
            }
            let views = [2, 1, 0].map(|back| (view + VIEWS - back) % VIEWS);
            self.rival.clone_from(&self.map);
            let started = self
                .rival
                .start(views, Branch::Other)
                .and_then(|_| self.map.start(views, Branch::Best))
                .and_then(|_| self.map.refine(&mut self.workspace, &options()));
            match started {
                Ok(report) => {
                    (self.started, self.undecided) = (true, true);
                    Outcome::Started(report)
                }
                Err(error) => Outcome::Waiting(Some(error)),
            }
        }

        fn place(&mut self, view: usize) -> Outcome {
            let placed = extend(&mut self.map, view, &mut self.workspace);
            placed.map_or_else(Outcome::Lost, |report| Outcome::Placed(view, report))
        }

        /// Continues with the branch that the scan fits better.
        fn decide(&mut self, view: usize) -> Outcome {
            // The rival gets the new sightings, and keeps its own poses and landmarks.
            let (poses, landmarks) = (self.rival.poses, self.rival.landmarks);
            self.rival.clone_from(&self.map);
            (self.rival.poses, self.rival.landmarks) = (poses, landmarks);
            let rival = extend(&mut self.rival, view, &mut self.workspace);
            let best = extend(&mut self.map, view, &mut self.workspace);
            let report = match (best, rival) {
                (Ok(best), Ok(rival)) if best.cost <= rival.cost => best,
                (Ok(best), Err(_)) => best,
                (_, Ok(rival)) => {
                    self.map.clone_from(&self.rival);
                    rival
                }
                (Err(why), Err(_)) => return Outcome::Lost(why),
            };
            self.undecided = false;
            Outcome::Placed(view, report)
        }
    }

    fn options() -> RefineOptions<f32> {
        RefineOptions {
            max_iterations: STEPS,
            ..RefineOptions::default()
        }
    }

    /// Adds a view and the landmarks that it determines, and refines.
    fn extend(
        map: &mut RobotMap,
        view: usize,
        workspace: &mut RobotWorkspace,
    ) -> Result<bearslam::Outcome<f32>, Why> {
        let found = map.add_view(view)?;
        if found.behind > 0 {
            map.poses[view] = None;
            return Err(Why::Contradiction(found.behind));
        }
        for landmark in 0..LANDMARKS {
            // A landmark behind a view has nearly parallel rays: it waits for more.
            if map.landmarks[landmark].is_none()
                && map
                    .add_landmark(landmark)
                    .is_ok_and(|found| found.behind > 0)
            {
                map.landmarks[landmark] = None;
            }
        }
        Ok(map.refine(workspace, &options())?)
    }
}

use bearslam::{Bearing, Pose, align, bearing_to, pose, transform_pose};
use nalgebra::Point2;
use robot::{LANDMARKS, Outcome, Robot, RobotMap, SIGMA};
use std::sync::Mutex;

/// On the target this would be a cell of the critical-section or RTIC kind.
static ROBOT: Mutex<Robot> = Mutex::new(Robot::new());

const SCANS: usize = 24;

/// Range of the sensor \[m\].
const SIGHT: f32 = 6.5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut robot = ROBOT.lock()?;
    let mut noise = Noise(1);
    let bytes = core::mem::size_of::<Robot>();
    println!("{bytes} bytes; bearings to {:.2} deg", SIGMA.to_degrees());
    for k in 0..SCANS {
        let truth = place(k);
        let scan = sightings(&truth, &mut noise);
        let outcome = robot.scan(&scan)?;
        print!("scan {k:2}: {} bearings, ", scan.len());
        match outcome {
            Outcome::Waiting(None) => println!("waiting for three scans"),
            Outcome::Waiting(Some(error)) => println!("no map yet: {error}"),
            Outcome::Lost(why) => println!("not placed: {why:?}"),
            Outcome::Started(report) | Outcome::Placed(_, report) => {
                let view = match outcome {
                    Outcome::Placed(view, _) => view,
                    _ => 2,
                };
                let (position, landmarks, known) = errors(&robot.map, view, &truth)?;
                println!(
                    "{known:2} landmarks, {} steps, rms {:.3} deg, off by {:.1} mm, landmarks by {:.1} mm",
                    report.iterations,
                    robot.map.rms().to_degrees(),
                    1e3 * position,
                    1e3 * landmarks,
                );
            }
        }
    }
    Ok(())
}

/// A figure of eight through the hall, twice.
fn place(k: usize) -> Pose<f32> {
    let phase = 0.53 * k as f32;
    let (x, y) = (3.0 * phase.cos(), 1.5 * (2.0 * phase).sin());
    pose(x, y, phase + 1.6)
}

/// Landmarks of the hall: its corners, its doors and pillars.
fn hall() -> [Point2<f32>; LANDMARKS] {
    const PLACES: [[f32; 2]; LANDMARKS] = [
        [-5.0, -3.0],
        [5.0, -3.0],
        [5.0, 3.0],
        [-5.0, 3.0],
        [-5.0, 0.4],
        [1.1, 3.0],
        [5.0, -0.8],
        [-1.6, -3.0],
        [-1.5, 1.9],
        [1.4, -1.9],
        [0.4, 0.7],
        [3.1, 2.2],
    ];
    PLACES.map(Point2::from)
}

fn sightings(truth: &Pose<f32>, noise: &mut Noise) -> Vec<(usize, Bearing<f32>)> {
    let landmarks = hall().into_iter().enumerate();
    landmarks
        .filter(|(_, point)| (point.coords - truth.translation.vector).norm() < SIGHT)
        .filter_map(|(landmark, point)| {
            let exact = bearing_to(truth, &point)?;
            Some((landmark, exact * Bearing::new(SIGMA * noise.next())))
        })
        .collect()
}

/// Position error of a view and root-mean-square error of the landmarks \[m\], after alignment by the
/// landmarks, and the number of landmarks.
fn errors(
    map: &RobotMap,
    view: usize,
    truth: &Pose<f32>,
) -> Result<(f32, f32, usize), bearslam::Error> {
    let pairs = map.landmarks.iter().zip(hall());
    let (source, target): (Vec<_>, Vec<_>) = pairs
        .filter_map(|(found, true_one)| Some(((*found)?, true_one)))
        .unzip();
    let fit = align(&source, &target)?;
    let apart = |found, wanted: &Point2<f32>| (fit.transform_point(found) - wanted).norm_squared();
    let squares: f32 = source.iter().zip(&target).map(|(a, b)| apart(a, b)).sum();
    let found = map.poses[view].unwrap_or_default();
    let offset = transform_pose(&fit, &found).translation.vector - truth.translation.vector;
    let count = source.len();
    Ok((offset.norm(), (squares / count as f32).sqrt(), count))
}

/// Normally distributed numbers: the sum of twelve uniform ones of a linear congruential generator, minus its mean.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> f32 {
        let sum: f32 = (0..12)
            .map(|_| {
                self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (self.0 >> 8) as f32 / 16_777_216.0
            })
            .sum();
        sum - 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_robot_maps_the_hall() {
        let (mut sum, mut count) = (0.0, 0.0);
        for seed in 1..=10 {
            let mut robot = Robot::new();
            let mut noise = Noise(seed);
            let mut placed = 0;
            for k in 0..SCANS {
                let truth = place(k);
                let outcome = robot.scan(&sightings(&truth, &mut noise)).unwrap();
                let Outcome::Placed(view, report) = outcome else {
                    continue;
                };
                placed += 1;
                assert!(report.termination.was_successful(), "{seed} {k} {report:?}");
                let (position, landmarks, _) = errors(&robot.map, view, &truth).unwrap();
                assert!(
                    position < 0.2 && landmarks < 0.4,
                    "{seed} {k} {position} {landmarks}"
                );
                sum += position + landmarks;
                count += 2.0;
                assert!(
                    robot.map.rms() < 1.2 * SIGMA,
                    "{seed} {k} {}",
                    robot.map.rms()
                );
            }
            assert_eq!(placed, SCANS - 3);
            assert!(robot.map.landmarks.iter().all(Option::is_some));
        }
        assert!(sum / count < 0.04, "{}", sum / count);
    }

    #[test]
    fn a_scan_that_tells_nothing_is_dropped() {
        let mut robot = Robot::new();
        let mut noise = Noise(7);
        for k in 0..5 {
            robot.scan(&sightings(&place(k), &mut noise)).unwrap();
        }
        let before = robot.map.clone();
        let scan = sightings(&place(5), &mut noise);
        assert!(matches!(robot.scan(&scan[..2]), Ok(Outcome::Lost(_))));
        assert_eq!(robot.map, before);
        assert!(matches!(robot.scan(&scan), Ok(Outcome::Placed(5, _))));
        assert!(robot.scan(&[(LANDMARKS, Bearing::identity())]).is_err());
    }
}
