"""`watch FILE` on the screen: the run that `watch --format jsonl` prints, to go to and fro in."""

from __future__ import annotations

import json
import os
from collections import defaultdict
from pathlib import Path

import pytest

from tests.line.test_watch import Watch, project, stream, watch
from tests.recording.wire import ACK, FIN, NS, RST, answer, capture, handshake, tcp, udp
from trcvtui import clock
from trcvtui.cli.main import main
from trcvtui.engine.driver import ProcessDriver
from trcvtui.history.records import MAX_SCAN
from trcvtui.line.on_screen import _play_shadows, watch_main
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.plc.ledger import PeerSent
from trcvtui.replay.time_line import ReplayNavigator

__all__ = ["watch"]


def work(line: ReplayNavigator) -> None:
    while line.advance(clock.now_ns() + 10_000_000):
        pass


def at(line: ReplayNavigator, text: str) -> tuple[int, list[str], tuple[str, ...]]:
    """Go there; return the scan, what the instances show, and what is told beside."""
    line.handle_line(1, f"at {text}")
    work(line)
    update = line.make_picture(UpdateRequest())
    position = update.position
    assert position is not None
    shows = [f"{one.outputs.status:04X}" for one in line.controller.bench.runtime.snapshot().instances]
    return position.scan, shows, position.beside


@pytest.mark.parametrize("by_plc", [False, True])
def test_each_edge_of_the_screen_is_a_line_of_watch(watch: Watch, tmp_path: Path, by_plc: bool) -> None:
    end = [tcp(seq=120, ack=501, flags=FIN | ACK), answer(seq=501, ack=121, flags=FIN | ACK)]
    end = [answer(seq=501, ack=120, flags=RST | ACK)] if by_plc else end
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


def test_a_month_of_silence_is_as_short_to_keep_as_a_second(watch: Watch, tmp_path: Path) -> None:
    bench, month_ms = project(tmp_path), 30 * 86_400_000
    watch([*handshake(), *stream(12, 12)], "--project", str(bench), step_ms=month_ms)
    line = shown(watch.path, bench)
    work(line)
    assert len(line.survey.times) < 1000 and line.survey.last_scan > 4 * month_ms // 10
    for scan in (1, 2, 1_000_000, month_ms // 10, 3 * month_ms // 10 + 77):
        ns = line.survey.time_of(scan)
        assert ns == (scan - 1) * 10_000_000
        assert line.survey.scan_at(ns) == scan == line.survey.scan_at(ns - 1)
        assert at(line, str(scan))[0] == scan


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


def test_the_time_of_a_capture_is_that_of_its_packets(watch: Watch, tmp_path: Path) -> None:
    watch([*handshake(), *stream(12)], "--project", str(project(tmp_path)))
    line = shown(watch.path, project(tmp_path))
    update = line.make_picture(UpdateRequest())
    assert update.kernel == "capture" and update.position is not None and update.position.first_ns == NS


def test_messages_have_the_times_of_their_packets_after_scans_that_are_not_run(
    watch: Watch, tmp_path: Path
) -> None:
    watch([*handshake(), *stream(12, 12)], "--project", str(project(tmp_path)), step_ms=60_000)
    line = shown(watch.path, project(tmp_path))
    work(line)
    while (
        delta := line.make_picture(UpdateRequest(messages=("R1", 0, MAX_SCAN))).messages
    ) is None or delta.share < 1:
        work(line)
    assert [row.t_ns for row in delta.rows] == [180_000_000_000, 300_000_000_000]


def test_a_shadow_with_another_length_is_drawn_beside(watch: Watch, tmp_path: Path) -> None:
    bench = project(tmp_path)
    seen = watch([*handshake(), *stream(6, 6, 6, 6)], "--project", str(bench), step_ms=60_000)
    assert next(r["scan"] for r in seen.of("R1") if r["DONE"]) > 18_001
    line = shown(watch.path, bench)
    line.handle_line(1, "if instance.R1.LEN=6")
    work(line)
    position = line.make_picture(UpdateRequest()).position
    assert position is not None
    first, *_ = position.what_if
    assert first.startswith("what if instance.R1.LEN=6: first difference at scan ")
    assert position.scan == position.parts_at == 18_001


def test_an_ad_hoc_shadow_takes_another_value_and_refuses_what_it_has_not(
    watch: Watch, tmp_path: Path
) -> None:
    watch([*handshake(), *stream(6, 6)])
    line = _play_shadows([str(watch.path)], (None, None, None), tmp_path / "shadows.pcapng")
    line.handle_line(1, "if instance.C1_TO_PLC.LEN=4")
    work(line)
    assert line._beside is not None and line._beside.run.parts_at
    line.handle_line(1, "if instance.NOBODY.LEN=4")
    assert "C1_TO_PLC, C1_FROM_PLC" in line.controller._answers[-1].error
    line.handle_line(1, "if dialect s7-1500")
    work(line)
    assert line._beside.run.parts_at


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="needs /proc")
def test_nothing_is_left_in_the_folder_for_such_while_a_capture_is_shown(
    watch: Watch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    watch([*handshake(), *stream(12)])
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr("tempfile.tempdir", None)
    driver = ProcessDriver(watch_main, [str(watch.path)], (None, None, None))
    assert driver.wait_for_project().instances
    assert not [*(tmp_path / "tmp").iterdir()]
    driver.close()


def test_without_a_project_the_messages_are_those_of_the_command_at_their_scans(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = [tcp(bytes(range(7)), 101, 501), tcp(bytes(range(7, 12)), 108, 501)]  # 3 ms: no pause
    said = [answer(b"thanks", 501, 113), tcp(seq=113, ack=507), tcp(seq=113, ack=507)]
    packets = [*handshake(), *parts, *said, *stream(6, 6, seq=113), udp(b"a datagram")]
    path = tmp_path / "c.pcapng"
    path.write_bytes(capture(packets, step_ns=3_000_000))
    assert main(["messages", str(path), "--format", "jsonl"]) == 0
    told = defaultdict(list)
    for row in map(json.loads, capsys.readouterr().out.splitlines()):
        told[row["direction"]].append((row["length"], row["hex"], row["t_s"], row["reason"] or ""))
    line = shown(path, None)
    work(line)
    found = defaultdict(list)
    for decl in line.controller.bench.project.instances:
        asked = UpdateRequest(messages=(decl.name, 0, MAX_SCAN), bench=line.controller._bench_number)
        news = line.make_picture(asked).messages
        assert news is not None and news.share == 1 and not news.are_typed
        for row in news.rows:
            assert row.content is not None and line.survey.scan_at(row.t_ns) == row.scan
            place = (row.size, row.content.hex(" "), row.t_ns / 1e9, row.reason)
            found["from PLC" if "FROM" in decl.name else "to PLC"].append(place)
    assert {way: sorted(rows) for way, rows in told.items()} == {
        way: sorted(rows) for way, rows in found.items()
    }
    assert {row[0] for row in found["to PLC"]} == {12, 6, 10}


def shown(path: Path, bench: Path | None) -> ReplayNavigator:
    return _play_shadows([str(path)], (bench, None, None), path.parent / "shadows.pcapng")


def test_what_is_no_capture_is_told_before_there_is_a_screen(tmp_path: Path) -> None:
    (tmp_path / "no.pcapng").write_bytes(b"no capture at all")
    driver = ProcessDriver(watch_main, [str(tmp_path / "no.pcapng")], (None, None, None))
    with pytest.raises(Exception, match="a capture"):
        driver.wait_for_project()
    driver.close()
