# SPDX-License-Identifier: MIT OR Apache-2.0
"""Feeds workers with seeds, and notices what a worker cannot report: an abort, a hang, a lack of memory."""

from __future__ import annotations

import json
import os
import queue
import select
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .ledger import Ledger, commit
from .worker import SECONDS, Outcome

REPOSITORY = Path(__file__).parents[2]
CHUNK = 1000
"""Seeds per line of the ledger."""
PATIENCE = 300.0
"""Longest wait for an answer [s]: only a process that sleeps takes so long."""
LAST = 2**63
"""A bound of the seeds that is never reached."""
THREADS = (1, 2, 7)
COMPARED = 100
"""One in so many seeds runs on every number of threads; those of a batch or a sweep all do."""


class Worker:
    """A process that runs seeds with a number of threads; started again after it has died."""

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self.process: subprocess.Popen[bytes] | None = None

    def command(self) -> list[str]:
        """What starts the process."""
        return [sys.executable, "-m", "tests.fuzz.worker", str(self.threads)]

    def run(self, seed: int) -> Outcome:
        """The outcome of a seed, whatever becomes of the process."""
        if self.process is None:
            environment = os.environ | {
                "RAYON_NUM_THREADS": str(self.threads),
                "OPENBLAS_NUM_THREADS": "1",
                "RUST_BACKTRACE": "0",
            }
            self.process = subprocess.Popen(
                self.command(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                cwd=REPOSITORY,
                env=environment,
                start_new_session=True,
            )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(f"{seed}\n".encode())
        self.process.stdin.flush()
        ready, _, _ = select.select([self.process.stdout], [], [], PATIENCE)
        line = self.process.stdout.readline() if ready else b""
        if line:
            return Outcome(**json.loads(line))
        code = self._end(kill=not ready)
        if code == -signal.SIGPROF:
            fault = ("hang", f"more than {SECONDS:g} s of processor time")
        elif not ready:
            fault = ("hang", f"no answer within {PATIENCE:g} s")
        else:
            name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            fault = ("abort", f"the process ended with {name}")
        return Outcome(seed, "any", "failed", "", SECONDS if fault[0] == "hang" else 0.0, [fault])

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self._end(kill=True)

    def _end(self, *, kill: bool) -> int:
        """How the process has ended, or ends now."""
        process, self.process = self.process, None
        assert process is not None
        if kill:
            process.kill()
        with process:
            return process.wait()


class Team:
    """Workers of all numbers of threads, whose answers have to agree."""

    def __init__(self) -> None:
        self.workers = [Worker(threads) for threads in THREADS]

    def run(self, seed: int) -> Outcome:
        """The outcome of a seed with one thread, compared with that of more."""
        first, *others = self.workers
        outcome = first.run(seed)
        if outcome.ending != "failed" and (seed % COMPARED == 0 or outcome.verb in ("sweep", "three_view_batch")):
            for other in others:
                again = other.run(seed)
                if again.digest != outcome.digest:
                    outcome.faults.append(("threads", f"other bits on {other.threads} threads: {again.faults}"))
                    outcome.ending = "failed"
        return outcome

    def close(self) -> None:
        """End all processes."""
        for worker in self.workers:
            worker.close()


def chunk(team: Team, first: int, end: int, over: Callable[[], bool]) -> tuple[int, dict[str, Any], list[Outcome]]:
    """Run seeds from `first`: where it stopped, the line of the ledger, and the failures."""
    calls: Counter[str] = Counter()
    failed, higher, slowest, begun, seed = [], [], (0.0, first), time.monotonic(), first
    while seed < end and not over():
        outcome = team.run(seed)
        calls[f"{outcome.verb} {outcome.ending}"] += 1
        slowest = max(slowest, (outcome.seconds, seed))
        if outcome.higher:
            higher.append(seed)
        if outcome.faults:
            failed.append(outcome)
        seed += 1
    line = {
        "calls": calls,
        "seconds": round(time.monotonic() - begun, 3),
        "slowest": round(slowest[0], 3),
        "slowest_seed": slowest[1],
        "higher": higher,
    }
    return seed, line, failed


def run(
    ledger: Ledger,
    seconds: float,
    *,
    workers: int = 2,
    seeds: tuple[int, int] = (0, LAST),
    tell: Callable[[str], None] = print,
) -> list[Outcome]:
    """Run seeds that are not in the ledger until there are no more or the time is over; the failures."""
    until, stopped = time.monotonic() + seconds, threading.Event()
    version = commit()
    results: queue.SimpleQueue[tuple[int, int, dict[str, Any], list[Outcome]]] = queue.SimpleQueue()
    lock = threading.Lock()
    taken = seeds[0]

    def over() -> bool:
        return stopped.is_set() or time.monotonic() >= until

    def work() -> None:
        nonlocal taken
        team = Team()
        try:
            while not over():
                with lock:
                    first, last = ledger.next_free(taken, CHUNK)
                    taken = last = min(last, seeds[1])
                if first >= last:
                    break
                end, line, failed = chunk(team, first, last, over)
                with lock:
                    for one in failed:
                        ledger.add(seed=one.seed, verb=one.verb, faults=one.faults, commit=version)
                    if end > first:
                        ledger.add(first=first, end=end, commit=version, **line)
                results.put((first, end, line, failed))
        finally:
            team.close()

    threads = [threading.Thread(target=work) for _ in range(workers)]
    for thread in threads:
        thread.start()
    failures: list[Outcome] = []
    while any(thread.is_alive() for thread in threads) or not results.empty():
        try:
            first, end, line, failed = results.get(timeout=0.5)
        except queue.Empty:
            continue
        except KeyboardInterrupt:
            # The workers end their inputs, and the ledger keeps what is done.
            stopped.set()
            continue
        failures += failed
        tell(f"{first} to {end}: {len(failed)} failed, {line['seconds']:.0f} s, slowest {line['slowest']:.1f} s")
        for one in failed:
            tell(f"  {one.seed} {one.verb}: {one.faults[0][0]}: {one.faults[0][1][:200]}")
    return failures


def again(ledger: Ledger, tell: Callable[[str], None] = print) -> None:
    """Run the seeds that have failed once more, and note those that are mended."""
    version, team = commit(), Team()
    try:
        for seed, line in sorted(ledger.failures().items()):
            outcome = team.run(seed)
            ledger.add(seed=seed, verb=outcome.verb, faults=outcome.faults, commit=version)
            tell(f"{seed} {line['faults'][0][0]}: {outcome.faults[0] if outcome.faults else 'mended'}")
    finally:
        team.close()
