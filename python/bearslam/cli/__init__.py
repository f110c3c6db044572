# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam`: a parser and a run for each command."""

from bearslam.cli.main import main

__all__ = ["main"]
