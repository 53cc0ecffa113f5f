"""`trcvtui watch`: a capture shows in shadows what a live block showed."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.recording.wire import (
    ACK,
    FIN,
    NS,
    PARTNER,
    PLC,
    RST,
    SYN,
    answer,
    capture,
    handshake,
    tcp,
    udp,
)  # fmt: skip
from trcvtui.bench.bench import Bench
from trcvtui.cli.main import main
from trcvtui.line.capture_player import MISSING
from trcvtui.line.packet_partners import ReplayedPartner

Record = dict[str, Any]
STATIC = """
dialect = "baosky"
[[connect]]
name = "C1"
ActiveEstablished = {active}
LocalAddress = "127.0.0.1"
LocalPort = {local}
RemoteAddress = "{remote}"
RemotePort = {port}
[[data]]
name = "d"
type = "ARRAY[0..11] OF BYTE"
[[instance]]
name = "R1"
block = "TRCV_C"
connect = "C1"
data = "d"
{more}
"""


def project(tmp_path: Path, more: str = "", **keys: object) -> Path:
    path = tmp_path / "bench.toml"
    defaults = {"active": "false", "local": 2000, "remote": "0.0.0.0", "port": 0}
    path.write_text(STATIC.format(more=more, **(defaults | keys)), encoding="utf-8")
    return path


class Watched:
    """What one run of `watch` has printed."""

    def __init__(self, printed: str) -> None:
        self.records: list[Record] = [json.loads(line) for line in printed.splitlines()]
        self.last = self.records[-1]
        self.notes = [r["note"] for r in self.records if "conversation" in r]

    def of(self, instance: str) -> list[Record]:
        return [r for r in self.records if r.get("instance") == instance]

    def jobs(self, instance: str) -> list[tuple[str, int]]:
        return [(r["STATUS"], r["RCVD_LEN"]) for r in self.of(instance) if r["DONE"] or r["ERROR"]]


class Watch:
    """Runs `watch` on packets."""

    def __init__(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.path = tmp_path / "c.pcapng"
        self._capsys = capsys

    def __call__(self, packets: list[bytes], *words: str, step_ms: int = 60) -> Watched:
        self.path.write_bytes(capture(packets, step_ns=step_ms * 1_000_000))
        return self.file(self.path, *words)

    def refused(self, packets: list[bytes], *words: str) -> str:
        self.path.write_bytes(capture(packets))
        self._capsys.readouterr()
        assert main(["watch", str(self.path), *words]) == 2
        (line,) = self._capsys.readouterr().err.splitlines()
        return line

    def file(self, path: Path, *words: str) -> Watched:
        self._capsys.readouterr()
        assert main(["watch", str(path), *words, "--format", "jsonl"]) == 0
        return Watched(self._capsys.readouterr().out)


@pytest.fixture
def watch(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Watch:
    return Watch(tmp_path, capsys)


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    scans: list[int] = []
    usual = Bench.step
    monkeypatch.setattr(Bench, "step", lambda self, now=None: scans.append(0) or usual(self, now))  # type: ignore[func-returns-value]
    return scans


def stream(*sizes: int, seq: int = 101) -> Iterator[bytes]:
    for size in sizes:
        yield tcp(bytes(range(size)), seq, 501)
        seq += size
        yield answer(seq=501, ack=seq)


def test_fin_after_7_of_12_bytes_shows_80a6_then_80c5(watch: Watch, tmp_path: Path) -> None:
    end = [tcp(seq=120, ack=501, flags=FIN | ACK), answer(seq=501, ack=121, flags=FIN | ACK)]
    seen = watch([*handshake(), *stream(12, 7), *end], "--project", str(project(tmp_path)))
    assert [each for each in seen.jobs("R1") if each[0] != "80A1"] == [("7008", 12), ("80A6", 0), ("80C5", 0)]


OTHER_502 = ("10.0.0.9", 502)


SECOND = """[[connect]]
name = "C2"
ActiveEstablished = true
LocalAddress = "127.0.0.1"
RemoteAddress = "10.0.0.77"
RemotePort = 502
[[data]]
name = "d2"
type = "ARRAY[0..11] OF BYTE"
[[instance]]
name = "R2"
block = "TRCV_C"
connect = "C2"
data = "d2"
"""


@pytest.mark.parametrize("more", ["", SECOND], ids=["one", "two on a port"])
def test_the_ends_of_an_active_connect_say_which_end_is_the_plc(
    more: str, watch: Watch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bench = project(tmp_path, more, active="true", local=0, remote="10.0.0.9", port=502)
    packets = [*handshake(source=("10.0.0.5", 40836), target=OTHER_502),
               tcp(bytes(12), 501, 101, ACK, 8192, OTHER_502, ("10.0.0.5", 40836))]  # fmt: skip
    assert watch(packets, "--project", str(bench)).last["assigned"] == [{"id": "C1", "shadows": ["C1"]}]
    assert main(["conversations", str(watch.path), "--project", str(bench), "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["plc"] == "10.0.0.5:40836"
    other = project(tmp_path, active="true", local=0, remote="10.0.0.77", port=503)
    assert "--plc" in watch.refused(packets, "--project", str(other))


def test_scan_1_is_the_first_packet_and_each_record_has_its_time(watch: Watch) -> None:
    seen = watch([*handshake(), *stream(12)], step_ms=100)
    done = next(r for r in seen.of("C1_TO_PLC") if r["DONE"])
    assert (done["scan"], done["t_ms"]) == (31, 300.0)  # the bytes are the fourth packet
    assert (NS, done["time"]) == (1_700_000_000_000_000_000, "2023-11-14T22:13:20.300000Z")


def test_a_plc_that_calls_is_played_by_a_shadow_that_calls(watch: Watch, tmp_path: Path) -> None:
    packets = [*handshake(), *stream(12), answer(bytes(12), 501, 113), tcp(seq=113, ack=513)]
    seen = watch(packets, "--plc", "10.0.0.9")
    assert seen.jobs("C1_TO_PLC")[-1] == ("7008", 12)
    bench = project(tmp_path, active="true", local=0, remote="10.0.0.5", port=2000)
    seen = watch(packets, "--plc", "10.0.0.9", "--project", str(bench))
    assert [r["STATUS"] for r in seen.of("R1")][-3:] == ["7006", "7008", "7006"]
    assert not any(r["ERROR"] and r["STATUS"] != "80A1" for r in seen.of("R1"))


@pytest.mark.parametrize("step_ms", [20, 300, 1500])
@pytest.mark.parametrize("ports", [(51001, 51002, 51003), (51001, 51001, 51001)])
def test_each_refused_syn_is_a_refusal_and_what_follows_is_received(
    watch: Watch, ports: tuple[int, ...], step_ms: int
) -> None:
    packets = []
    for port in ports:
        caller = PARTNER[0], port
        packets += [tcp(seq=100, flags=SYN, source=caller)]
        packets += [tcp(ack=101, flags=RST | ACK, source=PLC, target=caller)]
    packets += [*handshake(700, 800), answer(bytes(4), 801, 701)]
    seen = watch(packets, "--plc", PARTNER[0], step_ms=step_ms)
    jobs = [word for word, _ in seen.jobs("C1_TO_PLC") if word != "80A1"]
    assert jobs == ["80A0", "80A0", "80A0", "7008"]


@pytest.mark.parametrize("dialect", ["baosky", "s7-1500", "s7-1200", "s7-1200-legacy"])
@pytest.mark.parametrize("flags", [FIN | ACK, RST | ACK])
def test_a_plc_that_ends_its_own_connection_shows_no_error_for_that(
    watch: Watch, dialect: str, flags: int
) -> None:
    end = [answer(seq=501, ack=113, flags=flags), tcp(seq=113, ack=502, flags=FIN | ACK)]
    seen = watch([*handshake(), *stream(12), *end], "--plc", PLC[0], "--dialect", dialect)
    done = next(number for number, record in enumerate(seen.of("C1_TO_PLC")) if record["DONE"])
    assert not any(record["ERROR"] for record in seen.of("C1_TO_PLC")[done:])
    assert seen.of("C1_TO_PLC")[-1]["STATUS"] == "7002"


def test_a_conversation_that_begins_in_the_middle_is_said_to(watch: Watch) -> None:
    seen = watch([*stream(12, 12)], "--plc", "10.0.0.5")
    assert seen.notes == ["begins in the middle"]
    assert [size for _, size in seen.jobs("C1_TO_PLC")][-1] in (12, 24)


def test_of_many_who_wait_for_one_shadow_one_asks_in_a_scan(
    watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []
    connect = ReplayedPartner._connect

    def counted(end: ReplayedPartner) -> None:
        asked.append(end._shadows.bench.runtime.scans)
        connect(end)

    monkeypatch.setattr(ReplayedPartner, "_connect", counted)
    many = [
        packet
        for port in range(20_000, 20_300)
        for packet in (
            *handshake(source=("10.0.0.9", port))[:2],
            tcp(b"x" * 12, seq=101, ack=501, source=("10.0.0.9", port)),
        )
    ]
    watch.path.write_bytes(capture(many, step_ns=100_000))
    seen = watch.file(watch.path)
    assert len(seen.last["assigned"]) == 300
    begun = 600  # each conversation, for a shadow of either end
    assert len(asked) - begun <= 2 * len({*asked}) + begun


ROW = '[[watch]]\nname = "W1"\nplc = "{}"\nconnect = "C1"\n{}'


@pytest.mark.parametrize(
    ("row", "is_watched"),
    [
        (ROW.format("10.0.0.5:2000", ""), True),
        (ROW.format("10.0.0.5", 'partner = "10.0.0.9"'), True),
        (ROW.format("10.0.0.5:2001", ""), False),
        (ROW.format("10.0.0.5", 'partner = "10.0.0.8"'), False),
    ],
)
def test_a_watch_row_says_which_line_a_connect_looks_on(
    watch: Watch, tmp_path: Path, row: str, is_watched: bool
) -> None:
    packets, words = [*handshake(), *stream(12)], ("--project", str(project(tmp_path, row, local=3000)))
    if is_watched:
        assert watch(packets, *words).jobs("R1")[-1:] == [("7008", 12)]
    else:
        assert watch.refused(packets, *words).endswith(": 10.0.0.5:2000, 10.0.0.9:51000")


def test_a_plc_that_no_conversation_has_is_refused_with_the_ends_that_are_there(watch: Watch) -> None:
    line = watch.refused([*handshake(), *stream(12)], "--plc", "10.0.0.7")
    assert line.startswith("--plc: found '10.0.0.7', which no conversation has, expected ")
    assert line.endswith("one of the ends in the capture: 10.0.0.5:2000, 10.0.0.9:51000")


def test_pins_that_the_program_sets_are_left_to_it(watch: Watch, tmp_path: Path) -> None:
    bench = project(tmp_path)
    text = 'program = """\nrun 21\nset R1 EN_R=1\n"""\n' + bench.read_text()
    bench.write_text(text, encoding="utf-8")
    seen = watch([*handshake(), *stream(12)], "--project", str(bench))
    assert seen.jobs("R1") == [("7008", 12)]
    assert next(r for r in seen.of("R1") if r["DONE"])["scan"] > 21


def test_a_dialect_says_which_block_would_have_looked_on(
    watch: Watch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    packets, bench = [*handshake(), *stream(12)], str(project(tmp_path))
    assert watch(packets, "--dialect", "s7-1500").jobs("C1_TO_PLC")[-1][0] == "0000"
    assert watch(packets, "--project", bench, "--dialect", "s7-1500").jobs("R1") == [("0000", 12)]
    assert main(["watch", str(watch.path), "--project", bench, "--dialect", "s7-1501"]) == 2
    assert "--dialect: found 's7-1501'" in capsys.readouterr().err


def test_hours_of_silence_cost_no_scans_and_change_nothing(watch: Watch, steps: list[int]) -> None:
    """Keep-alive is on; the shadow that waits for the next partner waits as well."""
    end = [tcp(seq=125, ack=501, flags=FIN | ACK), answer(seq=501, ack=126, flags=FIN | ACK)]
    seen = watch([*handshake(), *stream(12, 12), *end], step_ms=3_600_000)
    assert len(steps) < 100
    dones = [(r["scan"], r["RCVD_LEN"]) for r in seen.of("C1_TO_PLC") if r["DONE"]]
    assert dones == [(3 * 360_000 + 1, 12), (5 * 360_000 + 1, 12)]


def test_skipped_scans_are_as_if_each_had_passed(
    watch: Watch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chance = random.Random(5)
    packets = [*handshake(), *stream(*[chance.randrange(1, 30) for _ in range(40)])]
    sender = '[[instance]]\nname = "S1"\nblock = "TSEND_C"\nconnect = "C1"\ndata = "d"\n'
    calls = {"active": "true", "local": 0, "remote": "10.0.0.5", "port": 2000}
    ways = []
    for name, more, keys in (("p", "", {}), ("a", "", calls), ("ps", sender, {}), ("as", sender, calls)):
        (tmp_path / name).mkdir()
        bench = str(project(tmp_path / name, f"LEN = 5\n{more}", **keys))
        ways.append(["--project", bench, "--plc", (PARTNER if keys else PLC)[0]])
    fast = [watch(packets, *way, step_ms=377).records for way in ways]
    monkeypatch.setattr("trcvtui.bench.bench.Bench.quiet_until", lambda self: self.now)
    assert [watch(packets, *way, step_ms=377).records for way in ways] == fast
    assert all(any(record.get("STATUS") == "7006" for record in records) for records in fast)


# -- ends --------------------------------------------------------------------------------------------------

FLOOD = [tcp(bytes(120), 101 + 120 * n, 501) for n in range(40)]  # 400 jobs of 12 bytes


@pytest.mark.parametrize("flags", [FIN | ACK, RST | ACK])
def test_a_plc_end_that_leaves_bytes_unread_ends_its_shadow_there(
    watch: Watch, tmp_path: Path, flags: int
) -> None:
    bench = str(project(tmp_path))
    flood = [*handshake(), *FLOOD, answer(seq=501, ack=4901, window=0)]
    silence = [answer(seq=501, ack=4901, window=0)] * 20
    end = [answer(seq=501, ack=4901, flags=flags, window=0), tcp(seq=4901, ack=502, flags=RST)]
    whole, cut = (watch([*flood, *silence, *more], "--project", bench, step_ms=10) for more in ([], end))
    assert cut.notes == [f"the PLC end has {'reset' if flags & RST else 'closed'} the connection"]
    (*jobs, over), at = cut.of("R1"), len(flood) + len(silence) + 1
    assert (over["STATUS"], over["ERROR"], over["scan"]) == ("7002", False, at + 2)  # it came a scan late
    assert jobs == whole.of("R1")[: len(jobs)] and (len(dones(cut)), len(dones(whole))) == (31, 400)


@pytest.mark.parametrize(("window", "size"), [(8192, 24), (8192 - 12, 12)])
def test_what_the_window_of_the_plc_end_misses_its_shadow_does_not_read(
    watch: Watch, window: int, size: int
) -> None:
    end = answer(seq=501, ack=125, flags=FIN | ACK, window=window)
    stands = [answer(seq=501, ack=101)] * 21  # no scan between the bytes and the end
    seen = watch([*handshake(), *stands, tcp(bytes(24), 101, 501), end], step_ms=3)
    assert seen.jobs("C1_TO_PLC")[-1] == ("7008", size)


@pytest.mark.parametrize(("flags", "jobs"), [(FIN | ACK, 5), (RST | ACK, 3)])
def test_after_the_partners_end_its_bytes_are_read_as_long_as_the_plc_end_stands(
    watch: Watch, tmp_path: Path, flags: int, jobs: int
) -> None:
    frames = [tcp(bytes(12), 101 + 12 * n, 501) for n in range(5)]
    fin, waits = tcp(seq=161, ack=501, flags=FIN | ACK), [answer(seq=501, ack=162)] * 5
    packets = [*handshake(), *frames, fin, *waits, answer(seq=501, ack=162, flags=flags)]
    seen = watch(packets, "--project", str(project(tmp_path)), step_ms=5)
    assert len(dones(seen)) == jobs
    assert seen.jobs("R1")[-1][0] == "80C5" and not seen.notes


def test_a_shadow_that_came_late_still_does_its_first_job(watch: Watch, tmp_path: Path) -> None:
    end = answer(seq=501, ack=113, flags=RST | ACK)
    seen = watch(
        [*handshake(), tcp(bytes(12), 101, 501), end], "--project", str(project(tmp_path)), step_ms=1
    )
    assert dones(seen) == [(12, None)]


# -- odd captures ------------------------------------------------------------------------------


def dones(seen: Watched, instance: str = "R1") -> list[tuple[int, str | None]]:
    return [(r["RCVD_LEN"], r.get("note")) for r in seen.of(instance) if r["DONE"]]


def test_a_connection_without_an_end_is_over_when_its_ends_connect_again(
    watch: Watch, tmp_path: Path
) -> None:
    """The second one has the same ports; what the first one had begun is lost with it."""
    again = [*handshake(7000, 9000), tcp(b"a" * 12, 7001, 9001), answer(seq=9001, ack=7013)]
    seen = watch([*handshake(), *stream(12, 5), *again], "--project", str(project(tmp_path)))
    assert dones(seen) == [(12, None)] * 2
    assert [row["id"] for row in seen.last["assigned"]] == ["C1", "C2"]
    assert [word for word, _ in seen.jobs("R1")][-2:] == ["80AA", "7008"]


def test_a_capture_that_ends_within_a_job_leaves_it_waiting(watch: Watch, tmp_path: Path) -> None:
    seen = watch([*handshake(), *stream(12, 5)], "--project", str(project(tmp_path)))
    assert dones(seen) == [(12, None)]
    assert seen.of("R1")[-1]["STATUS"] == "7006"
    assert seen.last["left_out"] == {}


def test_a_hole_of_two_gigabytes_costs_few_scans_and_frames_begin_where_they_began(
    watch: Watch, tmp_path: Path, steps: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A place is kept for some of it; whole jobs are left out."""
    monkeypatch.setattr("trcvtui.line.packet_partners.MOST_FILLED", 12_000)
    hole = 2**31 - 20_000
    after = 125 + hole
    late = [tcp(b"b" * 12, after, 501), answer(seq=501, ack=after + 12), tcp(b"b" * 12, after + 12, 501)]
    seen = watch([*handshake(), *stream(12, 12), *late], "--project", str(project(tmp_path)))
    left_out = seen.last["left_out"]["C1"]
    assert f"? {hole} bytes missing in the capture, to the PLC end, from byte 24" in seen.notes
    assert left_out % 12 == 0 and hole - 13_000 < left_out < hole
    kept = (hole - left_out) // 12
    assert dones(seen) == [(12, None)] * 2 + [(12, MISSING)] * kept + [(12, None)] * 2
    assert len(steps) < 4 * kept


def test_a_connect_that_looks_on_nothing_waits_without_a_word(
    watch: Watch, tmp_path: Path, steps: list[int]
) -> None:
    other = """
[[connect]]
name = "C2"
ActiveEstablished = true
RemoteAddress = "10.0.0.7"
RemotePort = 2000
[[instance]]
name = "R2"
block = "TRCV_C"
connect = "C2"
data = "d"
EN_R = true
CONT = true
"""
    path = project(tmp_path, other)
    seen = watch([*handshake(), *stream(12)], "--project", str(path), step_ms=3_600_000)
    assert dones(seen) == [(12, None)] and not seen.of("R2")
    assert len(steps) < 200


def test_silence_in_which_a_program_waits_is_run_up_to_a_bound_that_is_told(
    watch: Watch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("trcvtui.line.packet_partners.MOST_QUIET_SCANS", 500)
    bench = project(tmp_path)
    bench.write_text('program = """\nrun 100000000\n"""\n' + bench.read_text(), encoding="utf-8")
    seen = watch([*handshake(), *stream(12)], "--project", str(bench), step_ms=3_600_000)
    assert dones(seen) == [(12, None)]
    done = next(r for r in seen.of("R1") if r["DONE"])
    assert done["time"].startswith("2023-11-15T01:13:20") and seen.last["not_run"] > 1_000_000


def test_without_a_format_a_person_reads_it(watch: Watch, capsys: pytest.CaptureFixture[str]) -> None:
    packets = [*handshake(), *stream(12), answer(flags=RST, seq=501), udp(b"x")]
    watch.path.write_bytes(capture(packets, step_ns=60_000_000))
    assert main(["watch", str(watch.path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(
        line.startswith("2023-11-14T22:13:20.") and line.endswith("C1_TO_PLC  7008  DONE 12 B")
        for line in lines
    )
    assert any(line.endswith("C1: the PLC end has reset the connection") for line in lines)
    assert [line.split("  ")[2] for line in lines if "the partner reset" in line] == ["C1_FROM_PLC"]
    assert lines[-2:] == ["C1 was played to C1, C1_BACK", "C2 was played to C2, C2_BACK"]
