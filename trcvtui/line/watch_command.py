"""`trcvtui watch` writes the scans of shadow instances of a capture as lines of text or JSON."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Final

from trcvtui.capture.command import capture_notes
from trcvtui.errors import UserError, one_line
from trcvtui.line.capture_player import MISSING, MOST_LISTED, CaptureOutcome, CapturePlayer, plan_capture
from trcvtui.line.live import LivePlan, LiveWatch, PacketStream
from trcvtui.line.shadows import ShadowPlan
from trcvtui.line.tap_capture import TapNote
from trcvtui.line.tap_watch import TapPlan, TapWatch
from trcvtui.net.os.packet_pipe import detach_stdin
from trcvtui.net.os.system_calls import IN, poll_once
from trcvtui.net.os.tap_channels import TapChannel
from trcvtui.net.tap import RELEASE_LINE
from trcvtui.plc.ledger import Outputs, StatusEdge
from trcvtui.scenario.report import JsonLines, json_line, outputs_record
from trcvtui.signals import GROUP_SIGNALS, ignore_signals
from trcvtui.wording import utc_text

END_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
MOST_KNOWN_LINES: Final = 4096
TYPED_BYTES: Final = 1 << 16  # bytes of one read


class WatchLines:
    """Writes records of the shadows and, between the records, notes on conversations."""

    def __init__(
        self, write: Callable[[str], object], form: str | None, interval_ns: int, first_ns: int
    ) -> None:
        self._write = write
        self._lines = None if form is None else JsonLines(write, interval_ns)
        self._interval_ns = interval_ns
        self.first_ns = first_ns
        self._known: dict[tuple[str, Outputs] | None, str] = {}  # ends of JSON lines that were written before

    def report_scan(self, scan: int, changed: Sequence[StatusEdge], lacking: Sequence[str]) -> None:
        if self._lines is not None and not lacking:
            head = self._format_head(scan)
            self._write("".join([head + self._format_rest(edge) for edge in changed]))
            return
        for edge in changed:
            self._emit(scan, outputs_record(edge) | ({"note": MISSING} if edge.instance in lacking else {}))

    def _format_head(self, scan: int) -> str:
        time = utc_text(self.first_ns + (scan - 1) * self._interval_ns)
        return f'{{"scan":{scan},"t_ms":{(scan - 1) * self._interval_ns / 1e6!r},"time":"{time}",'

    def _format_rest(self, edge: StatusEdge) -> str:
        key = None if edge.outputs.error else (edge.instance, edge.outputs)
        known = self._known.get(key)
        if known is None:
            known = json_line(outputs_record(edge))[1:]
            if len(self._known) == MOST_KNOWN_LINES:
                self._known.clear()
            if key is not None:
                self._known[key] = known
        return known

    def note(self, ns: int, number: int, text: str) -> None:
        """Write a note on a conversation. `ns` counts from the first packet."""
        self._emit(-(-ns // self._interval_ns) + 1, {"conversation": f"C{number}", "note": text})

    def write_tap_record(self, ns: int, record: dict[str, object]) -> None:
        """Write a record of a tap if the form is JSON; its text is on stderr. `ns` counts from 1970."""
        if self._lines is not None:
            self._lines.write_record({"time": utc_text(ns), **record})

    def _emit(self, scan: int, record: dict[str, object]) -> None:
        ns = self.first_ns + (scan - 1) * self._interval_ns
        if self._lines is not None:
            self._lines.write_line(scan, {"time": utc_text(ns), **record})
        else:
            self._write(f"{utc_text(ns)}  scan {scan}  {one_line('  '.join(_describe_record(record)))}\n")

    def write_outcome(self, played: CaptureOutcome) -> None:
        assigned = islice(played.assigned.items(), MOST_LISTED)
        unassigned = islice(played.unassigned.items(), MOST_LISTED)
        if self._lines is None:
            for number, connects in assigned:
                self._write(f"C{number} was played to {', '.join(connects)}\n")
            for number, why in unassigned:
                self._write(f"C{number} is unassigned: {why}\n")
            for number, size in played.left_out.items():
                self._write(f"C{number}: {size} bytes never reached a shadow\n")
            if played.not_run:
                self._write(f"{played.not_run} scans without traffic were skipped\n")
            return
        record: dict[str, object] = {
            "assigned": [{"id": f"C{number}", "shadows": connects} for number, connects in assigned],
            "unassigned": [{"id": f"C{number}", "why": why} for number, why in unassigned],
            "left_out": {f"C{number}": size for number, size in played.left_out.items()},
        }
        self._lines.write_record(record | ({"not_run": played.not_run} if played.not_run else {}))


def _describe_record(record: Mapping[str, object]) -> Iterator[str]:
    if "conversation" in record:
        yield f"{record['conversation']}: {record['note']}"
        return
    yield f"{record['instance']}  {record['STATUS']}{'!' if record['ERROR'] else ''}"
    if record["DONE"]:
        yield f"DONE {record['RCVD_LEN']} B" if record.get("RCVD_LEN") else "DONE"
    cause = record.get("cause")
    if isinstance(cause, Mapping):
        yield str(cause["text"])
    if "note" in record:
        yield str(record["note"])


def watch_captures(
    paths: Sequence[str], project: Path | None, plc: str | None, dialect: str | None, form: str | None
) -> None:
    """Write lines to stdout, as JSON if `form` is given, else as text. Notes and troubles go to stderr."""
    plan, found, troubles = plan_capture(paths, project, plc, dialect)
    first_ns = found.first_ns or 0
    interval = min(task.interval_ns for task in plan.project.tasks)
    lines = WatchLines(sys.stdout.write, form, interval, first_ns)
    player = CapturePlayer(plan, found.all, first_ns, lines)
    player.play_captures(paths)
    lines.write_outcome(player.close())
    for line in (*plan.notes, *capture_notes(found, troubles)):
        _write_stderr(line)


def watch_stdin(project: Path | None, plc: str | None, dialect: str | None, form: str | None) -> None:
    watch_pipe(detach_stdin(with_keyboard=False), project, plc, dialect, form)


def watch_pipe(fd: int, project: Path | None, plc: str | None, dialect: str | None, form: str | None) -> None:
    """Write lines as packets come through a pipe, until it ends or Ctrl+C or SIGTERM comes."""
    plan = LivePlan(project, plc, dialect)
    live = LiveWatch(plan, _maker(plan, form, sys.stdout.write))
    stream = PacketStream(fd, live, _write_stderr, sys.stdout.flush)
    before = {
        number: signal.signal(number, lambda *_: stream.pipe.stop_when_empty()) for number in END_SIGNALS
    }
    try:
        notes = stream.play_all()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    _finish_watch(live, plan, notes)


def watch_tap(asks: int, asked: str) -> None:
    """Write lines of a tap's shadows, and run bench commands from stdin, until the tap ends.

    `asked` is the tap's request in JSON. If the request is wrong, exit 2 before asking for a channel.
    """
    ignore_signals(GROUP_SIGNALS)  # they end the tap, and this process ends with it
    places, project, plc, dialect, form, is_shown, can_type = json.loads(asked)
    try:
        plan = TapPlan(places, project and Path(project), plc, dialect)
    except UserError as wrong:
        _write_stderr("\n".join(wrong.lines()))
        sys.exit(2)
    way = TapChannel(asks)

    def report(ns: int, note: TapNote, text: str) -> None:
        lines = live.player and live.player.lines
        if note.note != "lack":
            _write_stderr(text)
        elif isinstance(lines, WatchLines):
            name = plan.routes[note.tap].name
            lines.write_tap_record(ns, {"tap": name, "waiting": note.waiting, "note": note.text})

    def handle_event() -> None:
        nonlocal can_type
        sys.stdout.flush()
        if can_type and live.player is not None and poll_once({0: IN}):  # one read: stdin may never be empty
            data = b""
            with suppress(OSError):
                data = os.read(0, TYPED_BYTES)
            can_type = bool(data)
            for line in live.run_typed_lines(data):
                _write_stderr(line)
            if not data:
                way.send(RELEASE_LINE + b"\n")

    live = TapWatch(plan, _maker(plan, form, sys.stdout.write if is_shown else len), None, report, way.send)
    notes: list[str] = []
    try:
        with suppress(UserError):  # the tap ended before it sent anything
            notes = PacketStream(way.fd, live, _write_stderr, handle_event, whole=way.feed).play_all()
        _finish_watch(live, plan, notes)
        sys.stdout.flush()
    except OSError:  # the reader of stdout is gone, or its terminal
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def _maker(
    plan: LivePlan, form: str | None, write: Callable[[str], object]
) -> Callable[[ShadowPlan, int], CapturePlayer]:
    return lambda shadows, first_ns: CapturePlayer(
        shadows, (), first_ns, WatchLines(write, form, plan.interval_ns, first_ns)
    )


def _finish_watch(live: LiveWatch, plan: LivePlan, notes: Sequence[str]) -> None:
    player = live.finish()
    lines = player.lines
    assert isinstance(lines, WatchLines)
    lines.write_outcome(player.close())
    for line in (*plan.plan.notes, *notes):
        _write_stderr(line)


def _write_stderr(line: str) -> None:
    sys.stderr.write(f"{line}\n")
