# SPDX-License-Identifier: MIT OR Apache-2.0
"""The parts of `bearslam.sweep`.

From the bottom up: `grid` (cells and chunks), `tally` (counts that add up in any order), `statistics` of them, `result`
(both with names on every axis), `table`, `plot` and `files`, `sweep_result` (all of it in one object); `executors`,
`ledger` and `checkpoint` for chunks while they are computed.
"""
