"""Several CONNECTs of ISO-on-TCP after one port: who gets whom, and what stays when one leaves."""

from __future__ import annotations

import pytest

from tests.net.layers.iso_bench import CAP, E001, E002, E003, WAITS, IsoBench
from trcvtui.net.layers.iso_on_tcp import IsoSettings
from trcvtui.net.results import Fault


def test_two_connects_share_a_port_and_each_gets_its_own_partner(b: IsoBench) -> None:
    first = b.iso_listener(IsoSettings(E002, b"", CAP), owner="C1")
    end = b.end(first)
    second = b.iso_listener(IsoSettings(E003, b"", CAP), end, owner="C2")
    assert b.end(second) == end
    to_second = b.call(end, IsoSettings(E001, E003, CAP))
    to_first = b.call(end, IsoSettings(E001, E002, CAP))
    took_second = b.taken(second, IsoSettings(E003, b"", CAP), to_second)
    took_first = b.taken(first, IsoSettings(E002, b"", CAP), to_first)
    assert b.verdict(to_second) is None
    assert b.verdict(to_first) is None
    b.send(to_second, b"for E003")
    b.send(to_first, b"for E002")
    assert b.message(took_second) == (b"for E003", 8)
    assert b.message(took_first) == (b"for E002", 8)


@pytest.mark.parametrize("who_leaves", ["first", "second"])
def test_a_connect_that_leaves_a_shared_port_leaves_it_to_the_other(b: IsoBench, who_leaves: str) -> None:
    first = b.iso_listener(WAITS, owner="C1")
    end = b.end(first)
    second = b.iso_listener(IsoSettings(E003, b"", CAP), end, owner="C2")
    gone, stays, tsap = (first, second, E003) if who_leaves == "first" else (second, first, E002)
    assert b.kernel.close(gone) is None
    caller = b.call(end, IsoSettings(E001, tsap, CAP))
    b.taken(stays, IsoSettings(tsap, b"", CAP), caller)
    assert b.verdict(caller) is None
    assert b.kernel.close(stays) is None
    refused = b.socket()
    fault = b.kernel.connect(refused, end) or b.verdict(refused)
    assert fault == Fault("connect", "ECONNREFUSED")


def test_a_free_port_is_the_same_for_all_and_comes_back(b: IsoBench) -> None:
    first = b.iso_listener(WAITS, owner="C1")
    end = b.end(first)
    second = b.iso_listener(IsoSettings(E003, b"", CAP), owner="C2")
    assert b.end(second) == end
    b.close_all(first, second)
    again = b.iso_listener(WAITS)
    assert b.end(again) == end


def test_who_is_ready_stirs_its_own_connect(b: IsoBench) -> None:
    first = b.iso_listener(WAITS, owner="C1")
    second = b.iso_listener(IsoSettings(E003, b"", CAP), b.end(first), owner="C2")
    caller = b.call(b.end(first), IsoSettings(E001, E003, CAP))

    def waits_for_c2() -> bool:
        b.kernel.connect_result(caller)
        return "C2" in (b.kernel.ready_handles() or {}).values() and b.kernel.readable(second)  # type: ignore[attr-defined]

    b.until(waits_for_c2)
    assert not b.kernel.readable(first)
