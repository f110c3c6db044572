# SPDX-License-Identifier: MIT OR Apache-2.0
"""`python -m bearslam` is the command `bearslam`."""

import sys

from bearslam.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
