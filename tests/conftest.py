"""What holds for every test: examples are the same each time, and none is judged by how long it took."""

from __future__ import annotations

import gc
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

from tests.certificates import certificates, secure_bench
from trcvtui.plc.containment import EXCEPTIONS_VARIABLE

__all__ = ["certificates", "secure_bench"]

TESTS = Path(__file__).parent
os.environ.setdefault("XDG_STATE_HOME", str(Path(tempfile.gettempdir(), "trcvtui-tests")))  # for reports
os.environ.setdefault(
    EXCEPTIONS_VARIABLE, "raise"
)  # what is contained elsewhere fails the test, in any process

settings.register_profile("same", deadline=None, max_examples=60, derandomize=True)
settings.register_profile("searching", deadline=None, max_examples=600)
settings.load_profile("same")


# What a folder's tests are; the longest begin, for a long test that begins last is waited for by all workers.
OF_FOLDER = {"properties": ("slow",), "e2e": ("live", "slow"), "tui": ("screen",)}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests of real sockets, of the screen, and long ones; let those that wait and the long ones begin.

    Each worker has an equal part of all tests, in their order: two begin with what waits, the others compute.
    """
    ranks = {folder: rank for rank, folder in enumerate(OF_FOLDER)}
    folder_of = {item: item.path.relative_to(TESTS).parts[0] for item in items}
    for item in items:
        case = item.callspec.params.values() if hasattr(item, "callspec") else ()
        kernel = ("live",) if "live" in list(case) else ()
        for name in (*OF_FOLDER.get(folder_of[item], ()), *kernel):
            item.add_marker(name)
    items.sort(key=lambda item: ranks.get(folder_of[item], len(ranks)))
    live = [item for item in items if item.get_closest_marker("live")]
    others = [item for item in items if not item.get_closest_marker("live")]
    second = len(items) // int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")) - len(live[::2])
    items[:] = [*live[::2], *others[: max(second, 0)], *live[1::2], *others[max(second, 0) :]]


def pytest_collection_finish() -> None:
    """Keep modules and collected tests from the collector, which would look at all of them each time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)
