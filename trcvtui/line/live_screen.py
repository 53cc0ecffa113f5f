"""Shadows that play while a screen looks, in a process of their own; `watch -` on the screen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn

from trcvtui import clock
from trcvtui.engine.driver import ProcessDriver
from trcvtui.errors import mistake
from trcvtui.net.os.packet_pipe import take_stdin
from trcvtui.picture.bench_update import UpdateRequest, unpacked
from trcvtui.picture.update_pipe import UpdatePipe
from trcvtui.replay.driver import serve_until_gone
from trcvtui.snapshots.bench import EngineTiming

if TYPE_CHECKING:
    from trcvtui.capture.reassembly import Conversation
    from trcvtui.diagnosis.judges import FilesJudge
    from trcvtui.engine.controller import Controller
    from trcvtui.line.capture_player import CapturePlayer
    from trcvtui.line.live import LivePlan, LiveWatch
    from trcvtui.line.shadows import ShadowChoice, ShadowPlan
    from trcvtui.plc.ledger import StatusEdge

SLICE_NS: Final = 2_000_000  # for a picture, between two looks at the pipe
MOST_LINES: Final = 2000  # of the ledger in a picture
SILENT_NS: Final = 5_000_000_000  # a tap gives a sign of life each second


def live_driver(asked: ShadowChoice) -> ProcessDriver:
    """Return shadows of the packets of stdin; that is the keyboard from now on."""
    return ProcessDriver(live_main, Channel(take_stdin(with_keyboard=True), writable=False), asked)


def live_main(channel: Channel, packets: Channel, asked: ShadowChoice, most_idle_ns: int = 0) -> None:
    """Serve the screen with what comes; the last words say what is wrong."""
    from trcvtui.line.live import LivePlan

    serve_until_gone(
        channel,
        lambda: _PipeServed(channel, LivePlan(*asked), asked).run(packets.fileno(), most_idle_ns),
    )


class TapSocketDriver(ProcessDriver):
    """Shadows of what passes the tap of a project, which is a program of its own."""

    def __init__(self, project: Path) -> None:
        """Raise UserError where that tap does not run."""
        super().__init__(live_main, (project, None, None), SILENT_NS)

    def _arguments(self) -> tuple[Any, ...]:
        from trcvtui.line.tap_socket import connection_to

        self._tap = Channel(connection_to(self._asked[0][0]))
        return self._tap, *self._asked

    def _start(self) -> None:
        super()._start()
        self._tap.close()  # its end is the end of the shadows


def capture_main(channel: Channel, command: Sequence[str], asked: ShadowChoice) -> None:
    """Serve with what a capture program writes, which this process starts; it ends when we do."""
    serve_until_gone(channel, lambda: _capture(channel, command, asked))


def _capture(channel: Channel, command: Sequence[str], asked: ShadowChoice) -> None:
    from subprocess import DEVNULL, PIPE, Popen

    from trcvtui.line.live import LivePlan

    plan = LivePlan(*asked)
    try:
        program = Popen(command, stdin=DEVNULL, stdout=PIPE)
    except OSError as wrong:
        raise mistake(command[0], wrong.strerror or "no program", "a program that writes packets") from None
    try:
        assert program.stdout is not None
        _PipeServed(channel, plan, asked).run(program.stdout.fileno())
    finally:
        program.kill()  # it has nothing of its own to end
        program.wait()


class ServedShadows:
    """The screen's side of shadows that play while it looks."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._pipe = UpdatePipe(channel)
        self._controller: Controller | None = None
        self._request: UpdateRequest | None = None
        self._told: list[tuple[str, str]] = []
        self._player: CapturePlayer | None = None
        self.judge: FilesJudge | None = None  # of what came

    def show(self, player: CapturePlayer, kernel: str, watch: Callable[[str], str] | None = None) -> None:
        """Show the shadows of a player from now on, and count its conversations; `kernel`: a word for it.

        `watch` gives a conversation shadows of its own.
        """
        from trcvtui.engine.controller import Controller
        from trcvtui.line.conversations import ConversationFigures

        player.talks = talks = player.talks or ConversationFigures()
        self._controller = controller = Controller(player.shadows.bench)
        controller.talks, controller.shadows = talks.snapshot, player.shown
        controller.kernel, controller.watch, self._player = kernel, watch, player
        controller.files_judge = self.judge
        self._channel.send(player.shadows.bench.project)

    def go_on(self, subject: str, why: str) -> NoReturn:
        """Go on showing what is there: nothing more comes."""
        self.tell(subject, why)
        if self._controller is not None:
            self._controller.over = why
        while True:
            self.serve()
            self._channel.poll(None if self._request is None and not self._pipe.is_busy() else 0.01)

    # -- what shadows show is in the ledger; what is said of conversations, too --------------------------

    def scan(self, scan: int, changed: Sequence[StatusEdge], lacking: Sequence[str]) -> None:
        from trcvtui.line.capture_player import MISSING

        for instance in lacking:
            self.tell(instance, MISSING)

    def note(self, ns: int, number: int, text: str) -> None:
        self.tell(f"C{number}", text)

    def tell(self, subject: str, text: str) -> None:
        self._told.append((subject, text))
        if self._controller is not None:
            for told in self._told:
                self._controller.bench.note(*told)
            self._told.clear()

    def serve(self) -> None:
        controller = self._controller
        if controller is None:
            return
        controller.catch_up()
        if self._player is not None:
            controller.shadows = self._player.shown  # more with each PLC end
        while self._channel.poll():
            message = unpacked(self._channel.recv_bytes())
            if isinstance(message, UpdateRequest):
                self._request = message
            else:
                controller.take(*message)
        if self._request is not None and not self._pipe.is_busy():
            self._pipe.begin(controller.picture(self._request, EngineTiming(mode="live"), MOST_LINES))
            self._request = None
        self._pipe.go_on(clock.now_ns() + SLICE_NS)


class _PipeServed(ServedShadows):
    def __init__(self, channel: Channel, plan: LivePlan, asked: ShadowChoice) -> None:
        super().__init__(channel)
        self._plan = plan
        self._project, self._plc, _ = asked
        self._live: LiveWatch | None = None

    def run(self, fd: int, most_idle_ns: int = 0) -> NoReturn:
        from trcvtui.diagnosis.judges import FilesJudge
        from trcvtui.line.live import KeptPackets, LiveWatch, PacketStream

        live = self._live = LiveWatch(self._plan, self._begin, self._leave)
        kept = KeptPackets()
        self.judge = FilesJudge(kept.files, self._plc, self._project, looks_again=True)
        stream = PacketStream(fd, live, lambda line: self.tell("stdin", line), self.serve, kept, most_idle_ns)
        said = stream.take()
        live.finish()
        for line in said:
            self.tell("stdin", line)
        self.go_on("stdin", "the packets have ended")

    def _begin(self, plan: ShadowPlan, first_ns: int) -> CapturePlayer:
        from trcvtui.line.capture_player import CapturePlayer

        player = CapturePlayer(plan, (), first_ns, self)
        if self.judge is not None:
            self.judge.begins_ns = first_ns
        assert self._live is not None  # it is what begins
        self.show(player, "capture", self._live.shadow)
        return player

    def _leave(self, talk: Conversation, why: str) -> None:
        from trcvtui.line.shadows import end_of

        ends = f"{end_of(talk.there.address)} - {end_of(talk.back.address)}"
        self.tell(f"C{talk.number}", f"{ends} is unassigned: {why}")
