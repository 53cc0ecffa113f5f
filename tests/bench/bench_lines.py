"""Tell a bench its lines, and let its scans pass."""

from __future__ import annotations

from trcvtui.bench.bench import Bench
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import RunScans


def run(bench: Bench, scans: int) -> None:
    for _ in range(scans):
        bench.step()


def do(bench: Bench, *lines: str, scans: int = 0) -> None:
    """Carry out lines, `run` of some scans among them; let scans pass after the last."""
    for line in lines:
        command = parse_line(line, bench.project, "test")
        if isinstance(command, RunScans):
            run(bench, command.scans)
        else:
            assert command is not None and bench.do(command) == ""
    run(bench, scans)
