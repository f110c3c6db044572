// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a diagnosis decides by: each threshold with its unit and reason.
//!
//! *Not sensitive* is measured: half and double give the same findings for every scene of the table of degenerate
//! configurations and of its harmless relatives, exact and with noise of 0.1 degrees, and for random sparse scenes with
//! and without odometry; 756 diagnoses. Numbers on which no finding depends (rounding, steps of an iteration that
//! has converged) stand where they are used.

/// Options of [`diagnose_with`](crate::diagnose_with).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct DiagnosisOptions {
    /// How a map is examined.
    pub shapes: ShapeOptions,
    /// Which map is looked at.
    pub maps: MapOptions,
    /// What is said of it.
    pub verdict: VerdictOptions,
}

/// When a direction is weak, and when a map has a shape that explains it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct ShapeOptions {
    /// A direction is weak when the predicted standard deviation of the map along it exceeds this share of its size.
    /// A fifth: beyond it the linearization that predicts it is worth little. The same as the bound of
    /// [`Reconstruction::uncertainty`](crate::Reconstruction::uncertainty).
    pub weak: f64,
    /// It is weak, too, when that of one point exceeds this share of the point's unit, which is the size of the map
    /// or its mean distance from what it sees or is seen by. Half: twice that reaches to where it is seen from.
    pub weak_point: f64,
    /// A shape explains a direction when more than this share of the square of the direction lies in what the shape
    /// leaves free. Half, so that two shapes with nothing in common never explain the same one.
    pub explained: f64,
    /// A point moves alone in a direction when it has this share of the squared moves. All but a tenth: then the
    /// others move by less than a third of its length together.
    pub alone: f64,
    /// Most causes that are looked for one by one after those of the whole map. Not sensitive.
    pub causes: usize,
    /// Points are off a shape by at most this many predicted standard deviations more than is usual for their number.
    /// Four: one map in ten thousand that has the shape is missed. Half changes five diagnoses,
    /// double none.
    pub sigmas: f64,
    /// Points are off a shape by at most this part of their units, whatever the noise. A tenth: what is farther off
    /// is weak for another reason than the shape. Half changes four diagnoses, double one.
    pub nearly: f64,
    /// Noise \[rad\] above which no shapes are looked for. Six degrees: points scatter by [`nearly`](Self::nearly) of
    /// their range, so anything looks like any shape.
    pub max_noise: f64,
    /// How far points are moved for a map of the same kind without any shape, in their units. Well below a tenth, so
    /// that the map stays the same otherwise, and far above the rounding by which shapes are told. Not sensitive.
    pub jitter: f64,
    /// Most parameters of a map whose singular values are all computed: the decomposition takes some seconds and
    /// memory for their square.
    pub max_parameters: usize,
    /// Most sightings times that square: also some seconds.
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

/// Which map is looked at: one that is given, one that the search finds, or another that explains the bearings as well
/// and shows more.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct MapOptions {
    /// Two maps explain the bearings equally well up to this ratio of their residuals. Three: with few sightings beyond
    /// the unknowns, residuals of equally good maps differ that much by chance. Half changes nothing, double one
    /// diagnosis.
    pub as_good: f64,
    /// Rays are parallel when they differ by at most this many standard deviations of a bearing: a bit more than four
    /// of a difference of two, which is `sqrt(2)` as uncertain. Not sensitive.
    pub parallel: f64,
    /// Bearings agree with a shape when they are off by at most this many standard deviations. Four: one bearing in
    /// ten thousand is farther off. Half changes four diagnoses, double none.
    pub sigmas: f64,
    /// Most noise \[rad\] for which shapes are looked for in the bearings themselves when no standard deviation is
    /// stated. Half a degree: the noise that follows from a map may be that of a wrong minimum. Not sensitive.
    pub max_unstated_noise: f64,
    /// Triples of views that are drawn to find the one that shares most landmarks. Not sensitive.
    pub start_triples: usize,
    /// Triples of views from whose tensors maps are made where the search has failed: of a degenerate problem most will
    /// do. Not sensitive.
    pub triples: usize,
    /// Places on the circle of tensors of each triple that become maps. Not sensitive.
    pub places: usize,
    /// Maps that are refined, those of the least cost first. Not sensitive.
    pub refined: usize,
    /// Iterations by which a member of a family of maps is refined. Few: it shall agree with the bearings again and not
    /// move along the family. Not sensitive.
    pub member_iterations: usize,
    /// Their first damping, far above the default of a refinement for the same reason. Not sensitive.
    pub member_damping: f64,
    /// Landmarks off a line by at most this part of their extent are looked at as a wall. A tenth, as for all shapes.
    /// Not sensitive.
    pub wall: f64,
    /// Members of the family of a wall that are compared before the best is refined. Not sensitive.
    pub members: u32,
    /// Views are looked at as a line when the way from one to the next turns by at most this angle \[rad\], root mean
    /// square. About twice what a tenth of the distance makes. Half changes nothing, double two
    /// diagnoses.
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

/// What is said of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct VerdictOptions {
    /// Residuals \[rad\], root mean square, above which a map is no evidence: six degrees, as
    /// [`ShapeOptions::max_noise`].
    pub max_rms: f64,
    /// A second map whose residuals are less than this many times those of the best leaves a doubt. As
    /// [`MapOptions::as_good`]; half changes two diagnoses, double none.
    pub clear_margin: f64,
    /// Singular values that are reported. No finding depends on it.
    pub singular_values: usize,
    /// Weakest directions that are computed where not all are. A map with more free ones is all but undetermined.
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
