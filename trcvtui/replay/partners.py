"""The partners of a recorded run repeat their acts for a bench whose calls differ from the recorded calls.

Rule 1: a partner does not react. If a partner would see the PLC act otherwise or at another time, the
answer is a guess from scan `guess_from` on (docs/recording.md, "What if").
Rule 2: a scan gets what came in the same scan of the recorded run: bytes, an end, a client, a refusal.
"""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from functools import partialmethod
from typing import Final, TypeVar, cast

from trcvtui.net.connection.connection import SocketUse
from trcvtui.net.kernel import Handle, KernelLoss, LocalAddress, NewClient, PathInfo
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock
from trcvtui.recording.journal import STEP, CallRecord
from trcvtui.recording.replay import ReplaySeam
from trcvtui.replay.recorded_run import (
    CLOSED,
    LASTING_CALLS,
    MOST_UNREAD_BYTES,
    NEVER_PLACE,
    OWN_CALLS,
    RESET,
    SHUT,
    UNKNOWN_END,
    CallPlace,
    DatedMessage,
    DialledAttempt,
    InheritedSocket,
    Partner,
    PlcAct,
    RecordedRun,
)

T = TypeVar("T")
FIRST_MADE: Final = 1 << 32  # the number of the first socket; smaller ones were there before the file begins
LAST_CALL: Final = 1 << 30  # a call after all others of a scan


class GuessReason(StrEnum):
    """Why an answer is a guess from a scan on."""

    PARTNER = "partner"  # it would have seen something else of us, or at another time
    BYTES = "bytes"  # they are in no entry
    TIME = "time"  # something came between two scans of the run that asks


class _Socket:
    """One handle of the asking bench. Only an active CONNECT has an `attempt`. `partner` is the far end."""

    def __init__(self, owner: str) -> None:
        self.owner = owner
        self.port = UNKNOWN_END
        self.listens = self.is_polled = False
        self.is_udp = self.is_hearing = False
        self.attempt: DialledAttempt | None = None
        self.partner: Partner | None = None
        self.read = self.sent = 0


class ReplayedPartners(ReplaySeam):
    """A seam on which partners repeat their acts. `peers` has the names of the bench's own peers.

    `recorded` advances with the recorded run, which runs first. If the scan intervals of the asking bench
    and of the recorded run differ, `intervals_ns` has both. Then each scan runs at a multiple of the asking
    bench's interval. Before this scan, the recorded run has done its scans up to that time and one more.
    From scan `guess_from` of the recorded run on, the answer is a guess. If `guess_from` is None, the
    answer is no guess.
    """

    def __init__(self, recorded: RecordedRun, peers: Collection[str]) -> None:
        super().__init__(iter(() if recorded.begins is None else (recorded.begins,)), "what-if")
        self.guess_from: int | None = None
        self.guess_why: GuessReason | None = None
        self.bytes_read = 0
        self.peers = peers
        self.intervals_ns: tuple[int, int] | None = None
        self._is_on_time = True  # a scan of the recorded run began when this one does
        self._recorded = recorded
        self.scan = recorded.first
        self._steps = 0
        self._calls = 0
        self._is_between = False
        # By handle; the owner of one from before the file may be unknown.
        self._sockets = defaultdict[int, _Socket](lambda: _Socket(""))
        self._made = FIRST_MADE
        self._seen: dict[Handle, str] = {}
        self._sessions: set[str] = set()  # owners of connections with a session
        self._datagrams_read: Counter[str] = Counter()
        self._newest: dict[tuple[str, str], tuple[CallPlace, object]] = {}
        self._nth = Counter[tuple[str, str]]()
        self._calls_at = {
            name.removeprefix("_at_").replace("port_", "port "): getattr(self, name)
            for name in dir(self)
            if name.startswith("_at_")
        }
        for one in recorded.inherited_sockets:
            self._sockets[one.handle] = self._make_inherited(one)

    def _make_inherited(self, one: InheritedSocket) -> _Socket:
        socket = _Socket(one.owner)
        socket.listens = one.use is SocketUse.LISTENS
        socket.is_udp = one.use is SocketUse.DATAGRAMS
        socket.is_hearing = one.handle in self._recorded.hearing
        socket.is_polled = True
        socket.partner = self._recorded.inherited_partners.get(one.handle)
        socket.attempt = self._recorded.inherited_attempts.get(one.handle)
        return socket

    def ask(self, owner: str, call: str, args: tuple[object, ...], do: Callable[[], T]) -> T:
        if call in OWN_CALLS:
            return do()
        if call == STEP:
            return cast(T, do() if self._is_between else self._begin_scan())
        if self.is_busy and owner not in self.peers:
            self._calls += 1
        found = self._calls_at.get(call)
        if owner in self.peers and args and type(args[0]) is int and args[0] < FIRST_MADE:
            args = (~args[0], *args[1:])  # one from before the file: no CONNECT may have its number
        if found is None:
            return cast(T, self._get_recorded_answer(owner, call))
        return cast(T, found(owner, *args))

    @contextmanager
    def pause_partners(self) -> Iterator[None]:
        """Let scans pass that the recorded run only counted; meanwhile the partners do nothing."""
        self._is_between, self._calls = True, LAST_CALL
        try:
            yield
        finally:
            self._is_between = False

    def bind_call(
        self, name: str, do: Callable[..., T] | None, owners: Mapping[Handle, str], label: str
    ) -> Callable[..., T]:
        nothing = cast(Callable[[], T], None)
        return lambda handle, *args: self.ask(owners.get(handle, label), name, (handle, *args), nothing)

    @property
    def due_ns(self) -> int:
        """Return when the next scan of a bench with another interval begins."""
        return self._steps * self.intervals_ns[0] if self.intervals_ns is not None else 0

    @property
    def slack_ns(self) -> int:
        """Return by how much two scans may differ in time, and still count as simultaneous."""
        return (min(self.intervals_ns) - 1) // 2 if self.intervals_ns is not None else 0

    def _begin_scan(self) -> int:
        recorded = self._recorded
        self._calls = 0
        self._nth.clear()
        if self.intervals_ns is None:
            self.scan += 1
            if self.scan <= recorded.scan:
                self._now = recorded.take_scan_time(self.scan)
        else:
            self._advance_to(self.due_ns)
            self._steps += 1
        if self.scan in recorded.failures:  # an internal error stopped a part there, here not
            self.note_guess(GuessReason.PARTNER)
        if recorded.is_broken:
            self.note_guess(GuessReason.BYTES)
        return self._now

    def _advance_to(self, due: int) -> None:
        recorded, latest = self._recorded, due + self.slack_ns
        while self.scan < recorded.scan and recorded.take_scan_time(self.scan + 1) <= latest:
            self.scan += 1
            if recorded.injected_scan == self.scan:
                self.note_guess(GuessReason.TIME)  # a planned fault counts calls
        self._now = due
        self._is_on_time = (
            self.scan > recorded.first and recorded.take_scan_time(self.scan) >= due - self.slack_ns
        )
        if not self._is_on_time and recorded.arrival_scan > self.scan:
            self.note_guess(GuessReason.TIME)  # something came between two recorded scans

    def compare_scan(self) -> None:
        """Find out, after a scan, whether partners see other acts of the PLC than the recorded ones."""
        recorded, before = self._recorded, self.scan
        for socket in self._sockets.values():
            partner = socket.partner
            if partner is not None:
                self._drop_missed_acts(partner.acts, before, partner.ended_in_fault)
                unread = self._arrivals(socket) - socket.read
                if unread > max(partner.most_unread, MOST_UNREAD_BYTES):
                    self.note_guess(GuessReason.PARTNER)  # the window closes
                if partner.may_be_held_back and socket.read >= partner.whole:
                    self.note_guess(GuessReason.PARTNER)  # its window was closed: it would send more now
        for written in recorded.written.values():
            self._drop_missed_acts(written, before)
        for attempts in recorded.attempts.values():
            if attempts and attempts[0].began <= before:
                self.note_guess(GuessReason.PARTNER)  # it was called then, and is not now
        for owner in {*recorded.listening, *(one.owner for one in self._sockets.values() if one.listens)}:
            if owner and owner not in self.peers:
                self._compare_listening(owner, before)
        while recorded.dropped and recorded.dropped[0][0] <= before:
            _, owner, read = recorded.dropped.pop(0)
            if self._datagrams_read[owner] > read:
                self.note_guess(GuessReason.PARTNER)  # there is room now

    def _drop_missed_acts(self, acts: deque[PlcAct], before: int, is_deaf: bool = False) -> None:
        while acts and acts[0].scan <= before:
            acts.popleft()
            if not is_deaf:  # a partner that has reset sees nothing more
                self.note_guess(GuessReason.PARTNER)

    def _compare_listening(self, owner: str, before: int) -> None:
        listens = any(one.owner == owner and one.listens for one in self._sockets.values())
        if listens and not self._recorded.listens(owner, before):
            self.note_guess(GuessReason.PARTNER)
        clients = self._recorded.clients.get(owner)
        if not listens and clients and clients[0].since.scan <= before:
            self.note_guess(GuessReason.PARTNER)

    def _take(self, acts: deque[PlcAct], what: tuple[object, ...], is_deaf: bool = False) -> PlcAct | None:
        """Remove and return the next recorded act if it is `what` in this scan. Else return None."""
        if acts and acts[0].scan == self.scan and acts[0].what == what and self._is_on_time:
            return acts.popleft()
        if not is_deaf:
            self.note_guess(GuessReason.PARTNER)
        return None

    def note_guess(self, why: GuessReason) -> None:
        if self.guess_from is None:
            self.guess_from, self.guess_why = max(self.scan, 1), why

    def _has_come(self, at: CallPlace) -> bool:
        return at <= (self.scan, self._calls)

    def _get_recorded_answer(self, owner: str, call: str) -> object:
        key = owner, call
        self._nth[key] += LAST_CALL if self._is_between else 1
        now, answers = CallPlace(self.scan, self._nth[key]), self._recorded.answers.get(key)
        while answers and answers[0][0] <= now:
            at, answer = answers.popleft()
            self._newest[key] = at, answer
        at, newest = self._newest.get(key, (NEVER_PLACE, None))
        is_once = call not in LASTING_CALLS or (isinstance(newest, Fault) and newest.injected)
        return newest if at == now or not is_once else None

    def peek_call(self) -> CallRecord | None:
        """Return None: WhatIf reads the commands of the journal for this bench."""
        return None

    def check_end(self) -> None:
        """Do nothing: there is no journal to end."""

    # -- calls of a kernel -----------------------------------------------------------------------------

    def _at_socket(self, owner: str, is_udp: bool = False) -> int | Fault:
        if owner not in self.peers:
            failed = self._get_recorded_answer(owner, "datagram_socket" if is_udp else "socket")
            if isinstance(failed, Fault):
                return failed
        self._made += 1
        socket = self._sockets[self._made] = _Socket(owner)
        socket.is_udp = is_udp
        return self._made

    _at_datagram_socket = partialmethod(_at_socket, is_udp=True)

    def _at_local_addresses(self, owner: str) -> object:
        known = self._get_recorded_answer(owner, "local_addresses")
        found = known if isinstance(known, tuple) else ()
        return tuple([each for each in found if isinstance(each, LocalAddress)])

    def _at_is_free(self, owner: str, end: Endpoint) -> bool:
        return self._get_recorded_answer(owner, "is_free") is not False

    def _at_link(self, owner: str, up: bool) -> tuple[str, str]:
        return "", "as it was recorded"

    def _at_set_link(self, owner: str, up: bool) -> str:
        return ""

    def _at_set_options(self, owner: str, *args: object) -> object:
        if args[-1]:
            self._sessions.add(owner)
        refused = self._get_recorded_answer(owner, "set_options")
        return refused if isinstance(refused, tuple) else ()

    def _at_bind(self, owner: str, handle: int, end: Endpoint) -> object:
        self._sockets[handle].port = end
        self._sockets[handle].is_hearing = end.address in self._recorded.broadcasts
        return None if owner in self.peers else self._get_recorded_answer(owner, "bind")

    def _at_local_end(self, owner: str, handle: int) -> object:
        found = self._get_recorded_answer(owner, "local_end")
        return found if isinstance(found, Endpoint) else self._sockets[handle].port

    def _at_listen(self, owner: str, handle: int, backlog: int) -> object:
        failed = None if owner in self.peers else self._get_recorded_answer(owner, "listen")
        self._sockets[handle].listens = failed is None
        clients = self._recorded.clients.get(owner)
        if clients and clients[0].since.scan <= self.scan:
            self.note_guess(GuessReason.PARTNER)  # it came before there is a listener
        return failed

    def _at_poll_add(self, owner: str, handle: int) -> object:
        self._sockets[handle].is_polled = True
        return self._get_recorded_answer(owner, "poll_add")

    def _at_poll_del(self, owner: str, handle: int) -> object:
        self._sockets[handle].is_polled = False
        self._seen.pop(Handle(handle), None)
        return self._get_recorded_answer(owner, "poll_del")

    def _at_poll(self, owner: str) -> None:
        if owner not in self.peers:
            self._seen = {
                Handle(h): s.owner for h, s in self._sockets.items() if s.is_polled and self._is_ready(s)
            }

    def _at_ready_handles(self, owner: str) -> dict[Handle, str] | None:
        return None if self.scan in self._recorded.looks_at_all else dict(self._seen)

    def _at_readable(self, owner: str, handle: int) -> bool:
        return handle in self._seen

    def _at_renew(self, owner: str, handle: int) -> bool:
        socket = self._sockets[handle]
        if self._is_ready(socket):
            self._seen[Handle(handle)] = socket.owner
        return self._is_over(socket)

    def _is_ready(self, socket: _Socket) -> bool:
        if socket.owner in self.peers:
            return False
        if socket.listens:
            clients = self._recorded.clients.get(socket.owner)
            return bool(clients and self._has_come(clients[0].since))
        if socket.is_udp:
            return self._peek(socket) is not None
        if socket.attempt is not None:
            return self._has_come(socket.attempt.answered)
        return self._arrivals(socket) > socket.read or self._peek(socket) is not None or self._is_over(socket)

    def _arrivals(self, socket: _Socket) -> int:
        """Return how many bytes have come in all, whether their contents are known or not."""
        return (
            socket.partner.arrived_by(CallPlace(self.scan, self._calls)) if socket.partner is not None else 0
        )

    def _peek(self, socket: _Socket) -> DatedMessage | None:
        if socket.is_udp:
            messages = self._recorded.datagrams.get((socket.owner, socket.is_hearing))
        else:
            messages = socket.partner.messages if socket.partner is not None else None
        return messages[0] if messages and self._has_come(messages[0][0]) else None

    def _is_over(self, socket: _Socket) -> bool:
        return socket.partner is not None and self._has_come(socket.partner.ended)

    def _at_accept(self, owner: str, handle: int) -> object:
        clients = self._recorded.clients.get(owner)
        if owner in self.peers or not clients or not self._has_come(clients[0].since):
            return WOULD_BLOCK
        partner = clients.popleft()
        if partner.accepted > (self.scan, LAST_CALL):  # what it is and sends is known only from its accept on
            self.note_guess(GuessReason.BYTES)
        if partner.refused is not None:
            return partner.refused
        if owner in self._sessions and partner.accepted.scan != self.scan:
            self.note_guess(GuessReason.PARTNER)  # our side of the handshake comes at another time
        for socket in self._sockets.values():
            if socket.owner == owner and socket.partner is not None:
                self._end_if_released(socket.partner)
        made = self._at_socket(owner)
        if isinstance(made, Fault):
            return made
        self._sockets[made].partner = partner
        self._sockets[made].port = self._sockets[handle].port
        return NewClient(Handle(made), partner.end)

    def _end_if_released(self, partner: Partner) -> None:
        if partner.ended is NEVER_PLACE and partner.released_at <= (self.scan, self._calls):
            partner.ended = CallPlace(self.scan)

    def _at_connect(self, owner: str, handle: int, end: Endpoint) -> object:
        if owner in self.peers:
            return None
        attempts = self._recorded.attempts.get(owner)
        if not attempts or attempts[0].began != self.scan:
            self.note_guess(GuessReason.PARTNER)  # it is called, but not at the same time
        while attempts and attempts[0].is_over_before(self.scan):
            attempts.popleft()
        if not attempts:
            return None
        attempt = self._sockets[handle].attempt = attempts.popleft()
        return attempt.answer if attempt.is_at_once else None

    def _at_connect_result(self, owner: str, handle: int) -> object:
        socket = self._sockets[handle]
        attempt = socket.attempt
        if attempt is None or not self._has_come(attempt.answered):
            return WOULD_BLOCK
        socket.attempt = None
        socket.partner = attempt.partner
        return attempt.answer

    def _at_recv(self, owner: str, handle: int, size: int) -> tuple[int | WouldBlock | Fault, bytes]:
        socket = self._sockets[handle]
        partner = socket.partner
        if owner in self.peers or partner is None:
            return WOULD_BLOCK, b""
        failed = self._get_recorded_answer(owner, "recv")
        fault = failed[0] if isinstance(failed, tuple) else None
        if isinstance(fault, Fault) and fault.error == "EAGAIN":
            return fault, b""
        if not partner.is_known and partner.read < socket.read + size:
            self.note_guess(GuessReason.BYTES)
        there = self._arrivals(socket)
        size = min(size, there - socket.read)
        if size > 0:
            data = partner.bytes_at(socket.read, socket.read + size)
            if data is None:
                self.note_guess(GuessReason.BYTES)
            socket.read += size
            self.bytes_read += size
            self._recorded.forget_bytes(partner, socket.read)
            return size, bytes(size) if data is None else data
        if self._is_over(socket):
            return partner.fault or 0, b""
        return WOULD_BLOCK, b""

    def _at_recv_from(
        self, owner: str, handle: int, size: int
    ) -> tuple[Datagram | WouldBlock | Fault, bytes]:
        socket = self._sockets[handle]
        found = self._peek(socket)
        if owner in self.peers or found is None:
            if not self._recorded.knows_earlier_messages(owner, socket.partner):
                self.note_guess(GuessReason.BYTES)
            fault = socket.partner.fault if socket.partner is not None else None
            return (fault if fault is not None and self._is_over(socket) else WOULD_BLOCK), b""
        hears = owner, socket.is_hearing
        messages = socket.partner.messages if socket.partner is not None else self._recorded.datagrams[hears]
        _, was, data = messages.popleft()
        if isinstance(was, Fault):
            return was, b""
        self._recorded.kept -= len(data)
        self._datagrams_read[owner] += 1
        socket.read += 1
        if len(data) < was.size:
            self.note_guess(GuessReason.BYTES)
        size = min(size, was.size)
        self.bytes_read += size
        return Datagram(size, was.source, was.whole), data[:size].ljust(size, b"\0")

    def _at_loss(self, owner: str, handle: int) -> KernelLoss | None:
        socket = self._sockets[handle]
        if socket.partner is None or not self._is_over(socket):
            return None
        return KernelLoss(socket.partner.fault, self._count_unread(socket))

    def _at_discard(self, owner: str, handle: int, most: int) -> int:
        socket = self._sockets[handle]
        size = min(most, self._count_unread(socket))
        socket.read += size
        return size

    def _count_unread(self, socket: _Socket) -> int:
        return max(0, self._arrivals(socket) - socket.read)  # bytes, or messages

    def _at_unread(self, owner: str, handle: int) -> int:
        socket = self._sockets.get(handle)
        return 0 if socket is None else self._count_unread(socket)

    def _at_path(self, owner: str, handle: int) -> object:
        known = self._get_recorded_answer(owner, "path")
        return known if isinstance(known, PathInfo) else None

    def _at_send(self, owner: str, handle: int, size: int, check: int) -> object:
        socket = self._sockets[handle]
        partner = socket.partner
        if partner is None:
            return WOULD_BLOCK
        is_deaf = partner.ended_in_fault and self._is_over(socket)
        same = self._take(partner.acts, (size, check), is_deaf)
        failed = self._get_recorded_answer(owner, "send")
        if isinstance(failed, Fault):
            return failed
        if is_deaf:
            return partner.fault
        taken = size
        if same is not None:
            taken = same.answer if isinstance(same.answer, int) else 0
        elif not partner.took_all:  # its window was closed: no more fits than then
            taken = max(0, min(size, partner.taken - socket.sent))
        socket.sent += taken
        return taken or WOULD_BLOCK

    def _at_send_to(self, owner: str, handle: int, size: int, check: int, end: Endpoint) -> object:
        if owner in self.peers:
            return WOULD_BLOCK
        self._take(self._recorded.written.get(owner, deque()), (size, check, end))
        failed = self._get_recorded_answer(owner, "send_to")
        return failed if isinstance(failed, Fault) else size

    def _at_shutdown(self, owner: str, handle: int, both: bool) -> object:
        partner = self._sockets[handle].partner
        if partner is not None:
            self._take(partner.acts, (SHUT,), partner.ended_in_fault)
        return self._get_recorded_answer(owner, "shutdown")

    def _at_close(self, owner: str, handle: int, call: str = CLOSED) -> object:
        socket = self._sockets.pop(handle, None)
        self._seen.pop(Handle(handle), None)
        partner = socket.partner if socket is not None else None
        if socket is not None and partner is not None:  # a close with unread bytes sends RST (RFC 1122)
            how = RESET if call == RESET or self._arrivals(socket) > socket.read else CLOSED
            self._take(partner.acts, (how,), partner.ended_in_fault and self._is_over(socket))
        failed = self._get_recorded_answer(owner, call)
        return failed if isinstance(failed, Fault) else None

    _at_abort = partialmethod(_at_close, call=RESET)

    # -- a serial line ---------------------------------------------------------------------------------

    def _at_port_read(self, owner: str, most: int) -> object:
        parts = self._recorded.serial.get(owner)
        failed = self._get_recorded_answer(owner, "port read")
        if isinstance(failed, Fault):
            return failed
        if not parts or not self._has_come(parts[0][0]):
            return b""
        at, data = parts.popleft()
        if len(data) > most:
            parts.appendleft((at, data[most:]))
        self.bytes_read += len(data[:most])
        return data[:most]

    def _at_port_write(self, owner: str, size: int, check: int) -> object:
        self._take(self._recorded.written.get(owner, deque()), (size, check))
        failed = self._get_recorded_answer(owner, "port write")
        return failed if isinstance(failed, Fault) else size

    def _at_port_arrive(self, owner: str, size: int, check: int) -> bool:
        return True
