"""Facts of a recording besides its packets: what the instances expect, and faults of the PLC's program."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Final

from msgspec.structs import replace

from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import ReceiveEnded, ReceiveStarted, SendEnded, SendStarted
from trcvtui.blocks.table import block_row
from trcvtui.diagnosis.block_symptoms import BlockSymptoms
from trcvtui.diagnosis.doctor import RecordedFacts
from trcvtui.diagnosis.doctor_process import DoctorWorker, ReportScan
from trcvtui.diagnosis.lint import NO_PINS, HeldPins, lint, list_receivers
from trcvtui.diagnosis.receiver import NEVER_NS, Receiver
from trcvtui.errors import UserError
from trcvtui.net.events import BytesDropped, BytesReceived, ConnectionChanged, EventKind
from trcvtui.net.kernel import PathInfo
from trcvtui.plc.ledger import InputEdge, StatusEdge
from trcvtui.project.project import Project
from trcvtui.recording.arrivals import BYTES_ARRIVED
from trcvtui.recording.journal import IN_GAP, STEP, CallRecord, Entry
from trcvtui.recording.recording import Recording
from trcvtui.recording.writer import run_writer
from trcvtui.replay.keyframes import Keyframes
from trcvtui.replay.run_again import ReplayRun, guard_restored
from trcvtui.replay.what_if import WhatIf
from trcvtui.scenario.scenario import load_bench_project
from trcvtui.snapshots.doctor import Finding, Remedy
from trcvtui.wording import times

LARGER_REASON: Final = "larger than LEN or DATA"
ARRIVED_CALL, PATH = IN_GAP + BYTES_ARRIVED, IN_GAP + "path"
SECOND: Final = 1_000_000_000
LEAST_SECONDS: Final = 4  # seconds, one after the other
RECENT_S: Final = 10
LEAST_GOOD_JOBS: Final = 2
SILENT_MS: Final = 2000  # without an ACK
MOST_SCANS: Final = 1_000_000
NOT_CALLED_REMEDY: Final = Remedy("EN_R is 1: call the block in each scan, and look at its STATUS")


# What a program did wrong: how sure it is as a cause, its text, the remedies; (): that of the cause.
# `{instance}` in a remedy is the one that it is for.
# fmt: off
TROUBLE_ROWS: Final[Mapping[str, tuple[float, str, tuple[Remedy, ...]]]] = {
    "shifted": (0.95, "bytes of an unfinished frame were thrown away, and the next job began inside it:",
                (Remedy("keep EN_R at 1 until DONE"),
                 Remedy("COM_RST lets a new frame begin", "pulse {instance} COM_RST"))),
    "flood": (0.85, "in one second more bytes came than jobs took, so the waiting bytes grew:", ()),
    "plc-not-reading": (0.85, "in one second bytes waited at the PLC and no job read them:",
                        (Remedy("keep EN_R at 1", "set {instance} EN_R=1", "instance.{instance}.EN_R=true"),),
                        ),
    "partner-not-reading": (0.85, "in one second bytes waited to leave; the partner announced no room:", ()),
    "dead-link": (0.85, "in one second no byte that was sent was acknowledged, or the stack gave up:", ()),
    "datagram-size": (0.95, "a datagram was larger than LEN or DATA:", ()),
    "request-too-fast": (0.93, "REQ rose while the previous job was sending:", ()),
    "not-connected-request": (0.93, "a job was requested without a connection:", ()),
}
# fmt: on


class _WaitingBytes:
    """Bytes that wait in the stack of each CONNECT: the smallest count in each second of the run."""

    def __init__(self, run: ReplayRun) -> None:
        self._run = run
        self._least: dict[str, dict[int, int]] = {}
        self._read: dict[str, set[int]] = {}
        self._unread: dict[int, tuple[str, int]] = {}  # by handle: owner, bytes
        self._paths: dict[str, list[tuple[int, PathInfo]]] = {}  # by CONNECT: second, path
        run.replay.entries = self._watch_entries(run.replay.entries)

    def _watch_entries(self, entries: Iterator[Entry]) -> Iterator[Entry]:
        for entry in entries:
            if isinstance(entry, CallRecord):
                self._count_entry(entry)
            if isinstance(entry, CallRecord) and entry.call == PATH and isinstance(entry.answer, PathInfo):
                second = self._run.bench.now // SECOND
                self._paths.setdefault(entry.owner, []).append((second, entry.answer))
            yield entry

    def _count_entry(self, entry: CallRecord) -> None:
        match entry:
            case CallRecord(_, call, _, int(now)) if call == STEP:
                for owner, unread in self._unread.values():
                    known = self._least.setdefault(owner, {})
                    known[now // SECOND] = min(known.get(now // SECOND, unread), unread)
            case CallRecord(owner, call, (int(handle), _, int(unread), _)) if call == ARRIVED_CALL:
                self._unread[handle] = owner, unread
            case CallRecord(owner, "recv", (int(handle), *_), (_, bytes(data))):
                self._unread[handle] = owner, max(0, self._unread.get(handle, (owner, 0))[1] - len(data))
            case CallRecord(_, "close" | "abort", (int(handle),)):
                self._unread.pop(handle, None)

    def note_read(self, connect: str, t_ns: int) -> None:
        self._read.setdefault(connect, set()).add(t_ns // SECOND)

    def forget_before(self, second: int) -> None:
        for least in self._least.values():
            for old in [each for each in least if each < second]:
                del least[old]
        for connect, paths in self._paths.items():
            self._paths[connect] = [each for each in paths if each[0] >= second]

    def find_floods(self) -> Iterator[tuple[str, int, int]]:
        """Yield each CONNECT on which unread bytes grow although jobs read: first second, number of s."""
        for connect, least in self._least.items():
            read = self._read.get(connect, set())
            since, run = 0, 0
            for before, second in pairwise(sorted(least)):
                grows = least[second] > least[before] and second in read and second == before + 1
                since, run = (since or second, run + 1) if grows else (0, 0)
                if run == LEAST_SECONDS:
                    yield connect, since, sum(least[s] > least[s - 1] for s in least if s - 1 in least)
                    break

    def find_not_reading(self) -> Iterator[tuple[str, int, int]]:
        """Yield each CONNECT on which bytes wait and no job reads: since when, for how long."""
        for connect, least in self._least.items():
            read = self._read.get(connect, set())
            waiting = [second for second in sorted(least) if least[second] and second not in read]
            yield from ((connect, *run) for run in _find_long_run(waiting))

    def find_partner_not_reading(self) -> Iterator[tuple[str, int, int]]:
        """Yield each CONNECT on which unsent bytes wait although all sent bytes are acknowledged."""
        for connect, paths in self._paths.items():
            waiting = [second for second, path in paths if path.unsent and not path.unacked]
            yield from ((connect, *run) for run in _find_long_run(waiting))

    def find_dead_links(self) -> Iterator[tuple[str, int, int]]:
        """Yield each CONNECT on which sent bytes are not acknowledged for long."""
        for connect, paths in self._paths.items():
            silent = [second for second, path in paths if path.unacked and path.last_ack_ms >= SILENT_MS]
            yield from ((connect, *run) for run in _find_long_run(silent))


def _find_long_run(seconds: Sequence[int]) -> Iterator[tuple[int, int]]:
    best, since, length = (0, 0), 0, 0
    for second in seconds:
        since, length = (since, length + 1) if second == since + length and length else (second, 1)
        best = max(best, (length, since))
    if best[0] >= LEAST_SECONDS:
        yield best[1], best[0]


def collect_recorded_facts(
    path: str, sets: Sequence[str] = (), is_running: bool = False, tell: ReportScan | None = None
) -> RecordedFacts | None:
    """Return the facts of a recording, or None if the file is no recording of trcvtui or cannot run again.

    `sets` has other parameters, as `instance.TRCV_C_1.LEN=20`; raise UserError for a wrong one. While the
    run continues, the present pins are judged, so a mended fault is not reported. `tell` is called for each
    scan.
    """
    try:
        recording = Recording(Path(path))
        keyframes = Keyframes(recording, path)
    except UserError:
        return None
    if sets:
        what_if = WhatIf(keyframes, sets, None)
        return _collect(what_if.recorded_run, what_if.what_if, what_if.scan, what_if.project, what_if.pins)
    try:
        run = keyframes.start_run()
        last = keyframes.offset + max([place.scans for place in recording.read_index()], default=0)
        scan = run.scan if tell is None else partial(_scan_and_report, run, last, tell)
        with guard_restored(run.is_restored, path):
            return _collect(run, run.bench, scan, run.bench.project, is_running=is_running)
    except UserError:
        return None


def judge_main(path: str, asked: str) -> None:
    """Run as the process of the doctor (diagnosis/judges.py)."""
    run_writer(asked, lambda _: DoctorWorker(path, collect_recorded_facts, load_bench_project), path)


def _scan_and_report(run: ReplayRun, last: int, tell: ReportScan) -> bool:
    tell(run.bench.runtime.scans, last)
    return run.scan()


def _collect(
    run: ReplayRun,
    bench: Bench,
    scan: Callable[[], bool],
    project: Project,
    held: HeldPins = NO_PINS,
    is_running: bool = False,
) -> RecordedFacts:
    facts = _RunFacts(run, bench, project)
    facts.run_to_end(scan)
    now = {each.name: dict(each.inputs) for each in bench.runtime.snapshot().instances}
    pins = now if is_running else None
    project = bench.project if is_running else project  # as it has been edited
    receivers = list_receivers(project, held, pins)
    receivers = tuple([facts.adapt_receiver(one, is_running) for one in receivers])
    until_ns = facts.wall_ns + bench.now
    return RecordedFacts(
        receivers,
        facts.by_ends,
        facts.harms,
        facts.find_troubles(is_running),
        until_ns,
        lint(project, pins),
        is_running,
        facts.symptoms.list_findings(is_running),
    )


class _RunFacts:
    """Facts of a run that its packets do not show, collected while it runs again.

    `by_ends` has CONNECTs by the ends of their sockets, as in KnownEnds. `harms` has, for each CONNECT, the
    UTC times at which one of its blocks showed an ERROR or lost a job.
    """

    def __init__(self, run: ReplayRun, bench: Bench, project: Project) -> None:
        self.wall_ns = run.begins.wall_ns
        self.by_ends: dict[tuple[int, str], str] = {}
        self.harms: dict[str, list[int]] = {}
        self._bench, self._stack = bench, _WaitingBytes(run)
        self.symptoms = BlockSymptoms(bench, self.wall_ns)
        self._found: dict[tuple[str, str], Finding] = {}
        self._times = Counter[tuple[str, str]]()
        self._jobs: dict[str, ReceiveStarted] = {}  # the first of each instance
        self._until: dict[str, int] = {}  # when its LEN or ADHOC changed first (UTC)
        self._changed: dict[str, int] = {}  # and last
        self._done = Counter[str]()  # jobs of each CONNECT
        self._done_then: dict[tuple[str, str], int] = {}  # jobs at the last sight of a trouble
        self._rose: dict[str, int] = {}  # in which scan REQ or EN_R of an instance rose last
        self._sends, self._stopped = set[str](), set[str]()
        self._dropped: dict[tuple[str, int], tuple[int, int]] = {}
        self._streams = {each.name for each in project.connects if not each.is_message_oriented}
        self._datagrams = {each.name for each in project.connects if each.is_datagram}
        self._connects = {each.name: each.connect for each in project.instances}
        rows = [(each, block_row(each.block)) for each in project.instances]
        self._takers = {each.connect: each.name for each, row in rows if row.receives_on_net}
        self._senders = {each.connect: each.name for each, row in rows if row.sends_on_net}
        for link in bench.runtime.snapshot().connections:  # of a run that was on its way already
            self._add_ends(link.name, link.local, link.remote)

    def run_to_end(self, pass_scan: Callable[[], bool]) -> None:
        ledger, seq = self._bench.runtime.ledger, 0
        try:
            while pass_scan() and self._bench.runtime.scans < MOST_SCANS:
                if ledger.last_seq != seq:
                    news, seq = ledger.events_since(seq), ledger.last_seq
                    for scan, t_ns, event in news:
                        self._add_event(scan, t_ns, event)
        except UserError:
            pass  # the recording ends here, or differs from here on: what was seen counts

    def _add_event(self, scan: int, t_ns: int, event: object) -> None:
        self.symptoms.add_event(scan, t_ns, event)
        match event:
            case InputEdge(instance, "REQ" | "EN_R" as pin, value) if value:
                if pin == "REQ" and instance in self._sends:
                    self._add_trouble("request-too-fast", instance, scan, t_ns)
                self._rose[instance] = scan
            case InputEdge(instance, "LEN" | "ADHOC") if instance in self._jobs:
                self._changed[instance] = self.wall_ns + t_ns
                self._until.setdefault(instance, self.wall_ns + t_ns)
            case ConnectionChanged():
                self._add_ends(event.connection, event.local, event.peer)
                if event.what is EventKind.CONNECTED:  # its stream begins anew: the trouble is over
                    self._done_then["shifted", event.connection] = -LEAST_GOOD_JOBS
            case BytesReceived():
                self._stack.note_read(event.connection, t_ns)
            case SendStarted():
                self._sends.add(event.instance)
            case SendEnded():
                self._sends.discard(event.instance)
            case StatusEdge() if event.outputs.error:
                self._add_error(event.instance, Condition(event.condition), scan, t_ns)
            case BytesDropped(connection, _, _, _, reason) if reason == LARGER_REASON:
                self._add_trouble("datagram-size", self._takers.get(connection, connection), scan, t_ns)
            case BytesDropped() if event.offset >= 0:
                self._dropped[event.connection, event.incarnation] = scan, t_ns
            case ReceiveStarted():
                self._add_job(event)
        if isinstance(event, SendEnded | ReceiveEnded) and event.done:
            self._done[event.connection] += 1
        elif isinstance(event, SendEnded | ReceiveEnded) and event.size:
            self.harms.setdefault(event.connection, []).append(self.wall_ns + t_ns)

    def _add_ends(self, connect: str, local: str, peer: str) -> None:
        """Note the CONNECT of a socket by the socket's two ends. An unknown end is an empty text."""
        port = int(local.rpartition(":")[2] or 0)
        for pair in ((port, peer), (port, ""), (0, peer)):
            if pair != (0, ""):
                self.by_ends.setdefault(pair, connect)

    def _add_error(self, instance: str, condition: Condition, scan: int, t_ns: int) -> None:
        self.harms.setdefault(self._connects.get(instance, ""), []).append(self.wall_ns + t_ns)
        if condition is Condition.INTERNAL_FAULT:
            self._stopped.add(instance)  # what it does not do is no fault of the line
        elif condition is Condition.LINK_DEAD:
            self._add_trouble("dead-link", instance, scan, t_ns)
        elif condition is Condition.MESSAGE_TOO_LONG and self._connects.get(instance) in self._datagrams:
            self._add_trouble("datagram-size", instance, scan, t_ns)
        elif condition is Condition.NOT_CONNECTED:
            # EN_R = 1 from the beginning costs nothing: the job begins when the connection is there.
            is_asked = (
                instance not in self._takers.values() or scan - self._rose.get(instance, -2) <= 1 < scan
            )
            if is_asked:
                self._add_trouble("not-connected-request", instance, scan, t_ns)

    def _add_job(self, started: ReceiveStarted) -> None:
        self._jobs.setdefault(started.instance, started)
        lost = self._dropped.pop((started.connection, started.incarnation), None)
        if lost is not None and started.connection in self._streams and not started.adhoc:
            self._add_trouble("shifted", started.instance, *lost)

    def _add_trouble(self, cause: str, instance: str, scan: int, t_ns: int) -> None:
        connect = self._connects.get(instance, instance)
        self._found.setdefault((cause, connect), self._make_finding(cause, instance, connect, scan, t_ns))
        self._times[cause, connect] += 1
        # Jobs that begin inside messages end with DONE, too: only a new connection ends this trouble.
        self._done_then[cause, connect] = NEVER_NS if cause == "shifted" else self._done[connect]

    def _make_finding(self, cause: str, instance: str, connect: str, scan: int, t_ns: int) -> Finding:
        (sure, text, mends), at = TROUBLE_ROWS[cause], (self.wall_ns + t_ns, 0, 0, 0)
        mend = tuple([
            replace(one, command=one.command and one.command.format(instance=instance),
                    set=one.set and one.set.format(instance=instance))
            for one in mends
        ])  # fmt: skip
        return Finding(sure, (text,), "", at, instance, mend, cause=cause, scan=scan, connect=connect)

    def adapt_receiver(self, receiver: Receiver, is_running: bool) -> Receiver:
        job = self._jobs.get(receiver.instance)
        if is_running:  # pieces that jobs took without ADHOC are none of a job with ADHOC
            return receiver._replace(
                since_ns=self._changed.get(receiver.instance, 0) if receiver.adhoc else 0
            )
        if job is None or not receiver.need:
            return receiver
        until_ns = self._until.get(receiver.instance, NEVER_NS)
        return receiver._replace(need=job.length, adhoc=job.adhoc, until_ns=until_ns)

    def _comes_of_refusal(self, cause: str, instance: str) -> bool:
        """Return whether bytes wait because the instance refuses its jobs: another finding says so."""
        return cause in ("flood", "plc-not-reading") and self.symptoms.refuses_jobs(instance)

    def find_troubles(self, is_running: bool) -> tuple[Finding, ...]:
        """Return faults of the program, and faults that the stack of a CONNECT shows for several seconds.

        While the run continues, two good jobs end a trouble, and only the last RECENT_S seconds count.
        """
        if is_running:
            then = self._done_then
            over = [key for key in self._found if self._done[key[1]] - then[key] >= LEAST_GOOD_JOBS]
            for key in over:
                del self._found[key], self._times[key]
            self._stack.forget_before(self._bench.now // SECOND - RECENT_S)
        for cause, blocks, some in (
            ("flood", self._takers, self._stack.find_floods()),
            ("plc-not-reading", self._takers, self._stack.find_not_reading()),
            ("partner-not-reading", self._senders, self._stack.find_partner_not_reading()),
            ("dead-link", self._senders, self._stack.find_dead_links()),
        ):
            for connect, since, seconds in some:
                if connect in blocks and not self._comes_of_refusal(cause, blocks[connect]):
                    scan = since * SECOND // self._bench.runtime.interval_ns + 1
                    trouble = self._make_finding(cause, blocks[connect], connect, scan, since * SECOND)
                    shown = self._bench.runtime.instance_snapshot(blocks[connect])
                    if cause == "plc-not-reading" and shown is not None and shown.pin("EN_R"):
                        trouble = replace(trouble, mend=(NOT_CALLED_REMEDY,))
                    self._found[cause, connect], self._times[cause, connect] = trouble, seconds
        found = [(key, one) for key, one in self._found.items() if one.instance not in self._stopped]
        return tuple(
            [replace(one, evidence=(f"{one.evidence[0]} {times(self._times[key])}",)) for key, one in found]
        )
