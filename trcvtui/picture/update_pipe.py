"""A picture on its way from the engine to the screen: one pickle, and of the snapshot what has changed.

Rule 1: a picture costs by what has changed. On the screen's side the other parts are the same objects.
Rule 2: a screen that does not read never makes a scan wait: only as much is written as the channel takes.
"""

from __future__ import annotations

import os
import pickle
import struct
import sys
from itertools import starmap
from multiprocessing.connection import Connection as Channel
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from msgspec.structs import replace

from trcvtui.plc.ledger import Line

if TYPE_CHECKING:
    from trcvtui.picture.bench_update import BenchUpdate
    from trcvtui.plc.snapshot import Snapshot

WRITE_BYTES: Final = 1 << 16  # with one write: about 10 us
Parts = tuple[tuple[Any, ...], ...]


class UpdateMessage(NamedTuple):
    """A picture without the parts of its snapshot, and without lines.

    `changed`: of each kind of parts their number, and those that have changed by place. `lines` as plain
    tuples of number, scan, time, kind of event and its fields: pickled in a quarter of the time.
    """

    update: BenchUpdate
    changed: tuple[tuple[int, list[tuple[int, Any]]], ...]
    lines: list[tuple[Any, ...]]


def _parts_of(snapshot: Snapshot) -> Parts:
    return snapshot.instances, snapshot.connections, snapshot.data


class UpdatePipe:
    """The engine's end: one picture at a time on its way into the channel."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._sent: Parts = (), (), ()  # of the picture before
        self._unsent = memoryview(b"")

    def is_busy(self) -> bool:
        return bool(self._unsent)

    def send(self, picture: BenchUpdate) -> None:
        """Pickle a picture and begin to write it, when the one before is written."""
        parts = _parts_of(picture.snapshot)
        changed = tuple(
            (len(kind), [(n, part) for n, part in enumerate(kind) if n >= len(sent) or part is not sent[n]])
            for kind, sent in zip(parts, self._sent, strict=True)
        )
        self._sent = parts
        lines = [
            (seq, scan, t_ns, event.__class__, *event)
            if isinstance(event, tuple)
            else (seq, scan, t_ns, None, event)
            for seq, scan, t_ns, event in picture.lines
        ]
        head = replace(picture.snapshot, instances=(), connections=(), data=())
        update = replace(picture, snapshot=head, lines=())
        message = pickle.dumps(UpdateMessage(update, changed, lines), pickle.HIGHEST_PROTOCOL)
        if sys.platform == "win32":
            self._channel.send_bytes(message)
        else:  # as `send_bytes` does: the length in four bytes, network order, then the message
            self._unsent = memoryview(struct.pack("!i", len(message)) + message)
            self.go_on()

    def go_on(self) -> None:
        """Write what the channel takes."""
        if not self._unsent:
            return
        descriptor = self._channel.fileno()
        os.set_blocking(descriptor, False)
        try:
            while self._unsent:
                self._unsent = self._unsent[os.write(descriptor, self._unsent[:WRITE_BYTES]) :]
        except BlockingIOError:
            return
        finally:
            os.set_blocking(descriptor, True)

    def finish(self) -> None:
        """Write the rest of a message that has begun, however long the screen takes: another one follows."""
        while self._unsent:
            self._unsent = self._unsent[os.write(self._channel.fileno(), self._unsent) :]


class UpdateReader:
    """The screen's end: makes whole pictures of the messages, of each of them in their order."""

    def __init__(self) -> None:
        self._parts: tuple[list[Any], ...] = [], [], []

    def picture(self, message: UpdateMessage) -> BenchUpdate:
        for known, (size, changed) in zip(self._parts, message.changed, strict=True):
            if len(known) != size:
                known[:] = [None] * size
            for place, part in changed:
                known[place] = part
        instances, connections, data = map(tuple, self._parts)
        update = message.update
        snapshot = replace(update.snapshot, instances=instances, connections=connections, data=data)
        lines = tuple(starmap(_line, message.lines))
        return replace(update, snapshot=snapshot, lines=lines)


def _line(seq: int, scan: int, t_ns: int, kind: Any, *fields: Any) -> Line:
    return Line(seq, scan, t_ns, fields[0] if kind is None else kind(*fields))
