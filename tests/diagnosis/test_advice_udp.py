"""Why and what next of URECV_C and USEND_C, with the actual numbers, played on the simulated network."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests.bench.told import Told
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import BLOCKS
from trcvtui.engine.engine import LocalDriver
from trcvtui.project.file import read_project

BENCH = """
dialect = "baosky"
[[data]]
name = "rx"
type = "ARRAY[0..15] OF BYTE"
[[udp_config]]
name = "U1"
LocalAddress = "127.0.0.1"
LocalPort = 2000
[[addr]]
name = "TARGET"
RemoteAddress = "127.0.0.1"
RemotePort = 3000
[[addr]]
name = "SOURCE"
[[instance]]
name = "R"
block = "URECV_C"
config = "U1"
data = "rx"
addr = "SOURCE"
[[instance]]
name = "S"
block = "USEND_C"
config = "U1"
data = "rx"
addr = "TARGET"
[[peer]]
name = "P"
udp = true
local = "127.0.0.1:{local}"
remote = "127.0.0.1:{remote}"
"""
UP = ("set R CONT=1 EN_R=1", "run 4")
SIXTEEN = "waiting for one datagram of at most 16 bytes; none received yet"


def desk(*lines: str, local: int = 3000, remote: int = 2000) -> Told:
    """Return a bench with a UDP peer at these ports, told these lines."""
    told = Told()
    text = BENCH.format(local=local, remote=remote)
    told.driver = LocalDriver(Bench(read_project(tomllib.loads(text), "b.toml", Path(".")), "sim"))
    told.do(*lines)
    return told


SITUATIONS = [
    pytest.param(
        (*UP, "run 100"), 2000, "R",
        f"{SIXTEEN}. The socket is open since scan 2, 1.0 s",
        "P has sent nothing",
        id="nobody sends",
    ),
    pytest.param(
        (*UP, "peer P send hex 01 02", "run 100"), 2001, "R",
        f"{SIXTEEN}. The socket is open since scan 2, 1.0 s",
        "P sends to 127.0.0.1:2001, this socket is at 127.0.0.1:2000: address or port is wrong",
        id="the wrong port",
    ),
    pytest.param(
        (*UP, "run 100"), 2001, "R",
        f"{SIXTEEN}. The socket is open since scan 2, 1.0 s",
        "check whether the partner sends to this address and port",
        id="a partner that is no peer here",
    ),
    pytest.param(
        (*UP, "peer P send random 20 seed=1", "run 100"), 2000, "R",
        f"{SIXTEEN}. The last datagram came 0.9 s ago",
        "LEN is 0 and DATA (rx) has 16 bytes, the only datagram had 20 bytes: 4 bytes of it did not fit and "
        "are lost",
        id="a datagram larger than DATA",
    ),
    pytest.param(
        ("set R LEN=8", *UP, "peer P send random 5 seed=1", "run 9", "peer P send random 5 seed=2", "run 9"),
        2000, "R",
        "waiting for one datagram of at most 8 bytes; none received yet. The last datagram (5 bytes) was "
        "delivered in scan 14, 0.0 s ago",
        "LEN is 8, the last 2 datagrams had 5 bytes. A datagram is a whole job whatever its size: RCVD_LEN "
        "says 5, and DATA keeps older bytes from byte 5 on",
        id="datagrams shorter than LEN",
    ),
    pytest.param(
        ("set R CONT=1", "run 4"), 2000, "R",
        "EN_R is 0",
        "EN_R is 0: datagrams wait in the socket; when it is full the stack drops the newer ones unseen",
        id="EN_R is 0",
    ),
    pytest.param(
        ("set S CONT=1", "run 4", "set S REQ=1", "run 1"), 2000, "S",
        "the local stack has taken 16 of 16 bytes",
        "DONE tells that the local stack took it for 127.0.0.1:3000; UDP does not tell whether it came",
        id="DONE of a datagram",
    ),
    pytest.param(
        ("set S CONT=1", "run 4", "peer P close", "set S REQ=1", "run 2"), 2000, "S",
        "the datagram is with the local stack, 16 of 16 bytes taken, partner 127.0.0.1:3000",
        "it went to 127.0.0.1:3000, and P is closed",
        id="a peer that is closed",
    ),
    pytest.param(
        ("set S CONT=1", "run 4", "set S REQ=1", "run 5"), 2000, "S",
        "the last job has ended; a rising edge of REQ starts the next",
        "REQ stays 1: a job starts with a rising edge only",
        id="REQ stays 1",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("lines", "remote", "instance", "why", "check"), SITUATIONS)
def test_a_situation_is_told_with_its_numbers(
    lines: tuple[str, ...], remote: int, instance: str, why: str, check: str
) -> None:
    told = desk(*lines, remote=remote).of(instance)
    assert told.why.startswith(why)
    assert any(check in line for line in told.checks), told.checks


def test_a_datagram_that_went_to_another_port_than_the_peers_is_named() -> None:
    told = desk("set S CONT=1", "run 4", "set S REQ=1", "run 2", local=3001).of("S")
    assert told.checks == (
        "it went to 127.0.0.1:3000, P receives at 127.0.0.1:3001: address or port in ADDR is wrong",
    )


def test_a_datagram_of_the_past_is_explained_with_the_sizes_of_then() -> None:
    bench = desk(*UP, "peer P send random 5 seed=1", "run 9", "peer P send random 16 seed=1", "run 9")
    assert bench.then("R", Condition.RECEIVED).checks == ()
    bench = desk(*UP, "peer P send random 16 seed=1", "run 9", "peer P send random 5 seed=1", "run 9")
    (told,) = bench.then("R", Condition.RECEIVED).checks
    assert "the last 2 datagrams had 5 to 16 bytes, the newest 5" in told


SIEMENS = BENCH.replace('"baosky"', '"s7-1500"').replace("URECV_C", "TURCV").replace("USEND_C", "TUSEND")


def s7_desk(*lines: str, remote: int = 2000) -> Told:
    """Return a bench with TURCV and TUSEND, told these lines."""
    told = Told()
    text = SIEMENS.format(local=3000, remote=remote)
    told.driver = LocalDriver(Bench(read_project(tomllib.loads(text), "b.toml", Path(".")), "sim"))
    told.do(*lines)
    return told


@pytest.mark.parametrize(
    ("lines", "remote", "instance", "why", "check"),
    [
        (("set R EN_R=1", "run 100"), 2000, "R", SIXTEEN, "`peer P send hex 01`"),
        (
            ("set R EN_R=1", "run 4", "peer P send hex 01 02", "run 100"), 2001, "R", SIXTEEN,
            "P sends to 127.0.0.1:2001, this socket is at 127.0.0.1:2000: address or port is wrong",
        ),
        (("run 4",), 2000, "R", "EN_R is 0", "EN_R is 0: datagrams wait in the socket"),
        (
            ("run 2", "set S LEN=16 REQ=1", "run 1"), 2000, "S", "the local stack has taken 16 of 16 bytes",
            "DONE tells that the local stack took it for 127.0.0.1:3000",
        ),
        (("run 2", "set S LEN=16 REQ=1", "run 5"), 2000, "S", "REQ has not risen", "REQ stays 1"),
    ],
)  # fmt: skip
def test_turcv_and_tusend_are_told_as_the_other_vendors_blocks_are(
    lines: tuple[str, ...], remote: int, instance: str, why: str, check: str
) -> None:
    told = s7_desk(*lines, remote=remote).of(instance)
    assert told.why.startswith(why)
    assert any(check in line for line in told.checks), told.checks


def test_of_two_tusends_in_one_scan_the_second_is_told_of_the_send_side() -> None:
    told, text = Told(), (CONFIGS / "s7-udp.toml").read_text().replace('"NOWHERE"\ndata', '"TARGET"\ndata')
    told.driver = LocalDriver(Bench(read_project(tomllib.loads(text), "b.toml", CONFIGS), "sim"))
    told.do("run 3", "pulse TUSEND_1 REQ", "pulse TUSEND_2 REQ", "run 1")
    advice = told.of("TUSEND_2")
    assert advice.why == "another instance works on this CONNECT, TUSEND_1"
    assert advice.checks[0] == "TUSEND_1 holds the send side of U1"
    assert advice.do == ("wait for its DONE or ERROR; better give each a CONNECT of its own",)


def test_a_block_sends_or_receives_and_its_pins_say_which() -> None:
    assert {"TSEND_C", "TSEND", "TUSEND", "USEND_C"} == {name for name, row in BLOCKS.items() if row.sends}
    assert {"TRCV_C", "TRCV", "TURCV", "URECV_C"} == {name for name, row in BLOCKS.items() if row.receives}
