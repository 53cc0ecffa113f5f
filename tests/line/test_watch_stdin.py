"""`trcvtui watch -`: a stream that grows shows what the file shows, as it comes."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from msgspec.msgpack import encode

from tests.line.test_watch import Record, Watch, project, stream, watch
from tests.recording.wire import ACK, FIN, NS, RST, SYN, answer, capture, handshake, tcp, udp
from trcvtui.capture.pcap import STATISTICS_BLOCK, CaptureReader, make_block
from trcvtui.cli.main import main
from trcvtui.diagnosis.judges import FilesJudge
from trcvtui.errors import UserError
from trcvtui.line import live
from trcvtui.line.capture_player import CapturePlayer
from trcvtui.line.live import TOO_FAST_TEXT, LivePlan, LiveWatch, PacketBuffer, PacketStream
from trcvtui.line.live_screen import ShadowServer
from trcvtui.line.shadows import ShadowPlan
from trcvtui.line.watch_command import WatchLines, watch_pipe
from trcvtui.net.os import packet_pipe
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.picture.update_pipe import UpdateReader

__all__ = ["watch"]
LINE = """
[[watch]]
name = "W"
plc = "{plc}"
connect = "C1"
"""


class Pieces:
    """Plays a capture to `watch -` in pieces, without a pipe or a clock."""

    def __init__(self, asked: tuple[Path | None, str | None, str | None] = (None, None, None)) -> None:
        self.printed: list[str] = []
        self.plan = LivePlan(*asked)
        self.live = LiveWatch(self.plan, self._begin)

    def _begin(self, plan: ShadowPlan, first_ns: int) -> CapturePlayer:
        self.lines = WatchLines(self.printed.append, "jsonl", self.plan.interval_ns, first_ns)
        return CapturePlayer(plan, (), first_ns, self.lines)

    def take(self, content: bytes, next_cut: Callable[[], int]) -> None:
        """Let it come in pieces; time does not go on between them."""
        at = 0

        def read(_: int) -> bytes:
            nonlocal at
            if known:
                self.live.advance_to_packet(known[0].last_ns)
            piece = content[at : at + next_cut()]
            at += len(piece)
            return piece

        known: list[CaptureReader] = []
        known.append(CaptureReader(read, "stdin"))
        self.live.found.names = known[0].interface_name
        self.live.found.add_packets(known[0], known[0].link_types)

    def end(self) -> list[Record]:
        played = self.live.finish().close()
        self.lines.write_outcome(played)
        return self.records()

    def records(self) -> list[Record]:
        return [json.loads(line) for line in "".join(self.printed).splitlines()]


def conversation(partner: int, chance: random.Random) -> list[bytes]:
    at = ("10.0.0.9", 50_000 + partner)
    plc = ("10.0.0.5", 2000 + partner)

    def there(data: bytes = b"", seq: int = 0, ack: int = 0, flags: int = ACK) -> bytes:
        return tcp(data, seq, ack, flags, source=at, target=plc)

    def back(data: bytes = b"", seq: int = 0, ack: int = 0, flags: int = ACK) -> bytes:
        return tcp(data, seq, ack, flags, source=plc, target=at)

    said = handshake(source=at, target=plc) if chance.random() < 0.7 else []
    seq, ack = 101, 501
    for _ in range(chance.randrange(1, 12)):
        size = chance.randrange(1, 30)
        said.append(there(chance.randbytes(size), seq, ack))
        seq += size
        if chance.random() < 0.2:
            said.append(said[-1])
        elif chance.random() < 0.15:
            said.pop()
        size = chance.choice([0, 0, chance.randrange(1, 2000)])
        said.append(back(chance.randbytes(size), ack, seq))
        ack += size
    end = chance.choice(["", "fin", "rst"])
    return [*said, *([there(seq=seq, ack=ack, flags=(FIN if end == "fin" else RST) | ACK)] if end else [])]


@pytest.mark.parametrize("seed", range(12))
def test_any_cuts_print_what_the_file_prints(seed: int, watch: Watch, tmp_path: Path) -> None:
    chance = random.Random(seed)
    talks = [conversation(n, chance) for n in range(chance.randrange(1, 4))]
    mixed = [
        talk.pop(0) for _ in range(3) for talk in talks if talk
    ]  # soon: shadows are there from scan 1 on
    built = len(mixed)
    while talks := [talk for talk in talks if talk]:
        mixed.append(chance.choice(talks).pop(0))
    bench = project(tmp_path, LINE.format(plc="10.0.0.5:2000")) if seed % 3 == 0 else None
    words = [] if bench is None else ["--project", str(bench)]
    seen = watch(mixed, *words, step_ms=chance.choice([1, 3, 12 if bench or built < 4 else 2]))
    pieces = Pieces((bench, None, None))
    most = chance.choice([1, 7, 100, 5000])
    pieces.take(watch.path.read_bytes(), lambda: chance.randrange(most) + 1)
    assert pieces.end() == seen.records


def test_who_begins_to_talk_later_gets_shadows_then() -> None:
    later = conversation(1, random.Random(5))
    pieces = Pieces()
    pieces.take(capture([*handshake(), *stream(12, 12, 12, 12), *later], step_ns=30_000_000), lambda: 50)
    records = pieces.end()
    first = next(r for r in records if r.get("instance") == "C2_TO_PLC")
    assert first["scan"] > 10
    jobs = [r["RCVD_LEN"] for r in records if r.get("instance") == "C2_TO_PLC" and r["DONE"]]
    assert jobs
    shadows = [each["shadows"] for each in records[-1]["assigned"]]
    assert shadows == [["C1", "C1_BACK"], ["C2", "C2_BACK"]]


def test_a_line_of_a_project_waits_from_scan_1_on_and_follows_who_calls(tmp_path: Path) -> None:
    calls = {"active": "true", "local": 0, "remote": "10.0.0.9", "port": 3000}
    asked = project(tmp_path, LINE.format(plc="10.0.0.5"), **calls), None, None
    quiet = [udp(b"x")] * 60
    pieces = Pieces(asked)
    pieces.take(capture([*quiet, *handshake(), *stream(12)], step_ns=10_000_000), lambda: 100)
    records = pieces.end()
    shown = [(r["scan"], r["STATUS"]) for r in records if r.get("instance") == "R1"]
    assert shown[0] == (1, "0001")
    assert [status for scan, status in shown if scan > 60][-2:] == ["7008", "7006"]


def test_time_goes_on_while_nothing_comes() -> None:
    pieces = Pieces()
    pieces.take(capture([*handshake(), *stream(12)], step_ns=1_000_000), lambda: 1000)
    assert not any(r["DONE"] for r in pieces.records())
    pieces.live.advance_to_packet(NS + 4_000_000)
    pieces.live.handle_idle(20_000_000)
    assert not any(r["DONE"] for r in pieces.records())
    for ms in range(30, 100, 10):
        pieces.live.handle_idle(ms * 1_000_000)
    assert [r["scan"] for r in pieces.records() if r["DONE"] and r["instance"] == "C1_TO_PLC"]
    player = pieces.live.player
    assert player is not None
    scans = player.shadows.bench.runtime.scans
    pieces.live.handle_idle(900_000_000)
    assert player.shadows.bench.runtime.scans == scans
    pieces.live.handle_idle(61_000_000_000)
    assert player.shadows.network.now_ns == 60_000_000_000 + 4_000_000


def test_a_new_conversation_has_the_place_of_one_that_fell_silent() -> None:
    old = [*handshake(), *stream(12)]
    source = ("10.0.0.9", 52_000)
    data = [tcp(bytes(n + 1), 101 + n * (n + 1) // 2, 501, source=source) for n in range(15)]
    pieces = Pieces()
    pieces.take(capture([*old, *handshake(source=source), *data], step_ns=1_000_000_000), lambda: 1000)
    records = pieces.end()
    assert "unassigned: it overlaps C1" in [r.get("note") for r in records]
    sizes = [r["RCVD_LEN"] for r in records if r.get("instance") == "C1_TO_PLC" and r["DONE"]]
    assert sizes[0] == 12
    assert sizes[-1] == 15


def test_who_has_talked_is_forgotten(tmp_path: Path) -> None:
    packets = []
    for number in range(400):
        at = ("10.0.0.9", 10_000 + number)
        packets += [*handshake(source=at), tcp(b"hello", 101, 501, source=at)]
        packets += [tcp(seq=106, ack=501, flags=RST | ACK, source=at)]
    pieces = Pieces()
    pieces.take(capture(packets, step_ns=500_000_000), lambda: 4000)
    assert len(pieces.live.found.all) < 60
    assert len(pieces.live.found._flows) < 120
    assert len(pieces.live.found._kept) < 60
    records = pieces.end()
    assert sum(r["DONE"] for r in records if r.get("instance") == "C1_TO_PLC") == 400


# -- the pipe ------------------------------------------------------------------------------------------------


def run(content: bytes, tmp_path: Path, *words: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "trcvtui", "watch", "-", "--format", "jsonl", *words],
        input=content,
        capture_output=True,
        timeout=60,
    )


def test_a_pipe_prints_what_the_file_prints(watch: Watch, tmp_path: Path) -> None:
    end = [tcp(seq=120, ack=501, flags=FIN | ACK), answer(seq=501, ack=121, flags=FIN | ACK)]
    seen = watch([*handshake(), *stream(12, 7), *end])
    done = run(watch.path.read_bytes(), tmp_path)
    assert (done.returncode, done.stderr) == (0, b"")
    assert [json.loads(line) for line in done.stdout.splitlines()] == seen.records
    cut = run(watch.path.read_bytes()[:-10], tmp_path)
    assert cut.returncode == 0
    assert b"the end of the file after" in cut.stderr
    assert b"only the packets before that are read" in cut.stderr


def test_a_packet_is_shown_while_the_pipe_is_open(watch: Watch) -> None:
    watch.path.write_bytes(capture([*handshake(), *stream(12)]))
    reads, writes = os.pipe()
    shown, shows = os.pipe()
    printed = os.fdopen(shown, "rb")
    with subprocess.Popen(
        [sys.executable, "-m", "trcvtui", "watch", "-", "--format", "jsonl"], stdin=reads, stdout=shows
    ) as process:
        os.close(reads)
        os.close(shows)
        os.write(writes, watch.path.read_bytes())
        lines: list[Record] = []
        while not lines or not lines[-1]["DONE"]:
            lines.append(json.loads(printed.readline()))
        assert lines[-1]["RCVD_LEN"] == 12
        process.terminate()  # the pipe is still open
        last = json.loads(printed.read().splitlines()[-1])
        assert last["assigned"] == [{"id": "C1", "shadows": ["C1", "C1_BACK"]}]
        assert process.wait(20) == 0
        os.close(writes)
    printed.close()


def test_a_packet_is_played_within_100_ms_of_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [1.0]
    monkeypatch.setattr(time, "monotonic_ns", lambda: round(clock[0] * 1e9))
    pieces = Pieces()
    reads, writes = os.pipe()
    os.write(writes, capture([*handshake(), *[udp(b"x")] * 20, *stream(12)], step_ns=10_000_000))

    def wait(idle_ns: int) -> None:
        clock[0] += packet_pipe.TICK_S
        pieces.live.handle_idle(idle_ns)
        if writes not in closed and any(r.get("DONE") for r in pieces.records()):
            os.close(writes)
            closed.append(writes)

    closed: list[int] = []
    pipe = packet_pipe.PacketPipe(reads, wait)
    pieces.take(pipe.read(1), lambda: 1000)
    pieces.live.advance_to_packet(NS + 24 * 10_000_000)
    assert pipe.read(1) == b""
    assert clock[0] + packet_pipe.REST_S <= 1.1
    os.close(reads)


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "an empty file"), (b"garbage", "a file that begins with 16#67617262")],
)
def test_what_is_no_capture_is_said(content: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "piped"
    path.write_bytes(content)
    with path.open("rb") as file, pytest.raises(UserError, match=said):
        watch_pipe(os.dup(file.fileno()), None, None, None, "jsonl")


def test_what_is_wrong_with_the_words_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["watch", "-", "other.pcap"]) == 2
    assert (
        capsys.readouterr().err
        == "trcvtui watch: found - (stdin) together with files, expected - alone, or only files\n"
    )


def test_packets_that_come_faster_than_they_are_played_are_said_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = [10.0]
    monkeypatch.setattr(time, "monotonic_ns", lambda: round(clock[0] * 1e9))
    pieces = Pieces()
    said: list[str] = []
    reads, writes = os.pipe()
    packets = PacketStream(reads, pieces.live, said.append)
    for seconds, newest in ((0.0, 0.0), (2.0, 1.9), (4.0, 2.9), (6.0, 3.0)):
        clock[0] = 10 + seconds
        packets._check_late(NS + round(newest * 1e9))
        assert len(said) == (seconds > 3)
    packets.pipe.empty_at = round(clock[0] * 1e9)  # shadows have played all
    packets._check_late(NS + 3_000_000_000)
    clock[0] += 5
    packets._check_late(NS + 8_000_000_000)
    assert said == [TOO_FAST_TEXT]
    os.close(reads)
    os.close(writes)


def taken(
    content: bytes, folder: Path, came: Callable[[], object] = int, kept: PacketBuffer | None = None
) -> list[str]:
    """Let packets come through a pipe; return what is said of them."""
    path = folder / "piped"
    path.write_bytes(content)
    with path.open("rb") as file:
        return PacketStream(file.fileno(), Pieces().live, print, came, kept).play_all()


def test_what_the_capture_program_dropped_is_told(tmp_path: Path) -> None:
    statistics = struct.pack("<IIIHHQHHQHH", 0, 0, 0, 5, 8, 3, 7, 8, 4, 0, 0)
    content = capture([*handshake(), *stream(12)]) + make_block(STATISTICS_BLOCK, statistics)
    assert taken(content, tmp_path) == ["the capture program dropped 7 packets"]


def test_the_newest_packets_of_a_stream_are_judged(tmp_path: Path) -> None:
    kept = PacketBuffer()
    taken(capture([tcp(seq=1000, flags=SYN), answer(flags=RST | ACK)]), tmp_path, kept=kept)
    judge = FilesJudge(kept.write_file, looks_again=True)
    judge.start_judging()
    while judge.is_judging:
        judge.poll_process()
    (found,) = json.loads(judge.result_json)["findings"]
    assert found["cause"] == "refused" and found["t_ns"] >= 0


def test_the_packets_that_are_kept_are_bounded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(live, "MOST_KEPT_BYTES", 200)
    kept = PacketBuffer()
    taken(capture([*handshake(), *stream(12)]), tmp_path, kept=kept)
    assert Path(kept.write_file()[0]).stat().st_size < 600


def test_the_screen_gets_pictures_of_shadows_while_packets_come() -> None:
    ours, theirs = multiprocessing.Pipe()
    reads, writes = os.pipe()
    served = ShadowServer(theirs, LivePlan(None, None, None), (None, None, None))

    def run() -> None:
        with suppress(EOFError, OSError):
            served.serve_forever(reads)

    thread = threading.Thread(target=run)
    thread.start()
    os.write(writes, capture([*handshake(), *[udp(b"x", target=("10.0.0.5", 53))] * 9, *stream(12)]))
    project = ours.recv()
    assert [each.name for each in project.instances] == ["C1_TO_PLC", "C1_FROM_PLC"]
    jobs, reader = 0, UpdateReader(ours)

    def picture() -> Any:
        ours.send_bytes(encode(UpdateRequest()))
        return next(filter(None, (ours.poll(None) and reader.next() for _ in count())))

    while not jobs:
        jobs = picture().snapshot.instances[0].jobs_done
    os.close(writes)
    said: list[object] = []
    while not any("have ended" in str(line) for line in said):
        said += picture().lines
    assert any("UDP: DNS" in str(line) for line in said)
    ours.close()
    thread.join(20)
    assert not thread.is_alive()
    os.close(reads)


def test_a_mistake_of_ours_is_no_end_of_the_packets(tmp_path: Path) -> None:
    def came() -> None:
        raise ValueError("a mistake")

    with pytest.raises(ValueError, match="a mistake"):
        taken(capture([*handshake(), *stream(12)]), tmp_path, came)


def test_two_lines_of_a_project_are_watched_beside_each_other(watch: Watch, tmp_path: Path) -> None:
    second = """
[[connect]]
name = "C2"
ActiveEstablished = true
LocalAddress = "127.0.0.1"
RemoteAddress = "10.0.0.9"
RemotePort = 3000
[[data]]
name = "e"
type = "ARRAY[0..4] OF BYTE"
[[instance]]
name = "R2"
block = "TRCV_C"
connect = "C2"
data = "e"
[[watch]]
name = "calls"
plc = "10.0.0.6"
connect = "C2"
"""
    bench = project(tmp_path, second + LINE.format(plc="10.0.0.5:2000"))
    caller, called = ("10.0.0.6", 40_000), ("10.0.0.9", 3000)
    calls = [
        *handshake(source=caller, target=called),
        *(tcp(bytes(5), 501 + 5 * n, 101, source=called, target=caller) for n in range(3)),
    ]
    mixed = [
        each
        for pair in zip([*handshake(), *stream(12, 12)], [*calls, udp(b"x")], strict=True)
        for each in pair
    ]
    seen = watch(mixed, "--project", str(bench), step_ms=40)
    pieces = Pieces((bench, None, None))
    pieces.take(watch.path.read_bytes(), lambda: 33)
    records = pieces.end()
    assert records == seen.records
    assert [r["RCVD_LEN"] for r in records if r.get("DONE") and r["instance"] == "R2"] == [5, 5, 5]
    assert [each["why"] for each in records[-1]["unassigned"]] == [
        "no CONNECT of the project fits, or several fit"
    ]


def test_what_is_unassigned_gets_shadows_when_it_is_asked_for(tmp_path: Path) -> None:
    source = ("10.0.0.9", 53_000)
    data = [each for n in range(6) for each in (tcp(bytes(7), 101 + 7 * n, 501, source=source), udp(b"x"))]
    content = capture([*handshake(), *stream(12), *handshake(source=source), *data], step_ns=30_000_000)
    for bench in (None, project(tmp_path, LINE.format(plc="10.0.0.5:2000"))):
        pieces = Pieces((bench, None, None))
        answers: list[str] = []

        def cut(pieces: Pieces = pieces, answers: list[str] = answers) -> int:
            if pieces.live.player is not None and 2 in pieces.live.player.overlaps:
                answers.append(pieces.live.add_shadow("C1")[:56])
                answers.append(pieces.live.add_shadow("C2"))
            return 100

        pieces.take(content, cut)
        assert answers == ["found 'C1', expected a conversation without a shadow: C2", ""]
        records = pieces.end()
        sizes = [r["RCVD_LEN"] for r in records if r.get("DONE") and r["instance"] == "C2_TO_PLC"]
        assert set(sizes) == {7}
        assert len(sizes) > 3
        assert {"id": "C2", "shadows": ["C2", "C2_BACK"]} in records[-1]["assigned"]
