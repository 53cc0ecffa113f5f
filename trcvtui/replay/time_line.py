"""A recording on the screen: a bench that stands at a scan of it, and moves by lines instead of the clock.

Rule 1: what is shown has run again from the recording: from a keyframe well before it, or from scan 1.
Rule 2: all work is done in slices; between two of them the newest line says where to go.
Rule 3: nothing here changes a bench: a command that would is told so.
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
from trcvtui.files import FilesRead, reading_only
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.messages import KeptRows, MessagesDelta
from trcvtui.history.pin_waveform import WaveformDelta, up_to
from trcvtui.history.waveform_recorder import WaveformRecorder
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.project.project import Project
from trcvtui.project.tables import quote
from trcvtui.recording.recording import Recording
from trcvtui.replay.all_messages import AllMessages, TimedRows
from trcvtui.replay.keyframes import Journal, Keyframes
from trcvtui.replay.run_again import ReplayRun
from trcvtui.replay.survey import END, FIRST, Search, Survey, read_at
from trcvtui.replay.what_if import Change, WhatIf
from trcvtui.snapshots.bench import EngineTiming
from trcvtui.snapshots.replay import CANNOT_CHANGE_TEXT, WHAT_IF, ReplayPosition
from trcvtui.udt.literals import parse_time

MOVES: Final = frozenset(("at", "speed", "hold", "go", "run", "if"))  # lines that move
LOOKS: Final = frozenset(("trigger", "expect", "doctor"))  # lines that look only
SPEEDS: Final = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0, float("inf"))
FASTEST: Final = "fastest"
LEAST_SEEN: Final = 500  # scans before the one that is shown: what panes tell of earlier


class WhatIfRun:
    """The run with another parameter, as far as it has run; `asked` is what was said at the prompt."""

    def __init__(self, run: WhatIf, asked: str) -> None:
        self.run, self.is_over = run, False
        self._asked = asked
        self._seen: tuple[LedgerReader, WaveformRecorder] | None = None

    def go_on(self, until: int) -> None:
        while not self.is_over and clock.now_ns() < until:
            reader, _ = self._looking_on()
            self.is_over = not self.run.scan()
            reader.catch_up()

    def _looking_on(self) -> tuple[LedgerReader, WaveformRecorder]:
        if self._seen is None:
            reader = LedgerReader(self.run.what_if)
            self._seen = reader, WaveformRecorder(self.run.what_if, reader)
        return self._seen

    def lines(self) -> tuple[str, ...]:
        if not self.is_over:
            return (f"what if {self._asked}: scan {self.run.what_if.runtime.scans} ..",)
        first, *rest = self.run.summary()
        return (f"what if {self._asked}: {first}", *rest, *filter(None, [self.run.trouble]))

    def wave(self, name: str, number: int, scan: int, t_ns: int) -> WaveformDelta | None:
        """Return what is new of an instance up to a scan, after its change `number`."""
        ledger, (_, waves) = self.run.what_if.runtime.ledger, self._looking_on()
        asked = name.removeprefix(WHAT_IF)
        news = waves.news(asked, number, (ledger.scan, ledger.t_ns))
        known = up_to(news, scan, t_ns) if news is not None else None
        return replace(known, instance=name) if known is not None else None


class ReplayController(Controller):
    """The bench of a replay as the screen sees it; `move` carries out the lines that move."""

    def __init__(
        self, run: ReplayRun, move: Callable[[str], str], doctor: tuple[BenchDoctor, Judge | None]
    ) -> None:
        with reading_only(FilesRead()):  # what is replayed is not saved: no name of its reaches the disk
            super().__init__(run.bench)
        self._doctor, self.files_judge = doctor  # one for all benches that take each other's place
        self.run = run
        self._move = move
        self.holding = True
        self.position: ReplayPosition | None = None
        self.beside: WhatIfRun | None = None
        self.messages: AllMessages | TimedRows | None = None
        self.fired = ""  # the trigger that fired in the last scan

    @property
    def at(self) -> int:
        return self.bench.runtime.scans

    @property
    def armed(self) -> str:
        """Return the trigger that is looked for, "" for none."""
        return self.trigger_watch.armed

    def step(self, now: int | None = None) -> bool:
        passed = self.run.scan()
        if self.armed:
            fired = self.trigger_watch.scanned()
            if fired is not None:
                self.trigger_watch.take_kept()  # it stands at this very scan
                self.fired = fired.text
        return passed

    def disarm(self) -> None:
        self.fired = ""
        if self.armed:
            self.trigger_watch.arm("off", "")

    def follow(self, before: Controller) -> None:
        self._answers.extend(before._answers)
        self._bench_number = before._bench_number + 1
        self._project_number = before._project_number + 1

    def _carry_out(self, line: str) -> str:
        verb, _, rest = line.partition(" ")
        if verb in MOVES:
            try:
                self._told = self._move(line)
            except UserError as wrong:
                return wrong.lines()[0]
            return ""
        if verb in LOOKS or (verb == "framing" and len(rest.split()) == 1):
            return super()._carry_out(line)
        return CANNOT_CHANGE_TEXT

    def _wave_news(self, asked: tuple[tuple[str, int], ...], known: bool) -> tuple[WaveformDelta, ...]:
        waves = super()._wave_news(tuple(each for each in asked if not each[0].startswith(WHAT_IF)), known)
        beside, ledger = self.beside, self.bench.runtime.ledger
        if beside is None:
            return waves
        others = (
            beside.wave(name, number if known else 0, ledger.scan, ledger.t_ns)
            for name, number in asked
            if name.startswith(WHAT_IF)
        )
        return (*waves, *(other for other in others if other is not None))

    def _message_news(self, request: UpdateRequest, scan: int) -> MessagesDelta | None:
        """Return rows of the whole recording, wherever it stands."""
        if request.messages is None or self.messages is None:
            return None
        return self.messages.news(*request.messages[:2])

    def picture(self, request: UpdateRequest, timing: EngineTiming, most_lines: int) -> BenchUpdate:
        """Return the bench after its last scan, with the position in the recording."""
        picture = super().picture(request, timing, most_lines)
        of = "replay" if self.position is None or self.position.first_ns is None else "capture"
        last = 0 if self.position is None else self.position.last_scan  # the doctor has seen all of it
        doctor = replace(picture.doctor, scan=last)
        return replace(picture, position=self.position, kernel=of, doctor=doctor)


class CaptureRun(NamedTuple):
    """A run that came of a capture: who looks on, UTC of its first packet in ns, what is told beside.

    `rows`: the messages, where the shadows do not know where they end.
    """

    project: Project
    shadows: frozenset[str]
    first_ns: int
    notes: tuple[str, ...]
    change: Change  # the project with other parameters
    judge: FilesJudge
    rows: KeptRows | None = None


class TimeLine:
    """Where a replay stands and where it goes."""

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
        self.controller = ReplayController(keyframes.begin(), self._obey, self._doctor)
        self._coming: ReplayController | None = None  # on its way, from the first scan or a keyframe
        self._wanted = self._least = keyframes.first + 1
        self._search: Search | None = None
        self._speed = SPEEDS.index(1.0)
        self._since: tuple[int, int] | None = None  # while it plays: the clock and the run's time, ns
        self._note = ""
        self._beside: WhatIfRun | None = None
        self._messages: AllMessages | TimedRows | None = None  # once somebody asks for them
        self._go(at)

    # -- lines -----------------------------------------------------------------------------------------

    def take(self, number: int, line: str) -> None:
        self._note = ""
        self.controller.take(number, line)
        if line.startswith("trigger ") and self.controller.armed:
            self.controller.holding, self._since, self._search = True, None, None
            self._wanted = END

    def _obey(self, line: str) -> str:
        verb, _, rest = line.partition(" ")
        rest = rest.strip()
        if verb == "speed":
            return self._set_speed(rest)
        if verb == "if":
            return self._run_beside(rest)
        if verb == "go":
            self._stop()
            self._play()
            return ""
        if verb == "hold":
            self._stop()
            self._wanted = self.controller.at
            return ""
        if verb == "run" and "#" in rest:
            self._go(("time", self.survey.time_of(self._wanted) + parse_time(rest, "prompt"), ""))
        elif verb == "run" or rest[:1] in ("+", "-"):
            if not rest.lstrip("+-").isdecimal():
                raise mistake("prompt", quote(line), "a number of scans")
            self._go(
                max(self._least, (self._wanted if self._wanted < END else self.controller.at) + int(rest))
            )
        else:
            self._go(read_at(rest, "prompt"))
        return ""

    def _run_beside(self, rest: str) -> str:
        self._beside = None
        verb, _, name = rest.partition(" ")
        if rest != "off":
            sets, dialect = ([], name.strip()) if verb == "dialect" else ([rest], None)
            if dialect is None and "=" not in rest:
                raise mistake("prompt", quote(f"if {rest}"), "if instance.X.LEN=20, if dialect NAME, if off")
            change = self._capture.change if self._capture is not None else None
            self._beside = WhatIfRun(WhatIf(self._keyframes, sets, dialect, change), rest)
        return ""

    def _go(self, to: int | Search) -> None:
        self._stop()
        if isinstance(to, int):
            self._wanted = max(self._least, to)
        else:
            self._search = to
            self._wants_findings |= to[0] in ("error", FIRST[0])

    def _stop(self) -> None:
        self.controller.disarm()
        self.controller.holding, self._since, self._search = True, None, None

    def _set_speed(self, rest: str) -> str:
        names = [_speed_text(speed) for speed in SPEEDS]
        if rest in ("+", "-"):
            self._speed = max(0, min(len(SPEEDS) - 1, self._speed + int(f"{rest}1")))
        elif rest in names:
            self._speed = names.index(rest)
        else:
            raise mistake("prompt", quote(f"speed {rest}"), "+, -, or one of " + ", ".join(names))
        if self._since is not None:
            self._play()
        return names[self._speed]

    def _play(self) -> None:
        self._wanted = self.controller.at
        self.controller.holding = False
        self._since = clock.now_ns(), self.survey.time_of(self._wanted)

    # -- moving ----------------------------------------------------------------------------------------

    def work(self, until: int) -> bool:
        """Move, or look through the recording, until this moment; return whether there is more to do."""
        self._look()
        if self._move(until):
            return True
        if self._beside is not None and not self._beside.is_over:
            self._go_on_beside(self._beside, until)
            return True
        if not self.survey.is_over:
            self.survey.go_on(until)
            return True
        if isinstance(self._messages, AllMessages) and not self._messages.is_over:
            self._messages.go_on(until)
            return True
        return self._goal() != self.controller.at  # for the doctor nothing here has to be done

    def _go_on_beside(self, beside: WhatIfRun, until: int) -> None:
        beside.go_on(until)
        if beside.is_over and beside.run.parts_at is not None:
            self._go(beside.run.parts_at)

    @property
    def plays(self) -> bool:
        return self._since is not None

    def _goal(self) -> int:
        is_unknown = self._wanted > self.survey.last and not self.survey.is_over
        if is_unknown and not self._passes_each:
            return self.controller.at
        return min(self._wanted, self.survey.last)

    @property
    def _passes_each(self) -> bool:
        return self.plays or bool(self.controller.armed)

    def _look(self) -> None:
        survey = self.survey
        if survey.is_over and not survey.is_judged and self._doctor[0].snapshot.looks:
            for one in self._doctor[0].snapshot.findings:
                if one.scan or one.t_ns:
                    scan = min(one.scan or survey.scan_at(one.t_ns or 0), survey.last)
                    survey.findings.setdefault(max(self._least, scan), one.cause)
            survey.is_judged = True
        if self._since is not None:
            began, t_ns = self._since
            speed = SPEEDS[self._speed]
            now = t_ns + int((clock.now_ns() - began) * speed) if speed < END else None
            self._wanted = END if now is None else max(self._wanted, survey.scan_at(now + 1) - 1)
        if self._search is not None:
            found = survey.found(self._search, self._wanted)
            if found is None:
                return
            _, step, name = self._search
            self._search = None
            if found == END:
                which = "later" if step > 0 else "earlier"
                self._note = f"no {which} {f'edge of {name}' if name else 'ERROR, no finding'}"
                self._note += f"; {trouble}" if (trouble := self._doctor[0].snapshot.trouble) else ""
            else:
                self._wanted = found
                if not name and found in survey.findings:
                    self._note = f"finding: {survey.findings[found]} (J)"
        if survey.is_over and self._wanted >= survey.last:
            self._wanted = survey.last
            if self.controller.at >= survey.last:
                self._arrive_at_the_end()

    def _arrive_at_the_end(self) -> None:
        if self._since is not None:
            self._stop()
        if self.controller.armed:
            self._note = f"the end: trigger {self.controller.armed} did not fire"
            self.controller.disarm()

    def _move(self, until: int) -> bool:
        goal, at = self._goal(), self.controller.at
        start = self._keyframes.before(0 if self._passes_each else goal - LEAST_SEEN)
        if start <= at <= goal:
            self._coming = None
        elif self._coming is None or not start <= self._coming.at <= goal:
            self._coming = ReplayController(self._keyframes.run_at(start), self._obey, self._doctor)
        moving = self._coming or self.controller
        has_moved = moving.at < goal
        while moving.at < goal and clock.now_ns() < until:
            stood = moving.at
            moving.run.limit = goal
            try:
                moving.scan()
                if moving.at == stood:  # the survey has counted scans to which the run does not come
                    raise moving.run.differs()
            except UserError as wrong:
                self.survey.cut(stood, str(wrong))
                self._coming = None
                fresh = ReplayController(self._keyframes.run_at(start), self._obey, self._doctor)
                fresh.follow(self.controller)
                self.controller = fresh
                return True
            self._keyframes.seen(moving.run)
            if moving.fired:
                self._note = f"trigger {moving.fired}"
                self._stop()
                self._wanted = goal = moving.at
        if self._coming is not None and self._coming.at == goal:
            self._coming.follow(self.controller)
            self.controller, self._coming = self._coming, None
        return has_moved

    def _whole(self) -> AllMessages | TimedRows:
        """Return what has the messages of the whole recording."""
        journal, capture = self._journal, self._capture
        if capture is not None and capture.rows is not None:
            return TimedRows(capture.rows, self.survey)
        path = str(journal.path) if capture is None and isinstance(journal, Recording) else ""
        return AllMessages(self._keyframes, self.survey, path)

    def close(self) -> None:
        if self._judge is not None:
            self._judge.close()

    def picture(self, request: UpdateRequest) -> BenchUpdate:
        survey, controller, beside = self.survey, self.controller, self._beside
        if request.messages is not None and self._messages is None:
            self._messages = self._whole()
        controller.beside, controller.messages = beside, self._messages
        controller.shadows = self._capture.shadows if self._capture else frozenset()
        controller.begun_ns = self._capture.first_ns if self._capture else controller.run.begins.wall_ns
        controller.position = ReplayPosition(
            controller.at,
            survey.last,
            self.survey.time_of(controller.at),
            survey.times[-1] if survey.times else 0,
            survey.is_over,
            self._wanted if self._search is None else END,
            _speed_text(SPEEDS[self._speed]),
            len(survey.errors),
            survey.marks(),
            survey.first,
            self._note or survey.trouble,
            beside.lines() if beside is not None else (),
            beside.run.parts_at or 0 if beside is not None else 0,
            self._capture.first_ns if self._capture else None,
            (*self._capture.notes, *survey.notes_before(controller.at)) if self._capture else (),
        )
        wants = self._wants_findings and survey.is_over and not survey.is_judged
        request = replace(request, doctor=request.doctor or wants)
        return controller.picture(request, EngineTiming(mode="replay"), request.most_lines)


def _speed_text(speed: float) -> str:
    return f"{speed:g}x" if speed < END else FASTEST
