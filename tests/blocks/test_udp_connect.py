"""UDP over a connection description beyond the scenarios: ADDR, pictures, run-time changes, mistakes."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests.bench.iso_desk import Desk
from tests.scenario.scenarios import CONFIGS
from trcvtui.commands.table import parse_line
from trcvtui.errors import UserError
from trcvtui.net.events import ConnectionChanged
from trcvtui.plc.ledger import BenchNote, StatusEdge
from trcvtui.project.file import load_project, read_project
from trcvtui.project.st_call import st_call

FILE = CONFIGS / "s7-udp-connect.toml"
BENCH = FILE.read_text()
BY_BYTES = """
[[connect]] # TCON_IP_v4: interface 64, ID 9, type 19, passive, no partner, LocalPort 2009
name = "C1"
bytes = "00 40 00 09 13 00 00 00 00 00 00 00 07 d9"
ListenPort = 0
"""
EVERYBODY = 'RemoteAddress = "127.255.255.255"\nRemotePort = "@P1"'


def tcon(desk: Desk) -> None:
    desk.say("pulse TCON_1 REQ", "run 5")


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_the_source_of_a_datagram_stands_in_addr_and_an_answer_goes_there(
    tmp_path: Path, kernel: str
) -> None:
    desk = Desk(BENCH.replace('addr = "TARGET"', 'addr = "SOURCE"'), tmp_path, kernel)
    tcon(desk)
    desk.say("set TURCV_1 EN_R=1", "run 2", "peer P1 send hex 01 02", "run 2")
    sender = desk.bench.peers["P1"].snapshot().local
    source = desk.bench.runtime.snapshot().addr("SOURCE")
    assert source is not None and (source.end, source.generation) == (sender, 1)
    desk.say("write tx hex 0A 0B 0C 0D", "pulse TUSEND_1 REQ", "run 2")
    assert desk.bench.peers["P1"].snapshot().last_received == b"\x0a\x0b\x0c\x0d"
    desk.close()


def test_the_pictures_say_udp_and_connect(tmp_path: Path) -> None:
    desk = Desk(BENCH, tmp_path)
    tcon(desk)
    snapshot = desk.bench.runtime.snapshot()
    connection, instance = snapshot.connection("C1"), snapshot.instance("TURCV_1")
    assert connection is not None and instance is not None
    assert (connection.udp, connection.state, connection.remote) == (True, "connected", "")
    assert (instance.connect, instance.addr, instance.on_config) == ("C1", "SOURCE", False)
    notes = [line.event for line in desk.bench.runtime.ledger if isinstance(line.event, ConnectionChanged)]
    assert [(note.what, note.detail) for note in notes] == [("listening", "UDP")]
    desk.close()


def test_a_description_of_udp_can_come_as_the_bytes_of_a_db(tmp_path: Path) -> None:
    by_field = BENCH[BENCH.index("[[connect]] # 19") : BENCH.index("[[connect]] # 16#13")]
    desk = Desk(BENCH.replace(by_field, BY_BYTES), tmp_path)
    tcon(desk)
    assert desk.bench.runtime.listening_port("C1")
    desk.close()


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_a_port_without_a_socket_for_broadcasts_receives_and_says_so_and_a_reset_makes_one(
    tmp_path: Path, kernel: str
) -> None:
    everybody = (
        'remote = "@C2"\n[[addr]]\nname = "ALL"\nRemoteAddress = "127.255.255.255"\nRemotePort = "@C1"\n'
    )
    desk = Desk(
        BENCH.replace('remote = "@C2"', everybody).replace('"PARTNER"\ndata = "tx"', '"ALL"\ndata = "tx"'),
        tmp_path,
        kernel,
    )
    desk.say("fault bind EADDRINUSE nth=2 on C1")
    tcon(desk)
    notes = [line.event for line in desk.bench.runtime.ledger if isinstance(line.event, ConnectionChanged)]
    port = desk.bench.runtime.listening_port("C1")
    assert [(note.what, note.detail) for note in notes] == [
        ("option refused", f"no socket for broadcasts: 127.255.255.255:{port}: bind EADDRINUSE (injected)"),
        ("listening", "UDP"),
    ]
    desk.say("set TURCV_1 EN_R=1", "run 2", "peer P1 send hex 01 02", "run 2")
    assert desk.bench.runtime.data("rx")[:2] == b"\1\2"
    desk.say("write tx hex 0A 0B 0C 0D", "set TSEND_C_1 CONT=1", "run 5", "pulse TSEND_C_1 REQ", "run 3")
    assert desk.bench.runtime.data("rx")[:2] == b"\1\2"
    desk.say("pulse T_RESET_1 REQ", "run 5", "pulse TSEND_C_1 REQ", "run 3")
    assert desk.bench.runtime.data("rx")[:4] == b"\x0a\x0b\x0c\x0d"
    desk.close()


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_a_datagram_to_its_own_port_comes_back_as_it_is_no_broadcast(tmp_path: Path, kernel: str) -> None:
    own = '[[addr]]\nname = "OWN"\nRemoteAddress = "127.0.0.1"\nRemotePort = "@C1"\n'
    desk = Desk(BENCH.replace('addr = "TARGET"', 'addr = "OWN"') + own, tmp_path, kernel)
    tcon(desk)
    desk.say("set TURCV_1 EN_R=1", "run 2", "write tx hex 0A 0B 0C 0D", "pulse TUSEND_1 REQ", "run 2")
    assert desk.bench.runtime.data("rx")[:4] == b"\x0a\x0b\x0c\x0d"
    desk.close()


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_a_peer_on_all_addresses_hears_broadcasts_and_lacks_nothing(tmp_path: Path, kernel: str) -> None:
    text = BENCH.replace('RemoteAddress = "127.0.0.1"\nRemotePort = "@P1"', EVERYBODY)
    text = text.replace('name = "P1"\nudp = true', 'name = "P1"\nudp = true\nlocal = "0.0.0.0:0"')
    desk = Desk(text, tmp_path, kernel)
    tcon(desk)
    desk.say("write tx hex 0A 0B 0C 0D", "pulse TUSEND_1 REQ", "run 3")
    assert desk.bench.peers["P1"].snapshot().last_received == b"\x0a\x0b\x0c\x0d"
    notes = [line.event for line in desk.bench.runtime.ledger if isinstance(line.event, BenchNote)]
    assert [note.what for note in notes if note.subject == "P1"] == ["listening", "heard"]
    desk.close()


def test_t_diag_tells_type_19_and_an_endpoint_that_stands(tmp_path: Path) -> None:
    text = BENCH + '[[data]]\nname = "result"\ntype = "ARRAY[0..15] OF BYTE"\n'
    text += '[[instance]]\nname = "D"\nblock = "T_DIAG"\nconnect = "C1"\ndata = "result"\n'
    desk = Desk(text, tmp_path)
    tcon(desk)
    desk.say("write tx hex 01 02 03 04", "pulse TUSEND_1 REQ", "run 3", "pulse D REQ", "run 4")
    kind, active, state = desk.bench.runtime.data("result")[4:7]
    assert (kind, active, state) == (19, 0, 4)
    assert desk.bench.runtime.data("result")[8:12] == (4).to_bytes(4, "big")
    desk.close()


def test_a_port_that_is_taken_is_80a1(tmp_path: Path) -> None:
    text = BENCH.replace("LocalPort = 2000\nListenPort = 0", "LocalPort = 2000")
    text = text.replace('local_tsap_id = "07 d1"\nListenPort = 0', 'local_tsap_id = "07 d0"')
    desk = Desk(text, tmp_path)
    tcon(desk)
    desk.say("set TRCV_C_1 CONT=1", "run 3")
    edges = [line.event for line in desk.bench.runtime.ledger if isinstance(line.event, StatusEdge)]
    assert 0x80A1 in [edge.outputs.status for edge in edges if edge.instance == "TRCV_C_1"]
    desk.close()


def test_a_tcp_port_of_the_same_number_is_no_neighbour(tmp_path: Path) -> None:
    text = BENCH.replace("LocalPort = 2000\nListenPort = 0", "LocalPort = 2000")
    text += '[[connect]]\nname = "T"\ntype = "TCON_IP_v4"\nLocalPort = 2000\n'
    text += '[[instance]]\nname = "R"\nblock = "TRCV_C"\nconnect = "T"\ndata = "rx"\nCONT = true\n'
    desk = Desk(text, tmp_path)
    tcon(desk)
    assert (desk.bench.runtime.listening_port("C1"), desk.bench.runtime.listening_port("T")) == (2000, 2000)
    desk.close()


def test_stop_frees_the_port_and_run_takes_another_socket(tmp_path: Path) -> None:
    desk = Desk(BENCH, tmp_path)
    desk.say("set TRCV_C_1 CONT=1 EN_R=1", "run 5")
    assert desk.status("TRCV_C_1") == "7006"
    desk.say("plc stop", "run 1")
    assert desk.bench.runtime.listening_port("C2") is None
    desk.say("plc run", "run 5", "peer P2 send hex 05", "run 2")
    assert desk.bench.runtime.data("rx")[:1] == b"\5"
    desk.close()


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_a_connect_of_udp_and_its_blocks_can_be_added_to_a_running_bench(tmp_path: Path, kernel: str) -> None:
    desk = Desk(BENCH, tmp_path, kernel)
    desk.say("run 1", "add connect C7 type=TCON_IP_v4 ConnectionType=19 LocalPort=2007 ListenPort=0")
    desk.say("add peer P7 udp=true remote=@C7", "add addr A7 RemoteAddress=127.0.0.1 RemotePort=@P7")
    desk.say("add instance R7 block=TRCV_C connect=C7 addr=A7 data=rx CONT=1 EN_R=1", "run 1")
    desk.say("create TUSEND S7 connect=C7 addr=A7 data=tx", "set S7 LEN=4", "run 5")
    desk.say("peer P7 send hex 07 08", "run 3", "pulse S7 REQ", "run 3")
    assert desk.bench.runtime.data("rx")[:2] == b"\7\x08"
    assert desk.bench.peers["P7"].snapshot().bytes_received == 4
    desk.close()


def test_the_call_in_structured_text_has_connect_and_addr() -> None:
    call = st_call(load_project(FILE), "TSEND_C_1")
    assert "CONNECT:=C2" in call and "ADDR:=PARTNER" in call


MISTAKES = {
    'block = "TUSEND"\nconnect = "C1"': (
        'block = "TUSEND"\nconnect = "C1"\nconfig = "U1"',
        "b.toml: instance TUSEND_1: config: found both a UDP_CONFIG and a CONNECT, expected one of them",
    ),
    'addr = "SOURCE"\n': (
        "",
        "b.toml: instance TURCV_1: addr: found nothing, expected a text in quotes",
    ),
    'remote = "@C2"': ('remote = "@C3"', "b.toml: peer P2: remote: found 'C3', expected one of C1, C2"),
}


@pytest.mark.parametrize("line", MISTAKES)
def test_a_mistake_in_the_file_is_a_line(line: str) -> None:
    instead, said = MISTAKES[line]
    with pytest.raises(UserError) as caught:
        read_project(tomllib.loads(BENCH.replace(line, instead, 1)), "b.toml", Path("."))
    assert said in caught.value.lines()


def test_a_block_without_addr_in_another_vendors_file_has_none() -> None:
    text = (CONFIGS / "passive.toml").read_text().replace('block = "TRCV_C"', 'block = "TRCV_C"\naddr = "A"')
    with pytest.raises(UserError) as caught:
        read_project(tomllib.loads(text), "b.toml", Path("."))
    assert any("addr: found an unknown key" in line for line in caught.value.lines())
    with pytest.raises(UserError):
        parse_line("create TUSEND S2 connect=C1 data=tx", load_project(FILE), "w")


@pytest.mark.parametrize(
    ("optimized", "length", "shown"),
    [(False, 0, "8085"), (False, 4, "7001"), (True, 0, "7001"), (True, 4, "8088")],
)
def test_tusend_wants_its_len_but_for_a_symbolic_data(
    tmp_path: Path, optimized: bool, length: int, shown: str
) -> None:
    of_tx = 'type = "ARRAY[0..3] OF BYTE"\n'
    desk = Desk(BENCH.replace(of_tx, of_tx + "optimized = true\n") if optimized else BENCH, tmp_path)
    tcon(desk)
    desk.say(f"set TUSEND_1 LEN={length}", "pulse TUSEND_1 REQ", "run 1")
    assert desk.status("TUSEND_1") == shown
    desk.close()
