// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the work with odometry and priors: starts, growth, sweeps.

use crate::lm::Loss;

/// Options of the choice of starts with odometry and priors.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct PosteriorOptions {
    /// Views beyond which a plausible cost is enough: no wrong minimum of so many bearings comes so low. With fewer,
    /// the map from bearings alone costs little and is always tried.
    pub many_views: usize,
}

impl Default for PosteriorOptions {
    fn default() -> Self {
        Self { many_views: 40 }
    }
}

/// Options of the growth along odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct OdometryGrowthOptions {
    /// Views after which a piece is refined for the first time: with fewer its landmarks are hardly placed yet.
    pub first_views: usize,
    /// Most iterations of each refinement on the way: a piece only has to stay near its minimum.
    pub iterations: usize,
    /// Parallax (smaller over larger singular value of the directions of the rays) below which a landmark of a
    /// growing piece has to wait: rays that spread by less than six degrees determine its range badly.
    pub min_parallax: f64,
    /// Fewest shared landmarks that lay one piece over another: as many as fix a similarity.
    pub min_shared: usize,
}

impl Default for OdometryGrowthOptions {
    fn default() -> Self {
        Self {
            first_views: 6,
            iterations: 8,
            min_parallax: 0.05,
            min_shared: 2,
        }
    }
}

/// Options of the growth along odometry by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct StrideOptions {
    /// A piece is refined again when it has grown by one view for so many that it had.
    pub part: usize,
    /// The fewest views by which it grows in between.
    pub shortest: usize,
    /// The most views by which it grows in between: a long way by odometry alone leads out of the reach of the refinement.
    pub longest: usize,
    /// Tolerance of the refinements on the way, relative to the cost.
    pub tolerance: f64,
}

impl Default for StrideOptions {
    fn default() -> Self {
        Self {
            part: 20,
            shortest: 10,
            longest: 100,
            tolerance: 1e-2,
        }
    }
}

/// Options of the robust growth along odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RobustGrowthOptions {
    /// A piece is refined again when it has grown by one view for so many that it had: more often than by least squares, because
    /// a wrong bearing leads astray whatever is placed after it.
    pub part: usize,
    /// Most pairs of shared landmarks by which it is tried to lay one piece over another.
    pub pairs: usize,
}

impl Default for RobustGrowthOptions {
    fn default() -> Self {
        Self {
            part: 4,
            pairs: 128,
        }
    }
}

/// Options of the sweeps along odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct OdometrySweepOptions {
    /// Most rounds: each lowers the cost, so they end by themselves.
    pub rounds: usize,
    /// A round is worth another when it has lowered the cost by more than this: that of an outlier.
    pub worth: f64,
    /// Tolerance of the refinement with Cauchy's loss: it only has to identify the inliers.
    pub cauchy_tolerance: f64,
    /// Bounds, in standard deviations, that are each tried once for the choice of the inliers: narrow ones leave out
    /// what has bent the map, wide ones take back what that has pushed out.
    pub bounds: [f64; 4],
}

impl Default for OdometrySweepOptions {
    fn default() -> Self {
        let outlier = Loss::<f64>::TRUNCATED;
        Self {
            rounds: 10,
            worth: outlier * outlier / 2.0,
            cauchy_tolerance: 1e-5,
            bounds: [2.0, 4.5, 9.0, 20.0],
        }
    }
}
