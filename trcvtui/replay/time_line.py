"""A recording on the screen: a bench at a scan of the recording. Commands, not the clock, choose the scan.

Rule 1: a shown scan is replayed from a keyframe well before that scan, or from scan 1.
Rule 2: all work is done in slices; between two slices the newest command line says where to go.
Rule 3: a command that would change a bench is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from msgspec.structs import replace

from trcvtui import clock
from trcvtui.bench.doctor_requests import BenchDoctor, Judge
from trcvtui.diagnosis.judges import FilesJudge
from trcvtui.engine.controller import Controller
from trcvtui.errors import UserError, mistake
from trcvtui.files import FilesRead, substitute_disk
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.messages import MessagesDelta, NewestRows
from trcvtui.history.pin_waveform import WaveformDelta, cut_delta
from trcvtui.history.waveform_recorder import WaveformRecorder
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.project.project import Project
from trcvtui.project.tables import quote
from trcvtui.recording.recording import Recording
from trcvtui.replay.all_messages import AllMessagesReader, RowsWithScans
from trcvtui.replay.keyframes import Journal, Keyframes
from trcvtui.replay.run_again import ReplayRun
from trcvtui.replay.survey import END, FIRST_EVENT, Search, Survey, parse_place
from trcvtui.replay.what_if import Change, WhatIf
from trcvtui.snapshots.bench import EngineTiming
from trcvtui.snapshots.replay import CANNOT_CHANGE_TEXT, WHAT_IF, ReplayPosition
from trcvtui.udt.literals import parse_time

MOVE_VERBS: Final = frozenset(("at", "speed", "hold", "go", "run", "if"))  # lines that move
VIEW_VERBS: Final = frozenset(("trigger", "expect", "doctor"))  # lines that change nothing
SPEEDS: Final = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0, float("inf"))
FASTEST_NAME: Final = "fastest"
LEAST_SCANS_BEFORE: Final = 500  # scans that run before the one that is shown: panes show them, too


class WhatIfRun:
    """The run with another parameter, up to its last scan so far. `text` is what you typed after `if`."""

    def __init__(self, run: WhatIf, text: str) -> None:
        self.run, self.is_over = run, False
        self._text = text
        self._seen: tuple[LedgerReader, WaveformRecorder] | None = None

    def advance(self, deadline_ns: int) -> None:
        while not self.is_over and clock.now_ns() < deadline_ns:
            reader, _ = self._get_readers()
            self.is_over = not self.run.scan()
            reader.catch_up()

    def _get_readers(self) -> tuple[LedgerReader, WaveformRecorder]:
        if self._seen is None:
            reader = LedgerReader(self.run.what_if)
            self._seen = reader, WaveformRecorder(self.run.what_if, reader)
        return self._seen

    def describe(self) -> tuple[str, ...]:
        if not self.is_over:
            return (f"what if {self._text}: scan {self.run.what_if.runtime.scans} ..",)
        first, *rest = self.run.describe()
        return (f"what if {self._text}: {first}", *rest, *filter(None, [self.run.trouble]))

    def make_wave_delta(self, name: str, number: int, scan: int, t_ns: int) -> WaveformDelta | None:
        """Return the changes of an instance after its change `number`, up to a scan."""
        ledger, (_, waves) = self.run.what_if.runtime.ledger, self._get_readers()
        news = waves.make_delta(name.removeprefix(WHAT_IF), number, (ledger.scan, ledger.t_ns))
        known = cut_delta(news, scan, t_ns) if news is not None else None
        return replace(known, instance=name) if known is not None else None


class ReplayController(Controller):
    """The bench of a replay as the screen sees it; `move` carries out MOVE_VERBS."""

    def __init__(
        self, run: ReplayRun, move: Callable[[str], str], doctor: tuple[BenchDoctor, Judge | None]
    ) -> None:
        with substitute_disk(FilesRead()):  # a replay has no file on the disk to save
            super().__init__(run.bench)
        self._doctor, self.files_judge = doctor  # one for all benches that take each other's place
        self.run = run
        self._move = move
        self.holding = True
        self.position: ReplayPosition | None = None
        self.beside: WhatIfRun | None = None
        self.messages: AllMessagesReader | RowsWithScans | None = None
        self.fired = ""  # the trigger that fired in the last scan

    @property
    def scans(self) -> int:
        return self.bench.runtime.scans

    @property
    def armed_trigger(self) -> str:
        """Return the text of the armed trigger, "" for none."""
        return self.trigger_watch.armed_text

    def step(self, now: int | None = None) -> bool:
        passed = self.run.scan()
        if self.armed_trigger:
            fired = self.trigger_watch.check_scan()
            if fired is not None:
                self.trigger_watch.take_frozen()  # not needed: the replay stops at this scan
                self.fired = fired.text
        return passed

    def disarm(self) -> None:
        self.fired = ""
        if self.armed_trigger:
            self.trigger_watch.arm("off", "")

    def continue_from(self, before: Controller) -> None:
        self._answers.extend(before._answers)
        self._bench_number = before._bench_number + 1
        self._project_number = before._project_number + 1

    def _carry_out(self, line: str) -> str:
        verb, _, rest = line.partition(" ")
        if verb in MOVE_VERBS:
            try:
                self._message = self._move(line)
            except UserError as wrong:
                return wrong.lines()[0]
            return ""
        if verb in VIEW_VERBS or (verb == "framing" and len(rest.split()) == 1):
            return super()._carry_out(line)
        return CANNOT_CHANGE_TEXT

    def _wave_news(self, asked: tuple[tuple[str, int], ...], known: bool) -> tuple[WaveformDelta, ...]:
        waves = super()._wave_news(tuple(each for each in asked if not each[0].startswith(WHAT_IF)), known)
        beside, ledger = self.beside, self.bench.runtime.ledger
        if beside is None:
            return waves
        others = (
            beside.make_wave_delta(name, number if known else 0, ledger.scan, ledger.t_ns)
            for name, number in asked
            if name.startswith(WHAT_IF)
        )
        return (*waves, *(other for other in others if other is not None))

    def _message_news(self, request: UpdateRequest, scan: int) -> MessagesDelta | None:
        """Return rows of the whole recording, whichever scan the replay shows."""
        if request.messages is None or self.messages is None:
            return None
        return self.messages.make_delta(*request.messages[:2])

    def picture(self, request: UpdateRequest, timing: EngineTiming, most_lines: int) -> BenchUpdate:
        """Return the bench after its last scan, with the position in the recording."""
        picture = super().picture(request, timing, most_lines)
        of = "replay" if self.position is None or self.position.first_ns is None else "capture"
        last = 0 if self.position is None else self.position.last_scan  # the doctor has seen all of it
        doctor = replace(picture.doctor, scan=last)
        return replace(picture, position=self.position, kernel=of, doctor=doctor)


class CaptureRun(NamedTuple):
    """A run made from a capture. The instances `shadows` only observe. `first_ns` is UTC of packet 1."""

    project: Project
    shadows: frozenset[str]
    first_ns: int
    notes: tuple[str, ...]
    change: Change  # the project with other parameters
    judge: FilesJudge
    rows: NewestRows | None = None


class ReplayNavigator:
    """The scan that a replay shows, and the scan to which it goes."""

    def __init__(
        self, journal: Journal, where: str, at: int | Search = 1, capture: CaptureRun | None = None
    ) -> None:
        self._journal, self.where, self._capture = journal, where, capture
        self._keyframes = keyframes = Keyframes(journal, where, capture.project if capture else None)
        self.survey = Survey(journal.read_entries(), where, keyframes.first, keyframes.offset)
        judge = FilesJudge(lambda: (journal.path,)) if isinstance(journal, Recording) else None
        self._judge = judge = capture.judge if capture is not None else judge
        self._wants_findings, self.survey.is_judged = False, judge is None
        self._doctor = BenchDoctor(), judge
        self.controller = ReplayController(keyframes.start_run(), self._run_line, self._doctor)
        self._coming: ReplayController | None = None  # the bench that runs to the goal from a keyframe
        self._wanted = self._least = keyframes.first + 1
        self._search: Search | None = None
        self._speed = SPEEDS.index(1.0)
        self._since: tuple[int, int] | None = None  # while it plays: the clock and the run's time, ns
        self._note = ""
        self._beside: WhatIfRun | None = None
        self._messages: AllMessagesReader | RowsWithScans | None = None  # once a screen asks for them
        self._set_goal(at)

    # -- lines -----------------------------------------------------------------------------------------

    def handle_line(self, number: int, line: str) -> None:
        self._note = ""
        self.controller.handle_line(number, line)
        if line.startswith("trigger ") and self.controller.armed_trigger:
            self.controller.holding, self._since, self._search = True, None, None
            self._wanted = END

    def _run_line(self, line: str) -> str:
        verb, _, rest = line.partition(" ")
        rest = rest.strip()
        if verb == "speed":
            return self._set_speed(rest)
        if verb == "if":
            return self._set_what_if(rest)
        if verb == "go":
            self._stop_moving()
            self._start_playing()
            return ""
        if verb == "hold":
            self._stop_moving()
            self._wanted = self.controller.scans
            return ""
        if verb == "run" and "#" in rest:
            self._set_goal(("time", self.survey.time_of(self._wanted) + parse_time(rest, "prompt"), ""))
        elif verb == "run" or rest[:1] in ("+", "-"):
            if not rest.lstrip("+-").isdecimal():
                raise mistake("prompt", quote(line), "a number of scans")
            self._set_goal(
                max(self._least, (self._wanted if self._wanted < END else self.controller.scans) + int(rest))
            )
        else:
            self._set_goal(parse_place(rest, "prompt"))
        return ""

    def _set_what_if(self, rest: str) -> str:
        self._beside = None
        verb, _, name = rest.partition(" ")
        if rest != "off":
            sets, dialect = ([], name.strip()) if verb == "dialect" else ([rest], None)
            if dialect is None and "=" not in rest:
                raise mistake("prompt", quote(f"if {rest}"), "if instance.X.LEN=20, if dialect NAME, if off")
            change = self._capture.change if self._capture is not None else None
            self._beside = WhatIfRun(WhatIf(self._keyframes, sets, dialect, change), rest)
        return ""

    def _set_goal(self, to: int | Search) -> None:
        self._stop_moving()
        if isinstance(to, int):
            self._wanted = max(self._least, to)
        else:
            self._search = to
            self._wants_findings |= to[0] in ("error", FIRST_EVENT[0])

    def _stop_moving(self) -> None:
        self.controller.disarm()
        self.controller.holding, self._since, self._search = True, None, None

    def _set_speed(self, rest: str) -> str:
        names = [_format_speed(speed) for speed in SPEEDS]
        if rest in ("+", "-"):
            self._speed = max(0, min(len(SPEEDS) - 1, self._speed + int(f"{rest}1")))
        elif rest in names:
            self._speed = names.index(rest)
        else:
            raise mistake("prompt", quote(f"speed {rest}"), "+, -, or one of " + ", ".join(names))
        if self._since is not None:
            self._start_playing()
        return names[self._speed]

    def _start_playing(self) -> None:
        self._wanted = self.controller.scans
        self.controller.holding = False
        self._since = clock.now_ns(), self.survey.time_of(self._wanted)

    # -- moving ----------------------------------------------------------------------------------------

    def advance(self, deadline_ns: int) -> bool:
        """Move or read on in the recording until this time of the clock; return whether work remains."""
        self._update_goal()
        if self._move(deadline_ns):
            return True
        if self._beside is not None and not self._beside.is_over:
            self._advance_what_if(self._beside, deadline_ns)
            return True
        if not self.survey.is_over:
            self.survey.advance(deadline_ns)
            return True
        if isinstance(self._messages, AllMessagesReader) and not self._messages.is_over:
            self._messages.advance(deadline_ns)
            return True
        return self._goal_scan() != self.controller.scans  # the doctor is another process

    def _advance_what_if(self, beside: WhatIfRun, deadline_ns: int) -> None:
        beside.advance(deadline_ns)
        if beside.is_over and beside.run.parts_at is not None:
            self._set_goal(beside.run.parts_at)

    @property
    def is_playing(self) -> bool:
        return self._since is not None

    def _goal_scan(self) -> int:
        # A jump waits for the survey; what visits each scan sees its end itself.
        is_unknown = self._wanted > self.survey.last_scan and not self.survey.is_over
        if is_unknown and not self._visits_each_scan:
            return self.controller.scans
        return min(self._wanted, self.survey.last_scan)

    @property
    def _visits_each_scan(self) -> bool:
        return self.is_playing or bool(self.controller.armed_trigger)

    def _update_goal(self) -> None:
        survey = self.survey
        if survey.is_over and not survey.is_judged and self._doctor[0].snapshot.looks:
            for one in self._doctor[0].snapshot.findings:
                if one.scan or one.t_ns:
                    scan = min(one.scan or survey.scan_at(one.t_ns or 0), survey.last_scan)
                    survey.findings.setdefault(max(self._least, scan), one.cause)
            survey.is_judged = True
        if self._since is not None:
            began, t_ns = self._since
            speed = SPEEDS[self._speed]
            now = t_ns + int((clock.now_ns() - began) * speed) if speed < END else None
            self._wanted = END if now is None else max(self._wanted, survey.scan_at(now + 1) - 1)
        if self._search is not None:
            found = survey.find_scan(self._search, self._wanted)
            if found is None:
                return
            _, step, name = self._search
            self._search = None
            if found == END:
                which = "later" if step > 0 else "earlier"
                self._note = f"no {which} {f'edge of {name}' if name else 'ERROR or finding'}"
                self._note += f"; {trouble}" if (trouble := self._doctor[0].snapshot.trouble) else ""
            else:
                self._wanted = found
                if not name and found in survey.findings:
                    self._note = f"finding: {survey.findings[found]} (J)"
        if survey.is_over and self._wanted >= survey.last_scan:
            self._wanted = survey.last_scan
            if self.controller.scans >= survey.last_scan:
                self._handle_end()

    def _handle_end(self) -> None:
        if self._since is not None:
            self._stop_moving()
        if self.controller.armed_trigger:
            self._note = f"end of the run: trigger {self.controller.armed_trigger} did not fire"
            self.controller.disarm()

    def _move(self, deadline_ns: int) -> bool:
        goal, at = self._goal_scan(), self.controller.scans
        start = self._keyframes.find_keyframe_scan(0 if self._visits_each_scan else goal - LEAST_SCANS_BEFORE)
        if start <= at <= goal:
            self._coming = None
        elif self._coming is None or not start <= self._coming.scans <= goal:
            self._coming = ReplayController(self._keyframes.restore_at(start), self._run_line, self._doctor)
        moving = self._coming or self.controller
        has_moved = moving.scans < goal
        while moving.scans < goal and clock.now_ns() < deadline_ns:
            before = moving.scans
            moving.run.limit = goal
            try:
                moving.scan()
                if moving.scans == before:  # the survey counts scans that the run does not reach
                    raise moving.run.make_end_error()
            except UserError as wrong:
                self.survey.end_after(before, str(wrong))
                self._coming = None
                fresh = ReplayController(self._keyframes.restore_at(start), self._run_line, self._doctor)
                fresh.continue_from(self.controller)
                self.controller = fresh
                return True
            self._keyframes.keep_if_due(moving.run)
            if moving.fired:
                self._note = f"trigger {moving.fired}"
                self._stop_moving()
                self._wanted = goal = moving.scans
        if self._coming is not None and self._coming.scans == goal:
            self._coming.continue_from(self.controller)
            self.controller, self._coming = self._coming, None
        return has_moved

    def _make_message_reader(self) -> AllMessagesReader | RowsWithScans:
        """Return the reader of the messages of the whole recording."""
        journal, capture = self._journal, self._capture
        if capture is not None and capture.rows is not None:
            return RowsWithScans(capture.rows, self.survey)
        path = str(journal.path) if capture is None and isinstance(journal, Recording) else ""
        return AllMessagesReader(self._keyframes, self.survey, path)

    def close(self) -> None:
        if self._judge is not None:
            self._judge.close()

    def make_picture(self, request: UpdateRequest) -> BenchUpdate:
        survey, controller, beside = self.survey, self.controller, self._beside
        if request.messages is not None and self._messages is None:
            self._messages = self._make_message_reader()
        controller.beside, controller.messages = beside, self._messages
        controller.shadows = self._capture.shadows if self._capture else frozenset()
        controller.begun_ns = self._capture.first_ns if self._capture else controller.run.begins.wall_ns
        controller.position = ReplayPosition(
            controller.scans,
            survey.last_scan,
            self.survey.time_of(controller.scans),
            survey.times[-1] if survey.times else 0,
            survey.is_over,
            self._wanted if self._search is None else END,
            _format_speed(SPEEDS[self._speed]),
            len(survey.errors),
            survey.make_error_marks(),
            survey.first,
            self._note or survey.trouble,
            beside.describe() if beside is not None else (),
            beside.run.parts_at or 0 if beside is not None else 0,
            self._capture.first_ns if self._capture else None,
            (*self._capture.notes, *survey.notes_before(controller.scans)) if self._capture else (),
        )
        wants = self._wants_findings and survey.is_over and not survey.is_judged
        request = replace(request, doctor=request.doctor or wants)
        return controller.picture(request, EngineTiming(mode="replay"), request.most_lines)


def _format_speed(speed: float) -> str:
    return f"{speed:g}x" if speed < END else FASTEST_NAME
