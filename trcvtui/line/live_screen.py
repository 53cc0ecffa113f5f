"""The process behind a live screen of `watch -` or `tap`. Shadows play while the screen shows them."""

from __future__ import annotations

from collections.abc import Sequence
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn

from trcvtui import clock
from trcvtui.engine.driver import ProcessDriver
from trcvtui.errors import mistake
from trcvtui.net.os.packet_pipe import detach_stdin
from trcvtui.net.os.tap_channels import TapChannel, ask_open_count
from trcvtui.net.tap import format_end
from trcvtui.picture.protocol import EngineStopped
from trcvtui.replay.driver import ScreenChannel, run_and_send_error
from trcvtui.snapshots.bench import EngineTiming
from trcvtui.snapshots.conversations import TAP

if TYPE_CHECKING:
    from trcvtui.capture.reassembly import Conversation
    from trcvtui.diagnosis.judges import FilesJudge
    from trcvtui.engine.controller import Controller
    from trcvtui.line.capture_player import CapturePlayer
    from trcvtui.line.live import LivePlan, LiveWatch
    from trcvtui.line.shadows import ShadowChoice, ShadowPlan
    from trcvtui.line.tap_capture import TapNote
    from trcvtui.picture.bench_update import BenchUpdate
    from trcvtui.plc.ledger import StatusEdge

TapChoice = tuple[list[list[str]], str | None, str | None, str | None]
TAP_ENDED_TEXT: Final = "the tap has ended"
SLICE_NS: Final = 2_000_000  # for a picture, between two looks at the pipe
MOST_LINES: Final = 2000  # of the ledger in a picture
MOST_SILENT_NS: Final = 5_000_000_000  # a tap sends something every 50 ms


def make_stdin_driver(asked: ShadowChoice) -> ProcessDriver:
    """Return shadows of the packets of stdin; from now on stdin is the keyboard."""
    return ProcessDriver(live_main, Channel(detach_stdin(with_keyboard=True), writable=False), asked)


def live_main(channel: Channel, packets: Channel, asked: ShadowChoice, most_idle_ns: int = 0) -> None:
    """Serve the screen with packets of a pipe. `most_idle_ns` is the longest silence of a tap, else 0."""
    from trcvtui.line.live import LivePlan

    run_and_send_error(
        channel,
        lambda: ShadowServer(channel, LivePlan(*asked), asked).serve_forever(packets.fileno(), most_idle_ns),
    )


class TapEnded(EngineStopped):
    """The tap was killed: the shell has the terminal again, and reads what the user types."""

    ends_screen = True


class TapDriver(ProcessDriver):
    """Shadows of the tap that started this screen. The tap hands over channels that carry packets.

    `kernel` is TAP, or ARMED_TAP for a screen whose keys act without a question.
    """

    def __init__(self, asks: int, asked: TapChoice, kernel: str = TAP) -> None:
        self._asks = Channel(asks)
        super().__init__(tap_main, self._asks, asked, kernel)

    def poll_picture(self) -> BenchUpdate | None:
        """Return the newest picture that has arrived; raise TapEnded."""
        picture = super().poll_picture()
        if picture is not None and picture.over:
            raise TapEnded(f"{picture.over}: both ends were informed (TCP: FIN or RST)")
        return picture

    def describe_quit_cuts(self) -> str:
        return ask_open_count(self._asks.fileno())


def tap_main(channel: Channel, asks: Channel, asked: TapChoice, kernel: str) -> None:
    """Serve the screen with the packets of a tap, requested on the channel `asks`."""

    def run() -> None:
        from trcvtui.line.tap_watch import TapPlan

        places, project, plc, dialect = asked
        path = None if project is None else Path(project)
        plan = TapPlan(places, path, plc, dialect)
        to, way = plan.routes[0].to, TapChannel(asks.fileno())
        if plc is None and len(places) == 1 and to.kind != "serial":
            plc = format_end(to.address, to.port)
        ShadowServer(channel, plan, (path, plc, dialect), way, kernel).serve_forever(way.fd)

    run_and_send_error(channel, run)


class RunningTapDriver(ProcessDriver):
    """Shadows of the bytes that pass the running tap of a project."""

    def __init__(self, project: Path) -> None:
        """Raise UserError if the project's tap does not run."""
        super().__init__(live_main, (project, None, None), MOST_SILENT_NS)

    def _arguments(self) -> tuple[Any, ...]:
        from trcvtui.line.tap_socket import open_connection

        self._tap = Channel(open_connection(self._asked[0][0]))
        return self._tap, *self._asked

    def _start(self) -> None:
        super()._start()
        self._tap.close()  # the shadows have their own; when the tap ends they end


def capture_main(channel: Channel, command: Sequence[str], asked: ShadowChoice) -> None:
    """Start a capture program and serve the screen with its packets. The program ends with this process."""
    run_and_send_error(channel, lambda: _run_capture(channel, command, asked))


def _run_capture(channel: Channel, command: Sequence[str], asked: ShadowChoice) -> None:
    from subprocess import DEVNULL, PIPE, Popen

    from trcvtui.line.live import LivePlan

    plan = LivePlan(*asked)
    try:
        program = Popen(command, stdin=DEVNULL, stdout=PIPE)
    except OSError as wrong:
        raise mistake(command[0], wrong.strerror or "no program", "a program that writes packets") from None
    try:
        assert program.stdout is not None
        ShadowServer(channel, plan, asked).serve_forever(program.stdout.fileno())
    finally:
        program.kill()  # it has nothing to save
        program.wait()


class ShadowServer:
    """Serves a screen with playing shadows.

    `way` is the channel to the tap that started the screen, or None for a pipe or another tap.
    """

    first_ns = 0

    def __init__(
        self,
        channel: Channel,
        plan: LivePlan,
        asked: ShadowChoice,
        way: TapChannel | None = None,
        kernel: str = "capture",
    ) -> None:
        self._channel, self._screen = channel, ScreenChannel(channel)
        self._plan, self._way, self._kernel = plan, way, kernel
        self._project, self._plc, _ = asked
        self._controller: Controller | None = None
        self._early_notes: list[tuple[str, str]] = []  # before there is a controller
        self._live: LiveWatch | None = None
        self._judge: FilesJudge | None = None  # of what came

    def serve_forever(self, fd: int, most_idle_ns: int = 0) -> NoReturn:
        from trcvtui.diagnosis.judges import FilesJudge
        from trcvtui.line.live import LiveWatch, PacketBuffer, PacketStream
        from trcvtui.line.tap_watch import TapWatch

        order, whole = (None, bytes) if self._way is None else (self._way.send, self._way.feed)
        if most_idle_ns or self._way is not None:  # a tap
            live: LiveWatch = TapWatch(
                self._plan, self._begin_shadows, self._note_ignored, self._show_note, order
            )
        else:
            live = LiveWatch(self._plan, self._begin_shadows, self._note_ignored)
        self._live, kept = live, PacketBuffer()
        self._judge = FilesJudge(kept.write_file, self._plc, self._project, looks_again=True)
        subject, over = ("stdin", "the packets have ended") if self._way is None else ("tap", TAP_ENDED_TEXT)
        stream = PacketStream(
            fd, live, lambda line: self._add_note(subject, line), self._serve, kept, most_idle_ns, whole
        )
        notes = stream.play_all()
        live.finish()
        for line in (*notes, over):
            self._add_note(subject, line)
        if self._controller is not None:
            self._controller.over = over
        while True:  # no packet comes any more; the screen stays
            self._serve(0.01 if self._screen.pipe.is_busy() else None)

    def _begin_shadows(self, plan: ShadowPlan, first_ns: int) -> CapturePlayer:
        from trcvtui.engine.controller import Controller
        from trcvtui.line.capture_player import CapturePlayer
        from trcvtui.line.conversations import ConversationFigures

        assert self._live is not None  # it is what begins
        player = CapturePlayer(plan, (), first_ns, self)
        player.talks = talks = ConversationFigures()
        self._controller = controller = Controller(player.shadows.bench)
        controller.talks, controller.kernel = talks.make_snapshots, self._kernel
        controller.watch, controller.files_judge = self._live.add_shadow, self._judge
        self._channel.send(player.shadows.bench.project)
        return player

    # -- the output of the shadows: notes go into the ledger ---------------------------------------------

    def report_scan(self, scan: int, changed: Sequence[StatusEdge], lacking: Sequence[str]) -> None:
        from trcvtui.line.capture_player import MISSING

        for instance in lacking:
            self._add_note(instance, MISSING)

    def note(self, ns: int, number: int, text: str) -> None:
        self._add_note(f"C{number}", text)

    def _note_ignored(self, talk: Conversation, why: str) -> None:
        from trcvtui.line.shadows import make_endpoint

        ends = f"{make_endpoint(talk.there.address)} - {make_endpoint(talk.back.address)}"
        self._add_note(f"C{talk.number}", f"{ends} is unassigned: {why}")

    def _show_note(self, ns: int, note: TapNote, text: str) -> None:
        self._add_note("tap", text)
        if self._controller is not None:
            self._controller.report_problem(text)

    def _add_note(self, subject: str, text: str) -> None:
        self._early_notes.append((subject, text))
        if self._controller is not None:
            for note in self._early_notes:
                self._controller.bench.note(*note)
            self._early_notes.clear()

    def _serve(self, waits: float | None = 0.0) -> None:
        controller = self._controller
        if controller is None:
            return
        controller.catch_up()
        if self._live is not None and self._judge is not None and (player := self._live.player) is not None:
            controller.shadows = player.shown  # grows with each PLC end
            self._judge.begins_ns = player.first_ns or None
        self._screen.handle_messages(controller.handle_line, waits)
        self._screen.try_send(lambda asked: controller.picture(asked, EngineTiming(mode="live"), MOST_LINES))
        self._screen.pipe.advance(clock.now_ns() + SLICE_NS)
