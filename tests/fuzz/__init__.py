# SPDX-License-Identifier: MIT OR Apache-2.0
"""A fuzzer of the many-view API: plausible problems with all combinations of options, checked by numpy.

    python -m tests.fuzz run --minutes 10 --ledger fuzz.jsonl

One seed is one input: `inputs` makes it, `calls` hands it to bearslam, `oracle` checks what came back, `worker` does
this in a process of its own, `runner` feeds the workers, and `ledger` keeps which seeds are done and what failed.
"""
