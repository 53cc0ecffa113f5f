"""Frames, decisions and streams of configs/scenarios/twincat, where the ledger tells more than a trace."""

from __future__ import annotations

import pytest

from tests.scenario.scenarios import TWINCAT, failures
from trcvtui.bench.bench import Bench
from trcvtui.blocks.environment import (
    BufferBytesLost,
    FeederHold,
    FrameEnded,
    NoiseDropped,
    PartialFrameDropped,
)
from trcvtui.blocks.status import Reproducibility
from trcvtui.dialects.twincat.rules import COM_ERRORS
from trcvtui.scenario.runner import ScenarioRunner, VirtualPace
from trcvtui.scenario.scenario import load_scenario
from trcvtui.scenario.scenario_index import read_shown_codes


def played(stem: str) -> Bench:
    (path,) = [path for path in TWINCAT if path.stem.startswith(stem)]
    scenario = load_scenario(path)
    bench = Bench(scenario.project, "sim")
    verdict = ScenarioRunner(bench, "x", VirtualPace(), lambda scan, outputs, sent: None).play(
        (*scenario.start, *scenario.steps)
    )
    assert verdict.has_passed, failures(verdict)
    bench.close()
    return bench


@pytest.mark.slow
def test_every_error_that_is_not_of_the_hardware_is_shown_by_a_scenario_that_names_it() -> None:
    for row in COM_ERRORS:
        if row.reach is Reproducibility.NEVER or not row.error:
            continue
        for block in row.blocks:
            if (block, row.code) in ALIKE:
                continue
            files = [path for path in TWINCAT if (row.code, block) in read_shown_codes(path)]
            assert files, f"{row.word} on {block}"
            assert any(row.word[3:].lower() in path.stem for path in files), row.word


# One code for several blocks, which check it in one place: shown on another of them.
ALIKE = {
    (block, code)
    for code, blocks in {
        1: ("ReceiveString", "ReceiveString255", "SendByte", "SendString"),
        2: ("SendByte", "SendString"),
        11: ("ReceiveString255",),
        20: ("SendString",),
        21: ("ReceiveString", "ReceiveString255"),
    }.items()
    for block in blocks
}


def test_a_connection_that_closes_in_a_frame_leaves_a_note_and_no_bytes() -> None:
    bench = played("6-t04")
    events = [line.event for line in bench.runtime.ledger]
    assert PartialFrameDropped("RD", "RX", 0, 2, "connection closed") in events
    assert not any(isinstance(event, FrameEnded) for event in events)
    assert bench.runtime.snapshot().combuffers[0].count == 0


def test_noise_is_counted_in_the_ledger() -> None:
    framer = next(each.framer for each in played("3-14").runtime.snapshot().instances if each.framer)
    assert (framer.discarded, framer.noise) == (43, b"\xff\xee\xdd" + b"\x55" * 40)
    totals = [e.total for line in played("3-14").runtime.ledger if isinstance(e := line.event, NoiseDropped)]
    assert totals == [3, 43]


def test_what_overflows_is_counted_and_noted() -> None:
    bench = played("5-15")
    lost = [line.event for line in bench.runtime.ledger if isinstance(line.event, BufferBytesLost)]
    assert lost == [BufferBytesLost("RX", 300, 3, "the ComBuffer is full", 300)]
    assert bench.runtime.snapshot().combuffers[0].lost == 3


@pytest.mark.slow
def test_a_stream_without_an_end_is_held_back_and_nothing_of_it_is_lost() -> None:
    bench = played("6-t09")
    (buffer,) = bench.runtime.snapshot().combuffers
    assert buffer.size - 4096 < buffer.count <= buffer.size
    assert buffer.lost == 0
    assert FeederHold("RX", True) in [line.event for line in bench.runtime.ledger]
    frames = [e for line in bench.runtime.ledger if isinstance(e := line.event, FrameEnded)]
    assert [frame.offset for frame in frames] == [16 * n for n in range(len(frames))]


def test_with_its_switch_a_part_ends_where_en_r_falls() -> None:
    (path,) = [path for path in TWINCAT if path.stem.startswith("6-t07")]
    scenario = load_scenario(path, ["options.reset_framer_with_en_r=true"])
    bench = Bench(scenario.project, "sim")
    runner = ScenarioRunner(bench, "x", VirtualPace(), lambda scan, outputs, sent: None)
    assert not runner.play((*scenario.start, *scenario.steps)).has_passed
    events = [line.event for line in bench.runtime.ledger]
    assert PartialFrameDropped("RD", "RX", 0, 1, "EN_R fell") in events
    assert FrameEnded("RD", "RX", 1, 2, "suffix", suffix=1, number=1) in events
    bench.close()
