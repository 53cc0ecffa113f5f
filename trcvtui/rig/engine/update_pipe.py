"""Brings a picture from the engine to the screen, piece by piece in the gaps between scans.

Rule 1: packing and writing stop when the gap's time is up, and go on in the next one.
Rule 2: a snapshot that is the same object as in the last picture is packed once, and unpacked once.
Rule 3: a screen that does not read never makes a scan wait: only as much is written as the channel takes.
"""

from __future__ import annotations

import os
import pickle
import struct
import sys
from collections.abc import Iterator
from functools import lru_cache
from itertools import chain, starmap
from multiprocessing.connection import Connection as Channel
from typing import Any, Final

from trcvtui.plc.ledger import Line
from trcvtui.records import replace
from trcvtui.rig import clock
from trcvtui.rig.bench_update import BenchUpdate
from trcvtui.rig.history.pin_waveform import PinChange, WaveformDelta

LINES_A_PIECE: Final = 32
WRITE_BYTES: Final = 1 << 16  # with one write: about 10 us
PIECES_KNOWN: Final = 4096  # unpacked snapshots that the screen's side keeps


class UpdatePipe:
    """One picture at a time on its way into the channel."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._packed: dict[str, tuple[object, bytes]] = {}
        self._packing: Iterator[bytes] | None = None
        self._unsent = memoryview(b"")

    def is_busy(self) -> bool:
        """Return whether a picture is still on its way."""
        return self._packing is not None or bool(self._unsent)

    def begin(self, picture: BenchUpdate) -> None:
        """Take a picture; `go_on` brings it."""
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

    # -- packing ---------------------------------------------------------------------------------------

    def _pack(self, picture: BenchUpdate) -> Iterator[bytes]:
        """Yield b"" after each piece of work, the whole message at last."""
        parts: list[list[bytes]] = []
        snapshot = picture.snapshot
        for kind in ("instances", "connections", "data"):
            parts.append([])
            for piece in getattr(snapshot, kind):
                parts[-1].append(self._piece(f"{kind} {piece.name}", piece))
                yield b""
        parts.append([])
        for first in range(0, len(picture.lines), LINES_A_PIECE):
            parts[-1].append(_dumps([_plain(line) for line in picture.lines[first : first + LINES_A_PIECE]]))
            yield b""
        for news in picture.waves:
            parts.append([_dumps(replace(news, changes=()))])
            for first in range(0, len(news.changes), LINES_A_PIECE):
                chunk = news.changes[first : first + LINES_A_PIECE]
                parts[-1].append(_dumps([tuple(change) for change in chunk]))
                yield b""
        empty = replace(snapshot, instances=(), connections=(), data=())
        bare = replace(picture, lines=(), waves=(), snapshot=empty)
        yield _dumps(_Packed(bare, *parts))

    def _piece(self, key: str, piece: object) -> bytes:
        known = self._packed.get(key)
        if known is None or known[0] is not piece:
            known = self._packed[key] = piece, _dumps(piece)
        return known[1]

    # -- writing ---------------------------------------------------------------------------------------

    def _post(self, message: bytes) -> None:
        if sys.platform == "win32":
            self._channel.send_bytes(message)
        else:  # as `send_bytes` does: the length in four bytes, network order, then the message
            self._unsent = memoryview(struct.pack("!i", len(message)) + message)

    def _write(self) -> bool:
        """Write once without waiting; return whether the channel may take more."""
        descriptor = self._channel.fileno()
        os.set_blocking(descriptor, False)
        try:
            self._unsent = self._unsent[os.write(descriptor, self._unsent[:WRITE_BYTES]) :]
        except BlockingIOError:
            return False
        finally:
            os.set_blocking(descriptor, True)
        return True


class _Packed:
    """A picture in pieces; unpickling it gives the whole BenchUpdate."""

    def __init__(self, bare: BenchUpdate, *parts: list[bytes]) -> None:
        self._whole = bare, *parts

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpack, self._whole


def _unpack(
    bare: BenchUpdate,
    instances: list[bytes],
    connections: list[bytes],
    data: list[bytes],
    lines: list[bytes],
    *waves: list[bytes],
) -> BenchUpdate:
    snapshot = replace(
        bare.snapshot,
        instances=tuple(map(_known, instances)),
        connections=tuple(map(_known, connections)),
        data=tuple(map(_known, data)),
    )
    news = chain.from_iterable(map(pickle.loads, lines))
    drawn = tuple(map(_wave, waves))
    return replace(bare, snapshot=snapshot, lines=tuple(starmap(_line, news)), waves=drawn)


def _wave(pieces: list[bytes]) -> WaveformDelta:
    bare: WaveformDelta = pickle.loads(pieces[0])
    changes = chain.from_iterable(map(pickle.loads, pieces[1:]))
    return replace(bare, changes=tuple(starmap(PinChange, changes)))


def _plain(line: Line) -> tuple[int, int, int, Any, Any]:
    """Return the line with its event as (kind, fields) where it is a tuple: packed in half the time."""
    seq, scan, t_ns, event = line
    if isinstance(event, tuple):
        return seq, scan, t_ns, type(event), tuple(event)
    return seq, scan, t_ns, None, event


def _line(seq: int, scan: int, t_ns: int, kind: Any, event: Any) -> Line:
    return Line(seq, scan, t_ns, event if kind is None else kind(*event))


@lru_cache(PIECES_KNOWN)
def _known(piece: bytes) -> Any:
    return pickle.loads(piece)


def _dumps(value: object) -> bytes:
    return pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
