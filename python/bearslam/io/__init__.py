# SPDX-License-Identifier: MIT OR Apache-2.0
"""Files of problems, maps and trajectories, and graphs for GTSAM."""
