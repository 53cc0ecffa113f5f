"""All that a recorded run received, read from its journal: acts of each partner, and other answers.

Rule 1: a place is a scan and a call in that scan. So a run that makes the same calls gets the same answers.
Rule 2: bytes and ends count from their arrival on, not from the call that read them (arrivals.py).
Bound: at most MOST_PARTNER_BYTES of all partners wait for the asking run. Further bytes are only counted.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator
from typing import Any, Final, NamedTuple, cast

from trcvtui.net.connection.connection import SocketUse
from trcvtui.net.kernel import KernelLoss, NewClient
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault
from trcvtui.plc.containment import EXCEPTION
from trcvtui.recording.arrivals import BYTES_ARRIVED, DROPPED, ENDED, FULL, LATE, MESSAGE, WAITING
from trcvtui.recording.journal import CLOSE, DO, IN_GAP, REST, SKIP, STEP, CallRecord, Entry, RunHeader

MOST_PARTNER_BYTES: Final = 128 << 20  # of all partners together
MOST_UNREAD_BYTES: Final = 64 << 10  # bytes: what a stack keeps before it closes the window
UNKNOWN_END: Final = Endpoint("127.0.0.1", 0)
OWN_CALLS: Final = ("grant", "wait", EXCEPTION)  # each bench has its own bound of work, and errors
LASTING_CALLS: Final = (  # calls whose newest answer holds until another one comes
    "bind", "listen", "path", "resolve", "local_end", "local_addresses", "set_options", "port open",
    "is_free",
)  # fmt: skip
BENCH_OWNER: Final = "bench"
BENCH_CALLS: Final = (DO, REST, SKIP, CLOSE, STEP)  # commands and scans of a bench
CLOSED, RESET, SHUT = "close", "abort", "shutdown"  # how this end of a connection ended


class CallPlace(NamedTuple):
    """A scan, and the number of a PLC call in this scan. Call 0 means the beginning of the scan."""

    scan: int
    call: int = 0


NEVER_PLACE: Final = CallPlace(1 << 62)
DatedMessage = tuple[CallPlace, Datagram | Fault, bytes]


class PlcAct(NamedTuple):
    """One act of the PLC that a partner sees: bytes sent, or an end. `what` is the part to compare."""

    scan: int
    what: tuple[object, ...]
    answer: object = None


class Partner:
    """One connection of a recorded run; positions count from the start of the connection or of the file."""

    def __init__(self, end: Endpoint, since: CallPlace, is_known: bool = True) -> None:
        self.end, self.since, self.accepted = end, since, since
        self.is_known = is_known  # what was unread at the beginning of the file
        self.chunks: deque[tuple[int, bytes]] = deque()  # not read by the run that asks; by position
        # Up to where bytes are noted, were read, have come; of messages: how many.
        self.known = self.read = self.whole = 0
        self.hole = 0  # up to where only reads have them
        self._arrived: deque[tuple[CallPlace, int]] = deque()  # bytes in all, from when on
        self._come = 0
        self.messages: deque[DatedMessage] = deque()
        self.ended, self.fault = NEVER_PLACE, cast(Fault | None, None)
        self.released_at = NEVER_PLACE  # by the PLC
        self.most_unread = MOST_UNREAD_BYTES
        self.full_from = 1 << 62  # unread bytes from which on the window may be small
        self.refused: Fault | None = None  # what accept answered in its place
        self.acts: deque[PlcAct] = deque()  # in order; those that the run that asks did are removed
        self.taken, self.took_all = 0, True  # bytes of the PLC in all; of the newest call

    @property
    def may_be_held_back(self) -> bool:
        """Return whether so many bytes are unread in the recorded run that the partner may be held back."""
        return self.whole - self.read >= self.full_from

    @property
    def ended_in_fault(self) -> bool:
        """Return whether the connection ended with an error; then the partner sees no further PLC acts."""
        return self.fault is not None

    def note_bytes(self, at: CallPlace, whole: int) -> None:
        if whole > self.whole:
            self.whole = whole
            self._arrived.append((at, whole))

    def note_end(self, at: CallPlace, fault: Fault | None, is_told: bool = True) -> None:
        """Note the connection's end; a call's Fault replaces a Fault that came from the socket's state."""
        self.fault = fault if is_told and fault is not None else self.fault or fault
        self.ended = min(self.ended, at)

    def arrived_by(self, place: CallPlace) -> int:
        """Return how many bytes, known or not, came up to a place; places must not decrease."""
        while self._arrived and self._arrived[0][0] <= place:
            self._come = self._arrived.popleft()[1]
        return self._come

    def bytes_at(self, start: int, stop: int) -> bytes | None:
        """Return the bytes between two positions, None if some of them are not known."""
        found = bytearray()
        for at, chunk in self.chunks:
            if at > start + len(found) or start + len(found) >= stop:
                break
            found += chunk[start + len(found) - at : stop - at]
        return bytes(found) if len(found) == stop - start else None


class DialledAttempt:
    """One attempt of an active CONNECT. On success, `answer` is None. `gone` is when it was given up."""

    def __init__(self, began: int) -> None:
        self.began = began  # in which scan
        self.answered, self.answer = NEVER_PLACE, cast(Fault | None, None)
        self.gone = NEVER_PLACE
        self.is_at_once = False  # answered by the call itself
        self.partner: Partner | None = None

    def is_over_before(self, scan: int) -> bool:
        """Return whether the attempt, or its connection, was over before this scan."""
        over = self.gone if self.partner is None else self.partner.released_at
        is_refused = self.answer is not None and self.answered.scan < scan
        return is_refused or over.scan < scan


class InheritedSocket(NamedTuple):
    """A socket that a CONNECT already has when a file begins in the middle."""

    owner: str
    handle: int
    use: SocketUse


class RecordedRun:
    """All that a recorded run received so far: partners, attempts, answers by owner and call.

    `first` is the last scan before these entries. `standing` has the sockets open after scan `first`.
    """

    def __init__(
        self, peers: Collection[str], standing: Iterable[InheritedSocket] = (), first: int = 0
    ) -> None:
        self.first, self.inherited_sockets = first, tuple(standing)
        self.scan = first
        self._times: deque[int] = deque()  # of the newest scans
        self.arrival_scan = 0  # the newest scan in which something came
        self.clients: dict[str, deque[Partner]] = {}
        self.attempts: dict[str, deque[DialledAttempt]] = {}
        self.answers: dict[tuple[str, str], deque[tuple[CallPlace, object]]] = {}
        self.datagrams: dict[tuple[str, bool], deque[DatedMessage]] = {}  # True: of a socket in `hearing`
        self.broadcasts: set[str] = set()  # addresses
        self.hearing: set[int] = set()  # sockets that are bound to one
        self.datagrams_read: Counter[str] = Counter()
        self._unread: Counter[int] = Counter()  # messages, of each handle
        self._unknown: set[str] = set()  # UDP_CONFIGs that may have had datagrams at the start of the file
        self.dropped: list[tuple[int, str, int]] = []  # scan, owner, datagrams that were read by then
        self.serial: dict[str, deque[tuple[CallPlace, bytes]]] = {}
        self.written: dict[str, deque[PlcAct]] = {}  # datagrams and serial bytes
        self.listening: dict[str, list[tuple[int, frozenset[int]]]] = {}  # from a scan on, on which handles
        self.begins: RunHeader | None = None
        self.is_broken = False  # the journal does not fit: what comes is not known
        self.failures: dict[int, str] = {}  # scan -> what an internal error has stopped in it
        self.injected_scan = 0  # the newest scan in which a planned fault answered
        self.bytes_read = 0
        self.kept = 0  # bytes of all partners that wait
        self._calls = 0
        self._peers = peers
        self._partners: dict[int, Partner] = {}
        self._dialled: dict[int, tuple[Endpoint, DialledAttempt]] = {}
        self._waiting: dict[str, deque[Partner]] = {}  # clients that are not accepted yet
        self._polled: set[int] = set()
        self.looks_at_all: set[int] = set()  # scans in which each handle is checked
        self._short: set[int] = set()
        self._nth = Counter[tuple[str, str]]()
        self._entries, self._next = cast(Iterator[Entry], iter(())), cast(Entry | None, None)
        self.inherited_partners: dict[int, Partner] = {}  # connections at the beginning, by handle
        self.inherited_attempts: dict[int, DialledAttempt] = {}
        for one in self.inherited_sockets:
            self._add_inherited(one)

    def take_scan_time(self, scan: int) -> int:
        """Return when a scan began; forget the times of scans that are earlier than the previous scan."""
        while len(self._times) > self.scan - scan + 2:
            self._times.popleft()
        return self._times[scan - self.scan - 1]

    def _add_inherited(self, one: InheritedSocket) -> None:
        if one.use is SocketUse.CONNECTED:
            partner = Partner(UNKNOWN_END, CallPlace(self.first), is_known=False)
            self.inherited_partners[one.handle] = self._partners[one.handle] = partner
        elif one.use is SocketUse.CONNECTS:
            attempt = self.inherited_attempts[one.handle] = DialledAttempt(self.first)
            self._dialled[one.handle] = UNKNOWN_END, attempt
        elif one.use is SocketUse.DATAGRAMS:
            if one.owner in self._unknown:  # its second one
                self.hearing.add(one.handle)
            self._unknown.add(one.owner)
        elif one.use is SocketUse.LISTENS:
            self._update_listening(one.owner, frozenset((one.handle,)))

    def _update_listening(self, owner: str, more: frozenset[int], less: frozenset[int] = frozenset()) -> None:
        known = self.listening.setdefault(owner, [(0, frozenset())])
        now = (known[-1][1] | more) - less
        if now != known[-1][1]:
            known.append((self.scan, now))

    def listens(self, owner: str, scan: int) -> bool:
        """Return whether a CONNECT listens at the end of `scan`, one of the two newest scans."""
        known = self.listening.get(owner, ())
        return bool(next((handles for since, handles in reversed(known) if since <= scan), ()))

    def read_beginning(self, entries: Iterator[Entry]) -> None:
        """Take the entries before the first command or scan; `advance` takes the rest, scan by scan."""
        self._entries, self._next = entries, next(entries, None)
        self._read_up_to(BENCH_CALLS)

    def advance(self) -> None:
        self._read_up_to((STEP,))
        if self._next is not None:
            self._add_and_read_next(self._next)
        self._read_up_to(BENCH_CALLS)

    def _read_up_to(self, calls: tuple[str, ...]) -> None:
        while (entry := self._next) is not None:
            if isinstance(entry, CallRecord) and entry.owner == BENCH_OWNER and entry.call in calls:
                return
            self._add_and_read_next(entry)

    def _add_and_read_next(self, entry: Entry) -> None:
        self.add_entry(entry)
        self._next = next(self._entries, None)

    def add_entry(self, entry: Entry) -> None:
        if isinstance(entry, RunHeader):
            self.begins = entry
        elif isinstance(entry, CallRecord) and not self.is_broken:
            try:
                self._add_call(entry)
            except (TypeError, ValueError, AttributeError, IndexError):  # types that no seam of ours writes
                self.is_broken = True

    def _add_call(self, entry: CallRecord) -> None:
        owner, call, args, answer = entry
        if call == STEP:
            self.scan += 1
            self._times.append(cast(int, answer))
            self._calls = 0
            self._short.clear()
            self._nth.clear()
            return
        if owner in self._peers and call != "local_end":
            return  # the bench that asks has its own peers
        handle = cast(int, args[0]) if args else 0
        is_arrival = call.startswith(IN_GAP)
        self._calls += not is_arrival and call not in OWN_CALLS
        if call == EXCEPTION:
            self.failures.setdefault(self.scan, owner)
        note = _CALL_HANDLERS.get(call)
        if note is not None:
            note(self, owner, handle, args, answer)
        if not is_arrival:
            self._keep_answer((owner, call), answer)

    def _keep_answer(self, key: tuple[str, str], answer: object) -> None:
        self._nth[key] += 1
        fault = answer[0] if isinstance(answer, tuple) and answer else answer
        if isinstance(fault, Fault) and fault.injected:
            self.injected_scan = self.scan
        known = self.answers.get(key, ())
        if isinstance(fault, Fault) or (key[1] in LASTING_CALLS and not (known and known[-1][1] == answer)):
            place = CallPlace(self.scan, self._nth[key])
            self.answers.setdefault(key, deque()).append((place, answer))

    def _earliest_place(self, handle: int) -> CallPlace:
        was_seen = handle in self._polled and handle not in self._short
        return CallPlace(self.scan, 0 if was_seen else self._calls)

    def _ready_place(self, handle: int) -> CallPlace:
        return CallPlace(self.scan, 0 if handle in self._polled else self._calls)

    # -- unread bytes --------------------------------------------------------------------------------------

    def _date_arrival(self, flags: int, handle: int) -> CallPlace:
        there = CallPlace(self.scan + 1) if flags & LATE else self._earliest_place(handle)
        self.arrival_scan = max(self.arrival_scan, there.scan)
        return there

    def _note_unread_bytes(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        _, unread, flags = cast(tuple[int, int, int], args[1:])
        partner = self._partners.get(handle)
        if partner is None:
            return
        data, there, whole = cast(bytes, answer), self._date_arrival(flags, handle), partner.read + unread
        start = max(partner.known, partner.read)
        if not partner.is_known and partner.known == partner.read:
            start = partner.hole = whole - len(data)  # the bytes before came before the file
        self._add_new_bytes(partner, start, data)
        partner.note_bytes(there, whole)
        partner.most_unread = max(partner.most_unread, unread)
        if flags & FULL:
            partner.full_from = min(partner.full_from, unread)
        if self.scan == self.first:
            partner.is_known = len(data) == unread  # the file repeats what was unread

    def _add_new_bytes(self, partner: Partner, start: int, data: bytes) -> None:
        """Take bytes of a stream from `start` on. Bytes between the known bytes and `start` are lost."""
        if start < partner.hole:
            self._keep_bytes(partner, start, data[: partner.hole - start])
        new = data[max(0, partner.known - start) :]
        partner.known = max(partner.known, start + len(data))
        self._keep_bytes(partner, partner.known - len(new), new)

    def _keep_bytes(self, partner: Partner, start: int, data: bytes) -> None:
        if data and self.kept + len(data) <= MOST_PARTNER_BYTES:  # Bound
            is_next = start == partner.known - len(data)
            at = len(partner.chunks) if is_next else sum(at < start for at, _ in partner.chunks)
            partner.chunks.insert(at, (start, data))
            self.kept += len(data)

    def forget_bytes(self, partner: Partner, position: int) -> None:
        """Forget a partner's bytes before a position, because the asking run has read them."""
        chunks = partner.chunks
        while chunks and chunks[0][0] + len(chunks[0][1]) <= position:
            self.kept -= len(chunks.popleft()[1])

    def _note_message(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        source, whole, flags = cast(tuple[Endpoint, int, int], args[1:])
        data, partner = cast(bytes, answer), self._partners.get(handle)
        self._unread[handle] += 1
        if partner is not None:
            partner.whole += 1
            partner.full_from = (
                min(partner.full_from, self._unread[handle]) if flags & FULL else partner.full_from
            )
        queue = self._get_message_queue(owner, handle, partner)
        got = Datagram(len(data), source, whole)
        is_kept = self.kept + len(data) <= MOST_PARTNER_BYTES
        self.kept += len(data) * is_kept
        queue.append((self._date_arrival(flags, handle), got, data if is_kept else b""))

    def _note_end(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if (partner := self._partners.get(handle)) is not None:
            fault = Fault("recv", "ECONNRESET") if answer == "rst" else None
            partner.note_end(self._ready_place(handle), fault, is_told=False)

    def _note_clients(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        waiting = self._waiting.setdefault(owner, deque())
        while len(waiting) < cast(int, answer):
            waiting.append(Partner(UNKNOWN_END, self._date_arrival(cast(int, args[1]), handle)))
            waiting[-1].accepted = NEVER_PLACE
            self.clients.setdefault(owner, deque()).append(waiting[-1])

    def _note_dropped(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        self.dropped.append((self.scan, owner, self.datagrams_read[owner]))

    # -- calls ---------------------------------------------------------------------------------------------

    def _note_ready(self, owner: str, handle: int, args: tuple[object, ...], answer: Any) -> None:
        self._polled = set(answer or ())
        if answer is None:
            self.looks_at_all.add(self.scan)

    def _note_readable(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if answer is True:
            self._polled.add(handle)

    def _note_listen(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if answer is None:
            self._update_listening(owner, frozenset((handle,)))

    def _note_accept(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if not isinstance(answer, NewClient | Fault):
            self._short.add(handle)  # a client that comes now was not there before
            return
        waiting = self._waiting.get(owner)
        if waiting:
            partner = waiting.popleft()
        else:
            partner = Partner(UNKNOWN_END, self._earliest_place(handle))
            self.clients.setdefault(owner, deque()).append(partner)
        partner.accepted = self._earliest_place(handle)
        self.arrival_scan = max(self.arrival_scan, self.scan)
        if isinstance(answer, Fault):
            partner.refused = answer
        else:
            partner.end = answer.peer
            self._partners[answer.handle] = partner

    def _note_connect(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        attempt = DialledAttempt(self.scan)
        self._dialled[handle] = cast(Endpoint, args[1]), attempt
        self.attempts.setdefault(owner, deque()).append(attempt)
        if answer is not None:
            attempt.is_at_once = True
            self._note_connect_result(owner, handle, args, answer)

    def _note_connect_result(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if answer is WOULD_BLOCK or handle not in self._dialled:
            return
        end, attempt = self._dialled.pop(handle)
        attempt.answered, attempt.answer = CallPlace(self.scan), cast(Fault | None, answer)
        self.arrival_scan = max(self.arrival_scan, self.scan)
        if answer is None:
            attempt.partner = self._partners[handle] = Partner(end, attempt.answered)

    def _note_recv(self, owner: str, handle: int, args: tuple[object, ...], answer: Any) -> None:
        got, data = answer
        partner, at = self._partners.get(handle), self._earliest_place(handle)
        if len(data) < cast(int, args[1]):
            self._short.add(handle)  # what comes now was not there before
        if partner is None:
            return
        if isinstance(got, int) or got is WOULD_BLOCK:
            partner.is_known = partner.is_known or len(data) < cast(int, args[1])
        elif isinstance(got, Fault) and not got.injected:
            partner.is_known = True
        if data:
            self._add_new_bytes(partner, partner.read, data)
            partner.read += len(data)
            partner.note_bytes(at, partner.read)
            self.bytes_read += len(data)
            self.arrival_scan = max(self.arrival_scan, self.scan)
        elif got == 0 or isinstance(got, Fault):
            partner.note_end(self._ready_place(handle), got or None)

    def _note_discard(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if (partner := self._partners.get(handle)) is not None:
            partner.read += cast(int, answer)

    def _note_datagram_read(self, owner: str, handle: int, args: tuple[object, ...], answer: Any) -> None:
        got, data = answer
        partner, at = self._partners.get(handle), self._earliest_place(handle)
        if isinstance(got, Datagram):
            if not self._unread[handle]:  # noted in a file before this
                self._unread[handle] = 1
                if partner is not None:
                    partner.whole += 1
                self._get_message_queue(owner, handle, partner).append((at, got, data))
            self._unread[handle] -= 1
            if partner is not None:
                partner.read += 1
            self.datagrams_read[owner] += 1
            self.bytes_read += len(data)
            return
        self._short.add(handle)
        if got is WOULD_BLOCK and partner is not None:
            partner.is_known = True
        elif got is WOULD_BLOCK:
            self._unknown.discard(owner)
        if isinstance(got, Fault) and partner is not None:
            partner.note_end(self._ready_place(handle), got)
        elif isinstance(got, Fault):
            self._get_message_queue(owner, handle, None).append((at, got, data))

    def _get_message_queue(self, owner: str, handle: int, partner: Partner | None) -> deque[DatedMessage]:
        if partner is not None:
            return partner.messages
        return self.datagrams.setdefault((owner, handle in self.hearing), deque())

    def _note_broadcasts(self, owner: str, handle: int, args: tuple[object, ...], answer: Any) -> None:
        self.broadcasts.update(each.broadcast for each in answer)

    def _note_bind(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        is_hearing = cast(Endpoint, args[1]).address in self.broadcasts
        (self.hearing.add if is_hearing else self.hearing.discard)(handle)

    def knows_earlier_messages(self, owner: str, partner: Partner | None) -> bool:
        """Return whether unread messages are known; messages from before the file are not known."""
        return owner not in self._unknown if partner is None else partner.is_known

    def _note_send(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        partner = self._partners.get(handle)
        if partner is None:
            return
        if isinstance(answer, Fault) and answer.error != "EAGAIN":
            partner.note_end(self._ready_place(handle), answer)
        partner.acts.append(PlcAct(self.scan, args[1:], answer))
        size = answer if isinstance(answer, int) else 0
        partner.taken, partner.took_all = partner.taken + size, size == args[1]

    def _note_write(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        self.written.setdefault(owner, deque()).append(PlcAct(self.scan, args[-3:], answer))

    def _note_connection_loss(
        self, owner: str, handle: int, args: tuple[object, ...], answer: object
    ) -> None:
        if isinstance(answer, KernelLoss) and (partner := self._partners.get(handle)):
            partner.note_end(self._ready_place(handle), answer.fault)

    def _note_end_check(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if answer is True and (partner := self._partners.get(handle)):
            partner.note_end(self._ready_place(handle), None)

    def _note_shutdown(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if (partner := self._partners.get(handle)) is not None:
            partner.acts.append(PlcAct(self.scan, (SHUT,)))

    def _note_close(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        partner = self._partners.get(handle)
        self._free(owner, handle, RESET if partner is not None and partner.whole > partner.read else CLOSED)

    def _note_abort(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        self._free(owner, handle, RESET)

    def _free(self, owner: str, handle: int, how: str) -> None:
        now = CallPlace(self.scan, self._calls)
        if handle in self._dialled:
            self._dialled.pop(handle)[1].gone = now
        if owner in self.listening and handle in self.listening[owner][-1][1]:
            for client in self._waiting.pop(owner, ()):  # reset with the listener
                if client in self.clients[owner]:
                    self.clients[owner].remove(client)
            self._update_listening(owner, frozenset(), frozenset((handle,)))
        partner = self._partners.pop(handle, None)
        if partner is not None:
            partner.released_at = now
            partner.acts.append(PlcAct(self.scan, (how,)))

    def _note_serial_read(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if isinstance(answer, bytes) and answer:
            self.serial.setdefault(owner, deque()).append((CallPlace(self.scan), answer))
            self.bytes_read += len(answer)
            self.arrival_scan = max(self.arrival_scan, self.scan)


CallHandler = Callable[[RecordedRun, str, int, tuple[object, ...], Any], None]
_CALL_HANDLERS: Final[dict[str, CallHandler]] = {
    IN_GAP + BYTES_ARRIVED: RecordedRun._note_unread_bytes,
    IN_GAP + MESSAGE: RecordedRun._note_message,
    IN_GAP + ENDED: RecordedRun._note_end,
    IN_GAP + WAITING: RecordedRun._note_clients,
    IN_GAP + DROPPED: RecordedRun._note_dropped,
    "ready_handles": RecordedRun._note_ready,
    "readable": RecordedRun._note_readable,
    "local_addresses": RecordedRun._note_broadcasts,
    "bind": RecordedRun._note_bind,
    "listen": RecordedRun._note_listen,
    "accept": RecordedRun._note_accept,
    "connect": RecordedRun._note_connect,
    "connect_result": RecordedRun._note_connect_result,
    "recv": RecordedRun._note_recv,
    "discard": RecordedRun._note_discard,
    "recv_from": RecordedRun._note_datagram_read,
    "send": RecordedRun._note_send,
    "send_to": RecordedRun._note_write,
    "port write": RecordedRun._note_write,
    "loss": RecordedRun._note_connection_loss,
    "renew": RecordedRun._note_end_check,
    "shutdown": RecordedRun._note_shutdown,
    "close": RecordedRun._note_close,
    "abort": RecordedRun._note_abort,
    "port read": RecordedRun._note_serial_read,
}
