"""The type files of others, by format; own samples where they are absent."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).parents[2]
OWN = Path(__file__).parent / "data"
GIVEN = Path(os.environ.get("TRCVTUI_UDT_CORPUS", ROOT / "../shared/corpus/udt"))
# Every file cut at every byte takes minutes; CI takes a sample of the cuts.
FULL = "TRCVTUI_ORACLE" in os.environ


def files(*suffixes: str) -> list[Path]:
    """Return all files of these formats, those of others and the own ones, in order."""
    found = [path for folder in (GIVEN, OWN) for path in sorted(folder.rglob("*"))]
    return [path for path in found if path.suffix.lower() in suffixes]


def cuts(length: int, sample: int) -> list[int]:
    """Return where to cut a file: at every byte, or at about `sample` places, the last bytes among them."""
    if FULL:
        return list(range(length + 1))
    step = max(1, length // sample)
    return [*range(0, length, step), *range(max(0, length - 3), length + 1)]
