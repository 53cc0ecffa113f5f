"""`trcvtui tap`: this process forwards, and never waits for the processes that show and record."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from subprocess import DEVNULL, Popen, TimeoutExpired
from typing import Any, Final, NamedTuple

from trcvtui.errors import mistake
from trcvtui.files import create_file
from trcvtui.net.os.forwarder import Forwarder, list_reachable, raise_descriptor_limit, write_or_drop_line
from trcvtui.net.os.system_calls import OUT, poll_once
from trcvtui.net.os.tap_channels import (
    ASK_COUNT,
    ORDERS,
    RECORDER,
    SCREEN,
    ChannelServer,
    ObserverServerPipes,
)
from trcvtui.net.tap import Route, format_end
from trcvtui.snapshots.conversations import ARMED_TAP, TAP

RUN_RECORDER: Final = (
    "import sys; from trcvtui.line.tap_capture import record_tap; record_tap(int(sys.argv[1]))"
)
RUN_LINES: Final = (
    "import sys; from trcvtui.line.watch_command import watch_tap; watch_tap(int(sys.argv[1]), sys.argv[2])"
)
RUN_SCREEN: Final = "import sys; from trcvtui.cli.line import show_tap; sys.exit(show_tap(*sys.argv[1:]))"
RUN_SERVER: Final = (
    "import sys; from trcvtui.line.tap_socket import serve_observers; serve_observers(*sys.argv[1:])"
)
MOST_WAITING_LINES: Final = 100  # lines for the terminal, while the screen has it
SECOND: Final = 1_000_000_000
MOST_PAUSE_NS: Final = 60 * SECOND  # before the server process is started again
# For a terminal whose screen was killed: mouse off, normal screen, cursor on.
LEAVE_SCREEN: Final = b"\x1b[?1000l\x1b[?1003l\x1b[?1006l\x1b[?2004l\x1b[?1049l\x1b[?25h"
PATIENCE_S: Final = 5.0  # seconds for child processes to end
EXIT_WRONG_INPUT: Final = 2


class ObserverSettings(NamedTuple):
    """How the tap is observed. `form` is text or jsonl.

    With `holds`, the tap holds both directions of each conversation from its beginning. `is_armed` lets
    screen keys intervene without a question. `may_order` lets socket observers intervene.
    """

    project: Path | None
    plc: str | None
    dialect: str | None
    form: str | None
    is_shown: bool
    has_screen: bool = False
    holds: bool = False
    is_armed: bool = False
    may_order: bool = False


def forward(routes: Sequence[Route], looks: ObserverSettings, record: str | None) -> int:
    """Forward until SIGTERM or Ctrl+C; raise UserError for an address that cannot be used."""
    if os.name != "posix" and (looks.is_shown or record is not None):
        raise mistake("trcvtui tap", "Windows", "no --record and no --format: here a tap only forwards")
    if looks.holds and not looks.has_screen:
        raise mistake("--hold", "no screen", "a screen: only it releases held bytes")
    raise_descriptor_limit()
    voice = _UserOutput()
    loop = Forwarder(voice.write_line)
    for route in routes:
        loop.open_route(route)
    server = _ServerProcess(loop, voice, routes, looks)
    children: list[_ObserverProcess] = []
    try:
        types = not looks.has_screen and _can_read_stdin()
        shows_lines = SCREEN if looks.is_shown else ORDERS if types else b""
        has_guests = looks.project is not None and os.name == "posix"
        if shows_lines or record is not None or has_guests:
            server.start()
        if record is not None:
            with create_file(record, "--record") as file:  # only after all addresses are open
                children.append(_ObserverProcess(server, RECORDER, "the recording"))
                children[-1].start((RUN_RECORDER,), stdin=DEVNULL, stdout=file)
        loop.holds = looks.holds
        asked = _make_request(routes, loop, looks)
        if looks.has_screen:
            _announce_places(voice.write_line, loop, routes)  # before the screen has the terminal
            children.append(screen := _ScreenProcess(server))
            if not screen.start_screen(asked, looks.is_armed):
                return screen.wait_for_end()
        else:
            if shows_lines:
                children.append(_ObserverProcess(server, shows_lines, "the output"))
                words = json.dumps((*asked, looks.form, looks.is_shown, types))
                if not children[-1].start((RUN_LINES,), words, stdin=None if types else DEVNULL):
                    return EXIT_WRONG_INPUT
            _announce_places(voice.write_line, loop, routes)
        loop.run()
    finally:
        loop.close()
        server.wait_for_end()
        for child in children:
            child.end_process()
    return 0


def _make_request(routes: Sequence[Route], loop: Forwarder, looks: ObserverSettings) -> tuple[object, ...]:
    places = [
        (route.name, _format_listen(route, made.address), str(route.to))
        for route, made in zip(routes, loop.routes, strict=True)
    ]
    return places, looks.project and str(looks.project), looks.plc, looks.dialect


def _announce_places(say: Callable[[str], None], loop: Forwarder, routes: Sequence[Route]) -> None:
    addresses = [made.address for made in loop.routes]
    for route, address in zip(routes, addresses, strict=True):
        how = f"; kill {os.getpid()} ends the tap" if route is routes[-1] and os.name == "posix" else ""
        say(f"{route.name}: {_format_listen(route, address)} to {route.to}{how}")
    for place in list_reachable(addresses):
        say(f"other machines reach {place}")


class _UserOutput:
    """Writes lines for the user at once, or after the screen has left the terminal."""

    def __init__(self) -> None:
        self.is_waiting = False
        self._waiting: deque[str] = deque(maxlen=MOST_WAITING_LINES)

    def write_line(self, line: str) -> None:
        if self.is_waiting:
            self._waiting.append(line)
        else:
            write_or_drop_line(line)

    def flush(self) -> None:
        self.is_waiting = False
        while self._waiting:
            write_or_drop_line(self._waiting.popleft())


class _ServerProcess:
    """The process that serves observers. If the process ends, it is started again; forwarding continues."""

    def __init__(
        self, loop: Forwarder, voice: _UserOutput, routes: Sequence[Route], looks: ObserverSettings
    ) -> None:
        from trcvtui.line.tap_socket import make_socket_path

        self.loop, self.voice = loop, voice
        path = "" if looks.project is None else str(make_socket_path(looks.project))
        taps = [(route.name, str(route.listen), str(route.to)) for route in routes]
        described = json.dumps({"taps": taps, "plc": looks.plc, "dialect": looks.dialect})
        self._words = path, str(int(looks.may_order)), described
        self._pause = 0
        self._process: Popen[bytes] | None = None
        self._pipes: ObserverServerPipes | None = None
        self._pending: list[tuple[bytes, Any]] = []  # channels of observers that wait for it

    def start(self) -> None:
        """Start the process; if the system refuses, try again later."""
        try:
            pipes = ObserverServerPipes()
            err = DEVNULL if self.voice.is_waiting else None  # the terminal belongs to the screen
            words = (RUN_SERVER, *map(str, pipes.fds), *self._words)
            self._process = _run_python(words, stdin=DEVNULL, stdout=DEVNULL, stderr=err, pass_fds=pipes.fds)
            pipes.close_far_ends()
        except OSError as failed:
            self._retry_later(failed.strerror or str(failed))
            return
        self._pipes = pipes
        self.loop.attach_server(pipes.events, self._handle_end)
        pending, self._pending = self._pending, []
        for kind, way in pending:
            pipes.hand_over_observer(kind, way)

    def hand_over_observer(self, kind: bytes, way: Any) -> None:
        """Hand an observer over to the process, at once or as soon as the process runs again."""
        if self._pipes is None:
            self._pending.append((kind, way))
        else:
            self._pipes.hand_over_observer(kind, way)

    def _handle_end(self) -> None:
        if self._pipes is not None and self._process is not None:
            self._pipes.close()
            self._pipes = None
            self._process.kill()  # its socket is closed and it has nothing to save
            self._process.wait()
        self._retry_later("their process has ended")

    def _retry_later(self, why: str) -> None:
        seconds = self._pause // SECOND
        self.voice.write_line(f"no observers: {why}; next try in {seconds} s, forwarding continues")
        self.loop.call_after(self._pause, self.start)
        self._pause = min(2 * self._pause or SECOND, MOST_PAUSE_NS)

    def wait_for_end(self) -> None:
        """After the end of the tap, wait until the process has handed over its last bytes, and end it."""
        for _, way in self._pending:
            way.close()
        if self._process is not None:
            _wait_or_kill(self._process)


class _ObserverProcess:
    """A child process that shows or records. It asks for a channel, and again if the channel ends."""

    def __init__(self, server: _ServerProcess, kind: bytes, what: str) -> None:
        self._server, self._kind, self._what = server, kind, what
        self._loop, self._asked = server.loop, ChannelServer()  # it is closed when the child has ended
        self._process: Popen[bytes] | None = None
        self._is_served = False  # it has asked for a channel

    def start(self, program: tuple[str, ...], *words: str, **given: Any) -> bool:
        """Start the child; return True once it asks for a channel, False if it ended with an error."""
        with self._asked.theirs as theirs:
            words = (*program, str(theirs.fileno()), *words)
            self._process = _run_python(words, pass_fds=(theirs.fileno(),), **given)
        self._loop.register(self._asked.fd, 1, self._answer_question)
        self._is_served = self._answer_question()
        return self._is_served

    def _answer_question(self, _: int = 0) -> bool:
        """Wait for the child's next question and answer it; return False if the child has ended."""
        question = self._asked.read_question()
        if question == ASK_COUNT:
            self._asked.answer_count(self._loop.describe_open())
        elif not question:
            self._loop.unregister(self._asked.fd)
            if self._is_served:  # otherwise it has written its error
                self._handle_end()
        elif (way := self._asked.hand_over_channel()) is not None:
            self._server.hand_over_observer(self._kind, way)
        return bool(question)

    def _handle_end(self) -> None:
        self._server.voice.write_line(f"{self._what} has ended; forwarding continues")

    def wait_for_end(self) -> int:
        assert self._process is not None
        return self._process.wait()

    def end_process(self) -> None:
        self._asked.close()
        if self._process is not None:
            _wait_or_kill(self._process)


class _ScreenProcess(_ObserverProcess):
    """The process of the screen; if it was killed, the terminal is restored."""

    def __init__(self, server: _ServerProcess) -> None:
        super().__init__(server, SCREEN, "the screen")
        self._terminal: list[Any] = []

    def start_screen(self, asked: tuple[object, ...], is_armed: bool) -> bool:
        import termios

        self._terminal = termios.tcgetattr(0)
        is_open = self.start((RUN_SCREEN,), json.dumps(asked), ARMED_TAP if is_armed else TAP)
        self._server.voice.is_waiting = is_open  # the terminal belongs to the screen
        return is_open

    def _handle_end(self) -> None:
        """Exit code 0 of the screen ends the tap. With another code forwarding continues."""
        import termios

        code = self.wait_for_end()
        self._loop.release_all()
        if code == 0:
            if cut := self._loop.describe_open():
                write_or_drop_line(f"the tap ends and cuts {cut}")
            self._loop.stop()
        else:
            ends = f"kill {os.getpid()} ends the tap"
            with suppress(termios.error, OSError):  # the terminal is closed
                termios.tcsetattr(0, termios.TCSANOW, self._terminal)
                ends = f"Ctrl+C or {ends}"
                if code < 0 and poll_once({1: OUT}):
                    os.write(1, LEAVE_SCREEN)
            write_or_drop_line(f"the screen has ended; forwarding continues; {ends}")
        self._server.voice.flush()

    def end_process(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
        super().end_process()


def _format_listen(route: Route, address: tuple[str, int] | None) -> str:
    if address is None:
        return str(route.listen)
    return ("udp:" if route.listen.kind == "udp" else "") + format_end(*address)


def _can_read_stdin() -> bool:
    import stat

    with suppress(AttributeError, ValueError):
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)  # in the background a terminal is not read
    try:
        mode = os.fstat(0).st_mode
    except OSError:
        return False
    return os.name == "posix" and (stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or os.isatty(0))


def _run_python(words: tuple[str, ...], **given: Any) -> Popen[bytes]:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return Popen([sys.executable, "-P", "-c", *words], env=environment, **given)


def _wait_or_kill(process: Popen[bytes]) -> None:
    try:
        process.wait(PATIENCE_S)
    except TimeoutExpired:
        process.kill()
        process.wait()
