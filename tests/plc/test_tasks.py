"""Tasks: which scan calls which instance, and in which order."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from trcvtui.bench.bench import Bench
from trcvtui.project.file import read_project


def calls(scans: int, *tasks: dict[str, Any]) -> list[tuple[int, str]]:
    """Return scan time in ms and the letters of the instances that were called, in order; one a task."""
    letters = "ABC"[: len(tasks)]
    document: dict[str, Any] = {
        "dialect": "baosky",
        "task": [{"name": f"T{letter}", **task} for letter, task in zip(letters, tasks, strict=True)],
        "connect": [{"name": "C1", "LocalAddress": "127.0.0.1"}],
        "instance": [
            {"name": letter, "block": "TRCV_C", "connect": "C1", "task": f"T{letter}"} for letter in letters
        ],
    }
    bench = Bench(read_project(document, "tasks.toml", Path()), "sim")
    seen = []
    for _ in range(scans):
        bench.step()
        seen.append((bench.now // 1_000_000, "".join(out.instance for out in bench.runtime.due_edges)))
    bench.close()
    return seen


@pytest.mark.parametrize(
    ("interval", "called_at"),
    [
        ("T#10ms", [0, 10, 20, 30, 40, 50, 60, 70, 80, 90]),
        ("T#15ms", [0, 20, 30, 50, 60, 80, 90]),
        ("T#20ms", [0, 20, 40, 60, 80]),
        ("T#25ms", [0, 30, 50, 80]),
        ("T#1s", [0]),
    ],
)
def test_a_task_is_called_in_the_first_scan_that_has_reached_its_time(
    interval: str, called_at: list[int]
) -> None:
    seen = calls(10, {"interval": "T#10ms"}, {"interval": interval})
    assert [t_ms for t_ms, called in seen if "B" in called] == called_at
    assert all("A" in called for _, called in seen)


def test_the_smaller_priority_goes_first_and_equal_ones_as_in_the_file() -> None:
    slow = {"interval": "T#20ms", "priority": 1}
    assert calls(3, {"priority": 2}, slow, {"priority": 2}) == [(0, "BAC"), (10, "AC"), (20, "BAC")]
