"""The observers of a tap all read the same pcapng. Guests connect to a Unix socket with mode 0600.

Rule: an observer that does not read misses blocks, which are counted. No other observer waits for it.
"""

from __future__ import annotations

import os
import socket
import stat
import struct
import time
from collections.abc import Sequence
from contextlib import suppress
from itertools import takewhile
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from trcvtui.errors import UserError, mistake
from trcvtui.files import reason_of
from trcvtui.net.os.lossy_pipe import LossyPipe
from trcvtui.net.os.system_calls import IN, new_poll_set, poll_once
from trcvtui.net.os.tap_channels import ORDERS, RECORDER, SCREEN
from trcvtui.net.os.tap_lane import TapLoop
from trcvtui.net.tap import END_KINDS, LOSS, RELEASE_LINE, USER_LINE, TapEvent, TapEventKind, read_events

PEER_CREDENTIALS: Final = struct.Struct("iII")  # of SO_PEERCRED: process, user, group
MOST_PATH_BYTES: Final = 107  # bytes of `sun_path`
MOST_OBSERVERS: Final = 8
FLUSH_NS: Final = 1_000_000_000  # for observers to read the rest at the end
CONNECT_TIMEOUT_S: Final = 1.0  # for a tap to accept a connection, and to send the first byte
LISTENER_CHECK_NS: Final = 5_000_000_000  # between two checks whether the socket's file is still ours
FIRST_PAUSE_NS, MOST_PAUSE_NS = 1_000_000_000, 60_000_000_000  # before the next attempt to listen


def _require_private_path(path: Path) -> str:
    with suppress(OSError):  # without a folder there is no socket either
        folder = os.lstat(path.parent)
        is_ours = stat.S_ISDIR(folder.st_mode) and folder.st_uid == os.geteuid()
        # In a folder that others may write, another user could put a socket in place of ours.
        if not is_ours or folder.st_mode & 0o077:
            found = f"mode {folder.st_mode & 0o777:o}" if is_ours else "a link, or another user's folder"
            raise mistake(str(path.parent), found, "a folder of yours, mode 700: set XDG_RUNTIME_DIR")
    if len(os.fsencode(path)) > MOST_PATH_BYTES:
        raise mistake(str(path), f"a name of {len(os.fsencode(path))} bytes", f"at most {MOST_PATH_BYTES}")
    return str(path)


def is_trusted(peer: socket.socket) -> bool:
    """Return whether the other end is a process of this user or of root."""
    option = getattr(socket, "SO_PEERCRED", None)
    if option is None:  # only Linux has it; elsewhere the mode of the folder has to protect us
        return True
    _, user, _ = PEER_CREDENTIALS.unpack(peer.getsockopt(socket.SOL_SOCKET, option, PEER_CREDENTIALS.size))
    return user in (0, os.geteuid())


def connect_to_tap(path: Path, expected: str) -> int:
    """Return the descriptor of a connection to the tap at a path; raise UserError if that fails."""
    name, made = _require_private_path(path), socket.socket(socket.AF_UNIX)
    made.settimeout(CONNECT_TIMEOUT_S)
    found = "no tap"
    try:
        made.connect(name)
        found = "a tap of another user"
        if not is_trusted(made):
            raise PermissionError
        found = "a tap that sends nothing"  # the system connects us to a process that hangs, too
        if not made.recv(1, socket.MSG_PEEK):
            raise ConnectionResetError
        made.setblocking(True)
    except OSError:
        made.close()
        raise mistake(str(path), found, expected) from None
    return made.detach()


def listen_at(path: Path) -> socket.socket:
    """Listen at a path; replace a dead program's socket. Raise UserError if it is in use, or on failure."""
    made = socket.socket(socket.AF_UNIX)
    try:
        # Only a socket that refuses a connection is that of a dead program.
        with socket.socket(socket.AF_UNIX) as rival, suppress(FileNotFoundError, ConnectionRefusedError):
            rival.settimeout(CONNECT_TIMEOUT_S)
            rival.connect(_require_private_path(path))
            raise mistake(str(path), "another tap that listens there", "only one tap of this project")
        with suppress(FileNotFoundError):
            if not stat.S_ISSOCK(os.lstat(path).st_mode):
                raise mistake(str(path), "a file", "nothing, or the socket of a tap")
            os.unlink(path)
        before = os.umask(0o177)  # mode 0600 from the start: chmod after bind would leave a gap
        try:
            made.bind(str(path))
        finally:
            os.umask(before)
        made.listen(MOST_OBSERVERS)
    except OSError as failed:
        made.close()
        raise mistake(str(path), reason_of(failed), "a place for a socket") from None
    except BaseException:
        made.close()
        raise
    return made


class Encoder(Protocol):
    """Makes the pcapng for observers, event by event."""

    def encode_head(self, ns: int) -> bytes: ...

    def encode_event(self, event: TapEvent) -> bytes: ...

    def encode_interfaces(self, since: int) -> list[bytes]:
        """Return the pcapng blocks that declare serial lines, without the first `since` blocks."""

    def encode_loss(self, ns: int, dropped: int, events: int, size: int) -> bytes:
        """Return the block for a loss of one observer. `dropped` events were lost since it connected."""

    def encode_open_talks(self) -> bytes:
        """Return the blocks for the open conversations."""


class ObserverKind(NamedTuple):
    """A kind of observer: which events it reads, and how many bytes may wait for it.

    If `holds`, the tap may hold all directions from its start until the observer leaves.
    """

    events: frozenset[int]
    most: int = 64 << 20
    holds: bool = False
    is_guest: bool = False


_ALL: Final = frozenset(int(kind) for kind in TapEventKind)
GUEST_KIND: Final = ObserverKind(_ALL, 8 << 20, is_guest=True)
# Observers that the tap starts, by the byte that is sent with their socket.
OBSERVER_KINDS: Final = {
    SCREEN: ObserverKind(_ALL, holds=True),
    RECORDER: ObserverKind(_ALL - {TapEventKind.NOW, TapEventKind.FIGURES}),  # a silent line fills no disk
    ORDERS: ObserverKind(frozenset({TapEventKind.REFUSED, TapEventKind.LACK}), holds=True),
}


class Observer:
    def __init__(self, server: ObserverServer, sock: socket.socket, kind: ObserverKind) -> None:
        self.kind = kind
        self._server, self._capture = server, server.capture
        self._has_ordered, self._is_refused = kind.holds, False
        lines = self._capture.encode_interfaces(0)
        self._lines, self._newest = len(lines), server.newest  # the newest conversation that it knows
        self._dropped = 0  # events that it missed
        self.pipe = LossyPipe(server.loop, sock, kind.most, self._report_missed, self._on_order, self._on_end)
        # At once: the first picture of a screen shows all open conversations, and keys act on them.
        self.pipe.put(
            b"".join([self._capture.encode_head(time.time_ns()), *lines, self._capture.encode_open_talks()])
        )

    def handle_events(self, events: Sequence[tuple[TapEvent, bytes]]) -> None:
        """Send the observer the blocks of events."""
        # Ends are never lost: else this observer would keep the conversation open for ever.
        kept = [block for event, block in events if event.kind in END_KINDS and event.number <= self._newest]
        size = sum(len(event.data) for event, _ in events if event.kind == TapEventKind.BYTES)
        size += sum(LOSS.unpack_from(event.data)[1] for event, _ in events if event.kind == TapEventKind.LOST)
        blocks = b"".join([block for _, block in events])
        self._write_blocks(blocks, len(events) - len(kept), size, b"".join(kept))
        if not self.pipe.is_behind:
            self._newest = max(
                [self._newest, *[event.number for event, _ in events if event.kind == TapEventKind.OPEN]]
            )

    def _write_blocks(self, blocks: bytes, events: int = 0, size: int = 0, ends: bytes = b"") -> None:
        for line in self._capture.encode_interfaces(self._lines):  # an interface comes before its packets
            self.pipe.put(line, events=0)
            self._lines += not self.pipe.is_behind
        self.pipe.put(blocks, events=events, size=size, ends=ends)

    def _report_missed(self, events: int, size: int, ends: bytes) -> None:
        self._dropped += events
        loss = self._capture.encode_loss(time.time_ns(), self._dropped, events, size) if events else b""
        self._write_blocks(loss + ends + self._capture.encode_open_talks())
        self._newest = self._server.newest

    def _on_order(self, line: bytes) -> None:
        if self.kind.is_guest and not self._server.may_order:
            if not self._is_refused:
                self._is_refused = True
                self._server.notify("an observer gives orders, which needs `trcvtui tap --allow-orders`")
            return
        self._has_ordered = True
        self._server.send_to_tap(line.lstrip(USER_LINE))  # only the server may write to the user

    def _on_end(self) -> None:
        self._server.remove_observer(self)
        if self._has_ordered:  # held bytes must not wait for an observer that is gone
            self._server.send_to_tap(RELEASE_LINE)


class ObserverServer:
    """Serves observers with a `capture` of the events that the tap reports on `events`.

    The tap passes its own observers' sockets through `channels`. Guests connect to the socket at `path`.
    """

    def __init__(
        self, events: int, channels: int, path: Path | None, may_order: bool, capture: Encoder
    ) -> None:
        self.loop, self.capture, self.may_order = TapLoop(self.notify, new_poll_set()), capture, may_order
        self.newest = 0  # conversation
        self._tap, self._channels = socket.socket(fileno=events), socket.socket(fileno=channels)
        self._path, self._events = path, read_events(self._tap.recv)
        self._observers: tuple[Observer, ...] = ()
        self._has_ended = False
        self._door: socket.socket | None = None
        self._inode, self._pause = 0, FIRST_PAUSE_NS
        self.loop.register(events, IN, self._read_events)

    def run(self) -> None:
        """Serve until the tap ends; then give observers time to read the rest."""
        self._keep_listening()
        while not self._has_ended:
            self.loop.run_once(-1)
        self._close_listener()
        until = time.monotonic_ns() + FLUSH_NS
        for observer in self._observers:
            observer.pipe.send_rest(until)

    # -- the tap ---------------------------------------------------------------------------------------------

    def send_to_tap(self, line: bytes) -> None:
        """Send the tap a line; the tap always reads, so this does not wait."""
        with suppress(OSError):
            self._tap.sendall(line + b"\n")

    def notify(self, text: str) -> None:
        self.send_to_tap(USER_LINE + text.encode())

    def _read_events(self, _: int) -> None:
        try:
            events = next(self._events, None)
        except OSError:
            events = None
        if events is None:
            self._has_ended = True
            self.loop.unregister(self._tap.fileno())
            return
        open_before = [*takewhile(lambda event: event.kind == TapEventKind.OPEN and event.at, events)]
        self._distribute(open_before)  # before the tap's observers are added: their first blocks show these
        while poll_once({self._channels.fileno(): IN}) and self._add_own_observers():
            pass  # an observer that was handed over before an event gets that event
        self._distribute(events[len(open_before) :])

    def _distribute(self, events: Sequence[TapEvent]) -> None:
        wanted = frozenset[int]().union(*[each.kind.events for each in self._observers])
        made = [
            (event, self.capture.encode_event(event))
            for event in events
            if event.kind in wanted or event.kind != TapEventKind.BYTES  # the others change the capture
        ]
        self.newest = max([self.newest, *[e.number for e in events if e.kind == TapEventKind.OPEN]])
        parts: dict[frozenset[int], list[tuple[TapEvent, bytes]]] = {}
        for observer in self._observers:
            kinds = observer.kind.events
            if kinds not in parts:
                parts[kinds] = [each for each in made if each[0].kind in kinds]
            if parts[kinds]:
                observer.handle_events(parts[kinds])

    def _add_own_observers(self) -> bool:
        kind, channels, _, _ = socket.recv_fds(self._channels, 1, 1)
        for channel in channels:
            self._add_observer(socket.socket(fileno=channel), OBSERVER_KINDS[kind])
        return bool(kind)

    # -- observers -------------------------------------------------------------------------------------------

    def _add_observer(self, sock: socket.socket, kind: ObserverKind) -> None:
        self._observers += (Observer(self, sock, kind),)

    def remove_observer(self, observer: Observer) -> None:
        self._observers = tuple([each for each in self._observers if each is not observer])
        if observer.kind.is_guest and not self._has_ended:
            self.notify("an observer has ended; forwarding continues")

    def _accept_guest(self, _: int) -> None:
        assert self._door is not None
        try:
            observer, _ = self._door.accept()
        except OSError:
            return
        if sum(each.kind.is_guest for each in self._observers) >= MOST_OBSERVERS or not is_trusted(observer):
            observer.close()
        else:
            self._add_observer(observer, GUEST_KIND)

    def _keep_listening(self) -> None:
        """Listen for guests; listen again if the socket's file is gone."""
        if self._path is None:
            return
        pause = LISTENER_CHECK_NS
        if not self._is_own_socket(self._path):
            self._close_listener()
            try:
                self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                self._door = listen_at(self._path)
                self._inode = os.stat(self._path).st_ino
                self.loop.register(self._door.fileno(), IN, self._accept_guest)
            except (UserError, OSError) as refused:
                pause, self._pause = self._pause, min(2 * self._pause, MOST_PAUSE_NS)
                self.notify(f"no observers: {refused}; next try in {pause // 10**9} s, forwarding continues")
        self.loop.call_after(pause, self._keep_listening)

    def _is_own_socket(self, path: Path) -> bool:
        with suppress(OSError):
            return os.stat(path).st_ino == self._inode
        return False

    def _close_listener(self) -> None:
        if self._door is not None:
            self.loop.unregister(self._door.fileno())
            self._door.close()
            self._door = None
            if self._path is not None and self._is_own_socket(self._path):  # never delete another tap's
                os.unlink(self._path)
