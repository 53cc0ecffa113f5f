"""The page of a report: one HTML document without scripts, external links or the present time.

Rule 1: all text passes `finalize` and the escaping of jinja2. So bytes of a wire and names of files are
never markup.
Rule 2: the same recording gives the same bytes. Certificates and keys appear only by name and SHA-256.
Rule 3: light, dark and paper are three sets of colours; a shape or a word repeats what a colour means.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from trcvtui import __version__
from trcvtui.diagnosis.advice import Advice, describe_cause
from trcvtui.dialects.dialect import format_value
from trcvtui.errors import one_line
from trcvtui.project.keys import entry_of, kind_name
from trcvtui.project.project import DataDecl
from trcvtui.report.run_notes import (
    BUSY,
    DONE,
    ERROR,
    MOST_LATE,
    UP,
    EdgeNote,
    EventNote,
    FrameNote,
    InstanceNotes,
    RunNotes,
    TimeLane,
)
from trcvtui.scenario.runner import Verdict
from trcvtui.snapshots.doctor import Finding
from trcvtui.udt.byte_text import hexdump
from trcvtui.udt.report import member_rows
from trcvtui.wording import count, last_part, stamp_text, times, utc_text

T = TypeVar("T")
Row = TypeVar("Row")
REPORT_MARK: Final = b"<!doctype html>\n<!-- a report of trcvtui -->\n"
MOST_FINDINGS: Final = 20
MOST_INSTANCES: Final = 200
MOST_MEMBERS: Final = 100
MOST_HEX: Final = 512  # bytes of a frame
MOST_TEXT: Final = 20_000  # characters of `start` and `program`
PLAIN: Final = frozenset({"set", "pulse", "run", "wait", "fault", "plc", "hold", "go", "create", "delete"})
PATH_KEYS: Final = frozenset({"file", "key"})  # keys whose value is a path
PAYLOAD_KEYS: Final = frozenset({"says", "replies", "message", "steps"})  # keys with bytes that are sent
LANES_LEFT, LANES_WIDTH, ROW = 150, 1000, 20  # of the time line: names, columns, height of a lane
LANE_SHAPES: Final = (  # what a column has seen, its class, its top and height: an ERROR is the highest
    (UP, "up", 6, 6),
    (BUSY, "busy", 8, 3),
    (DONE, "done", 5, 9),
    (ERROR, "error", 1, 16),
)


class ReportSource(NamedTuple):
    """The origin of a report. `seen` says how the whole run was replayed, or `stopped` why only a part was.

    `files` and `conversations` are rows of tables. A row of `files` has name, bytes and SHA-256.
    `findings` is what the doctor found, the surest finding first.
    """

    title: str
    seen: str
    stopped: str
    begin_ns: int
    network: str
    file: str
    sha256: str
    files: tuple[Sequence[str], ...] = ()
    conversations: tuple[Sequence[str], ...] = ()
    findings: tuple[Finding, ...] = ()


class _Card(NamedTuple):
    head: str
    advice: Advice
    is_bad: bool


class _FrameView(NamedTuple):
    head: str
    reason: str
    dump: list[str]  # lines
    more: int  # bytes beyond the dump
    data: DataDecl | None  # whose members are shown
    members: Iterable[Sequence[str]]


class _DrawnLane(NamedTuple):
    name: str
    y: int
    paths: list[tuple[str, str]]  # class and data of each


def generate_page(source: ReportSource, notes: RunNotes, verdict: Verdict | None = None) -> Iterator[str]:
    templates = Environment(
        loader=FileSystemLoader(Path(__file__).with_name("templates")),
        autoescape=True,
        finalize=_plain,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    templates.filters.update(counted=count, seconds=stamp_text)
    yield REPORT_MARK.decode()
    yield from templates.get_template("page.html").generate(page=_PageParts(source, notes, verdict))


def _plain(value: object) -> object:
    return value if isinstance(value, Markup) else one_line(str(value))


class _PageParts:
    left, width, row, most_members = LANES_LEFT, LANES_WIDTH, ROW, MOST_MEMBERS

    def __init__(self, source: ReportSource, notes: RunNotes, verdict: Verdict | None) -> None:
        self.source, self.notes, self._verdict = source, notes, verdict
        self._project = notes.bench.project
        self._has_payload = notes.has_payload
        names = [name for name, each in notes.instances.items() if each.edges.count]
        self.names, self.left_out = names[:MOST_INSTANCES], len(names[MOST_INSTANCES:])

    # -- above -------------------------------------------------------------------------------------------

    def verdict(self) -> tuple[str, bool]:
        counts = [each.error_edges.count for each in self.notes.instances.values()]
        at = sum(map(bool, counts))
        found = f"{count(sum(counts), 'ERROR')} at {count(at, 'instance')}" if at else "no ERROR"
        found = found if counts else "there is no instance"
        is_bad = at > 0
        remarks = sum(len(each.remarks) for each in self.notes.instances.values())
        found += f", {count(remarks, 'remark')} on frames" if remarks else ""
        if self._verdict is not None:
            is_bad = not self._verdict.has_passed
            failed = count(len(self._verdict.failures), "expectation")
            found = f"FAILED: {failed} did not hold; {found}" if is_bad else f"passed, {found}"
        until, stopped = self.notes.until.scan, self.source.stopped
        if stopped:
            found = f"up to scan {until}: {found}" if until else "no scan of the run could be run again"
        return found, is_bad or bool(stopped)

    def remarks(self) -> Iterator[str]:
        seen, until, stopped = self.notes.seen.scan, self.notes.until.scan, self.source.stopped
        run_again = f"only {count(seen, 'scan')} of the run could be run again: {stopped}"
        yield run_again if stopped else self.source.seen
        if until > seen:
            yield f"scans {seen + 1} to {until} are known only from the journal, without causes and frames"
        if self.notes.lost:
            yield f"{count(self.notes.lost, 'line')} of the ledger came too fast for this page"
        if not self._has_payload:
            yield "without payload: bytes, members and messages are left out"

    def causes(self) -> Iterator[_Card]:
        """Yield the expectations that did not hold, then the findings of the doctor."""
        for failure in self._verdict.failures if self._verdict is not None else ():
            found = f"found: {failure.found}" if self._has_payload else ""
            yield _Card(f"step {failure.step}: {self._format_command(failure.line)}", Advice(found, ()), True)
        for one in self.source.findings[:MOST_FINDINGS]:
            evidence = one.evidence if self._has_payload else ()  # evidence may quote bytes and values
            head = f"{one.cause}, {one.confidence:.0%} sure"
            head += f": {one.ends.plc} with {one.ends.partner}" if one.ends is not None else ""
            yield _Card(head, Advice("; ".join(evidence), tuple([mend.text for mend in one.mend])), True)

    @property
    def more_findings(self) -> int:
        return max(0, len(self.source.findings) - MOST_FINDINGS)

    def facts(self) -> Iterator[tuple[str, str]]:
        source, notes, late = self.source, self.notes, self.notes.late
        yield "begin", utc_text(source.begin_ns)
        each, scans = notes.bench.runtime.interval_ns / 1e6, count(notes.until.scan, "scan")
        yield "length", f"{stamp_text(notes.until.t_ns)} s, {scans}, one each {each:g} ms"
        if late.count:
            which = ", ".join(text for _, text in late) + " and others" * (late.count > 2 * MOST_LATE)
            yield "late", f"{count(late.count, 'scan')} by more than half an interval: {which}"
        yield "PLC", f"{self._project.dialect.title}, {self._project.model}"
        yield "network", source.network
        yield "file", source.file
        yield "its SHA-256", source.sha256
        yield "report", f"trcvtui {__version__}"

    # -- time line ---------------------------------------------------------------------------------------

    @property
    def end_ns(self) -> int:
        return self.notes.until.t_ns + self.notes.bench.runtime.interval_ns

    def ticks(self) -> Iterator[tuple[str, str]]:
        """Yield the x position and the time of each grid line."""
        step = 1_000_000
        while self.end_ns > step * 10:
            step = step * 5 // 2 if str(step)[0] == "2" else step * 2
        for ns in range(0, self.end_ns, step):
            yield f"{LANES_LEFT + round(LANES_WIDTH * ns / self.end_ns, 1):g}", f"{ns / 1e9:g} s"

    def lanes(self) -> list[_DrawnLane]:
        links = sorted(self.notes.links.items())[:MOST_INSTANCES]
        lanes = [*links, *((name, self.notes.instances[name].lane) for name in self.names)]
        return [self._draw_lane(name, lane, number * ROW) for number, (name, lane) in enumerate(lanes)]

    def _draw_lane(self, name: str, lane: TimeLane, y: int) -> _DrawnLane:
        wide = LANES_WIDTH * lane.width_ns / self.end_ns
        paths = [
            (shape, "".join(_bars(lane.columns, bit, wide, y + top, high)))
            for bit, shape, top, high in LANE_SHAPES
        ]
        return _DrawnLane(name, y, [(shape, path) for shape, path in paths if path])

    # -- instances ---------------------------------------------------------------------------------------

    def overview(self) -> Iterator[Sequence[str]]:
        for name in self.names:
            notes, last = self.notes.instances[name], self.notes.last_snapshot(name)
            *_, (_, note) = notes.edges
            status, since = self._status(note.edge.outputs.status, note.edge.block), f"scan {note.at.scan}"
            works_on, jobs = (last.connect, str(last.jobs_done)) if last is not None else ("", "gone")
            errors = str(notes.error_edges.count)
            yield name, note.edge.block, works_on, status, since, jobs, str(notes.dropped), errors

    def _status(self, status: int, block: str) -> str:
        row = self._project.dialect.row(status, block)
        return f"16#{status:04X}" + (f" {row.title}" if row is not None else "")

    def advice_cards(self, name: str) -> Iterator[_Card]:
        notes, last = self.notes.instances[name], self.notes.last_snapshot(name)
        if last is not None and self.notes.seen.scan and name in self.notes.advice:
            is_end = self.notes.seen == self.notes.until
            when = "At the end" if is_end else f"In scan {self.notes.seen.scan}"
            head = f"{when}: {self._status(last.outputs.status, last.block)}, since scan {last.since_scan}"
            yield _Card(head, self.notes.advice[name], last.outputs.error)
        for card in (*notes.errors.values(), *notes.remarks.values()):
            edge, at = card.first.edge, card.first.at
            often = f", {times(card.times)} up to scan {card.last.scan}" if card.times > 1 else ""
            if card.times > 1 and not edge.outputs.error:
                often = f", seen up to scan {card.last.scan}"
            head = (
                f"{self._status(edge.outputs.status, edge.block)} in scan {at.scan}, {stamp_text(at.t_ns)} s"
            )
            yield _Card(head + often, card.advice, edge.outputs.error)

    def edges(self, notes: InstanceNotes) -> Iterator[Sequence[str]]:
        errors = (error for _, error in notes.error_edges)
        return _mark_gaps(sorted(dict((*notes.edges, *errors)).items()), self._edge, "edge")

    def _edge(self, note: EdgeNote) -> Sequence[str]:
        edge, shown = note.edge, note.edge.outputs
        size = "" if shown.rcvd_len is None or not shown.done else str(shown.rcvd_len)
        status = f"16#{shown.status:04X} {self._project.dialect.label(edge.condition)}"
        why = describe_cause(edge.cause, edge.block)
        return str(note.at.scan), stamp_text(note.at.t_ns), status, shown.lit_lamp.upper(), size, why

    def frames(self, name: str) -> Iterator[_FrameView | tuple[str]]:
        """Yield the frames; where frames are left out, yield a tuple of one text that says how many."""
        decl = self._project.instance(name)
        data = self._project.data_decl(decl.data) if decl is not None and decl.data else None
        frames = self.notes.instances[name].frames
        return _mark_gaps(frames, lambda frame: self._frame(frame, data), "frame")

    def _frame(self, frame: FrameNote, data: DataDecl | None) -> _FrameView:
        job, way = f"job {frame.job}, " if frame.job else "", "sent" if frame.is_sent else "received"
        head = f"{job}{way} {frame.size} B, scan {frame.at.scan}, {stamp_text(frame.at.t_ns)} s"
        shown = frame.content[:MOST_HEX] if self._has_payload else b""
        if not shown:
            return _FrameView(head, frame.reason, [], 0, None, ())
        if data is not None and all(leaf.path.startswith("[") for leaf in data.layout.leaves(0, 2)):
            data = None  # an array: no member has a name
        members = _members(frame.content, data) if data is not None else ()
        dump = hexdump(shown).decode("ascii").splitlines()
        return _FrameView(head, frame.reason, dump, frame.size - len(shown), data, members)

    # -- around ------------------------------------------------------------------------------------------

    def events(self) -> Iterator[Sequence[str]]:
        events = sorted((each for _, each in self.notes.events), key=lambda e: (e.at.scan, not e.subject))
        numbers = (number for number, _ in self.notes.events)
        return _mark_gaps(zip(numbers, events, strict=True), self._event, "event")

    def _event(self, note: EventNote) -> Sequence[str]:
        what = note.what if note.subject else self._format_command(note.what)
        return str(note.at.scan), stamp_text(note.at.t_ns), note.subject or "command", what, note.detail

    def _format_command(self, line: str) -> str:
        """Return a command. In a report without payload, return only the words before any bytes."""
        words = line.split()
        if self._has_payload or not words or words[0] in PLAIN:
            return line
        return " ".join(words[: 3 if words[0] == "peer" else 2]) + " ..."

    def settings(self) -> Iterator[str]:
        project = self._project
        yield f'dialect = "{project.dialect.name}"'
        yield f'model = "{project.model}"'
        for switch in project.dialect.switches:
            yield f"options.{switch.name} = {format_value(switch, project.options[switch.name])}"
        for task in project.tasks:
            yield f'task "{task.name}": each {task.interval_ns / 1e6:g} ms, priority {task.priority}'
        sent = (project.messages, project.sequences) if self._has_payload else ()
        for decls in (
            project.connects, project.udp_configs, project.addrs, project.combuffers, project.data,
            project.instances, project.certificates.values(), project.peers, *sent,
        ):  # fmt: skip
            for decl in decls:
                yield ""
                yield f"[[{kind_name(decl)}]]"
                for key, value in entry_of(decl):
                    if self._has_payload or key not in PAYLOAD_KEYS:
                        shown = last_part(str(value)) if key in PATH_KEYS else value
                        yield f"{key} = {json.dumps(shown, ensure_ascii=False)}"
        for word, text in (("start", project.start), ("program", project.program)):
            if text and self._has_payload:
                yield ""
                yield f"{word}:"
                yield from text[:MOST_TEXT].splitlines()


# -- pieces --------------------------------------------------------------------------------------------------


def _mark_gaps(
    rows: Iterable[tuple[int, T]], make: Callable[[T], Row], word: str
) -> Iterator[Row | tuple[str]]:
    before = 0
    for number, one in rows:
        if number > before + 1:
            yield (f"{count(number - before - 1, word)} between are left out",)
        before = max(before, number)
        yield make(one)


def _members(content: bytes, data: DataDecl) -> Iterable[Sequence[str]]:
    within = min(data.layout.count_leaves_within(len(content)) + 1, data.layout.leaf_count)
    return member_rows(data.layout, content, data.name, most=min(within, MOST_MEMBERS))


def _bars(columns: Sequence[int], bit: int, wide: float, y: int, high: int) -> Iterator[str]:
    """Yield a bar for each group of adjacent columns with this bit; a bar is wide enough to see."""
    begin = None
    for number, seen in enumerate((*columns, 0)):
        if seen & bit and begin is None:
            begin = number
        elif begin is not None and not seen & bit:
            x = LANES_LEFT + min(begin * wide, LANES_WIDTH - 2)
            width = max(2, min((number - begin) * wide, LANES_LEFT + LANES_WIDTH - x))
            yield f"M{x:.1f} {y}h{width:.1f}v{high}h-{width:.1f}z"
            begin = None
