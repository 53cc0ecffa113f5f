"""What a recorded run was told, out of its journal: what each partner did in which scan, and other answers.

Rule: a place is a scan and a call in it, so that a run that asks the same is told the same.
Bound: MOST_BYTES of all partners; what comes then is not known.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Collection, Iterable
from operator import itemgetter
from typing import Any, Final, cast

from trcvtui.capture.journal import GAP, STEP, Answered, EntriesLost, Entry, RunBegins
from trcvtui.net.connection.connection import SocketUse
from trcvtui.net.kernel import Accepted, KernelLoss
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault
from trcvtui.plc.containment import EXCEPTION
from trcvtui.records import NamedTuple

MOST_BYTES: Final = 128 << 20  # of all partners together
MOST_UNREAD: Final = 64 << 10  # bytes: what a stack keeps before it closes the window
NOBODY: Final = Endpoint("127.0.0.1", 0)
TRANSPARENT: Final = ("grant", "wait", EXCEPTION)  # each bench has its own bound of work, and errors
STAYS: Final = (  # calls whose newest answer holds until another one comes
    "bind", "listen", "path", "resolve", "local_end", "local_addresses", "set_options", "port open",
    "is_free",
)  # fmt: skip


class CallPlace(NamedTuple):
    """In which scan, and at which call of the PLC in it; 0: from its beginning on."""

    scan: int
    call: int = 0


NEVER: Final = CallPlace(1 << 62)
DatedMessage = tuple[CallPlace, Datagram | Fault, bytes]


_PLACE: Final = itemgetter(0)


class Partner:
    """One connection of a recorded run, as the PLC met it."""

    def __init__(self, end: Endpoint, since: CallPlace) -> None:
        self.end, self.since = end, since
        self.data = bytearray()
        self.arrived: list[tuple[CallPlace, int]] = []  # how many bytes in all, from when on
        self.messages: list[DatedMessage] = []
        self.ended, self.fault = NEVER, cast(Fault | None, None)
        self.let_go = NEVER  # by the PLC
        self.most_unread = MOST_UNREAD  # bytes that the recorded run has left to the stack
        self.refused: Fault | None = None  # what accept answered in his place
        self.taken: list[tuple[int, int, bool]] = []  # scan, bytes of the PLC in all, did he take all of them

    def note_bytes(self, at: CallPlace, size: int) -> None:
        if size > (self.arrived[-1][1] if self.arrived else 0):
            self.arrived.append((at, size))

    def note_end(self, at: CallPlace, fault: Fault | None) -> None:
        self.fault = self.fault or fault
        self.ended = min(self.ended, at)

    def come_by(self, place: CallPlace) -> int:
        """Return how many bytes have come in all up to a place, known ones or not."""
        before = bisect_right(self.arrived, place, key=_PLACE)
        return self.arrived[before - 1][1] if before else 0

    def taken_by(self, scan: int) -> tuple[int, bool]:
        """Return how many bytes of the PLC were taken up to a scan, and whether all that were sent last."""
        before = bisect_right(self.taken, scan, key=_PLACE)
        return self.taken[before - 1][1:] if before else (0, True)


class DialledAttempt:
    """One call of an active CONNECT. `answer`: None is a connection; `gone`: when it was given up."""

    def __init__(self) -> None:
        self.answered, self.answer = NEVER, cast(Fault | None, None)
        self.gone = NEVER
        self.is_at_once = False  # answered by the call itself
        self.partner: Partner | None = None

    def is_before(self, scan: int) -> bool:
        """Return whether nothing of it is left in this scan."""
        over = self.gone if self.partner is None else self.partner.let_go
        is_refused = self.answer is not None and self.answered.scan < scan
        return is_refused or over.scan < scan


class Standing(NamedTuple):
    """What a CONNECT holds where a file begins in the middle: a socket, and what that is for."""

    owner: str
    handle: int
    use: SocketUse


class RecordedRun:
    """All that a recorded run was told: partners, attempts, answers by owner and call, times of scans.

    `first`: the last scan before these entries; `standing`: the sockets that there were then.
    """

    def __init__(
        self,
        entries: Iterable[Entry],
        peers: Collection[str],
        standing: Iterable[Standing] = (),
        first: int = 0,
    ) -> None:
        self.first, self.standing = first, tuple(standing)
        self.times: list[int] = []
        self.clients: dict[str, list[Partner]] = {}
        self.attempts: dict[str, list[DialledAttempt]] = {}
        self.answers: dict[tuple[str, str], list[tuple[CallPlace, object]]] = {}
        self.datagrams: dict[str, list[DatedMessage]] = {}
        self.serial: dict[str, list[tuple[CallPlace, bytes]]] = {}
        self.begins: RunBegins | None = None
        self.failures: dict[int, str] = {}  # scan -> what an internal error has stopped in it
        self.cut = 0  # the scan from which on nothing is known, 0: none
        self.read: list[tuple[int, int]] = []  # scan, how many bytes blocks have read in all
        self._size = 0
        self._calls = 0
        self._peers = peers
        self._partners: dict[int, Partner] = {}
        self._dialled: dict[int, tuple[Endpoint, DialledAttempt]] = {}
        self._polled: set[int] = set()
        self.looks_at_all: set[int] = set()  # scans in which every handle is looked at
        self._short: set[int] = set()
        self._nth = Counter[tuple[str, str]]()
        self.stands: dict[int, Partner] = {}  # who was there at the beginning, by the handle
        self.tried: dict[int, DialledAttempt] = {}
        for one in self.standing:
            self._stand(one)
        for entry in entries:
            if not self.take(entry):
                break

    @property
    def scan(self) -> int:
        return self.first + len(self.times)

    def _stand(self, one: Standing) -> None:
        if one.use is SocketUse.STANDS:
            self.stands[one.handle] = self._partners[one.handle] = Partner(NOBODY, CallPlace(self.first))
        elif one.use is SocketUse.CALLS:
            attempt = self.tried[one.handle] = DialledAttempt()
            self._dialled[one.handle] = NOBODY, attempt
            self.attempts.setdefault(one.owner, []).append(attempt)

    def take(self, entry: Entry) -> bool:
        """Take the next entry; return whether it is known what comes after it."""
        is_known = self._take(entry)
        if not is_known:
            self.cut = self.scan + 1
        return is_known

    def _take(self, entry: Entry) -> bool:
        if isinstance(entry, RunBegins):
            self.begins = entry
        elif isinstance(entry, Answered):
            try:
                self._take_call(entry)
            except (TypeError, ValueError, AttributeError, IndexError):  # no journal of ours
                return False
        return not isinstance(entry, EntriesLost) and self._size <= MOST_BYTES

    def bytes_to(self, scan: int) -> int:
        return next((size for at, size in reversed(self.read) if at <= scan), 0)

    def _read_more(self, size: int) -> None:
        self._size += size
        self.read.append((self.scan, self._size))

    def _take_call(self, entry: Answered) -> None:
        owner, call, args, answer = entry
        if call == STEP:
            self.times.append(cast(int, answer))
            self._calls = 0
            self._short.clear()
            self._nth.clear()
            return
        if owner in self._peers and call != "local_end":
            return
        if call.startswith(GAP):
            if call == GAP + "unread" and (partner := self._partners.get(cast(int, args[0]))):
                unread = cast(int, answer)
                partner.most_unread = max(partner.most_unread, unread)
                partner.note_bytes(CallPlace(self.scan + 1), len(partner.data) + unread)
            return
        self._calls += call not in TRANSPARENT
        if call == EXCEPTION:
            self.failures.setdefault(self.scan, owner)
        note = _NOTES.get(call)
        if note is not None:
            note(self, owner, cast(int, args[0]) if args else 0, args, answer)
        self._keep((owner, call), answer)

    def _keep(self, key: tuple[str, str], answer: object) -> None:
        """Keep what stays so, and each Fault, with its place among the calls of its kind in the scan."""
        self._nth[key] += 1
        fault = answer[0] if isinstance(answer, tuple) and answer else answer
        known = self.answers.get(key, ())
        if isinstance(fault, Fault) or (key[1] in STAYS and not (known and known[-1][1] == answer)):
            self.answers.setdefault(key, []).append((CallPlace(self.scan, self._nth[key]), answer))

    def _now(self, handle: int) -> CallPlace:
        """Return since when one can see what is told now: what the poll saw, from the scan's beginning on."""
        was_seen = handle in self._polled and handle not in self._short
        return CallPlace(self.scan, 0 if was_seen else self._calls)

    def _ready(self, owner: str, handle: int, args: tuple[object, ...], answer: Any) -> None:
        self._polled = set(answer or ())
        if answer is None:
            self.looks_at_all.add(self.scan)

    def _readable(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if answer is True:
            self._polled.add(handle)

    def _accepted(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if isinstance(answer, Accepted):
            partner = Partner(answer.peer, self._now(handle))
            self._partners[answer.handle] = partner
            self.clients.setdefault(owner, []).append(partner)
        elif isinstance(answer, Fault):
            partner = Partner(NOBODY, self._now(handle))
            partner.refused = answer
            self.clients.setdefault(owner, []).append(partner)

    def _dial(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        attempt = DialledAttempt()
        self._dialled[handle] = cast(Endpoint, args[1]), attempt
        self.attempts.setdefault(owner, []).append(attempt)
        if answer is not None:
            attempt.is_at_once = True
            self._answered(owner, handle, args, answer)

    def _answered(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if answer is WOULD_BLOCK or handle not in self._dialled:
            return
        end, attempt = self._dialled.pop(handle)
        attempt.answered, attempt.answer = CallPlace(self.scan), cast(Fault | None, answer)
        if answer is None:
            attempt.partner = self._partners[handle] = Partner(end, attempt.answered)

    def _received(self, owner: str, handle: int, args: tuple[object, ...], answer: Any) -> None:
        got, data = answer
        partner, at = self._partners.get(handle), self._now(handle)
        if len(data) < cast(int, args[1]):
            self._short.add(handle)  # what comes now was not there before
        if partner is None:
            return
        if data:
            partner.data += data
            partner.note_bytes(at, len(partner.data))
            self._read_more(len(data))
        elif got == 0 or isinstance(got, Fault):
            partner.note_end(at, got or None)

    def _received_whole(self, owner: str, handle: int, args: tuple[object, ...], answer: Any) -> None:
        got, data = answer
        partner, at = self._partners.get(handle), self._now(handle)
        if isinstance(got, Datagram) or (isinstance(got, Fault) and partner is None):
            messages = self.datagrams.setdefault(owner, []) if partner is None else partner.messages
            messages.append((at, got, data))
            self._read_more(len(data))
        elif isinstance(got, Fault) and partner is not None:
            partner.note_end(at, got)

    def _sent(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        partner = self._partners.get(handle)
        if partner is None:
            return
        if isinstance(answer, Fault) and answer.error != "EAGAIN":
            partner.note_end(self._now(handle), answer)
        before = partner.taken[-1][1] if partner.taken else 0
        size = answer if isinstance(answer, int) else 0
        partner.taken.append((self.scan, before + size, size == args[1]))

    def _lost(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if isinstance(answer, KernelLoss) and (partner := self._partners.get(handle)):
            partner.note_end(self._now(handle), answer.fault)

    def _looked(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if answer is True and (partner := self._partners.get(handle)):
            partner.note_end(self._now(handle), None)

    def _left(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        now = CallPlace(self.scan, self._calls)
        if handle in self._dialled:
            self._dialled.pop(handle)[1].gone = now
        partner = self._partners.pop(handle, None)
        if partner is not None:
            partner.let_go = now

    def _line(self, owner: str, handle: int, args: tuple[object, ...], answer: object) -> None:
        if isinstance(answer, bytes) and answer:
            self.serial.setdefault(owner, []).append((CallPlace(self.scan), answer))
            self._read_more(len(answer))


_NOTES: Final[dict[str, Callable[[RecordedRun, str, int, tuple[object, ...], Any], None]]] = {
    "ready_handles": RecordedRun._ready,
    "readable": RecordedRun._readable,
    "accept": RecordedRun._accepted,
    "connect": RecordedRun._dial,
    "connect_result": RecordedRun._answered,
    "recv": RecordedRun._received,
    "recv_from": RecordedRun._received_whole,
    "send": RecordedRun._sent,
    "loss": RecordedRun._lost,
    "renew": RecordedRun._looked,
    "close": RecordedRun._left,
    "abort": RecordedRun._left,
    "port read": RecordedRun._line,
}
