# SPDX-License-Identifier: MIT OR Apache-2.0
"""The functions that a user calls, one file per function or family of functions."""
