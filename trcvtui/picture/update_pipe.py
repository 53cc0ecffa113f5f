"""The transport of a picture from the engine to the screen: a pickle with the changed parts of the snapshot.

Rule 1: the cost depends on the changed parts only. For unchanged parts the screen keeps its objects.
Rule 2: pickling and writing stop when a gap ends. As a picture never changes, they go on in the next gap.
Rule 3: a screen that does not read never delays a scan. The engine writes only what the channel takes.
"""

from __future__ import annotations

import os
import pickle
import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from itertools import chain, starmap
from multiprocessing.connection import Connection as Channel
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

from msgspec.structs import replace

from trcvtui import clock
from trcvtui.plc.ledger import Line

if TYPE_CHECKING:
    from trcvtui.picture.bench_update import BenchUpdate

SLICE_ITEMS: Final = 64  # parts or lines: 200 us at most
WRITE_BYTES: Final = 1 << 16  # with one write: about 10 us
READ_BYTES: Final = 1 << 18
LENGTH_HEAD: Final = struct.Struct("!i")  # before each message, as in multiprocessing
MOST_PICTURE: Final = (1 << 31) - 1  # bytes: the largest length in the head

T = TypeVar("T")


class UpdateMessage(NamedTuple):
    """A picture without its ledger lines and the parts of its snapshot. Lines and parts follow in slices.

    `parts` has, for each kind, the number of parts and the number of slices that carry the changed parts.
    """

    update: BenchUpdate
    parts: list[tuple[int, int]]
    lines: int  # slices


class UpdatePipe:
    """The engine's end of the pipe to the screen; it writes one picture at a time."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._sent: Sequence[tuple[Any, ...]] = (), (), ()  # parts of the picture before
        self._pickling: Iterator[bytes] | None = None
        self._unsent = memoryview(b"")

    def is_busy(self) -> bool:
        return self._pickling is not None or bool(self._unsent)

    def begin(self, picture: BenchUpdate) -> None:
        self._pickling = self._pickle_picture(picture)

    def advance(self, deadline_ns: int) -> None:
        """Pickle and write until `deadline_ns`, but at least one slice. Stop when the channel is full."""
        while self._pickling is not None:
            message = next(self._pickling)
            if message:
                self._pickling = None
                self.post(message)
            if clock.now_ns() >= deadline_ns:  # rule 2
                return
        while self._unsent and self._write() and clock.now_ns() < deadline_ns:
            pass

    def finish(self) -> None:
        """Write the rest of an unfinished message, however long that takes; then the next one can begin."""
        while self._unsent:
            self._unsent = self._unsent[os.write(self._channel.fileno(), self._unsent) :]

    def _pickle_picture(self, picture: BenchUpdate) -> Iterator[bytes]:
        """Yield b"" before each slice, and the whole message at the end."""
        snapshot = picture.snapshot
        kinds = snapshot.instances, snapshot.connections, snapshot.data
        changed = [  # rule 1: the parts of a snapshot are frozen, so identity is enough
            [*_slices([(n, part) for n, part in enumerate(kind) if n >= len(sent) or part is not sent[n]])]
            for kind, sent in zip(kinds, self._sent, strict=True)
        ]
        lines = [*_slices(picture.lines)]
        update = replace(picture, lines=(), snapshot=replace(snapshot, instances=(), connections=(), data=()))
        parts = [(len(kind), len(slices)) for kind, slices in zip(kinds, changed, strict=True)]
        content = BytesIO()
        dump = pickle.Pickler(content, pickle.HIGHEST_PROTOCOL).dump
        dump(UpdateMessage(update, parts, len(lines)))
        for some in chain(*changed, (map(_flatten_line, each) for each in lines)):
            yield b""
            dump([*some])
        self._sent = kinds
        yield content.getvalue()

    def post(self, message: bytes) -> None:
        if sys.platform == "win32":
            self._channel.send_bytes(message)
        else:
            self._unsent = memoryview(LENGTH_HEAD.pack(len(message)) + message)

    def _write(self) -> bool:
        descriptor = self._channel.fileno()
        os.set_blocking(descriptor, False)  # rule 3
        try:
            self._unsent = self._unsent[os.write(descriptor, self._unsent[:WRITE_BYTES]) :]
        except OSError as why:
            if not isinstance(why, BlockingIOError):
                self._unsent = self._unsent[:0]  # the screen is gone: the engine notices it when it reads
            return False
        finally:
            os.set_blocking(descriptor, True)
        return True


class MessageReader:
    """Reads complete messages of at most `most` bytes from a channel. The reader never waits for bytes."""

    def __init__(self, channel: Channel, most: int) -> None:
        self._channel, self._most = channel, most
        self._bytes = bytearray()
        self._has_ended = False

    def read_message(self) -> bytes | None:
        """Return the next message, or None while it is incomplete. Raise EOFError after the last one."""
        if sys.platform == "win32":
            return self._channel.recv_bytes(self._most) if self._channel.poll() else None
        while True:
            if len(self._bytes) >= LENGTH_HEAD.size:
                end = LENGTH_HEAD.size + (size := LENGTH_HEAD.unpack_from(self._bytes)[0])
                if not 0 <= size <= self._most:  # a damaged or hostile head
                    raise OSError(f"a message of {size} bytes")
                if len(self._bytes) >= end:
                    message = bytes(memoryview(self._bytes)[LENGTH_HEAD.size : end])
                    del self._bytes[:end]
                    return message
            if self._has_ended:
                raise EOFError
            if not self._read_channel():
                return None

    def _read_channel(self) -> bool:
        descriptor = self._channel.fileno()
        os.set_blocking(descriptor, False)
        try:
            read = os.read(descriptor, READ_BYTES)
        except BlockingIOError:
            return False
        except OSError:  # a reset: the other end ended with unread bytes; its own messages are already read
            read = b""
        finally:
            os.set_blocking(descriptor, True)
        self._bytes += read
        self._has_ended = not read
        return True


class UpdateReader(MessageReader):
    """The screen's end of the pipe.

    Waiting for a whole picture would freeze the screen: the engine writes it in the gaps of several scans.
    """

    def __init__(self, channel: Channel) -> None:
        super().__init__(channel, MOST_PICTURE)
        self._parts: Sequence[list[Any]] = [], [], []  # of the last picture

    def next(self) -> Any:
        """Return the next message, decoded, None while it is incomplete; join the slices of a picture."""
        message = self.read_message()
        return None if message is None else self._load_message(message)

    def _load_message(self, message: bytes) -> Any:
        load = pickle.Unpickler(BytesIO(message)).load
        sent = load()
        return self._merge_picture(sent, load) if isinstance(sent, UpdateMessage) else sent

    def _merge_picture(self, sent: UpdateMessage, load: Callable[[], Any]) -> BenchUpdate:
        for known, (size, slices) in zip(self._parts, sent.parts, strict=True):
            known[size:] = [None] * (size - len(known))
            for place, part in chain.from_iterable(load() for _ in range(slices)):
                known[place] = part
        lines = starmap(_restore_line, chain.from_iterable(load() for _ in range(sent.lines)))
        instances, connections, data = map(tuple, self._parts)
        snapshot = replace(sent.update.snapshot, instances=instances, connections=connections, data=data)
        return replace(sent.update, snapshot=snapshot, lines=tuple(lines))


def _slices(items: Sequence[T]) -> Iterator[Sequence[T]]:
    return (items[first : first + SLICE_ITEMS] for first in range(0, len(items), SLICE_ITEMS))


# A line pickled as a plain tuple takes a quarter of the time.


def _flatten_line(line: Line) -> tuple[Any, ...]:
    seq, scan, t_ns, event = line
    kind, *fields = (event.__class__, *event) if isinstance(event, tuple) else (None, event)
    return seq, scan, t_ns, kind, fields


def _restore_line(seq: int, scan: int, t_ns: int, kind: Any, fields: list[Any]) -> Line:
    return Line(seq, scan, t_ns, fields[0] if kind is None else kind(*fields))
