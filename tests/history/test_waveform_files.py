"""Timing as files: the VCD, read by somebody else's reader, is what the scans were; SVG and text too."""

from __future__ import annotations

import signal
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import cast

import pytest
from vcdvcd import VCDVCD  # type: ignore[import-untyped]

from tests.history.waveform_runs import RECEIVER, SENDER, Run, connected, random_run
from trcvtui.errors import UserError
from trcvtui.history.pin_waveform import pins_of
from trcvtui.history.waveform_text import (
    ScanRange,
    free_path,
    plain_text,
    svg_text,
    target_folder,
    vcd_text,
    write_waves,
)
from trcvtui.plc.ledger import InputEdge, StatusEdge

if hasattr(signal, "SIGPIPE"):
    # vcdvcd lets the whole process die of a closed pipe; every other test wants EPIPE, as Python has it.
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)

INTERVAL = 10_000_000
SVG = "{http://www.w3.org/2000/svg}"


def read_back(text: str) -> dict[str, list[tuple[int, int | None]]]:
    """Return every signal with its changes (time, value), as vcdvcd reads them."""
    vcd = VCDVCD(vcd_string=text)
    return {
        name: [(t, None if value == "x" else int(value, 2)) for t, value in vcd[name].tv]
        for name in cast("list[str]", vcd.signals)
    }


def whole(run: Run) -> ScanRange:
    return ScanRange(1, run.wave().until_scan)


def test_the_vcd_read_back_is_what_every_pin_was_after_every_scan() -> None:
    run = random_run(21, 3000)
    told = read_back(vcd_text([run.wave(RECEIVER), run.wave(SENDER)], whole(run)))
    for instance, pins in run.seen.items():
        for pin, values in pins.items():
            changes = told[f"{instance}.{pin}"]
            place = 0
            for scan, value in enumerate(values, 1):
                end = scan * INTERVAL - 1
                while place + 1 < len(changes) and changes[place + 1][0] <= end:
                    place += 1
                assert changes[place][1] == value, (instance, pin, scan)


def test_the_vcd_read_back_has_every_change_of_the_ledger() -> None:
    run = random_run(22, 800)
    told = read_back(vcd_text([run.wave()], whole(run)))
    last: dict[str, int | None] = {}
    written: dict[str, list[tuple[int, int | None]]] = {}
    for line in run.console.bench.runtime.ledger.since(0):
        event = line.event
        if isinstance(event, StatusEdge | InputEdge) and event.instance == RECEIVER:
            for pin, value in pins_of(event):
                if last.get(pin, -1) != value:
                    written.setdefault(pin, []).append((line.t_ns, value))
                last[pin] = value
    for pin, changes in written.items():
        known = [change for change in told[f"{RECEIVER}.{pin}"] if change[1] is not None]
        if pin in ("EN_R", "CONT", "LEN", "ADHOC", "COM_RST"):
            known = known[1:]  # what it was from the beginning
            changes = [c for n, c in enumerate(changes) if n or c[1]]
        assert [value for _, value in known] == [value for _, value in changes], pin
        assert all(0 <= t - at < 10 for (t, _), (at, _) in zip(known, changes, strict=True)), pin


def test_a_reset_that_rises_and_falls_in_one_scan_has_two_times_in_the_vcd() -> None:
    run = connected()
    run.say("pulse TRCV_C_1 COM_RST")
    run.scan(3)
    run.catch_up()
    changes = read_back(vcd_text([run.wave()], whole(run)))[f"{RECEIVER}.COM_RST"]
    (up, one), (down, zero) = changes[-2:]
    assert (one, zero) == (1, 0) and down == up + 1


def test_widths_are_those_of_the_manual() -> None:
    run = connected()
    run.catch_up()
    text = vcd_text([run.wave()], whole(run))
    for words in ("$timescale 1 ns", "reg 16", "reg 32", "wire 1", "module TRCV_C_1"):
        assert words in text


def test_a_vcd_between_two_markers_begins_with_what_the_pins_were() -> None:
    run = connected()
    run.say("peer P1 send random 8 seed=1")
    run.scan(20)
    run.catch_up()
    told = read_back(vcd_text([run.wave()], ScanRange(12, 25)))
    assert told[f"{RECEIVER}.CONT"] == [(0, None), (10 * INTERVAL, 1)]
    assert told[f"{RECEIVER}.DONE"][-2:] != told[f"{RECEIVER}.DONE"][-1:], "the pulse is inside"


def test_the_svg_is_well_formed_and_labels_the_codes() -> None:
    run = connected()
    run.say("peer P1 send random 8 seed=1")
    run.scan(20)
    run.catch_up()
    root = ET.fromstring(svg_text([run.wave(), run.wave(SENDER)], ScanRange(10, 30)))
    words = [element.text for element in root.iter(f"{SVG}text")]
    for word in (
        "7006",
        "TRCV_C_1 DONE",
        "TSEND_C_1 STATUS",
        "scan 10 at 90.000 ms  to  scan 30 at 290.000 ms",
    ):
        assert word in words
    done = words.index("TRCV_C_1 DONE")
    assert done > 0
    heights = {
        point.split(",")[1] for line in root.iter(f"{SVG}polyline") for point in line.attrib["points"].split()
    }
    assert len(heights) > 10, "levels at both heights of the rows"


def test_the_text_draws_the_rows_and_lists_the_edges_with_their_causes() -> None:
    run = connected()
    run.say("peer P1 send random 8 seed=1")
    run.scan(20)
    run.catch_up()
    text = plain_text([run.wave()], whole(run), 1)
    assert text.startswith("scans 1 to 34, 1 scan a column\n")
    done = next(line for line in text.splitlines() if line.startswith("DONE"))
    assert done.count("█") == 1 and "watch DONE" in text
    assert "16#7008 received" in text and "the frame is complete" in text


@pytest.mark.slow
def test_the_text_of_a_long_run_stays_short() -> None:
    run = random_run(23, 9000)
    text = plain_text([run.wave()], whole(run), 1)
    assert "4 scans a column" in text
    assert len(text.splitlines()) < 4000


def test_an_existing_file_is_not_written_over(tmp_path: Path) -> None:
    run = connected()
    run.catch_up()
    path = tmp_path / "a.vcd"
    assert write_waves(path, "vcd", [run.wave()], whole(run), 1) == path.stat().st_size
    with pytest.raises(UserError, match="is there already"):
        write_waves(path, "vcd", [run.wave()], whole(run), 1)
    assert free_path(tmp_path, "a", "vcd") == tmp_path / "a-2.vcd"
    with pytest.raises(UserError, match="vcd, svg, text"):
        write_waves(tmp_path / "b", "png", [run.wave()], whole(run), 1)
    with pytest.raises(UserError):
        write_waves(tmp_path / "none" / "b.vcd", "vcd", [run.wave()], whole(run), 1)


def test_files_go_beside_the_project_but_never_into_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from trcvtui.paths import demo_path

    monkeypatch.chdir(tmp_path)
    (tmp_path / "plant").mkdir()
    assert target_folder(tmp_path / "plant" / "a.toml") == tmp_path / "plant"
    assert target_folder(demo_path()) == tmp_path
