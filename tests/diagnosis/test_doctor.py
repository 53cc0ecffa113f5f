"""The doctor names each generated fault, calls healthy lines healthy, and keeps its JSON contract."""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import pytest

from tests import golden
from tests.diagnosis.doctor_cases import (
    FAULTS,
    HEALTHY,
    Built,
    S,
    Telegrams,
    Wire,
    begin,
    built,
    record,
    talk,
    verdicts_of,
)
from tests.recording.wire import ACK, PLC, RST, SYN, capture, serial_line, tcp
from trcvtui.cli.main import main
from trcvtui.diagnosis.doctor import DoctorQuestion
from trcvtui.diagnosis.doctor import run_doctor as run_doctor
from trcvtui.diagnosis.receiver import Receiver

ROOT = Path(__file__).parents[2]


def found_in(made: Built, folder: Path) -> list[dict[str, Any]]:
    """Return the findings of all conversations, the surest of each cause, the best first."""
    path = folder / "case.pcapng"
    path.write_bytes(made.file(80 if made.what == "cut" else 0))
    verdicts = verdicts_of(path, made.plc, (made.receiver,) if made.receiver else ())
    assert all(one["healthy"] == (one["findings"] == []) for one in verdicts)
    best: dict[str, dict[str, Any]] = {}
    for finding in (finding for one in verdicts for finding in one["findings"]):
        if finding["cause"] not in best or finding["confidence"] > best[finding["cause"]]["confidence"]:
            best[finding["cause"]] = finding
    return sorted(best.values(), key=lambda one: -one["confidence"])


def test_the_cause_of_a_fault_is_named_first_and_told_in_its_words(tmp_path: Path) -> None:
    said, wrong = [], []
    for cause, make, kinds in FAULTS:
        for seed in range(1001, 1003):
            found = found_in(built(cause, make, kinds[seed % len(kinds)], seed), tmp_path)
            first: dict[str, Any] = (
                found[0] if found else {"cause": "", "title": "", "evidence": [], "mend": []}
            )
            if first["cause"] != cause or not (first["evidence"] and first["mend"]):
                wrong.append((cause, seed, found))
            if seed == 1001:
                texts = [f"- {text}" for text in first["evidence"]]
                texts += [f"> {mend['text']}" for mend in first["mend"]]
                said.append((f"{cause}: {first['title']}", texts))
    assert wrong == []
    golden.agree("doctor", "captures", said)


def test_a_healthy_line_has_no_finding(tmp_path: Path) -> None:
    made = [built("", make, make.__name__, seed) for make in HEALTHY for seed in range(1001, 1004)]
    assert [(one.what, found) for one in made if (found := found_in(one, tmp_path))] == []


def written(cause: str, folder: Path) -> Path:
    path = folder / f"{cause}.pcapng"
    number = next(n for n, row in enumerate(FAULTS) if row[0] == cause)
    path.write_bytes(built(cause, FAULTS[number][1], FAULTS[number][2][0], 1).file())
    return path


def test_the_json_of_a_finding_is_the_contract(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", str(written("refused", tmp_path)), "--format", "json"]) == 1
    (one, *_) = json.loads(capsys.readouterr().out)
    assert set(one) == {
        *("file", "conversation", "healthy", "verdict", "findings"),
        *("quality", "remarks", "not_judged"),
    }
    assert set(one["conversation"]) == {"plc", "partner", "protocol"}
    (finding, *_) = one["findings"]
    assert set(finding) == {
        *("cause", "confidence", "t_s", "where", "evidence", "mend"),
        *("title", "status", "packets", "filter", "explains"),
    }
    assert set(finding["where"]) == {"direction", "byte", "packet", "scan", "instance"}
    assert finding["cause"] == "refused" and finding["where"]["packet"] == 2
    assert set(finding["mend"][0]) == {"text", "command", "set", "tried"}


def test_a_healthy_capture_is_0_and_json_lines_have_one_object_a_conversation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "good.pcapng"
    path.write_bytes(built("", HEALTHY[0], "", 1).file())
    assert main(["doctor", str(path), "--format", "jsonl"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert json.loads(line)["healthy"] is True
    assert main(["doctor", str(path)]) == 0
    assert capsys.readouterr().out.endswith(": healthy\n")


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="file names are text there")
def test_a_file_name_that_is_no_text_breaks_no_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written("refused", tmp_path).rename(tmp_path / os.fsdecode(b"\xff"))
    assert main(["doctor", str(path), "--format", "json"]) == 1
    (one, *_) = msgspec.json.decode(capsys.readouterr().out)
    assert one["file"] == f"{tmp_path}/\\udcff"


def test_what_is_no_capture_is_2_and_does_not_hide_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = tmp_path / "bad.pcapng"
    bad.write_bytes(b"no capture at all")
    assert main(["doctor", str(bad), "--format", "json"]) == 2
    told = capsys.readouterr()
    assert json.loads(told.out) == [] and "bad.pcapng" in told.err
    assert main(["doctor", str(bad), str(written("refused", tmp_path))]) == 1
    told = capsys.readouterr()
    assert "refused (95% sure)" in told.out and "1 capture" in told.err


def test_a_plc_end_that_is_not_there_is_told_with_those_that_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["doctor", str(written("refused", tmp_path)), "--plc", "10.9.9.9"]) == 2
    assert "10.0.0.5:2000" in capsys.readouterr().err


def test_a_type_alone_tells_that_messages_are_too_short(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    udt = tmp_path / "wanted.st"
    udt.write_text("TYPE Wanted : STRUCT a : ARRAY[0..6999] OF BYTE; END_STRUCT END_TYPE")
    path = written("frame-short", tmp_path)
    assert main(["doctor", str(path), "--udt", str(udt), "--format", "json"]) == 1
    (one,) = json.loads(capsys.readouterr().out)
    assert one["findings"][0]["cause"] == "frame-short"


def test_workers_give_the_answers_of_one_process(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [str(written(cause, tmp_path)) for cause in ("refused", "resets", "loss")]
    assert run_doctor(files, DoctorQuestion(), "jsonl", 1) == 1
    alone = capsys.readouterr().out
    assert run_doctor(files, DoctorQuestion(), "jsonl", 2) == 1
    assert Counter(capsys.readouterr().out.splitlines()) == Counter(alone.splitlines())


def test_a_receiver_whose_connect_has_neither_end_is_not_accused(tmp_path: Path) -> None:
    cause, make, kinds = next(row for row in FAULTS if row[0] == "frame-short")
    made = built(cause, make, kinds[0], 1)
    assert made.receiver is not None
    made.receiver = made.receiver._replace(local_port=2999, own_address=bytes((10, 0, 0, 5)))
    assert found_in(made, tmp_path) == []


def test_with_a_type_the_end_that_receives_alone_is_the_plc(tmp_path: Path) -> None:
    made = Built("")
    r = Random(1)
    wire = Wire(r, made, begin(r), plc_calls=True).open()
    talk(r, wire, Telegrams(r, 20), 10, S, "alone")
    path = tmp_path / "c.pcapng"
    path.write_bytes(made.file())
    (one,) = verdicts_of(path, receivers=(Receiver("", "", 24),))
    assert one["conversation"]["plc"].startswith("10.0.0.5:")
    assert one["findings"][0]["cause"] == "frame-short"
    (one,) = verdicts_of(path, receivers=(Receiver("", "", 20),))
    assert one["healthy"]


READ, FRAMING, PARITY, OVERRUN = 2, 7, 8, 10  # events of RTAC serial


@pytest.mark.parametrize("ports", [(51001, 51001, 51001), (51001, 51002, 51003)])
def test_a_call_that_comes_again_after_its_refusal_counts_again(
    ports: tuple[int, ...], tmp_path: Path
) -> None:
    callers = [("10.0.0.9", port) for port in ports]
    calls = [
        (tcp(seq=7, flags=SYN, source=one), tcp(ack=8, flags=RST | ACK, source=PLC, target=one))
        for one in callers
    ]
    path = tmp_path / "c.pcapng"
    path.write_bytes(capture([packet for call in calls for packet in call], step_ns=250_000_000))
    found = verdicts_of(path)[0]["findings"]
    assert [(one["cause"], one["evidence"][1]) for one in found] == [
        ("refused", "seen 3 times in this capture")
    ]


def test_errors_that_the_driver_of_a_serial_line_tells_are_its_finding(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    noisy = (READ, b"\x02\x83\x11"), (PARITY, b""), (READ, b"\xff")
    path = tmp_path / "a.pcapng"
    path.write_bytes(serial_line(*noisy, (FRAMING, b""), (PARITY, b""), (OVERRUN, b"")))
    assert main(["doctor", str(path), "--format", "json"]) == 1
    [verdict] = json.loads(capsys.readouterr().out)
    [found] = verdict["findings"]
    assert (found["cause"], found["where"]["direction"], found["t_s"]) == ("line-errors", "to-plc", 0.05)
    assert found["evidence"] == ["4 line errors in 4 bytes: parity 2, framing 1, overrun 1"]


def test_a_serial_line_without_errors_is_healthy(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    path.write_bytes(serial_line(*[(READ, b"\x02OK\x03")] * 9))
    assert main(["doctor", str(path)]) == 0


@pytest.mark.parametrize("plc_calls", [False, True])
def test_a_caller_of_tls_1_3_whose_certificate_is_refused_gets_one_encrypted_alert(
    plc_calls: bool, tmp_path: Path
) -> None:
    made = Built("tls-refused")
    wire = Wire(Random(7), made, S, plc_calls=plc_calls).open()
    caller, listener = wire.caller, wire.listener
    wire.say(caller, record(22, b"\x01" + bytes(200)))
    wire.say(listener, record(22, b"\x02" + bytes(80)) + record(20, b"\x01") + record(23, bytes(400)))
    wire.say(caller, record(20, b"\x01") + record(23, bytes(300)))
    wire.say(listener, record(23, bytes(19)))
    wire.fin(caller)
    first = found_in(made, tmp_path)[0]
    assert first["cause"] == "tls-refused" and "one encrypted alert" in first["evidence"][0]
