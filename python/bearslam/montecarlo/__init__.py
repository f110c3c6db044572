# SPDX-License-Identifier: MIT OR Apache-2.0
"""What `bearslam.sweep` is made of.

From the bottom up: `grid` (cells and chunks), `tally` (counts that add up in any order), `statistics` (what they tell),
`csv_file`, `npz_file` and `files`, `table` and `plot`, `result` (all of it in one object); `executors`, `ledger` and
`checkpoint` (chunks on their way).
"""
