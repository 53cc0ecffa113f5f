"""The live engine: it scans at absolute deadlines, and serves the screens between two scans.

Rule 1: missed scans are not made up in a burst. Deadlines that have passed are skipped and counted.
Rule 2: the engine serves the screens in turns, only in the gap between two scans. A picture is made in
one go, so that it shows one scan. Then the picture is pickled and written slice by slice.
Rule 3: a new bench begins with a new time, new deadlines and new timing figures.
"""

from __future__ import annotations

import gc
import os
from contextlib import nullcontext
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from msgspec.structs import replace

from trcvtui import clock
from trcvtui.bench.bench import Bench, enter_own_network
from trcvtui.engine.controller import Controller
from trcvtui.engine.screens import AttachedScreen, AttachedScreens
from trcvtui.engine.timing import ScanTiming, freeze_collector, request_punctuality
from trcvtui.errors import UserError
from trcvtui.files import FilesRead, record_reads, refuse_files
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.signals import TERMINAL_SIGNALS, ignore_signals

if TYPE_CHECKING:
    from trcvtui.net.os.tab_listener import TabListener
    from trcvtui.recording.files import RecordTarget
    from trcvtui.recording.recorder import RunRecorder


def engine_main(channel: Channel, *asked: Any) -> None:
    """Run the bench for an EngineDriver until the channel closes. Send an error that ends the run."""
    gc.disable()  # the engine collects at the beginning of each bench only
    ignore_signals(TERMINAL_SIGNALS)  # they belong to the screen
    try:
        _run(channel, *asked)
    except UserError as wrong:
        _send_last_words(channel, wrong)
    except Exception as error:
        from trcvtui.bench.error_report import textless_trace

        _send_last_words(channel, textless_trace(error))


def _run(
    channel: Channel,
    path: Path,
    kernel: str,
    netns: bool,
    read_only: bool,
    record: RecordTarget | None,
    door: TabListener | None = None,
) -> None:
    from trcvtui.scenario.scenario import load_bench_project

    recorder = None
    if record is not None:
        from trcvtui.recording.recorder import make_recorder

        recorder = make_recorder(record, record.target, waits=False)
    elif not read_only:  # no black box: no line of a read-only bench changes it
        from trcvtui.recording.recorder import attach_black_box

        recorder, box = attach_black_box(None, FilesRead())
        recorder.box = box
    with record_reads(recorder.reads) if recorder is not None else nullcontext():
        project = load_bench_project(path)
        if recorder is not None and recorder.box is not None and not project.black_box:
            recorder = None
        with recorder or nullcontext():  # before anything else: its file may be refused
            channel.send(project)  # at once: the screen has its own library to import meanwhile
            from trcvtui.engine.controller import fresh_bench

            if netns:
                enter_own_network(kernel, project.sim)
            bench = fresh_bench(project, kernel, recorder.seam if recorder is not None else None)
            if recorder is not None:
                recorder.add_header(bench, path, (), is_scenario=False)
            if read_only:
                refuse_files("this bench is read-only")  # `expect .. file X` would tell what X holds
            Engine(AttachedScreens(channel, project, read_only, door), bench, recorder).run()


def _send_last_words(channel: Channel, last_words: str | UserError) -> None:
    try:
        channel.send(last_words)
    except OSError:
        return  # the screen is gone, and that was the reason


SPARE_NS: Final = 150_000  # no screen is served in this time before a scan
GAP_SHARE: Final = 8  # pictures get 1 / 8 of an interval: a process that computes more waits longer (EEVDF)
STEP_NS: Final = 4_000_000  # between two checks of the channel in a long gap
READ_PAUSE_NS: Final = 100_000_000  # longest time between two reads of the ledger
PATIENCE_NS: Final = 100_000_000  # longest wait of a picture for a gap with enough room
FAST_INTERVAL_NS: Final = 5_000_000  # below this interval
PICTURE_PAUSE_NS: Final = 100_000_000  # there is this pause between two pictures
TIMING_FILE: Final = "TRCVTUI_TIMING_FILE"  # names a file that gets every scan's lateness at the end


class Engine:
    """The controller with its bench, and the screens."""

    def __init__(self, screens: AttachedScreens, bench: Bench, recorder: RunRecorder | None = None) -> None:
        self._screens = screens
        self._controller = Controller(bench)
        self._recorder = recorder
        if recorder is not None:
            from trcvtui.diagnosis.judges import FilesJudge, RunJudge
            from trcvtui.recording.files import list_newest_file

            judge = FilesJudge(lambda: list_newest_file(recorder.file), looks_again=True)
            self._controller.black_box = box = recorder.box
            self._controller.files_judge = judge if box is None else RunJudge(box)
        self._made_at = self._worked_at = 0  # the last picture, and the last work on one
        self._mode = request_punctuality()
        self._timing_file = os.environ.get(TIMING_FILE)
        self._bench = bench

    def _begin_bench(self, bench: Bench) -> None:
        freeze_collector()
        self._bench = bench
        for screen in self._screens.all:
            screen.kept = None
        self._interval = bench.runtime.interval_ns
        self._timing = ScanTiming(self._mode)
        if self._timing_file:
            self._timing.keep_every_scan()
        self._start = self._due = self._read_at = clock.now_ns()  # rule 3

    def run(self) -> None:
        """Scan at every deadline; serve the screens in between."""
        self._begin_bench(self._bench)
        try:
            while True:
                self._serve_screens()
                self._scan_fast(self._due - SPARE_NS)
                clock.sleep_until(self._due)
                self._scan()
        except Exception:
            self._screens.first.pipe.finish()
            raise
        finally:
            self._bench.close()
            if self._timing_file:
                self._timing.write_to(Path(self._timing_file))

    def _scan(self) -> None:
        began = clock.now_ns()
        if self._controller.step(began - self._start if self._bench.kernel_name == "live" else None):
            ended = clock.now_ns()
            self._timing.count_scan(self._due, began, ended, self._interval)
        else:
            self._controller.step_peers_alone()
            ended = clock.now_ns()
        self._due += self._interval
        if ended > self._due:
            # Rule 1: the deadlines that have passed are skipped.
            self._due += (ended - self._due + self._interval - 1) // self._interval * self._interval

    def _scan_fast(self, deadline_ns: int) -> None:
        while self._controller.hurries and clock.now_ns() < deadline_ns:
            self._controller.scan()

    def _serve_screens(self) -> None:
        """Serve the screens right after the scan, and again every STEP_NS of a long gap.

        Only the clock wakes the engine, and never shortly before a scan. A process that has just run does
        not get the processor at once. Then the next scan would begin 0.5 to 2.5 ms late (seen with perf).
        """
        if self._recorder is not None:
            self._recorder.finish_scan(self._bench)
            self._controller.report_recording(self._recorder.describe_status(), self._recorder.last_error)
        self._read_ledger()
        self._handle_messages()
        self._deliver_pictures(self._due - SPARE_NS)
        while self._due - (now := clock.now_ns()) > 2 * STEP_NS:
            self._scan_fast(now + STEP_NS)
            clock.sleep_until(now + STEP_NS)
            self._handle_messages()
            self._deliver_pictures(self._due - SPARE_NS)

    def _read_ledger(self) -> None:
        now = clock.now_ns()
        is_long_ago = now > self._read_at + READ_PAUSE_NS
        if self._controller.catch_up(None if is_long_ago else max(now, self._due - SPARE_NS)):
            self._read_at = now

    def _handle_messages(self) -> None:
        for screen, message in self._screens.read_messages(self._due - SPARE_NS):
            if isinstance(message, UpdateRequest):
                screen.request, screen.asked_at = message, clock.now_ns()
            else:
                self._handle_line(*message)

    def _handle_line(self, number: int, line: str) -> None:
        self._controller.handle_line(number, line)
        self._screens.hand_out(self._controller.take_answers())
        if self._controller.bench is not self._bench:
            if self._recorder is not None:
                self._recorder.close()  # the recorded run is over
                self._recorder = self._controller.black_box = self._controller.files_judge = None
            self._begin_bench(self._controller.bench)

    def _deliver_pictures(self, deadline_ns: int) -> None:
        began = clock.now_ns()
        screens = self._screens.all
        if not any(screen.request or screen.pipe.is_busy() for screen in screens):
            self._worked_at = began
            return
        if began >= deadline_ns and began < self._worked_at + PATIENCE_NS:  # rule 2: there is no gap
            return
        part = min(deadline_ns, began + min(self._interval, STEP_NS) // GAP_SHARE)
        for screen in tuple(screens):
            screens.rotate(-1)  # rule 2: in turns
            if screen.request and not screen.pipe.is_busy() and self._may_make_picture(screen, deadline_ns):
                self._make_picture(screen, screen.request)
            if self._made_at < began or clock.now_ns() < part:  # else it is pickled in the next gap
                screen.pipe.advance(part)
            if clock.now_ns() >= part:
                break  # the next gap begins with the next screen
        self._worked_at = clock.now_ns()
        if began <= self._due < self._worked_at:
            self._timing.late_by_picture += 1

    def _make_picture(self, screen: AttachedScreen, request: UpdateRequest) -> None:
        began, watch = clock.now_ns(), self._controller.trigger_watch
        for each in self._screens.all:
            each.kept = watch.kept or each.kept
        watch.kept = screen.kept
        picture = self._controller.picture(request, self._timing.summary(began), request.most_lines)
        watch.kept, screen.kept = None, watch.kept
        self._screens.hand_out(picture.answers)
        answers, screen.answers, screen.request = tuple(screen.answers), [], None
        screen.pipe.begin(replace(picture, answers=answers))
        screen.make_ns, self._made_at = clock.now_ns() - began, began

    def _may_make_picture(self, screen: AttachedScreen, deadline_ns: int) -> bool:
        """Return whether a picture fits before the next scan, or the screen has waited for too long."""
        least = PICTURE_PAUSE_NS if self._interval < FAST_INTERVAL_NS and not screen.answers else 0
        now = clock.now_ns()
        if now < self._made_at + least:
            return False
        return now + screen.make_ns <= deadline_ns or now > screen.asked_at + PATIENCE_NS
