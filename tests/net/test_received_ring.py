"""The newest received bytes of each CONNECT: what a position means, what goes first, what a state has."""

from __future__ import annotations

import random

import pytest

from trcvtui.net import received_ring
from trcvtui.net.received_ring import BLOCK_BYTES, MOST_SKIPPED, ReceivedRings
from trcvtui.recording.state import SharedObjects, decode_state, encode_state


def test_the_newest_bytes_stand_at_their_positions_however_they_came() -> None:
    draw, ring = random.Random(1), ReceivedRings().open_ring("C1", 3 * BLOCK_BYTES)
    sent = b""
    for size in [
        0,
        1,
        BLOCK_BYTES - 1,
        0,
        BLOCK_BYTES,
        2 * BLOCK_BYTES + 5,
        *(draw.randrange(700) for _ in range(100)),
    ]:
        content = draw.randbytes(size)
        assert ring.append(memoryview(content)) == len(sent)
        sent += content
        assert (ring.first, ring.end) == (max(0, len(sent) - 3 * BLOCK_BYTES), len(sent))
        assert ring.read(0, 1 << 40) == sent[ring.first :]
        assert ring.read(ring.end - 300, ring.end - 7) == sent[-300:-7][: max(0, ring.end - 7 - ring.first)]


def test_of_all_rings_the_oldest_bytes_go_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(received_ring, "MOST_RING_BYTES", 4 * BLOCK_BYTES)
    rings = ReceivedRings()
    quiet, busy = rings.open_ring("C1"), rings.open_ring("C2")
    quiet.append(bytes(10))
    busy.append(bytes(4 * BLOCK_BYTES))
    assert (quiet.first, quiet.end, busy.first) == (10, 10, 0)
    quiet.append(b"again")
    assert (quiet.read(0, 99), busy.first) == (b"again", BLOCK_BYTES)
    assert busy.missing_reason == "older than the 64MiB that all histories keep together"


def test_a_ring_that_may_keep_more_says_why_older_bytes_are_gone() -> None:
    rings = ReceivedRings()
    rings.open_ring("C1", BLOCK_BYTES).append(bytes(4 * BLOCK_BYTES))
    assert (
        rings.open_ring("C1", 8 * BLOCK_BYTES).missing_reason
        == "older than what was kept while its history was smaller"
    )


def test_bytes_without_values_have_a_few_places() -> None:
    ring = ReceivedRings().open_ring("C1")
    assert (ring.append(b"ab"), ring.add_unknown(3), ring.add_unknown(1 << 30), ring.end) == (
        0,
        2,
        5,
        5 + MOST_SKIPPED,
    )


def test_a_state_has_no_bytes_and_a_ring_goes_on_where_it_ended() -> None:
    rings = ReceivedRings()
    rings.open_ring("C1", 1 << 16).append(b"before" * 5000)
    state = encode_state(rings, SharedObjects(()))
    assert len(state) < 1000
    restored = decode_state(state, SharedObjects(()), "test")
    ring = restored.get("C1")
    assert (ring.first, ring.end, ring.most) == (30_000, 30_000, 1 << 16)
    assert ring.append(b"after") == 30_000
    assert ring.read(0, 1 << 20) == b"after"
