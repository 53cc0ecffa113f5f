"""A window on the history of received bytes: what the screen asks for, and what comes in a picture.

A stream is one CONNECT's: the bytes of its receive jobs, one after the other, and what was dropped between
them. A position counts the bytes of that stream from the start of the bench, whatever is still kept of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

MOST_WINDOW: Final = 8192  # bytes in a picture
MOST_SPANS: Final = 512  # jobs, recv calls or messages in a picture: with smaller ones it covers fewer bytes
END: Final = -1  # a window that ends with the newest byte


class JobSpan(NamedTuple):
    """Bytes of one receive job, all of them, at `position` of the stream; or bytes that were dropped.

    `reason` says why bytes never reached DATA (`done` is False), or why their values are not kept.
    `whole` counts the bytes: of many dropped ones only the first stand in the stream, of noise the last.
    `prefix` and `suffix`: how many bytes of a frame are its marks.
    """

    position: int
    size: int
    instance: str
    number: int
    scan: int
    t_ns: int
    done: bool
    reason: str = ""
    is_kept: bool = True
    whole: int = 0
    prefix: int = 0
    suffix: int = 0
    is_frame: bool = False  # of a block on a ComBuffer

    @property
    def stop(self) -> int:
        """Return the position behind the last byte."""
        return self.position + self.size


class RecvSpan(NamedTuple):
    """Bytes that one recv call brought, from byte `offset` of the connection on."""

    position: int
    size: int
    number: int
    scan: int
    t_ns: int
    offset: int

    @property
    def stop(self) -> int:
        """Return the position behind the last byte."""
        return self.position + self.size


class MessageSpan(NamedTuple):
    """Bytes of a peer's message of `whole` bytes, from its byte `first` on."""

    position: int
    size: int
    peer: str
    number: int
    first: int
    whole: int

    @property
    def stop(self) -> int:
        """Return the position behind the last byte."""
        return self.position + self.size

    @property
    def begins(self) -> bool:
        """Return whether the message begins here."""
        return self.first == 0

    @property
    def ends(self) -> bool:
        """Return whether the message ends here."""
        return self.first + self.size >= self.whole


@dataclass(frozen=True, slots=True)
class Seek:
    """Look for another place, from position `start` on: a DONE, one of the `patterns`, or `dropped` bytes."""

    number: int
    start: int
    is_forward: bool
    patterns: tuple[bytes, ...] = ()
    dropped: bool = False


@dataclass(frozen=True, slots=True)
class Sought:
    """What became of a Seek: where it was found; None: nowhere, or not yet with `share` of the work done."""

    number: int
    position: int | None
    share: float = 1.0


@dataclass(frozen=True, slots=True)
class HistoryRequest:
    """What the screen wants of a CONNECT's stream. `before`: the bytes of the job before each one, too.

    `job_at` asks for all bytes of the job at a position; `data` for those of the job before the present DATA
    of an instance: (instance, first byte, size).
    """

    connect: str
    start: int = END
    size: int = 0
    before: bool = False
    seek: Seek | None = None
    job_at: int | None = None
    data: tuple[str, int, int] | None = None


@dataclass(frozen=True, slots=True)
class Before:
    """Bytes of the job before, as they stood `position` bytes into the stream or into DATA."""

    position: int
    content: bytes
    job: int


@dataclass(frozen=True, slots=True)
class HistoryWindow:
    """Bytes `start` .. of a stream that is kept from `begin` up to `end`; what is not kept is 0 in `content`.

    Spans that reach over an edge of the window are whole.
    """

    connect: str
    begin: int
    end: int
    start: int = 0
    content: bytes = b""
    jobs: tuple[JobSpan, ...] = ()
    recvs: tuple[RecvSpan, ...] = ()
    messages: tuple[MessageSpan, ...] = ()
    before: tuple[Before, ...] = ()
    sought: Sought | None = None
    job: tuple[int, bytes] | None = None
    data: Before | None = None

    @property
    def stop(self) -> int:
        """Return the position behind the last byte of the window."""
        return self.start + len(self.content)
