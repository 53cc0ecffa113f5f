"""Which hit of a search a place is, and how many there are."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import Final

from trcvtui.udt.byte_text import all_in

MOST_HITS: Final = 10_000
MOST_BYTES: Final = 1024 * 1024  # for all patterns together: of more the hits are not counted


def hit_of(runs: Sequence[tuple[int, bytes]], patterns: tuple[bytes, ...], place: int) -> str:
    """Return `hit 2 of 7`, "" where there is too much to be counted."""
    if sum(len(content) for _, content in runs) * len(patterns) > MOST_BYTES:
        return ""
    found = (start + match.start for start, content in runs for match in all_in(content, patterns))
    places = sorted(set(islice(found, MOST_HITS)))
    is_counted = next(found, None) is None and place in places
    return f"hit {places.index(place) + 1} of {len(places)}" if is_counted else ""
