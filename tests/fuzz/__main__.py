# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command line: run, replay a seed or a kept input, run what failed again, and print the table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from . import inputs, kept, runner, show, shrink
from .ledger import Ledger


def main() -> int:
    """Run the chosen command; 1 if anything failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="run seeds that are not in the ledger")
    run.add_argument("--minutes", type=float, default=10.0, help="how long (default: %(default)s)")
    run.add_argument("--workers", type=int, default=2, help="how many inputs at a time (default: %(default)s)")
    run.add_argument("--seed-from", type=int, default=0, help="lowest seed (default: %(default)s)")
    run.add_argument("--seed-to", type=int, default=runner.LAST, help="end of the seeds (default: none)")
    again = commands.add_parser("again", help="run what failed once more, and note what is mended")
    summary = commands.add_parser("summary", help="print the table for the documentation")
    for one in (run, again, summary):
        one.add_argument("--ledger", type=Path, default=Path("fuzz.jsonl"), help="file (default: %(default)s)")
    replay = commands.add_parser("replay", help="print an input as Python code, and what goes wrong")
    replay.add_argument("input", help="seed, or FILE of a kept input")
    replay.add_argument("--keep", type=Path, metavar="FILE", help="write the input that is printed; .json")
    replay.add_argument("--shrink", action="store_true", help="look for a smaller input that fails in the same way")
    options = parser.parse_args()
    match options.command:
        case "run":
            ledger = Ledger(options.ledger)
            seeds = (options.seed_from, options.seed_to)
            failures = runner.run(ledger, 60 * options.minutes, workers=options.workers, seeds=seeds)
            print(ledger.summary())
            return bool(failures)
        case "again":
            ledger = Ledger(options.ledger)
            runner.again(ledger)
            return bool(ledger.failures())
        case "summary":
            print(Ledger(options.ledger).summary())
            return 0
    return _replay(options.input, smaller=options.shrink, keep=options.keep)


def _replay(name: str, *, smaller: bool, keep: Path | None) -> int:
    """Print an input, or a smaller one like it, and its faults."""
    given = inputs.make(int(name)) if name.isdecimal() else kept.read(Path(name))
    if smaller or not name.isdecimal():
        prober = shrink.Prober()
        given = shrink.shrink(given, prober.kind_of) if smaller else given
        faults = prober.faults(given)
        prober.close()
    else:
        team = runner.Team()
        faults = team.run(given.seed).faults
        team.close()
    print(show.code(given))
    print(f"# wild changes: {given.wild}; layout: {given.truth.layout if given.truth else 'unknown'}")
    for kind, text in faults:
        print(f"# {kind}: {text}")
    if keep:
        kept.write(given, keep)
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
