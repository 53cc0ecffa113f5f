"""`trcvtui tap`: forwards in this process; other processes look on, so that nothing waits for them."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen, TimeoutExpired
from typing import Any, Final, NamedTuple

from trcvtui.errors import mistake
from trcvtui.files import create
from trcvtui.net.os.forwarder import Forwarder, raise_limit, reachable, say_at_once
from trcvtui.net.os.system_calls import OUT, look_at
from trcvtui.net.os.tap_ways import ASKED, COUNTS, EventPipes
from trcvtui.net.tap import Route, TapEventKind, end_text
from trcvtui.snapshots.conversations import ARMED_TAP, TAP

RECORDS: Final = "from trcvtui.line.tapped import record_tap; record_tap()"
LOOKS_ON: Final = "import sys; from trcvtui.line.tap_observer import look_on; look_on(sys.argv[1])"
SHOWS: Final = "import sys; from trcvtui.cli.line import tap_screen; sys.exit(tap_screen(*sys.argv[1:]))"
SERVES: Final = (
    "import sys; from trcvtui.line.tap_socket import serve_observers; serve_observers(*sys.argv[1:])"
)
MOST_SAID: Final = 100  # lines that wait for the end of the screen
FIRST_PAUSE_NS, MOST_PAUSE_NS = 1_000_000_000, 60_000_000_000  # before observers are served anew
# Of a terminal whose screen was killed: no mouse, the usual picture, a cursor.
LEAVE_SCREEN: Final = b"\x1b[?1000l\x1b[?1003l\x1b[?1006l\x1b[?2004l\x1b[?1049l\x1b[?25h"
PATIENCE: Final = 5.0  # seconds for the processes that look on to end
TYPED: Final = 1 << 16  # bytes of one read
WRONG_INPUT: Final = 2


class ObserverSettings(NamedTuple):
    """What shadows look on, and whether it is shown; `form`: text or jsonl.

    `has_screen`: on a screen. `holds`: both directions of each conversation are held from its beginning.
    `is_armed`: keys of the screen intervene without a question. `may_order`: so may observers at the socket.
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
    """Forward until SIGTERM or Ctrl+C; raise UserError for a place that cannot be had."""
    if os.name != "posix" and (looks.is_shown or record is not None):
        raise mistake("trcvtui tap", "Windows", "no --record and no --format here: it forwards alone")
    if looks.holds and not looks.has_screen:
        raise mistake("--hold", "no screen", "one that lets go what is held")
    raise_limit()
    voice = _Voice()
    loop = Forwarder(voice.say)
    for route in routes:
        loop.add_route(route)
    started: list[Popen[bytes]] = []
    screen = _Screen(loop, voice) if looks.has_screen else None
    observers = None
    try:
        if record is not None:
            with create(record, "--record") as file:  # when all places are had
                ours, theirs = loop.pair()
                with theirs:
                    started.append(_started((RECORDS,), stdin=theirs.fileno(), stdout=file))
                loop.add_looker(ours, "the recording")
        loop.holds = looks.holds
        if screen is not None:
            _say_where(voice.say, loop, routes)  # before the screen has the terminal
            if not screen.open(routes, looks):
                return screen.wait()
        elif not _look_on(loop, routes, looks, started):
            return WRONG_INPUT
        else:
            _say_where(voice.say, loop, routes)
        if looks.project is not None and os.name == "posix":
            observers = _Observers(loop, voice, looks.project, looks.may_order)
            observers.start()
            loop.beat()
        loop.run()
    finally:
        loop.close()
        if observers is not None:
            observers.end()
        if screen is not None:
            screen.end()
        for process in started:
            _wait(process)
    return 0


def _say_where(say: Callable[[str], None], loop: Forwarder, routes: Sequence[Route]) -> None:
    addresses = [made.address for made in loop.routes]
    for route, address in zip(routes, addresses, strict=True):
        how = f"; kill {os.getpid()} ends the tap" if route is routes[-1] and os.name == "posix" else ""
        say(f"{route.name}: {_listens(route, address)} to {route.to}{how}")
    for place in reachable(addresses):
        say(f"other machines reach {place}")


def _look_on(
    loop: Forwarder, routes: Sequence[Route], looks: ObserverSettings, started: list[Popen[bytes]]
) -> bool:
    types = _can_type()
    if not (looks.is_shown or types):
        return True
    places = [(route.name, str(route.listen), str(route.to)) for route in routes]
    project = None if looks.project is None else str(looks.project)
    asked = json.dumps((places, project, looks.plc, looks.dialect, looks.form, looks.is_shown))
    ours, theirs = loop.pair()
    with theirs:
        started.append(_started((LOOKS_ON, asked), stdin=theirs.fileno()))
    if ours.recv(1) != b"\n":  # it has said what is wrong
        ours.close()
        return False
    loop.add_looker(ours, "who shows it", gives_orders=True, wants_bytes=looks.is_shown)
    if looks.is_shown:
        loop.tell_time()
    if types:

        def read(_: int) -> None:
            data = b""
            with suppress(OSError):
                data = os.read(0, TYPED)
            if data:
                loop.tell_ordering(TapEventKind.LINE, data)
            else:
                loop.forget(0)
                loop.let_all_go()

        loop.hear(0, 1, read)
    return True


class _Voice:
    """What is said to the user: at once, or after the screen that has the terminal."""

    def __init__(self) -> None:
        self.is_kept = False
        self._kept: deque[str] = deque(maxlen=MOST_SAID)

    def say(self, line: str) -> None:
        if self.is_kept:
            self._kept.append(line)
        else:
            say_at_once(line)

    def let_out(self) -> None:
        self.is_kept = False
        while self._kept:
            say_at_once(self._kept.popleft())


class _Observers:
    """The process that serves observers at a socket; bytes go on whatever becomes of it."""

    def __init__(self, loop: Forwarder, voice: _Voice, project: Path, may_order: bool) -> None:
        from trcvtui.line.tap_socket import socket_of

        self._loop, self._voice, self._may_order = loop, voice, may_order
        self._path = socket_of(project)
        self._pause = FIRST_PAUSE_NS
        self._process: Popen[bytes] | None = None
        self._asked: EventPipes | None = None

    def start(self) -> None:
        """Start it; where the system gives no process now, later."""
        try:
            self._asked = EventPipes()
            with self._asked.theirs as theirs:
                words = SERVES, str(theirs.fileno()), str(self._path), str(int(self._may_order))
                told = DEVNULL if self._voice.is_kept else None  # the terminal belongs to the screen
                self._process = _started(
                    words, stdin=PIPE, stdout=DEVNULL, stderr=told, pass_fds=(theirs.fileno(),)
                )
        except OSError as failed:
            self._again(failed.strerror or str(failed))
            return
        self._loop.hear(self._asked.fd, 1, self._hear)

    def _hear(self, _: int) -> None:
        assert self._asked is not None
        if self._asked.take_question() == ASKED:
            way = self._asked.hand_over()
            if way is not None:
                self._loop.add_looker(way, "an observer", gives_orders=self._may_order, is_guest=True)
            return
        self._loop.forget(self._asked.fd)
        self._asked = None
        if self._process is not None:
            self._process.wait()
        self._again("their process has ended")

    def _again(self, why: str) -> None:
        self._voice.say(f"no observers: {why}; tried again in {self._pause // 10**9} s, bytes go on")
        self._loop.after(self._pause, self.start)
        self._pause = min(2 * self._pause, MOST_PAUSE_NS)

    def end(self) -> None:
        """Let observers read what is left."""
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
            _wait(self._process)


class _Screen:
    """The screen, a child of this process: the terminal is put right when it was killed."""

    def __init__(self, loop: Forwarder, voice: _Voice) -> None:
        self._loop, self._voice = loop, voice
        self._process: Popen[bytes] | None = None
        self._terminal: list[Any] = []
        self._asked = EventPipes()  # at its end the screen has ended

    def open(self, routes: Sequence[Route], looks: ObserverSettings) -> bool:
        import termios

        self._terminal = termios.tcgetattr(0)
        places = [
            (route.name, _listens(route, made.address), str(route.to))
            for route, made in zip(routes, self._loop.routes, strict=True)
        ]
        asked = json.dumps((places, looks.project and str(looks.project), looks.plc, looks.dialect))
        with self._asked.theirs as theirs:
            kernel = ARMED_TAP if looks.is_armed else TAP
            words = SHOWS, str(theirs.fileno()), asked, kernel
            self._process = _started(words, pass_fds=(theirs.fileno(),))
        if self._asked.take_question() != ASKED:
            return False
        ours = self._asked.hand_over()
        if ours is None or ours.recv(1) != b"\n":
            if ours is not None:
                ours.close()
            return False
        self._loop.hear(self._asked.fd, 1, self._hear)
        self._loop.add_looker(ours, "", gives_orders=True)
        self._loop.tell_time()
        self._voice.is_kept = True  # the terminal belongs to the screen
        return True

    def _hear(self, _: int) -> None:
        question = self._asked.take_question()
        if not question:
            self._gone()
        elif question == COUNTS:
            self._asked.answer(self._loop.open_in_words())
        elif (way := self._asked.hand_over()) is not None:
            self._loop.add_looker(way, "", gives_orders=True)

    def _gone(self) -> None:
        """The user has ended the tap with it; or it was left or killed, and bytes go on."""
        import termios

        self._loop.forget(self._asked.fd)
        code = self.wait()
        self._loop.let_all_go()
        if code == 0:
            if cut := self._loop.open_in_words():
                say_at_once(f"the tap ends and cuts {cut}")
            self._loop.stop()
        else:
            ends = f"kill {os.getpid()} ends the tap"
            with suppress(termios.error, OSError):  # the terminal is closed
                termios.tcsetattr(0, termios.TCSANOW, self._terminal)
                ends = f"Ctrl+C or {ends}"
                if code < 0 and look_at({1: OUT}):
                    os.write(1, LEAVE_SCREEN)
            say_at_once(f"the screen has ended: bytes still go on; {ends}")
        self._voice.let_out()

    def wait(self) -> int:
        assert self._process is not None
        return self._process.wait()

    def end(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            self._process.wait()


def _listens(route: Route, address: tuple[str, int] | None) -> str:
    if address is None:
        return str(route.listen)
    return ("udp:" if route.listen.kind == "udp" else "") + end_text(*address)


def _can_type() -> bool:
    import stat

    with suppress(AttributeError, ValueError):
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)  # in the background a terminal is not read
    try:
        mode = os.fstat(0).st_mode
    except OSError:
        return False
    return os.name == "posix" and (stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or os.isatty(0))


def _started(words: tuple[str, ...], **given: Any) -> Popen[bytes]:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return Popen([sys.executable, "-P", "-c", *words], env=environment, **given)


def _wait(process: Popen[bytes]) -> None:
    try:
        process.wait(PATIENCE)
    except TimeoutExpired:
        process.kill()
        process.wait()
