"""What was answered on a connection is over: no 80A1 and no lock comes of it later."""

from __future__ import annotations

import pytest

from tests.scenario.test_golden_sending import traces

JOINED = (
    "set TRCV_C_1 CONT=1\nrun 3\npeer P1 connect\nwait TRCV_C_1 STATUS=7004\nset TRCV_C_1 EN_R=1\nrun 3\n"
)


@pytest.mark.parametrize(
    ("what_comes", "shown"),
    [
        ("peer P1 close", "80C5! 7002{5}"),
        ("peer P1 rst", "80AA! 7002{5}"),
        ("set TRCV_C_1 COM_RST=1", "8000 7003 7007 7002{3}"),
    ],
)
def test_en_r_that_rose_on_a_connection_gives_no_80a1_when_that_is_gone(what_comes: str, shown: str) -> None:
    trace = traces("passive", f"{JOINED}{what_comes}\nrun 6")["TRCV_C_1"]
    assert trace == f"0001 7001 7002 7004 7006{{3}} {shown}"


def test_en_r_that_rises_again_without_a_connection_still_gives_it() -> None:
    again = "peer P1 close\nset TRCV_C_1 EN_R=0\nrun 3\nset TRCV_C_1 EN_R=1\nrun 3"
    trace = traces("passive", JOINED + again)["TRCV_C_1"]
    assert trace == "0001 7001 7002 7004 7006{3} 7002{3} 80A1! 7002{2}"


def test_en_r_of_urecv_c_that_rose_at_7001_gives_no_80a1_when_another_block_closes_the_socket() -> None:
    steps = "set URECV_C_1 CONT=1\nset USEND_C_1 CONT=1\nrun 3\nset URECV_C_1 EN_R=1\nrun 2\n"
    trace = traces("udp", steps + "set USEND_C_1 CONT=0\nfault socket times=forever\nrun 5")["URECV_C_1"]
    assert trace.startswith("0001 7001{2} 7006{2}") and "80A1!" not in trace


def test_a_usend_c_that_finds_no_buffer_does_not_keep_the_config() -> None:
    second = "create USEND_C USEND_C_2 config=U1 addr=TARGET data=tx CONT=1\nset USEND_C_1 CONT=1\nrun 4\n"
    refused = "fault buffer\npulse USEND_C_1 REQ\nrun 2\npulse USEND_C_2 REQ\nrun 3"
    shown = traces("udp", second + refused)
    assert shown["USEND_C_1"].endswith("80A7! 7001{4}")
    assert shown["USEND_C_2"].endswith("7005 7009 7001")
