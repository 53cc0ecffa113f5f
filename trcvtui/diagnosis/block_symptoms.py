"""The symptoms that the blocks of a run showed, found while the run is repeated.

Rule: an ERROR counts if it shows at the end, or came again after all was well. A single 80C4 at the start
is no fault.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Any, Final

from msgspec.structs import replace

from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import BUSY_CONDITIONS, DONE_CONDITIONS, Condition
from trcvtui.blocks.environment import ReceiveEnded, SendEnded
from trcvtui.blocks.table import block_row
from trcvtui.diagnosis.advice import make_advice
from trcvtui.diagnosis.evidence import NO_FACTS, make_past_evidence
from trcvtui.diagnosis.readings.framing_advice import advise_framings
from trcvtui.diagnosis.readings.proposal import FramingAdvice
from trcvtui.diagnosis.symptoms import JOB_REFUSALS, LINK_ERRORS
from trcvtui.history.records import ScanStamp
from trcvtui.net.events import BytesReceived
from trcvtui.net.layers.layered_stream import SESSION_ENDED as SESSION_ENDED
from trcvtui.plc.ledger import BenchNote, InputEdge, Line, StatusEdge
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.snapshots.doctor import Finding, Remedy
from trcvtui.wording import SECOND, count, format_ns, times

LINKED_CONDITIONS: Final = (
    BUSY_CONDITIONS | DONE_CONDITIONS | {Condition.CONNECTED, Condition.ESTABLISHED}
) - {Condition.NOTHING_TO_RESET}
BUILDING_CONDITIONS: Final = frozenset({Condition.CREATING, Condition.CREATED, Condition.ESTABLISHING})
UNCONNECTED_NS: Final = 10 * SECOND
QUIET_NS: Final = SECOND  # of a job with bytes, at least; after a single message ten times as long
KEPT_PAUSES: Final = 64
GOOD_JOBS: Final = 2
RECENT_NS: Final = 10 * SECOND
FACT_CONFIDENCE: Final = 0.95
FRAMING_CONFIDENCE: Final = 0.85  # a proposal that was not tried on the block
OVERRUN_CONDITIONS: Final = (Condition.STRING_OVERRUN, Condition.DATA_OVERRUN)
NO_ADVICE: Final = FramingAdvice((), "")


@dataclass
class _ErrorRecord:
    """One ERROR of one instance. `good` counts the DONEs since the ERROR last showed."""

    line: Line
    edge: StatusEdge
    last_ns: int
    times: int = 0
    good: int = 0
    is_over: bool = False
    has_recurred: bool = False


def _last_error_ns(item: tuple[object, _ErrorRecord]) -> int:
    return item[1].last_ns


class BlockSymptoms:
    """Takes the ledger of a run line by line. Afterwards `list_findings` returns the symptoms."""

    def __init__(self, bench: Bench, wall_ns: int) -> None:
        self._bench, self._wall_ns = bench, wall_ns
        self._errors: dict[tuple[str, str], _ErrorRecord] = {}
        self._linked_ns: dict[str, int] = {}  # when an instance was last connected, or requested it
        self._came: dict[str, deque[int]] = {}  # when bytes of a CONNECT came
        self._handshakes: dict[str, str] = {}  # why that of a CONNECT last ended, in the library's words

    def add_event(self, scan: int, t_ns: int, event: object) -> None:
        match event:
            case StatusEdge() if event.outputs.error and not event.cause.is_expected:
                self._add_error(scan, t_ns, event)
            case StatusEdge():
                if event.condition in LINKED_CONDITIONS:
                    self._linked_ns[event.instance] = t_ns
                    self._mark_errors_over(event.instance, LINK_ERRORS)
                if event.outputs.done:
                    self._mark_errors_over(event.instance)
            case ReceiveEnded() | SendEnded() if event.done:
                self._mark_errors_over(event.instance)
            case InputEdge(instance, "CONT" | "REQ", value) if value:
                self._linked_ns[instance] = t_ns
            case BenchNote(subject, what, detail) if what == SESSION_ENDED:
                self._handshakes[subject] = detail
            case BytesReceived(connection):
                self._came.setdefault(connection, deque(maxlen=KEPT_PAUSES)).append(t_ns)

    def _add_error(self, scan: int, t_ns: int, edge: StatusEdge) -> None:
        first = _ErrorRecord(Line(0, scan, t_ns, edge), edge, t_ns)
        record = self._errors.setdefault((edge.instance, edge.condition), first)
        record.has_recurred = record.has_recurred or record.is_over
        record.times, record.last_ns, record.good, record.is_over = record.times + 1, t_ns, 0, False

    def _mark_errors_over(self, instance: str, errors: frozenset[Condition] | None = None) -> None:
        for (name, condition), record in self._errors.items():
            if name == instance and (errors is None or condition in errors):
                record.is_over, record.good = True, record.good + (errors is None)

    def refuses_jobs(self, instance: str) -> bool:
        """Return whether an instance refused its jobs to the end, whatever the line did."""
        return any(
            name == instance and condition in JOB_REFUSALS and not record.is_over
            for (name, condition), record in self._errors.items()
        )

    def list_findings(self, is_running: bool) -> tuple[Finding, ...]:
        """Return the symptoms. While the run continues, leave out an ERROR that is over and old."""
        snapshot = self._bench.runtime.snapshot()
        found = [*self._find_error_symptoms(is_running)]
        named = {one.instance for one in found}
        for shown in snapshot.instances:
            if shown.name not in named:
                found += [*self._find_unconnected(shown), *self._find_unfinished(shown)]
        return tuple(found)

    def _find_error_symptoms(self, is_running: bool) -> Iterator[Finding]:
        newest = {name: record for (name, _), record in sorted(self._errors.items(), key=_last_error_ns)}
        for (name, _), record in self._errors.items():
            is_old = record.good >= GOOD_JOBS or self._bench.now - record.last_ns >= RECENT_NS
            if record.is_over and (not record.has_recurred or (is_running and is_old)):
                continue
            if record is newest[name] or record.times > 1:  # else another ERROR replaced it
                yield self._make_symptom(record)

    def _make_symptom(self, record: _ErrorRecord) -> Finding:
        bench, edge, scan, t_ns = self._bench, record.edge, record.line.scan, record.line.t_ns
        name, word = edge.instance, f"{edge.outputs.status:04X}"
        row = bench.project.dialect.row(edge.outputs.status, edge.block)
        then = ScanStamp(scan, t_ns)
        card = make_advice(
            make_past_evidence(record.line, edge, NO_FACTS, then, bench.project, bench.runtime.interval_ns)
        )
        checks = [each.text for each in card.do] or (row.checks_of(edge.block)[:2] if row is not None else ())
        shown = bench.runtime.snapshot().instance(name)
        stays = shown is not None and shown.outputs.error and shown.condition == edge.condition
        often = f"from scan {scan} to the end" if stays and record.times == 1 else times(record.times)
        connect, is_session = self._trace_connect_name(name), edge.cause.call == "session"
        said = self._handshakes.get(connect, "") if is_session else ""
        text = ": ".join(filter(None, (f"{name} showed {word} {often}", card.why, said)))
        is_tls = is_session and Condition(edge.condition).name.startswith("TLS_")
        found = self._make_finding(
            name, "tls-refused" if is_tls else "block-error", text, t_ns, connect=connect, scan=scan,
            evidence=(text, *card.causes), status=(word,), mend=tuple([Remedy(each) for each in checks]),
            is_fact=is_session and bool(card.do), leads_to=(Condition(edge.condition),),
        )  # fmt: skip
        return self._explain_by_framing(found) if edge.condition in OVERRUN_CONDITIONS else found

    def _make_finding(self, name: str, cause: str, text: str, t_ns: int, **more: Any) -> Finding:
        at, scan = (self._wall_ns + t_ns, 0, 0, 0), t_ns // self._bench.runtime.interval_ns + 1
        made = Finding(FACT_CONFIDENCE, (text,), "", at, name, cause=cause, explains=(text,), scan=scan)
        return replace(made, **more)

    def _explain_by_framing(self, found: Finding) -> Finding:
        """Return `found`, or, if another suffix fits the received bytes, a finding about the framing."""
        decl = self._bench.project.instance(found.instance)
        shown = self._bench.runtime.snapshot().instance(found.instance)
        advice = (
            advise_framings(self._bench.runtime.recording(decl.connect)) if decl is not None else NO_ADVICE
        )
        best = next((one for one in advice.proposals if one.framing is not None), None)
        if best is None or best.framing is None or shown is None or shown.framer is None:
            return found
        if not best.framing.suffix or best.framing.suffix == shown.framer.suffix:
            return found
        mend = Remedy(best.title, f"framing {found.instance} apply {advice.proposals.index(best) + 1}")
        texts = (f"{best.frames} of {best.of_frames} frames have the {best.title}", *best.evidence)
        evidence = (*found.explains, *texts)
        return replace(found, cause="framing", confidence=FRAMING_CONFIDENCE, evidence=evidence, mend=(mend,))

    def _trace_connect_name(self, name: str) -> str:
        """Return the CONNECT of an instance; on a ComBuffer, the CONNECT of the instance that feeds it."""
        project = self._bench.project
        decl = project.instance(name)
        own = decl.connect if decl is not None else ""
        source = next((each.source for each in project.combuffers if each.name == own), "")
        feeds = project.instance(source)
        return feeds.connect if feeds is not None else own

    def _find_unconnected(self, shown: InstanceSnapshot) -> Iterator[Finding]:
        """Yield a finding if a requested connection does not exist and no ERROR says so."""
        config = self._bench.project.connect(shown.connect)
        is_stream = config is not None and not config.is_datagram
        if shown.condition not in BUILDING_CONDITIONS or not shown.pin("CONT") or not is_stream:
            return
        now, since = self._bench.now, self._linked_ns.get(shown.name, 0)
        if now - since >= UNCONNECTED_NS:
            text = f"{shown.name} has requested a connection for {format_ns(now - since)}, and there is none"
            yield self._make_finding(shown.name, "not-connected", text, since, connect=shown.connect)

    def _find_unfinished(self, shown: InstanceSnapshot) -> Iterator[Finding]:
        """Yield a finding if a job waits 2 usual pauses, at least QUIET_NS; without pauses, 10 QUIET_NS."""
        last = shown.last_receive_ns
        if not block_row(shown.block).receives_on_net or not 0 < shown.have < shown.need or last is None:
            return
        gaps = [b - a for a, b in pairwise(self._came.get(shown.connect, ()))]
        pauses = [one for one in gaps if one > 2 * self._bench.runtime.interval_ns]
        quiet, usual = self._bench.now - last, int(median(pauses)) if pauses else 0
        if quiet < (max(QUIET_NS, 2 * usual) if pauses else 10 * QUIET_NS):
            return
        here = f"{shown.name} holds {shown.have} of {count(shown.need, 'byte')}"
        text = f"{here}, and none came for {format_ns(quiet)}"
        sure = 0.85 if pauses else 0.7  # a single message has no known period
        more = {"connect": shown.connect, "confidence": sure, "mend": self._offer_com_rst(shown)}
        yield self._make_finding(shown.name, "job-waits", text, last, **more)

    def _offer_com_rst(self, shown: InstanceSnapshot) -> tuple[Remedy, ...]:
        """Return the remedy COM_RST if the next job will want another length than the running job."""
        data = self._bench.project.data_decl(shown.data) if shown.data else None
        wanted = shown.pin("LEN") or (data.size if data is not None else shown.need)
        if wanted == shown.need or shown.pin("COM_RST") is None:
            return ()
        text = f"this job began before its length was changed to {wanted}: end it with COM_RST"
        return (Remedy(text, f"pulse {shown.name} COM_RST"),)
