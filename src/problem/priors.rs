// SPDX-License-Identifier: MIT OR Apache-2.0
//! Observations other than bearings: odometry, and prior poses and landmarks, each with its uncertainty.

use super::noise::Noise;
use super::subject::Subject;
use crate::geometry::Pose;
use nalgebra::{Point2, Vector2};

/// The measured motion from one view to another: the pose of `end` in the frame of `start`.
///
/// # Reference
/// Dellaert and Stroupe, ICRA 2002, section 2.2.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Odometry {
    /// Index of the view at the start.
    pub start: usize,
    /// Index of the view at the end.
    pub end: usize,
    /// Pose of the view at the end in the frame of the view at the start.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::serialized::pose"))]
    pub delta: Pose<f64>,
    /// Its uncertainty: x and y in the frame of the end, heading \[rad\].
    pub noise: Noise<3>,
}

/// A prior on a pose, in the map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct PosePrior {
    /// Index of the view.
    pub view: usize,
    /// The prior pose.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::serialized::pose"))]
    pub pose: Pose<f64>,
    /// Its uncertainty: x and y in the map frame, heading \[rad\]. An infinite standard deviation marks
    /// what is unknown: a compass gives only the heading.
    pub noise: Noise<3>,
}

/// A prior on the position of a landmark, such as a beacon or a control point.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct LandmarkPrior {
    /// Index of the landmark.
    pub landmark: usize,
    /// The prior position in the map frame.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::serialized::point"))]
    pub position: Point2<f64>,
    /// Its uncertainty in the map frame.
    pub noise: Noise<2>,
}

/// Odometry or a prior in the form that a problem stores, with the square root of the information.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Prior {
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

impl Prior {
    /// The subjects that it constrains.
    pub(crate) fn subjects(&self) -> [Option<Subject>; 2] {
        match *self {
            Self::Motion { start, end, .. } => {
                [Some(Subject::View(start)), Some(Subject::View(end))]
            }
            Self::Pose { view, .. } => [Some(Subject::View(view)), None],
            Self::Landmark { landmark, .. } => [Some(Subject::Landmark(landmark)), None],
        }
    }

    /// The same with what it knows of positions shifted.
    pub(crate) fn shifted(&self, offset: Vector2<f64>) -> Self {
        let mut shifted = *self;
        match &mut shifted {
            Self::Motion { .. } => {}
            Self::Pose { pose, .. } => pose.translation.vector += offset,
            Self::Landmark { position, .. } => position.coords += offset,
        }
        shifted
    }

    /// The same for renumbered subjects, with all lengths multiplied by a factor.
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
        // Weights of lengths scale inversely; the third column belongs to the heading.
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
