"""`python -m benchmarks [--quick] [M1 M4 ...]`: measure, print, and write docs/benchmarks.md."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Final

from benchmarks.figures import FULL, QUICK, Effort, Figure
from benchmarks.machine import facts
from benchmarks.report import lines, markdown
from benchmarks.targets import TARGETS, Target

PAGE: Final = Path(__file__).parents[1] / "docs" / "benchmarks.md"


def main() -> int:
    """Run the benchmarks; the page is written by a run over all targets only."""
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer pairs and rounds, under 40 s")
    parser.add_argument("targets", metavar="TARGET", nargs="*", help="such as M1; default: all")
    args = parser.parse_args()
    unknown = set(args.targets) - {target.name for target in TARGETS}
    if unknown:
        parser.error(f"targets: found {sorted(unknown)}, expected some of M1 .. M{len(TARGETS)}")
    machine = facts()
    measured = [(target, _measure(target, QUICK if args.quick else FULL, args.targets)) for target in TARGETS]
    if not args.targets:
        PAGE.write_text(markdown(machine, measured, "make bench" + (" ARGS=--quick" if args.quick else "")))
        print(f"written: {PAGE}")
    return 0


def _measure(target: Target, effort: Effort, chosen: list[str]) -> list[Figure]:
    wanted = not chosen or target.name in chosen
    figures = list(target.measure(effort)) if target.measure and wanted else []
    print(*lines(target, figures), sep="\n", flush=True)
    return figures


if __name__ == "__main__":
    sys.exit(main())
