"""Timing as files: the VCD, read by somebody else's reader, is what the scans were."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import cast

import pytest
from vcdvcd import VCDVCD  # type: ignore[import-untyped]

from tests.history.waveform_runs import RECEIVER, Run, connected, random_run
from trcvtui.errors import UserError
from trcvtui.history.pin_waveform import event_pins
from trcvtui.history.waveform_text import (
    ScanRange,
    export_folder,
    format_vcd,
    free_path,
    write_vcd,
)
from trcvtui.plc.ledger import InputEdge, StatusEdge

if hasattr(signal, "SIGPIPE"):
    # vcdvcd lets the whole process die of a closed pipe; every other test wants EPIPE, as Python has it.
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)

INTERVAL = 10_000_000


def read_back(text: str) -> dict[str, list[tuple[int, int | None]]]:
    """Return every signal with its changes (time, value), as vcdvcd reads them."""
    vcd = VCDVCD(vcd_string=text)
    return {
        name: [(t, None if value == "x" else int(value, 2)) for t, value in vcd[name].tv]
        for name in cast("list[str]", vcd.signals)
    }


def whole(run: Run) -> ScanRange:
    return ScanRange(1, run.wave().until_scan)


def test_the_vcd_read_back_has_every_change_of_the_ledger() -> None:
    run = random_run(22, 800)
    told = read_back(format_vcd([run.wave()], whole(run)))
    last: dict[str, int | None] = {}
    written: dict[str, list[tuple[int, int | None]]] = {}
    for line in run.console.bench.runtime.ledger.lines_since(0):
        event = line.event
        if isinstance(event, StatusEdge | InputEdge) and event.instance == RECEIVER:
            for pin, value in event_pins(event):
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
    run.play("pulse TRCV_C_1 COM_RST", 3)
    changes = read_back(format_vcd([run.wave()], whole(run)))[f"{RECEIVER}.COM_RST"]
    (up, one), (down, zero) = changes[-2:]
    assert (one, zero) == (1, 0) and down == up + 1


def test_widths_are_those_of_the_manual() -> None:
    run = connected()
    run.catch_up()
    text = format_vcd([run.wave()], whole(run))
    for words in ("$timescale 1 ns", "reg 16", "reg 32", "wire 1", "module TRCV_C_1"):
        assert words in text


def test_a_vcd_between_two_markers_begins_with_what_the_pins_were() -> None:
    run = connected()
    run.play("peer P1 send random 8 seed=1", 20)
    told = read_back(format_vcd([run.wave()], ScanRange(12, 25)))
    assert told[f"{RECEIVER}.CONT"] == [(0, None), (10 * INTERVAL, 1)]
    assert told[f"{RECEIVER}.DONE"][-2:] != told[f"{RECEIVER}.DONE"][-1:], "the pulse is inside"


def test_an_existing_file_is_not_written_over(tmp_path: Path) -> None:
    run = connected()
    run.catch_up()
    path = tmp_path / "a.vcd"
    assert write_vcd(path, [run.wave()], whole(run)) == path.stat().st_size
    with pytest.raises(UserError, match="is there already"):
        write_vcd(path, [run.wave()], whole(run))
    assert free_path(tmp_path, "a") == tmp_path / "a-2.vcd"
    with pytest.raises(UserError):
        write_vcd(tmp_path / "none" / "b.vcd", [run.wave()], whole(run))


def test_files_go_beside_the_project_but_never_into_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from trcvtui.paths import demo_path

    monkeypatch.chdir(tmp_path)
    (tmp_path / "plant").mkdir()
    assert export_folder(tmp_path / "plant" / "a.toml") == tmp_path / "plant"
    assert export_folder(demo_path()) == tmp_path
