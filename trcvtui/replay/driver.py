"""The replay of a recording in a process of its own, and the screen's side of the channel to it."""

from __future__ import annotations

import gc
from collections.abc import Callable
from contextlib import closing
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import TYPE_CHECKING, Final

from trcvtui import clock
from trcvtui.engine.driver import ProcessDriver
from trcvtui.errors import UserError, mistake
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest, decode_request
from trcvtui.picture.update_pipe import UpdatePipe
from trcvtui.project.tables import quote
from trcvtui.replay.survey import END, FIRST_EVENT, parse_place
from trcvtui.signals import TERMINAL_SIGNALS, ignore_signals
from trcvtui.udt.literals import format_duration

if TYPE_CHECKING:
    from trcvtui.replay.time_line import ReplayNavigator

WORK_SLICE_NS: Final = 10_000_000  # of work between two reads of the channel
PLAY_POLL_S: Final = 0.02  # between two frames while it plays


def make_replay_driver(path: Path, at: str | None) -> ProcessDriver:
    """Return the replay of a recording. The replay begins at `at`; None means the first event."""
    if at is not None:
        parse_place(at, "--at")  # refused here, before there is a screen
    return ProcessDriver(replay_main, path, at)


def replay_main(channel: Channel, path: Path, at: str | None) -> None:
    serve_screen(channel, lambda: open_time_line(path, at))


def open_time_line(path: Path, at: str | None) -> ReplayNavigator:
    """Return the replay at `at`; raise UserError if the recording has no such scan."""
    from trcvtui.recording.journal import STEP, CallRecord
    from trcvtui.recording.recording import Recording
    from trcvtui.replay.time_line import ReplayNavigator  # the screen's side needs none of it

    recording, to = Recording(path), FIRST_EVENT if at is None else parse_place(at, "--at")
    line = ReplayNavigator(recording, str(path), to)
    if at is None or to == END or (isinstance(to, tuple) and to[0] != "time") or not recording.read_index():
        return line
    # The index has the scans before the last block; that block has the others.
    last, ns = line.survey.last_read_scan + recording.read_index()[-1].scans, recording.read_index()[-1].ns
    for entry in recording.read_entries(len(recording.read_index()) - 1):
        if isinstance(entry, CallRecord) and entry.call == STEP and isinstance(entry.answer, int):
            last, ns = last + 1, entry.answer
    first = line.survey.first + 1
    if first <= to <= last if isinstance(to, int) else to[1] <= ns:
        return line
    expected = f"a scan from {first} to {last}, or a time up to {format_duration(ns)}: {path} has no more"
    raise mistake("--at", quote(at), expected)


def serve_screen(channel: Channel, begin: Callable[[], ReplayNavigator]) -> None:
    """Serve the screen until the screen closes the channel. Send an error before the process ends."""

    def open_and_serve() -> None:
        with closing(begin()) as time_line:
            channel.send(time_line.controller.bench.project)
            _serve_time_line(channel, time_line)

    run_and_send_error(channel, open_and_serve)


def run_and_send_error(channel: Channel, run: Callable[[], None]) -> None:
    """Call `run`, and send its error, if any, to the screen. Return if the screen is gone."""
    gc.freeze()  # what was imported stays: no collection has to look at it
    ignore_signals(TERMINAL_SIGNALS)  # they belong to the screen
    try:
        try:
            run()
        except UserError as wrong:
            channel.send(wrong)
        except (EOFError, OSError):
            raise
        except Exception as error:
            from trcvtui.bench.error_report import textless_trace

            channel.send(textless_trace(error))
    except (EOFError, OSError):
        return  # the screen is gone


class ScreenChannel:
    """The channel to a screen: the screen sends lines and requests; pictures go to the screen."""

    def __init__(self, channel: Channel) -> None:
        self._channel, self.pipe = channel, UpdatePipe(channel)
        self._request: UpdateRequest | None = None

    def handle_messages(self, take: Callable[[int, str], object], waits: float | None = 0.0) -> None:
        """Take all messages. Wait `waits` seconds for the first message; None waits without a limit."""
        while self._channel.poll(waits):
            message, waits = decode_request(self._channel.recv_bytes()), 0.0
            if isinstance(message, UpdateRequest):
                self._request = message
            else:
                take(*message)

    def try_send(self, picture: Callable[[UpdateRequest], BenchUpdate]) -> None:
        """Begin to send the requested picture, if the previous picture has been sent."""
        if self._request is not None and not self.pipe.is_busy():
            self.pipe.begin(picture(self._request))
            self._request = None


def _serve_time_line(channel: Channel, time_line: ReplayNavigator) -> None:
    from trcvtui.replay.run_again import guard_restored

    screen, is_busy = ScreenChannel(channel), True
    while True:
        waits = 0.0 if is_busy else PLAY_POLL_S if time_line.is_playing or screen.pipe.is_busy() else None
        screen.handle_messages(time_line.handle_line, waits)
        with guard_restored(time_line.controller.run.is_restored, time_line.where):
            is_busy = time_line.advance(clock.now_ns() + WORK_SLICE_NS)
            screen.try_send(time_line.make_picture)
        screen.pipe.advance(clock.now_ns() + WORK_SLICE_NS)
