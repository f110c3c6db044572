# SPDX-License-Identifier: MIT OR Apache-2.0
"""A process that runs inputs: a line with a seed comes in, a line with the outcome goes out.

Every call has a limit on its processor time; a call that exceeds it, aborts or takes too much memory ends the
process, which the runner notices.
"""

from __future__ import annotations

import json
import resource
import signal
import sys
import time
import traceback
import warnings
from dataclasses import dataclass, field
from typing import Any

import bearslam
from bearslam.errors import BearslamWarning

from . import calls, inputs, oracle
from .inputs import Input

SECONDS = 10.0
"""Longest processor time of one call [s]."""
MEMORY = 4 * 2**30
"""Largest address space of a worker [bytes]."""
REPEATED = 10
"""One in so many seeds is called twice."""
AGAIN = 0.5
"""A call that took longer is not repeated [s]."""


@dataclass
class Outcome:
    """What came of one input: `answered`, `refused`, `degenerate` or `failed`, with the faults."""

    seed: int
    verb: str
    ending: str
    digest: str
    seconds: float
    faults: list[tuple[str, str]] = field(default_factory=list)
    higher: bool = False
    """Whether the refinement of the truth ends lower: no fault of the arithmetic, but counted."""


def run(given: Input, threads: int = 1) -> Outcome:
    """Call, check, and in a share of the seeds call again."""
    begun = time.process_time()
    answer, faults = _answer(given, threads)
    seconds = time.process_time() - begun
    if isinstance(answer, bearslam.BearslamError):
        ending = "degenerate" if isinstance(answer, bearslam.DegenerateError) else "refused"
        faults += oracle.check_error(given, answer)
    elif isinstance(answer, BaseException):
        ending = "failed"
    else:
        ending = "answered"
        faults += oracle.check(given, answer)
    higher = ending == "answered" and _is_higher(given, answer)
    print_of = calls.digest(answer)
    if ending != "failed" and seconds < AGAIN and given.seed % REPEATED == 0:
        again = calls.digest(_answer(given, threads)[0])
        if again != print_of:
            faults.append(("bits", "a second call gives other bits"))
    return Outcome(given.seed, given.verb, "failed" if faults else ending, print_of, seconds, faults, higher)


def _answer(given: Input, threads: int) -> tuple[Any, list[tuple[str, str]]]:
    """What the call returns or raises, and the fault if that is no error of bearslam."""
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        return calls.call(given, threads), []
    except bearslam.BearslamError as error:
        return error, []
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - a panic is none of the usual exceptions
        kind = "panic" if type(error).__name__ == "PanicException" else "exception"
        where = traceback.extract_tb(error.__traceback__)[-1]
        return error, [(kind, f"{type(error).__name__}: {error} ({where.name})")]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def _is_higher(given: Input, answer: Any) -> bool:
    """Whether a complete map of plain squares costs more than the refinement of the truth."""
    plain = {
        "bearings",
        "form",
        "sigma",
        "oriented",
        "odometry",
        "pose_priors",
        "landmark_priors",
        "covariance",
        "seed",
    }
    if given.verb != "solve" or given.truth is None or not set(given.arguments) <= plain or answer.undetermined:
        return False
    start = (given.truth.poses, given.truth.landmarks)
    kept = {name: value for name, value in given.arguments.items() if name not in ("covariance", "seed")}
    best, _ = _answer(Input(given.seed, "refine", kept | {"start": start}), 1)
    return (
        isinstance(best, bearslam.Reconstruction)
        and not best.undetermined
        and best.cost < answer.cost * (1 - 1e-5) - 1e-9
    )


def limit() -> None:
    """Limit this process: memory, no core dumps, an end when a call takes too long, and warnings as errors."""
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", BearslamWarning)


def main() -> None:
    """Serve seeds until the input ends."""
    threads = int(sys.argv[1])
    limit()
    for line in sys.stdin:
        seed = int(line)
        try:
            outcome = run(inputs.make(seed), threads)
        except Exception:  # noqa: BLE001 - of the generator or the oracle, not of bearslam
            outcome = Outcome(seed, "any", "failed", "", 0.0, [("fuzzer", traceback.format_exc(limit=-3))])
        print(json.dumps(vars(outcome)), flush=True)


if __name__ == "__main__":
    main()
