"""Prefix, data and suffix of a frame over its bytes: a style each, and a sign between them without colour.

`02›41 42 43‹0d 0a`: what stands before the first sign is prefix, behind the second suffix.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.rig.history.window import JobSpan

OPENS, CLOSES = "›", "‹"
PREFIX, SUFFIX, OLD = "prefix", "suffix", "faint"


class Marked(NamedTuple):
    """Bytes `start` to `stop`: data begin at `data`, the suffix at `suffix`."""

    start: int
    data: int
    suffix: int
    stop: int

    def style(self, place: int) -> str:
        """Return the style of a byte of it, "" for data."""
        if self.start <= place < self.data:
            return PREFIX
        return SUFFIX if self.suffix <= place < self.stop else ""

    def sign(self, place: int) -> str:
        """Return the sign before a byte of it, "" for none."""
        if place == self.data and self.start < self.data:
            return OPENS
        return CLOSES if place == self.suffix and self.suffix < self.stop else ""


NOTHING: Final = Marked(0, 0, 0, 0)


def marked(start: int, size: int, prefix: int, suffix: int) -> Marked:
    """Return the marks of a frame of `size` bytes."""
    return Marked(start, start + prefix, start + size - suffix, start + size)


def of_span(span: JobSpan) -> Marked:
    """Return the marks of a frame of the past."""
    if not span.prefix and not span.suffix:
        return NOTHING
    return marked(span.position, span.size, span.prefix, span.suffix)


def of_data(instance: InstanceSnapshot) -> Marked | None:
    """Return the marks of the newest frame in its variable, None where there is none."""
    last = instance.framer.last if instance.framer is not None else None
    return marked(0, last.size, last.prefix, last.suffix) if last is not None else None


def of_part(instance: InstanceSnapshot) -> Marked | None:
    """Return the marks of a frame that is not complete: it has no suffix yet."""
    framer = instance.framer
    if framer is None or not instance.have:
        return None
    return marked(0, instance.have, min(instance.have, len(framer.prefix or b"")), 0)


def signs(spans: Sequence[JobSpan]) -> dict[int, str]:
    """Return the sign before each byte that begins data or a suffix."""
    found = {}
    for span in spans:
        marks = of_span(span)
        for place in (marks.data, marks.suffix):
            if sign := marks.sign(place):
                found[place] = sign
    return found
