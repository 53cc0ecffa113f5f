"""USEND_C and URECV_C beyond the scenarios: bytes on the wire, ADDR, sleep, a changed program, mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bench.iso_desk import Desk
from tests.scenario.scenarios import CONFIGS
from trcvtui.commands.table import parse_line
from trcvtui.errors import UserError
from trcvtui.project.file import load_project

BENCH = (CONFIGS / "udp.toml").read_text()


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_a_string_with_len_0_is_a_datagram_of_82_bytes(tmp_path: Path, kernel: str) -> None:
    desk = Desk(BENCH.replace("ARRAY[0..3] OF BYTE", "STRING"), tmp_path, kernel)
    desk.say("write tx 'hello'", "set USEND_C_1 CONT=1", "run 2", "pulse USEND_C_1 REQ", "run 2")
    peer = desk.bench.peers["P1"].snapshot()
    assert (peer.bytes_received, len(peer.last_received)) == (82, 82)
    assert peer.last_received == desk.bench.runtime.data("tx")
    desk.close()


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_the_source_of_a_datagram_stands_in_addr_and_in_the_pictures(tmp_path: Path, kernel: str) -> None:
    desk = Desk(BENCH, tmp_path, kernel)
    source = desk.bench.runtime.snapshot().addr("SOURCE")
    assert source is not None and (source.end, source.generation) == ("0.0.0.0:0", 0)
    desk.say("set URECV_C_1 CONT=1 EN_R=1", "run 3", "peer P1 send hex 01 02", "run 1")
    sender = desk.bench.peers["P1"].snapshot().local
    snapshot = desk.bench.runtime.snapshot()
    source, instance, port = (
        snapshot.addr("SOURCE"),
        snapshot.instance("URECV_C_1"),
        snapshot.connection("U1"),
    )
    assert source is not None and (source.end, source.generation) == (sender, 1)
    assert instance is not None and (instance.addr, instance.cause.peer) == ("SOURCE", sender)
    assert port is not None and (port.udp, port.state, port.remote) == (True, "created", sender)
    desk.close()


def test_a_datagram_that_is_here_when_en_r_falls_is_dropped_and_noted(tmp_path: Path) -> None:
    desk = Desk(BENCH, tmp_path)
    desk.say("set URECV_C_1 CONT=1", "run 3", "peer P1 send hex 01 02", "set URECV_C_1 EN_R=1", "run 1")
    assert desk.bench.runtime.job_bytes("URECV_C_1") == b"\1\2"
    desk.say("set URECV_C_1 EN_R=0", "run 2", "set URECV_C_1 EN_R=1", "run 3")
    assert (desk.status("URECV_C_1"), desk.bench.runtime.data("rx")) == ("7006", bytes(8))
    dropped = [line.event for line in desk.bench.runtime.ledger if "Dropped" in type(line.event).__name__]
    assert [(event.size, event.reason) for event in dropped] == [(2, "EN_R fell")]  # type: ignore[union-attr]
    desk.close()


def test_an_empty_datagram_is_a_job_with_no_byte(tmp_path: Path) -> None:
    desk = Desk(BENCH, tmp_path)
    desk.say("set URECV_C_1 CONT=1 EN_R=1", "run 3")
    kernel, peer = desk.bench._kernel, desk.bench.peers["P1"]
    end = desk.bench._listening_end("U1")
    assert end is not None
    assert kernel.send_to(peer.transport._handle, memoryview(b""), end) == 0  # type: ignore[arg-type]
    desk.say("run 1")
    out = desk.bench.runtime.outputs("URECV_C_1")
    assert (out.status, out.done, out.rcvd_len) == (0x7008, True, 0)
    desk.close()


def test_len_and_the_size_of_data_are_latched_and_a_smaller_data_takes_what_fits(tmp_path: Path) -> None:
    desk = Desk(BENCH, tmp_path)
    desk.say("set URECV_C_1 CONT=1 EN_R=1", "run 3", "set URECV_C_1 LEN=1")
    desk.say("peer P1 send hex 01 02 03 04", "resize rx ARRAY[0..1] OF BYTE", "run 1")
    assert (desk.status("URECV_C_1"), desk.bench.runtime.data("rx")) == ("7008", b"\1\2")
    desk.close()


def test_an_instance_deleted_in_mid_job_locks_until_the_socket_is_closed(tmp_path: Path) -> None:
    desk = Desk(BENCH, tmp_path)
    desk.say("set URECV_C_1 CONT=1 EN_R=1", "run 4", "delete URECV_C_1")
    desk.say("create URECV_C R2 config=U1 addr=SOURCE data=rx CONT=1 EN_R=1", "run 3")
    assert desk.status("R2") == "80C3"
    desk.say("set R2 CONT=0", "run 1", "set R2 CONT=1", "run 4")
    assert desk.status("R2") == "7006"
    desk.close()


MISTAKES = {
    'config = "U1"': ("", "instance USEND_C_1: config: found nothing, expected a text in quotes"),
    'addr = "TARGET"': ('addr = "T"', "instance USEND_C_1: addr: found 'T', expected one of TARGET, SOURCE"),
    'RemotePort = "@P1"': (
        'RemotePort = "@U7"',
        "addr TARGET: RemotePort: found 'U7', expected one of P1, U1",
    ),
    "LocalPort = 0": ("LocalPort = 65536", "udp_config U1: LocalPort: found 65536, expected "),
    'remote = "@U1"': ('remote = "@C1"', "peer P1: remote: found 'C1', expected U1"),
    'name = "SOURCE"': ('name = "TARGET"', "addr TARGET: name: found 'TARGET', which an ADDR already has"),
    'name = "P1"': ('name = "U1"', "peer U1: name: found 'U1', which a UDP_CONFIG already has"),
}


@pytest.mark.parametrize("line", MISTAKES)
def test_a_mistake_in_the_file_is_a_line(tmp_path: Path, line: str) -> None:
    instead, said = MISTAKES[line]
    file = tmp_path / "b.toml"
    file.write_text(BENCH.replace(line, instead, 1))
    with pytest.raises(UserError) as caught:
        load_project(file)
    assert any(str(problem).startswith(f"{file}: {said}") for problem in caught.value.problems), [
        str(problem) for problem in caught.value.problems
    ]


def test_a_udp_config_is_set_from_the_command_line() -> None:
    project = load_project(CONFIGS / "udp.toml", ["udp_config.U1.LocalPort=2005", "addr.TARGET.RemotePort=7"])
    config = project.udp_config("U1")
    assert config is not None and config.local.port == 2005
    assert project.addrs[0].remote_port == 7


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("create USEND_C S2 addr=TARGET data=tx", "w: found no config=, expected config= and the name of a "),
        ("create USEND_C S2 config=U1 data=tx", "w: found no addr=, expected addr= and the name of an ADDR"),
        ("link U2 down", "w: found 'U2', expected U1"),
    ],
)
def test_a_mistake_in_a_command_is_a_line(line: str, said: str) -> None:
    with pytest.raises(UserError) as caught:
        parse_line(line, load_project(CONFIGS / "udp.toml"), "w")
    assert str(caught.value.problems[0]).startswith(said)
