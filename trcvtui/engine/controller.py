"""Drives the bench for a screen. Each line gets one answer, and each request gets one picture.

Rule: a scenario gets a fresh bench in place of the present one. After the scenario the opened project
gets a fresh bench. There is always exactly one bench.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from msgspec.structs import replace

from trcvtui import clock
from trcvtui.bench.bench import KERNEL_NAMES, Bench
from trcvtui.bench.conditions import describe_now, holds
from trcvtui.bench.doctor_requests import BenchDoctor, Judge
from trcvtui.bench.split_test import ScreenSplitTest
from trcvtui.blocks.conditions import Condition
from trcvtui.commands import words
from trcvtui.commands.edit import describe_edit, free_port, listening_ends, port_text
from trcvtui.commands.table import format_command, parse_line
from trcvtui.commands.words import EditCommand
from trcvtui.diagnosis.judges import RunJudge
from trcvtui.engine.project_edits import ProjectEdits, move_project
from trcvtui.engine.trigger_watch import TriggerWatch
from trcvtui.errors import UserError, mistake
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.messages import MessageRows, MessagesDelta
from trcvtui.history.pin_waveform import WaveformDelta
from trcvtui.history.records import MAX_SCAN
from trcvtui.history.stream_reader import StreamReader
from trcvtui.history.waveform_recorder import WaveformRecorder
from trcvtui.net.results import Endpoint
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.plc.ledger import Line
from trcvtui.plc.runtime import Runtime
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.project.edit import types_of_project
from trcvtui.project.file import reread_udts
from trcvtui.project.project import Project
from trcvtui.project.tables import quote
from trcvtui.scenario.player import Player, refuse_too_many_steps
from trcvtui.scenario.recorded_session import RecordedSession, parse_toml_path, scenario_text, write_new
from trcvtui.scenario.scenario import load_scenario, read_start_steps
from trcvtui.snapshots.bench import EngineTiming, LineAnswer
from trcvtui.snapshots.conversations import ConversationSnapshot
from trcvtui.udt.command import constants_of
from trcvtui.wording import count

if TYPE_CHECKING:
    from trcvtui.recording.black_box import BlackBox
    from trcvtui.recording.seam import Seam

# Rule: DATA keeps its types while it runs; `resize` takes a changed type into DATA, as a download does.

RELOAD, CONSTANT, IN_USE = "reload", "constant", "this type, which DATA has"
UDT_USAGE: Final = "udt reload, or udt constant NAME=VALUE; the rest of `udt` is for the screen's lab (L)"


def reload_types(rest: str, project: Project, where: str) -> tuple[Project, dict[str, int], str]:
    """Read the types again from their files. Return the project, the given constants and the message.

    `rest` has the words after `udt`. Raise UserError if a type used by DATA is now broken or missing.
    """
    word, _, pairs = rest.strip().partition(" ")
    if word not in (RELOAD, CONSTANT) or (word == RELOAD) == bool(pairs.strip()):
        raise mistake(where, quote(f"udt {rest}".strip()), UDT_USAGE)
    given = constants_of(pairs.split()) if word == CONSTANT else {}
    constants = {**project.constants, **given}
    fresh = replace(project, udts=reread_udts(project), constants=constants)
    if not fresh.udts:
        return fresh, given, "the project names no UDT files"
    types = types_of_project(fresh)
    names = project.types.types
    used = {decl.type_name.casefold() for decl in project.data} & names.keys()
    bad = [name for name in sorted(used) if name not in types.types]
    if bad:
        raise UserError(types.broken.get(bad[0]) or mistake(where, f"no {names[bad[0]][0]}", IN_USE).problems)
    read = types.types.keys() & types.senders.keys()
    message = f"{count(len(read), 'type')} read; `resize` takes a changed one into DATA"
    return replace(fresh, types=types), given, message


RESET_PIN: Final = "COM_RST"
LATCHED_PINS: Final = ("LEN", "ADHOC")  # read when a job starts, ADHOC where it does not act at once
CONNECTED, NO_EFFECT = "connected", "without effect"


def make_remark(command: words.BenchCommand, runtime: Runtime, adhoc_at_once: bool) -> str:
    """Return the remark on a command in the present state of the bench; "" for most commands."""
    match command:
        case words.PulsePin(name, "COM_RST"):
            return _reset_remark(runtime.instance_snapshot(name), runtime)
        case words.SetInputs(name, pins):
            instance = runtime.instance_snapshot(name)
            latched = LATCHED_PINS[: 1 if adhoc_at_once else None]
            remarks = [_latched_remark(instance, *pin) for pin in pins if pin[0] in latched]
            if any(pin == RESET_PIN and value for pin, value in pins):
                remarks.append(_reset_remark(instance, runtime))
            return "; ".join(filter(None, remarks))
    return ""


def _reset_remark(instance: InstanceSnapshot | None, runtime: Runtime) -> str:
    if instance is None:
        return ""
    is_up = runtime.link_snapshot(instance.connect).state == CONNECTED
    if not instance.pin("CONT") and (not is_up or instance.condition == Condition.NO_JOB):
        return f"{NO_EFFECT}: CONT is 0, and the edge is not remembered"
    return (
        "" if is_up else f"{NO_EFFECT}: {instance.connect} is not connected, and the edge is not remembered"
    )


def _latched_remark(instance: InstanceSnapshot | None, pin: str, value: object) -> str:
    if instance is None or not instance.need or instance.pin(pin) == value:
        return ""
    return f"from the next job on: the running job continues with {count(instance.need, 'byte')}"


MOST_ANSWERS: Final = 64
EDIT_COMMANDS: Final = (*words.EDIT_COMMANDS, words.CreateBlock, words.DeleteBlock, words.Retype)
MOST_DATA: Final = 65_536  # of one variable in a picture: as much as a job writes; more would block the pipe
SCAN_CONTROL: Final = ("hold", "go")
MARK: Final = "mark"
SAVE: Final = "save"
WATCH: Final = "watch"
UDT: Final = "udt"
FRAMING: Final = "framing"
SAVE_USAGE: Final = "save scenario FILE, save recording FILE, or save project [FILE] [!]"
RECORD: Final = "record"  # begins a recording, `record stop` ends it
RECORDING: Final = "recording"
BOX_OFF: Final = "[options] black_box on, no --record, and the run with which the screen began"
TRIGGER: Final = "trigger"
SCENARIO: Final = "scenario"
PROJECT: Final = "project"
SCENARIO_USAGE: Final = "load FILE.toml sim|live, step, run or stop"


def fresh_bench(project: Project, kernel: str, seam: Seam | None = None) -> Bench:
    """Return a bench before its first scan. The commands of `start` act in that scan."""
    bench = Bench(project, kernel, seam)
    for step in read_start_steps(project):
        bench.do(step.command)
    return bench


def _recording_path(name: str) -> Path:
    path = Path(os.path.expanduser(name))
    return path if path.suffix else path.with_suffix(".pcapng")


class Controller:
    """The bench for the screen. While `holding`, only the player's scans and `wanted` further scans run."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.player: Player | None = None
        self.holding = False
        self.wanted = 0
        self.recorded = self._wrong_recording = ""  # the state of a recording, and its last error
        self.kernel = ""  # the source of what is shown, if that is no bench's kernel
        self.over = ""  # why no more scans come
        self.shadows: frozenset[str] = frozenset()  # instances that follow conversations of other programs
        self.talks: Callable[[], tuple[ConversationSnapshot, ...]] = tuple  # these conversations
        self.black_box: BlackBox | None = None
        self.files_judge: Judge | None = None  # of files, packets or the black box
        self._line = 0, ""  # number and text of the line that is carried out
        self.watch: Callable[[str], str] | None = None  # gives an unassigned conversation shadows
        self._trials = ScreenSplitTest()
        self._begin_bench(bench)
        self._saved: set[str] = set()  # real paths of the files that were written from here
        self._message = self._edit = ""
        self._edits = ProjectEdits(bench.project)
        self._home_kernel = bench.kernel_name
        self._begun_with = 0  # the edits that the bench had before its first scan
        self._answers: deque[LineAnswer] = deque(maxlen=MOST_ANSWERS)
        self._bench_number = 0
        self._project = bench.project
        self._project_number = 0

    def _begin_bench(self, bench: Bench) -> None:
        self.begun_ns = clock.utc_ns() - bench.now if bench.kernel_name == "live" else None
        self._ledger = reader = LedgerReader(bench)
        self._history = StreamReader(bench, reader)
        self._messages = MessageRows(bench, reader, self._history.streams)
        self.trigger_watch = TriggerWatch(bench, reader)
        self._waves = WaveformRecorder(bench, reader)
        self._doctor = BenchDoctor()
        self.session = RecordedSession(bench, reader, self._waves)
        self.catch_up = reader.catch_up

    # -- lines -----------------------------------------------------------------------------------------

    def handle_line(self, number: int, line: str) -> None:
        self._message, self._edit, self._line = "", "", (number, line)
        self.catch_up()  # before the line changes the bench
        wrong = self._carry_out(line.strip())
        self._answers.append(LineAnswer(number, line, wrong, self._message, self._edit))

    def _carry_out(self, line: str) -> str:
        if line in SCAN_CONTROL:
            self.holding, self.wanted = line == "hold", 0
            self.bench.record_line(line)
            return ""
        try:
            verb, _, rest = line.partition(" ")
            if verb == SCENARIO:
                return self._handle_scenario(rest.strip())
            if verb == TRIGGER:
                self._message = self.trigger_watch.arm(rest, "prompt")
                return ""
            if line == MARK:
                self.session.restart_expectations()
                self._message = f"marked after scan {self.session.marked_at}"
                return ""
            if verb == WATCH and self.watch is not None:
                return self.watch(rest.strip())
            if verb == SAVE:
                return self._save(rest.strip())
            if verb == RECORD:
                return self._handle_record(rest.strip())
            if verb == UDT:
                return self._handle_udt(rest)
            if verb == FRAMING:
                return self._handle_framing(rest)
            command = parse_line(line, self.bench.project, "prompt")
        except UserError as error:
            return error.lines()[0]
        if command is None:
            return ""
        if isinstance(command, words.AddEntry) and command.port:
            command = self._with_free_port(command)
            line = format_command(command)
        try:
            wrong = self._run_command(command)
        except UserError as error:  # such as: no black box keeps the run
            return error.lines()[0]
        if not wrong and isinstance(command, EDIT_COMMANDS) and self.player is None:
            self._edit = line
        if not wrong and not isinstance(command, words.AskDoctor):
            self.session.keep_command(command, line)
        return wrong

    def _run_command(self, command: words.BenchCommand) -> str:
        match command:
            case words.RunScans(scans):
                return self._allow_scans(scans)
            case words.RunFor(ns):
                return self._allow_scans(ns // self.bench.runtime.interval_ns)
            case words.Expect(condition, None):
                return "" if holds(self.bench, condition) else f"found {describe_now(self.bench, condition)}"
            case words.TrySplits():
                return self._trials.begin(self.bench, command)
            case words.StopTrySplits():
                return self._trials.stop()
            case words.AddEntry() | words.AddVariable() | words.Change() | words.Remove() | words.UndoEdit():
                return self._edit_bench(command)
            case words.AskDoctor():
                judge = self.files_judge or RunJudge(self._require_box())
                self._message = self._doctor.ask(judge, self.bench, *self._line, command)
                return ""
            case words.Wait() | words.Expect() | words.ExpectTrace():
                return "waits and traces belong in a scenario file"
            case words.SetInputs() | words.PulsePin():
                at_once = self.bench.project.rules.adhoc_at_once
                remark = make_remark(command, self.bench.runtime, at_once)
                wrong = self.bench.do(command)
                self._message = "" if wrong else remark
                return wrong
            case _:
                return self.bench.do(command)

    def _with_free_port(self, command: words.AddEntry) -> words.AddEntry:
        [end] = listening_ends(command.with_it)[:1]
        port = command.port
        while not self.bench.is_free(Endpoint(end.address, port)):
            port = free_port(self.bench.project, port)
        typed = command.text.removesuffix(port_text(command.port))
        other = parse_line(typed + port_text(port), self.bench.project, "prompt")
        assert isinstance(other, words.AddEntry)
        return other

    def _edit_bench(self, command: EditCommand) -> str:
        message = describe_edit(command, self.bench.project)
        own_edit = None
        if self.player is None:
            try:
                own_edit = self._edits.parse_own_edit(command)  # a scenario never edits the opened project
            except UserError as error:
                return error.lines()[0]
        wrong = self.bench.do(command)
        if not wrong:
            self._message = message
            if own_edit is not None:
                self._edits.add_edit(own_edit)
        return wrong

    def _handle_udt(self, rest: str) -> str:
        if self.player is not None:
            return "the UDTs of a scenario are those of its own project"
        fresh, given, self._message = reload_types(rest, self.bench.project, "prompt")
        self.bench.record_line(f"{UDT} {rest}")
        self.bench.project = fresh
        self._edits.accept_types(fresh, given)
        return ""

    def _handle_framing(self, rest: str) -> str:
        from trcvtui.diagnosis.readings import framing_command as framing  # imported at its first use

        name, buffer, number = framing.parse_framing_words(rest, self.bench.project, "prompt")
        recording = self.bench.runtime.recording(buffer)
        if not number:
            self._message = framing.describe_framings(recording)
            return ""
        lines = framing.make_proposal_commands(recording, self.bench.project, name, number, "prompt")
        wrong = next(filter(None, map(self._carry_out, lines)), "")
        self._message = "; ".join(lines)
        return wrong

    def _allow_scans(self, scans: int) -> str:
        if not self.holding:
            return "scans are passing already; `hold` stops them"
        self.wanted += scans
        return ""

    # -- the session ------------------------------------------------------------------------------------

    def _handle_record(self, rest: str) -> str:
        box = self._require_box()
        if rest == "stop":
            self._message = box.stop_recording()
            return ""
        from trcvtui.recording.black_box import find_new_path

        stem = self.bench.project.path.stem or "recording"
        self._message = box.start_recording(_recording_path(rest) if rest else find_new_path(Path(), stem))
        return ""

    def report_recording(self, text: str, wrong: str) -> None:
        """Show the state of the recording in the header. Note a new recording error in the ledger."""
        self.recorded = text
        if wrong != self._wrong_recording:
            self._wrong_recording = wrong
            self.bench.note(RECORDING, wrong)

    def _require_box(self) -> BlackBox:
        if self.black_box is None and self.recorded:
            raise mistake(
                "prompt", "a run that --record records", "that recording, or a start without --record"
            )
        if self.black_box is None:
            raise mistake("prompt", "no black box for this run", BOX_OFF)
        return self.black_box

    def _save(self, rest: str) -> str:
        """Write the project, the black box, or the session as a scenario."""
        what, _, name = rest.partition(" ")
        if what == RECORDING and name.strip():
            self._message = self._require_box().save(_recording_path(name.strip()))
            return ""
        if what != PROJECT and (what != SCENARIO or not name.strip()):
            raise mistake("prompt", f"'{SAVE} {rest}'", SAVE_USAGE)
        if self.player is not None:
            raise mistake(
                "prompt", "a scenario on the bench", "a session of your own: leave the scenario first"
            )
        if what == PROJECT:
            self._message = self._edits.save(name)
            self.bench.project = move_project(self.bench.project, self._edits.project.path)
            return ""
        before = None
        if self._edits.saved != self._begun_with:
            before = self._edits.before
            if before is None:
                found = "a session that began with unsaved additions"
                raise mistake("prompt", found, "a session begun after `save project`: open the file again")
        elif self._edits.read_file_text() != self._edits.text:
            before = self._edits.text
        path = parse_toml_path(name, "prompt")
        text = scenario_text(self.session, self.bench, path, before)
        self._saved.add(write_new(path, text, self._saved, "prompt"))
        size = f"{count(self.session.commands, 'command')}, {count(self.bench.runtime.scans, 'scan')}"
        self._message = f"{size} in {path.absolute()}{self.session.external_partners().warning}"
        return ""

    # -- a scenario ------------------------------------------------------------------------------------

    def _handle_scenario(self, rest: str) -> str:
        if rest in ("step", "run"):
            return self._play(rest)
        if rest == "stop":
            if self.player is not None:
                self._leave_scenario()
            return ""
        file, _, kernel = rest.removeprefix("load ").rpartition(" ")
        if not rest.startswith("load ") or not file.strip() or kernel not in KERNEL_NAMES:
            raise mistake("prompt", f"'{SCENARIO} {rest}'", f"{SCENARIO} {SCENARIO_USAGE}")
        self._load_scenario(file.strip(), kernel)
        return ""

    def _play(self, how: str) -> str:
        if self.player is None:
            return f"no scenario is loaded; `{SCENARIO} load FILE.toml sim` loads one"
        if self.player.is_finished:
            return "the scenario is over; loading it again begins anew"
        self.player.start_to_end() if how == "run" else self.player.request_step()
        return ""

    def _load_scenario(self, file: str, kernel: str) -> None:
        scenario = load_scenario(Path(file))
        refuse_too_many_steps(file, scenario)
        self.bench.close()  # first: both may want the same port
        try:
            self._switch_bench(Bench(scenario.project, kernel))
        except UserError:
            self._leave_scenario()
            raise
        self.player, self.holding = Player(file, scenario, self.bench), True

    def _leave_scenario(self) -> None:
        self.bench.close()
        self._switch_bench(fresh_bench(self._edits.project, self._home_kernel))
        self._begun_with = self._edits.done
        self._edits.note_new_bench()

    def _switch_bench(self, bench: Bench) -> None:
        self.bench, self.player, self.recorded = bench, None, ""
        self._begin_bench(bench)
        self.holding, self.wanted = False, 0
        self._trials = ScreenSplitTest()
        self._bench_number += 1

    # -- scans -----------------------------------------------------------------------------------------

    @property
    def hurries(self) -> bool:
        """Return True while a simulated scenario plays to its end. Scans then run as fast as possible."""
        player = self.player
        simulated = self.bench.kernel_name == "sim"
        return player is not None and simulated and player.is_to_end and player.wants_scan

    def scan(self, now: int | None = None) -> bool:
        """Run the next scan if `holding` allows it. Then let the readers of the ledger catch up."""
        passed = self.step(now)
        self.catch_up()
        return passed

    def step(self, now: int | None = None) -> bool:
        """Run the next scan if `holding` allows it, and return whether it ran. The ledger is read later."""
        if not self._use_scan_permit():
            return False
        self.bench.step(now)
        if self.trigger_watch.armed_text:
            fired = self.trigger_watch.check_scan()
            if fired is not None and fired.holds:
                self.holding, self.wanted = True, 0
        if self.player is not None:
            self.player.handle_scan()
        self._trials.advance()
        return True

    def _use_scan_permit(self) -> bool:
        if not self.holding or (self.player is not None and self.player.wants_scan):
            return True
        if self.wanted == 0:
            return False
        self.wanted -= 1
        return True

    def step_peers_alone(self) -> None:
        """While no scan runs, let the peers of a live bench work; simulated time stops without scans."""
        if self.bench.kernel_name == "live":
            self.bench.step_peers_alone()

    # -- pictures --------------------------------------------------------------------------------------

    def take_answers(self) -> tuple[LineAnswer, ...]:
        """Return the answers since the last call."""
        answers = tuple(self._answers)
        self._answers.clear()
        return answers

    def picture(self, request: UpdateRequest, timing: EngineTiming, most_lines: int) -> BenchUpdate:
        """Return the bench after its last scan, with at most `most_lines` new ledger lines, the newest."""
        runtime, ledger = self.bench.runtime, self.bench.runtime.ledger
        known = request.bench == self._bench_number
        since = request.since_seq if known else 0
        data_of, partial_of = (request.data, request.partial_of) if known else ((), ())
        self._answers.extend(self._doctor.advance(self.files_judge, self.bench, request.doctor))
        internal = self.bench.containment.take_messages()
        if internal:
            self.report_problem(internal)
        if self._project is not self.bench.project:
            self._project = self.bench.project
            self._project_number += 1
        kept = self.trigger_watch.take_frozen() if known else None
        lines, last = ledger.lines_since(since, min(most_lines, request.most_lines)), ledger.last_seq
        wanted = request.history
        if kept:  # a trigger has fired: the picture is of its scan
            last = kept.snapshot.ledger_seq
            numbered = enumerate(kept.events, last - len(kept.events) + 1)
            lines = tuple([Line(seq, *item) for seq, item in numbered if seq > since])
            wanted = replace(wanted, scan=kept.snapshot.scan) if wanted else None
        return BenchUpdate(
            snapshot=kept.snapshot if kept else runtime.snapshot(self.bench.faults()),
            lines=lines,
            lines_skipped=max(0, last - since - len(lines)),
            data=kept.data if kept else tuple((name, runtime.data(name, MOST_DATA)) for name in data_of),
            partial=kept.partial if kept else tuple((name, runtime.job_bytes(name)) for name in partial_of),
            peers=kept.peers if kept else self.bench.peer_snapshots(),
            answers=self.take_answers(),
            timing=timing,
            holding=self.holding,
            kernel=self.kernel or self.bench.kernel_name,
            over=self.over,
            bench=self._bench_number,
            project_number=self._project_number,
            project=None if request.project == self._project_number else self._project,
            player=self.player.snapshot() if self.player is not None else None,
            trial=self._trials.snapshot() or (self.player.find_trial() if self.player is not None else None),
            waves=self._wave_news(request.waves, known),
            history=self._history.read_window(wanted) if wanted and known else None,
            unsaved=self._edits.unsaved_count,
            unsaved_word=self._edits.unsaved_noun,
            recordings=tuple((name, runtime.recording(name)) for name in request.recordings_of if known),
            facts=kept.facts if kept else self.trigger_watch.facts(partial_of),
            recorded=self.recorded,
            is_recording=self.black_box is not None and self.black_box.is_recording,
            armed=self.trigger_watch.armed_text if known else "",
            fired=kept.fired if kept else None,
            shadows=self.shadows,
            talks=self.talks(),
            doctor=self._doctor.snapshot,
            messages=self._message_news(request, kept.snapshot.scan if kept else MAX_SCAN) if known else None,
            begun_ns=self.begun_ns,
        )

    def _message_news(self, request: UpdateRequest, scan: int) -> MessagesDelta | None:
        if request.messages is None:
            return None
        instance, since, until = request.messages
        return self._messages.make_delta(instance, since, min(until, scan))

    def report_problem(self, text: str) -> None:
        """Show a problem that no typed line has caused."""
        self._answers.append(LineAnswer(0, "", text))

    def _wave_news(self, asked: tuple[tuple[str, int], ...], known: bool) -> tuple[WaveformDelta, ...]:
        ledger = self.bench.runtime.ledger
        now = ledger.scan, ledger.t_ns
        news = (self._waves.make_delta(name, number if known else 0, now) for name, number in asked)
        return tuple(fresh for fresh in news if fresh is not None)
