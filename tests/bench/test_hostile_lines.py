"""A device that sends noise for ever, or a frame that never ends: few bytes are held, and scans go on.

What is counted are bytes and calls, never time.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bench.bench_lines import do
from trcvtui.bench.bench import Bench
from trcvtui.blocks.framing import KEPT_NOISE_BYTES
from trcvtui.blocks.serial.com_buffer import MOST_RECORDED_BYTES
from trcvtui.engine.controller import fresh_bench
from trcvtui.net.serial_line import SIMULATED_LINE_BYTES, SimSerialPort
from trcvtui.plc.serial_line_control import MOST_READ_BYTES
from trcvtui.plc.snapshot import FramerSnapshot
from trcvtui.project.file import load_project

SIZE = 200  # of a frame
PROJECT = """
dialect = "twincat"
start = "write mark hex aa 55"
[[data]]
name = "mark"
type = "ARRAY[0..1] OF BYTE"
[[data]]
name = "rx"
type = "ARRAY[0..199] OF BYTE"
[[data]]
name = "chunk"
type = "ARRAY[0..4095] OF BYTE"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
[[combuffer]]
name = "RX"
{source}
[[instance]]
name = "T"
block = "TRCV_C"
connect = "C1"
data = "chunk"
ADHOC = true
CONT = true
EN_R = true
[[instance]]
name = "RD"
block = "ReceiveData"
RxBuffer = "RX"
data = "rx"
{mark}
SizeReceiveData = 200
[[peer]]
name = "P"
active = true
remote = "@C1"
"""
SERIAL = 'source = "serial"\nport = "/dev/ttyUSB0"'
STREAM = 'source = "T"'
SUFFIX = 'pSuffix = "mark"\nLenSuffix = 2'
LINES = pytest.mark.parametrize("source", [SERIAL, STREAM], ids=["serial", "tcp"])
SCANS = 300
A_SCAN = 6000  # bytes


def bench_on(folder: Path, source: str, mark: str) -> Bench:
    file = folder / "line.toml"
    file.write_text(PROJECT.format(source=source, mark=mark), encoding="utf-8")
    bench = fresh_bench(load_project(file), "sim")
    do(bench, "run 10", "plc run", "run 10", "peer P connect", scans=10)
    return bench


def flood(bench: Bench, source: str, scans: int) -> int:
    """Let more come in each scan than a scan can take; return the most bytes that were held after one."""
    most = 0
    for number in range(scans):
        payload = f"random {A_SCAN} seed={number}"
        do(bench, f"peer P send {payload}" if source == STREAM else f"feed RX {payload}")
        before = bench.runtime.scans
        bench.step()
        assert bench.runtime.scans == before + 1
        most = max(most, held(bench))
    return most


def framer_of(bench: Bench) -> FramerSnapshot:
    framer = next(each.framer for each in bench.runtime.snapshot().instances if each.name == "RD")
    assert framer is not None
    return framer


def held(bench: Bench) -> int:
    (rx,) = bench.runtime.snapshot().combuffers
    noise = framer_of(bench).noise
    assert rx.count <= rx.size and len(noise) <= KEPT_NOISE_BYTES
    return rx.count + len(noise) + len(bench.runtime.job_bytes("RD")) + bench.runtime.recording("RX").size


def room(source: str) -> int:
    return (65_536 if source == STREAM else 300) + KEPT_NOISE_BYTES + SIZE + MOST_RECORDED_BYTES


@pytest.mark.slow
@LINES
def test_a_frame_that_never_ends_ends_at_its_size_each_time(tmp_path: Path, source: str) -> None:
    bench = bench_on(tmp_path, source, SUFFIX)
    assert flood(bench, source, SCANS) <= room(source)
    out = bench.runtime.outputs("RD")
    assert (out.rcvd_len, out.status) == (SIZE, 23)
    assert bench.runtime.snapshot().instance("RD").jobs_done > SCANS - 20  # type: ignore[union-attr]
    bench.close()


def test_a_full_combuffer_slows_a_tcp_device_and_loses_nothing(tmp_path: Path) -> None:
    bench = bench_on(tmp_path, STREAM, SUFFIX)
    flood(bench, STREAM, SCANS)
    (rx,), (link,) = bench.runtime.snapshot().combuffers, bench.runtime.snapshot().connections
    assert rx.lost == 0 and rx.count > rx.size - 4096
    assert rx.arrived == link.bytes_received < SCANS * A_SCAN // 10  # the network has the others
    bench.close()


def test_a_scan_takes_no_more_of_a_port_than_its_share() -> None:
    port = SimSerialPort()
    port.open()
    port.simulate_arrival(b"\x55" * (SIMULATED_LINE_BYTES + 1000))
    assert len(port.read(MOST_READ_BYTES)) == MOST_READ_BYTES
    assert len(port.read(SIMULATED_LINE_BYTES)) == SIMULATED_LINE_BYTES - MOST_READ_BYTES
