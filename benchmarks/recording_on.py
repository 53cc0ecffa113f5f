"""R1: the scans of an engine that is recorded against those of one that is not, and whether all is kept."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure, against, alternate, percentile, ratios
from benchmarks.paced import PacedEngine
from benchmarks.scans import Scans
from benchmarks.traffic import project, traffic
from trcvtui import clock
from trcvtui.recording.files import RecordTarget
from trcvtui.recording.journal import STEP, CallRecord, RunHeader
from trcvtui.recording.recording import Recording
from trcvtui.recording.writer import WriterProcess

INSTANCES: Final = 64
MESSAGE: Final = 1024
INTERVAL_NS: Final = 10_000_000
LEAD_IN_S: Final = 1.0
WRITE_NS: Final = 3_000_000_000


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the p99 of a scan with a recording against that without, and the DONEs that no file has."""
    with tempfile.TemporaryDirectory() as name:
        folder, lost = Path(name), 0

        def p99(file: Path | None) -> float:
            nonlocal lost
            scans, done = _scans(folder, file, effort.window_s)
            if file is not None:
                lost += max(0, done - _received(file) // MESSAGE)
            return percentile([scan.length / 1000 for scan in scans.scans], 0.99)

        numbers = count()
        pairs = alternate(
            lambda: p99(folder / f"{next(numbers)}.pcapng"), lambda: p99(None), max(2, effort.rounds)
        )
        note = f"{against(pairs, 0, ' us')}; {INSTANCES} instances, 1 KiB in every second scan"
        yield Figure.of("scan p99, recorded / not recorded", ratios(pairs), note=note)
        yield Figure("DONEs that the file has not", str(lost), lost)
        rate = _most_kept(folder / "fast.pcapng")
        note = "messages of 1 KiB, until the file is complete; no run beside it"
        yield Figure("the highest rate that is kept, MB/s", f"{rate:.0f}", rate, note=note)


def _scans(folder: Path, file: Path | None, seconds: float) -> tuple[Scans, int]:
    """Return the scans of a window, and how often all instances were DONE until then."""
    with traffic(INSTANCES, INSTANCES, MESSAGE, 2 * INTERVAL_NS) as ports:
        text = project("T#10ms", ports, INSTANCES, INSTANCES, MESSAGE)
        with PacedEngine(folder, text, INSTANCES, file) as engine:
            begin = engine.count_after(LEAD_IN_S)
            end = engine.count_after(seconds)
        assert end.done > begin.done
        return Scans.read(engine.timing, INTERVAL_NS).between(begin.at_ns, end.at_ns), end.done


def _most_kept(file: Path) -> float:
    """Return the MB/s of messages that a writer process has written, without one that is lost."""
    sink, sent, began = WriterProcess(file, RecordTarget(file)), 0, clock.now_ns()
    sink.add_entries([RunHeader("0", "live", 0, 0, False, "P.toml", (), "/", (), ())])
    while clock.now_ns() < began + WRITE_NS:
        scan = [CallRecord("bench", STEP, (), sent)]
        for number in range(INSTANCES):
            data = (sent + number).to_bytes(8, "big") * (MESSAGE // 8)
            scan.append(CallRecord(f"C{number}", "recv", (number, MESSAGE), (MESSAGE, data)))
        sent += INSTANCES
        sink.add_entries(scan)
        while sink.is_behind:
            sink.advance()
    sink.close()
    seconds = (clock.now_ns() - began) / 1e9
    assert not sink.trouble and _received(file) == sent * MESSAGE
    return sent * MESSAGE / seconds / 1e6


def _received(file: Path) -> int:
    """Return the bytes of all recv in a recording."""
    entries = Recording(file).read_entries()
    got = [one.answer for one in entries if isinstance(one, CallRecord) and one.call == "recv"]
    return sum(len(each[1]) for each in got if isinstance(each, tuple) and isinstance(each[1], bytes))
