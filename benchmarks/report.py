"""The figures in words: a line each on the screen, a table in docs/benchmarks.md."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from benchmarks.figures import Figure
from benchmarks.targets import Aim, Target, aim_of

Measured = Sequence[tuple[Target, Sequence[Figure]]]

SKIPPED: Final = "left out in this run"
UNSAID: Final = "not looked into yet"
INTRODUCTION: Final = """# Benchmarks

Written by `make bench`. Every ratio is taken in short alternating slices of one run, ours against its
reference: the median of the pairs [10th .. 90th percentile]. Only such ratios mean something on another
machine; absolute figures stand in the notes and are no promise. Aims are no gates: what is reached is
reported as it is. "Before": measured before, on a machine of this kind.

An overrun is the engine's when more processor time than an interval was used from the end of the scan before
to the end of this one, work between the scans included; with less the scan would have ended in time, had it
not waited for the processor: that overrun is the machine's. "Machine limit": the bare system calls alone take
more than 60 % of the interval.
"""


def line(target: Target, figure: Figure) -> str:
    """Return the screen's line for one figure."""
    aim = aim_of(target, figure)
    text = f"  aim {aim.text}: {aim.verdict(figure)}" if aim and aim.text else ""
    return f"       {figure.case:42} {figure.value}{text}" + (f"  ({figure.note})" if figure.note else "")


def markdown(facts: Sequence[str], measured: Measured, command: str) -> str:
    """Return the page: machine facts, every target with every figure, and what stands in the way."""
    rows = [
        "| target | case | before | reached | aim | | notes |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    missed = []
    for target, figures in measured:
        rows.append(f"| **{target.name}** | *{target.promise}* | | {'' if figures else SKIPPED} | | | |")
        for figure in figures:
            aim = aim_of(target, figure) or Aim(figure.case, "")
            verdict = aim.verdict(figure)
            cells = (figure.case, aim.before, figure.value, aim.text, verdict, figure.note)
            rows.append(f"| | {' | '.join(cells)} |")
            if verdict not in ("", "reached"):
                missed.append(f"* {target.name}, {figure.case}: {aim.in_the_way or UNSAID}")
    parts = {
        "Machine": "\n".join(f"* {fact}" for fact in (*facts, f"command: `{command}`")),
        "Figures": "\n".join(rows),
        "What stands in the way": "\n".join(missed) or "Every aim is reached.",
    }
    return INTRODUCTION + "".join(f"\n## {title}\n\n{text}\n" for title, text in parts.items())


def machine() -> list[str]:
    """Return cores, processor, kernel, Python, and the load now."""
    load = f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "unknown"
    return [
        f"{os.cpu_count()} cores, {_processor()}",
        f"{platform.system()} {platform.release()}, {platform.machine()}",
        f"{platform.python_implementation()} {platform.python_version()}",
        f"load when the run began: {load}",
    ]


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return platform.processor() or "unknown processor"
    names = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return names[0] if names else "unknown processor"
