"""The page of a report: one HTML document without a script, a link to elsewhere or a clock of its own.

Rule 1: all text goes through `_text`; a byte of a wire or a name of a file is never markup.
Rule 2: the same recording gives the same bytes. Certificates and keys stand in it by name and SHA-256 alone.
Rule 3: light, dark and paper are three sets of colours; what a colour says, a shape or a word says, too.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from html import escape
from typing import Final, NamedTuple, TypeVar

from trcvtui import __version__
from trcvtui.diagnosis.advice import Advice, because
from trcvtui.dialects.dialect import format_value
from trcvtui.errors import one_line
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.keys import entry_of, kind_name
from trcvtui.project.project import DataDecl
from trcvtui.report.run_notes import (
    BUSY,
    DONE,
    ERROR,
    MOST_LATE,
    UP,
    EdgeTold,
    EventTold,
    FirstAndLast,
    FrameTold,
    InstanceNotes,
    RunNotes,
    TimeLane,
)
from trcvtui.scenario.runner import Verdict
from trcvtui.udt.byte_text import hexdump
from trcvtui.udt.report import member_rows
from trcvtui.wording import count, times, utc_text

T = TypeVar("T")
MARK: Final = b"<!doctype html>\n<!-- a report of trcvtui -->\n"
MOST_INSTANCES: Final = 200
MOST_MEMBERS: Final = 100
MOST_HEX: Final = 512  # bytes of a frame
MOST_TEXT: Final = 20_000  # characters of `start` and `program`
POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'"
PLAIN: Final = frozenset({"set", "pulse", "run", "wait", "fault", "plc", "hold", "go", "create", "delete"})
PATHS: Final = frozenset({"file", "key"})  # keys whose value is one
SPOKEN: Final = frozenset({"says", "replies", "message", "steps"})  # keys that hold what is sent
LEFT, WIDTH, RIGHT, ROW = 150, 1000, 24, 20  # of the time line: names, columns, height of a lane
SHAPES: Final = (  # what a column has seen, its class, its top and height: an ERROR is the highest
    (UP, "up", 6, 6),
    (BUSY, "busy", 8, 3),
    (DONE, "done", 5, 9),
    (ERROR, "error", 1, 16),
)
CONVERSATION: Final = (
    "id", "protocol", "PLC end", "partner", "begin", "end", "bytes to", "from PLC", "missing", "shadows",
)  # fmt: skip
STYLE: Final = """
:root{color-scheme:light dark;--ink:#1b1f24;--soft:#57606a;--line:#c6ccd3;--back:#f4f6f8;--paper:#fff;
--up:#0b62c4;--busy:#8a6100;--done:#18702f;--error:#c01c28}
@media screen and (prefers-color-scheme:dark){:root{--ink:#e3e7eb;--soft:#9aa4ae;--line:#3a424b;
--back:#1b2026;--paper:#12161a;--up:#69b1ff;--busy:#e0b04a;--done:#5ec977;--error:#ff7b72}}
*{box-sizing:border-box}
body{font:15px/1.45 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:64rem;
margin:0 auto;padding:1rem;overflow-wrap:anywhere}
h1{font-size:1.5rem;margin:.2rem 0}
h2{font-size:1.2rem;margin:1.8rem 0 .5rem;border-bottom:1px solid var(--line)}
h3{font-size:1rem;margin:1.1rem 0 .3rem}p{margin:.3rem 0}
.verdict{font-size:1.15rem;font-weight:600;border-left:6px solid var(--done);padding:.3rem .8rem}
.verdict.bad{border-color:var(--error)}.soft{color:var(--soft)}
.card{border:1px solid var(--line);border-left:4px solid var(--busy);padding:.3rem .8rem;margin:.6rem 0}
.card.bad{border-left-color:var(--error)}
table{border-collapse:collapse;width:100%;margin:.4rem 0;font-size:.87rem}
th,td{text-align:left;vertical-align:top;padding:.15rem .5rem .15rem 0;border-bottom:1px solid var(--line);
overflow-wrap:anywhere;unicode-bidi:isolate}
.n{text-align:right;white-space:nowrap}.w{white-space:nowrap}tr.bad td{color:var(--error);font-weight:600}
pre{font:.82rem/1.35 ui-monospace,monospace;background:var(--back);padding:.5rem;overflow-x:auto;
margin:.3rem 0}
svg{width:100%;height:auto;display:block;font:12px system-ui,sans-serif}
svg text{fill:var(--ink)}svg .up{fill:var(--up)}svg .busy{fill:var(--busy)}svg .done{fill:var(--done)}
svg .error{fill:var(--error)}svg .grid{stroke:var(--line);stroke-width:1}
dl{display:grid;grid-template-columns:max-content minmax(0,1fr);gap:.1rem 1rem;margin:.4rem 0}
dt{color:var(--soft)}dd{margin:0;overflow-wrap:anywhere}
@page{size:A4;margin:14mm 12mm;@bottom-right{content:counter(page) " / " counter(pages);font:9pt sans-serif}}
@media print{:root{color-scheme:light}body{font-size:9.5pt;max-width:none;padding:0}
h2,h3{break-after:avoid}tr,.card,.frame,svg{break-inside:avoid}thead{display:table-header-group}
pre{white-space:pre-wrap;font-size:7.5pt;border:1px solid var(--line)}}
"""


MOST_FINDINGS: Final = 20


class FoundCause(NamedTuple):
    """What the doctor has found: where and how sure, the evidence, what mends it."""

    head: str
    evidence: tuple[str, ...]
    mends: tuple[str, ...]


class ReportSource(NamedTuple):
    """What a report is made of. `seen`: by which way, where it was seen to its end; else `stopped` says why.

    `files` (name, bytes, SHA-256) and `conversations` (by the titles of CONVERSATION) are rows of tables.
    `findings` are the doctor's, the surest first.
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
    findings: tuple[FoundCause, ...] = ()


def last_part(path: str) -> str:
    """Return the name of a file without its folders: they say who made it, and nothing else."""
    return path.replace("\\", "/").rpartition("/")[2]


def page(source: ReportSource, notes: RunNotes, verdict: Verdict | None = None) -> Iterator[str]:
    """Yield the document."""
    told, title = _PageParts(source, notes), _text(source.title)
    yield MARK.decode()
    yield '<html lang="en"><head><meta charset="utf-8">'
    yield f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
    yield '<meta name="viewport" content="width=device-width"><meta name="robots" content="noindex">'
    yield f"<title>{title}</title><style>{STYLE}</style></head>\n<body><h1>{title}</h1>\n"
    yield from told.verdict(verdict)
    yield from told.findings()
    yield from told.facts()
    yield from told.time_line()
    yield from told.instances()
    yield from told.around()
    yield "</body></html>\n"


class _PageParts:
    """The parts of the page."""

    def __init__(self, source: ReportSource, notes: RunNotes) -> None:
        self._source, self._notes = source, notes
        self._project = notes.bench.project
        self._has_payload = notes.has_payload
        names = [name for name, each in notes.instances.items() if each.edges.count]
        self._names, self._left_out = names[:MOST_INSTANCES], len(names[MOST_INSTANCES:])

    # -- above -------------------------------------------------------------------------------------------

    def verdict(self, verdict: Verdict | None) -> Iterator[str]:
        counts = [each.error_edges.count for each in self._notes.instances.values()]
        at = sum(map(bool, counts))
        found = f"{count(sum(counts), 'ERROR')} at {count(at, 'instance')}" if at else "no ERROR"
        found = found if counts else "there is no instance"
        is_bad = at > 0
        remarks = sum(len(each.remarks) for each in self._notes.instances.values())
        found += f", {count(remarks, 'remark')} on frames" if remarks else ""
        if verdict is not None:
            is_bad = not verdict.passed
            failed = count(len(verdict.failures), "expectation")
            found = f"passed, {found}" if verdict.passed else f"FAILED: {failed} did not hold; {found}"
        seen, until, stopped = self._notes.seen.scan, self._notes.until.scan, self._source.stopped
        if stopped:
            found = f"up to scan {until}: {found}" if until else "nothing of the run could be seen"
        yield f'<p class="verdict{" bad" * (is_bad or bool(stopped))}">{_text(found)}</p>\n'
        told = self._source.seen
        if stopped:
            told = f"{count(seen, 'scan')} of the run could be run again, no more: {stopped}"
        yield f'<p class="soft">{_text(told)}</p>\n'
        if until > seen:
            rest = (
                f"scans {seen + 1} to {until}: what the journal says; nobody knows why, frames are not known"
            )
            yield f'<p class="soft">{rest}</p>\n'
        if self._notes.lost:
            lost = count(self._notes.lost, "line")
            yield f'<p class="soft">{lost} of the ledger came too fast for this page</p>\n'
        if not self._has_payload:
            yield '<p class="soft">without payload: bytes, members and messages are left out</p>\n'
        for failure in verdict.failures if verdict is not None else ():
            line = f"step {failure.step}: {self._line(failure.line)}"
            found = f"found: {failure.found}" if self._has_payload else ""
            yield f'<div class="card bad"><b>{_text(line)}</b><p>{_text(found)}</p></div>\n'

    def findings(self) -> Iterator[str]:
        found = self._source.findings
        for one in found[:MOST_FINDINGS]:
            evidence = one.evidence if self._has_payload else ()  # it may show bytes and values
            yield _card(one.head, Advice("; ".join(evidence), one.mends), is_bad=True)
        if len(found) > MOST_FINDINGS:
            yield f'<p class="soft">{count(len(found) - MOST_FINDINGS, "finding")} more</p>\n'

    def facts(self) -> Iterator[str]:
        source, scans = self._source, count(self._notes.until.scan, "scan")
        each, late = self._notes.bench.runtime.interval_ns / 1e6, self._notes.late
        which = ", ".join(told for _, told in late) + " and others" * (late.count > 2 * MOST_LATE)
        yield _definitions(
            ("begin", utc_text(source.begin_ns)),
            ("length", f"{_seconds(self._notes.until.t_ns)} s, {scans}, one each {each:g} ms"),
            *[("late", f"{count(late.count, 'scan')} by more than half an interval: {which}")][: late.count],
            ("PLC", f"{self._project.dialect.title}, {self._project.model}"),
            ("network", source.network),
            ("file", source.file),
            ("its SHA-256", source.sha256),
            ("report", f"trcvtui {__version__}"),
        )

    # -- time line ---------------------------------------------------------------------------------------

    def time_line(self) -> Iterator[str]:
        links = sorted(self._notes.links.items())[:MOST_INSTANCES]
        lanes = [*links, *((name, self._notes.instances[name].lane) for name in self._names)]
        if not lanes:
            return
        yield "<h2>Time line</h2>\n"
        yield from _drawn(lanes, self._notes.until.t_ns + self._notes.bench.runtime.interval_ns)
        legend = (
            ("up", "connected"), ("busy", "BUSY"), ("done", "DONE"), ("error", "ERROR"),
        )  # fmt: skip
        marks = {name: (top, high) for _, name, top, high in SHAPES}
        yield f'<svg viewBox="0 0 {LEFT + WIDTH + RIGHT} 18" role="img" aria-label="the shapes">'
        for number, (name, word) in enumerate(legend):
            x, (y, high) = LEFT + number * 130, marks[name]
            yield f'<rect class="{name}" x="{x}" y="{y}" width="24" height="{high}"/>'
            yield f'<text x="{x + 30}" y="13">{word}</text>'
        yield "</svg>\n"

    # -- instances ---------------------------------------------------------------------------------------

    def instances(self) -> Iterator[str]:
        if not self._names:
            return
        yield "<h2>Instances</h2>\n"
        titles = ("instance", "block", "works on", "STATUS at the end", "since", "jobs", "dropped", "ERRORs")
        yield _table(titles, (self._overview(name) for name in self._names), ".....nnn")
        if self._left_out:
            yield f"<p>{count(self._left_out, 'instance')} more in the recording</p>\n"
        for number, name in enumerate(self._names):
            yield f'<h2 id="i{number}">{_text(name)}</h2>\n'
            yield from self._instance(self._notes.instances[name], name)

    def _overview(self, name: str) -> Sequence[str]:
        notes, last = self._notes.instances[name], self._notes.last(name)
        *_, (_, told) = notes.edges
        status, since = self._status(told.edge.outputs.status, told.edge.block), f"scan {told.at.scan}"
        works_on, jobs = (last.connect, str(last.jobs_done)) if last is not None else ("", "gone")
        errors = str(notes.error_edges.count)
        return name, told.edge.block, works_on, status, since, jobs, str(notes.dropped), errors

    def _status(self, status: int, block: str) -> str:
        row = self._project.dialect.row(status, block)
        return f"16#{status:04X}" + (f" {row.title}" if row is not None else "")

    def _instance(self, notes: InstanceNotes, name: str) -> Iterator[str]:
        last = self._notes.last(name)
        if last is not None and self._notes.seen.scan and name in self._notes.advice:
            when = (
                "At the end" if self._notes.seen == self._notes.until else f"In scan {self._notes.seen.scan}"
            )
            head = f"{when}: {self._status(last.outputs.status, last.block)}, since scan {last.since_scan}"
            yield _card(head, self._notes.advice[name], is_bad=last.outputs.error)
        for card in (*notes.errors.values(), *notes.remarks.values()):
            edge, at = card.first.edge, card.first.at
            often = f", {times(card.times)} up to scan {card.last.scan}" if card.times > 1 else ""
            if card.times > 1 and not edge.outputs.error:
                often = f", seen up to scan {card.last.scan}"
            head = f"{self._status(edge.outputs.status, edge.block)} in scan {at.scan}, {_seconds(at.t_ns)} s"
            yield _card(head + often, card.advice, is_bad=edge.outputs.error)
        if notes.edges.count:
            yield f"<h3>STATUS, {count(notes.edges.count, 'edge')}</h3>\n"
            yield from self._edges(notes)
        if notes.frames.count:
            yield f"<h3>{count(notes.frames.count, 'frame')}</h3>\n"
            yield from self._frames(notes.frames, name)

    def _edges(self, notes: InstanceNotes) -> Iterator[str]:
        errors = (told for _, told in notes.error_edges)
        rows = sorted(dict((*notes.edges, *errors)).items())
        yield _table(
            ("scan", "at s", "STATUS", "lamp", "bytes", "why"), _with_gaps(rows, self._edge, "edge"), "nnwwn."
        )

    def _edge(self, told: EdgeTold) -> Sequence[str]:
        edge: StatusEdge = told.edge
        shown, label = edge.outputs, self._project.dialect.label(edge.condition)
        size = "" if shown.rcvd_len is None or not shown.done else str(shown.rcvd_len)
        status = f"16#{shown.status:04X} {label}"
        return (
            str(told.at.scan), _seconds(told.at.t_ns), status, shown.lit.upper(), size,
            because(edge.cause, edge.block),
        )  # fmt: skip

    def _frames(self, frames: FirstAndLast[FrameTold], name: str) -> Iterator[str]:
        decl = self._project.instance(name)
        data = self._project.data_decl(decl.data) if decl is not None and decl.data else None
        before = 0
        for number, frame in frames:
            if number > before + 1:
                yield f'<p class="soft">{count(number - before - 1, "frame")} between are left out</p>\n'
            before = number
            yield from self._frame(frame, data)

    def _frame(self, frame: FrameTold, data: DataDecl | None) -> Iterator[str]:
        job = f"job {frame.job}, " if frame.job else ""
        way = "sent" if frame.is_sent else "received"
        head = f"{job}{way} {frame.size} B, scan {frame.at.scan}, {_seconds(frame.at.t_ns)} s"
        yield f'<div class="frame"><p><b>{_text(head)}</b> {_text(frame.reason)}</p>'
        shown = frame.content[:MOST_HEX]
        if self._has_payload and shown:
            more = frame.size - len(shown)
            yield f"<pre>{_lines(hexdump(shown).decode('ascii').splitlines())}</pre>"
            yield f'<p class="soft">{count(more, "byte")} more in the recording</p>' if more > 0 else ""
            yield from _members(frame.content, data)
        yield "</div>\n"

    # -- around ------------------------------------------------------------------------------------------

    def around(self) -> Iterator[str]:
        if self._source.conversations:
            yield "<h2>Conversations</h2>\n"
            yield _table(CONVERSATION, self._source.conversations, "......nnn.")
        told = sorted((each for _, each in self._notes.events), key=lambda e: (e.at.scan, not e.subject))
        if told:
            yield f"<h2>Connections, peers and commands, {count(self._notes.events.count, 'event')}</h2>\n"
            numbers = (number for number, _ in self._notes.events)
            rows = _with_gaps(zip(numbers, told, strict=True), self._event, "event")
            yield _table(("scan", "at s", "who", "what", "more"), rows, "nn...")
        yield "<h2>Settings at the end</h2>\n"
        yield f"<pre>{_lines(self._settings())}</pre>\n"
        if self._source.files:
            yield "<h2>Files of the run</h2>\n"
            yield _table(("file", "bytes", "SHA-256"), self._source.files, ".n.")

    def _event(self, told: EventTold) -> Sequence[str]:
        what = told.what if told.subject else self._line(told.what)
        return str(told.at.scan), _seconds(told.at.t_ns), told.subject or "command", what, told.detail

    def _line(self, line: str) -> str:
        """Return a command; without payload as much of it as holds no bytes."""
        said = line.split()
        if self._has_payload or not said or said[0] in PLAIN:
            return line
        return " ".join(said[: 3 if said[0] == "peer" else 2]) + " ..."

    def _settings(self) -> Iterator[str]:
        project = self._project
        yield f'dialect = "{project.dialect.name}"'
        yield f'model = "{project.model}"'
        for switch in project.dialect.switches:
            yield f"options.{switch.name} = {format_value(switch, project.options[switch.name])}"
        for task in project.tasks:
            yield f'task "{task.name}": each {task.interval_ns / 1e6:g} ms, priority {task.priority}'
        spoken = (project.messages, project.sequences) if self._has_payload else ()
        for decls in (
            project.connects, project.udp_configs, project.addrs, project.combuffers, project.data,
            project.instances, project.certificates.values(), project.peers, *spoken,
        ):  # fmt: skip
            for decl in decls:
                yield ""
                yield f"[[{kind_name(decl)}]]"
                for key, value in entry_of(decl):
                    if self._has_payload or key not in SPOKEN:
                        yield f"{key} = {_value(last_part(str(value)) if key in PATHS else value)}"
        for word, text in (("start", project.start), ("program", project.program)):
            if text and self._has_payload:
                yield ""
                yield f"{word}:"
                yield from text[:MOST_TEXT].splitlines()


# -- pieces --------------------------------------------------------------------------------------------------


def _text(text: str) -> str:
    return escape(one_line(text))


def _lines(lines: Iterable[str]) -> str:
    return "\n".join(map(_text, lines))


def _definitions(*rows: tuple[str, str]) -> str:
    return (
        "<dl>" + "".join(f"<dt>{_text(name)}</dt><dd>{_text(value)}</dd>" for name, value in rows) + "</dl>\n"
    )


def _table(titles: Sequence[str], rows: Iterable[Sequence[str]], kinds: str) -> str:
    """Return a table; `kinds`: n for a column of numbers, w for one that is never wrapped."""
    marks = [f' class="{kind}"' if kind != "." else "" for kind in kinds]
    head = "".join(f'<th scope="col"{m}>{_text(t)}</th>' for m, t in zip(marks, titles, strict=True))
    made = [f"<table><thead><tr>{head}</tr></thead><tbody>\n"]
    for row in rows:
        if len(row) == 1:
            made.append(f'<tr><td colspan="{len(titles)}" class="soft">{_text(row[0])}</td></tr>\n')
            continue
        is_bad = "ERROR" in row
        cells = "".join(f"<td{m}>{_text(cell)}</td>" for m, cell in zip(marks, row, strict=True))
        made.append(f"<tr{' class=bad' * is_bad}>{cells}</tr>\n")
    return "".join(made) + "</tbody></table>\n"


def _with_gaps(
    rows: Iterable[tuple[int, T]], make: Callable[[T], Sequence[str]], word: str
) -> Iterator[Sequence[str]]:
    before = 0
    for number, one in rows:
        if number > before + 1:
            yield (f"{count(number - before - 1, word)} between are left out",)
        before = max(before, number)
        yield make(one)


def _card(head: str, advice: Advice, is_bad: bool) -> str:
    checks = "".join(f"<li>{_text(check)}</li>" for check in advice.checks)
    checks = f"<ul>{checks}</ul>" if checks else ""
    bad = " bad" * is_bad
    return f'<div class="card{bad}"><b>{_text(head)}</b><p>{_text(advice.why)}</p>{checks}</div>\n'


def _members(content: bytes, data: DataDecl | None) -> Iterator[str]:
    """Yield the members of a frame, unless DATA has none with a name."""
    if data is None or all(leaf.path.startswith("[") for leaf in data.layout.leaves(0, 2)):
        return
    within = min(data.layout.leaves_within(len(content)) + 1, data.layout.leaf_count)
    rows = member_rows(data.layout, content, data.name, most=min(within, MOST_MEMBERS))
    yield _table(("byte", "type", data.name, "value"), rows, "n...")
    if data.layout.leaf_count > MOST_MEMBERS:
        yield f'<p class="soft">the first {MOST_MEMBERS} of {data.layout.leaf_count} members</p>'


def _value(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


def _seconds(ns: int) -> str:
    return f"{ns / 1e9:.3f}"


def _drawn(lanes: Sequence[tuple[str, TimeLane]], end_ns: int) -> Iterator[str]:
    """Yield the drawing of lanes up to a time in ns."""
    height = ROW * len(lanes) + 24
    label = f"{count(len(lanes), 'lane')} over {_seconds(end_ns)} s"
    yield f'<svg viewBox="0 0 {LEFT + WIDTH + RIGHT} {height}" role="img" aria-label="{_text(label)}">\n'
    for ns in _ticks(end_ns):
        x = LEFT + round(WIDTH * ns / end_ns, 1)
        yield f'<path class="grid" d="M{x:g} 0v{height - 20}"/>'
        yield f'<text x="{x:g}" y="{height - 6}" text-anchor="middle">{ns / 1e9:g} s</text>\n'
    for number, (name, lane) in enumerate(lanes):
        y = number * ROW
        short = name if len(name) <= 20 else f"{name[:19]}\u2026"
        yield f'<text x="0" y="{y + 14}">{_text(short)}<title>{_text(name)}</title></text>'
        wide = WIDTH * lane.width_ns / end_ns
        for bit, shape, top, high in SHAPES:
            runs = "".join(_bars(lane.columns, bit, wide, y + top, high))
            yield f'<path class="{shape}" d="{runs}"/>' if runs else ""
        yield "\n"
    yield "</svg>\n"


def _bars(columns: Sequence[int], bit: int, wide: float, y: int, high: int) -> Iterator[str]:
    """Yield a bar for each run of columns that have a bit; none is too narrow to be seen."""
    begin = None
    for number, seen in enumerate((*columns, 0)):
        if seen & bit and begin is None:
            begin = number
        elif begin is not None and not seen & bit:
            x = LEFT + min(begin * wide, WIDTH - 2)
            width = max(2, min((number - begin) * wide, LEFT + WIDTH - x))
            yield f"M{x:.1f} {y}h{width:.1f}v{high}h-{width:.1f}z"
            begin = None


def _ticks(end_ns: int) -> Iterator[int]:
    step = 1_000_000
    while end_ns > step * 10:
        step = step * 5 // 2 if str(step)[0] == "2" else step * 2
    yield from range(0, end_ns, step)
