"""`python -m benchmarks [--quick] [M1 M4 ...]`: measure, print, and write docs/benchmarks.md."""

from __future__ import annotations

import argparse
import signal
import sys
import traceback
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

from benchmarks.figures import FULL, QUICK, Effort, Figure
from benchmarks.report import line, machine, markdown
from benchmarks.targets import TARGETS, Target

PAGE: Final = Path(__file__).parents[1] / "docs" / "benchmarks.md"
LIMIT_S: Final = 300  # of one target: what hangs does not keep the others from their figures
DAY_AT_10_MS: Final = 8_640_000


def main() -> int:
    """Run the benchmarks; the page is written by a run over all targets only. 1: a part has failed."""
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer pairs and rounds, a few minutes")
    parser.add_argument("--day", action="store_true", help="the simulated day at T#10ms: an hour more")
    parser.add_argument("targets", metavar="TARGET", nargs="*", help="such as M1 or growth; default: all")
    args = parser.parse_args()
    names = [target.name for target in TARGETS]
    if unknown := set(args.targets) - {*names}:
        parser.error(f"targets: found {sorted(unknown)}, expected some of {' '.join(names)}")
    effort = QUICK if args.quick else FULL
    if args.day:
        effort = replace(effort, scans_a_day=DAY_AT_10_MS)
    facts, failed = machine(), 0
    measured: list[tuple[Target, list[Figure]]] = []
    for target in TARGETS:
        figures: list[Figure] = []
        measured.append((target, figures))
        if not args.targets or target.name in args.targets:
            failed += not _measure(target, effort, figures, 0 if args.day else LIMIT_S)
    if not args.targets:
        given = " ".join(word for word in sys.argv[1:])
        PAGE.write_text(markdown(facts, measured, "make bench" + (f" ARGS={given}" if given else "")))
        print(f"written: {PAGE}")
    return 1 if failed else 0


def _measure(target: Target, effort: Effort, figures: list[Figure], limit_s: int) -> bool:
    """Add the target's figures and print them; what fails is said among them, and False is returned."""
    print(f"{target.name:6} {target.promise}", flush=True)
    try:
        for figure in _within(limit_s, target.measure(effort)):
            figures.append(figure)
            print(line(target, figure), flush=True)
    except Exception as wrong:
        traceback.print_exc()
        figures.append(Figure.missing("the rest", f"{type(wrong).__name__}: {wrong}"))
        return False
    return True


def _within(limit_s: int, figures: Iterator[Figure]) -> Iterator[Figure]:
    """Yield the figures; TimeoutError where they take too long together (not on Windows)."""

    def too_long(number: int, frame: object) -> None:
        signal.alarm(limit_s)  # for what is tried after it
        raise TimeoutError(f"longer than {limit_s} s")

    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, too_long)
        signal.alarm(limit_s)
    try:
        yield from figures
    finally:
        if hasattr(signal, "SIGALRM"):
            signal.alarm(0)


if __name__ == "__main__":
    sys.exit(main())
