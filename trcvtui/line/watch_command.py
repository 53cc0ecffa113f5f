"""`trcvtui watch`: what shadow instances show of a capture, as lines of text or of JSON."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Final

from trcvtui.capture.command import capture_notes
from trcvtui.errors import one_line
from trcvtui.line.capture_player import MISSING, MOST_LISTED, CaptureOutcome, CapturePlayer, plan_capture
from trcvtui.line.live import LivePlan, LiveWatch, PacketStream
from trcvtui.line.shadows import ShadowPlan
from trcvtui.net.os.packet_pipe import take_stdin
from trcvtui.plc.ledger import Outputs, StatusEdge
from trcvtui.scenario.report import JsonLines, json_line, outputs_record
from trcvtui.wording import utc_text

ENDS: Final = (signal.SIGINT, signal.SIGTERM)
MOST_KNOWN: Final = 4096


class WatchLines:
    """The records of the shadows, and what is said of conversations between them."""

    def __init__(
        self, write: Callable[[str], object], form: str | None, interval_ns: int, first_ns: int
    ) -> None:
        self._write = write
        self._lines = None if form is None else JsonLines(write, interval_ns)
        self._interval_ns = interval_ns
        self._first_ns = first_ns
        self._known: dict[tuple[str, Outputs] | None, str] = {}  # lines of JSON without their beginning

    def scan(self, scan: int, changed: Sequence[StatusEdge], lacking: Sequence[str]) -> None:
        if self._lines is not None and not lacking:
            head = self._head(scan)
            self._write("".join([head + self._rest(edge) for edge in changed]))
            return
        for edge in changed:
            self._say(scan, outputs_record(edge) | ({"note": MISSING} if edge.instance in lacking else {}))

    def _head(self, scan: int) -> str:
        time = utc_text(self._first_ns + (scan - 1) * self._interval_ns)
        return f'{{"scan":{scan},"t_ms":{(scan - 1) * self._interval_ns / 1e6!r},"time":"{time}",'

    def _rest(self, edge: StatusEdge) -> str:
        key = None if edge.outputs.error else (edge.instance, edge.outputs)
        known = self._known.get(key)
        if known is None:
            known = json_line(outputs_record(edge))[1:]
            if len(self._known) == MOST_KNOWN:
                self._known.clear()
            if key is not None:
                self._known[key] = known
        return known

    def note(self, ns: int, number: int, text: str) -> None:
        """Write what is said of a conversation; `ns` counts from the first packet."""
        self._say(-(-ns // self._interval_ns) + 1, {"conversation": f"C{number}", "note": text})

    def tell_tap(self, ns: int, record: dict[str, object]) -> None:
        """Write a record that is said of a tap; `ns` counts from 1970. Text stands on stderr already."""
        if self._lines is not None:
            self._lines.write({"time": utc_text(ns), **record})

    def _say(self, scan: int, record: dict[str, object]) -> None:
        ns = self._first_ns + (scan - 1) * self._interval_ns
        if self._lines is not None:
            self._lines.line(scan, {"time": utc_text(ns), **record})
        else:
            self._write(f"{utc_text(ns)}  scan {scan}  {one_line('  '.join(_words(record)))}\n")

    def end(self, played: CaptureOutcome) -> None:
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
                self._write(f"{played.not_run} scans of silence were not run\n")
            return
        record: dict[str, object] = {
            "assigned": [{"id": f"C{number}", "shadows": connects} for number, connects in assigned],
            "unassigned": [{"id": f"C{number}", "why": why} for number, why in unassigned],
            "left_out": {f"C{number}": size for number, size in played.left_out.items()},
        }
        self._lines.write(record | ({"not_run": played.not_run} if played.not_run else {}))


def _words(record: Mapping[str, object]) -> Iterator[str]:
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


def watch(
    paths: Sequence[str], project: Path | None, plc: str | None, dialect: str | None, form: str | None
) -> None:
    """Write lines to stdout, JSON where `form` says so, and to stderr what could not be read."""
    plan, found, troubles = plan_capture(paths, project, plc, dialect)
    first_ns = found.first_ns or 0
    interval = min(task.interval_ns for task in plan.project.tasks)
    lines = WatchLines(sys.stdout.write, form, interval, first_ns)
    player = CapturePlayer(plan, found.all, first_ns, lines)
    player.play(paths)
    lines.end(player.close())
    for line in (*plan.notes, *capture_notes(found, troubles)):
        _say(line)


def watch_stdin(project: Path | None, plc: str | None, dialect: str | None, form: str | None) -> None:
    watch_pipe(take_stdin(with_keyboard=False), project, plc, dialect, form)


def watch_pipe(fd: int, project: Path | None, plc: str | None, dialect: str | None, form: str | None) -> None:
    """Write lines as packets come through a pipe, until it ends, or Ctrl+C or SIGTERM."""
    plan = LivePlan(project, plc, dialect)

    def begin(shadows: ShadowPlan, first_ns: int) -> CapturePlayer:
        return CapturePlayer(
            shadows, (), first_ns, WatchLines(sys.stdout.write, form, plan.interval_ns, first_ns)
        )

    live = LiveWatch(plan, begin)
    stream = PacketStream(fd, live, _say, sys.stdout.flush)
    before = {number: signal.signal(number, lambda *_: stream.pipe.stop()) for number in ENDS}
    try:
        said = stream.take()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    player = live.finish()
    lines = player.lines
    assert isinstance(lines, WatchLines)
    lines.end(player.close())
    for line in (*plan.plan.notes, *said):
        _say(line)


def _say(line: str) -> None:
    sys.stderr.write(f"{line}\n")
