"""Which layout a terminal of a size gets: the classes that main.tcss speaks of; all sizes in cells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

TABS, PAIR = "-tabs", "-pair"
LEAST_BELOW: Final = 32  # rows below the list of instances
LEAST_WIDTH, LEAST_HEIGHT, TINY, ROOMY, TALL = 128, 38, 16, 43, 54
BROAD, HIGH = 180, 56  # from here on history and timing both stand
STRIP_WIDTH, STRIP_HEIGHT = 140, 39  # so wide, so high without the instances: timing is a strip of its own
PAIR_WIDTH, PAIR_HEIGHT = 100, 30  # from here on STATUS stands beside Block, and above Peer
MOST_INSTANCES: Final = 10  # rows of the list, its frame included
FRAME: Final = 2  # rows of a border
LEAST_TIMING, LEAST_HISTORY, LEAST_BYTES = 5, 4, 5
REST: Final = 0  # the row that takes what is left: bytes and members


def sizes(width: int, height: int, instances: int) -> dict[str, bool]:
    """Return the class names and whether each holds."""
    below = height - min(MOST_INSTANCES, instances + 2)
    tabs = width < LEAST_WIDTH or height < LEAST_HEIGHT or below < LEAST_BELOW
    return {
        TABS: tabs,
        PAIR: tabs and width >= PAIR_WIDTH and height >= PAIR_HEIGHT,
        "-tiny": height < TINY,
        "-roomy": height >= ROOMY,
        "-tall": height >= TALL,
        "-high": height >= HIGH,
        "-broad": width >= BROAD,
        "-strip": STRIP_WIDTH <= width < BROAD and height < HIGH and below >= STRIP_HEIGHT,
    }


def grid_rows(holds: Mapping[str, bool], timing: bool) -> tuple[int, ...]:
    """Return the heights of the rows of panes: STATUS, what is past in one row or two, bytes, the peer.

    `holds` are the classes of a size, `timing` whether timing stands where one place is for it and history.
    """
    tall, peer = holds["-tall"], 11 if holds["-tall"] else 10 if holds["-roomy"] else 8
    if holds["-broad"]:
        return (13, 12, REST, peer) if tall else (8, 8, REST, peer)
    if holds["-high"]:
        return 9, 12, 7, REST, 10
    if holds["-strip"] and timing:
        return (9, 10, 5, REST, peer) if tall else (6, 9, 5, REST, 10)
    if holds["-strip"]:
        return (9, 7, 8, REST, peer) if tall else (8, 6, 6, REST, 10)
    return (11, 12, REST, peer) if tall else (8, 10 if timing else 7, REST, peer)


def grown(rows: tuple[int, ...], height: int, status: int, peer: int) -> tuple[int, ...]:
    """Return the rows with one of `status` for STATUS, as far as the others can spare it.

    First goes what the peer leaves empty below its `peer` rows, then what is past, then the bytes.
    """
    fitted = list(rows)
    rest = rows.index(REST)
    fitted[rest] = height - sum(rows)
    past = range(rest - 1, 0, -1)
    least = {-1: peer, rest: LEAST_BYTES, **{n: LEAST_TIMING if n == 1 else LEAST_HISTORY for n in past}}
    for place in (-1, *past, rest):
        given = max(0, min(status - fitted[0], fitted[place] - least[place]))
        fitted[place] -= given
        fitted[0] += given
    fitted[rest] = REST
    return tuple(fitted)
