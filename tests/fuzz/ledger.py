# SPDX-License-Identifier: MIT OR Apache-2.0
"""The ledger: a JSON line for each range of seeds that is done, with commit and counts, and one for each failure."""

from __future__ import annotations

import hashlib
import json
import subprocess
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bearslam

from .inputs import GENERATOR

Range = tuple[int, int]


class Ledger:
    """A file to which ranges and failures are appended; what is in it is not run again."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines: list[dict[str, Any]] = []
        if path.exists():
            # A run that was killed may have left half a line.
            for line in path.read_text().splitlines():
                try:
                    self.lines.append(json.loads(line))
                except json.JSONDecodeError:
                    continue
            if not path.read_bytes().endswith(b"\n"):
                self._write("\n")

    def _write(self, text: str) -> None:
        with self.path.open("a") as file:
            file.write(text)

    def add(self, **line: Any) -> None:
        """Append one line."""
        full = {"generator": GENERATOR, **line}
        self.lines.append(full)
        self._write(json.dumps(full) + "\n")

    def ranges(self) -> list[Range]:
        """The ranges of seeds that are done by the present generator, merged."""
        own = [line for line in self.lines if line["generator"] == GENERATOR and "first" in line]
        return merged((line["first"], line["end"]) for line in own)

    def next_free(self, low: int, most: int) -> Range:
        """The first range from `low` of at most so many seeds that are not done."""
        high = low + most
        for first, end in self.ranges():
            if first <= low < end:
                low, high = end, end + most
            elif low < first:
                return low, min(high, first)
        return low, high

    def failures(self) -> dict[int, dict[str, Any]]:
        """The last failure of each seed that has not been mended since."""
        found: dict[int, dict[str, Any]] = {}
        for line in self.lines:
            if line["generator"] == GENERATOR and "seed" in line:
                if line["faults"]:
                    found[line["seed"]] = line
                else:
                    found.pop(line["seed"], None)
        return found

    def summary(self) -> str:
        """The table for the documentation."""
        done = [line for line in self.lines if "first" in line]
        calls: Counter[str] = Counter()
        for line in done:
            calls.update(line["calls"])
        seeds = sum(line["end"] - line["first"] for line in done)
        kinds = Counter(line["faults"][0][0] for line in self.failures().values())
        slowest = max((line["slowest"] for line in done), default=0.0)
        hours = sum(line["seconds"] for line in done) / 3600
        commits = list(dict.fromkeys(line["commit"] for line in done))
        higher = sum(len(line["higher"]) for line in done)
        rows = ["| verb | answered | degenerate | refused | failed |", "|---|---|---|---|---|"]
        for verb in sorted({name.split()[0] for name in calls}):
            counts = [calls[f"{verb} {ending}"] for ending in ("answered", "degenerate", "refused", "failed")]
            rows.append(f"| `{verb}` | " + " | ".join(map(str, counts)) + " |")
        return "\n".join(
            [
                f"{seeds} inputs, {hours:.1f} hours, slowest call {slowest:.1f} s, commits {', '.join(commits)}",
                f"maps that cost more than the refinement of the truth: {higher}",
                "open failures: " + (", ".join(f"{count} {kind}" for kind, count in kinds.most_common()) or "none"),
                "",
                *rows,
            ]
        )


def merged(ranges: Iterable[Range]) -> list[Range]:
    """Ranges in ascending order, those that touch as one."""
    whole: list[Range] = []
    for first, end in sorted(ranges):
        if whole and first <= whole[-1][1]:
            whole[-1] = (whole[-1][0], max(end, whole[-1][1]))
        else:
            whole.append((first, end))
    return whole


def commit() -> str:
    """The commit of the tests, and a digest of the compiled core that they run."""
    here = Path(__file__).parent
    git = ["git", "-C", str(here)]
    try:
        head = subprocess.run([*git, "rev-parse", "--short=9", "HEAD"], capture_output=True, text=True, check=True)
        head = head.stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        head = "unknown"
    core = Path(bearslam._core.__file__).read_bytes()
    return f"{head} (core {hashlib.sha256(core).hexdigest()[:8]})"
