"""`make lint` refuses the worst words, and says in which file and line, and what to say instead."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import pytest

WORDS = Path(__file__).parents[1] / ".ci" / "words.py"


def test_a_word_that_has_to_go_is_named_with_its_place_and_what_to_say(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "trcvtui").mkdir()
    (tmp_path / "trcvtui" / "a.py").write_text("def told_once() -> None:\n    ...  # one byte behind it\n")
    (tmp_path / "README.md").write_text("A fold-behind-name is a name.\nHence nothing.\n")
    module: dict[str, Any] = runpy.run_path(str(WORDS))
    module["main"].__globals__["ROOT"] = tmp_path
    assert module["main"]() == 1
    assert capsys.readouterr().out.splitlines() == [
        "README.md:2: found 'Hence', expected while, so, of it",
        "trcvtui/a.py:1: found 'told_once', expected fault_repeat",
        "trcvtui/a.py:2: found 'behind', expected after (time), below or beside (place)",
    ]
