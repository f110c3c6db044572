# SPDX-License-Identifier: MIT OR Apache-2.0
"""What is given, what is asked for and what is found: types and their checks, no files and no drawing."""
