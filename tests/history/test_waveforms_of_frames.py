"""The waves of blocks on a ComBuffer: their own pins, numbers as buses, in the pane and in every file."""

from __future__ import annotations

import re

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.history.pin_waveform import ScanWindow, Waveform, WaveformCache
from trcvtui.history.waveform_text import ScanRange, draw_row, format_vcd, row_names
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.project.file import load_project
from trcvtui.snapshots.bench import EngineTiming

INPUTS = {"LenPrefix": 8, "LenSuffix": 8, "SizeReceiveData": 32, "Timeout": 32, "Reset": 1}
OUTPUTS = {"DataReceived": 1, "busy": 1, "Error": 16, "RxTimeout": 1, "LenReceiveData": 32}


@pytest.fixture
def wave() -> Waveform:
    """Return the wave of an RD: a frame of 4 bytes, one that ends by a gap, one with no end in 16 bytes."""
    console = Controller(fresh_bench(load_project(CONFIGS / "twincat-line.toml"), "sim"))
    said = {
        1: ["prefix RD hex 02", "suffix RD hex 03", "set RD Timeout=50"],
        3: ["feed RX hex 02 41"],
        5: ["feed RX hex 42 03"],
        9: ["feed RX hex 02 41 42"],
        19: ["feed RX hex 02 " + "41 " * 15],
        21: ["create ReceiveByte RB RxBuffer=RX"],
        22: ["feed RX hex 99"],
    }
    for scan in range(1, 24):
        for line in said.get(scan, []):
            console.handle_line(scan, line)
        console.scan()
    shelf = WaveformCache()
    picture = console.picture(UpdateRequest(waves=(("RD", 0),)), EngineTiming(), 0)
    shelf.add_deltas(picture.waves, picture.snapshot.interval_ns)
    return shelf.get_wave("RD")


def row(wave: Waveform, name: str) -> str:
    return "".join(text for text, _ in draw_row(wave, name, ScanWindow(0, 23, 1)))


def test_the_rows_of_receivedata_are_its_own_pins_what_it_delivers_first(wave: Waveform) -> None:
    ghosts = {"watch DataReceived", "watch Error"}
    assert set(row_names(wave)) == INPUTS.keys() | OUTPUTS.keys() | ghosts
    assert row_names(wave)[:3] == ["DataReceived", "Error", "busy"]


def test_a_frame_is_one_pulse_of_datareceived_and_a_length_that_stays(wave: Waveform) -> None:
    assert row(wave, "DataReceived") == "▁▁▁▁█▁▁▁▁▁▁▁▁█▁▁▁▁█▁▁▁▁"
    assert row(wave, "busy") == "▁▁▔▔▁▁▁▁▔▔▔▔▔▁▁▁▁▁▁▁▁▁▁"
    assert row(wave, "RxTimeout") == "▁▁▁▁▁▁▁▁▁▁▁▁▁▔▔▔▔▔▁▁▁▁▁"
    assert row(wave, "LenReceiveData") == "│0──│4──│0───│3───│16──"
    assert row(wave, "Error") == "│0────────────────│23──"
    assert [wave.lanes["Error"].value_at(scan) for scan in (18, 19, 23)] == [0, 23, 23]


def test_the_vcd_declares_each_pin_as_wide_as_its_type(wave: Waveform) -> None:
    text = format_vcd([wave], ScanRange(1, 23))
    declared = {pin: (kind, int(bits)) for kind, bits, pin in re.findall(r"\$var (\w+) (\d+) . (\w+) ", text)}
    assert declared == {
        pin: ("reg" if bits > 1 else "wire", bits) for pin, bits in (INPUTS | OUTPUTS).items()
    }
    assert "b10111 " in text  # Error 23
