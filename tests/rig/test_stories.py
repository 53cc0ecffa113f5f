"""The stories that are told with the program: each holds on the simulated network and on real sockets."""

from __future__ import annotations

import pytest

from tests.rig.scenarios import CONFIGS, play

STORIES = ("packed-sender", "every-split", "auto-reply", "udt-mismatch")


@pytest.mark.parametrize("kernel", ["sim", "live"])
@pytest.mark.parametrize("story", STORIES)
def test_a_story_holds(story: str, kernel: str) -> None:
    verdict = play(CONFIGS / "scenarios" / "stories" / f"{story}.toml", kernel).verdict
    assert verdict.failures == ()
