"""Ages, counts and sizes in words; tables as text; any value as JSON."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import repeat
from typing import Any, Final

from trcvtui.errors import one_line

SIZE_UNITS: Final = {"B": 1, "KiB": 1 << 10, "MiB": 1 << 20, "GiB": 1 << 30}
SECOND: Final = 1_000_000_000
MOST_IN_SECONDS: Final = 120  # shorter times are shown in seconds alone


# Time in words: a stamp is when, a duration how long, an age how long ago.


def stamp_text(ns: int) -> str:
    """Return a time of the run in seconds with milliseconds: `12.330`."""
    milliseconds = ns // 1_000_000
    return f"{milliseconds // 1000}.{milliseconds % 1000:03d}"


def age_text(ns: int) -> str:
    """Return how long ago something was, coarse: `1.2 s`, `99 s`, `12 min`, `3 h`."""
    seconds = max(0, ns) / SECOND
    if seconds < 10:
        return f"{int(seconds * 10) / 10:.1f} s"
    if seconds < MOST_IN_SECONDS:
        return f"{int(seconds)} s"
    if seconds < 7200:
        return f"{int(seconds / 60)} min"
    return f"{int(seconds / 3600)} h"


def format_ns(ns: int) -> str:
    """Return how long something took: `0.35 ms`, `12 ms`, `4.2 s`, `3 min 5 s`, `2 h 5 min`."""
    if ns < MOST_IN_SECONDS * SECOND:
        return f"{ns / 1e6:.3g} ms" if ns < SECOND else f"{ns / SECOND:.3g} s"
    minutes, seconds = divmod(ns // SECOND, 60)
    return f"{minutes} min {seconds} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def count(number: int, one: str, many: str = "") -> str:
    """Return `1 byte`, `2 bytes`."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def times(number: int) -> str:
    """Return `once`, `twice`, `3 times`."""
    return {1: "once", 2: "twice"}.get(number, f"{number} times")


def rate_text(size: int, ns: int) -> str:
    """Return how fast bytes come: `40 B/s`, `1.2 KB/s`."""
    return f"{size_text(size * SECOND / max(1, ns))}/s"


def last_part(path: str) -> str:
    """Return the file name without its folders, for a path of any operating system."""
    return path.replace("\\", "/").rpartition("/")[2]


def size_text(size: float) -> str:
    """Return `40 B`, `1.2 KB`."""
    if size < 1000:
        return f"{size:.0f} B"
    return f"{size / 1000:.1f} KB" if size < 1_000_000 else f"{size / 1_000_000:.1f} MB"


def parse_size(text: str) -> int | None:
    """Return the number of bytes in a text such as `64KiB`, or None if the text is no size."""
    found = re.fullmatch(r"(\d{1,9})(B|KiB|MiB|GiB)?", text, re.ASCII)
    return int(found[1]) * SIZE_UNITS[found[2] or "B"] if found else None


def exact_size(size: int) -> str:
    """Return a size as exact text such as `64KiB`, which `parse_size` reads."""
    unit = next(unit for unit in reversed(SIZE_UNITS) if size % SIZE_UNITS[unit] == 0)
    return f"{size // SIZE_UNITS[unit]}{unit}"


def utc_text(ns: int) -> str:
    """Return ns since 1970 as `2000-01-01T00:00:00.000000Z`."""
    from datetime import UTC, datetime, timedelta  # few callers need it: a faster start

    try:
        moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=ns // 1000)
    except OverflowError:  # a file may claim any time
        return f"{ns} ns after 1970-01-01T00:00:00Z"
    return moment.isoformat(timespec="microseconds").replace("+00:00", "Z")


def format_columns(rows: Iterable[tuple[str, ...]], sides: str) -> Iterator[str]:
    """Yield rows in columns, escaped. `sides` has a letter for each column: r is right-aligned, l left."""
    columns = [_escape_column(column) for column in zip(*rows, strict=True)]
    if not columns:  # no rows
        return iter(())
    padded = [
        map(str.rjust if side == "r" else str.ljust, column, repeat(max(map(len, column))))
        for side, column in zip(sides, columns, strict=True)
    ]
    return map(str.rstrip, map("  ".join, zip(*padded, strict=True)))


def _escape_column(column: tuple[str, ...]) -> tuple[str, ...]:
    return column if "".join(column).isprintable() else tuple(map(one_line, column))


# In JSON of ASCII: an escaped backslash, a surrogate pair, and (group 1) a lone surrogate. Strict readers
# refuse a lone one, though JSON has a form for it.
_SURROGATE: Final = re.compile(r"\\\\|\\ud[89ab]..\\ud[c-f]..|\\(ud[89a-f]..)")


def json_text(value: object, **form: Any) -> str:
    """Return a value as JSON in ASCII, so that bytes from a wire stay data. `form` goes to `json.dumps`.

    A lone surrogate is written as six characters such as `\\udc00`, as in `one_line`.
    """
    import json  # here: a command line starts faster without it

    text = json.dumps(value, **form).replace("\x7f", "\\u007f")  # DEL: `dumps` escapes all others
    return _SURROGATE.sub(lambda found: "\\" * bool(found[1]) + found[0], text) if "\\ud" in text else text
