"""Plays the partners of a capture in the simulated network at their times, with scans between.

Rule 1: a scan sees all events up to its time. Scans that change nothing are counted, not run.
Rule 2: a partner does not react. Bytes that a shadow sends are discarded; keep-alive is answered.
Rule 3: bytes that a shadow does not read wait, up to a bound. At the bound, scans run until there is room:
a closed window would also make the partner wait. Bytes that are never read are left out, and counted.
Rule 4: if a PLC end closes or resets in the capture, its shadow ends. The shadow reads the bytes that the
PLC may have read. The shadow ends in the next scan, but not before its first job. A shadow that connected N
scans late ends N scans later. In a recording by trcvtui the PLC, and so the shadow, reads all bytes.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import Final

from trcvtui.bench.bench import Bench
from trcvtui.net.events import BytesReceived
from trcvtui.net.results import Endpoint
from trcvtui.net.sim.network import PLAYED_SEND_ROOM
from trcvtui.net.sim.stream import SimStream, StreamPhase
from trcvtui.plc.ledger import A_HOLE, A_PACKET, NO_END, PeerSent, StatusEdge

MOST_UNREAD_BYTES: Final = 128 << 10  # bytes of datagrams or a serial line that wait for a shadow
MOST_FILLED: Final = 64 << 10  # missing bytes get placeholders, at most so many more than real bytes
FIRST_JOB_SCANS: Final = 3  # scans from a new connection to its first DONE
NEXT_CALL_SCANS: Final = 5  # scans at most from a refused call to the next one
QUIET_SCANS: Final = 3  # after so many scans without a change none comes without an event
MOST_QUIET_SCANS: Final = 100_000  # quiet scans that are run where skipping is not proven safe
PATIENCE_NS: Final = 3_000_000_000  # an answered SYN waits so long for a shadow that listens
SETTLE_SCANS: Final = 1000  # scans at most after the last event, and after each job of bytes that still wait
_WASTE_BUFFER: Final = memoryview(bytearray(1 << 16))


class ShadowBench:
    """A bench whose partners are played. `on_scan` gets the changes and the instances that lack bytes.

    `on_scan` is called after each scan with a change or an event.
    """

    def __init__(
        self, bench: Bench, on_scan: Callable[[int, Sequence[StatusEdge], frozenset[str]], None]
    ) -> None:
        self.bench = bench
        self.network = bench.network
        self.waiting: list[ReplayedPartner | ConnectionlessPartner] = []  # in the order in which they came
        self.holes: dict[str, deque[tuple[int, int]]] = {}  # CONNECT -> (begin, end) of placeholders
        self.of_datagrams: set[str] = set()  # CONNECTs whose holes count datagrams: DATA may cut one
        self.not_run = 0  # skipped scans that might have changed something
        self.room = MOST_FILLED  # for missing bytes
        self.last_job: dict[str, int] = {}  # CONNECT -> bytes of the last job
        self.after_scan: Callable[[], object] = int
        self.sent: Callable[[PeerSent, int], None] | None = None  # called with each packet and its time
        self.packet_ns = 0  # the time of the packet that is played
        self.works_on = {each.name: each.connect for each in bench.project.instances}
        self.leaving: list[ReplayedPartner] = []  # their shadows are to end (rule 4)
        self._on_scan = on_scan
        self._interval = bench.runtime.interval_ns
        self._quiet = 0
        self._jobs = 0  # that had bytes
        self._lacking: set[str] = set()  # instances whose job has a place without bytes

    def advance_to(self, ns: int) -> None:
        """Run or skip the scans before this time, then move the network's clock to this time."""
        while (due := self.bench.runtime.scans * self._interval) < ns:
            if self.network.take_ready_flag() or self._quiet < QUIET_SCANS:
                self.step()
            elif not self._skip_quiet_scans(due, ns):
                if self._quiet < MOST_QUIET_SCANS:
                    self.step()
                    continue
                left = -(-ns // self._interval) - due // self._interval
                self.bench.skip(left)
                self.not_run += left
        self.network.advance(max(ns, self.network.now_ns))

    def forbid_skipping(self) -> None:
        """Run the next scans even without an event, so that a calling CONNECT can check its call."""
        self._quiet = 0

    def refuse_call(self, connect: str) -> None:
        """Refuse the call of a shadow; if the shadow pauses between two calls, it must call now."""
        runtime = self.bench.runtime
        for _ in range(NEXT_CALL_SCANS):
            is_ahead = runtime.scans * self._interval > self.network.now_ns + PATIENCE_NS
            if self.network.wire.refuse_as_partner(connect) or is_ahead:
                break
            runtime.retry_now(connect)
            self.step()
        self.forbid_skipping()

    def task_period_scans(self, connect: str) -> int:
        """Return the period, in scans, of the slowest task with a block of a CONNECT."""
        names = {each.task for each in self.bench.project.instances if each.connect == connect}
        tasks = [task.interval_ns for task in self.bench.project.tasks if task.name in names]
        return max([-(-each // self._interval) for each in tasks], default=1)

    def settle(self) -> None:
        left = SETTLE_SCANS
        while left and (self.leaving or self.network.take_ready_flag() or self._quiet < QUIET_SCANS):
            jobs = self._jobs
            self.step()
            left = left - 1 if self._jobs == jobs else SETTLE_SCANS

    def _skip_quiet_scans(self, due: int, ns: int) -> bool:
        until = self.bench.quiet_until()
        limit = ns if until is None else min(until, ns)
        if self.waiting:
            limit = min(limit, *(end.gives_up_at for end in self.waiting))
        if self.leaving:
            limit = min(limit, *((end.due_end_scan - 1) * self._interval for end in self.leaving))
        if limit <= due:
            return False
        reached = self.network.advance_until_ready(limit)
        scans = -(-reached // self._interval) - due // self._interval
        if scans > 0:
            self.bench.skip(scans)
        return scans > 0

    def step(self) -> None:
        runtime, ledger = self.bench.runtime, self.bench.runtime.ledger
        if self.waiting:
            self._retry_waiting()
        over = [end for end in self.leaving if end.due_end_scan <= runtime.scans + 1]
        for end in over:
            end.end_shadow_now()
        seq = ledger.last_seq
        self.bench.step()
        self.after_scan()
        for end in over:
            end.drop_unread()
        self.leaving = [end for end in self.leaving if end not in over]
        self.network.take_ready_flag()
        changed = runtime.changed
        is_quiet = not changed and ledger.last_seq == seq
        self._quiet = self._quiet + 1 if is_quiet else 0
        if self.holes:
            self._find_lacking(seq)
        if not is_quiet:
            lacking = frozenset(self._lacking)
            self._on_scan(runtime.scans, changed, lacking)
            self._lacking -= {e.instance for e in changed if e.outputs.done or e.outputs.error}
            for edge in changed:
                if edge.outputs.done and edge.outputs.rcvd_len:
                    self._jobs += 1
                    self.last_job[self.works_on[edge.instance]] = edge.outputs.rcvd_len

    def _retry_waiting(self) -> None:
        closed: set[str] = set()
        left: list[ReplayedPartner | ConnectionlessPartner] = []
        waiting, self.waiting = self.waiting, []
        for one in waiting:
            if one.try_again(one.link not in closed):
                left.append(one)
                if one.keeps_out:
                    closed.add(one.link)
        self.waiting = left + self.waiting

    def _find_lacking(self, seq: int) -> None:
        for _, _, event in self.bench.runtime.ledger.events_since(seq):
            if not isinstance(event, BytesReceived) or event.connection not in self.holes:
                continue
            holes, end = self.holes[event.connection], event.offset + event.size
            end = event.recv if event.connection in self.of_datagrams else end
            if holes and holes[0][0] < end:
                self._lacking.add(event.instance)
            while holes and holes[0][1] <= end:
                holes.popleft()
        self.holes = {connect: holes for connect, holes in self.holes.items() if holes}


class ReplayedPartner:
    """One end of a conversation as the partner of a CONNECT. With `calls`, the end calls the CONNECT.

    `left_out` counts bytes that never reached the shadow. FIN, RST or a failed connect sets `is_over`.
    """

    def __init__(self, shadows: ShadowBench, connect: str, own: Endpoint, calls: bool) -> None:
        self.connect = self.link = connect
        self.left_out = 0
        self.is_over = False
        self.has_ended = self.has_left = False  # in the capture: the partner; the shadow's own end
        self.gives_up_at = 0
        self.keeps_out = True  # the link is not ready: those waiting after it need not try
        self._shadows = shadows
        self._own = own
        self._calls = calls
        self._is_begun = self._has_called = False
        config = shadows.bench.project.connect(connect)
        self._asks = calls and config is not None and config.session is not None
        self._awaits = self._has_answer = False  # the shadow's answer: its CC or first bytes
        self._stream: SimStream | None = None
        self._acts: deque[Callable[[], None]] = deque()  # events that wait for the connection
        self._begun = self._stood = 0  # scan of the beginning; scans from there to the PLC end's FIN or RST
        self._has_read = False  # the PLC is known to have read all bytes (a recording of ours)
        self._kept = self._packets = 0  # bytes in `_acts`; packets so far
        self._sent = 0

    def begin_connecting(self) -> None:
        """Build the connection, as soon as the shadow is ready for it."""
        if not self._is_begun:
            self._is_begun = True
            self._shadows.holes.pop(self.connect, None)
            self._begun = self._shadows.bench.runtime.scans
            self.gives_up_at = self._shadows.network.now_ns + PATIENCE_NS
            self._connect()
            if self._stream is None:
                self._shadows.waiting.append(self)

    def note_plc_bytes(self) -> None:
        """Note the PLC end's bytes; after the first bytes the partner waits for the shadow's answer."""
        if self._asks:
            self._asks = False
            self.gives_up_at = self._shadows.network.now_ns + PATIENCE_NS
            self._run_or_queue(self._await_answer)
            if self._awaits:
                self._shadows.waiting.append(self)

    def _await_answer(self) -> None:
        self._awaits = not self._has_answer

    def try_again(self, may_try: bool) -> bool:
        """Try again to connect; return whether this partner still waits."""
        if may_try and self._stream is None:
            self._connect()
        is_late = self._shadows.network.now_ns >= self.gives_up_at
        if self._stream is not None:
            self._awaits &= not (self._has_answer or is_late)
            self._run_acts()
            return self._awaits
        if not is_late:
            return True
        self.left_out += self._kept
        self._acts.clear()
        self.is_over = True
        return False

    def _connect(self) -> None:
        wire, runtime = self._shadows.network.wire, self._shadows.bench.runtime
        if self._calls:
            port = runtime.listening_port(self.connect)
            config = self._shadows.bench.project.connect(self.connect)
            if port is None or config is None:
                return
            stream = wire.connect_as_partner(self._own, Endpoint(config.local.address, port))
            self._has_called |= stream is not None
            self.keeps_out = self._has_called  # else the same ends have a connection
            if stream is None or stream.phase is not StreamPhase.OPEN:
                return
        else:
            stream = wire.answer_as_partner(self.connect)
            if stream is None:
                runtime.retry_now(self.connect)
                return
        self._stream = stream
        self._shadows.forbid_skipping()
        stream.changed = self._drain
        self._run_acts()

    def _run_acts(self) -> None:
        while self._acts and not self._awaits:
            self._acts.popleft()()

    def _drain(self) -> None:
        stream = self._stream
        while stream is not None and stream.unread:
            self._has_answer = True
            stream.read(_WASTE_BUFFER, len(_WASTE_BUFFER))

    def _run_or_queue(self, act: Callable[[], None], size: int = 0) -> None:
        if not self._is_begun:
            self.begin_connecting()
        if self._stream is not None and not self._awaits:
            act()
        elif not self.is_over and self._kept + size <= PLAYED_SEND_ROOM:
            self._kept += size
            self._acts.append(act)
        else:
            self.left_out += size

    def send(self, data: bytes) -> None:
        self._shadows.room += len(data)
        ns = self._shadows.packet_ns
        if self._stream is not None and self._is_begun and not self._awaits:
            self._send_now(data, ns)
        else:
            self._run_or_queue(lambda: self._send_now(data, ns), len(data))

    def send_placeholder(self, size: int) -> None:
        """Send zeros in place of missing bytes, so that later bytes keep their offsets."""
        self._run_or_queue(lambda: self._send_placeholder(size))

    def _send_placeholder(self, size: int) -> None:
        if self.is_over:
            return
        shadows, place = self._shadows, size
        if size > shadows.room:  # leave out whole jobs: the next frame keeps its beginning
            job = shadows.last_job.get(self.connect, 1)
            left_out = -(-(size - shadows.room) // job) * job
            place = size - left_out if left_out <= size else size % job
            self.left_out += size - place
        shadows.room -= place
        if not place:
            return
        shadows.holes.setdefault(self.connect, deque()).append((self._sent, self._sent + place))
        self._send_now(bytes(place), shadows.packet_ns, A_HOLE)

    def _send_now(self, data: bytes, ns: int, what: str = A_PACKET) -> None:
        stream, rest = self._stream, memoryview(data)
        assert stream is not None
        if self._shadows.sent is not None:
            self._packets += 1
            ends = str(stream.local), str(stream.remote)
            self._shadows.sent(PeerSent(what, self._packets, *ends, self._sent, len(data)), ns)
        self._sent += len(data)
        while rest:
            part = rest[: max(PLAYED_SEND_ROOM - stream.pending_bytes, 0)]
            got = stream.write(part) if part else 0
            if not isinstance(got, int):  # the shadow has ended the connection
                self.left_out += len(rest)
                return
            rest = rest[got:]
            if rest and not self._wait_for_room(stream):
                self.left_out += len(rest)
                return

    def _wait_for_room(self, stream: SimStream) -> bool:
        unread = stream.pending_bytes
        for _ in range(QUIET_SCANS + 1):
            self._shadows.step()
            if stream.pending_bytes < unread:
                return True
        return False

    def end_partner(self, reset: bool) -> None:
        self.has_ended = True
        self._shadows.forbid_skipping()
        self._run_or_queue(self._reset_stream if reset else self._close_stream)

    def _close_stream(self) -> None:
        if self._stream is not None and not self.is_over:
            self._stream.shutdown(both=False)
        self.is_over = True

    def _reset_stream(self) -> None:
        if self._stream is not None:
            self._stream.abort()
        self.is_over = True

    def end_shadow(self, unread: int, may_read: bool, has_read: bool) -> None:
        """End the PLC end (rule 4). `may_read`: FIN after the partner's end; `has_read`: PLC read all."""
        self._shadows.forbid_skipping()
        self.has_left = self.has_ended = True
        self._stood, self._has_read = self._shadows.bench.runtime.scans - self._begun, has_read
        self.gives_up_at = self._shadows.network.now_ns + PATIENCE_NS
        self._run_or_queue(lambda: self._begin_leaving(unread, may_read))

    def _begin_leaving(self, unread: int, may_read: bool) -> None:
        if self._stream is not None:
            self._stream.withdraw(unread)
            if not may_read:
                self._shadows.leaving.append(self)

    @property
    def due_end_scan(self) -> int:
        """Return the scan in which the shadow of an ended PLC end must end (rule 4)."""
        runtime, task = self._shadows.bench.runtime, self._shadows.task_period_scans(self.connect)
        since = runtime.connected_in_scan(self.connect)
        now_ns, stream = self._shadows.network.now_ns, self._stream
        due = since + max(self._stood + task - 1, FIRST_JOB_SCANS * task)
        is_late = since <= self._begun or (self._has_read and stream is not None and stream.pending_bytes > 0)
        return max(due, runtime.scans + 2) if is_late and now_ns < self.gives_up_at else due

    def end_shadow_now(self) -> None:
        if self._stream is not None and self.has_left and not self.is_over:
            self._stream.end_by_plc()

    def drop_unread(self) -> None:
        if self._stream is not None:
            self.left_out += self._stream.pending_bytes
            self._stream.withdraw(self._stream.pending_bytes)

    def fall_silent(self) -> None:
        if self._stream is not None:
            self._stream.fall_silent()


class ConnectionlessPartner:
    """Datagrams for a socket or bytes of a serial line, played to shadows.

    `left_out` counts bytes that never reached the shadow, by the number of their conversation.
    """

    def __init__(self, shadows: ShadowBench, link: str, left_out: Counter[int]) -> None:
        self.gives_up_at = 0
        self.keeps_out = True
        self._shadows = shadows
        self.link = link
        self._left_out = left_out
        self._waiting: deque[tuple[int, int, Endpoint, bytes, int]] = deque()
        self._kept = 0  # bytes of these
        self._packets = self._sent = 0
        self._numbers: dict[Endpoint, int] = {}  # of the conversation of each source
        project = shadows.bench.project
        of_udp = project.connect(link) or project.udp_config(link)
        self._address = of_udp.local.address if of_udp is not None else ""  # "": a serial line

    def send(self, number: int, source: Endpoint, data: bytes, missing: int) -> None:
        """Send a datagram or bytes. The capture lacks `missing` more bytes."""
        ns = self._shadows.packet_ns
        if not self._waiting and self._try_deliver(ns, number, source, data, missing):
            return
        if not self._waiting:
            self.gives_up_at = self._shadows.network.now_ns + PATIENCE_NS
            self._shadows.waiting.append(self)
        if self._kept + len(data) <= MOST_UNREAD_BYTES:
            self._waiting.append((ns, number, source, data, missing))
            self._kept += len(data)
        else:
            self._left_out[number] += len(data)

    def try_again(self, may_try: bool) -> bool:
        """Try again to deliver; return whether something still waits."""
        while may_try and self._waiting and self._try_deliver(*self._waiting[0]):
            self._kept -= len(self._waiting.popleft()[3])
        if self._shadows.network.now_ns >= self.gives_up_at:
            self.drop_waiting()
        return bool(self._waiting)

    def drop_unread(self) -> None:
        port = self._shadows.bench.runtime.listening_port(self.link)
        if self._address and port is not None:
            for source, data in self._shadows.network.datagrams.withdraw(Endpoint(self._address, port)):
                self._left_out[self._numbers[source]] += len(data)

    def drop_waiting(self) -> None:
        for _, number, _, data, _ in self._waiting:
            self._left_out[number] += len(data)
        self._waiting.clear()
        self._kept = 0

    def _try_deliver(self, ns: int, number: int, source: Endpoint, data: bytes, missing: int) -> bool:
        shadows, whole = self._shadows, data + bytes(min(missing, MOST_UNREAD_BYTES))
        if self._address:
            port = shadows.bench.runtime.listening_port(self.link)
            if port is None:
                return False
            self._numbers[source] = number
            is_taken = shadows.network.datagrams.deliver(source, Endpoint(self._address, port), whole)
        else:
            line = shadows.bench.lines[self.link]
            if not line.is_open:
                return False
            is_taken = line.simulate_arrival(whole)
            shadows.forbid_skipping()
        if not is_taken:
            self._left_out[number] += len(data)
            return True
        self._packets += 1
        if shadows.sent is not None:
            ends = NO_END, self.link
            shadows.sent(PeerSent(A_PACKET, self._packets, *ends, self._sent, len(data)), ns)
            if missing:
                after = self._sent + len(data), len(whole) - len(data)
                shadows.sent(PeerSent(A_HOLE, self._packets, *ends, *after), ns)
        self._sent += len(whole)
        if missing:
            hole = self._sent - len(whole) + len(data), self._sent
            if self._address:
                shadows.of_datagrams.add(self.link)
                hole = self._packets - 1, self._packets
            shadows.holes.setdefault(self.link, deque()).append(hole)
        return True
