// SPDX-License-Identifier: MIT OR Apache-2.0
//! How a refinement ends.

use core::fmt;

/// How a refinement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Termination {
    /// No refinement was requested.
    NotRefined,
    /// A further step would lower the cost by less than the tolerance.
    Converged,
    /// The residuals are zero up to rounding.
    ZeroResidual,
    /// No step lowers the cost, however much it is damped.
    NoProgress,
    /// The maximum number of iterations was reached.
    MaxIterations,
    /// A full step does not lower the cost, and damping is zero.
    Overshot,
    /// The normal equations are singular beyond the gauge and damping is zero.
    Singular,
}

impl Termination {
    /// Whether the result is a minimum.
    pub fn was_successful(self) -> bool {
        matches!(
            self,
            Self::Converged | Self::ZeroResidual | Self::NoProgress
        )
    }

    /// The name of the variant in lower case with underscores.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotRefined => "not_refined",
            Self::Converged => "converged",
            Self::ZeroResidual => "zero_residual",
            Self::NoProgress => "no_progress",
            Self::MaxIterations => "max_iterations",
            Self::Overshot => "overshot",
            Self::Singular => "singular",
        }
    }
}

/// In words, for example `converged` or `not converged`.
impl fmt::Display for Termination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotRefined => "not refined",
            Self::Converged => "converged",
            Self::ZeroResidual => "converged to zero residuals",
            Self::NoProgress => "no further progress",
            Self::MaxIterations => "not converged",
            Self::Overshot => "overshot",
            Self::Singular => "singular normal equations",
        })
    }
}
