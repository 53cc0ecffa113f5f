"""Rows of messages: how many are kept, how many cross, which ones have lost their bytes."""

from __future__ import annotations

from itertools import count, islice

import pytest

from tests.history.test_received import ADDED_AGAIN, frames
from tests.history.test_received import talking as reading
from tests.properties.test_history import Generator
from trcvtui.history import messages
from trcvtui.history.messages import MessageRow, MessageRows, NewestRows
from trcvtui.history.records import MAX_SCAN
from trcvtui.net.received_ring import ReceivedRings
from trcvtui.plc.ledger import KEPT_LINES, BenchNote
from trcvtui.tui.view_model.known_messages import KnownMessages


def talking() -> tuple[Generator, MessageRows]:
    told, reader = reading()
    return told, MessageRows(told.bench, told.ledger, reader.streams)


def crossed(rows: NewestRows, known: KnownMessages, until: int = MAX_SCAN) -> int:
    """Let the screen ask until nothing is new; return how many pictures that took."""
    for pictures in range(1, 1000):
        known.accept_rows(rows.make_delta(*known.make_request("X"), until), until)
        if not known.is_behind:
            return pictures
    raise AssertionError("never here")


def contents(rows: list[MessageRow]) -> bytes:
    return b"".join(row.content for row in rows if row.content is not None)


def test_the_screen_gets_each_row_once_and_no_more_than_a_picture_holds() -> None:
    told, rows = talking()
    sent, known = frames(told, 600), KnownMessages()
    assert crossed(rows, known) == 5
    assert [row.number for row in known.rows] == [*range(1, 601)]
    assert contents(known.rows) == sent
    more = frames(told, 3)
    assert crossed(rows, known) == 1
    assert (known.count, contents(known.rows)) == (603, sent + more)
    gaps = [after.t_ns - row.t_ns for row, after in zip(known.rows, known.rows[1:], strict=False)]
    assert [row.gap_ns for row in known.rows] == [None, *gaps]


def test_large_messages_cross_in_more_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(messages, "BYTES_A_PICTURE", 48)
    told, rows = talking()
    sent, known = frames(told, 5), KnownMessages()
    assert crossed(rows, known) == 3
    assert contents(known.rows) == sent


def test_a_row_stays_when_its_bytes_are_gone_and_the_screen_forgets_them_too() -> None:
    told, rows = talking()
    told.bench.runtime.received_ring("C1").most = 240  # type: ignore[union-attr]
    known = KnownMessages()
    frames(told, 10)
    crossed(rows, known)
    assert known.first_full == 0 and all(row.content is not None for row in known.rows)
    sent = frames(told, 4)
    crossed(rows, known)
    assert (known.first_full, len(known.rows), known.rows[3].size) == (4, 14, 24)
    assert [row.content is None for row in known.rows] == [True] * 4 + [False] * 10
    assert contents(known.rows[-4:]) == sent


def test_a_frozen_view_has_the_rows_up_to_its_scan_and_keeps_their_bytes() -> None:
    told, rows = talking()
    told.bench.runtime.received_ring("C1").most = 240  # type: ignore[union-attr]
    known, sent = KnownMessages(), frames(told, 8)
    scan = told.bench.runtime.scans
    crossed(rows, known)
    frames(told, 8)
    crossed(rows, known, scan)
    assert contents(known.rows) == sent
    crossed(rows, known)
    assert (len(known.rows), known.first_full) == (16, 6)


def test_rows_are_bounded_for_an_instance_and_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(messages, "MOST_INSTANCE_ROWS", 20)
    told, rows = talking()
    known = KnownMessages()
    frames(told, 5)
    crossed(rows, known)
    frames(told, 40)
    delta = rows.make_delta("X", 0)
    assert (delta.first, delta.count, len(delta.rows)) == (25, 45, 20)
    crossed(rows, known)
    assert (known.first, known.left_out, len(known.rows)) == (35, 30, 10)
    monkeypatch.setattr(messages, "MOST_ROWS", 10)
    frames(told, 1)
    assert len(rows.make_delta("X", 0).rows) == 20, "one goes for each that comes"


def test_a_job_that_is_cut_says_by_what_and_an_instance_added_again_goes_on() -> None:
    told, rows = talking()
    frames(told, 1)
    told.send(bytes(5), [])
    told.scan(2)
    told.do("peer P1 close")
    told.scan(4)
    for line in ADDED_AGAIN:
        told.do(line)
    told.scan(3)
    told.do("peer P1 connect")
    told.scan(4)
    frames(told, 1)
    found = rows.make_delta("X", 0).rows
    assert [(row.number, row.size, row.reason) for row in found] == [(1, 24, ""), (2, 5, "FIN"), (1, 24, "")]


def test_after_lines_were_overwritten_no_row_and_no_gap_is_guessed() -> None:
    told, rows = talking()
    frames(told, 1)
    told.send(bytes(24), [])
    told.bench.step()
    told.bench.runtime.ledger.write_all([BenchNote("note", "", "")] * (KEPT_LINES + 1))
    told.scan(3)
    frames(told, 1)
    assert [(row.number, row.gap_ns) for row in rows.make_delta("X", 0).rows] == [(1, None), (3, None)]


def test_a_message_of_no_bytes_loses_none_and_hides_no_older_one() -> None:
    rings, known = ReceivedRings(), KnownMessages()
    rows = NewestRows(rings.get)
    for number, size in enumerate((0, 3, 0), 1):
        rows.add_row(
            "X",
            number,
            number,
            number,
            size,
            "U",
            [(rings.open_ring("U").append(bytes(size)), size)] * (size > 0),
            "",
            size,
        )
        crossed(rows, known)
        assert (known.first_full, known.rows[-1].content) == (0, bytes(size))
    rings.open_ring("U").most = 2
    crossed(rows, known)
    assert (known.first_full, [row.content for row in known.rows]) == (2, [b"", None, b""])


def test_where_messages_come_faster_than_they_cross_a_screen_has_many_of_them_in_a_row() -> None:
    rings, known, numbers, here = ReceivedRings(), KnownMessages(), count(1), list[int]()
    rows = NewestRows(rings.get)
    for _ in range(100):
        for number in islice(numbers, 2 * messages.ROWS_A_PICTURE):
            rows.add_row("X", number, number, number, 1, "C", [(rings.open_ring("C").append(b"1"), 1)], "", 1)
        known.accept_rows(rows.make_delta(*known.make_request("X")), MAX_SCAN)
        here.append(len(known.rows))
    assert (
        max(here[50:]) > messages.MOST_INSTANCE_ROWS // 3
        and sum(each == messages.ROWS_A_PICTURE for each in here) <= 5
    )
    assert [row.number for row in known.rows] == [*range(known.first + 1, known.next_number + 1)]
