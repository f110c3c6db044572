// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random scenes: the two layouts of Dellaert and Stroupe (2002), and a trajectory with limited sight.

mod bound;
mod contaminate;
mod map_errors;
mod odometry;

pub use bound::Bound;
pub use contaminate::Outliers;
pub use map_errors::Errors;

use crate::error::Error;
#[cfg(not(feature = "std"))]
use crate::float::Float;
use crate::geometry::{Pose, bearing_to, pose};
use crate::problem::{Map, check_data};
use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};
use nalgebra::Point2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// Where robots and landmarks are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Both uniform over the arena (Dellaert and Stroupe, figure 9 and section 4.2).
    Mixed,
    /// Landmarks on the border of the arena, robots in its middle three fifths (figure 10).
    Enclosed,
    /// A robot driving a closed, wavy loop among uniform landmarks, heading along its path.
    Trajectory,
}

/// The size of the arena and the range of sight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arena {
    /// Extent along x.
    pub width: f64,
    /// Extent along y.
    pub height: f64,
    /// Landmarks farther away than this are not seen.
    pub sight: f64,
}

impl Default for Arena {
    /// The arena of the paper, 7 by 5 metres, with unlimited sight.
    fn default() -> Self {
        Self {
            width: 7.0,
            height: 5.0,
            sight: f64::INFINITY,
        }
    }
}

/// A scene and the bearings measured in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The true poses.
    pub poses: Vec<Pose<f64>>,
    /// The true landmarks.
    pub landmarks: Vec<Point2<f64>>,
    /// Bearings \[rad\] in (-pi, pi], views times landmarks, row by row; NaN where not seen.
    pub bearings: Vec<f64>,
}

impl Scene {
    /// The truth as a map.
    pub fn map(&self) -> Map {
        Map {
            poses: self.poses.iter().copied().map(Some).collect(),
            landmarks: self.landmarks.iter().copied().map(Some).collect(),
        }
    }
}

impl Layout {
    /// All layouts.
    pub const ALL: [Self; 3] = [Self::Mixed, Self::Enclosed, Self::Trajectory];

    /// The name of the variant in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mixed => "mixed",
            Self::Enclosed => "enclosed",
            Self::Trajectory => "trajectory",
        }
    }
}

/// A random scene with Gaussian noise of standard deviation `noise` \[rad\] on every bearing.
///
/// The same arguments give the same scene, up to rounding in the platform's sines and cosines.
///
/// # Errors
/// [`Error::TooFew`] for no views or no landmarks, [`Error::NotPositive`] for a negative or NaN
/// noise, width, height or sight, [`Error::Magnitude`] for a width or height beyond
/// [`DATA_MAGNITUDES`](crate::DATA_MAGNITUDES).
///
/// # Example
/// ```
/// use bearslam::{Arena, Layout, simulate};
/// let scene = simulate(Layout::Mixed, 4, 9, 2.23_f64.to_radians(), 1, Arena::default())?;
/// assert_eq!(scene.bearings.len(), 36);
/// # Ok::<(), bearslam::Error>(())
/// ```
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 4.2.
pub fn simulate(
    layout: Layout,
    views: usize,
    landmarks: usize,
    noise: f64,
    seed: u64,
    arena: Arena,
) -> Result<Scene, Error> {
    simulate_while(layout, views, landmarks, noise, seed, arena, |_| true)
}

/// Poses, landmarks or bearings between two looks at whether to go on. It decides about time only.
const LOOK: usize = 1 << 12;

/// As [`simulate`], as long as `goes_on`, called with the views done, says so.
///
/// # Errors
/// [`Error::Interrupted`] when not, in addition to those.
pub(crate) fn simulate_while(
    layout: Layout,
    views: usize,
    landmarks: usize,
    noise: f64,
    seed: u64,
    arena: Arena,
    mut goes_on: impl FnMut(usize) -> bool,
) -> Result<Scene, Error> {
    for (what, got) in [("views", views), ("landmarks", landmarks)] {
        if got == 0 {
            return Err(Error::TooFew {
                what,
                needed: 1,
                got,
            });
        }
    }
    for (what, value, legal) in [
        ("noise", noise, noise >= 0.0 && noise.is_finite()),
        (
            "width",
            arena.width,
            arena.width > 0.0 && arena.width.is_finite(),
        ),
        (
            "height",
            arena.height,
            arena.height > 0.0 && arena.height.is_finite(),
        ),
        ("sight", arena.sight, arena.sight > 0.0),
    ] {
        if !legal {
            return Err(Error::NotPositive {
                what,
                index: 0,
                value,
            });
        }
    }
    check_data("width", 0, arena.width)?;
    check_data("height", 0, arena.height)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let Arena {
        width,
        height,
        sight,
    } = arena;
    let mut drawn = 0_usize;
    let mut look = |done: usize| {
        drawn += 1;
        let stops = drawn.is_multiple_of(LOOK) && !goes_on(done);
        if stops {
            Err(Error::Interrupted)
        } else {
            Ok(())
        }
    };
    let mut poses = Vec::with_capacity(views);
    for view in 0..views {
        look(0)?;
        poses.push(match layout {
            Layout::Mixed => pose(
                width * random.random::<f64>(),
                height * random.random::<f64>(),
                PI - TAU * random.random::<f64>(),
            ),
            Layout::Enclosed => pose(
                width * (0.2 + 0.6 * random.random::<f64>()),
                height * (0.2 + 0.6 * random.random::<f64>()),
                PI - TAU * random.random::<f64>(),
            ),
            Layout::Trajectory => on_loop(TAU * view as f64 / views as f64, width, height),
        });
    }
    let count = landmarks;
    let mut landmarks = Vec::with_capacity(count);
    for _ in 0..count {
        look(0)?;
        landmarks.push(match layout {
            Layout::Enclosed => on_border(random.random(), width, height),
            _ => Point2::new(
                width * random.random::<f64>(),
                height * random.random::<f64>(),
            ),
        });
    }
    let normal = Normal::new(0.0, noise).map_err(|_| Error::NotPositive {
        what: "noise",
        index: 0,
        value: noise,
    })?;
    let mut bearings = Vec::with_capacity(poses.len() * landmarks.len());
    for (done, pose) in poses.iter().enumerate() {
        for landmark in &landmarks {
            look(done)?;
            let error = normal.sample(&mut random);
            let range = (landmark.coords - pose.translation.vector).norm();
            bearings.push(match bearing_to(pose, landmark) {
                Some(bearing) if range <= sight => wrap(bearing.angle() + error),
                _ => f64::NAN,
            });
        }
    }
    Ok(Scene {
        poses,
        landmarks,
        bearings,
    })
}

/// A wavy loop, traversed counter-clockwise once as `phase` goes from 0 to 2 pi.
fn on_loop(phase: f64, width: f64, height: f64) -> Pose<f64> {
    let (sin, cos) = phase.sin_cos();
    let (sin5, cos5) = (5.0 * phase).sin_cos();
    let radius = 0.34 + 0.06 * cos5;
    let slope = -0.3 * sin5;
    let (dx, dy) = (
        width * (slope * cos - radius * sin),
        height * (slope * sin + radius * cos),
    );
    pose(
        width * (0.5 + radius * cos),
        height * (0.5 + radius * sin),
        dy.atan2(dx),
    )
}

/// The point on the border at a fraction of its length.
fn on_border(fraction: f64, width: f64, height: f64) -> Point2<f64> {
    let along = fraction * 2.0 * (width + height);
    if along < width {
        Point2::new(along, 0.0)
    } else if along < width + height {
        Point2::new(width, along - width)
    } else if along < 2.0 * width + height {
        Point2::new(2.0 * width + height - along, height)
    } else {
        Point2::new(0.0, 2.0 * (width + height) - along)
    }
}

/// The same angle in (-pi, pi].
fn wrap(angle: f64) -> f64 {
    if angle > PI {
        angle - TAU * ((angle - PI) / TAU).ceil()
    } else if angle <= -PI {
        angle + TAU * (((-PI - angle) / TAU).floor() + 1.0)
    } else {
        angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks change nothing, and the first that says so ends the work, wherever it is.
    #[test]
    fn a_simulation_ends_when_it_is_told_to() {
        let arena = Arena::default();
        for (views, landmarks) in [(3 * LOOK, 1), (1, 3 * LOOK), (2 * LOOK, 2)] {
            let mut looks = 0;
            let mut counted = |_| {
                looks += 1;
                true
            };
            let whole =
                simulate_while(Layout::Mixed, views, landmarks, 0.1, 1, arena, &mut counted);
            let plain = simulate(Layout::Mixed, views, landmarks, 0.1, 1, arena);
            assert_eq!(whole.unwrap().landmarks, plain.unwrap().landmarks);
            assert!(looks > 5);
            for last in 0..looks {
                let mut seen = 0;
                let found = simulate_while(Layout::Mixed, views, landmarks, 0.1, 1, arena, |_| {
                    seen += 1;
                    seen <= last
                });
                assert_eq!(found.unwrap_err(), Error::Interrupted);
            }
        }
    }
}
