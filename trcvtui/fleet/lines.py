"""The lines and instances of an agent: pictures of a bench become messages, ERROR edges become events."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Final

from msgspec.structs import replace

from trcvtui.fleet.topics import MOST_RECENT, EventMessage, FiguresMessage, RecentMessage, StatusMessage
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.plc.ledger import StatusEdge
from trcvtui.plc.snapshot import ConnectionSnapshot, InstanceSnapshot
from trcvtui.scenario.runner import cause_record
from trcvtui.snapshots.doctor import DoctorSnapshot, Finding, Remedy

NS: Final = 1_000_000_000
HOUR_S: Final = 3600
MINUTE_S: Final = 60
MOST_TIMES: Final = 4096  # kept times of ERRORs (an hour) and DONEs (a minute)


class AgentInstance:
    """One instance: its status and its newest events."""

    def __init__(self, line: str, name: str) -> None:
        self.line, self.name = line, name
        self.status: StatusMessage | None = None
        self.finding = ""  # the surest cause of the doctor's last look
        self.recent: deque[EventMessage] = deque(maxlen=MOST_RECENT)
        self.count = 0
        self.jobs_done = self.errors = 0  # since the agent started, over all its engines
        self._last: tuple[bool, int] = (False, 0)  # ERROR and STATUS of the edge before
        self._base = 0, 0  # counts of the engines before

    def make_edge(
        self, boot: str, at: float, edge: StatusEdge, place: dict[str, object]
    ) -> EventMessage | None:
        """Return an event if ERROR is new or has a new STATUS, else None. `place` has its scan and file."""
        shown = edge.outputs.error, edge.outputs.status
        is_new = edge.outputs.error and shown != self._last
        self._last = shown
        if not is_new:
            return None
        cause = cause_record(edge.cause, edge.block) | place
        return self.add_event(boot, at, "error", f"{edge.outputs.status:04X}", cause)

    def add_event(
        self, boot: str, at: float, kind: str, status: str | None, cause: dict[str, object]
    ) -> EventMessage:
        self.count += 1
        made = EventMessage(f"{boot}-{self.count}", at, kind, status, cause)
        self.recent.append(made)
        return made

    def recent_message(self, at: float) -> RecentMessage:
        return RecentMessage(at, self.count, tuple(self.recent))

    def begin_run(self) -> None:
        """Keep the counts so far: the counts of a new engine, which begin at 0, are added to them."""
        self._base = self.jobs_done, self.errors
        self._last = False, 0

    def update(self, shown: InstanceSnapshot, text: str, at: float, age_s: float) -> bool:
        """Set the status; return whether it has changed, apart from its times."""
        outputs = shown.outputs
        self.jobs_done, self.errors = self._base[0] + shown.jobs_done, self._base[1] + shown.errors
        status = StatusMessage(
            at,
            f"{outputs.status:04X}",
            text,
            outputs.busy,
            outputs.done,
            outputs.error,
            self.jobs_done,
            self.errors,
            shown.have,
            shown.need,
            round(age_s, 3),
            self.finding,
        )
        before, self.status = self.status, status
        return before is None or replace(before, t=status.t, age_s=status.age_s) != status


class AgentLine:
    """One CONNECT or ComBuffer: its state, its bytes, and times of ERRORs and DONEs."""

    def __init__(self, name: str) -> None:
        self.name, self.state = name, ""
        self.received = self.sent = 0  # bytes since the agent started
        self._last_figures = 0, 0, 0.0  # received, sent, time
        self._of_connection = 0, 0, 0  # incarnation, received, sent
        self.errors: deque[float] = deque(maxlen=MOST_TIMES)
        self.dones: deque[tuple[float, int]] = deque(maxlen=MOST_TIMES)

    def update(self, state: str, incarnation: int, received: int, sent: int) -> bool:
        """Add the counters of a connection; return whether its state has changed."""
        last, last_received, last_sent = self._of_connection
        # Another connection, or another engine, counts from 0 again.
        is_same = last == incarnation and received >= last_received and sent >= last_sent
        self.received += received - last_received if is_same else received
        self.sent += sent - last_sent if is_same else sent
        self._of_connection = incarnation, received, sent
        changed, self.state = state != self.state, state
        return changed

    def take_figures(self, at: float) -> FiguresMessage:
        """Return the figures for the time since the last call."""
        received, sent, then = self._last_figures
        seconds = max(at - then, 1e-3) if then else float(MINUTE_S)
        self._last_figures = self.received, self.sent, at
        while self.errors and self.errors[0] < at - HOUR_S:
            self.errors.popleft()
        while self.dones and self.dones[0][0] < at - MINUTE_S:
            self.dones.popleft()
        rates = (self.received - received) / seconds, (self.sent - sent) / seconds
        done = sum(count for _, count in self.dones)
        return FiguresMessage(at, self.state, round(rates[0], 1), round(rates[1], 1), done, len(self.errors))

    @property
    def has_moved(self) -> bool:
        """Return whether bytes were received or sent since the last figures."""
        return (self.received, self.sent) != self._last_figures[:2]


class AgentBench:
    """The lines and instances of a bench by name. `boot` identifies this run of the agent.

    `names` has the name of the line of a CONNECT or ComBuffer, if the two names differ.
    """

    def __init__(
        self,
        boot: str,
        label: Callable[[str], str],
        recorded_in: Callable[[], str] = lambda: "",
        names: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.boot, self._label, self._recorded_in, self._names = boot, label, recorded_in, names
        self.lines: dict[str, AgentLine] = {}
        self.instances: dict[str, AgentInstance] = {}
        self.seq = 0  # the last line read from the ledger
        self._looks = 0  # of the doctor, at the last report
        self._known: set[tuple[str, str]] = set()  # instance and cause of each finding of the last look

    def begin_run(self) -> None:
        """Read the ledger of a new engine from its beginning."""
        self.seq = self._looks = 0
        self._known.clear()
        for instance in self.instances.values():
            instance.begin_run()

    def handle_update(
        self, update: BenchUpdate, wall: float
    ) -> tuple[list[AgentInstance], list[tuple[AgentInstance, EventMessage]], list[AgentLine]]:
        """Apply a picture. Return changed instances, new events, and lines whose state has changed."""
        snapshot = update.snapshot
        began = wall - snapshot.t_ns / NS
        events = []
        if update.lines_skipped:  # an ERROR may be among them: leave a note
            for instance in self.instances.values():
                missed = {
                    "text": f"{update.lines_skipped} lines of the ledger were not read: too many at once"
                }
                events.append((instance, instance.add_event(self.boot, wall, "note", None, dict(missed))))
        for each in snapshot.instances:
            line_name = self._names.get(each.connect, each.connect)
            self.instances.setdefault(each.name, AgentInstance(line_name, each.name))
        file = self._file_record() if update.lines else {}
        for line in update.lines:
            self.seq = line.seq
            if isinstance(line.event, StatusEdge) and line.event.instance in self.instances:
                seen = self.instances[line.event.instance]
                at = round(began + line.t_ns / NS, 3)
                event = seen.make_edge(self.boot, at, line.event, {"scan": line.scan, **file})
                if event is not None:
                    events.append((seen, event))
                    self._get_line(seen.line).errors.append(at)
        moved = [line for line in self._update_lines(update) if line is not None]
        return (
            list(self._update_instances(snapshot.instances, snapshot.scan, snapshot.interval_ns, wall)),
            events,
            moved,
        )

    def _file_record(self) -> dict[str, object]:
        file = self._recorded_in()
        return {"file": file} if file else {}

    def activity_key(self) -> tuple[object, ...]:
        """Return a key that changes when the doctor has something new to judge."""
        counted = tuple((line.received, line.sent, line.state) for line in self.lines.values())
        return (*counted, *(each.errors for each in self.instances.values()))

    def make_finding_events(
        self, doctor: DoctorSnapshot, wall: float, with_payload: bool
    ) -> Iterable[tuple[AgentInstance, EventMessage]]:
        """Yield an event for each (instance, cause) that the doctor's previous findings did not have."""
        if doctor.looks == self._looks:
            return
        self._looks, found, surest = doctor.looks, set(), dict[str, str]()
        for one in doctor.findings:
            for seen in self.instances.values():
                line = self._names.get(one.connect, one.connect)
                is_its = one.instance == seen.name or (not one.instance and line in ("", seen.line))
                if not is_its or (seen.name, one.cause) in found:
                    continue
                surest.setdefault(seen.name, one.cause)
                found.add((seen.name, one.cause))
                if (seen.name, one.cause) not in self._known:
                    cause = _finding_record(one, with_payload) | self._file_record()
                    yield seen, seen.add_event(self.boot, round(wall, 3), "finding", None, cause)
        self._known = found
        for seen in self.instances.values():
            seen.finding = surest.get(seen.name, "")

    def _update_instances(
        self, shown: Iterable[InstanceSnapshot], scan: int, interval_ns: int, wall: float
    ) -> Iterable[AgentInstance]:
        for each in shown:
            seen = self.instances[each.name]
            done = seen.jobs_done
            age = (scan - each.since_scan) * interval_ns / NS
            if seen.update(each, self._label(each.condition), round(wall, 3), age):
                yield seen
            if seen.jobs_done > done:
                self._get_line(seen.line).dones.append((wall, seen.jobs_done - done))

    def _update_lines(self, update: BenchUpdate) -> Iterable[AgentLine | None]:
        for each in update.snapshot.connections:
            line = self._get_line(self._names.get(each.name, each.name))
            yield line if line.update(*_link_counters(each)) else None
        for buffer in update.snapshot.combuffers:
            line = self._get_line(self._names.get(buffer.name, buffer.name))
            yield line if line.update("up" if buffer.is_up else "away", 0, buffer.arrived, 0) else None

    def _get_line(self, name: str) -> AgentLine:
        return self.lines.setdefault(name, AgentLine(name))


def _finding_record(one: Finding, with_payload: bool) -> dict[str, object]:
    """Return the cause record of a finding's event."""
    mend = one.mend[0] if one.mend else Remedy("")
    text = "; ".join(filter(None, (f"{one.confidence:.0%} sure", mend.text)))
    evidence = one.evidence[0] if with_payload and one.evidence else None  # it may quote payload bytes
    more = {"command": mend.command, "scan": one.scan, "evidence": evidence}
    known = {name: value for name, value in more.items() if value is not None}
    return {"cause": one.cause, "confidence": one.confidence, "text": text, **known}


def _link_counters(link: ConnectionSnapshot) -> tuple[str, int, int, int]:
    return link.state, link.incarnation, link.bytes_received, link.bytes_sent
