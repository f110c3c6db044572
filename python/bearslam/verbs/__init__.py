# SPDX-License-Identifier: MIT OR Apache-2.0
"""What a user calls: one file a function, or a family of functions."""
