"""`trcvtui messages`: each message of a recording, a capture or a run is one row."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from typing import Final, NamedTuple, TextIO

from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.capture.command import take_captures
from trcvtui.capture.plc_end import NOTHING_KNOWN, fits_nothing, guess_plc, parse_plc
from trcvtui.capture.reassembly import ConversationEvent, Conversations, WireDirection
from trcvtui.diagnosis.cut_messages import MessageCutter, MessageCutters
from trcvtui.engine.controller import fresh_bench
from trcvtui.engine.message_filter import Filter, read_filter, read_layout_filter
from trcvtui.errors import Problem, UserError, mistake, one_line
from trcvtui.files import replacing
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.messages import MessageRow, MessageRows
from trcvtui.history.stream_reader import StreamReader
from trcvtui.plc.ledger import PeerSent
from trcvtui.project.project import Project
from trcvtui.project.tables import expected_name, shown
from trcvtui.recording.journal import SIM_WALL_NS, RunBegins
from trcvtui.recording.recording import Recording
from trcvtui.report.message_table import OF_A_CONVERSATION, OF_AN_INSTANCE, MessageTable, MessageType
from trcvtui.udt.layout.layout import Layout

GOOD, NO_ROW = 0, 1
TO_PLC, FROM_PLC = "to PLC", "from PLC"
UNSURE: Final = 0.5  # a guess of the PLC end that is told
READ_AT_ONCE: Final = 1000  # packets of a scan, after which the ledger is read


class MessagesQuestion(NamedTuple):
    """What the command line asks for. `time_ns`: how long projects run."""

    files: Sequence[str]
    project: Path | None = None
    plc: str | None = None
    layout: Layout | None = None
    instance: str | None = None
    members: str = ""
    where: str | None = None
    form: str = "text"
    out: Path | None = None


class _Rows:
    """Puts rows that are let through into the table."""

    def __init__(self, asked: MessagesQuestion, out: TextIO) -> None:
        self.asked, self._out = asked, out
        self.table: MessageTable | None = None
        self._filters: dict[str, Filter | None] = {}

    def begin_bench(self, project: Project, begun_ns: int) -> None:
        """Take the instances whose rows come; raise UserError for names that none of them has."""
        names = [each.name for each in project.instances]
        if self.asked.instance is not None:
            if self.asked.instance not in names:
                expected = expected_name(self.asked.instance, names, "instance")
                raise mistake("--instance", shown(self.asked.instance), expected, "unknown")
            names = [self.asked.instance]
        decls = [(each.name, project.received_data(each.name)) for each in project.instances]
        types = [MessageType(name, data) for name, data in decls if data is not None and name in names]
        self._begin(types, OF_AN_INSTANCE, begun_ns)
        self._filters = dict.fromkeys(names)
        if self.asked.where is not None:
            self._read_filters(names, lambda where, name: read_filter(where, project, name, "--where"))

    def begin_capture(self, layout: Layout | None, begun_ns: int) -> None:
        if self.asked.instance is not None:
            raise mistake("--instance", "a capture without instances", "--project beside it, or a recording")
        types = [MessageType(TO_PLC, layout)] if layout is not None else []
        self._begin(types, OF_A_CONVERSATION, begun_ns)
        layouts = {TO_PLC: layout, FROM_PLC: None}
        self._filters = dict.fromkeys(layouts)
        if self.asked.where is not None:
            self._read_filters(layouts, lambda where, way: read_layout_filter(where, layouts[way], "--where"))

    def _begin(self, types: Sequence[MessageType], labels: Sequence[str], begun_ns: int) -> None:
        self.table = MessageTable(self._out, self.asked.form, types, labels, self.asked.members, begun_ns)
        if self.table.left_out:
            say(f"{self.table.left_out} members have no column: --members names those that shall")

    def _read_filters(self, names: Iterable[str], read: Callable[[str, str], Filter]) -> None:
        wrong: UserError | None = None
        for name in names:
            try:
                self._filters[name] = read(self.asked.where or "", name)
            except UserError as refused:
                del self._filters[name]
                wrong = wrong or refused
        if wrong is not None and not self._filters:
            raise wrong

    def take(self, labels: tuple[str, ...], row: MessageRow, way: str = "", of: str | None = None) -> None:
        """Take a row; `way`: of a conversation; `of`: whose type it has, in place of that."""
        key = way or labels[0]
        lets_through = self._filters.get(key, _nothing)
        if self.table is not None and (lets_through is None or lets_through(row)):
            self.table.write(labels, row, key if of is None else of)

    def finish(self) -> None:
        if self.table is None or not self.table.rows:
            raise _NoRow
        self.table.finish()


def _nothing(row: MessageRow) -> bool:
    return False


def messages(asked: MessagesQuestion, kernel: str = "sim", time_ns: int | None = None) -> int:
    """Write the messages; return 0, or 1 where there is none; raise UserError."""
    projects = [file for file in asked.files if file.endswith(".toml")]
    if projects and (len(asked.files) > 1 or time_ns is None):
        found = projects[0] if time_ns is None else f"{projects[0]} and other files"
        raise mistake("trcvtui messages", found, "one project with --for T#10s, or files")
    if not projects and time_ns is not None:
        raise mistake("--for", asked.files[0], "a project (.toml)")
    if asked.layout is not None and (asked.project is not None or projects):
        raise mistake("--udt", "a project beside it, which has the types", "one of both")
    try:
        with _output(asked.out) as out:
            rows = _Rows(asked, out)
            if time_ns is not None:
                _run(rows, kernel, time_ns)
            elif asked.project is not None:
                _play(rows, asked.project)
            elif asked.layout is None and asked.plc is None and all(map(_begin_of_run, asked.files)):
                for path in asked.files:
                    _run_again(rows, path)
            else:
                _cut(rows)
            rows.finish()
    except _NoRow:
        return NO_ROW
    return GOOD


class _NoRow(Exception):
    """Nothing is written, and no file made."""


@contextmanager
def _output(path: Path | None) -> Iterator[TextIO]:
    if path is None:
        yield sys.stdout
        return
    with replacing(path, f"--out {path}", is_new=True) as file:
        text = TextIOWrapper(file, "utf-8", "backslashreplace", newline="")
        yield text
        text.flush()
        text.detach()


def say(line: str) -> None:
    sys.stderr.write(f"{one_line(line)}\n")


# -- benches -------------------------------------------------------------------------------------------------


class _BenchMessages:
    """The rows of a bench, taken after each scan; `add_ns`: from its time to that of the rows."""

    def __init__(self, bench: Bench, rows: _Rows, add_ns: int = 0, after: int = 0) -> None:
        self.reader = LedgerReader(bench)
        self._messages = MessageRows(bench, self.reader, StreamReader(bench, self.reader).streams, after)
        self._rows, self._add_ns = rows, add_ns

    def take(self) -> None:
        for name, row in self._messages.take():
            self._rows.take((name,), row._replace(t_ns=row.t_ns + self._add_ns) if self._add_ns else row)


def _run(rows: _Rows, kernel: str, time_ns: int) -> None:
    from trcvtui.scenario.command import LivePace
    from trcvtui.scenario.runner import VirtualPace
    from trcvtui.scenario.scenario import load_bench

    project = load_bench(Path(rows.asked.files[0]))
    rows.begin_bench(project, clock.wall_ns() if kernel == "live" else SIM_WALL_NS)
    bench = fresh_bench(project, kernel)
    found, pace = _BenchMessages(bench, rows), LivePace() if kernel == "live" else VirtualPace()
    try:
        while bench.now + bench.runtime.interval_ns < time_ns:
            pace.next_scan(bench)
            found.take()
    finally:
        bench.close()


def _begin_of_run(path: str) -> RunBegins | None:
    """Return what a recording begins with; None: it is none."""
    try:
        recording = Recording(path)
    except UserError:
        return None
    first = next(iter(recording.entries()), None)
    return first if isinstance(first, RunBegins) else None


def _run_again(rows: _Rows, path: str) -> None:
    from trcvtui.replay.keyframes import Keyframes
    from trcvtui.replay.packet_times import PacketTimes
    from trcvtui.replay.run_again import restored_state

    recording = Recording(path)
    keyframes = Keyframes(recording, path)
    run = keyframes.begin()
    if rows.table is None:
        rows.begin_bench(run.bench.project, run.begins.wall_ns)
    found, begun_ns = _BenchMessages(run.bench, rows, after=keyframes.offset), run.begins.wall_ns
    found.reader.index.packet_times = PacketTimes(path, begun_ns, lambda: begun_ns + run.bench.now).of
    run.before_close = found.take
    try:
        with restored_state(run.is_restored, path):
            while run.scan():
                found.take()
        if not run.is_whole:
            raise run.differs()
    except UserError as stopped:
        found.take()
        say(recording.stopped or str(stopped))


# -- captures ------------------------------------------------------------------------------------------------


def _zero_ns(paths: Sequence[str], first_ns: int) -> int:
    """Return the time at which t_s is 0: where a run of ours began, else that of the first packet."""
    begins = _begin_of_run(paths[0])
    return first_ns if begins is None else begins.wall_ns


class _NoLines:
    def scan(self, *told: object) -> None:
        """Do nothing: the ledger tells more."""

    note = scan


def _play(rows: _Rows, project: Path) -> None:
    from trcvtui.line.capture_player import CapturePlayer, plan_capture

    paths = rows.asked.files
    plan, found, troubles = plan_capture(paths, project, rows.asked.plc, None)
    first_ns = found.first_ns or 0
    zero_ns = _zero_ns(paths, first_ns)
    rows.begin_bench(plan.project, zero_ns)
    player = CapturePlayer(plan, found.all, first_ns, _NoLines())
    bench = player.shadows.bench
    messages, ledger = _BenchMessages(bench, rows, first_ns - zero_ns), bench.runtime.ledger

    def sent(packet: PeerSent, ns: int) -> None:
        ledger.write_at(ns, packet)
        if ledger.last_seq % READ_AT_ONCE == 0:
            messages.reader.catch_up()

    player.shadows.sent, player.shadows.after_scan = sent, messages.take
    player.play(paths)
    played = player.close()
    messages.take()
    for number, why in played.unassigned.items():
        say(f"C{number} is unassigned: {why}")
    for number, size in played.left_out.items():
        say(f"C{number}: {size} bytes never reached an instance")
    _end_capture(found, troubles)


def _end_capture(found: Conversations, troubles: Sequence[Problem]) -> None:
    for trouble in troubles:
        say(f"{trouble}; read up to there")
    if not found.all:
        say(f"no conversation in {found.packets} packets")


def _cut(rows: _Rows) -> None:
    paths, layout = rows.asked.files, rows.asked.layout
    taker, troubles = _CaptureMessages(rows), list[Problem]()
    take_captures(paths, taker.found, troubles)
    if troubles and not taker.found.packets:
        raise UserError(troubles)
    if rows.table is None:
        rows.begin_capture(layout, 0)
    taker.end()
    _end_capture(taker.found, troubles)


class _CaptureMessages:
    """Cuts what both directions of each conversation say; of the type are messages to the PLC."""

    def __init__(self, rows: _Rows) -> None:
        self.found = Conversations(self._take)
        self._rows = rows
        self._given = parse_plc(rows.asked.plc) if rows.asked.plc is not None else None
        self._zero_ns: int | None = None
        self._cutters = MessageCutters(self._made)

    def _made(self, direction: WireDirection) -> MessageCutter | None:
        """Return what cuts a direction; None: it is of no conversation of the PLC that was named."""
        guess = guess_plc(direction.conversation, self._given, NOTHING_KNOWN)
        if self._given is not None and guess.why != "--plc":
            return None
        way = FROM_PLC if guess.says is direction else TO_PLC
        layout, rows, zero_ns = self._rows.asked.layout, self._rows, self._zero_ns or 0
        labels = f"C{direction.conversation.number}", way
        number, last_ns = 0, None

        def take(ns: int, content: bytes, size: int, reason: str, begins: bool) -> None:
            nonlocal number, last_ns
            number += 1
            gap_ns = None if last_ns is None else ns - last_ns
            last_ns = ns
            have = len(content)
            row = MessageRow(number, 0, ns - zero_ns, gap_ns, size, -1, "", -1, reason, have, content)
            rows.take(labels, row, way, None if begins else "")

        return MessageCutter(layout.size if layout is not None and way is TO_PLC else 0, take)

    def _take(self, event: ConversationEvent) -> None:
        if self._zero_ns is None:
            self._zero_ns = _zero_ns(self._rows.asked.files, self.found.first_ns or event.ns)
            self._rows.begin_capture(self._rows.asked.layout, self._zero_ns)
        self._cutters.take(event)

    def end(self) -> None:
        self._cutters.end(max([each.last_ns for each in self.found.all], default=0))
        if self._given is not None and self.found.all and not self._cutters.are_any:
            given = f"'{self._rows.asked.plc}', which no conversation has"
            raise fits_nothing("--plc", given, self.found.all)
        if self._rows.asked.layout is not None:
            for each in self.found.all:
                guess = guess_plc(each, self._given, NOTHING_KNOWN)
                if guess.confidence < UNSURE:
                    say(f"C{each.number}: PLC end {guess.confidence:.0%} sure ({guess.why}): --plc names it")
