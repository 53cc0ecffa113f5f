"""A PLC on real sockets, on record, and partners outside of it, paced by its scans and not by a clock."""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Condition, Thread
from typing import Any

from trcvtui.files import noting_reads
from trcvtui.project.file import load_project
from trcvtui.rig.engine.controller import fresh_bench
from trcvtui.rig.recording.files import RecordTo
from trcvtui.rig.recording.recorder import recorder_of
from trcvtui.rig.scenario.command import LivePace, RecordedPace
from trcvtui.rig.scenario.report import JsonLines

MOST_SCANS = 3000


class LivePlc:
    """Its bench, its port, and as jsonl what its instances have shown."""

    def __init__(self, text: str, folder: Path) -> None:
        path, self.recording = folder / "plc.toml", folder / "plc.pcapng"
        path.write_text(text)
        self.lines: list[str] = []
        self._recorder = recorder_of(RecordTo(self.recording, overwrite=True), self.recording, waits=True)
        with noting_reads(self._recorder.reads):
            project = load_project(path)
        self._recorder.__enter__()
        self.bench = fresh_bench(project, "live", self._recorder.seam)
        self._recorder.begin(self.bench, path, (), is_scenario=False)
        self._report = JsonLines(self.lines.append, self.bench.runtime.interval_ns)
        self._pace = RecordedPace(LivePace(), self._recorder)
        self._passed, self._is_over = Condition(), False

    def scan(self) -> None:
        self._pace.next_scan(self.bench)
        self._report.scan(self.bench.runtime.scans, self.bench.runtime.changed)
        with self._passed:
            self._passed.notify_all()

    def until(self, holds: Callable[[], object]) -> None:
        for _ in range(MOST_SCANS):
            if holds():
                return
            self.scan()
        raise AssertionError(f"not in {MOST_SCANS} scans: {self.lines[-5:]}")

    def run(self, scans: int) -> None:
        for _ in range(scans):
            self.scan()

    @property
    def port(self) -> int:
        """Return where it listens; scans pass until it does."""
        end = "U1" if self.bench.project.udp_configs else "C1"
        self.until(lambda: self.bench.runtime.listening_port(end))
        return self.bench.runtime.listening_port(end) or 0

    def until_arrived(self, count: int) -> None:
        """Let scans pass until so many bytes have come to the PLC's stack on C1, read or not."""

        def has_come() -> bool:
            (link,) = self.bench.runtime.snapshot().connections
            handles = [handle for _, handle, _ in self.bench.runtime.sockets()]
            return link.bytes_received + sum(map(self.bench._kernel.unread, handles)) >= count

        self.until(has_come)

    def until_done(self) -> None:
        """Let scans pass until one more job is done."""
        before = self.done
        self.until(lambda: self.done > before)

    @property
    def done(self) -> int:
        return sum(one.jobs_done for one in self.bench.runtime.snapshot().instances)

    def called(self, port: int) -> socket.socket:
        """Call the PLC in a partner's thread, until it listens."""
        while True:
            try:
                return socket.create_connection(("127.0.0.1", port))
            except ConnectionError:
                self.passes(2)

    def passes(self, scans: int) -> None:
        """Wait in a partner's thread until so many scans have passed."""
        until = self.bench.runtime.scans + scans
        with self._passed:
            assert self._passed.wait_for(lambda: self._is_over or self.bench.runtime.scans >= until, 60)

    def beside(self, partner: Callable[[], object]) -> None:
        """Let scans pass while a partner does what it does in a thread, and some more."""
        raised: list[BaseException] = []

        def conduct() -> None:
            try:
                partner()
            except BaseException as error:
                raised.append(error)

        thread = Thread(target=conduct, daemon=True)
        thread.start()
        self.until(lambda: not thread.is_alive())
        self.run(20)
        for error in raised:
            raise error

    def close(self) -> None:
        """End the run and its recording, once."""
        if self._is_over:
            return
        with self._passed:
            self._is_over = True
            self._passed.notify_all()
        self.bench.close()
        self._recorder.close()


@contextmanager
def live_plc(text: str, folder: Path) -> Iterator[LivePlc]:
    plc = LivePlc(text, folder)
    try:
        yield plc
    finally:
        plc.close()


def shown(lines: list[dict[str, Any]]) -> list[tuple[Any, ...]]:
    """Return what instances show, by scan."""
    keys = ("scan", "instance", "STATUS", "BUSY", "DONE", "ERROR", "RCVD_LEN")
    return sorted((tuple(line.get(key) for key in keys) for line in lines), key=str)


def read(lines: list[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in lines]


def resets(sock: socket.socket) -> None:
    """Close with an RST."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    sock.close()


def fill(sock: socket.socket, plc: LivePlc) -> None:
    """Send until there was no room five times."""
    sock.setblocking(False)
    refused = 0
    while refused < 5:
        try:
            sock.send(bytes(65536))
        except BlockingIOError:
            refused += 1
            plc.passes(1)
    sock.setblocking(True)
