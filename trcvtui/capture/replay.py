"""A bench on a record: kernel, serial port and bound of work that ask a seam, and a seam that answers.

`Replay` compares each question with the recorded one. A difference is an error of scan, owner and call.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final, NoReturn, TypeVar, cast

from trcvtui.capture.journal import (
    ENDED_HERE,
    GAP,
    READ,
    STEP,
    Answered,
    BesideJournal,
    EntriesLost,
    Entry,
    Note,
    RunBegins,
    Seam,
)
from trcvtui.errors import UserError, mistake
from trcvtui.files import FilesRead
from trcvtui.net.connection.resources import Party, Work
from trcvtui.net.events import What
from trcvtui.net.kernel import (
    Accepted,
    DirectRead,
    Handle,
    Kernel,
    LocalAddress,
    SocketOptions,
)
from trcvtui.net.layers.layer_kernel import ReadyKernel, nothing_known
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock
from trcvtui.net.serial_line import Opening, SerialPort

T = TypeVar("T")


class Replay:
    """Answers from entries of a kind that was looked at; `tell` writes what a call had told into the ledger.

    `begins` is the first entry, where it is one of a run; `files` are what was read up to here.
    """

    answers = True
    is_busy = True
    is_off = False

    def __init__(self, entries: Iterator[Entry], where: str) -> None:
        self._entries = entries
        self._where = where
        self.scan = self._now = 0
        self.tell: Callable[[Note], None] = lambda note: None
        self._known: dict[tuple[str, str, tuple[object, ...]], object] = {}  # what gaps have told
        self._front = next(entries, None)
        self.begins: RunBegins | None = None
        self.files = FilesRead()
        if isinstance(self._front, RunBegins):
            self.begins = self._front
            self.files = FilesRead(self.begins.folder, self.begins.files, self.begins.digests)
            self._front = next(entries, None)

    def ask(self, owner: str, call: str, args: tuple[object, ...], do: Callable[[], T]) -> T:
        """Return what was answered; raise UserError where something else was asked then."""
        if not self.is_busy:
            return cast(T, self._known_in_gap(owner, call, args))
        if call == STEP:
            self.scan += 1
        entry = self._front
        if type(entry) is not Answered or entry[1] != call or entry[0] != owner or entry[2] != args:
            entry = self._found(owner, call, args)
        answer = entry[3]
        if call == STEP:
            if cast(int, answer) < self._now:
                raise self._wrong(_words(owner, call, args), "a time that does not go back")
            self._now = cast(int, answer)
        self._front = next(self._entries, None)
        return cast(T, answer)

    def call(
        self, name: str, do: Callable[..., T] | None, owners: Mapping[Handle, str], label: str
    ) -> Callable[..., T]:
        """Return what asks this call."""
        nothing = cast(Callable[[], T], None)
        return lambda handle, *args: self.ask(owners.get(handle, label), name, (handle, *args), nothing)

    def _found(self, owner: str, call: str, args: tuple[object, ...]) -> Answered:
        """Return the entry of a question, after notes and gaps; raise UserError for another question."""
        entry = self._front
        while not isinstance(entry, Answered) or entry.call.startswith(GAP):
            if entry is None or isinstance(entry, RunBegins | EntriesLost):
                self._differs(entry, _words(owner, call, args))
            self._pass(entry)
            entry = self._front
        if entry[:3] != (owner, call, args):
            self._differs(entry, _words(owner, call, args))
        return entry

    def _pass(self, entry: Answered | Note | BesideJournal) -> None:
        """Go past a note, which is told, or what was asked in a gap, which is remembered."""
        self._front = next(self._entries, None)
        if isinstance(entry, BesideJournal):
            return
        if not isinstance(entry, Answered):
            self.tell(entry)
            return
        owner, call, args, answer = entry
        if call == READ:
            self.files.take(cast(str, args[0]), cast(bytes | str, answer))
        elif call == GAP + "path" and [*map(type, args)] == [int]:
            self._known[owner, "path", args] = answer

    def _known_in_gap(self, owner: str, call: str, args: tuple[object, ...]) -> object:
        """Return what was told in this gap or the newest before; None: nobody has asked that."""
        while isinstance(self._front, Answered) and self._front.call.startswith(GAP):
            found = self._front[:3] == (owner, GAP + call, args)
            self._pass(self._front)
            if found:
                break
        return self._known.get((owner, call, args))

    def told(self, note: Note) -> None:
        """Do nothing: only the PLC and the bench tell anything here, and nobody keeps it."""

    def wire(
        self, owner: str, call: str, handle: int, args: tuple[object, ...], answer: object, data: bytes
    ) -> None:
        """Do nothing: no wire is there."""

    def coming(self) -> Answered | None:
        """Return what the bench was told next, or asked; None: the journal is at its end."""
        while (entry := self._front) is not None and not isinstance(entry, RunBegins | EntriesLost):
            if isinstance(entry, Answered) and not entry.call.startswith(GAP):
                return entry
            self._pass(entry)
        return None

    @property
    def lost(self) -> str:
        """Return what was not recorded here, "" where the journal goes on or has ended."""
        front = self._front
        return f"a gap of {front.number} entries ({front.why})" if isinstance(front, EntriesLost) else ""

    @property
    def is_ended(self) -> bool:
        """Return whether somebody has ended the recording here, while the run went on."""
        return isinstance(self._front, EntriesLost) and self._front.why == ENDED_HERE

    def end(self) -> None:
        """Raise UserError where the journal goes on after the run has ended."""
        entry = self.coming() or self._front
        if entry is not None:
            self._differs(entry, "nothing more")

    def _differs(self, recorded: Entry | None, now: str) -> NoReturn:
        match recorded:
            case Answered():
                was = f"{_words(*recorded[:3])}, which was recorded"
            case EntriesLost(number, why):
                was = f"{number} entries that were not recorded: {why}"
            case _:
                was = "the end of the journal, which was recorded"
        raise self._wrong(now, was)

    def _wrong(self, now: str, was: str) -> UserError:
        return mistake(f"{self._where}: scan {self.scan}", now, was)


def _words(owner: str, call: str, args: tuple[object, ...]) -> str:
    return f"{call} {_shown(args)} of {owner}"


def _shown(args: tuple[object, ...]) -> str:
    return "(" + ", ".join(str(each) for each in args)[:200] + ")"


def _of_nobody(make: Callable[[], T], answers: bool) -> T:
    """Return what is asked by a recorder; a replay asks nothing and has nothing."""
    return cast(T, None) if answers else make()


PLAIN: Final = (  # calls whose arguments and answers are kept as they are
    *("set_reuse", "bind", "listen", "local_end", "poll_add", "poll_del", "resolve", "connect"),
    *("connect_result", "loss", "discard", "unread", "path", "probe", "readable", "renew"),
    "set_user_timeout",
)


class _SeamKernel:
    """A kernel that asks its seam: recorded around `inner`, or answered without it."""

    def __init__(self, seam: Seam, label: str, inner: Kernel | None) -> None:
        self._seam, self._label = seam, label
        self._inner = cast(Kernel, inner)
        self._owners: dict[Handle, str] = {}
        for name in PLAIN:
            setattr(self, name, self._plain(name))
        self._buffer = memoryview(b"")  # of the call under way: what is kept has its size alone
        self._accept = self._plain("accept")
        self._recv = seam.call("recv", self._do_recv, self._owners, label)
        self._send = seam.call("send", self._do_send, self._owners, label)

    def __getstate__(self) -> dict[str, object]:
        """Return what a keyframe keeps: between two calls nobody reads the buffer."""
        return self.__dict__ | {"_buffer": memoryview(b"")}

    def _plain(self, name: str) -> Callable[..., Any]:
        return self._seam.call(name, getattr(self._inner, name, None), self._owners, self._label)

    def _owner(self, handle: Handle) -> str:
        return self._owners.get(handle, self._label)

    def local_addresses(self) -> tuple[LocalAddress, ...]:
        return self._seam.ask(self._label, "local_addresses", (), lambda: self._inner.local_addresses())

    def set_link(self, owner: str, up: bool) -> str:
        return self._seam.ask(owner, "set_link", (up,), lambda: self._inner.set_link(owner, up))

    def poll(self) -> None:
        self._seam.ask(self._label, "poll", (), lambda: self._inner.poll())

    def ready_handles(self) -> dict[Handle, str] | None:
        def do() -> dict[Handle, str] | None:
            seen = getattr(self._inner, "ready_handles", nothing_known)()
            return None if seen is None else dict(seen)

        return self._seam.ask(self._label, "ready_handles", (), do)

    def socket(self, owner: str) -> Handle | Fault:
        return self._mine(owner, self._seam.ask(owner, "socket", (), lambda: self._inner.socket(owner)))

    def datagram_socket(self, owner: str) -> Handle | Fault:
        do = lambda: self._inner.datagram_socket(owner)  # noqa: E731
        return self._mine(owner, self._seam.ask(owner, "datagram_socket", (), do))

    def _mine(self, owner: str, made: Handle | Fault) -> Handle | Fault:
        if not isinstance(made, Fault):
            self._owners[made] = owner
        return made

    def set_options(self, handle: Handle, options: SocketOptions) -> tuple[str, ...]:
        asked = options.nodelay, options.keep_alive_s, options.user_timeout_ms, options.small_buffers
        args = (handle, *asked, options.session is not None)
        return self._seam.ask(
            self._owner(handle), "set_options", args, lambda: self._inner.set_options(handle, options)
        )

    def accept(self, handle: Handle) -> Accepted | WouldBlock | Fault:
        got: Accepted | WouldBlock | Fault = self._accept(handle)
        if isinstance(got, Accepted):
            self._owners[got.handle] = self._owner(handle)
        return got

    def recv(self, handle: Handle, into: memoryview) -> int | WouldBlock | Fault:
        self._buffer = into
        got, data = self._recv(handle, len(into))
        if data and self._seam.answers:
            into[: len(data)] = data
        return got

    def _do_recv(self, handle: Handle, size: int) -> tuple[int | WouldBlock | Fault, bytes]:
        got = self._inner.recv(handle, self._buffer)
        if isinstance(got, int) and not self._seam.is_off:
            return got, bytes(self._buffer[:got])
        return got, b""

    def recv_from(self, handle: Handle, into: memoryview) -> Datagram | WouldBlock | Fault:
        def do() -> tuple[Datagram | WouldBlock | Fault, bytes]:
            got = self._inner.recv_from(handle, into)
            return got, bytes(into[: got.size]) if isinstance(got, Datagram) else b""

        got, data = self._seam.ask(self._owner(handle), "recv_from", (handle, len(into)), do)
        into[: len(data)] = data
        return got

    def direct_read(self, handle: Handle) -> DirectRead | None:
        """Return one that tells what it reads; None in a replay, which reads by `recv`."""
        direct = None if self._seam.answers else self._inner.direct_read(handle)
        if direct is None:
            return None
        seam, owner = self._seam, self._owner(handle)

        def told(into: bytearray | memoryview, size: int) -> tuple[int, bytes]:
            seam.wire(owner, "recv", handle, (len(into),), size, b"")
            return size, bytes(into[:size])

        def read(into: bytearray | memoryview) -> int:
            size = direct.read(into)
            if size == len(into) and not seam.is_off:
                seam.ask(owner, "recv", (handle, size), lambda: told(into, size))
            return size

        def read_on(into: memoryview, size: int) -> int:
            whole = direct.read_on(into, size)
            if not seam.is_off:
                seam.ask(owner, "recv", (handle, len(into)), lambda: told(into, whole))
            return whole

        def unasked(size: int) -> None:
            seam.ask(owner, "recv", (handle, size), lambda: (WOULD_BLOCK, b""))

        return DirectRead(read, read_on, direct.failed, unasked)

    def send(self, handle: Handle, data: memoryview) -> int | WouldBlock | Fault:
        self._buffer = data
        return self._send(handle, len(data), zlib.crc32(data))

    def _do_send(self, handle: Handle, size: int, check: int) -> int | WouldBlock | Fault:
        return self._inner.send(handle, self._buffer)

    def send_to(self, handle: Handle, data: memoryview, end: Endpoint) -> int | WouldBlock | Fault:
        args = handle, len(data), zlib.crc32(data), end
        return self._seam.ask(
            self._owner(handle), "send_to", args, lambda: self._inner.send_to(handle, data, end)
        )

    def shutdown(self, handle: Handle, both: bool = True) -> Fault | None:
        return self._seam.ask(
            self._owner(handle), "shutdown", (handle, both), lambda: self._inner.shutdown(handle, both)
        )

    def abort(self, handle: Handle) -> Fault | None:
        owner = self._owners.pop(handle, self._label)
        return self._seam.ask(owner, "abort", (handle,), lambda: self._inner.abort(handle))

    def close(self, handle: Handle) -> Fault | None:
        owner = self._owners.pop(handle, self._label)
        return self._seam.ask(owner, "close", (handle,), lambda: self._inner.close(handle))


def seam_kernel(seam: Seam, label: str, make: Callable[[], Kernel]) -> ReadyKernel:
    """Return a kernel of the seam; `make` gives the one to be recorded, and is not called by a replay."""
    return cast(ReadyKernel, _SeamKernel(seam, label, _of_nobody(make, seam.answers)))


class SeamPort:
    """A serial port that asks its seam."""

    def __init__(self, seam: Seam, owner: str, make: Callable[[], SerialPort]) -> None:
        self._seam, self._owner = seam, owner
        self._inner = _of_nobody(make, seam.answers)

    def open(self) -> Fault | Opening | None:
        """Open it."""
        return self._seam.ask(self._owner, "port open", (), lambda: self._inner.open())

    def read(self, most: int) -> bytes | Fault:
        """Return the bytes that have come."""
        got = self._seam.ask(self._owner, "port read", (most,), lambda: self._inner.read(most))
        self._seam.wire(self._owner, "port read", 0, (), None, got if isinstance(got, bytes) else b"")
        return got

    def write(self, payload: bytes) -> int | Fault:
        """Hand bytes over."""
        args = len(payload), zlib.crc32(payload)
        taken = self._seam.ask(self._owner, "port write", args, lambda: self._inner.write(payload))
        data = payload[:taken] if isinstance(taken, int) else b""
        self._seam.wire(self._owner, "port write", 0, (), None, data)
        return taken

    def close(self) -> None:
        """Give the port back."""
        self._seam.ask(self._owner, "port close", (), lambda: self._inner.close())

    def arrive(self, payload: bytes) -> bool:
        """Let bytes come over a simulated line."""
        args = len(payload), zlib.crc32(payload)
        return self._seam.ask(self._owner, "port arrive", args, lambda: self._inner.arrive(payload))


class SeamWork(Work):
    """The bound of a scan's work, of which handshakes and records below the seam take their part, too."""

    def __init__(self, seam: Seam, clock: Callable[[], int]) -> None:
        super().__init__(clock)
        self._seam = seam

    def grant(self, party: Party) -> int:
        """Return what a party has in this scan."""
        return self._seam.ask(party.owner, "grant", (party.what,), lambda: Work.grant(self, party))

    def wait(self, party: Party, partner: str, what: What) -> None:
        """Keep a share of the next scan for a party."""
        self._seam.ask(party.owner, "wait", (partner, what), lambda: Work.wait(self, party, partner, what))
