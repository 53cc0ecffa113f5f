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
UNSAID: Final = "not examined yet"
INTRODUCTION: Final = """# Benchmarks

`make bench` writes this page. A ratio compares trcvtui with a reference, measured in short alternating slices
of one run: the median of the pairs [10th .. 90th percentile]. Only ratios can be compared between machines;
absolute figures are in the notes. An aim is no promise. "Before": an earlier figure of a similar machine.

An overrun is the engine's if the engine used more processor time than an interval, from the end of the scan
before to the end of this one. Otherwise the scan waited for the processor, and the overrun is the machine's.
"Machine limit": the system calls alone take more than 60 % of the interval.
"""


def line(target: Target, figure: Figure) -> str:
    """Return the screen's line for one figure."""
    aim = aim_of(target, figure)
    text = f"  aim {aim.text}: {aim.verdict(figure)}" if aim and aim.text else ""
    return f"       {figure.case:42} {figure.value}{text}" + (f"  ({figure.note})" if figure.note else "")


def markdown(facts: Sequence[str], measured: Measured, command: str) -> str:
    """Return the page: machine facts, every target with every figure, and why aims are missed."""
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
        "Why an aim is missed": "\n".join(missed) or "Every aim is reached.",
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
