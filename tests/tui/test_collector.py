"""The collector of cycles: it keeps out of the way of keys, and nothing piles up."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.tui.on_a_bench import on_a_bench

PANES = "12345678"
KEYS = ("j", "k", "n", "tab", "H", "H", "x", "escape", "c", "m")
LOOKS = ("j", "k", "tab", "H", "H", "escape")


@contextmanager
def generations() -> Iterator[list[int]]:
    seen: list[int] = []

    def note(phase: str, about: dict[str, int]) -> None:
        if phase == "start":
            seen.append(about["generation"])

    gc.callbacks.append(note)
    try:
        yield seen
    finally:
        gc.callbacks.remove(note)


async def test_while_keys_come_only_young_objects_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trcvtui.tui.terminal_app.REST_INTERVAL_S", 3600.0)  # the test says when it is
    async with on_a_bench() as screen:
        gc.collect()  # the tests before have counted, too: their next collection may be one of older objects
        with generations() as seen:
            for _ in range(6):
                await screen.press(*KEYS)
                screen.app._collect_garbage()
                screen.bench.scan(20)
                await screen.pictures()
        assert set(seen) <= {0}


async def test_at_rest_it_looks_at_older_ones_and_after_long_rest_at_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("trcvtui.tui.terminal_app.REST_INTERVAL_S", 3600.0)
    async with on_a_bench() as screen:
        app = screen.app
        await screen.press(*KEYS)
        with generations() as seen:
            app._collect_garbage()
            assert seen == [], "a key has just come"
            gc.collect(0)
            app._collect_garbage()
            assert seen == [0, 1]
            app._rests = 100
            app._collect_garbage()
            assert seen == [0, 1, 2]


async def test_what_keys_leave_is_gone_after_a_rest() -> None:
    """A cache of Textual grows in some rounds; what piles up grows in each."""
    async with on_a_bench() as screen:
        left: list[int] = []
        while len(left) < 6 or left[-1] - left[-2] >= 50:
            assert len(left) < 12, left
            for pane in PANES:
                await screen.press(pane, *LOOKS)
            screen.driver.requests.clear()  # the test's own memory
            gc.collect()
            left.append(len(gc.get_objects()))
