"""Every ERROR names its cause: the call, the errno, the partner, and whether a planned fault did it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.scenario.scenarios import BAOSKY, LEGACY, SIEMENS, SIM_ONLY, TWINCAT, played
from trcvtui.blocks.conditions import ERROR_CONDITIONS, Condition
from trcvtui.cli.main import main
from trcvtui.net.faults import KNOWN_ERRORS

ALL = BAOSKY + SIEMENS + LEGACY + TWINCAT + SIM_ONLY
# The calls that can have part in a condition, "" where none has; what stands in no line has none.
CALLS: dict[Condition, str] = {
    Condition.NO_SOCKET: "socket -",
    Condition.WRONG_LOCAL_ADDRESS: "bind -",
    Condition.REUSE_FAILED: "set_reuse",
    Condition.BIND_FAILED: "bind listen",
    Condition.POLL_ADD_FAILED: "poll_add",
    Condition.ACCEPT_FAILED: "accept",
    Condition.POLL_DEL_FAILED: "poll_del",
    Condition.CONNECT_FAILED: "connect",
    Condition.NOT_CONNECTED: "bind -",
    Condition.DISCONNECT_FAILED: "shutdown close",
    Condition.RESET_FAILED: "shutdown abort close",
    Condition.SHORT_FRAME: "recv",
    Condition.NO_BUFFER: "buffer",
    Condition.SEND_BUFFER_FULL: "send",
    Condition.SEND_FAILED: "send recv -",
    Condition.RECEIVE_FAILED: "recv -",
    Condition.LINK_DEAD: "recv send path connect",
    Condition.QUEUE_FULL: "queue",
    Condition.PARTNER_CLOSED: "recv",
    Condition.REFUSED: "connect recv",
    Condition.UNREACHABLE: "connect send",
    Condition.FOUND_CLOSED: "recv send",
    Condition.STILL_ASKED: "recv send -",
    Condition.PORT_IN_USE: "bind",
    Condition.PORT_RESERVED: "bind -",
    Condition.NO_RESOLVER: "resolve -",
    Condition.NAME_UNKNOWN: "resolve -",
    Condition.TLS_INTEGRITY: "recv",
}
OF_CERTIFICATES = {
    *(Condition.TLS_MESSAGE, Condition.TLS_HANDSHAKE, Condition.TLS_UNSUPPORTED, Condition.TLS_DISCARDED),
    *(Condition.TLS_NO_CA, Condition.TLS_EXPIRED, Condition.TLS_EXTENSION),
}
LINKED = {"accept", "connect", "recv", "send"}


def errors(path: Path) -> Iterator[tuple[Condition, dict[str, Any]]]:
    """Return each ERROR of a scenario that has a record: its condition and its cause."""
    run = played(path)
    records = [record for record in run.records() if record["ERROR"]]
    edges = [edge for edge in run.edges if edge.outputs.error]
    assert len(records) == len(edges)
    for record, edge in zip(records, edges, strict=True):
        yield Condition(edge.condition), record["cause"]


@pytest.mark.slow
def test_every_error_of_a_scenario_names_its_cause() -> None:
    for path in ALL:
        for condition, cause in errors(path):
            is_told(condition, cause, path)


def is_told(condition: Condition, cause: dict[str, Any], path: Path) -> None:
    where, plans_faults = (path.stem, condition, cause), "\nfault " in path.read_text()
    assert set(cause) == {"text", "call", "errno", "peer", "injected"}, where
    assert cause["text"] and cause["text"].isprintable(), where
    assert (cause["call"] or "-") in CALLS.get(condition, "-").split(), where
    assert cause["errno"] is None or cause["errno"] in KNOWN_ERRORS, where
    assert cause["errno"] is None or cause["call"] is not None, where
    if cause["call"] not in (None, "recv"):  # recv: 0 bytes, or what came in them, is no errno
        assert cause["errno"] is not None, where
    if cause["call"] in LINKED and "udp" not in path.stem:
        assert cause["peer"], where
    assert cause["injected"] is False or plans_faults, where
    assert cause["injected"] == cause["text"].startswith("injected fault: "), where


@pytest.mark.slow
def test_the_scenarios_bring_about_every_error_but_those_of_certificates() -> None:
    seen = {condition for path in ALL for condition, _ in errors(path)}
    nowhere = {Condition.INTERNAL_FAULT}  # test_internal_errors
    assert ERROR_CONDITIONS - seen == OF_CERTIFICATES | nowhere  # theirs: test_tls_blocks


@pytest.mark.slow
def test_a_record_without_error_has_no_cause() -> None:
    for path in ALL:
        assert all(("cause" in record) == record["ERROR"] for record in played(path).records())


# -- a fault is told as a fault, whichever call it hits ------------------------------------------------------

STREAM = """
dialect = "{dialect}"
[[data]]
name = "d"
type = "ARRAY[0..7] OF BYTE"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
LocalPort = 0
[[instance]]
name = "X"
block = "{block}"
connect = "C1"
data = "d"
[[peer]]
name = "P1"
active = true
remote = "@C1"
[scenario]
name = "one fault"
steps = '''
{steps}
'''
"""
UP = "set X CONT=1\nrun 3\npeer P1 connect\nrun 8\n"


def cause_of_the_error(text: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    path = folder / "one.toml"
    path.write_text(text)
    assert main(["scenario", str(path), "--format", "jsonl"]) == 0
    records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    first: dict[str, Any] = next(record["cause"] for record in records if record.get("ERROR"))
    return first


ISO = """
dialect = "s7-1500"
[[data]]
name = "d"
type = "ARRAY[0..7] OF BYTE"
[[connect]]
name = "C1"
type = "TCON_IP_RFC"
ActiveEstablished = true
RemoteAddress = "127.0.0.1"
LocalTSelector = "TCP-1"
RemoteTSelector = "TCP-2"
IsoPort = "@P1"
[[instance]]
name = "X"
block = "TSEND_C"
connect = "C1"
data = "d"
[[peer]]
name = "P1"
active = false
iso = true
local_tsap = "TCP-2"
remote_tsap = "TCP-1"
[scenario]
name = "ISO"
steps = '''
write d hex 01 01 01 01 01 01 01 01
set X CONT=1
wait X STATUS=7004
fault send EAGAIN on C1
pulse X REQ
run 3
write d hex 02 02 02 02 02 02 02 02
pulse X REQ
run 5
expect X trace ... 80C4! 7004 ...
expect peer P1 received hex 02 02 02 02 02 02 02 02
'''
"""


def test_a_message_that_the_stack_has_refused_is_not_sent_in_place_of_the_next(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cause = cause_of_the_error(ISO, tmp_path, capsys)
    assert (cause["call"], cause["errno"], cause["injected"]) == ("send", "EAGAIN", True)


# -- in every format -----------------------------------------------------------------------------------------


def test_text_and_junit_say_it_in_the_same_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps = UP + "fault send EAGAIN on C1\npulse X REQ\nrun 2\npulse X REQ\nrun 2\nexpect X STATUS=80A8"
    path = tmp_path / "one.toml"
    path.write_text(STREAM.format(dialect="baosky", block="TSEND_C", steps=steps))
    told = {}
    for form in ("jsonl", "text", "junit"):
        assert main(["scenario", str(path), "--format", form]) == 1
        told[form] = capsys.readouterr().out
    first = json.loads(next(line for line in told["jsonl"].splitlines() if '"ERROR":true' in line))
    words = first["cause"]["text"]
    assert words.startswith("injected fault: the stack takes no byte (send gave EAGAIN), 0 of 8 bytes taken")
    line = f"ERROR X 80A8 in scan {first['scan']}: {words}"
    assert line in told["text"]
    assert line in told["junit"]


def test_an_error_that_comes_again_is_one_line_of_the_text(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = "set X CONT=1 REQ=blink\nrun 12"
    (tmp_path / "one.toml").write_text(STREAM.format(dialect="baosky", block="TSEND_C", steps=steps))
    assert main(["scenario", str(tmp_path / "one.toml")]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines() if "ERROR" in line]
    assert len(lines) == 1
    assert lines[0].startswith("ERROR X 80A1 4 times in scans ")
