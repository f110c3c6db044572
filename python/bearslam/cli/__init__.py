# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam`: one parser and one run function per command."""

from bearslam.cli.main import main

__all__ = ["main"]
