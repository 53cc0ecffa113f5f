"""The type files of others, by format; own samples where they are absent."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
OWN = Path(__file__).parent / "data"
GIVEN = Path(os.environ.get("TRCVTUI_UDT_CORPUS", ROOT / "../shared/corpus/udt"))
ABSENT = f"no type files of others in {GIVEN} (TRCVTUI_UDT_CORPUS names another folder)"
needs_given = pytest.mark.skipif(not GIVEN.is_dir(), reason=ABSENT)
# Every file cut at every byte takes minutes; CI takes a sample of the cuts.
FULL = "TRCVTUI_ORACLE" in os.environ


def files(*suffixes: str) -> list[Path]:
    """Return all files of these formats, those of others and the own ones, in order."""
    found = [path for folder in (GIVEN, OWN) for path in sorted(folder.rglob("*"))]
    return [path for path in found if path.suffix.lower() in suffixes]


def of_others(rows: Sequence[Any], width: int = 1) -> Sequence[Any]:
    """Return rows of parameters; where the files of others are absent, one that is skipped and says so."""
    return rows or [pytest.param(*[None] * width, id="absent", marks=needs_given)]


def cuts(length: int, sample: int) -> list[int]:
    """Return where to cut a file: at every byte, or at about `sample` places, the last bytes among them."""
    if FULL:
        return list(range(length + 1))
    step = max(1, length // sample)
    return [*range(0, length, step), *range(max(0, length - 3), length + 1)]
