# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam`: one parser and one run function per command."""
