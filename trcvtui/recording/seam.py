"""The seam: the calls that leave a bench, and a recorder that makes these calls and keeps the answers.

Rule 1: a bench reaches kernel, serial ports, the bound of work and commands only through its seam.
Rule 2: if a layer calls the network inside a call, only the ledger notes of the inner call are kept.
Rule 3: calls at the PLC's wire are kept as well, for the packets of a recording (wire.py).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol, TypeVar, cast

from trcvtui.net.connection.resources import BudgetShare, ScanBudget
from trcvtui.net.events import EventKind
from trcvtui.net.kernel import Handle, Kernel, LocalAddress, NewClient, SocketOptions
from trcvtui.net.layers.layer_kernel import ReadyListKernel, unknown_ready_handles
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock
from trcvtui.net.serial_line import LineErrors, PortOpening, SerialPort
from trcvtui.recording.arrivals import DISCARD_FLAG, ArrivalRecorder
from trcvtui.recording.journal import BUFFER_CALLS, IN_GAP, STEP, CallRecord, Entry, LedgerNote, WireCall

T = TypeVar("T")


class Seam(Protocol):
    """Where calls leave a bench. A recorder makes the calls and keeps answers; a replay returns these."""

    @property
    def has_answers(self) -> bool:
        """Return whether the answers come from a recording, so that no call is really made."""

    write_note: Callable[[LedgerNote], None]  # writes a note into the ledger
    is_busy: bool  # False in the gaps between scans and commands
    is_off: bool  # nothing is kept any more

    def ask(self, owner: str, call: str, args: tuple[object, ...], do: Callable[[], T]) -> T: ...

    def bind_call(
        self, name: str, do: Callable[..., T] | None, owners: Mapping[Handle, str], label: str
    ) -> Callable[..., T]:
        """Return a function for a kernel call; its arguments are a handle and values, which are kept."""

    def handle_ledger_note(self, note: LedgerNote) -> None:
        """Keep a note that a replay cannot make again. The bench writes the note just after this call."""

    def note_call(
        self, owner: str, call: str, handle: int, args: tuple[object, ...], answer: object, data: bytes
    ) -> None:
        """Keep a call that the PLC made at the wire; a replay does nothing."""


_NEW_TUPLE: Final = tuple.__new__  # makes a NamedTuple faster than its own `__new__`


class SeamRecorder:
    """Makes each call and passes the call's entry to `keep`. A live run sets `clock`, which returns ns."""

    has_answers = False
    is_busy = True

    def __init__(self, keep: Callable[[Entry], None]) -> None:
        self._keep = keep
        self.clock: Callable[[], int] = int
        self._step = self._stepped = 0
        self.write_note: Callable[[LedgerNote], None] = lambda note: None
        self._is_inside = False
        self.is_off = False

    def stop_recording(self) -> None:
        self.is_off = self._is_inside = True  # as inside a call: nothing is kept

    def ask(self, owner: str, call: str, args: tuple[object, ...], do: Callable[[], T]) -> T:
        if self._is_inside:  # Rule 2
            return do()
        self._is_inside = True
        try:
            answer = do()
        finally:
            self._is_inside = False
        if call == STEP and isinstance(answer, int):  # packets of this scan have the time since then
            self._step, self._stepped = answer, self.clock()
        self._keep(_NEW_TUPLE(CallRecord, (owner, call if self.is_busy else IN_GAP + call, args, answer)))
        return answer

    def bind_call(
        self, name: str, do: Callable[..., T] | None, owners: Mapping[Handle, str], label: str
    ) -> Callable[..., T]:
        assert do is not None
        keep, in_gap = self._keep, IN_GAP + name

        def record_call(handle: Handle, *args: object) -> T:
            if self._is_inside:
                return do(handle, *args)
            self._is_inside = True
            try:
                answer = do(handle, *args)
            finally:
                self._is_inside = False
            entry = owners.get(handle, label), name if self.is_busy else in_gap, (handle, *args), answer
            keep(_NEW_TUPLE(CallRecord, entry))
            return answer

        return record_call

    def note_arrival(self, owner: str, call: str, args: tuple[object, ...], answer: object) -> None:
        """Keep a note of unread bytes; a replay skips such notes."""
        if not self.is_off:
            self._keep(_NEW_TUPLE(CallRecord, (owner, IN_GAP + call, args, answer)))

    def note_call(
        self, owner: str, call: str, handle: int, args: tuple[object, ...], answer: object, data: bytes
    ) -> None:
        if self.is_off:
            return
        at = self._step + self.clock() - self._stepped
        self._keep(WireCall(at, owner, call, handle, args, answer, data))

    def handle_ledger_note(self, note: LedgerNote) -> None:
        """Keep a note from inside a call; a replay makes all other notes of the PLC and the bench again."""
        if self._is_inside and not self.is_off:
            self._keep(note)

    def add_outside_note(self, note: LedgerNote) -> None:
        """Keep a note from outside the bench, before the next entry."""
        self._keep(note)


# -- the kernel, ports, the bound of work ------------------------------------------------------------------


def _make_unless_replay(make: Callable[[], T], answers: bool) -> T:
    return cast(T, None) if answers else make()


def _note_owner(owners: dict[Handle, str], owner: str, made: Handle | Fault) -> Handle | Fault:
    if not isinstance(made, Fault):
        owners[made] = owner
    return made


PLAIN_CALLS: Final = (  # calls whose arguments and answers are kept as they are
    *("set_reuse", "bind", "listen", "local_end", "poll_add", "poll_del", "resolve", "connect"),
    *("connect_result", "loss", "discard", "unread", "path", "probe", "readable", "renew"),
    *("set_user_timeout", "set_broadcast"),
)


class _SeamKernel:
    """A kernel that passes calls to its seam. `inner` makes the calls; in a replay there is no `inner`."""

    def __init__(self, seam: Seam, label: str, inner: Kernel | None) -> None:
        self._seam, self._label = seam, label
        self._inner = cast(Kernel, inner)
        self._owners: dict[Handle, str] = {}
        self._bind_calls()

    def _bind_calls(self) -> None:
        for name in PLAIN_CALLS:
            setattr(self, name, self._bind_plain_call(name))
        self._buffer = memoryview(b"")  # of the present call; its entry has the size alone
        self._accept = self._bind_plain_call("accept")
        self._recv = self._seam.bind_call("recv", self._do_recv, self._owners, self._label)
        self._send = self._seam.bind_call("send", self._do_send, self._owners, self._label)

    def __getstate__(self) -> dict[str, object]:
        return {name: self.__dict__[name] for name in ("_seam", "_label", "_inner", "_owners")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind_calls()

    def _bind_plain_call(self, name: str) -> Callable[..., Any]:
        return self._seam.bind_call(name, getattr(self._inner, name, None), self._owners, self._label)

    def _owner_of(self, handle: Handle) -> str:
        return self._owners.get(handle, self._label)

    def local_addresses(self) -> tuple[LocalAddress, ...]:
        return self._seam.ask(self._label, "local_addresses", (), lambda: self._inner.local_addresses())

    def set_link(self, owner: str, up: bool) -> str:
        return self._seam.ask(owner, "set_link", (up,), lambda: self._inner.set_link(owner, up))

    def poll(self) -> None:
        self._seam.ask(self._label, "poll", (), lambda: self._inner.poll())

    def ready_handles(self) -> dict[Handle, str] | None:
        def get_ready() -> dict[Handle, str] | None:
            seen = getattr(self._inner, "ready_handles", unknown_ready_handles)()
            return None if seen is None else dict(seen)

        return self._seam.ask(self._label, "ready_handles", (), get_ready)

    def socket(self, owner: str) -> Handle | Fault:
        made = self._seam.ask(owner, "socket", (), lambda: self._inner.socket(owner))
        return _note_owner(self._owners, owner, made)

    def datagram_socket(self, owner: str) -> Handle | Fault:
        do = lambda: self._inner.datagram_socket(owner)  # noqa: E731
        return _note_owner(self._owners, owner, self._seam.ask(owner, "datagram_socket", (), do))

    def set_options(self, handle: Handle, options: SocketOptions) -> tuple[str, ...]:
        asked = options.nodelay, options.keep_alive_s, options.user_timeout_ms, options.small_buffers
        args = (handle, *asked, options.session is not None)
        return self._seam.ask(
            self._owner_of(handle), "set_options", args, lambda: self._inner.set_options(handle, options)
        )

    def accept(self, handle: Handle) -> NewClient | WouldBlock | Fault:
        got: NewClient | WouldBlock | Fault = self._accept(handle)
        if isinstance(got, NewClient):
            self._owners[got.handle] = self._owner_of(handle)
        return got

    def recv(self, handle: Handle, into: memoryview) -> int | WouldBlock | Fault:
        self._buffer = into
        got, data = self._recv(handle, len(into))
        if data and self._seam.has_answers:  # a kernel has filled it itself
            into[: len(data)] = data
        return got

    def _do_recv(self, handle: Handle, size: int) -> tuple[int | WouldBlock | Fault, bytes]:
        got = self._inner.recv(handle, self._buffer)
        if isinstance(got, int) and not self._seam.is_off:  # no copy when nothing is kept
            return got, bytes(self._buffer[:got])
        return got, b""

    def recv_from(self, handle: Handle, into: memoryview) -> Datagram | WouldBlock | Fault:
        def receive() -> tuple[Datagram | WouldBlock | Fault, bytes]:
            got = self._do_recv_from(handle, into)
            return got, bytes(into[: got.size]) if isinstance(got, Datagram) else b""

        got, data = self._seam.ask(self._owner_of(handle), "recv_from", (handle, len(into)), receive)
        into[: len(data)] = data
        return got

    def _do_recv_from(self, handle: Handle, into: memoryview) -> Datagram | WouldBlock | Fault:
        return self._inner.recv_from(handle, into)

    def note_arrivals(self) -> None:
        """Do nothing: a replay has the notes in its journal, and bytes at peers are not noted."""

    def send(self, handle: Handle, data: memoryview) -> int | WouldBlock | Fault:
        self._buffer = data
        return self._send(handle, len(data), zlib.crc32(data))  # enough to compare: a replay sends the same

    def _do_send(self, handle: Handle, size: int, check: int) -> int | WouldBlock | Fault:
        return self._inner.send(handle, self._buffer)

    def send_to(self, handle: Handle, data: memoryview, end: Endpoint) -> int | WouldBlock | Fault:
        args = handle, len(data), zlib.crc32(data), end
        return self._seam.ask(
            self._owner_of(handle), "send_to", args, lambda: self._inner.send_to(handle, data, end)
        )

    def shutdown(self, handle: Handle, both: bool = True) -> Fault | None:
        return self._seam.ask(
            self._owner_of(handle), "shutdown", (handle, both), lambda: self._inner.shutdown(handle, both)
        )

    def abort(self, handle: Handle) -> Fault | None:
        owner = self._owners.pop(handle, self._label)
        return self._seam.ask(owner, "abort", (handle,), lambda: self._inner.abort(handle))

    def close(self, handle: Handle) -> Fault | None:
        owner = self._owners.pop(handle, self._label)
        return self._seam.ask(owner, "close", (handle,), lambda: self._inner.close(handle))


_datagram_buffer: Final = memoryview(bytearray(1 << 16))  # no datagram is larger


class _RecordedKernel(_SeamKernel):
    """The kernel of a recorded PLC: it also notes the bytes that the PLC has not read yet."""

    def __init__(self, seam: SeamRecorder, label: str, inner: Kernel) -> None:
        super().__init__(seam, label, inner)
        self._arrivals = ArrivalRecorder(seam, inner, self._owners, label)
        calls = ("listen", "connect_result", "readable", "renew", "discard", "poll_del")
        self._calls = {name: cast(Callable[..., Any], self.__dict__.pop(name)) for name in calls}

    def note_arrivals(self) -> None:
        if not self._seam.is_off:
            self._arrivals.note_all_unread()

    def ready_handles(self) -> dict[Handle, str] | None:
        seen = super().ready_handles()
        self._arrivals.note_poll(seen)
        return seen

    def readable(self, handle: Handle) -> bool:
        if is_readable := bool(self._calls["readable"](handle)):
            self._arrivals.note_ready(handle)
        return is_readable

    def renew(self, handle: Handle) -> bool:
        self._arrivals.note_ready(handle)
        return bool(self._calls["renew"](handle))

    def listen(self, handle: Handle, backlog: int) -> Fault | None:
        failed: Fault | None = self._calls["listen"](handle, backlog)
        if failed is None:
            self._arrivals.add_listener(handle)
        return failed

    def poll_del(self, handle: Handle) -> Fault | None:
        self._arrivals.note_unread(handle)  # afterwards the kernel does not see an end
        failed: Fault | None = self._calls["poll_del"](handle)
        return failed

    def accept(self, handle: Handle) -> NewClient | WouldBlock | Fault:
        got = super().accept(handle)
        if isinstance(got, NewClient):
            self._arrivals.add_handle(got.handle)
        elif isinstance(got, WouldBlock):  # a client that comes now is late
            self._arrivals.note_empty(handle)
        return got

    def connect_result(self, handle: Handle) -> WouldBlock | Fault | None:
        answer: WouldBlock | Fault | None = self._calls["connect_result"](handle)
        if answer is None:
            self._arrivals.add_handle(handle)
        return answer

    def datagram_socket(self, owner: str) -> Handle | Fault:
        made = super().datagram_socket(owner)
        if not isinstance(made, Fault):
            self._arrivals.add_handle(made, is_udp=True)
        return made

    def _do_recv(self, handle: Handle, size: int) -> tuple[int | WouldBlock | Fault, bytes]:
        got, data = super()._do_recv(handle, size)
        if isinstance(got, int) or got is WOULD_BLOCK:
            self._arrivals.note_read(handle, got if isinstance(got, int) else 0, size)
        return got, data

    def _do_recv_from(self, handle: Handle, into: memoryview) -> Datagram | WouldBlock | Fault:
        got = self._inner.recv_from(handle, _datagram_buffer)  # whole, even if `into` takes less
        if not isinstance(got, Datagram):
            if got is WOULD_BLOCK:
                self._arrivals.note_empty(handle)
            return got
        self._arrivals.note_message_read(handle, got.source, bytes(_datagram_buffer[: got.size]), got.whole)
        size = min(got.size, len(into))
        into[:size] = _datagram_buffer[:size]
        return Datagram(size, got.source, got.whole)

    def discard(self, handle: Handle, most: int) -> int:
        self._arrivals.note_unread(handle, DISCARD_FLAG)
        gone: int = self._calls["discard"](handle, most)
        self._arrivals.note_read(handle, gone, gone)
        return gone

    def abort(self, handle: Handle) -> Fault | None:
        return self._note_and_free(handle, super().abort)

    def close(self, handle: Handle) -> Fault | None:
        return self._note_and_free(handle, super().close)

    def _note_and_free(self, handle: Handle, free: Callable[[Handle], Fault | None]) -> Fault | None:
        self._arrivals.note_unread(handle, DISCARD_FLAG)
        self._arrivals.forget(handle)
        return free(handle)


class SeamKernel(ReadyListKernel, Protocol):
    def note_arrivals(self) -> None:
        """Note what is unread after a scan, if the run is recorded."""


def wrap_kernel(seam: Seam, label: str, make: Callable[[], Kernel], is_noted: bool = False) -> SeamKernel:
    """Return a kernel at the seam; `make` makes the kernel inside it. A replay does not call `make`."""
    if is_noted and isinstance(seam, SeamRecorder):
        return cast(SeamKernel, _RecordedKernel(seam, label, make()))
    return cast(SeamKernel, _SeamKernel(seam, label, _make_unless_replay(make, seam.has_answers)))


class SeamPort:
    """A serial port whose calls go through its seam."""

    def __init__(self, seam: Seam, owner: str, make: Callable[[], SerialPort]) -> None:
        self._seam, self._owner = seam, owner
        self._inner = _make_unless_replay(make, seam.has_answers)

    def open(self) -> Fault | PortOpening | None:
        return self._seam.ask(self._owner, "port open", (), lambda: self._inner.open())

    def read(self, most: int) -> bytes | Fault:
        got = self._seam.ask(self._owner, "port read", (most,), lambda: self._inner.read(most))
        self._seam.note_call(self._owner, "port read", 0, (), None, got if isinstance(got, bytes) else b"")
        return got

    def write(self, payload: bytes) -> int | Fault:
        args = len(payload), zlib.crc32(payload)
        taken = self._seam.ask(self._owner, "port write", args, lambda: self._inner.write(payload))
        data = payload[:taken] if isinstance(taken, int) else b""
        self._seam.note_call(self._owner, "port write", 0, (), None, data)
        return taken

    def close(self) -> None:
        self._seam.ask(self._owner, "port close", (), lambda: self._inner.close())

    def simulate_arrival(self, payload: bytes) -> bool:
        args = len(payload), zlib.crc32(payload)
        return self._seam.ask(self._owner, "port arrive", args, lambda: self._inner.simulate_arrival(payload))

    def line_errors(self) -> LineErrors | None:
        counted = self._seam.ask(self._owner, "port errors", (), lambda: self._inner.line_errors())
        self._seam.note_call(self._owner, "port errors", 0, (), counted, b"")
        return counted


class SeamBudget(ScanBudget):
    """The bound of a scan's work. Handshakes and records below the seam also count as work of the scan."""

    def __init__(self, seam: Seam, clock: Callable[[], int]) -> None:
        super().__init__(clock)
        self._seam = seam

    def grant(self, party: BudgetShare) -> int:
        return self._seam.ask(party.owner, "grant", (party.what,), lambda: ScanBudget.grant(self, party))

    def note_waiting(self, party: BudgetShare, partner: str, what: EventKind) -> None:
        self._seam.ask(
            party.owner, "wait", (partner, what), lambda: ScanBudget.note_waiting(self, party, partner, what)
        )


# -- the wire ----------------------------------------------------------------------------------------------

WIRE_CALLS: Final = (  # calls of which packets are made
    *("bind", "local_end", "connect", "connect_result", "accept", "recv", "recv_from", "send", "send_to"),
    *("shutdown", "close", "abort", "loss"),
)


class _WireKernel:
    """A kernel that passes all calls to `inner`. Calls at the wire are also noted at the seam."""

    def __init__(self, seam: Seam, inner: Kernel, is_next: bool) -> None:
        self._seam, self._inner, self._is_next = seam, inner, is_next
        self._owners: dict[Handle, str] = {}
        for name in WIRE_CALLS:
            setattr(self, name, self._wrap_call(name))

    def __getattr__(self, name: str) -> object:
        return getattr(self._inner, name)

    def local_addresses(self) -> tuple[LocalAddress, ...]:
        found = self._inner.local_addresses()
        self._seam.note_call("", "local_addresses", 0, (), found, b"")
        return found

    def socket(self, owner: str) -> Handle | Fault:
        return _note_owner(self._owners, owner, self._inner.socket(owner))

    def datagram_socket(self, owner: str) -> Handle | Fault:
        return _note_owner(self._owners, owner, self._inner.datagram_socket(owner))

    def _wrap_call(self, name: str) -> Callable[..., object]:
        call, wire, owners = getattr(self._inner, name), self._seam.note_call, self._owners
        has_bytes, is_last = name in BUFFER_CALLS, name in ("close", "abort")
        is_in_entry = self._is_next and name in ("recv", "recv_from")

        def call_and_note(handle: Handle, *args: object) -> object:
            unread = (self._inner.unread(handle),) if name == "close" else ()  # FIN or RST? (wire.py)
            answer = call(handle, *args)
            if isinstance(answer, WouldBlock) or (name == "loss" and answer is None):
                return answer  # nothing has crossed the wire
            owner = owners.pop(handle, "") if is_last else owners.get(handle, "")
            data = b""
            if has_bytes:
                size = answer.size if isinstance(answer, Datagram) else answer
                view, *args_left = args
                args = (len(view), *args_left)  # type: ignore[arg-type]
                if isinstance(size, int) and not is_in_entry:
                    data = bytes(view[:size])  # type: ignore[index]
            elif isinstance(answer, NewClient):
                owners[answer.handle] = owner
            wire(owner, name, handle, args + unread, answer, data)
            return answer

        return call_and_note


def make_wire_kernel(seam: Seam, kernel: Kernel, is_next: bool) -> ReadyListKernel:
    """Return a kernel that notes calls at the wire. If `is_next`, no layer is between kernel and seam."""
    return cast(ReadyListKernel, _WireKernel(seam, kernel, is_next))
