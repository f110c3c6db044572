# SPDX-License-Identifier: MIT OR Apache-2.0
"""Problems, options and estimates: types and their checks, without files or figures."""
