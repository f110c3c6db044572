# SPDX-License-Identifier: MIT OR Apache-2.0
"""Pictures of maps, and the viewer. What draws needs matplotlib or rerun-sdk."""
