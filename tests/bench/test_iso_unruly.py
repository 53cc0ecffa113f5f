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


def test_forty_silent_clients_do_not_delay_a_good_one(desk: Desk) -> None:
    desk.say(*[f"peer RAW{n} connect" for n in range(SILENT)], "peer P1 connect")
    since = desk.bench.runtime.scans
    desk.until_status("R", "7006")
    assert desk.bench.runtime.scans - since < SECOND
    assert told(desk, "client dropped")
    assert all("a newer one takes its place" in why for why in told(desk, "client dropped"))


def test_a_cr_that_comes_a_byte_a_second_is_dropped_after_5_s(desk: Desk) -> None:
    connect(desk, "RAW0")
    for byte in CR.split()[:5]:
        desk.say(f"peer RAW0 send hex {byte}", f"run {SECOND}")
    desk.until(lambda: desk.bench.peers["RAW0"].state == "closed")
    assert told(desk, "client dropped") == ["no handshake in 5 s"]
    assert desk.status("R") == "7002"


@pytest.mark.slow
@pytest.mark.parametrize("half", ["03 00 00 09 02 f0 00 61 62", "03 00 00 09 02 f0", "03"])
def test_half_a_message_is_dropped_after_30_s_and_the_next_partner_is_welcome(desk: Desk, half: str) -> None:
    connect_by_hand(desk)
    desk.say(f"peer RAW0 send hex {half}", f"run {29 * SECOND}")
    assert desk.status("R") == "7006"
    desk.until(lambda: desk.status("R") == "80C4", most=2 * SECOND)
    assert told(desk, "session ended") == ["a message that has not ended in 30 s"]
    desk.until_status("R", "7002")
    connect(desk, "P1")
    desk.until_status("R", "7006")
    desk.say("peer P1 send hex 01 02")
    desk.until_done("R")
    assert desk.bench.runtime.outputs("R").rcvd_len == 2


@pytest.mark.slow
def test_endless_dts_are_dropped_at_16_times_the_longest_message(desk: Desk) -> None:
    connect_by_hand(desk)
    desk.say(f"peer RAW0 send hex 03 00 00 84 02 f0 00{' 55' * 125} repeat=8400")
    desk.until(lambda: told(desk, "session ended"))
    assert told(desk, "session ended") == ["a message of more than 1048576 bytes"]


@pytest.mark.parametrize(
    ("sent", "why"),
    [
        ("47 45 54 20 2f", "TPKT version 71"),
        ("03 00 00 85 02 f0 80" + " 55" * 126, "a DT of 129 bytes, 128 are agreed"),
        ("03 00 00 0b 06 80 00 05 44 31 80", "DR, reason 80"),
    ],
    ids=["garbage", "oversize", "DR"],
)
def test_what_cannot_be_right_ends_the_connection_with_a_line(desk: Desk, sent: str, why: str) -> None:
    connect_by_hand(desk)
    desk.say(f"peer RAW0 send hex {sent}")
    desk.until_status("R", "7002")
    assert told(desk, "session ended") == [why]


def test_garbage_in_the_place_of_the_cr_is_dropped_with_a_line(desk: Desk) -> None:
    connect(desk, "RAW0")
    desk.say("peer RAW0 send random 300 seed=1")
    desk.until(lambda: told(desk, "client dropped"))
    assert desk.status("R") == "7002"


def test_a_refused_cr_and_an_ignored_tpdu_have_a_line(desk: Desk) -> None:
    connect(desk, "RAW0")
    desk.say("peer RAW0 send hex 03 00 00 0b 06 10 00 01 00 01 07")
    desk.until(lambda: told(desk, "TPDU ignored"))
    assert told(desk, "TPDU ignored") == ["a TPDU of code 10"]
    desk.say(f"peer RAW0 send hex {CR.replace('c2 02 e0 02', 'c2 02 e0 77')}")
    desk.until(lambda: told(desk, "client dropped"))
    assert told(desk, "client dropped") == ["no CONNECT has the TSAP e0 77"]
