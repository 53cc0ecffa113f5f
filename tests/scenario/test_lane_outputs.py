"""Every scenario prints the same jsonl with fast lanes and without them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario.scenarios import play
from trcvtui import LANE

CONFIGS = Path(__file__).parents[2] / "configs"
FILES = [path for path in sorted(CONFIGS.rglob("*.toml")) if "[scenario]" in path.read_text()]


@pytest.mark.slow
@pytest.mark.parametrize("folder", sorted({path.parent for path in FILES}), ids=lambda folder: folder.name)
def test_a_scenario_prints_the_same_with_and_without_lanes(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if folder.name == "tls":
        pytest.skip("its certificates are made by hand")
    for path in (each for each in FILES if each.parent == folder):
        monkeypatch.delenv(LANE, raising=False)
        fast = play(path, "sim").text
        monkeypatch.setenv(LANE, "slow")
        assert play(path, "sim").text == fast, path.name
