"""Which layout a terminal of a size gets: the classes that main.tcss speaks of; all sizes in cells."""

from __future__ import annotations

from typing import Final

TABS: Final = "-tabs"
LEAST_WIDTH, LEAST_HEIGHT, TINY, ROOMY, TALL = 128, 38, 16, 43, 54
BROAD, HIGH = 180, 56  # from here on history and timing both stand
STRIP_WIDTH, STRIP_HEIGHT = 140, 39  # so wide, so high without the instances: timing is a strip of its own
MOST_INSTANCES: Final = 10  # rows of the list, its frame included


def sizes(width: int, height: int, instances: int) -> dict[str, bool]:
    """Return the class names and whether each holds."""
    below = height - min(MOST_INSTANCES, instances + 2)
    return {
        TABS: width < LEAST_WIDTH or height < LEAST_HEIGHT,
        "-tiny": height < TINY,
        "-roomy": height >= ROOMY,
        "-tall": height >= TALL,
        "-high": height >= HIGH,
        "-broad": width >= BROAD,
        "-strip": STRIP_WIDTH <= width < BROAD and height < HIGH and below >= STRIP_HEIGHT,
    }
