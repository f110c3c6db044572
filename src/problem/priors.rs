// SPDX-License-Identifier: MIT OR Apache-2.0
//! What is known besides bearings: odometry, poses, landmarks, each with its uncertainty.

use super::noise::Noise;
use super::subject::Subject;
use crate::geometry::Pose;
use nalgebra::Point2;

/// The measured motion from one view to another: the pose of `end` in the frame of `start`.
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 2.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometry {
    /// Index of the view at the start.
    pub start: usize,
    /// Index of the view at the end.
    pub end: usize,
    /// Pose of the view at the end in the frame of that at the start.
    pub delta: Pose<f64>,
    /// How well it is known: x and y in the frame of the end, heading \[rad\].
    pub noise: Noise<3>,
}

/// A pose that is known beforehand, in the map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePrior {
    /// Index of the view.
    pub view: usize,
    /// Its pose.
    pub pose: Pose<f64>,
    /// How well it is known: x and y in the map frame, heading \[rad\]. An infinite standard deviation
    /// is for what is not known: a compass gives the heading only.
    pub noise: Noise<3>,
}

/// A landmark whose position is known beforehand: a beacon, a survey point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkPrior {
    /// Index of the landmark.
    pub landmark: usize,
    /// Its position in the map frame.
    pub position: Point2<f64>,
    /// How well it is known, in the map frame.
    pub noise: Noise<2>,
}

/// Something known of one or two subjects, as the problem keeps it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Tie {
    Motion {
        start: usize,
        end: usize,
        delta: Pose<f64>,
        root: [[f64; 3]; 3],
    },
    Pose {
        view: usize,
        pose: Pose<f64>,
        root: [[f64; 3]; 3],
    },
    Landmark {
        landmark: usize,
        position: Point2<f64>,
        root: [[f64; 2]; 2],
    },
}

impl Tie {
    /// The subjects that it holds.
    pub(crate) fn subjects(&self) -> [Option<Subject>; 2] {
        match *self {
            Self::Motion { start, end, .. } => {
                [Some(Subject::View(start)), Some(Subject::View(end))]
            }
            Self::Pose { view, .. } => [Some(Subject::View(view)), None],
            Self::Landmark { landmark, .. } => [Some(Subject::Landmark(landmark)), None],
        }
    }

    /// The same between subjects numbered anew, with all lengths times a factor.
    pub(crate) fn moved(
        &self,
        view: impl Fn(usize) -> usize,
        landmark: impl Fn(usize) -> usize,
        factor: f64,
    ) -> Self {
        let stretched = |pose: &Pose<f64>| {
            let mut pose = *pose;
            pose.translation.vector *= factor;
            pose
        };
        // Weights of lengths go the other way; the third column belongs to the heading.
        let looser =
            |root: &[[f64; 3]; 3]| root.map(|[x, y, heading]| [x / factor, y / factor, heading]);
        match self {
            Self::Motion {
                start,
                end,
                delta,
                root,
            } => Self::Motion {
                start: view(*start),
                end: view(*end),
                delta: stretched(delta),
                root: looser(root),
            },
            Self::Pose {
                view: index,
                pose,
                root,
            } => Self::Pose {
                view: view(*index),
                pose: stretched(pose),
                root: looser(root),
            },
            Self::Landmark {
                landmark: index,
                position,
                root,
            } => Self::Landmark {
                landmark: landmark(*index),
                position: position * factor,
                root: root.map(|row| row.map(|entry| entry / factor)),
            },
        }
    }
}
