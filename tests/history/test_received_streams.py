"""The stream of each CONNECT and ComBuffer has the bytes that DATA had, and those that were dropped."""

from __future__ import annotations

from collections import Counter
from itertools import count
from pathlib import Path

from tests.scenario.scenarios import SCENARIOS
from trcvtui.bench.bench import Bench
from trcvtui.blocks.environment import (
    BufferBytesLost,
    FrameEnded,
    NoiseDropped,
    PartialFrameDropped,
    ReceiveEnded,
    SendEnded,
)
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.messages import MessageRows
from trcvtui.history.records import HistoryRequest, JobSpan, SeekRequest
from trcvtui.history.stream_reader import StreamReader
from trcvtui.net.events import BytesDropped
from trcvtui.scenario.runner import ScenarioRunner, VirtualPace
from trcvtui.scenario.scenario import load_scenario

NOISE = "noise before the prefix"


class Compared(VirtualPace):
    """After each scan the stream is asked for what the ledger says of that scan, and DATA holds after it."""

    def __init__(self, bench: Bench) -> None:
        ledger = LedgerReader(bench)
        self.reader = StreamReader(bench, ledger)
        self.rows = MessageRows(bench, ledger, self.reader.streams)
        self.bench, self.found = bench, Counter[str]()
        self._frames, self._seeks, self._seq = Counter[str](), count(1), 0

    def next_scan(self, bench: Bench) -> None:
        super().next_scan(bench)
        events = [event for scan, _, event in bench.runtime.ledger.events_since(self._seq)]
        self._seq = bench.runtime.ledger.last_seq
        in_data: dict[str, tuple[str, str, int, int]] = {}  # by variable: the newest job of the scan
        drops: Counter[tuple[str, int, str]] = Counter()
        ended: Counter[tuple[str, int, int, str]] = Counter()
        for event in events:
            match event:
                case ReceiveEnded(instance, number, connect, _, _, size, True):
                    in_data[self._data(instance)] = connect, instance, number, size
                    ended[instance, number, size, ""] += 1
                case ReceiveEnded(instance, number, size=size, reason=reason) if size:
                    ended[instance, number, size, reason] += 1
                case FrameEnded(instance, buffer, _, size, number=number):
                    self._frames[instance] += 1
                    assert number == self._frames[instance]
                    in_data[self._data(instance)] = buffer, instance, number, size
                    ended[instance, number, size, ""] += 1
                case SendEnded(instance, number, size=size, done=done, reason=reason) if done or size:
                    ended[instance, number, size, "" if done else reason] += 1
                case BytesDropped():
                    drops[event.connection, event.size, event.reason] += 1
                case NoiseDropped():
                    drops[event.buffer, event.size, NOISE] += 1
                case PartialFrameDropped():
                    drops[event.buffer, event.size, f"incomplete, {event.reason}"] += 1
                case BufferBytesLost() if event.buffer != "TX":  # what is sent was not received
                    drops[event.buffer, event.size, event.reason] += 1
        rows = [(name, row) for name, row in self.rows.take_rows()]
        assert ended == Counter((name, row.number, row.size, row.reason) for name, row in rows)
        contents = {(name, row.number): row.content for name, row in rows if not row.reason}
        for data, (name, instance, number, size) in in_data.items():
            if data:
                self._job(name, instance, number, bench.runtime.data(data, size))
                assert contents[instance, number] == bench.runtime.data(data, size)
        for name, row in rows:
            shown = bench.runtime.instance_snapshot(name)
            assert shown is None or (row.scan, row.status) == (bench.runtime.scans, shown.outputs.status)
            assert row.content is not None and len(row.content) == row.size
        names = {name for name, _, _ in drops}
        assert drops == Counter((n, job.whole, job.reason) for n in names for job in self._dropped(n))
        self.found["drops"] += drops.total()

    def _data(self, instance: str) -> str:
        decl = self.bench.project.instance(instance)
        return (decl.data or "") if decl is not None else ""

    def _job(self, name: str, instance: str, number: int, content: bytes) -> None:
        seek = SeekRequest(next(self._seeks), 0, False, job=(instance, number))
        sought = self.reader.read_window(HistoryRequest(name, seek=seek)).sought
        assert sought is not None and sought.position is not None
        window = self.reader.read_window(HistoryRequest(name, sought.position, 8192, job_at=sought.position))
        assert window.job == (sought.position, content) or not content
        job = next(job for job in window.jobs if job.number == number and job.instance == instance)
        assert (job.whole, job.scan, job.done) == (len(content), self.bench.runtime.scans, True)
        assert window.content[: job.size] == content[: job.size][:8192]
        self.found["jobs"] += 1

    def _dropped(self, name: str) -> list[JobSpan]:
        scan, window = self.bench.runtime.scans, self.reader.read_window(HistoryRequest(name, size=8192))
        assert all(job.scan for job in window.jobs), "of each byte it is known whose it is"
        return [job for job in window.jobs if not (job.done or job.is_open or job.first) and job.scan == scan]


def compared(path: Path) -> Compared:
    """Return what was found in the run of a scenario file."""
    scenario = load_scenario(path)
    bench = Bench(scenario.project, "sim")
    found = Compared(bench)
    ScenarioRunner(bench, scenario.name, found, lambda *_: None).play([*scenario.start, *scenario.steps])
    bench.close()
    return found


def test_every_scenario_has_the_same_jobs_and_drops_in_data_and_stream() -> None:
    found = Counter[str]()
    for path in SCENARIOS:
        found += compared(path).found
    assert found["jobs"] > 900 and found["drops"] > 80


def test_the_end_of_a_datagram_that_had_no_room_has_a_place_without_values() -> None:
    spans = {}
    for stem in ("udp-80aa-datagram-too-large", "udp-large-datagram-cut"):
        (path,) = [path for path in SCENARIOS if path.stem == stem]
        window = compared(path).reader.read_window(HistoryRequest("U1", size=8192))
        spans[stem] = [(job.number, job.size, job.whole, job.done, job.is_kept) for job in window.jobs]
    too_large, cut = spans.values()
    assert too_large[:2] == [(1, 8, 9, False, True), (1, 1, 9, False, False)]
    assert cut[:2] == [(1, 4, 4, True, True), (1, 2, 2, False, False)]
