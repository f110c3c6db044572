// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options of the stages with odometry and priors: starts, growth, sweeps.

use crate::lm::Loss;

/// Options of the choice of starts with odometry and priors.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct PosteriorOptions {
    /// With more views than this a plausible cost is enough: no wrong minimum of so many bearings has so low a cost.
    /// With fewer, the map from bearings alone takes little time and is always tried. Half changes nothing; double
    /// fails on four of 44 scenes fewer and takes at least seven times as long.
    pub many_views: usize,
    /// Refinements of a map, each of which may make room for what did not fit before.
    pub completions: usize,
    /// Maximum number of iterations of each start: what takes more goes on only when it may become the best.
    pub first_iterations: usize,
    /// Most starts that go on then.
    pub finished: usize,
    /// Growths with other choices where the best map leaves something out or is too costly.
    pub regrowths: usize,
    /// Ranges at which all landmarks start together where rays hardly spread, in units of the distance that the views may
    /// have moved.
    pub far_radii: [f64; 3],
}

impl Default for PosteriorOptions {
    fn default() -> Self {
        Self {
            many_views: 40,
            completions: 3,
            first_iterations: 100,
            finished: 3,
            regrowths: 48,
            far_radii: [3.0, 10.0, 30.0],
        }
    }
}

/// Options of the growth along odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct OdometryGrowthOptions {
    /// Number of views at which a piece is refined for the first time: with fewer, hardly any landmark is determined.
    /// Not sensitive.
    pub first_views: usize,
    /// Maximum number of iterations of each refinement during growth: a piece only has to stay near its minimum. Not
    /// sensitive.
    pub iterations: usize,
    /// Parallax (smaller over larger singular value of the directions of the rays) below which a landmark of a growing
    /// piece is not placed yet: rays that spread by less than six degrees determine its range badly. Not sensitive.
    pub min_parallax: f64,
    /// Minimum number of shared landmarks to join two pieces: two determine a similarity. Not sensitive.
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

/// Options of the search for the headings of views whose positions are known.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct HeadingOptions {
    /// Headings of each of two views that are tried: five degrees apart.
    pub headings: usize,
    /// Angle \[rad\] at which two headings agree by half: about what a step of the grid changes.
    pub half_agreed: f64,
    /// Views that are looked at, those first that see most landmarks: others are placed by what these find.
    pub views: usize,
    /// Pairs of views that are tried, those with most checks first.
    pub pairs: usize,
    /// Local minima over the grids of all pairs that become maps.
    pub maps: usize,
}

impl Default for HeadingOptions {
    fn default() -> Self {
        Self {
            headings: 72,
            half_agreed: 0.1,
            views: 40,
            pairs: 4,
            maps: 8,
        }
    }
}

/// Options of the growth along odometry by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct StrideOptions {
    /// A piece is refined again after it has grown by one view for every this many that it had. Not sensitive.
    pub part: usize,
    /// Minimum number of views added between refinements. Not sensitive.
    pub shortest: usize,
    /// Maximum number of views added between refinements: after longer dead reckoning a refinement may not converge.
    /// Not sensitive.
    pub longest: usize,
    /// Tolerance of the refinements during growth, relative to the cost. Not sensitive.
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
    /// A piece is refined again after it has grown by one view for every this many that it had: more often than with
    /// least squares, because an outlier misleads whatever is placed after it. Not sensitive.
    pub part: usize,
    /// Maximum number of pairs of shared landmarks that are tried to join two pieces. Not sensitive.
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
    /// Maximum number of rounds: each lowers the cost, so they end by themselves. Not sensitive.
    pub rounds: usize,
    /// Another round follows when the last one lowered the cost by more than this: the cost of an outlier. Not
    /// sensitive.
    pub worth: f64,
    /// Bounds, in standard deviations, that are each tried once for the selection of inliers: narrow ones exclude
    /// outliers that have bent the map, wide ones readmit good bearings that such outliers have pushed out. Not
    /// sensitive.
    pub bounds: [f64; 4],
}

impl Default for OdometrySweepOptions {
    fn default() -> Self {
        let outlier = Loss::<f64>::TRUNCATED;
        Self {
            rounds: 10,
            worth: outlier * outlier / 2.0,
            bounds: [2.0, 4.5, 9.0, 20.0],
        }
    }
}
