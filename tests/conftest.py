"""What holds for every test: no property is judged by how long one example took on this machine."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest
from hypothesis import settings

from tests.certificates import certificates, secure_bench

__all__ = ["certificates", "secure_bench"]

TESTS = Path(__file__).parent

settings.register_profile("untimed", deadline=None, max_examples=60)
settings.load_profile("untimed")


SLOW_FIRST = ("properties", "e2e", "tui")  # a long test that begins last is waited for by all workers


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let the folders of the long tests begin."""
    folders = {folder: rank for rank, folder in enumerate(SLOW_FIRST)}
    items.sort(key=lambda item: folders.get(item.path.relative_to(TESTS).parts[0], len(folders)))


def pytest_collection_finish() -> None:
    """Keep modules and collected tests from the collector, which would look at all of them each time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)
