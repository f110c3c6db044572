// SPDX-License-Identifier: MIT OR Apache-2.0
//! Least-squares adjustment of all poses and landmarks at once: residuals, normal equations, refinement.

mod align_to_priors;
mod block;
mod boundary;
pub(crate) mod bundle;
pub(crate) mod cholesky;
pub(crate) mod decompose;
pub(crate) mod elimination;
pub(crate) mod gauge;
pub(crate) mod linear_similarity;
mod newton;
pub(crate) mod normal_equations;
pub(crate) mod prior_rows;
pub(crate) mod refine;
pub(crate) mod schur;
mod sparse;
mod step_solver;

pub(crate) use align_to_priors::aligned_to_priors;
pub(crate) use refine::cost_of_priors;
pub use refine::{Report, refine_map};
