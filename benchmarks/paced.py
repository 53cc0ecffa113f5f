"""The live engine at its own pace in its own process, without a screen, with as many connections as asked."""

from __future__ import annotations

import multiprocessing
import os
import time
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from msgspec.structs import replace

from trcvtui.clock import now_ns
from trcvtui.engine.controller import fresh_bench
from trcvtui.engine.engine import TIMING_FILE, Engine
from trcvtui.engine.screens import AttachedScreens
from trcvtui.files import record_reads
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.picture.update_pipe import UpdateReader
from trcvtui.plc.snapshot import Snapshot
from trcvtui.project.file import load_project
from trcvtui.recording.files import RecordTarget
from trcvtui.recording.recorder import make_recorder

LOOK_S: Final = 0.05
MOST_LOOKS: Final = 400
END_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class Count:
    """What the instances had done after so many scans; when that was asked, the time of the scan."""

    at_ns: int
    t_ns: int
    scans: int
    done: int
    each: tuple[int, ...]  # of the instances


class PacedEngine:
    """One engine; `timing` is written when it ends."""

    def __init__(self, folder: Path, project: str, connections: int, record: Path | None = None) -> None:
        self.timing = folder / "timing.json"
        file = folder / "bench.toml"
        file.write_text(project)
        context = multiprocessing.get_context("spawn")
        self._channel, theirs = context.Pipe()
        self._reader = UpdateReader(self._channel)
        self._process = context.Process(
            target=_run, args=(theirs, file, self.timing, connections, record), daemon=True
        )
        self._process.start()
        theirs.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self._channel.close()
        self._process.join(END_S)
        self._process.kill()

    def ports(self, count: int) -> list[int]:
        """Return the ports that the CONNECTs listen on, as soon as all of them do."""
        for _ in range(MOST_LOOKS):
            ends = [connection.local for connection in self._snapshot().connections]
            ports = [int(end.rpartition(":")[2]) for end in ends if end]
            if len(ports) == count:
                return ports
            time.sleep(LOOK_S)
        raise TimeoutError(f"{len(ports)} of {count} CONNECTs listen")

    def say(self, *lines: str) -> None:
        """Let the engine carry out bench command lines; return when it has."""
        for line in lines:
            self._channel.send((0, line))
        self._snapshot()

    def let_pass(self, scans: int) -> None:
        """Let so many scans pass while holding."""
        last = self._snapshot().scan + scans
        self.say(f"run {scans}")
        while self._snapshot().scan < last:
            time.sleep(LOOK_S)

    def count_after(self, seconds: float) -> Count:
        """Let so much time pass, then count."""
        time.sleep(seconds)
        seen = self._snapshot()
        each = tuple(instance.jobs_done for instance in seen.instances)
        return Count(now_ns(), seen.t_ns, seen.scan, sum(each), each)

    def _snapshot(self) -> Snapshot:
        self._channel.send(UpdateRequest(most_lines=0))
        while (picture := self._reader.next()) is None:
            self._channel.poll(None)
        assert isinstance(picture, BenchUpdate)
        return picture.snapshot


def _run(channel: Channel, file: Path, timing: Path, connections: int, record: Path | None) -> None:
    """Run until the channel is closed."""
    os.environ[TIMING_FILE] = str(timing)
    recorder = None if record is None else make_recorder(RecordTarget(record), record, waits=False)
    with suppress(EOFError, OSError), recorder or nullcontext():
        with record_reads(recorder.reads) if recorder is not None else nullcontext():
            project = replace(load_project(file, ()), connection_limit=connections)  # no model has that many
        bench = fresh_bench(project, "live", recorder.seam if recorder is not None else None)
        if recorder is not None:
            recorder.add_header(bench, file, (), is_scenario=False)
        Engine(AttachedScreens(channel, project, False, None), bench, recorder).run()
