"""What a recording knows beside its packets: what the instances expect, and what its program did wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import JobStarted, SendEnded, SendStarted
from trcvtui.blocks.table import block_row
from trcvtui.capture.journal import GAP, Answered, Entry
from trcvtui.capture.recording import Recording
from trcvtui.errors import UserError
from trcvtui.net.events import BytesDropped, BytesReceived, ConnectionChanged
from trcvtui.net.kernel import PathInfo
from trcvtui.plc.ledger import InputEdge, StatusEdge
from trcvtui.project.project import Project
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.diagnosis.doctor import JobTrouble, RecordedFacts
from trcvtui.rig.diagnosis.lint import NO_PINS, HeldPins, lint, receivers_of
from trcvtui.rig.replay.keyframes import Keyframes
from trcvtui.rig.replay.run_again import RunAgain, restored_state
from trcvtui.rig.replay.what_if import WhatIf

LARGER: Final = "larger than LEN or DATA"
UNREAD, PATH = GAP + "unread", GAP + "path"
SECOND: Final = 1_000_000_000
GROWING: Final = 4  # seconds, one after the other
SILENT_MS: Final = 2000  # without an ACK
MOST_SCANS: Final = 1_000_000
PassScan = Callable[[RunAgain, int], bool]


class _Stack:
    """What waits in the stack of each CONNECT, as the gaps of a run ask: the least of each second."""

    def __init__(self, run: RunAgain) -> None:
        self._run = run
        self._least: dict[str, dict[int, int]] = {}
        self._read: dict[str, set[int]] = {}
        self._paths: dict[str, list[tuple[int, PathInfo]]] = {}  # of each second
        run.replay.entries = self._noted(run.replay.entries)

    def _noted(self, entries: Iterator[Entry]) -> Iterator[Entry]:
        for entry in entries:
            if isinstance(entry, Answered) and entry.call == UNREAD and isinstance(entry.answer, int):
                known = self._least.setdefault(entry.owner, {})
                second = self._run.bench.now // SECOND
                known[second] = min(known.get(second, entry.answer), entry.answer)
            if isinstance(entry, Answered) and entry.call == PATH and isinstance(entry.answer, PathInfo):
                second = self._run.bench.now // SECOND
                self._paths.setdefault(entry.owner, []).append((second, entry.answer))
            yield entry

    def read(self, connect: str, t_ns: int) -> None:
        self._read.setdefault(connect, set()).add(t_ns // SECOND)

    def floods(self) -> Iterator[tuple[str, int, int]]:
        """Yield each CONNECT for which more waits each second although jobs run: since when, for how long."""
        for connect, least in self._least.items():
            read = self._read.get(connect, set())
            since, run = 0, 0
            for before, second in pairwise(sorted(least)):
                grows = least[second] > least[before] and second in read and second == before + 1
                since, run = (since or second, run + 1) if grows else (0, 0)
                if run == GROWING:
                    yield connect, since, sum(least[s] > least[s - 1] for s in least if s - 1 in least)
                    break

    def not_reading(self) -> Iterator[tuple[str, int, int]]:
        """Yield each CONNECT on which bytes wait and no job reads: since when, for how long."""
        for connect, least in self._least.items():
            read = self._read.get(connect, set())
            waiting = [second for second in sorted(least) if least[second] and second not in read]
            yield from ((connect, *run) for run in _long_runs(waiting))

    def partner_not_reading(self) -> Iterator[tuple[str, int, int]]:
        """Yield each CONNECT on which bytes wait to leave, and what has left is acknowledged."""
        for connect, paths in self._paths.items():
            waiting = [second for second, path in paths if path.unsent and not path.unacked]
            yield from ((connect, *run) for run in _long_runs(waiting))

    def dead_links(self) -> Iterator[tuple[str, int, int]]:
        """Yield each CONNECT on which bytes have left, and nothing comes back."""
        for connect, paths in self._paths.items():
            silent = [second for second, path in paths if path.unacked and path.last_ack_ms >= SILENT_MS]
            yield from ((connect, *run) for run in _long_runs(silent))


def _long_runs(seconds: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Yield the longest run of seconds, if it is long: when it begins, how many follow each other."""
    best, since, length = (0, 0), 0, 0
    for second in seconds:
        since, length = (since, length + 1) if second == since + length and length else (second, 1)
        best = max(best, (length, since))
    if best[0] >= GROWING:
        yield best[1], best[0]


def recorded_facts(
    path: str, sets: Sequence[str] = (), is_running: bool = False, pass_scan: PassScan | None = None
) -> RecordedFacts | None:
    """Return what a recording of ours knows; None: it is none, or it cannot run.

    `sets`: with these parameters, `instance.TRCV_C_1.LEN=20`; raise UserError for one that is wrong. Of a run
    that goes on the pins of now count: a remedy that was applied is no fault any more. `pass_scan`
    lets a scan pass, and is told the last one.
    """
    try:
        recording = Recording(Path(path))
        keyframes = Keyframes(recording, path)
    except UserError:
        return None
    if sets:
        what_if = WhatIf(keyframes, sets, None)
        what_if.read_all()
        return _facts_of(what_if.recorded_run, what_if.what_if, what_if.scan, what_if.project, what_if.pins)
    try:
        run = keyframes.begin()
        last = keyframes.offset + max([place.scans for place in recording.index()], default=0)
        scan = run.scan if pass_scan is None else partial(pass_scan, run, last)
        with restored_state(run.is_restored, path):
            return _facts_of(run, run.bench, scan, run.bench.project, is_running=is_running)
    except UserError:
        return None


def _facts_of(
    run: RunAgain,
    bench: Bench,
    scan: Callable[[], bool],
    project: Project,
    held: HeldPins = NO_PINS,
    is_running: bool = False,
) -> RecordedFacts:
    connects = _Connects(bench)
    troubles = _troubles(run, bench, scan, connects)  # until it ends
    now = {each.name: dict(each.inputs) for each in bench.runtime.snapshot().instances}
    pins = now if is_running else None
    until_ns = run.begins.wall_ns + bench.now
    receivers = receivers_of(project, held, pins)
    return RecordedFacts(receivers, connects.by_ends, troubles, until_ns, lint(project, pins))


class _Connects:
    """The CONNECTs of a run, by the ends that their sockets had: as KnownEnds has them."""

    def __init__(self, bench: Bench) -> None:
        self.by_ends: dict[tuple[int, str], str] = {}
        for link in bench.runtime.snapshot().connections:  # of a run that was on its way already
            self.take(link.name, link.local, link.remote)

    def take(self, connect: str, local: str, peer: str) -> None:
        """Take the ends of a socket, "" where one is not known."""
        port = int(local.rpartition(":")[2] or 0)
        for pair in ((port, peer), (port, ""), (0, peer)):
            if pair != (0, ""):
                self.by_ends.setdefault(pair, connect)


def _troubles(
    run: RunAgain, bench: Bench, pass_scan: Callable[[], bool], connects: _Connects
) -> tuple[JobTrouble, ...]:
    """Run it again, and count edges of REQ in a running job, and jobs without a connection."""
    found: dict[tuple[str, str], JobTrouble] = {}
    sends, asked, stopped = set[str](), set[str](), set[str]()
    dropped: dict[tuple[str, int], tuple[int, int]] = {}
    streams = {each.name for each in bench.project.connects if not each.is_message_oriented}
    receivers = {each.name for each in bench.project.instances if block_row(each.block).receives}
    connects_of = {each.name: each.connect for each in bench.project.instances}
    takers = {each.connect: each.name for each in bench.project.instances if each.name in receivers}
    seq, wall_ns = 0, run.begins.wall_ns
    ledger, stack = bench.runtime.ledger, _Stack(run)

    def tell(cause: str, instance: str, scan: int, t_ns: int) -> None:
        known = found.get((cause, instance))
        connect = connects_of.get(instance, instance)
        first = known or JobTrouble(cause, instance, connect, scan, wall_ns + t_ns, 0)
        found[cause, instance] = first._replace(times=first.times + 1)

    try:
        while pass_scan() and bench.runtime.scans < MOST_SCANS:
            if ledger.last_seq == seq:
                continue
            news, seq = ledger.stamped_since(seq), ledger.last_seq
            for scan, t_ns, event in news:
                match event:
                    case InputEdge(instance, "REQ", value) if value and instance in sends:
                        tell("request-too-fast", instance, scan, t_ns)
                    case ConnectionChanged():
                        connects.take(event.connection, event.local, event.peer)
                    case BytesReceived():
                        stack.read(event.connection, t_ns)
                    case SendStarted():
                        sends.add(event.instance)
                    case SendEnded():
                        sends.discard(event.instance)
                    case StatusEdge() if event.outputs.error and event.condition == Condition.NOT_CONNECTED:
                        tell("not-connected-request", event.instance, scan, t_ns)
                    case StatusEdge() if event.condition == Condition.INTERNAL_FAULT:
                        stopped.add(event.instance)  # what it leaves undone is no fault of the line
                    case InputEdge(instance, "EN_R", value) if value and scan > 1:
                        asked.add(instance)
                    case BytesDropped(connection, _, _, _, reason) if reason == LARGER:
                        tell("datagram-size", takers.get(connection, connection), scan, t_ns)
                    case BytesDropped() if event.offset >= 0:
                        dropped[event.connection, event.incarnation] = scan, t_ns
                    case JobStarted() if not event.adhoc:
                        lost = dropped.pop((event.connection, event.incarnation), None)
                        if lost is not None and event.connection in streams:
                            tell("shifted", event.instance, *lost)
                    case _:
                        pass
    except UserError:
        pass  # the recording ends here
    senders = {each.connect: each.name for each in bench.project.instances if block_row(each.block).sends}
    for cause, blocks, some in (
        ("flood", takers, stack.floods()),
        ("plc-not-reading", takers, stack.not_reading()),
        ("partner-not-reading", senders, stack.partner_not_reading()),
        ("dead-link", senders, stack.dead_links()),
    ):
        for connect, since, seconds in some:
            if connect in blocks:
                scan = since * SECOND // bench.runtime.interval_ns + 1
                at = wall_ns + since * SECOND
                found[cause, connect] = JobTrouble(cause, blocks[connect], connect, scan, at, seconds)
    # EN_R that is 1 from the beginning costs nothing: the job begins when the connection stands.
    return tuple(
        [
            one
            for one in found.values()
            if one.instance not in stopped
            if one.times > 1 or one.cause == "datagram-size" or one.instance not in receivers - asked
        ]
    )
