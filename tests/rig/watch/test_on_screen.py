"""`watch FILE` on the screen: the run that `watch --format jsonl` prints, to go to and fro in."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.capture.wire import ACK, FIN, NS, answer, handshake, tcp
from tests.rig.watch.test_watch import Watch, project, stream, watch
from trcvtui.plc.ledger import PeerSent
from trcvtui.rig import clock
from trcvtui.rig.bench_update import UpdateRequest
from trcvtui.rig.replay.time_line import TimeLine
from trcvtui.rig.watch.on_screen import WatchDriver, _played

__all__ = ["watch"]


def work(line: TimeLine) -> None:
    while line.work(clock.now_ns() + 10_000_000):
        pass


def at(line: TimeLine, text: str) -> tuple[int, list[str], tuple[str, ...]]:
    """Go there; return the scan, what the instances show, and what is told beside."""
    line.take(1, f"at {text}")
    work(line)
    update = line.collect(UpdateRequest()).update
    position = update.position
    assert position is not None
    shows = [f"{one.outputs.status:04X}" for one in line.controller.bench.runtime.snapshot().instances]
    return position.scan, shows, position.beside


def test_each_edge_of_the_screen_is_a_line_of_watch(watch: Watch, tmp_path: Path) -> None:
    end = [tcp(seq=120, ack=501, flags=FIN | ACK), answer(seq=501, ack=121, flags=FIN | ACK)]
    bench = project(tmp_path)
    seen = watch([*handshake(), *stream(12, 7), *end], "--project", str(bench), step_ms=700)
    line = shown(watch.path, bench)
    work(line)
    assert [*line.survey.edges["R1"]] == [r["scan"] for r in seen.of("R1")]
    assert line.survey.trouble == ""
    for record in seen.of("R1"):
        scan, shows, _ = at(line, str(record["scan"]))
        assert (scan, shows) == (record["scan"], [record["STATUS"]])
        assert line.survey.time_of(scan) == round(record["t_ms"] * 1e6)


def test_scans_in_which_nothing_happened_can_be_gone_to(watch: Watch, tmp_path: Path) -> None:
    bench = project(tmp_path)
    seen = watch([*handshake(), *stream(12, 12)], "--project", str(bench), step_ms=60_000)
    line = shown(watch.path, bench)
    work(line)
    first, second = [r["scan"] for r in seen.of("R1") if r["DONE"]]
    assert second - first > 5000
    for scan in (second - 3000, first + 7, second - 1, first, second):
        assert at(line, str(scan))[0] == scan
        jobs = line.controller.bench.runtime.snapshot().instances[0].jobs_done
        assert jobs == (2 if scan == second else 1)
    assert at(line, "T#2m10s")[0] == 13_001


def test_missing_bytes_are_told_from_their_scan_on(watch: Watch, tmp_path: Path) -> None:
    first, _, _, *rest = stream(12, 5, 7, 12)
    packets = [*handshake(), first, *rest, answer(seq=501, ack=137)]
    seen = watch(packets, "--project", str(project(tmp_path)))
    line = shown(watch.path, project(tmp_path))
    work(line)
    missing = next(r["scan"] for r in seen.records if "missing" in str(r.get("note")))
    assert not any("missing" in text for text in at(line, str(missing - 2))[2])
    hole, job = at(line, "end")[2]
    lines = [one.event for one in line.controller.bench.runtime.ledger]
    sent = [(one.peer, one.offset, one.size) for one in lines if isinstance(one, PeerSent)]
    assert sent == [("packet:", 0, 12), ("missing:", 12, 5), ("packet:", 17, 7), ("packet:", 24, 12)]
    assert hole.endswith("C1: ? 5 bytes missing in the capture, to the PLC end, from byte 12")
    assert job.endswith("R1: ? missing in the capture")


def test_the_time_of_a_capture_is_that_of_its_packets_and_what_if_says_what_it_needs(
    watch: Watch, tmp_path: Path
) -> None:
    watch([*handshake(), *stream(12)], "--project", str(project(tmp_path)))
    line = shown(watch.path, project(tmp_path))
    update = line.collect(UpdateRequest()).update
    assert update.kernel == "capture" and update.position is not None and update.position.first_ns == NS
    line.take(1, "if instance.R1.EN_R=0")
    assert "what-if on a capture" in line.controller._answers[-1].error


def shown(path: Path, bench: Path) -> TimeLine:
    return _played([str(path)], (bench, None, None), path.parent / "shadows.pcapng")


def test_what_is_no_capture_is_told_before_there_is_a_screen(tmp_path: Path) -> None:
    (tmp_path / "no.pcapng").write_bytes(b"no capture at all")
    driver = WatchDriver([str(tmp_path / "no.pcapng")], (None, None, None))
    with pytest.raises(Exception, match="a capture"):
        driver.project()
    driver.close()
