// SPDX-License-Identifier: MIT OR Apache-2.0
//! Thresholds of a diagnosis, each with its unit and reason.
//!
//! `cargo bench --bench thresholds --features rayon,serde -- 6 0 diagnosis` counts the diagnoses whose findings change
//! with half and with double of each value, of 618: the degenerate configurations of the tests and similar regular
//! ones, exact with and without a map and with noise of 0.1 degrees, and random sparse scenes with and without
//! odometry. *Not sensitive*: none changes. Numbers on which no finding depends (rounding, steps of an iteration that
//! has converged) are defined where they are used.

/// All thresholds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct DiagnosisOptions {
    /// How a map is examined.
    pub shapes: ShapeOptions,
    /// Which map is examined.
    pub maps: MapOptions,
    /// What is reported.
    pub verdict: VerdictOptions,
}

/// When a direction is weak, and when a map has a shape that explains it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct ShapeOptions {
    /// A direction is weak when the predicted standard deviation of the map along it exceeds this fraction of its size.
    /// A fifth: above that the linearisation behind the prediction is unreliable. The same as the bound of
    /// [`Reconstruction::uncertainty`](crate::Reconstruction::uncertainty). Half changes nothing, double one diagnosis.
    pub weak: f64,
    /// It is also weak when the standard deviation of one point exceeds this fraction of the point's unit, the larger
    /// of the size of the map and its mean distance from what it sees or is seen by. Half: two standard deviations then
    /// reach to where it is seen from. Half changes one diagnosis, double none.
    pub weak_point: f64,
    /// A shape explains a direction when more than this fraction of its squared length lies in the null space of the
    /// shape. Half, so that two shapes with orthogonal null spaces never explain the same direction. Half changes
    /// nothing; with double no shape explains anything, which changes 144 diagnoses.
    pub explained: f64,
    /// A point moves alone in a direction when it has this fraction of the squared moves. All but a tenth: the others
    /// together then move by less than a third of its move. Not sensitive.
    pub alone: f64,
    /// Maximum number of causes that are sought one by one after those of the whole map. Not sensitive.
    pub causes: usize,
    /// Points fit a shape when they are off it by at most this many predicted standard deviations more than expected
    /// for their number. Four: one map in ten thousand that has the shape is missed. Half changes two diagnoses, double
    /// one.
    pub sigmas: f64,
    /// Points fit a shape only when they are off it by at most this fraction of their units, whatever the noise. A
    /// tenth: a map farther off is weak for another reason than the shape. Half changes nothing, double one diagnosis.
    pub nearly: f64,
    /// Noise \[rad\] above which no shapes are sought. Six degrees: points scatter by [`nearly`](Self::nearly) of their
    /// range, so that everything fits any shape. Not sensitive.
    pub max_noise: f64,
    /// How far points are moved, in their units, to get a similar map without any shape. Well below a tenth, so that
    /// the map stays the same otherwise, and far above the rounding that exact shapes may have. Not sensitive.
    pub jitter: f64,
    /// Maximum number of parameters of a map whose singular values are all computed: the decomposition takes seconds,
    /// and memory for their square. Not reached in what was measured.
    pub max_parameters: usize,
    /// Maximum number of sightings times that square, for the same reason. Not reached either.
    pub max_work: usize,
}

impl Default for ShapeOptions {
    fn default() -> Self {
        Self {
            weak: 0.2,
            weak_point: 0.5,
            explained: 0.5,
            alone: 0.9,
            causes: 8,
            sigmas: 4.0,
            nearly: 0.1,
            max_noise: 0.1,
            jitter: 0.03,
            max_parameters: 600,
            max_work: 2_000_000_000,
        }
    }
}

impl ShapeOptions {
    /// Whether a direction is weak, by its predicted standard deviation and that of the point that moves most.
    pub fn is_weak(&self, deviation: f64, largest: f64) -> bool {
        deviation > self.weak || largest > self.weak_point
    }
}

/// Which map is examined: a given one, one that the search finds, or another that explains the bearings as well and
/// whose shape explains more.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct MapOptions {
    /// Two maps explain the bearings equally well up to this ratio of their residuals. Three: with few sightings beyond
    /// the unknowns, residuals of equally good maps differ that much by chance. Not sensitive.
    pub as_good: f64,
    /// Rays are parallel when they differ by at most this many standard deviations of a bearing: a bit more than four
    /// of a difference of two, which is `sqrt(2)` as uncertain. Not sensitive.
    pub parallel: f64,
    /// Bearings agree with a shape when they are off by at most this many standard deviations. Four: one bearing in ten
    /// thousand is farther off. Half changes 13 diagnoses, double none.
    pub sigmas: f64,
    /// Bound \[rad\] on the noise with which shapes are sought in the bearings themselves when no standard deviation is
    /// stated. Half a degree: noise estimated from a map may be that of a wrong minimum. Not sensitive.
    pub max_unstated_noise: f64,
    /// Triples of views that are drawn to find the one that shares most landmarks. Not sensitive.
    pub start_triples: usize,
    /// Triples of views from whose tensors maps are made when the search has failed: in a degenerate problem most of
    /// them serve. Not sensitive.
    pub triples: usize,
    /// Places on the circle of tensors of each triple that become maps. Not sensitive.
    pub places: usize,
    /// Maps that are refined, those of the least cost first. Not sensitive.
    pub refined: usize,
    /// Iterations to refine a member of a family of maps. Few: it has to agree with the bearings again without moving
    /// along the family. Half changes one diagnosis, double two.
    pub member_iterations: usize,
    /// Initial damping of these iterations, far above the default for the same reason. Half changes nothing, double one
    /// diagnosis.
    pub member_damping: f64,
    /// Landmarks off a line by at most this fraction of their extent are treated as a wall. A tenth, as for all shapes.
    /// Not sensitive.
    pub wall: f64,
    /// Grid of members of the family of a wall from which the search for the best one starts. Half changes nothing,
    /// double one diagnosis.
    pub members: u32,
    /// Views are treated as a line when the path from one to the next turns by at most this angle \[rad\], root mean
    /// square. About twice the turn caused by an offset of a tenth of the distance. Not sensitive.
    pub straight: f64,
}

impl Default for MapOptions {
    fn default() -> Self {
        Self {
            as_good: 3.0,
            parallel: 6.0,
            sigmas: 4.0,
            max_unstated_noise: 0.01,
            start_triples: 24,
            triples: 3,
            places: 24,
            refined: 12,
            member_iterations: 4,
            member_damping: 1e-2,
            wall: 0.1,
            members: 64,
            straight: 0.2,
        }
    }
}

/// What is reported about a map.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct VerdictOptions {
    /// Residuals \[rad\], root mean square, above which a map is no evidence: six degrees, as
    /// [`ShapeOptions::max_noise`]. Not sensitive.
    pub max_rms: f64,
    /// The solution is ambiguous when a second map has residuals less than this many times those of the best. As
    /// [`MapOptions::as_good`]. Not sensitive.
    pub clear_margin: f64,
    /// Number of singular values that are reported. No finding depends on it.
    pub singular_values: usize,
    /// Number of weakest directions computed when not all are. A map with more free ones is almost undetermined. Not
    /// sensitive.
    pub directions: usize,
}

impl Default for VerdictOptions {
    fn default() -> Self {
        Self {
            max_rms: 0.1,
            clear_margin: 3.0,
            singular_values: 8,
            directions: 12,
        }
    }
}
