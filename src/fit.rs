// SPDX-License-Identifier: MIT OR Apache-2.0
//! Test of the fit: whether the residuals of a map are what the stated standard deviations predict, and which
//! observation is at fault; positions from known poses or landmarks with both.

mod alarm;
mod data_snooping;
pub(crate) mod distributions;
mod expected_error;
mod fix;
mod global_test;
mod left_out;
mod redundancy;
mod test;
mod wrong_sensor;

pub use alarm::{Alarm, Observation, TestOptions};
pub use expected_error::expected_error;
pub use fix::Fix;
pub use global_test::GlobalTest;
pub use redundancy::{Checked, Redundancy, redundancy};
pub use test::{FitTest, test_fit};
