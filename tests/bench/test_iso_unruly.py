"""Unruly partners in front of a TRCV_C on ISO-on-TCP: dropped, with a line in the ledger; 10 ms a scan."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.bench.iso_desk import PASSIVE, Desk

RAW = '[[peer]]\nname = "RAW{}"\nremote = "@C1"\n'
SILENT = 40
CR = "03 00 00 16 11 e0 00 00 00 01 00 c1 02 e0 01 c2 02 e0 02 c0 01 07"  # TPDUs of 128 bytes
SECOND = 100  # scans


@pytest.fixture(params=["sim", "live"])
def desk(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Desk]:
    made = Desk(PASSIVE + "".join(RAW.format(n) for n in range(SILENT)), tmp_path, request.param)
    made.say("set R CONT=1 EN_R=1", "run 3")
    yield made
    made.close()


def connect(desk: Desk, peer: str) -> None:
    desk.say(f"peer {peer} connect")
    desk.until(lambda: desk.bench.peers[peer].state == "connected")


def connect_by_hand(desk: Desk) -> None:
    connect(desk, "RAW0")
    desk.say(f"peer RAW0 send hex {CR}")
    desk.until_status("R", "7006")


def told(desk: Desk, what: str) -> list[str]:
    """Return why, of each such line about C1; each names the partner's end."""
    notes = [note for note in desk.notes(what) if note.subject == "C1"]
    assert all(note.end.startswith("127.0.0.1:") for note in notes)
    return [note.detail for note in notes]


def test_a_refused_cr_and_an_ignored_tpdu_have_a_line(desk: Desk) -> None:
    connect(desk, "RAW0")
    desk.say("peer RAW0 send hex 03 00 00 0b 06 10 00 01 00 01 07")
    desk.until(lambda: told(desk, "TPDU ignored"))
    assert told(desk, "TPDU ignored") == ["a TPDU of code 10"]
    desk.say(f"peer RAW0 send hex {CR.replace('c2 02 e0 02', 'c2 02 e0 77')}")
    desk.until(lambda: told(desk, "client dropped"))
    assert told(desk, "client dropped") == ["no CONNECT has the TSAP e0 77"]
