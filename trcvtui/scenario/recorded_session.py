"""Keeps the commands and the STATUS of a session on a bench, and writes them as a scenario file that runs.

Rule 1: only commands that were carried out are kept, each with the number of scans that had passed before.
Rule 2: a mark begins the expectations anew. Commands before the mark stay: they led to its state.
Rule 3: commands before the first scan follow the commands of the project's `start`, which are not kept.
Rule 4: on real sockets peers and scans act by two clocks. On real sockets a scenario expects that jobs end
with DONE between two events, but does not count these jobs.
Bounds: MOST_COMMANDS commands of MOST_CHARACTERS characters. Each trace keeps its first and its newest
groups of equal scans.
"""

from __future__ import annotations

import json
import os
from collections import deque
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

from msgspec import Struct, structs

from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import block_row
from trcvtui.commands import words
from trcvtui.commands.patterns import ANY_SCANS, Atom, Scan
from trcvtui.commands.table import format_command
from trcvtui.errors import mistake
from trcvtui.files import write_file
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.pin_waveform import PinChange
from trcvtui.history.waveform_recorder import PinHistory, WaveformRecorder
from trcvtui.net.events import ConnectionChanged, EventKind
from trcvtui.paths import demo_path
from trcvtui.plc.ledger import BenchNote, StatusEdge
from trcvtui.project.tables import parse_toml, quote, read_text
from trcvtui.project.text import relocate, relocate_files

MOST_COMMANDS: Final = 5000
MOST_CHARACTERS: Final = 4_000_000
FIRST_RUNS: Final = 150
NEWEST_RUNS: Final = 50
# The wire decides how many scans these last, not the block: any number from one on is expected.
WIRE_DEPENDENT: Final = (Condition.ESTABLISHING, Condition.CONNECTED, Condition.SENDING, Condition.RECEIVING)
ANY_TEXT: Final = str(ANY_SCANS)
SIM_KERNEL: Final = "sim"
NEVER: Final = 1 << 62
DELETED: Final = "deleted"
END_NOTES: Final = frozenset({DELETED, "STOP"})  # after these an instance, or all of them, are not called
BEGIN_NOTES: Final = frozenset({"created", "declared anew"})
MOST_NAMED_PARTNERS: Final = 3
MOST_FRAMES: Final = 200  # that are expected one by one; later ones only as part of the trace
MOST_FRAME_BYTES: Final = 256  # bytes of each
OUTSIDE_TEXT: Final = " A partner outside the bench took part ("
# A TRCV_C shows these in turns while frames come.
TURN_CONDITIONS: Final = (Condition.CONNECTED, Condition.RECEIVING, Condition.RECEIVED)


class StatusPattern:
    """The STATUS of one instance as a pattern: its first and its newest groups of equal scans."""

    def __init__(self, of_the_wire: frozenset[int] = frozenset()) -> None:
        self._of_the_wire = of_the_wire
        self._first: list[Scan | None] = []
        self._newest: deque[Scan | None] = deque(maxlen=NEWEST_RUNS)
        self._is_cut = False
        self._long: set[int] = set()  # the places of runs that are longer than one scan
        self._scan: Scan | None = None
        self._count = 0

    def add(self, scan: Scan) -> None:
        if scan == self._scan:
            self._long.add(self._count)
            return
        self._scan = scan
        self._append(scan)

    def __bool__(self) -> bool:
        return self._count > 0

    @property
    def is_full(self) -> bool:
        return self._count > FIRST_RUNS

    def add_gap(self) -> None:
        """Allow any scans here, because some scans were not read."""
        self._scan = None
        self._append(None)

    def mark_cut(self) -> None:
        """Mark that scans between the first and the newest ones are left out."""
        self._scan, self._is_cut = None, True
        self._newest.clear()

    def _append(self, scan: Scan | None) -> None:
        self._count = count = self._count + 1
        if count <= FIRST_RUNS:
            self._first.append(scan)
            return
        if count > FIRST_RUNS + NEWEST_RUNS:
            self._is_cut = True
            self._long.discard(count - NEWEST_RUNS)
        self._newest.append(scan)

    def format_pattern(self, by_turns: Collection[int] = (), done: Collection[int] = ()) -> str:
        """Return the scans in the notation of a pattern; no scans give an empty text.

        After a scan with a STATUS in `done`, any number of scans with a STATUS in `by_turns` may follow.
        """
        newest = self._atoms(self._newest, self._count - len(self._newest) + 1)
        atoms = [*self._atoms(self._first, 1), *[ANY_SCANS] * self._is_cut, *newest]
        return " ".join(map(str, _replace_turns(atoms, by_turns, done) if by_turns else atoms))

    def _atoms(self, scans: Iterable[Scan | None], place: int) -> list[Atom]:
        return [ANY_SCANS if scan is None else self._atom(scan, at) for at, scan in enumerate(scans, place)]

    def _atom(self, scan: Scan, at: int) -> Atom:
        return Atom(scan, 1, at in self._long or scan[0] in self._of_the_wire)


def _replace_turns(atoms: list[Atom], by_turns: Collection[int], done: Collection[int]) -> Iterator[Atom]:
    """Yield the atoms. After a STATUS in `done`, `...` replaces the scans with a STATUS in `by_turns`."""
    is_open = False
    for atom in atoms:
        if is_open and (atom is ANY_SCANS or (atom.scan is not None and atom.scan[0] in by_turns)):
            continue
        yield atom
        is_open = atom is ANY_SCANS
        if atom.scan is not None and atom.scan[0] in done:
            yield ANY_SCANS
            is_open = True


class ExternalPartners(Struct, frozen=True):
    """Partners outside the bench, which cannot be replayed, and the CONNECTs that these partners used."""

    partners: tuple[str, ...] = ()
    connects: frozenset[str] = frozenset()

    @property
    def about_text(self) -> str:
        if not self.partners:
            return ""
        named, where = ", ".join(self.partners[:MOST_NAMED_PARTNERS]), ", ".join(sorted(self.connects))
        return f"{OUTSIDE_TEXT}{named}): nothing is expected on {where}."

    @property
    def warning(self) -> str:
        found = ", ".join(self.partners[:MOST_NAMED_PARTNERS])
        return f"; {found} is no peer of this bench and will not be replayed" if found else ""


class SessionEntry(Struct, frozen=True):
    """A line after `scans` scans. If `traced` is set, the line expects the trace of that instance."""

    scans: int
    line: str
    traced: str = ""
    is_frame: bool = False


class _Trace:
    """The trace of one instance. `status` holds since the last edge. `next_call` is the next call's scan.

    `changes_read` counts the changes of the instance's pins that were read.
    """

    __slots__ = ("changes_read", "interval", "is_lost", "next_call", "pattern", "status")

    def __init__(self, pattern: StatusPattern, interval: int) -> None:
        self.pattern, self.interval = pattern, interval
        self.status: Scan = 0, False
        self.next_call = NEVER
        self.is_lost = False
        self.changes_read = 0


class RecordedSession:
    """One bench from its first scan on: `keep_command` keeps commands; outputs come from the ledger."""

    def __init__(self, bench: Bench, reader: LedgerReader, waves: WaveformRecorder) -> None:
        self._bench = bench
        rules = bench.project.rules
        codes = (rules.status, *rules.status_of.values())
        self._of_the_wire = frozenset(code[each] for code in codes for each in WIRE_DEPENDENT if each in code)
        self._turns = {code[each] for code in codes for each in TURN_CONDITIONS if each in code}
        self._done = {code[Condition.RECEIVED] for code in codes if Condition.RECEIVED in code}
        self._peers_by_the_clock = False  # whether commands let peers act so; the project says it of others
        self._entries: list[SessionEntry] = []
        self._characters = self._frames = 0
        self._waves = waves
        self._shown: dict[str, _Trace] = {}
        self.commands = 0
        self.marked_at = 0
        self._catch_up = reader.catch_up
        reader.index.subscribe({BenchNote: self._handle_note})
        if bench.kernel_name == SIM_KERNEL:
            reader.index.subscribe({StatusEdge: self._expect_frame})
        reader.on_loss.append(self._note_gap)
        for name in waves.records:
            self._begin_trace(name)

    def keep_command(self, command: words.BenchCommand, line: str) -> None:
        """Keep a command that was carried out."""
        if isinstance(command, words.RunScans | words.RunFor):
            return  # each entry has its number of scans
        if isinstance(command, words.DeleteBlock):
            self._expect_trace(command.instance)  # now: later its name is unknown to `expect`
        self.commands += 1
        self._peers_by_the_clock |= _acts_by_clock(command)
        text = _format_command(command, line)
        self._characters += len(text)
        if not self.is_overfull:
            self._add(text)

    def _add(self, line: str, traced: str = "", frame_in: int | None = None) -> None:
        scan = self._bench.runtime.scans if frame_in is None else frame_in
        self._entries.append(SessionEntry(scan, line, traced, frame_in is not None))

    def _expect_trace(self, instance: str) -> None:
        trace = self._read_to_now().get(instance)
        if trace is not None and trace.pattern:
            self._add(self._trace_line(instance, trace.pattern, self.external_partners().connects), instance)
            self._begin_trace(instance)

    @property
    def is_by_the_clock(self) -> bool:
        """Return whether peers acted by another clock than the scans (rule 4)."""
        peers = self._bench.project.peers
        acts = self._peers_by_the_clock or any(peer.says or peer.reconnect_ns for peer in peers)
        return acts and self._bench.kernel_name != SIM_KERNEL

    def external_partners(self) -> ExternalPartners:
        """Return the partners that are no peers of this bench, as far back as the ledger goes."""
        ledger = self._bench.runtime.ledger
        ours, calls = set(), []
        for _, _, event in ledger.events_since(0):
            if isinstance(event, BenchNote) and event.what == "connected":
                ours.add(event.end)
            elif isinstance(event, ConnectionChanged) and event.what is EventKind.CONNECTED:
                calls.append(event)
        strange = [call for call in calls if call.peer not in ours]
        partners = tuple(dict.fromkeys(call.peer for call in strange))
        return ExternalPartners(partners, frozenset(call.connection for call in strange))

    def _trace_line(self, instance: str, pattern: StatusPattern, outside: frozenset[str]) -> str:
        decl = self._bench.project.instance(instance)
        is_outside = decl is not None and decl.connect in outside
        return f"expect {instance} trace {ANY_TEXT if is_outside else self._pattern(pattern)}"

    def _pattern(self, pattern: StatusPattern) -> str:
        return pattern.format_pattern(*((self._turns, self._done) if self.is_by_the_clock else ()))

    @property
    def is_overfull(self) -> bool:
        return self.commands > MOST_COMMANDS or self._characters > MOST_CHARACTERS

    def _begin_trace(self, instance: str) -> _Trace:
        record = self._waves.records[instance]
        trace = self._shown[instance] = _Trace(StatusPattern(self._of_the_wire), self._interval(instance))
        trace.changes_read = record.total
        record.on_drop = partial(self._add_dropped_change, trace, record)
        return trace

    def _add_dropped_change(self, trace: _Trace, record: PinHistory, change: PinChange) -> None:
        if record.total - record.kept_count > trace.changes_read:
            self._add_change(trace, change)
            trace.changes_read += 1
            if trace.pattern.is_full:
                record.on_drop = None

    def _read_to_now(self) -> dict[str, _Trace]:
        self._catch_up()
        return self._read_changes(self._bench.runtime.scans)

    def _read_changes(self, until: int) -> dict[str, _Trace]:
        """Read all new changes of pins, and count the calls up to scan `until`."""
        for name, record in self._waves.records.items():
            trace = self._shown.get(name) or self._begin_trace(name)
            changes = record.list_changes_after(trace.changes_read)
            if len(changes) < record.total - trace.changes_read:
                trace.pattern.mark_cut()
                trace.next_call = NEVER
            for change in changes:
                self._add_change(trace, change)
            trace.changes_read = record.total
            self._add_quiet_calls(trace, until)
        return self._shown

    def _add_change(self, trace: _Trace, change: PinChange) -> None:
        _, scan, _, edge = change
        if not isinstance(edge, StatusEdge) or edge.condition == Condition.NOT_CALLED:
            return
        self._add_quiet_calls(trace, scan - 1)
        trace.status, trace.is_lost = (edge.outputs.status, edge.outputs.error), False
        trace.pattern.add(trace.status)
        trace.next_call = self._next_call(trace, scan)

    def _interval(self, instance: str) -> int:
        """Return the time from call to call of an instance, in ns."""
        decl = self._bench.project.instance(instance)
        task = self._bench.project.task(decl.task) if decl is not None else None
        return task.interval_ns if task is not None else self._bench.runtime.interval_ns

    def _next_call(self, trace: _Trace, scan: int) -> int:  # the first scan at or after the task's next time
        each = self._bench.runtime.interval_ns
        if trace.interval == each:
            return scan + 1
        due = ((scan - 1) * each // trace.interval + 1) * trace.interval
        return -(-due // each) + 1

    def _add_quiet_calls(self, trace: _Trace, until: int) -> None:
        """Add at most two calls without a change up to scan `until`. A pattern needs no more calls."""
        if trace.next_call <= until:
            trace.pattern.add(trace.status)
            if self._next_call(trace, trace.next_call) <= until:
                trace.pattern.add(trace.status)
            trace.next_call = self._next_call(trace, until)

    def _handle_note(self, seq: int, scan: int, t_ns: int, note: BenchNote) -> None:
        if note.what not in END_NOTES and note.what not in BEGIN_NOTES:
            return
        for name, trace in self._read_changes(scan - 1).items():
            if note.what in BEGIN_NOTES:
                trace.interval = self._interval(name)
            elif note.what != DELETED or note.subject == name:
                trace.next_call = NEVER

    def _note_gap(self, seq: int, scan: int, t_ns: int) -> None:
        for trace in self._read_changes(scan).values():
            trace.pattern.add_gap()
            trace.is_lost, trace.next_call = True, NEVER

    def _expect_frame(self, seq: int, scan: int, t_ns: int, edge: StatusEdge) -> None:
        """Expect outputs and first bytes of a frame in this scan. Called only in virtual time (rule 4)."""
        if not edge.outputs.done or not block_row(edge.block).has_com_buffer or self._frames >= MOST_FRAMES:
            return
        decl = self._bench.project.instance(edge.instance)
        if decl is None:
            return
        self._frames += 1
        shown = ((pin.name, getattr(edge.outputs, pin.shows)) for pin in block_row(edge.block).outputs)
        pins = " ".join(f"{pin}={int(value)}" for pin, value in shown if value is not None)
        self._add(f"expect {edge.instance} {pins}", frame_in=scan)
        is_late = scan != self._bench.runtime.scans  # DATA may have the next frame already
        content = self._bench.runtime.data(decl.data, MOST_FRAME_BYTES) if decl.data and not is_late else b""
        length = edge.outputs.rcvd_len
        size = content.find(0) + 1 if length is None else length  # a text: with its byte 00
        if content[:size]:
            self._add(f"expect {decl.data} hex {content[:size].hex(' ')}", frame_in=scan)

    def restart_expectations(self) -> None:
        """Begin the expectations anew from here (rule 2)."""
        before = dict(self._read_to_now())
        here = [instance.name for instance in self._bench.project.instances]
        kept = [e for e in self._entries if e.traced not in here and not e.is_frame]
        self._entries, self._frames = [_drop_judgement(e) for e in kept], 0
        for instance in here:
            self._add(f"expect {instance} trace {ANY_TEXT}", instance)
        for name, trace in before.items():
            fresh = self._begin_trace(name)
            fresh.status, fresh.next_call, fresh.is_lost = trace.status, trace.next_call, trace.is_lost
            if fresh.is_lost:
                fresh.pattern.add_gap()
        self.marked_at = self._bench.runtime.scans

    def steps(self) -> Iterator[str]:
        """Yield the steps of a scenario that repeats the session; raise UserError if it is too long."""
        if self.is_overfull:
            found = f"{self.commands} commands of {self._characters} characters"
            expected = f"at most {MOST_COMMANDS} of {MOST_CHARACTERS}; a new bench begins a new session"
            raise mistake("save scenario", found, expected)
        passed = 0
        for entry in self._entries:
            yield from _line_for_scans(entry.scans - passed)
            passed = entry.scans
            yield entry.line
        yield from _line_for_scans(self._bench.runtime.scans - passed)
        outside = self.external_partners().connects
        for instance, trace in self._read_to_now().items():
            if trace.pattern:
                yield self._trace_line(instance, trace.pattern, outside)


def _line_for_scans(scans: int) -> Iterator[str]:
    if scans:
        yield f"run {scans}"


def _drop_judgement(entry: SessionEntry) -> SessionEntry:
    return structs.replace(entry, line=f"expect {entry.traced} trace {ANY_TEXT}") if entry.traced else entry


def _acts_by_clock(command: words.BenchCommand) -> bool:
    match command:
        case words.PeerSend():
            return command.repeat > 1 or bool(command.gap_ns or command.gaps_ns)
        case words.PeerPlaySequence() | words.NumberedFramesOn():
            return True
        case _:
            return False


def _format_command(command: words.BenchCommand, line: str) -> str:
    """Return the line as it was typed, but bytes of a file as hex, because the file may change."""
    from_file = isinstance(command, words.PeerSend) and command.text.startswith("file")
    if line.isprintable() and not from_file:
        return line
    return format_command(
        replace(command, text="") if isinstance(command, words.PeerSend | words.WriteBytes) else command
    )


SUFFIX: Final = ".toml"
MARK_TEXT: Final = " since scan "
FAR_FOLDER: Final = os.path.join(os.pardir, os.pardir, os.pardir)


def scenario_text(session: RecordedSession, bench: Bench, path: Path, before: str | None = None) -> str:
    """Return the text of a scenario file for `path`.

    `before` is the project's text at the start of the session, if its file has changed since. The scenario
    has this text, or the text of an installed project. The scenario names no path of the installation.
    """
    old, new = bench.project.base, path.parent
    lines = [_rebase_step(line, old, new) for line in session.steps()]
    steps = "\n".join(lines).replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    about = f"A session of {bench.runtime.scans} scans on {bench.kernel_name}, saved with what was seen"
    about += f"{MARK_TEXT}{session.marked_at}." if session.marked_at else "."
    about += session.external_partners().about_text
    head = {"name": path.stem, "about": about}
    lines = [_project_text(bench.project.path, path.parent, before), "", "[scenario]"]
    lines += [f"{key} = {_quote(text)}" for key, text in head.items()]
    return "\n".join([*lines, 'steps = """', steps, '"""', ""])


def _rebase_step(line: str, old: Path, new: Path) -> str:
    """Return a step for a file in `new`. The path in an `add udt` line is then relative to this folder."""
    start, name = "add udt ", line.removeprefix("add udt ")
    return start + relocate(name, old, new) if line.startswith(start) else line


def _project_text(own: Path, folder: Path, before: str | None) -> str:
    inside = Path(os.path.realpath(own)).is_relative_to(os.path.realpath(demo_path().parents[1]))
    if before is None and not inside:
        return f"project = {_quote(_relative_path(own, folder))}"
    text = relocate_files(read_text(own) if before is None else before, own.parent, folder, str(own))
    if "scenario" in parse_toml(text, str(own)):
        raise mistake("save scenario", f"{own}, which is a scenario itself", "a session of a project")
    return text.rstrip()


def _relative_path(project: Path, folder: Path) -> str:
    whole = os.path.realpath(project)
    try:
        relative = os.path.relpath(whole, os.path.realpath(folder))
    except ValueError:  # another drive: Windows has no relative path there
        return whole
    return whole if relative.startswith(FAR_FOLDER) else relative.replace(os.sep, "/")


def _quote(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def parse_toml_path(name: str, where: str) -> Path:
    """Return the path of a TOML file that is named in a command; raise UserError for another suffix."""
    bare = name.strip().strip("\"'")
    path = Path(bare).expanduser()
    if not path.name or bare.endswith(("/", os.sep)):
        raise mistake(where, quote(name), "the name of a file")
    if not path.suffix:
        return path.with_suffix(SUFFIX)
    if path.suffix != SUFFIX:
        raise mistake(where, quote(path.name), f"a name that ends in {SUFFIX}")
    return path


def write_new(path: Path, text: str, ours: Iterable[str], where: str) -> str:
    """Write a new file, or overwrite one of `ours`, else raise UserError. Return the real path."""
    whole = os.path.realpath(path)
    is_own = whole in ours
    write_file(path, text, where, is_own=is_own, is_new=not is_own)
    return whole
