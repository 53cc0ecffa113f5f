"""The list of lines: filtered, and grouped by site or by cause."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable
from typing import Final, NamedTuple

from trcvtui.fleet.seen_fleet import AWAY, HOUR_BUCKETS, FleetLine

# By the name of a grouping on the screen: the key of a line's group.
GROUP_KEYS: Final[dict[str, Callable[[FleetLine], str]]] = {
    "site": lambda line: line.agent.site,
    "cause": lambda line: line.cause,
}


class GroupHead(NamedTuple):
    """The head of a group: the number of lines, the result of `count_sick`, the ERRORs of the last hour."""

    name: str
    lines: int
    shown: tuple[tuple[int, int], ...]
    errors_an_hour: int
    sparkline: tuple[int, ...]


Entry = FleetLine | GroupHead


def filter_lines(lines: Iterable[FleetLine], typed: str) -> list[FleetLine]:
    """Return the lines that contain all of these words in names, state or STATUS."""
    words = typed.casefold().split()
    return [line for line in lines if all(word in line.filter_text for word in words)]


def group_lines(lines: Iterable[FleetLine], by: str, opened: Collection[str], wall: float) -> list[Entry]:
    """Return the heads, ordered by the first line of each group; an open head precedes its lines."""
    groups: dict[str, list[FleetLine]] = {}
    name_of = GROUP_KEYS[by]
    for line in lines:
        groups.setdefault(name_of(line), []).append(line)
    entries: list[Entry] = []
    for name, members in groups.items():
        entries.append(_make_group(name, members, wall))
        if name in opened:
            entries += members
    return entries


def _make_group(name: str, members: list[FleetLine], wall: float) -> GroupHead:
    sums = [0] * HOUR_BUCKETS
    for line in members:
        if line.errors:
            sums = [a + b for a, b in zip(sums, line.sparkline(wall), strict=True)]
    hour = sum(line.errors_hour for line in members)
    return GroupHead(name, len(members), count_sick(members), hour, tuple(sums))


def count_sick(lines: Iterable[FleetLine]) -> tuple[tuple[int, int], ...]:
    """Return (state, number of lines) for the states that need attention, the worst first."""
    counted = Counter(line.shows for line in lines)
    return tuple((shows, counted[shows]) for shows in sorted(counted) if shows < AWAY)
