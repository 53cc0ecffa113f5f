"""A serial port that is not there: which one, what the system said, what to do, in "why" and as a warning."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bench.bench_lines import do
from trcvtui.bench.bench import Bench
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import Step
from trcvtui.diagnosis.advice import Advice, make_advice
from trcvtui.diagnosis.evidence import make_current_evidence
from trcvtui.diagnosis.serial import list_framing_warnings
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.net.results import Fault
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.plc.port_hints import describe_port_fault, port_hint
from trcvtui.plc.snapshot import ComBufferSnapshot
from trcvtui.project.file import load_project
from trcvtui.scenario.runner import ScenarioRunner, VirtualPace
from trcvtui.snapshots.bench import EngineTiming

PROJECT = """
dialect = "twincat"
[[task]]
name = "FAST"
interval = "T#10ms"
[[task]]
name = "SLOW"
interval = "T#100ms"
[[data]]
name = "rx"
type = "ARRAY[0..15] OF BYTE"
[[combuffer]]
name = "RX"
source = "serial"
port = "{port}"
[[combuffer]]
name = "TX"
line = "RX"
[[instance]]
name = "RD"
block = "ReceiveData"
RxBuffer = "RX"
data = "rx"
SizeReceiveData = 4
Timeout = "{timeout}"
task = "{task}"
[[instance]]
name = "SB"
block = "SendByte"
TxBuffer = "TX"
SendByte = 65
"""


def bench_on(folder: Path, port: str = "/dev/ttyUSB0", timeout: str = "T#0s", task: str = "FAST") -> Bench:
    file = folder / "port.toml"
    file.write_text(PROJECT.format(port=port, timeout=timeout, task=task), encoding="utf-8")
    return fresh_bench(load_project(file), "sim")


def why(bench: Bench, name: str) -> Advice:
    picture = Controller(bench).picture(UpdateRequest(), EngineTiming(), 0)
    evidence = make_current_evidence(picture, bench.project, name)
    assert evidence is not None
    return make_advice(evidence)


def warned(bench: Bench) -> tuple[str, ...]:
    return list_framing_warnings(bench.runtime.snapshot(), bench.project, "RD")


def test_a_port_that_may_not_be_opened_is_told_with_its_call_and_its_errno(tmp_path: Path) -> None:
    bench = bench_on(tmp_path)
    do(bench, "fault open EACCES on RX times=forever", scans=1)
    told = why(bench, "RD")
    assert told.why == "injected fault: port /dev/ttyUSB0 of RX is not there: open gave EACCES"
    assert "dialout" in told.checks[0]
    assert warned(bench)[0].startswith(told.why) and "dialout" in warned(bench)[0]
    bench.close()


def test_a_sender_is_told_of_the_port_that_its_bytes_go_out_over(tmp_path: Path) -> None:
    bench = bench_on(tmp_path)
    do(bench, "fault open ENOENT on RX times=forever", scans=1)
    (told,) = why(bench, "SB").checks
    assert told.startswith(
        "injected fault: port /dev/ttyUSB0 of TX is not there: open gave ENOENT: there is no"
    )
    rx, tx = bench.runtime.snapshot().combuffers
    assert (tx.line, tx.port, tx.is_up, tx.fault) == ("RX", rx.port, False, rx.fault)
    bench.close()


def test_a_port_that_is_pulled_and_comes_back_is_told_as_long_as_it_is_away(tmp_path: Path) -> None:
    bench = bench_on(tmp_path)
    bench.step()
    assert not warned(bench)[0].startswith("port") and why(bench, "RD").why == "no frame has begun"
    do(bench, "fault read EIO on RX", scans=1)
    assert why(bench, "RD").why == "injected fault: port /dev/ttyUSB0 of RX is not there: read gave EIO"
    for _ in range(101):
        bench.step()
    assert bench.runtime.snapshot().combuffers[0].is_up
    assert why(bench, "RD").why == "no frame has begun"
    bench.close()


@pytest.mark.parametrize("stopped", [False, True])
def test_nothing_is_told_of_a_port_that_nobody_has_tried(tmp_path: Path, stopped: bool) -> None:
    bench = bench_on(tmp_path)
    if stopped:
        do(bench, "plc stop", scans=1)
    assert describe_port_fault(bench.runtime.snapshot().combuffers[0]) == ""
    bench.close()


def test_where_no_hint_is_known_the_words_of_the_system_are_told() -> None:
    fault = Fault("open", "EINVAL", words="invalid URL, protocol 'pigeon' not known")
    buffer = ComBufferSnapshot("RX", "serial", 300, 0, 0, 0, False, port="pigeon://1", fault=fault)
    assert describe_port_fault(buffer) == "port pigeon://1 of RX is not there: open gave EINVAL"
    assert port_hint(buffer) == fault.words


@pytest.mark.parametrize("port", ["socket://10.0.0.7:4001", "rfc2217://10.0.0.7:4001"])
def test_a_gap_is_a_guess_on_a_port_that_is_a_tcp_connection(tmp_path: Path, port: str) -> None:
    bench = bench_on(tmp_path, port, "T#50ms")
    bench.step()
    assert "a gap over TCP is a guess" in warned(bench)[0]
    bench.close()


def test_a_gap_on_a_real_line_is_no_guess(tmp_path: Path) -> None:
    bench = bench_on(tmp_path, timeout="T#50ms")
    bench.step()
    assert warned(bench) == ()
    bench.close()


def test_a_timeout_is_measured_by_the_task_that_calls_the_block(tmp_path: Path) -> None:
    bench = bench_on(tmp_path, timeout="T#50ms", task="SLOW")
    bench.step()
    (told,) = warned(bench)
    assert told.startswith("Timeout is 50 ms, but RD is called every 100 ms")
    bench.close()


@pytest.mark.parametrize(
    ("line", "said"), [("feed TX hex 01", "found 'TX', expected RX"), ("feed RX brk", r"found 'brk'.*break")]
)
def test_what_cannot_be_fed_is_told_with_what_can(line: str, said: str, tmp_path: Path) -> None:
    bench = bench_on(tmp_path)
    with pytest.raises(Exception, match=said):
        parse_line(line, bench.project, "w")
    bench.close()


def test_a_scenario_that_waits_in_vain_for_a_port_says_so(tmp_path: Path) -> None:
    bench = bench_on(tmp_path)
    do(bench, "fault open EACCES on RX times=forever", scans=1)
    command = parse_line("wait RD DataReceived=1 within T#100ms", bench.project, "test")
    assert command is not None
    step = Step(1, "wait", command)
    verdict = ScenarioRunner(bench, "x", VirtualPace(), lambda scan, outputs, sent: None).play([step])
    (failure,) = verdict.failures
    away = "injected fault: port /dev/ttyUSB0 of RX is not there: open gave EACCES"
    assert failure.found == f"DataReceived=0; {away}"
    bench.close()
