#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Refinement from the same starts by bearslam, Ceres and GTSAM: build, run, compare.

    python benches/peers/run.py [--rounds 3] [--repeat 15] [--variants] [--also NAME=COMMAND]

Needs NumPy. A refiner that is not installed is skipped with a message. Install GTSAM by
``pip install gtsam`` (possibly for another interpreter: ``--gtsam-python``), Ceres by
``apt-get install libceres-dev cmake g++``, bearslam by installing this package. ``--also`` adds a
command that takes the file of scenes as its last argument and prints the same lines, one per scene:
m n median_us least_us iterations cost.

All run on one core, one after the other, in several rounds, so that a slow minute of the machine
affects every refiner. For each size, over its scenes:

time        median of the scenes' median times [us]
quiet       median of the scenes' least times [us]: closer to the computation alone, on a busy machine
iterations  median
cost        median sum of squared residuals [rad^2]
arrived     scenes whose cost is within 1e-5 of the lowest that any refiner reached from this start
ratio       time as a multiple of the first refiner's
"""

from __future__ import annotations

import argparse
import os
import shlex
import statistics
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
OUTPUT = HERE.parents[1] / "target" / "peers"
SCENES = OUTPUT / "scenes.txt"
SKIPPED = 77


@dataclass
class Refiner:
    """A command and what it printed: [round][scene] = (median, least, iterations, cost)."""

    name: str
    command: list[str]
    rounds: list[list[tuple[float, ...]]] = field(default_factory=list)
    sizes: list[tuple[int, int]] = field(default_factory=list)

    def run(self) -> bool:
        """Run once over all scenes; False, with the reason on standard error, if that fails."""
        try:
            done = subprocess.run([*self.command, str(SCENES)], capture_output=True, text=True)
        except FileNotFoundError as error:
            print(f"skipped {self.name}: {error}", file=sys.stderr)
            return False
        if done.returncode != 0:
            word = "skipped" if done.returncode == SKIPPED else "FAILED"
            print(f"{word} {self.name}: {done.stderr.strip()}", file=sys.stderr)
            return False
        lines = [line.split() for line in done.stdout.splitlines()]
        self.sizes = [(int(m), int(n)) for m, n, *_ in lines]
        self.rounds.append([tuple(map(float, rest)) for _, _, *rest in lines])
        return True

    def scene(self, k: int) -> tuple[float, float, float, float]:
        """Median time over the rounds, least time, iterations and cost of scene `k`."""
        medians, leasts, iterations, costs = zip(*(scenes[k] for scenes in self.rounds), strict=True)
        return statistics.median(medians), min(leasts), iterations[0], costs[0]


def build_ceres() -> list[str] | None:
    """Path of the program, or None with the reason on standard error."""
    folder = OUTPUT / "build"
    steps = (
        ["cmake", "-S", str(HERE), "-B", str(folder), "-DCMAKE_BUILD_TYPE=Release"],
        ["cmake", "--build", str(folder)],
    )
    for step in steps:
        try:
            done = subprocess.run(step, capture_output=True, text=True)
        except FileNotFoundError:
            print("skipped ceres: cmake is not installed", file=sys.stderr)
            return None
        if done.returncode != 0:
            print(f"skipped ceres: {done.stderr.strip()}", file=sys.stderr)
            return None
    return [str(folder / "ceres_refine")]


def table(refiners: list[Refiner]) -> str:
    """Print one line for every size and refiner."""
    form = "{:>8}  {:<22} {:>9} {:>9} {:>10} {:>12} {:>9} {:>7}"
    lines = [form.format("size", "refiner", "time", "quiet", "iterations", "cost", "arrived", "ratio")]
    sizes = refiners[0].sizes
    if any(refiner.sizes != sizes for refiner in refiners):
        raise SystemExit("the refiners did not report the same scenes")
    for size in dict.fromkeys(sizes):
        scenes = [k for k, other in enumerate(sizes) if other == size]
        best = {k: min(refiner.scene(k)[3] for refiner in refiners) for k in scenes}
        first = None
        for refiner in refiners:
            found = [refiner.scene(k) for k in scenes]
            time, quiet, iterations, cost = (statistics.median(x) for x in zip(*found, strict=True))
            first = first or time
            arrived = sum(x[3] <= best[k] * (1 + 1e-5) + 1e-12 for k, x in zip(scenes, found, strict=True))
            lines.append(
                form.format(
                    f"{size[0]} x {size[1]}",
                    refiner.name,
                    f"{time:.1f}",
                    f"{quiet:.1f}",
                    f"{iterations:g}",
                    f"{cost:.6f}",
                    f"{arrived}/{len(scenes)}",
                    f"{time / first:.2f}",
                )
            )
    return "\n".join(lines)


def main() -> None:
    """Build, run and print."""
    parser = argparse.ArgumentParser(description="Compare refiners from the same starts.")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--repeat", type=int, default=15, help="number of timed runs per scene and round")
    parser.add_argument("--variants", action="store_true", help="also run other solvers of Ceres and GTSAM")
    parser.add_argument("--gtsam-python", default=sys.executable, help="interpreter that has gtsam")
    parser.add_argument("--also", action="append", default=[], metavar="NAME=COMMAND")
    args = parser.parse_args()

    if hasattr(os, "sched_setaffinity"):  # children inherit it
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    subprocess.run([sys.executable, str(HERE / "scenes.py"), str(SCENES)], check=True)

    repeat = ["--repeat", str(args.repeat)]
    extras = [extra.partition("=") for extra in args.also]
    refiners = [Refiner(name, shlex.split(command)) for name, _, command in extras]
    refiners.append(Refiner("bearslam from Python", [sys.executable, str(HERE / "bearslam_refine.py"), *repeat]))
    ceres = build_ceres()
    if ceres is not None:
        refiners.append(Refiner("ceres dense_schur", [*ceres, *repeat]))
        if args.variants:
            refiners += [
                Refiner("ceres dense_normal", [*ceres, *repeat, "--solver", "dense_normal"]),
                Refiner("ceres dense_qr", [*ceres, *repeat, "--solver", "dense_qr"]),
                Refiner("ceres, free gauge", [*ceres, *repeat, "--gauge", "free"]),
            ]
    gtsam = [args.gtsam_python, str(HERE / "gtsam_refine.py"), *repeat]
    refiners.append(Refiner("gtsam sequential", gtsam))
    if args.variants:
        refiners.append(Refiner("gtsam multifrontal", [*gtsam, "--solver", "multifrontal"]))

    for _ in range(args.rounds):
        refiners = [refiner for refiner in refiners if refiner.run()]
    if not refiners:
        raise SystemExit("nothing to compare")
    print(table(refiners))


if __name__ == "__main__":
    main()
