"""`trcvtui messages`: the same rows from a recording, a capture with a project, and a capture with a type."""

from __future__ import annotations

import csv
import errno
import io
import json
import socket
import struct
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from tests import golden
from tests.line.test_without_connection import SERIAL, cut_off
from tests.recording.wire import ACK, FIN, capture, handshake, serial_line, tcp, udp
from trcvtui.bench.bench import Bench
from trcvtui.cli.main import main
from trcvtui.diagnosis.cut_messages import MessageCutter
from trcvtui.files import record_reads
from trcvtui.recording.files import RecordTarget
from trcvtui.recording.recorder import make_recorder
from trcvtui.scenario.command import LivePace, RecordedPace
from trcvtui.scenario.scenario import load_bench_project

TYPE = "TYPE Telegram : STRUCT state : INT; weight : REAL; count : DINT; END_STRUCT END_TYPE"
PROJECT = """
dialect = "baosky"
[[task]]
name = "MAIN"
interval = "T#1ms"
[[udt]]
file = "t.st"
[[data]]
name = "rx"
type = "Telegram"
{link}
[[instance]]
name = "R1"
block = "{block}"
{on}
data = "rx"
CONT = true
EN_R = true
"""
STREAM = """
[[connect]]
name = "C1"
ActiveEstablished = false
LocalAddress = "127.0.0.1"
LocalPort = {port}
"""
DATAGRAMS = """
[[udp_config]]
name = "U1"
LocalAddress = "127.0.0.1"
LocalPort = 2000
[[addr]]
name = "FROM"
"""
Values = list[tuple[int, float, int]]
SENT: Values = [(n % 7, n * 0.5 - 3, n * n - 5) for n in range(200)]
Run = Callable[..., tuple[int, str, str]]


def telegram(state: int, weight: float, count: int) -> bytes:
    return struct.pack("<hxxfi", state, weight, count)


def stream(*segments: bytes, end: bool = True) -> list[bytes]:
    seq, packets = 101, handshake()
    for segment in segments:
        packets.append(tcp(segment, seq, 501))
        seq += len(segment)
    return packets + ([tcp(seq=seq, ack=501, flags=FIN | ACK)] if end else [])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "t.st").write_text(TYPE)
    (tmp_path / "p.toml").write_text(
        PROJECT.format(link=STREAM.format(port=2000), block="TRCV_C", on='connect = "C1"')
    )
    of_udp = 'config = "U1"\naddr = "FROM"'
    (tmp_path / "u.toml").write_text(PROJECT.format(link=DATAGRAMS, block="URECV_C", on=of_udp))
    return tmp_path


@pytest.fixture
def run(folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.chdir(folder)

    def of(*words: str) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main(["messages", *words])
        return code, *capsys.readouterr()

    return of


def rows(run: Run, *words: str, other_types: int = 0) -> list[dict[str, str]]:
    code, out, err = run(*words, "--format", "csv")
    assert code == 0
    assert len(err.splitlines()) == err.count("its DATA has another type") == other_types, err
    return [*csv.DictReader(io.StringIO(out, newline=""), strict=True)]


def told(found: list[dict[str, str]], *names: str) -> list[tuple[str, ...]]:
    return [tuple(row[name] for name in names) for row in found]


def record_live(folder: Path, send: Callable[[socket.socket], None]) -> int:
    """Record a TRCV_C that listens on a port of this machine, until an outside client has said all."""
    path = folder / "live.toml"
    path.write_text((folder / "p.toml").read_text().replace("LocalPort = 2000", "LocalPort = 0"))
    recorder = make_recorder(RecordTarget(folder / "r.pcapng"), folder / "r.pcapng", waits=True)
    with record_reads(recorder.reads):
        project = load_bench_project(path)
    with recorder:
        bench = Bench(project, "live", recorder.seam)
        recorder.add_header(bench, path, (), is_scenario=False)
        pace, ports = RecordedPace(LivePace(), recorder), list[int]()
        client = threading.Thread(target=lambda: send(socket.create_connection(("127.0.0.1", ports[0]))))
        while not ports or client.is_alive():
            pace.next_scan(bench)
            port = bench.runtime.listening_port("C1")
            if not ports and port is not None:
                ports.append(port)
                client.start()
        for _ in range(2 * len(SENT)):  # a job takes two scans
            pace.next_scan(bench)
        bench.close()
    return ports[0]


@pytest.mark.live
def test_200_telegrams_are_the_same_rows_from_each_source(run: Run, folder: Path) -> None:
    acknowledged = threading.Event()

    def send(client: socket.socket) -> None:
        with client:
            for values in SENT:
                client.sendall(telegram(*values))
                acknowledged.wait(0.003)

    port = record_live(folder, send)
    of_run = rows(run, "r.pcapng")
    of_shadow = rows(run, "r.pcapng", "--project", "p.toml", "--plc", f"127.0.0.1:{port}")
    of_type = rows(run, "r.pcapng", "--udt", "t.st")
    for found in (of_run, of_shadow, of_type):
        assert [(int(r["state"]), float(r["weight"]), int(r["count"])) for r in found] == SENT
        assert {row["length"] for row in found} == {"12"}
    same = "n", "time", "t_s", "length", "reason", "hex"
    assert told(of_run, *same) == told(of_shadow, *same) == told(of_type, *same), "to the nanosecond"
    assert {row["status"] for row in of_run} == {"7008"}
    code, out, _ = run("r.pcapng", "--format", "jsonl")
    assert code == 0
    assert [(v["state"], v["weight"], v["count"]) for v in map(json.loads, out.splitlines())] == SENT
    assert len(run("r.pcapng")[1].splitlines()) == 201
    heavy = rows(run, "r.pcapng", "--where", "weight > 50.0")
    assert [float(row["weight"]) for row in heavy] == [w for _, w, _ in SENT if w > 50]
    assert run("r.pcapng", "--where", "state = 77") == (1, "", "")


def test_packed_messages_are_right_with_their_layout_and_never_shifted_without(
    run: Run, folder: Path
) -> None:
    packed = [struct.pack("<hfi", *values) for values in SENT]
    (folder / "c.pcapng").write_bytes(capture(stream(*packed)))
    found = rows(run, "c.pcapng", "--udt", "t.st", "--layout", "packed")
    assert [(int(r["state"]), float(r["weight"]), int(r["count"])) for r in found] == SENT
    without = rows(run, "c.pcapng", "--udt", "t.st")
    assert [(row["length"], row["hex"]) for row in without] == [("10", each.hex(" ")) for each in packed]
    assert {row["count"] for row in without} == {""}


def test_datagrams_and_serial_lines_have_the_times_and_holes_of_their_packets(run: Run, folder: Path) -> None:
    some = [(udp(telegram(*SENT[n])), 5 * (n == 2)) for n in range(4)]
    (folder / "c.pcapng").write_bytes(cut_off(*some, (udp(b""), 0), (udp(b"\1\0"), 0)))
    names = "n", "time", "length", "reason", "hex", "state", "weight", "count"
    of_shadow = rows(run, "c.pcapng", "--project", "u.toml", "--plc", "10.0.0.5")
    assert told(of_shadow, *names) == told(rows(run, "c.pcapng", "--udt", "t.st"), *names)
    assert told(of_shadow, "length", "reason", "weight")[2:] == [
        ("12", "hole", ""), ("12", "", "-1.5"), ("0", "", ""), ("2", "", "")
    ]  # fmt: skip
    (folder / "s.toml").write_text(SERIAL.replace("{}", "RX"))
    (folder / "s.pcapng").write_bytes(serial_line(*[(2, b"hello %d\n" % n) for n in range(4)]))
    of_line = told(rows(run, "s.pcapng", "--project", "s.toml"), "n", "time", "hex")
    assert of_line == told(rows(run, "s.pcapng"), "n", "time", "hex") and len(of_line) == 4


SENDS = """
start = "set S CONT=1 REQ=blink\\nset R1 ADHOC=0"
[[data]]
name = "tx"
type = "Telegram"
[[connect]]
name = "C2"
ActiveEstablished = true
LocalAddress = "127.0.0.1"
RemoteAddress = "127.0.0.1"
RemotePort = 2000
[[instance]]
name = "S"
block = "TSEND_C"
connect = "C2"
data = "tx"
"""


def test_the_files_of_a_split_run_have_each_message_once_with_the_jobs_number(run: Run, folder: Path) -> None:
    start, _, rest = SENDS.partition("[[data]]")
    (folder / "b.toml").write_text(start + (folder / "p.toml").read_text() + "[[data]]" + rest)
    record = ["record", "b.toml", "--kernel", "sim", "--out", "out", "--split", "64KiB", "--duration", "T#3s"]
    assert main(record) == 0
    files = [str(file) for file in sorted((folder / "out").iterdir())]
    assert len(files) > 2
    whole, of_files = rows(run, "b.toml", "--for", "T#3s"), rows(run, *files)
    names = "n", "scan", "instance", "length", "status", "reason", "count"
    assert told(of_files, *names) == told(whole, *names) and len(whole) > 400
    [first, *_] = rows(run, files[1], "--instance", "R1")
    assert int(first["n"]) > 1
    of_run, of_shadow = (
        rows(run, files[0], "--instance", "R1", *words) for words in ([], ["--project", "b.toml"])
    )
    times = "n", "time", "t_s", "gap_ms", "hex"
    assert told(of_run, *times) == told(of_shadow, *times)[: len(of_run)], "of our own sender, too"


def test_another_recording_has_its_own_times_and_no_columns_of_another_type(
    run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start, _, rest = SENDS.partition("[[data]]")
    (folder / "b.toml").write_text(start + (folder / "p.toml").read_text() + "[[data]]" + rest)
    for name, kind in (("a", TYPE), ("b", TYPE), ("c", TYPE.replace("REAL", "DINT"))):
        (folder / "t.st").write_text(kind)
        monkeypatch.setattr("trcvtui.recording.recorder.SIM_WALL_NS", 10**18 + ord(name) * 10**9)
        assert main(["record", "b.toml", "--kernel", "sim", "--out", name, "--duration", "T#50ms"]) == 0
    files = [str(*(folder / name).iterdir()) for name in "abc"]
    alone = [told(rows(run, file), "n", "time", "hex") for file in files]
    found = rows(run, *files, other_types=1)
    assert told(found, "n", "time", "hex") == [row for of_file in alone for row in of_file]
    is_known = [row["count"] != "" for row in found if row["instance"] == "R1"]
    assert any(is_known) and is_known == sorted(is_known, reverse=True) and not is_known[-1]


CHANGES = """
[[peer]]
name = "P"
active = true
remote = "@C1"
[scenario]
name = "a type changes"
steps = '''
set R1 EN_R=0
run 9
peer P connect
wait R1 STATUS=7004
set R1 EN_R=1
run 9
peer P send hex 01 00 00 00 00 00 C0 3F 01 00 00 00
run 9
set R1 EN_R=0
run 3
resize rx ARRAY[0..3] OF INT
set R1 EN_R=1
run 9
peer P send hex 01 00 02 00 03 00 04 00
run 9
'''
"""


def test_after_a_change_of_the_type_its_old_columns_are_empty(run: Run, folder: Path) -> None:
    (folder / "s.toml").write_text((folder / "p.toml").read_text() + CHANGES)
    assert main(["scenario", "s.toml", "--record", "s.pcapng"]) == 0
    found = told(rows(run, "s.pcapng", other_types=1), "length", "hex", "state", "count")
    assert [(row[0], *row[2:]) for row in found] == [("12", "1", "1"), ("8", "", "")]
    assert found[1][1] == "01 00 02 00 03 00 04 00"
    assert told(rows(run, "s.pcapng", "--where", "state = 1", other_types=1), "length") == [("12",)]
    assert told(rows(run, "s.pcapng", "--where", "length < 9", other_types=1), "length") == [("8",)]


def test_columns_are_of_the_type_that_data_has_with_its_first_message(run: Run, folder: Path) -> None:
    (folder / "u.st").write_text(
        "TYPE Pair : STRUCT first : DINT; more : ARRAY[0..7] OF BYTE; END_STRUCT END_TYPE"
    )
    changes = CHANGES.replace("run 9", "add udt u.st\nset data rx type=Pair\nrun 9", 1)
    (folder / "s.toml").write_text((folder / "p.toml").read_text() + changes)
    assert main(["scenario", "s.toml", "--record", "s.pcapng"]) == 0
    found = told(rows(run, "s.pcapng", other_types=1), "length", "first")
    assert found == [("12", "1"), ("8", "")]
    assert told(rows(run, "s.pcapng", "--where", "first = 1", other_types=1), "length") == [("12",)]


class Cut:
    """A cutter, and what it has given: size, bytes, reason, whether the message begins there."""

    def __init__(self, record: int) -> None:
        self.found: list[tuple[int, bytes, str, bool]] = []
        self.cutter = MessageCutter(record, lambda _, *told: self.found.append((told[1], told[0], *told[2:])))

    def play(self, *told: bytes | int | float, largest: int = 1460) -> list[tuple[int, str, bool]]:
        """Take segments a millisecond apart; a float is a pause in s, an int a hole."""
        ns = 0
        for each in told:
            ns += int(each * 1e9) if isinstance(each, float) else 1_000_000
            if isinstance(each, int):
                self.cutter.add_hole(ns, each)
            elif isinstance(each, bytes):
                self.cutter.add_segment(ns, each, largest)
        self.cutter.end_message(ns, "FIN")
        return [(size, reason, begins) for size, _, reason, begins in self.found]


A, B, L = bytes(range(12)), bytes(range(12, 24)), bytes(1460)


@pytest.mark.parametrize(
    ("segments", "rows"),
    [
        ((A, B), [(12, "", True)] * 2),
        ((A + B,), [(12, "", True)] * 2),
        ((A[:4], A[4:], B), [(12, "", True)] * 2),
        ((A[:4], 0.1, A[4:], 0.1), [(4, "", True), (8, "", True)]),
        ((A[:10],) * 6, [(10, "", True)] * 5 + [(10, "FIN", True)]),
        ((A + B + A[:3],), [(27, "", True)]),
        ((L, L, L[: 1460 - 24], L, L, L), [(12, "", True)] * 728),
        ((A[:10], 5 * A), [(10, "", True), (60, "", True)]),
        ((5 * A, 0.1, A[:10]), [(60, "", True), (10, "FIN", True)]),
        ((5 * A, 0.1, 5 * A, 0.1, A), [(12, "", True)] * 11),
        ((A[:5], A, A, A + B), [(5, "", True)] + [(12, "", True)] * 4),
        ((L, L, L[: 1460 - 20]), [(4360, "", True)]),
        ((L, L, L[:1460 - 24]), [(12, "", True)] * 363),
        ((A, 24, B), [(12, "", True)] * 2),
        ((A, A[:5], 7, B), [(12, "", True), (5, "hole", True), (12, "", True)]),
        ((A, A[:5], 3, A[8:] + B), [(12, "", True), (5, "hole", True), (4, "hole", False), (12, "", True)]),
        ((A[:9], 12, A, 0.1, B), [(9, "hole", True), (12, "", True), (12, "", True)]),
        ((A[:9], A[:9], 9, A[:9], A), [(9, "", True), (9, "hole", True), (9, "hole", False), (12, "", True)]),
    ],
)  # fmt: skip
def test_a_type_cuts_what_pauses_and_segments_end(
    segments: tuple[bytes | int | float, ...], rows: list[tuple[int, str, bool]]
) -> None:
    assert Cut(12).play(*segments) == rows


@pytest.mark.parametrize(("size", "rows"), [(10, [10] * 8), (12, [10, 10, 60])])
def test_what_a_plc_has_read_is_cut_by_pauses_alone(size: int, rows: list[int]) -> None:
    reads = 0.1, A[:10], 0.1, A[:2], A[:8], 0.1, A[:4], A[:6], A[:6], A[:4], A, A, A, A[:4]
    assert [row[0] for row in Cut(size).play(*reads, largest=0)] == rows, "its jobs end at 12 bytes"


def test_without_a_type_pauses_end_messages_and_what_is_held_is_bounded() -> None:
    assert Cut(0).play(A, B, 0.1, A) == [(24, "", True), (12, "", True)]
    assert Cut(0).play(L, 0.03, A) == [(1472, "", True)], "the rest of what fills a segment"
    assert max(size for size, _, _ in Cut(0).play(*[L] * 200)) < 65_535 + 1460
    held = Cut(12)
    for n in range(1000):
        held.cutter.add_segment(n, L, 1460)
        assert len(held.cutter._held) <= 65_535
    assert all(size == 12 for size, *_ in held.found)


@pytest.mark.parametrize("source", ["recording", "capture"])
def test_of_a_file_cut_anywhere_come_the_rows_before_with_one_line(
    source: str, run: Run, folder: Path
) -> None:
    (folder / "c.pcapng").write_bytes(capture(stream(*[telegram(*each) for each in SENT[:20]])))
    if source == "recording":
        start, _, rest = SENDS.partition("[[data]]")
        (folder / "b.toml").write_text(start + (folder / "p.toml").read_text() + "[[data]]" + rest)
        assert main(["record", "b.toml", "--kernel", "sim", "--out", "out", "--duration", "T#100ms"]) == 0
        (folder / "c.pcapng").write_bytes((folder / "out" / "b-0001.pcapng").read_bytes())
    words = ["--udt", "t.st"] if source == "capture" else []
    whole, content = run("c.pcapng", *words, "--format", "csv")[1], (folder / "c.pcapng").read_bytes()
    for size in range(0, len(content), max(1, len(content) // 60)):
        (folder / "cut.pcapng").write_bytes(content[:size])
        code, out, err = run("cut.pcapng", *words, "--format", "csv")
        assert code in (0, 1, 2) and len(err.splitlines()) <= 1
        if code == 0 and (source == "recording" or "FIN" not in out):
            assert out.splitlines()[:-1] == whole.splitlines()[: len(out.splitlines()) - 1]


def test_a_mistake_is_one_line(run: Run, folder: Path) -> None:
    (folder / "c.pcapng").write_bytes(capture(stream(*[telegram(*each) for each in SENT[:3]])))
    said: list[tuple[str, list[str]]] = []
    for line in (
        "p.toml", "p.toml c.pcapng --for T#1s", "c.pcapng --for T#1s", "c.pcapng --instance R1",
        "c.pcapng --layout packed", "c.pcapng --udt t.st --project p.toml", "c.pcapng --plc 10.0.0.7",
        "c.pcapng --project p.toml --instance R2", "c.pcapng --project p.toml --members weigth",
        "c.pcapng --udt t.st --where weigth>1", "c.pcapng --project p.toml --where weigth>1", "none.pcapng",
        "c.pcapng --out t.st",
    ):  # fmt: skip
        code, out, err = run(*line.split())
        assert (code, out) == (2, "")
        said.append((line, err.splitlines()))
    golden.agree("mistakes", "messages", said)


SCL = 'TYPE "T"\nSTRUCT\n "my name" : Int;\n "a=b" : Real;\n "q,r" : Bool;\nEND_STRUCT;\nEND_TYPE'


def test_names_in_quotes_may_have_blanks_commas_and_operators(run: Run, folder: Path) -> None:
    (folder / "t.scl").write_text(SCL)
    sent = [struct.pack(">hf?x", n, n / 2, n % 2) for n in range(4)]
    (folder / "c.pcapng").write_bytes(capture(stream(*sent)))
    asked = "c.pcapng", "--udt", "t.scl", "--layout", "s7-standard", "--members", 'my name, "q,r"'
    for where, numbers in (
        ("my name = 2", "3"),
        ('"a=b" > 0.5', "34"),
        ('"q,r"=1', "24"),
        ('"a=b" != 1', "124"),
    ):
        found = rows(run, *asked, "--where", where)
        assert "".join(row["n"] for row in found) == numbers
        assert [*found[0]][-3:] == ["hex", "my name", "q,r"]


def test_out_is_a_new_file_and_nothing_half_is_left(
    run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "c.pcapng").write_bytes(capture(stream(*[telegram(*each) for each in SENT])))
    asked = "c.pcapng", "--udt", "t.st", "--format", "csv"
    assert run(*asked, "--out", "m.csv") == (0, "", "")
    assert (folder / "m.csv").read_text() == run(*asked)[1]
    assert run(*asked, "--out", "n.csv", "--where", "state=77") == (1, "", "")
    before = sorted(folder.iterdir())

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("trcvtui.files.os.fsync", full)
    code, _, err = run(*asked, "--out", "n.csv")
    assert (code, len(err.splitlines())) == (2, 1)
    assert sorted(folder.iterdir()) == before
