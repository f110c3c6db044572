# SPDX-License-Identifier: MIT OR Apache-2.0
"""Figures of maps, and the viewer. Drawing needs matplotlib or rerun-sdk."""
