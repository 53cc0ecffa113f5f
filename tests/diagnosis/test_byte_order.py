"""A UDT whose members look swapped: named when it is, silent when it is not."""

from __future__ import annotations

import random
import struct
from pathlib import Path

import pytest

from tests.bench.bench_project import bench_project
from trcvtui.diagnosis.data_view import byte_order_suspicion
from trcvtui.udt.layout.layout import Layout

HEAD = "if?xhi"  # id, speed, flag, mode, t of the Telegram


@pytest.fixture
def telegram(tmp_path: Path) -> Layout:
    """Return the layout of the bench's Telegram: little-endian."""
    decl = bench_project(tmp_path).data_decl("rx")
    assert decl is not None
    return decl.layout


def content(layout: Layout, order: str, number: int, speed: float) -> bytes:
    return struct.pack(order + HEAD, number, speed, True, 7, 1500).ljust(layout.size, b"\0")


def test_swapped_members_are_named_with_both_values(telegram: Layout) -> None:
    suspicion = byte_order_suspicion(telegram, content(telegram, ">", 41, 1234.5))
    assert str(suspicion) == (
        "members look swapped: speed = 1234.5 and id = 41 in big-endian, but 7.40218e-39 and 687865856 "
        "in little-endian, as DATA is read now (and 1 more member)"
    )


def test_a_telegram_in_the_right_order_raises_no_suspicion(telegram: Layout) -> None:
    chance = random.Random(7)
    for _ in range(3000):
        payload = content(telegram, "<", chance.randrange(-9999, 99999), chance.uniform(-1e4, 1e4))
        assert byte_order_suspicion(telegram, payload) is None


def test_a_swapped_telegram_is_suspected_nearly_always(telegram: Layout) -> None:
    chance = random.Random(7)
    found = 0
    for _ in range(3000):
        payload = content(telegram, ">", chance.randrange(1, 9999), chance.uniform(0.5, 1e4))
        found += byte_order_suspicion(telegram, payload) is not None
    assert found > 2700


def test_bytes_by_chance_are_hardly_ever_suspected(telegram: Layout) -> None:
    chance = random.Random(7)
    found = [byte_order_suspicion(telegram, chance.randbytes(telegram.size)) for _ in range(3000)]
    assert sum(one is not None for one in found) < 30


@pytest.mark.parametrize("size", [0, 1, 7, 11])
def test_a_telegram_that_is_cut_short_raises_no_false_alarm(size: int, telegram: Layout) -> None:
    assert byte_order_suspicion(telegram, content(telegram, "<", 41, 1234.5)[:size]) is None


def test_zeros_say_nothing(telegram: Layout) -> None:
    assert byte_order_suspicion(telegram, bytes(telegram.size)) is None
