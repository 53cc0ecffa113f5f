"""Brings a picture from the engine to the screen, piece by piece in the gaps between scans.

Rule 1: packing and writing stop when the gap's time is up, and go on in the next one.
Rule 2: of the snapshot's parts only those cross that have changed since the picture before: a picture costs
by what has changed. On the screen's side the others are the same objects.
Rule 3: a screen that does not read never makes a scan wait: only as much is written as the channel takes.
"""

from __future__ import annotations

import os
import pickle
import struct
import sys
from collections.abc import Iterable, Iterator
from itertools import chain, compress, count, islice, starmap
from multiprocessing.connection import Connection as Channel
from operator import is_not
from typing import Any, Final, TypeVar

from msgspec.structs import replace

from trcvtui import clock
from trcvtui.history.pin_waveform import PinChange, WaveformDelta
from trcvtui.picture.bench_update import BareUpdate, BenchUpdate
from trcvtui.plc.ledger import Line, Stamped
from trcvtui.plc.snapshot import made

LINES_A_PIECE: Final = 32
PARTS_A_PIECE: Final = 8
LOOK_AT: Final = 2000  # parts that are looked at in one piece of work, whether they have changed
WRITE_BYTES: Final = 1 << 16  # with one write: about 10 us
PIPES_KNOWN: Final = 8  # on the screen's side

T = TypeVar("T")
Parts = tuple[Any, ...]
_numbers: Final = count()


class UpdatePipe:
    """One picture at a time on its way into the channel."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._name = f"{os.getpid()} {next(_numbers)}"
        self._sent: list[Parts] = [(), (), ()]  # the parts of the picture before
        self._packing: Iterator[bytes] | None = None
        self._unsent = memoryview(b"")

    def is_busy(self) -> bool:
        return self._packing is not None or bool(self._unsent)

    def begin(self, picture: BareUpdate) -> None:
        self._packing = self._pack(picture)

    def go_on(self, until: int) -> None:
        """Pack and write until the time is up, but one piece at least; stop when the channel is full."""
        while self._packing is not None:
            message = next(self._packing)
            if message:
                self._packing = None
                self._post(message)
            if clock.now_ns() >= until:
                return
        while self._unsent and self._write() and clock.now_ns() < until:
            pass

    def finish(self) -> None:
        """Write the rest of a message that has begun, however long the screen takes: another one follows."""
        while self._unsent:
            self._unsent = self._unsent[os.write(self._channel.fileno(), self._unsent) :]

    # -- packing ---------------------------------------------------------------------------------------

    def _pack(self, picture: BareUpdate) -> Iterator[bytes]:
        """Yield b"" after each piece of work, the whole message at last."""
        parts: list[tuple[int, list[bytes]]] = []
        kinds: list[Parts] = [*picture.snapshot[1:]]
        for kind, before in zip(kinds, self._sent, strict=True):
            pieces: list[bytes] = []
            parts.append((len(kind), pieces))
            for first in range(0, len(kind), LOOK_AT):
                places: Iterable[int] = range(first, min(first + LOOK_AT, len(kind)))
                if len(kind) == len(before):
                    span = slice(first, first + LOOK_AT)
                    places = [*compress(places, map(is_not, kind[span], before[span]))]
                yield b""
                for some in _batches(places, PARTS_A_PIECE):
                    pieces.append(_dumps([(place, kind[place]) for place in some]))
                    yield b""
        lines: list[bytes] = []
        for numbered in _batches(enumerate(picture.lines, picture.first_seq), LINES_A_PIECE):
            lines.append(_dumps([*starmap(_plain, numbered)]))
            yield b""
        waves: list[list[bytes]] = []
        for news in picture.update.waves:
            waves.append([_dumps(replace(news, changes=()))])
            for changes in _batches(news.changes, LINES_A_PIECE):
                waves[-1].append(_dumps([*map(tuple, changes)]))
                yield b""
        window = picture.window()
        yield b""
        bare = replace(picture.update, waves=(), history=window)
        message = _dumps(_Package(self._name, bare, parts, lines, waves))
        yield b""
        self._sent = kinds
        yield message

    # -- writing ---------------------------------------------------------------------------------------

    def _post(self, message: bytes) -> None:
        if sys.platform == "win32":
            self._channel.send_bytes(message)
        else:  # as `send_bytes` does: the length in four bytes, network order, then the message
            self._unsent = memoryview(struct.pack("!i", len(message)) + message)

    def _write(self) -> bool:
        descriptor = self._channel.fileno()
        os.set_blocking(descriptor, False)
        try:
            self._unsent = self._unsent[os.write(descriptor, self._unsent[:WRITE_BYTES]) :]
        except BlockingIOError:
            return False
        finally:
            os.set_blocking(descriptor, True)
        return True


class _Package:
    """A picture in pieces; unpickling it gives the whole BenchUpdate."""

    def __init__(self, *whole: Any) -> None:
        self._whole = whole

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpack, self._whole


_arrived: Final[dict[str, list[list[Any]]]] = {}  # by pipe: the parts of the last picture that came


def _unpack(
    pipe: str,
    bare: BenchUpdate,
    parts: list[tuple[int, list[bytes]]],
    lines: list[bytes],
    waves: list[list[bytes]],
) -> BenchUpdate:
    known = _arrived.setdefault(pipe, [[], [], []])
    if len(_arrived) > PIPES_KNOWN:
        del _arrived[next(iter(_arrived))]
    for kind, (size, pieces) in zip(known, parts, strict=True):
        if len(kind) != size:
            kind[:] = [None] * size
        for place, part in chain.from_iterable(map(pickle.loads, pieces)):
            kind[place] = made(part)
    instances, connections, data = map(tuple, known)
    snapshot = replace(bare.snapshot, instances=instances, connections=connections, data=data)
    news = chain.from_iterable(map(pickle.loads, lines))
    drawn = tuple(map(_wave, waves))
    return replace(bare, snapshot=snapshot, lines=tuple(starmap(_line, news)), waves=drawn)


def _wave(pieces: list[bytes]) -> WaveformDelta:
    bare: WaveformDelta = pickle.loads(pieces[0])
    changes = chain.from_iterable(map(pickle.loads, pieces[1:]))
    return replace(bare, changes=tuple(starmap(PinChange, changes)))


def _plain(seq: int, item: Stamped) -> tuple[int, int, int, Any, Any]:
    scan, t_ns, event = item
    if isinstance(event, tuple):
        return seq, scan, t_ns, event.__class__, [*event]
    return seq, scan, t_ns, None, event


def _line(seq: int, scan: int, t_ns: int, kind: Any, event: Any) -> Line:
    return Line(seq, scan, t_ns, event if kind is None else kind(*event))


def _batches(items: Iterable[T], size: int) -> Iterator[list[T]]:
    left = iter(items)
    while some := list(islice(left, size)):
        yield some


def _dumps(value: object) -> bytes:
    return pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
