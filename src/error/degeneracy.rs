// SPDX-License-Identifier: MIT OR Apache-2.0
//! The kinds of degeneracy: what was tested, and what would help.

/// The test that the geometry of the data failed.
///
/// The value of [`Error::Degenerate`](super::Error::Degenerate) is that of [`Degeneracy::quantity`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Degeneracy {
    /// More than one tensor explains the bearings of three views: the landmarks lie on one cubic curve
    /// through them, such as a wall or a circle.
    ThreeViewSystem,
    /// More than one tensor of the projective method explains the bearings of three views.
    ProjectiveSystem,
    /// Two of three views are in one place.
    CoincidentViews,
    /// Three views are on one line, so that the projective method cannot place the third.
    CollinearViews,
    /// A tensor that is zero or not finite.
    VanishingTensor,
    /// A tensor under which every bearing is an epipole.
    VanishingPencil,
    /// A tensor that no three real views have.
    ComplexEpipoles,
    /// Rays that are parallel, or along one line of sight.
    ParallelRays,
    /// All landmarks for a resection are in one place.
    CoincidentLandmarks,
    /// All landmarks for a resection lie in one direction.
    CommonDirection,
    /// A view is on one circle, or one line, with the landmarks for its resection.
    AmbiguousResection,
    /// Bearings that no pose, or no position, explains.
    ContradictoryBearings,
    /// Points that no similarity aligns: one set is a single place, or the sets do not correspond.
    UncorrelatedPoints,
    /// All views and landmarks of a start are in one place.
    CoincidentStart,
    /// All landmarks are on one wall: exact bearings leave a family of maps.
    CollinearLandmarks,
    /// Exact bearings leave a direction of the map free besides the gauge.
    FreeMap,
    /// The best map puts most views into one place and explains nothing, or most landmarks onto views.
    CollapsedMap,
    /// Odometry and priors leave part of the gauge free, although covariances in their frame were requested.
    FreeFrame,
    /// The normal equations of a covariance are singular beyond the free directions.
    SingularNormalEquations,
    /// No hypothesis of a map could be refined.
    NoHypothesis,
    /// Nothing that is known leads to a first map that could be refined.
    NoStart,
    /// No map has redundant sightings.
    NoSpareSighting,
    /// No map has inliers beyond its minimal sample.
    NoSupport,
}

impl Degeneracy {
    /// The name of the kind in snake case, for programs.
    pub const fn name(self) -> &'static str {
        self.texts().0
    }

    /// The quantity that was tested.
    pub const fn quantity(self) -> &'static str {
        self.texts().1
    }

    /// What would help.
    pub const fn advice(self) -> &'static str {
        self.texts().2
    }

    /// Name, quantity, advice.
    const fn texts(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::ThreeViewSystem => (
                "three_view_system",
                "second smallest singular value of the three-view system",
                "add landmarks off their common line or circle, or views from other places",
            ),
            Self::ProjectiveSystem => (
                "projective_system",
                "second smallest singular value of the projective three-view system",
                "add landmarks off their common line or conic, or views from other places",
            ),
            Self::CoincidentViews => (
                "coincident_views",
                "shortest over longest distance between three views",
                "take views from three different places",
            ),
            Self::CollinearViews => (
                "collinear_views",
                "sine of the angle between the epipoles that place the third view",
                "take a view off the line of the others, or use the calibrated method",
            ),
            Self::VanishingTensor => (
                "vanishing_tensor",
                "norm of the tensor",
                "give finite entries that are not all zero",
            ),
            Self::VanishingPencil => (
                "vanishing_pencil",
                "pencil of the intrinsic homographies",
                "take views from different places",
            ),
            Self::ComplexEpipoles => (
                "complex_epipoles",
                "discriminant of the epipoles (complex eigenvalues)",
                "reduce the noise, add landmarks, or use the calibrated method",
            ),
            Self::ParallelRays => (
                "parallel_rays",
                "parallax of the rays",
                "add a view that sees the landmark from the side",
            ),
            Self::CoincidentLandmarks => (
                "coincident_landmarks",
                "spread of the landmarks",
                "add landmarks in other places",
            ),
            Self::CommonDirection => (
                "common_direction",
                "spread of the bearings",
                "add landmarks in other directions",
            ),
            Self::AmbiguousResection => (
                "ambiguous_resection",
                "misfit of the worst rotation in the resection",
                "add a landmark off the line or circle through the view and the others",
            ),
            Self::ContradictoryBearings => (
                "contradictory_bearings",
                "root mean square of the residuals, in radians,",
                "check the sense of rotation (bearings are counter-clockwise), the unit, and which landmark is which",
            ),
            Self::UncorrelatedPoints => (
                "uncorrelated_points",
                "correlation of the points to align",
                "give points that correspond, in at least two places of either frame",
            ),
            Self::CoincidentStart => (
                "coincident_start",
                "extent of the start",
                "start from views and landmarks in different places",
            ),
            Self::CollinearLandmarks => (
                "collinear_landmarks",
                "width over length of the landmarks, which are on one wall,",
                "add three sightings of a landmark off the wall",
            ),
            Self::FreeMap => (
                "free_map",
                "sensitivity of the map to bearing noise, in map sizes per radian,",
                "add landmarks off their common line or circle, or views from other places",
            ),
            Self::CollapsedMap => (
                "collapsed_map",
                "median distance of the views from their middle, or of the landmarks from a view, as a share of the largest,",
                "try another method, and check bearings and identities: the map that was found explains none",
            ),
            Self::FreeFrame => (
                "free_frame",
                "number of directions of the gauge that odometry and priors leave free",
                "add priors that fix position, heading and scale, or choose another frame",
            ),
            Self::SingularNormalEquations => (
                "singular_normal_equations",
                "pivot of the normal equations",
                "add sightings or priors of the undetermined views and landmarks",
            ),
            Self::NoHypothesis => (
                "no_hypothesis",
                "number of hypotheses that could be refined",
                "add landmarks that several views see, off their common line or circle, or views from other places",
            ),
            Self::NoStart => (
                "no_start",
                "number of starts that could be refined",
                "what is known leads to no map: diagnose names what each view lacks; add views of landmarks that several views share, odometry, or more of poses and landmarks, and check their standard deviations",
            ),
            Self::NoSpareSighting => (
                "no_spare_sighting",
                "number of maps with redundant sightings",
                "add sightings of landmarks that several views share",
            ),
            Self::NoSupport => (
                "no_support",
                "number of maps with inliers beyond a minimal sample",
                "check sigma, and add sightings",
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate alloc;

    #[test]
    fn names_are_those_of_the_variants() {
        for kind in [
            Degeneracy::ThreeViewSystem,
            Degeneracy::ProjectiveSystem,
            Degeneracy::CoincidentViews,
            Degeneracy::CollinearViews,
            Degeneracy::VanishingTensor,
            Degeneracy::VanishingPencil,
            Degeneracy::ComplexEpipoles,
            Degeneracy::ParallelRays,
            Degeneracy::CoincidentLandmarks,
            Degeneracy::CommonDirection,
            Degeneracy::AmbiguousResection,
            Degeneracy::ContradictoryBearings,
            Degeneracy::UncorrelatedPoints,
            Degeneracy::CoincidentStart,
            Degeneracy::CollinearLandmarks,
            Degeneracy::FreeMap,
            Degeneracy::CollapsedMap,
            Degeneracy::FreeFrame,
            Degeneracy::SingularNormalEquations,
            Degeneracy::NoHypothesis,
            Degeneracy::NoStart,
            Degeneracy::NoSpareSighting,
            Degeneracy::NoSupport,
        ] {
            let camel: alloc::string::String = kind
                .name()
                .split('_')
                .map(|word| word[..1].to_uppercase() + &word[1..])
                .collect();
            assert_eq!(camel, alloc::format!("{kind:?}"));
        }
    }
}
