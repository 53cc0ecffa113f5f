"""`trcvtui messages` writes each message of a recording, a capture or a run as one row."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from typing import Final, NamedTuple, TextIO

from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.capture.command import read_captures
from trcvtui.capture.plc_end import NO_KNOWN_ENDS, guess_plc, make_no_match_error, parse_plc
from trcvtui.capture.reassembly import ConversationEvent, Conversations, WireDirection
from trcvtui.diagnosis.cut_messages import MessageCutter, MessageCutters
from trcvtui.engine.controller import fresh_bench
from trcvtui.engine.message_filter import Filter, read_filter, read_layout_filter
from trcvtui.errors import Problem, UserError, mistake, one_line
from trcvtui.files import replace_file
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.messages import MessageRow, MessageRows
from trcvtui.history.received_streams import LEAST_SPANS_KEPT
from trcvtui.history.stream_reader import StreamReader
from trcvtui.plc.ledger import PeerSent
from trcvtui.project.project import DataDecl, Project
from trcvtui.project.tables import expected_name, quote
from trcvtui.recording.journal import SIM_WALL_NS
from trcvtui.recording.recording import Recording, read_run_header
from trcvtui.report.message_table import (
    CONVERSATION_COLUMNS,
    INSTANCE_COLUMNS,
    MessageTable,
    MessageType,
    is_same_type,
)
from trcvtui.udt.layout.layout import Layout

EXIT_GOOD, EXIT_NO_ROW = 0, 1
TO_PLC, FROM_PLC = "to PLC", "from PLC"
UNSURE_CONFIDENCE: Final = 0.5  # less confident guesses of the PLC end give a warning
PACKETS_PER_READ: Final = 1000  # packets between two scans


class MessagesOptions(NamedTuple):
    """The options of the command line. A project runs for `time_ns`."""

    files: Sequence[str]
    project: Path | None
    plc: str | None
    layout: Layout | None
    instance: str | None
    members: str
    where: str | None
    form: str
    out: Path | None
    kernel: str
    time_ns: int | None


class _NoRow(Exception):
    """There is no row: nothing is written, and no file is made."""


def write_messages(asked: MessagesOptions) -> int:
    """Write the messages. Return 1 if there are no messages, else 0; raise UserError."""
    first, is_project = asked.files[0], any(file.endswith(".toml") for file in asked.files)
    if is_project and (len(asked.files) > 1 or asked.time_ns is None):
        found = first if asked.time_ns is None else f"{first} and other files"
        raise mistake("trcvtui messages", found, "one project with --for T#10s, or captures or recordings")
    if not is_project and asked.time_ns is not None:
        raise mistake("--for", first, "a project (.toml)")
    if asked.layout is not None and (asked.project is not None or is_project):
        raise mistake("--udt", "a project beside it, which has the types", "only one of the two")
    try:
        with _output(asked.out) as out:
            rows = _RowWriter(asked, out)
            if asked.time_ns is not None:
                _run_project(rows, asked.kernel, asked.time_ns)
            elif asked.project is not None:
                _play_captures(rows, asked.project)
            elif asked.layout is None and asked.plc is None and all(map(read_run_header, asked.files)):
                for path in asked.files:
                    _replay_recording(rows, path)
            else:
                _CaptureMessages(rows).read_all()
            rows.finish()
    except _NoRow:
        return EXIT_NO_ROW
    return EXIT_GOOD


@contextmanager
def _output(path: Path | None) -> Iterator[TextIO]:
    if path is None:
        yield sys.stdout
        return
    with replace_file(path, f"--out {path}", is_new=True) as file:
        text = TextIOWrapper(file, "utf-8", "backslashreplace", newline="")
        yield text
        text.flush()
        text.detach()


def _warn(line: object) -> None:
    sys.stderr.write(f"{one_line(str(line))}\n")


class _RowWriter:
    """Writes the rows that pass a filter into the table, by instance or by direction."""

    def __init__(self, asked: MessagesOptions, out: TextIO) -> None:
        self.asked, self._out = asked, out
        self.table: MessageTable | None = None
        self._filters: dict[str, Filter | None] = {}
        self.project: Project | None = None  # whose types have the columns
        self.begun_ns = 0

    def begin_table(self, project: Project | None, begun_ns: int) -> None:
        """Begin the table for a project's instances, or for both directions of a capture (None)."""
        asked, self.project, self.begun_ns = self.asked, project, begun_ns
        if project is None and asked.instance is not None:
            raise mistake("--instance", "a capture without instances", "--project beside it, or a recording")
        types = self._list_types(project)
        if asked.instance is not None and not types:
            names = [each.name for each in project.instances] if project is not None else ()
            expected = expected_name(asked.instance, names, "instance")
            raise mistake("--instance", quote(asked.instance), expected, "unknown")
        wrong = self._read_filters(types, project)
        if wrong and len(wrong) == len(self._filters):
            raise min(wrong, key=lambda each: len(str(each)))  # the shortest names a near member
        some = [MessageType(name, type_) for name, type_ in types.items() if type_ is not None]
        labels = CONVERSATION_COLUMNS if project is None else INSTANCE_COLUMNS
        self.table = MessageTable(self._out, asked.form, some, labels, asked.members, begun_ns)
        if self.table.left_out:
            _warn(f"{self.table.left_out} members have no column: choose columns with --members")

    def _list_types(self, project: Project | None) -> dict[str, DataDecl | Layout | None]:
        if project is None:
            return {TO_PLC: self.asked.layout, FROM_PLC: None}
        names = [each.name for each in project.instances if self.asked.instance in (None, each.name)]
        return {name: project.received_data(name) for name in names}

    def _read_filters(self, names: Collection[str], project: Project | None) -> list[UserError]:
        where, wrong = self.asked.where, list[UserError]()
        named = (where or "").strip().partition(" ")[0]
        for name in [named] if named in names else names:
            self._filters[name] = None if where is None else lambda row: False
            if where is None:
                continue
            try:
                if project is not None:
                    self._filters[name] = read_filter(where, project, name, "--where")
                else:
                    layout = self.asked.layout if name == TO_PLC else None
                    self._filters[name] = read_layout_filter(where, layout, "--where")
            except UserError as refused:  # another type may have that member
                wrong.append(refused)
        return wrong

    def change_project(self, project: Project) -> frozenset[str]:
        """Read the filters for another project; return the instances whose columns have another type."""
        types, first = self._list_types(project), self._list_types(self.project)
        self._read_filters(types, project)
        return frozenset(name for name in types if not is_same_type(types[name], first.get(name)))

    def add_row(self, key: str, labels: tuple[str, ...], row: MessageRow, has_type: bool = True) -> None:
        if self.table is not None and key in self._filters:
            passes = self._filters[key]
            if passes is None or passes(row):
                self.table.write(labels, row, key if has_type else "")

    def finish(self) -> None:
        if self.table is None or not self.table.rows:
            raise _NoRow
        self.table.finish()


# -- benches -------------------------------------------------------------------------------------------------


class _BenchMessages:
    """The rows of a bench, taken after each scan. `add_ns` is added to the times of the rows."""

    def __init__(self, bench: Bench, rows: _RowWriter, add_ns: int = 0, after: int = 0) -> None:
        self.reader = LedgerReader(bench)
        self._streams = StreamReader(bench, self.reader).streams
        self._messages = MessageRows(bench, self.reader, self._streams, after)
        self._rows, self._add_ns, self._bench = rows, add_ns, bench
        self._project = rows.project
        self._changed = frozenset[str]()  # instances whose messages have another type than the columns
        self._warned = set[str]()

    def add_new_rows(self, is_last: bool = False) -> None:
        new = [*self._messages.take_rows()]
        if self._rows.table is None and (new or is_last):  # the types at the first row set the columns
            self._project = self._bench.project
            self._rows.begin_table(self._project, self._rows.begun_ns)
        if self._bench.project is not self._project and self._rows.table is not None:
            self._project = self._bench.project
            self._changed = self._rows.change_project(self._project)
        for name, row in new:
            row = row._replace(t_ns=row.t_ns + self._add_ns)
            self._rows.add_row(name, (name,), row, name not in self._changed)
        for name in {name for name, _ in new} & self._changed - self._warned:
            self._warned.add(name)
            _warn(f"{name}: its DATA has another type than in the first row; later rows have no members")
        for stream in self._streams.streams.values():
            stream.forget_oldest(LEAST_SPANS_KEPT, 0)  # they are rows now


def _run_project(rows: _RowWriter, kernel: str, time_ns: int) -> None:
    from trcvtui.scenario.command import LivePace
    from trcvtui.scenario.runner import VirtualPace
    from trcvtui.scenario.scenario import load_bench_project

    project = load_bench_project(Path(rows.asked.files[0]))
    rows.begin_table(project, clock.utc_ns() if kernel == "live" else SIM_WALL_NS)
    bench = fresh_bench(project, kernel)
    found, pace = _BenchMessages(bench, rows), LivePace() if kernel == "live" else VirtualPace()
    try:
        while bench.now + bench.runtime.interval_ns < time_ns:
            pace.next_scan(bench)
            found.add_new_rows()
    finally:
        bench.close()


def _replay_recording(rows: _RowWriter, path: str) -> None:
    from trcvtui.replay.keyframes import Keyframes
    from trcvtui.replay.packet_times import PacketTimes
    from trcvtui.replay.run_again import guard_restored

    recording = Recording(path)
    keyframes = Keyframes(recording, path)
    run = keyframes.start_run()
    begun_ns = run.begins.wall_ns
    rows.begun_ns = rows.begun_ns or begun_ns
    found = _BenchMessages(run.bench, rows, begun_ns - rows.begun_ns, keyframes.offset)
    found.reader.index.packet_times = PacketTimes(path, begun_ns, lambda: begun_ns + run.bench.now).find_time
    run.before_close = found.add_new_rows
    stopped: UserError | None = None

    def scan() -> bool:
        nonlocal stopped
        try:
            with guard_restored(run.is_restored, path):
                if run.scan():
                    return True
                if not run.is_whole:
                    raise run.make_end_error()
        except UserError as wrong:
            stopped = wrong
        return False

    while scan():
        found.add_new_rows()  # outside the try: its errors are about options and end the command
    if stopped is not None:
        found.add_new_rows()
        _warn(recording.stopped or stopped)
    found.add_new_rows(is_last=True)


# -- captures ------------------------------------------------------------------------------------------------


def _zero_ns(paths: Sequence[str], first_ns: int) -> int:
    """Return the time at which t_s is 0: the beginning of a recorded run, or a capture's first packet."""
    begins = read_run_header(paths[0])
    return first_ns if begins is None else begins.wall_ns


class _SilentOutput:
    first_ns = 0

    def report_scan(self, *_: object) -> None:
        """Do nothing: the ledger already has everything that a line would show."""

    note = report_scan


def _play_captures(rows: _RowWriter, project: Path) -> None:
    from trcvtui.line.capture_player import CapturePlayer, plan_capture

    paths = rows.asked.files
    plan, found, troubles = plan_capture(paths, project, rows.asked.plc, None)
    first_ns = found.first_ns or 0
    zero_ns = _zero_ns(paths, first_ns)
    rows.begin_table(plan.project, zero_ns)
    player = CapturePlayer(plan, found.all, first_ns, _SilentOutput())
    bench = player.shadows.bench
    messages, ledger = _BenchMessages(bench, rows, first_ns - zero_ns), bench.runtime.ledger

    def write_sent_packet(packet: PeerSent, ns: int) -> None:
        ledger.write_at(ns, packet)
        if ledger.last_seq % PACKETS_PER_READ == 0:
            messages.reader.catch_up()

    player.shadows.sent, player.shadows.after_scan = write_sent_packet, messages.add_new_rows
    player.play_captures(paths)
    played = player.close()
    messages.add_new_rows()
    for number, why in played.unassigned.items():
        _warn(f"C{number} is unassigned: {why}")
    for number, size in played.left_out.items():
        _warn(f"C{number}: {size} bytes never reached an instance")
    _warn_about_capture(found, troubles)


def _warn_about_capture(found: Conversations, troubles: Sequence[Problem]) -> None:
    for trouble in troubles:
        _warn(f"{trouble}; read up to there")
    if not found.all:
        _warn(f"no conversation in {found.packets} packets")


class _CaptureMessages:
    """Cuts both directions of each conversation into messages; only messages to the PLC have the type."""

    def __init__(self, rows: _RowWriter) -> None:
        self._found, self._rows, self._zero_ns = Conversations(self._add_event), rows, 0
        self._given = parse_plc(rows.asked.plc) if rows.asked.plc is not None else None
        self._cutters = MessageCutters(self._make_cutter)

    def read_all(self) -> None:
        found, rows, troubles = self._found, self._rows, list[Problem]()
        read_captures(rows.asked.files, found, troubles)
        if troubles and not found.packets:
            raise UserError(troubles)
        if rows.table is None:
            rows.begin_table(None, 0)
        self._cutters.end_all(max([each.last_ns for each in found.all], default=0))
        if self._given is not None and found.all and not self._cutters.has_cutters:
            raise make_no_match_error("--plc", f"'{rows.asked.plc}', which no conversation has", found.all)
        for each in found.all if rows.asked.layout is not None else ():
            guess = guess_plc(each, self._given, NO_KNOWN_ENDS)
            if guess.confidence < UNSURE_CONFIDENCE:
                _warn(f"C{each.number}: PLC end {guess.confidence:.0%} sure ({guess.why}): --plc names it")
        _warn_about_capture(found, troubles)

    def _make_cutter(self, direction: WireDirection) -> MessageCutter | None:
        """Return the cutter of a direction, or None if neither end of its conversation is the `--plc`."""
        guess = guess_plc(direction.conversation, self._given, NO_KNOWN_ENDS)
        if self._given is not None and guess.why != "--plc":
            return None
        way = FROM_PLC if guess.says is direction else TO_PLC
        layout, rows, zero_ns = self._rows.asked.layout, self._rows, self._zero_ns
        labels = f"C{direction.conversation.number}", way
        number, last_ns = 0, None

        def add_message(ns: int, content: bytes, size: int, reason: str, begins: bool) -> None:
            nonlocal number, last_ns
            gap_ns = None if last_ns is None else ns - last_ns
            number, last_ns, have = number + 1, ns, len(content)
            row = MessageRow(number, 0, ns - zero_ns, gap_ns, size, -1, "", -1, reason, have, content)
            rows.add_row(way, labels, row, begins)

        return MessageCutter(layout.size if layout is not None and way is TO_PLC else 0, add_message)

    def _add_event(self, event: ConversationEvent) -> None:
        if self._rows.table is None:
            self._zero_ns = _zero_ns(self._rows.asked.files, self._found.first_ns or event.ns)
            self._rows.begin_table(None, self._zero_ns)
        self._cutters.add_event(event)
