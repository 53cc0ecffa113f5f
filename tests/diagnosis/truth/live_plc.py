"""A PLC on real sockets, on record, and partners outside of it, paced by its scans and not by a clock."""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Condition, Thread
from typing import Any

from trcvtui.engine.controller import fresh_bench
from trcvtui.files import record_reads
from trcvtui.project.file import load_project
from trcvtui.recording.files import RecordTarget
from trcvtui.recording.recorder import make_recorder
from trcvtui.scenario.command import LivePace, RecordedPace
from trcvtui.scenario.report import JsonLines

MOST_SCANS = 3000


class LivePlc:
    """Its bench, and in `lines` what its instances have shown."""

    def __init__(self, text: str, folder: Path) -> None:
        path, self.recording = folder / "plc.toml", folder / "plc.pcapng"
        path.write_text(text)
        self.dialect, self.lines = text.split('"')[1], list[dict[str, Any]]()
        self._recorder = make_recorder(
            RecordTarget(self.recording, overwrite=True), self.recording, waits=True
        )
        with record_reads(self._recorder.reads):
            project = load_project(path)
        self._recorder.__enter__()
        self.bench = fresh_bench(project, "live", self._recorder.seam)
        self._recorder.add_header(self.bench, path, (), is_scenario=False)
        self._report = JsonLines(lambda line: self.lines.append(json.loads(line)), 0)
        self._pace = RecordedPace(LivePace(), self._recorder)
        self._passed, self._is_over = Condition(), False

    def __enter__(self) -> LivePlc:
        return self

    def __exit__(self, *_: object) -> None:
        self.bench.close()
        self._recorder.close()
        with self._passed:
            self._is_over = True
            self._passed.notify_all()

    def run(self, scans: int) -> None:
        for _ in range(scans):
            self._pace.next_scan(self.bench)
            self._report.write_scan(self.bench.runtime.scans, self.bench.runtime.changed)
            with self._passed:
                self._passed.notify_all()

    def until(self, holds: Callable[[], object]) -> None:
        for _ in range(MOST_SCANS):
            if holds():
                return
            self.run(1)
        raise AssertionError(f"not in {MOST_SCANS} scans: {self.lines[-5:]}")

    def port(self) -> int:
        """Return where it listens; scans pass until it does."""
        end = "U1" if self.bench.project.udp_configs else "C1"
        self.until(lambda: self.bench.runtime.listening_port(end))
        return self.bench.runtime.listening_port(end) or 0

    def until_arrived(self, count: int) -> None:
        """Let scans pass until so many bytes have come to the PLC's stack, read or not."""

        def has_come() -> bool:
            (link,) = self.bench.runtime.snapshot().connections
            handles = [handle for _, handle, _ in self.bench.runtime.sockets()]
            return link.bytes_received + sum(map(self.bench._kernel.unread, handles)) >= count

        self.until(has_come)

    def until_done(self, jobs: int) -> None:
        self.until(lambda: sum(one.jobs_done for one in self.bench.runtime.snapshot().instances) >= jobs)

    # -- in a partner's thread

    def passes(self, scans: int) -> None:
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

    def called(self, port: int) -> socket.socket:
        while True:
            try:
                return socket.create_connection(("127.0.0.1", port))
            except ConnectionError:
                self.passes(2)

    def conduct(self, script: str, sock: socket.socket) -> None:
        """Do what a script says: `send 30, wait 3, rst`; the end of the script is a close."""
        for step in script.split(", "):
            verb, _, what = step.partition(" ")
            match verb:
                case "send":
                    sock.sendall(bytes(int(what)))
                case "hex":
                    sock.sendall(bytes.fromhex(what))
                case "iso":
                    sock.sendall(bytes([3, 0, 0, int(what) + 7, 2, 0xF0, 0x80]) + bytes(int(what)))
                case "wait":
                    self.passes(int(what))
                case "read":
                    for _ in range(int(what)):
                        sock.recv(65536)
                case "flood":  # until there was no room five times
                    self._flood(sock)
                case "half-close":
                    sock.shutdown(socket.SHUT_WR)
                    with suppress(ConnectionError):
                        while sock.recv(65536):
                            pass
                case "rst":
                    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        sock.close()

    def _flood(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        refused = 0
        while refused < 5:
            try:
                sock.send(bytes(65536))
            except BlockingIOError:
                refused += 1
                self.passes(1)
        sock.setblocking(True)
