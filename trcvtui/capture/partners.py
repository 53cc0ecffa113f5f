"""Partners of a recorded run, who do again what they did then, for a bench that asks other questions.

Rule 1: a partner does not react. Where he would have, `guess_from` says so; what follows is a guess.
Rule 2: a scan meets what the recorded run met in that scan: bytes that had come, an end, a client, a refusal.
Rule 3: bytes that nobody has read in the recorded run are a number; nobody knows them.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Final, TypeVar, cast

from trcvtui.capture.journal import STEP, Answered
from trcvtui.capture.recorded_run import (
    NEVER,
    NOBODY,
    STAYS,
    TRANSPARENT,
    CallPlace,
    DatedMessage,
    DialledAttempt,
    Partner,
    RecordedRun,
    Standing,
)
from trcvtui.capture.replay import Replay
from trcvtui.net.connection.connection import SocketUse
from trcvtui.net.kernel import Accepted, Handle, KernelLoss, LocalAddress, PathInfo
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock

T = TypeVar("T")
FIRST_MADE: Final = 1 << 32  # the number of the first socket; smaller ones were there before the file begins
LAST: Final = 1 << 30  # a call after all others of a scan


class _Socket:
    """One handle of the bench that asks. `attempt` is that of an active CONNECT, `partner` who is there."""

    def __init__(self, owner: str) -> None:
        self.owner = owner
        self.port = NOBODY
        self.listens = self.is_polled = False
        self.is_udp = False
        self.attempt: DialledAttempt | None = None
        self.partner: Partner | None = None
        self.read = self.messages_read = self.sent = 0


class _Sockets(dict[int, _Socket]):
    """Sockets by handle; of one that was there before the file begins nobody may know whose it is."""

    def __missing__(self, handle: int) -> _Socket:
        made = self[handle] = _Socket("")
        return made


class PartnersAgain(Replay):
    """A seam on which partners do what they did; `peers` are the names of those that a bench has itself.

    `guess_from`: the first scan in which a partner would perhaps have done something else, None: none.
    """

    def __init__(self, told: RecordedRun, peers: Collection[str]) -> None:
        super().__init__(iter(() if told.begins is None else (told.begins,)), "what-if")
        self.guess_from: int | None = None
        self.bytes_read = 0
        self.peers = peers
        self._told = told
        self.scan = told.first
        self._calls = 0
        self._is_between = False
        self._sockets = _Sockets()
        self._made = FIRST_MADE
        self._seen: dict[Handle, str] = {}
        self._clients = {owner: deque(found) for owner, found in told.clients.items()}
        self._attempts = {owner: deque(found) for owner, found in told.attempts.items()}
        self._datagrams = {owner: deque(found) for owner, found in told.datagrams.items()}
        self._serial = {owner: deque(found) for owner, found in told.serial.items()}
        self._answers = {key: deque(found) for key, found in told.answers.items()}
        self._newest: dict[tuple[str, str], tuple[CallPlace, object]] = {}
        self._nth = Counter[tuple[str, str]]()
        self._calls_at = {
            name.removeprefix("_at_").replace("port_", "port "): getattr(self, name)
            for name in dir(self)
            if name.startswith("_at_")
        }
        for one in told.standing:
            self._sockets[one.handle] = self._standing(one)

    def _standing(self, one: Standing) -> _Socket:
        socket = _Socket(one.owner)
        socket.listens = one.use is SocketUse.LISTENS
        socket.is_udp = one.use is SocketUse.DATAGRAMS
        socket.is_polled = True
        socket.partner = self._told.stands.get(one.handle)
        socket.attempt = self._told.tried.get(one.handle)
        if socket.attempt is not None and self._attempts.get(one.owner):
            self._attempts[one.owner].popleft()
        return socket

    def ask(self, owner: str, call: str, args: tuple[object, ...], do: Callable[[], T]) -> T:
        if call in TRANSPARENT:
            return do()
        if call == STEP:
            return cast(T, do() if self._is_between else self._step())
        if self.is_busy and owner not in self.peers:
            self._calls += 1
        found = self._calls_at.get(call)
        if owner in self.peers and args and type(args[0]) is int and args[0] < FIRST_MADE:
            args = (~args[0], *args[1:])  # it was there before the file begins; no CONNECT has this number
        if found is None:
            return cast(T, self._as_told(owner, call))
        return cast(T, found(owner, *args))

    @contextmanager
    def nothing_coming(self) -> Iterator[None]:
        """Let scans pass that the recorded run has counted and not run: partners do nothing in these."""
        self._is_between, self._calls = True, LAST
        try:
            yield
        finally:
            self._is_between = False

    def call(
        self, name: str, do: Callable[..., T] | None, owners: Mapping[Handle, str], label: str
    ) -> Callable[..., T]:
        nothing = cast(Callable[[], T], None)
        return lambda handle, *args: self.ask(owners.get(handle, label), name, (handle, *args), nothing)

    def _step(self) -> int:
        self.scan += 1
        self._calls = 0
        self._nth.clear()
        times = self._told.times
        if self.scan > self._told.first + 1:
            self._look_back()
        if self.scan in self._told.failures:
            self.note_guess()
        if self.scan <= self._told.scan:
            self._now = times[self.scan - self._told.first - 1]
        return self._now

    def _look_back(self) -> None:
        """Find out whether the scan before has told partners something that they were not told."""
        before = self.scan - 1
        for socket in self._sockets.values():
            partner = socket.partner
            if partner is None or self.guess_from is not None:
                continue
            unread = self._arrived(socket) - socket.read
            if (
                socket.sent != partner.taken_by(before)[0]
                or partner.let_go.scan <= before
                or unread > partner.most_unread
            ):
                self.note_guess()

    def note_guess(self) -> None:
        """Note that from this scan on a partner would perhaps have done something else."""
        if self.guess_from is None:
            self.guess_from = max(self.scan, 1)

    def _has_come(self, at: CallPlace) -> bool:
        return at <= (self.scan, self._calls)

    def _as_told(self, owner: str, call: str) -> object:
        """Return the Fault of the same call in the recorded scan; of a call in STAYS, the newest answer."""
        key = owner, call
        self._nth[key] += LAST if self._is_between else 1
        now, answers = CallPlace(self.scan, self._nth[key]), self._answers.get(key)
        while answers and answers[0][0] <= now:
            at, answer = answers.popleft()
            self._newest[key] = at, answer
        at, newest = self._newest.get(key, (NEVER, None))
        is_of_once = call not in STAYS or (isinstance(newest, Fault) and newest.injected)
        return newest if at == now or not is_of_once else None

    def coming(self) -> Answered | None:
        """Return nothing: who tells this bench what to do has read the journal himself."""
        return None

    def end(self) -> None:
        """Do nothing: no journal has to come to its end."""

    # -- calls of a kernel -----------------------------------------------------------------------------

    def _open(self, owner: str, is_udp: bool = False) -> int | Fault:
        if owner not in self.peers:
            failed = self._as_told(owner, "datagram_socket" if is_udp else "socket")
            if isinstance(failed, Fault):
                return failed
        self._made += 1
        socket = self._sockets[self._made] = _Socket(owner)
        socket.is_udp = is_udp
        return self._made

    def _at_socket(self, owner: str) -> int | Fault:
        return self._open(owner)

    def _at_datagram_socket(self, owner: str) -> int | Fault:
        return self._open(owner, is_udp=True)

    def _at_local_addresses(self, owner: str) -> object:
        known = self._as_told(owner, "local_addresses")
        found = known if isinstance(known, tuple) else ()
        return tuple([each for each in found if isinstance(each, LocalAddress)])

    def _at_is_free(self, owner: str, end: Endpoint) -> bool:
        return self._as_told(owner, "is_free") is not False

    def _at_link(self, owner: str, up: bool) -> tuple[str, str]:
        return "", "as it was recorded"

    def _at_set_link(self, owner: str, up: bool) -> str:
        return ""

    def _at_set_options(self, owner: str, *args: object) -> object:
        refused = self._as_told(owner, "set_options")
        return refused if isinstance(refused, tuple) else ()

    def _at_bind(self, owner: str, handle: int, end: Endpoint) -> object:
        self._sockets[handle].port = end
        return None if owner in self.peers else self._as_told(owner, "bind")

    def _at_local_end(self, owner: str, handle: int) -> object:
        found = self._as_told(owner, "local_end")
        return found if isinstance(found, Endpoint) else self._sockets[handle].port

    def _at_listen(self, owner: str, handle: int, backlog: int) -> object:
        failed = None if owner in self.peers else self._as_told(owner, "listen")
        self._sockets[handle].listens = failed is None
        return failed

    def _at_poll_add(self, owner: str, handle: int) -> object:
        self._sockets[handle].is_polled = True
        return self._as_told(owner, "poll_add")

    def _at_poll_del(self, owner: str, handle: int) -> object:
        self._sockets[handle].is_polled = False
        self._seen.pop(Handle(handle), None)
        return self._as_told(owner, "poll_del")

    def _at_poll(self, owner: str) -> None:
        if owner not in self.peers:
            self._seen = {
                Handle(h): s.owner for h, s in self._sockets.items() if s.is_polled and self._has_news(s)
            }

    def _at_ready_handles(self, owner: str) -> dict[Handle, str] | None:
        return None if self.scan in self._told.looks_at_all else dict(self._seen)

    def _at_readable(self, owner: str, handle: int) -> bool:
        return handle in self._seen

    def _at_renew(self, owner: str, handle: int) -> bool:
        socket = self._sockets[handle]
        if self._has_news(socket):
            self._seen[Handle(handle)] = socket.owner
        return self._is_over(socket)

    def _has_news(self, socket: _Socket) -> bool:
        if socket.owner in self.peers:
            return False
        if socket.listens:
            clients = self._clients.get(socket.owner)
            return bool(clients and self._has_come(clients[0].since))
        if socket.is_udp:
            datagrams = self._datagrams.get(socket.owner)
            return bool(datagrams and self._has_come(datagrams[0][0]))
        if socket.attempt is not None:
            return self._has_come(socket.attempt.answered)
        return (
            self._arrived(socket) > socket.read or self._message(socket) is not None or self._is_over(socket)
        )

    def _arrived(self, socket: _Socket) -> int:
        """Return how many bytes have come in all, known ones or not."""
        return socket.partner.come_by(CallPlace(self.scan, self._calls)) if socket.partner is not None else 0

    def _message(self, socket: _Socket) -> DatedMessage | None:
        messages = socket.partner.messages if socket.partner is not None else []
        if socket.messages_read < len(messages) and self._has_come(messages[socket.messages_read][0]):
            return messages[socket.messages_read]
        return None

    def _is_over(self, socket: _Socket) -> bool:
        return socket.partner is not None and self._has_come(socket.partner.ended)

    def _at_accept(self, owner: str, handle: int) -> object:
        clients = self._clients.get(owner)
        if owner in self.peers or not clients or not self._has_come(clients[0].since):
            return WOULD_BLOCK
        partner = clients.popleft()
        if partner.refused is not None:
            return partner.refused
        if partner.since.scan < self.scan:
            self.note_guess()  # he would have waited for an answer
        for socket in self._sockets.values():
            if socket.owner == owner and socket.partner is not None:
                self._give_up(socket.partner)
        made = self._open(owner)
        if isinstance(made, Fault):
            return made
        self._sockets[made].partner = partner
        self._sockets[made].port = self._sockets[handle].port
        return Accepted(Handle(made), partner.end)

    def _give_up(self, partner: Partner) -> None:
        """Let a partner end whom the recorded run had let go before this moment: he has come again since."""
        if partner.ended is NEVER and partner.let_go <= (self.scan, self._calls):
            partner.ended = CallPlace(self.scan)

    def _at_connect(self, owner: str, handle: int, end: Endpoint) -> object:
        if owner in self.peers:
            return None
        attempts = self._attempts.get(owner)
        while attempts and attempts[0].is_before(self.scan):
            attempts.popleft()
            self.note_guess()
        if not attempts:
            self.note_guess()
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
        failed = self._as_told(owner, "recv")
        fault = failed[0] if isinstance(failed, tuple) else None
        if isinstance(fault, Fault) and fault.error == "EAGAIN":
            return fault, b""
        there = self._arrived(socket)
        if there > socket.read:
            data = bytes(partner.data[socket.read : min(there, socket.read + size)])
            if len(data) < min(there - socket.read, size):
                self.note_guess()  # rule 3
            if data:
                socket.read += len(data)
                self.bytes_read += len(data)
                return len(data), data
        if self._is_over(socket):
            return partner.fault or 0, b""
        return WOULD_BLOCK, b""

    def _at_recv_from(
        self, owner: str, handle: int, size: int
    ) -> tuple[Datagram | WouldBlock | Fault, bytes]:
        socket = self._sockets[handle]
        found = self._message(socket)
        if socket.is_udp:
            datagrams = self._datagrams.get(owner)
            found = datagrams.popleft() if datagrams and self._has_come(datagrams[0][0]) else None
        if owner in self.peers or found is None:
            return self._no_message(socket)
        socket.messages_read += 1
        _, was, data = found
        if isinstance(was, Fault):
            return was, b""
        self.bytes_read += min(size, was.size)
        if size > was.size < was.whole:
            self.note_guess()  # the recorded run had no room for the rest
        return Datagram(min(size, was.size), was.source, was.whole), data[:size]

    def _no_message(self, socket: _Socket) -> tuple[WouldBlock | Fault, bytes]:
        fault = socket.partner.fault if socket.partner is not None else None
        return (fault if fault is not None and self._is_over(socket) else WOULD_BLOCK), b""

    def _at_loss(self, owner: str, handle: int) -> KernelLoss | None:
        socket = self._sockets[handle]
        if socket.partner is None or not self._is_over(socket):
            return None
        return KernelLoss(socket.partner.fault, self._arrived(socket) - socket.read)

    def _at_discard(self, owner: str, handle: int, most: int) -> int:
        socket = self._sockets[handle]
        size = min(most, self._arrived(socket) - socket.read)
        socket.read += size
        return size

    def _at_unread(self, owner: str, handle: int) -> int:
        socket = self._sockets.get(handle)
        return 0 if socket is None else self._arrived(socket) - socket.read

    def _at_path(self, owner: str, handle: int) -> object:
        known = self._as_told(owner, "path")
        return known if isinstance(known, PathInfo) else None

    def _at_send(self, owner: str, handle: int, size: int, check: int) -> object:
        socket = self._sockets[handle]
        partner = socket.partner
        if partner is None:
            return WOULD_BLOCK
        told = self._as_told(owner, "send")
        if isinstance(told, Fault):
            return told
        if partner.fault is not None and self._is_over(socket):
            return partner.fault
        taken = size
        whole, took_all = partner.taken_by(self.scan)
        if not took_all:
            taken = max(0, min(size, whole - socket.sent))
        socket.sent += taken
        return taken or WOULD_BLOCK

    def _at_send_to(self, owner: str, handle: int, size: int, check: int, end: Endpoint) -> object:
        if owner in self.peers:
            return WOULD_BLOCK
        told = self._as_told(owner, "send_to")
        return told if isinstance(told, Fault) else size

    def _gone(self, owner: str, call: str, handle: int) -> object:
        socket = self._sockets.pop(handle, None)
        self._seen.pop(Handle(handle), None)
        partner = socket.partner if socket is not None and not self._is_over(socket) else None
        if partner is not None and partner.let_go.scan != self.scan:
            self.note_guess()
        told = self._as_told(owner, call)
        return told if isinstance(told, Fault) else None

    def _at_close(self, owner: str, handle: int) -> object:
        return self._gone(owner, "close", handle)

    def _at_abort(self, owner: str, handle: int) -> object:
        return self._gone(owner, "abort", handle)

    # -- a serial line ---------------------------------------------------------------------------------

    def _at_port_read(self, owner: str, most: int) -> object:
        parts = self._serial.get(owner)
        told = self._as_told(owner, "port read")
        if isinstance(told, Fault):
            return told
        if not parts or not self._has_come(parts[0][0]):
            return b""
        at, data = parts.popleft()
        if len(data) > most:
            parts.appendleft((at, data[most:]))
        self.bytes_read += len(data[:most])
        return data[:most]

    def _at_port_write(self, owner: str, size: int, check: int) -> object:
        told = self._as_told(owner, "port write")
        return told if isinstance(told, Fault) else size

    def _at_port_arrive(self, owner: str, size: int, check: int) -> bool:
        return True
