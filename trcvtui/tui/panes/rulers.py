"""The rulers under a row of bytes: messages, recv calls and jobs, each as a bracket with its name.

Pure text: spans and the columns of the bytes in, parts of a line out. A job that ends within a message is
marked between the two bytes that it parts, in the row and in its ruler, by a stroke and not by colour alone.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Final, NamedTuple, Protocol, TypeVar

from trcvtui.rig.history.window import HistoryWindow, JobSpan, MessageSpan, RecvSpan
from trcvtui.tui.formatting import clip, moment, plain, short_time
from trcvtui.tui.widgets import frame_marks

CUT: Final = "╱"
START: Final = "▕"
MESSAGES, RECVS, JOBS, WAS = "msg", "recv", "job", "was"
RULERS: Final = ((MESSAGES, RECVS, JOBS), (MESSAGES, JOBS), ())
_STOP: Final = attrgetter("stop")
_POSITION: Final = attrgetter("position")


class Placed(Protocol):
    """Anything that stands over bytes."""

    @property
    def position(self) -> int: ...
    @property
    def stop(self) -> int: ...


Span = TypeVar("Span", bound=Placed)


class Pen(NamedTuple):
    """How one kind of span is drawn: beginning, in between, end, and the style."""

    begin: str
    between: str
    end: str
    style: str


MESSAGE: Final = Pen("└", "─", "┘", "key")
RECV: Final = Pen("╰", "┄", "╯", "dim")
JOB: Final = Pen("╚", "═", "╝", "busy")
DROPPED: Final = Pen("×", "×", "×", "warn")


class Stroke(NamedTuple):
    """A bracket over columns `first` .. `last` of a ruler; names from the longest to the shortest."""

    first: int
    last: int
    begins: bool
    ends: bool
    pen: Pen
    names: tuple[str, ...]


def within(spans: Sequence[Span], start: int, stop: int) -> Sequence[Span]:
    """Return the spans that have bytes between two positions."""
    first = bisect_right(spans, start, key=_STOP)
    last = first
    while last < len(spans) and spans[last].position < stop:
        last += 1
    return spans[first:last]


def covering(spans: Sequence[Span], position: int) -> Span | None:
    """Return the span that holds a position."""
    return next(iter(within(spans, position, position + 1)), None)


def cuts(window: HistoryWindow, start: int, stop: int) -> frozenset[int]:
    """Return the positions at which a job begins in the middle of a message."""
    found = set()
    for job in within(window.jobs, start, stop):
        message = covering(window.messages, job.position) if job.position >= start else None
        if message is not None and message.first + job.position - message.position > 0:
            found.add(job.position)
    return frozenset(found)


def signs(window: HistoryWindow, start: int, stop: int) -> dict[int, str]:
    """Return the sign before each byte at which a message is cut, or data or suffix of a frame begin."""
    cut = dict.fromkeys(cuts(window, start, stop), CUT)
    return cut | frame_marks.signs(within(window.jobs, start, stop))


def before_byte(position: int, signs: dict[int, str], begins: set[int]) -> tuple[str, str]:
    """Return what stands before a byte: a sign, the beginning of a message, or room."""
    if position in signs:
        return signs[position], "warn strong"
    return (START, "key") if position in begins else (" ", "")


# -- one ruler -----------------------------------------------------------------------------------------------


def ruler(strokes: Sequence[Stroke], width: int) -> list[tuple[str, str]]:
    """Return the parts of a ruler of `width` columns."""
    parts: list[tuple[str, str]] = []
    reached = 0
    for stroke in strokes:
        if stroke.first > reached:
            parts.append((" " * (stroke.first - reached), ""))
        parts.append((_bracket(stroke), stroke.pen.style))
        reached = stroke.last + 1
    parts.append((" " * max(0, width - reached), ""))
    return parts


def _bracket(stroke: Stroke) -> str:
    pen, width = stroke.pen, stroke.last - stroke.first + 1
    begin = pen.begin if stroke.begins else pen.between
    end = pen.end if stroke.ends else pen.between
    room = width - 2
    name = next((name for name in stroke.names if len(name) <= room), "")
    return begin + name + pen.between * (room - len(name)) + end


def strokes(
    spans: Sequence[Span],
    start: int,
    stop: int,
    column: Callable[[int], int],
    drawn: Callable[[Span], tuple[bool, bool, Pen, tuple[str, ...]]],
) -> list[Stroke]:
    """Return the brackets of the spans over a row; `column` tells where a byte of it stands."""
    found = []
    for span in within(spans, start, stop):
        begins, ends, pen, names = drawn(span)
        first, last = max(span.position, start), min(span.stop, stop) - 1
        here = begins and span.position >= start, ends and span.stop <= stop
        found.append(Stroke(column(first - start), column(last - start) + 1, *here, pen, names))
    return found


def of_message(span: MessageSpan) -> tuple[bool, bool, Pen, tuple[str, ...]]:
    """Return how a message is drawn."""
    peer, number = plain(span.peer), f"#{span.number}"
    size = f"{span.first}.." if span.first else f"{span.whole} B"
    return span.begins, span.ends, MESSAGE, (f"{peer} {number} {size}", f"{peer} {number}", number)


def of_recv(span: RecvSpan) -> tuple[bool, bool, Pen, tuple[str, ...]]:
    """Return how a recv call is drawn; 0 is none: the bytes were never read."""
    if not span.number:
        return True, True, RECV, ("never read", "")
    number, scan = span.number, span.scan
    return True, True, RECV, (f"recv {number} scan {scan}", f"r{number} s{scan}", f"{number}", "")


def of_job(span: JobSpan) -> tuple[bool, bool, Pen, tuple[str, ...]]:
    """Return how a job is drawn, or bytes that were dropped."""
    name = plain(span.instance)
    if not span.done:
        return True, True, DROPPED, (f"{span.whole} B dropped: {plain(span.reason)}", "dropped", "")
    number = f"{'frame' if span.is_frame else 'job'} {span.number}"
    return True, True, JOB, (f"{name} {number} scan {span.scan}", f"{number} scan {span.scan}", number, "")


# -- beside the rulers ---------------------------------------------------------------------------------------


def beside_messages(marks: Sequence[int], messages: Sequence[MessageSpan]) -> str:
    """Return what a cut means."""
    if not marks:
        return ""
    message = covering(messages, marks[0])
    return f"{CUT} #{message.number} cut at {message.first + marks[0] - message.position}" if message else ""


def beside_recvs(recvs: Sequence[RecvSpan], start: int, stop: int) -> str:
    """Return when the first chunk arrived that begins in a row, and how long after the one before."""
    first = next((n for n, span in enumerate(recvs) if start <= span.position < stop), None)
    if first is None:
        return ""
    span = recvs[first]
    gap = f" +{short_time(span.t_ns - recvs[first - 1].t_ns)}" if first else ""
    return f"{moment(span.t_ns)}{gap}"


def beside_jobs(jobs: Sequence[JobSpan], start: int, stop: int) -> str:
    """Return the DONE, or the loss, that stands in a row."""
    job = next((span for span in jobs if start < span.stop <= stop), None)
    if job is None:
        return ""
    if job.done:
        return f"DONE {moment(job.t_ns)}" if not job.reason else clip(plain(job.reason), 60)
    return f"{moment(job.t_ns)} dropped"
