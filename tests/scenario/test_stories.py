"""The stories that are told with the program: each holds on the simulated network and on real sockets."""

from __future__ import annotations

import pytest

from tests.scenario.scenarios import CONFIGS, play

STORIES = sorted(path.stem for path in (CONFIGS / "scenarios" / "stories").glob("*.toml"))
SLOW = {"four-bytes-short"}  # a minute of real time
ANY_PORT = {"packed-sender": ("connect.C1.LocalPort=0",)}  # its own is that of the README: it may be in use
LIVE = [story for story in STORIES if story not in SLOW]


def test_the_stories_are_these() -> None:
    assert STORIES == [
        "auto-reply", "byte-order-swapped", "en-r-dropped", "every-split", "four-bytes-short",
        "packed-sender", "udt-mismatch",
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("story", "kernel"), [(s, "sim") for s in STORIES] + [(s, "live") for s in LIVE])
def test_a_story_holds(story: str, kernel: str) -> None:
    verdict = play(
        CONFIGS / "scenarios" / "stories" / f"{story}.toml", kernel, *ANY_PORT.get(story, ())
    ).verdict
    assert verdict.failures == ()
