"""`watch` on what has no connection: datagrams to blocks of UDP, bytes of a serial line to a ComBuffer."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.diagnosis.truth.cases import ISO, ISO_PEER, pins, plc, receiver
from tests.line.test_watch import Record, Watch, watch
from tests.recording.wire import NS, PARTNER, PLC, handshake, serial_line, tcp, udp
from trcvtui.capture.command import read_captures
from trcvtui.capture.pcap import RAW_IP, interface_block, packet_block, section_block
from trcvtui.capture.reassembly import Conversations
from trcvtui.cli.main import main
from trcvtui.line.capture_player import MISSING

__all__ = ["watch"]

SENT, RECEIVED = 1, 2  # events of RTAC serial
UDP = """
dialect = "baosky"
[[data]]
name = "d"
type = "ARRAY[0..7] OF BYTE"
[[udp_config]]
name = "U1"
LocalAddress = "127.0.0.1"
LocalPort = 2000
[[addr]]
name = "FROM"
[[instance]]
name = "R1"
block = "URECV_C"
config = "U1"
addr = "FROM"
data = "d"
"""


def project(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return path


def cut_off(*packets: tuple[bytes, int]) -> bytes:
    """Return a capture that has left out so many bytes of the end of each packet."""
    blocks = [section_block("tests"), interface_block(RAW_IP, "t")]
    for n, (data, left_out) in enumerate(packets):
        blocks.append(packet_block(0, NS + n * 60_000_000, data[: len(data) - left_out], length=len(data)))
    return b"".join(blocks)


@pytest.mark.parametrize(
    ("dialect", "block", "status"),
    [("baosky", "URECV_C", "7008"), ("s7-1500", "TRCV_C", "0000"), ("s7-1200-legacy", "TRCV_C", "0000")],
)
def test_datagrams_of_both_ends_have_a_shadow_each(
    watch: Watch, dialect: str, block: str, status: str
) -> None:
    seen = watch([udp(b"abc"), udp(b"defgh"), udp(b"no", PLC, PARTNER)], "--dialect", dialect)
    assert [job for job in seen.jobs("C1_TO_PLC") if job[1]] == [(status, 3), (status, 5)]
    assert [job for job in seen.jobs("C1_FROM_PLC") if job[1]] == [(status, 2)]
    assert {record["block"] for record in seen.records[:-1]} == {block}
    assert seen.last["assigned"] == [{"id": "C1", "shadows": ["C1", "C1_BACK"]}]


def test_all_who_send_to_one_end_reach_one_shadow_at_the_same_time(watch: Watch) -> None:
    packets = [udp(b"from %d" % n, ("10.0.0.9", 4000 + n)) for n in (1, 2, 1, 3)]
    seen = watch(packets)
    assert [size for _, size in seen.jobs("C1_TO_PLC")] == [6, 6, 6, 6]
    assert [each["shadows"][0] for each in seen.last["assigned"]] == ["C1", "C1", "C1"]


def test_names_and_clocks_of_the_network_have_no_shadow_unless_they_are_asked_for(watch: Watch) -> None:
    asks = udp(b"who is", target=("10.0.0.5", 53))
    assert watch([asks, udp(b"abc")]).last["unassigned"] == [{"id": "C1", "why": "UDP: DNS"}]
    assert watch([asks], "--plc", "10.0.0.5:53").jobs("C1_TO_PLC") == [("7008", 6)]


def test_a_dialect_without_datagrams_says_so(watch: Watch) -> None:
    seen = watch([udp(b"abc")], "--dialect", "twincat")
    assert seen.last["unassigned"] == [{"id": "C1", "why": "UDP: no block of twincat receives datagrams"}]


@pytest.mark.parametrize(
    ("more", "words", "is_watched"),
    [
        ("", (), True),
        ("", ("--plc", "10.0.0.5"), True),
        ("", ("--plc", "10.0.0.8"), False),
        ('[[watch]]\nname = "W"\nplc = "10.0.0.5:2000"\nconnect = "U1"\n', (), True),
        ('[[watch]]\nname = "W"\nplc = "10.0.0.5:2001"\nconnect = "U1"\n', (), False),
    ],
)
def test_the_udp_config_of_a_project_is_that_of_its_port_or_of_a_watch_row(
    watch: Watch, tmp_path: Path, more: str, words: tuple[str, ...], is_watched: bool
) -> None:
    packets, words = [udp(bytes(8))], ("--project", str(project(tmp_path, UDP + more)), *words)
    if is_watched:
        assert watch(packets, *words).jobs("R1") == [("7008", 8)]
    else:
        assert watch.refused(packets, *words).endswith(": 10.0.0.5:2000, 10.0.0.9:51000")


OWN = 'type = "TCON_IP_v4"\nConnectionType = 19\nLocalPort = 2000\nListenPort = 0\n'
FROM = '[[addr]]\nname = "FROM"\n'
SIEMENS = plc(OWN, FROM + receiver("TRCV_C", 8, 'addr = "FROM"\n'), dialect="s7-1500")


@pytest.mark.parametrize(("text", "error", "done"), [(UDP, "80AA", "7008"), (SIEMENS, "80C9", "0000")])
def test_a_datagram_above_data_is_the_error_also_where_the_capture_has_cut_it_off(
    watch: Watch, tmp_path: Path, text: str, error: str, done: str
) -> None:
    sizes = (9, 1), (9, 0), (8, 3), (8, 0)
    watch.path.write_bytes(cut_off(*((udp(bytes(size)), left_out) for size, left_out in sizes)))
    seen = watch.file(watch.path, "--project", str(project(tmp_path, text)), "--plc", "10.0.0.5")
    told = [(r["STATUS"], "note" in r) for r in seen.records if r.get("ERROR") or r.get("RCVD_LEN")]
    assert told == [(error, True), (error, False), (done, True), (done, False)]


def test_a_datagram_that_the_capture_has_cut_off_is_a_job_that_lacks_bytes(watch: Watch) -> None:
    whole = udp(bytes(range(40)))
    watch.path.write_bytes(cut_off((whole, 0), (whole, 16), (whole, 0)))
    seen = watch.file(watch.path)
    assert seen.jobs("C1_TO_PLC") == [("7008", 40)] * 3
    told = [record.get("note") for record in seen.of("C1_TO_PLC") if record["DONE"]]
    assert told == [None, MISSING, None]
    assert seen.notes == ["? 16 bytes missing in the capture, to the PLC end, from byte 64"]


def test_datagrams_that_find_no_room_are_counted(watch: Watch) -> None:
    seen = watch([udp(bytes(1400), step) for step in [PARTNER] * 500], step_ms=0)
    got = sum(size for _, size in seen.jobs("C1_TO_PLC"))
    assert got + seen.last["left_out"]["C1"] == 500 * 1400
    assert 0 < got < 500 * 1400


SERIAL = """
dialect = "twincat"
start = "write suffix hex 0a"
[[data]]
name = "suffix"
type = "BYTE"
[[data]]
name = "rx"
type = "ARRAY[0..15] OF BYTE"
[[combuffer]]
name = "{}"
source = "sim"
[[instance]]
name = "RD"
block = "ReceiveData"
RxBuffer = "{}"
data = "rx"
pSuffix = "suffix"
LenSuffix = 1
SizeReceiveData = 16
"""


@pytest.mark.parametrize("buffer", ["RX", "OTHER"])
def test_a_serial_line_fills_the_combuffer_of_its_name_or_the_only_one(
    watch: Watch, tmp_path: Path, buffer: str
) -> None:
    events = (RECEIVED, b"12"), (RECEIVED, b"3\n4567"), (SENT, b"ok\n"), (RECEIVED, b"\n")
    watch.path.write_bytes(serial_line(*events))
    seen = watch.file(watch.path, "--project", str(project(tmp_path, SERIAL.format(buffer, buffer))))
    assert [size for _, size in seen.jobs("RD")] == [4, 5]
    assert seen.last["assigned"] == [{"id": "C1", "shadows": [buffer]}]


def test_without_a_project_nobody_knows_how_a_serial_line_is_cut(watch: Watch) -> None:
    watch.path.write_bytes(serial_line((RECEIVED, b"12")))
    assert "a ComBuffer of a project" in watch.file(watch.path).last["unassigned"][0]["why"]


def test_blocks_on_a_combuffer_that_a_watched_trcv_c_fills_look_on_too(watch: Watch) -> None:
    stream = [tcp(b"ab", 101, 501), tcp(b"c\nde\n", 103, 501)]
    where = ("--project", "configs/twincat-stream.toml", "--plc", "10.0.0.5")
    assert [size for _, size in watch([*handshake(), *stream], *where).jobs("RD")] == [4, 3]


SAYS = 'says = ["random 16", "random 9"]\nevery = "T#30ms"\n'
RECEIVES = receiver("TRCV_C", 16, pins(CONT=True, EN_R=True))
TWO_SENDERS = """
[[peer]]
name = "P1"
udp = true
remote = "@U1"
says = ["random 8", "random 5", "random 3"]
every = "T#30ms"
[[peer]]
name = "P2"
udp = true
remote = "@U1"
says = ["random 4"]
every = "T#20ms"
"""


def recorded(tmp_path: Path, bench: str, steps: str) -> tuple[Path, list[Record]]:
    project(tmp_path, bench)
    scenario, path, out = tmp_path / "s.toml", tmp_path / "run.pcapng", tmp_path / "run.jsonl"
    text = f'project = "bench.toml"\n[scenario]\nname = "s"\nsteps = """\n{steps}\n"""\n'
    scenario.write_text(text, encoding="utf-8")
    words = ["--record", str(path), "--format", "jsonl", "--out", str(out)]
    assert main(["scenario", str(scenario), *words]) == 0
    return path, [json.loads(each) for each in out.read_text(encoding="utf-8").splitlines()]


def test_a_partner_of_iso_on_tcp_says_nothing_before_its_shadow_has_answered(
    watch: Watch, tmp_path: Path
) -> None:
    path, run = recorded(tmp_path, plc(ISO, RECEIVES, ISO_PEER + SAYS, "s7-1500"), "run T#500ms")
    seen = watch.file(path, "--project", str(tmp_path / "bench.toml"), "--plc", "127.0.0.1:32768")
    jobs = [("0000", r["RCVD_LEN"]) for r in run if r.get("DONE")]
    assert jobs[:3] == [("0000", 16), ("0000", 9), ("0000", 16)]
    assert seen.jobs("R")[: len(jobs)] == jobs
    assert seen.last["left_out"] == {}


def test_datagrams_that_the_recorded_plc_left_unread_are_left_out_at_the_end_of_the_recording(
    watch: Watch, tmp_path: Path
) -> None:
    steps = "set R1 EN_R=1\nrun T#200ms\nset R1 EN_R=0\nrun T#200ms\nset R1 EN_R=1\nrun T#300ms"
    bench = UDP + "CONT = true\nLEN = 8\n" + TWO_SENDERS
    path, run = recorded(tmp_path, bench, steps)
    seen = watch.file(path, "--project", str(tmp_path / "bench.toml"))
    done = [each for each in seen.of("R1") if each["DONE"]]
    assert done[-1]["t_ms"] <= run[-2]["t_ms"] + 30
    conversations = Conversations()
    read_captures([str(path)], conversations, [])
    sent = sum(each.there.byte_count + each.back.byte_count for each in conversations.all)
    assert set(seen.last["left_out"]) == {"C1", "C2"}
    assert sum(each["RCVD_LEN"] for each in done) + sum(seen.last["left_out"].values()) == sent
